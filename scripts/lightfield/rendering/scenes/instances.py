"""Numbers the instances that collections, particles and geometry nodes make of objects.

Blender gives each instance a random number. It depends only on the names and the places in lists
that lead to the instance. So it is the same in every view, frame, process and machine. Cycles
passes it to shaders as Object Info's Random. Here every material writes it into extra passes. As a
float it has 24 bits: of n instances of an object, about n² / 5e7 pairs share a number. An object
that is not an instance has its number of `lightfield.rendering.scenes.ids`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.rendering.scenes.ids import Numbers, has_no_surface
from lightfield.rendering.scenes.render_graph import in_render

Array = NDArray[Any]

# A ray passes through surfaces that transparency cuts out, and each of them writes a number. There
# are channels for this many layers.
_LAYERS = 12
_COLOURS = [f"plenoforge_instance_{number}" for number in range(_LAYERS // 3)]
_COUNT = "plenoforge_layers"
# The passes of Cycles with the numbers, and their channels.
CYCLES_PASSES = {**dict.fromkeys(_COLOURS, "RGB"), _COUNT: "X"}
_LARGEST = 2**32 - 2**8
_NO_INDEX = 2**31 - 1


@dataclass(frozen=True)
class Instances:
    """The objects and the instances that the scene shows at a frame.

    - ``names``: the number of each by its name.
    - ``numbers`` (n,): the same numbers in order.
    - ``objects`` (n,): the numbers of their objects.
    - ``shown_itself``: by an object's number, that number if the object itself is shown, else 0.
    """

    names: dict[str, int]
    numbers: Array
    objects: Array
    shown_itself: Array

    def decoded(self, passes: Mapping[str, Array], objects: Array) -> Array:
        """Return the number (height, width) uint32 of what each pixel shows. 0 if unknown.

        ``passes`` holds the `CYCLES_PASSES` by name. ``objects`` (height, width) are the objects'
        numbers. Surfaces without a material, and surfaces beyond the last layer, write no number.
        They get the object's number, if the object itself is shown.
        """
        layers = np.concatenate([passes[name] for name in _COLOURS], axis=-1).astype(np.float64)
        last = passes[_COUNT].astype(int).clip(1, _LAYERS) - 1
        random = np.take_along_axis(layers, last, axis=-1)[..., 0]
        numbers = np.rint(random * 2.0**32).clip(0, _LARGEST).astype(np.uint32)
        # Accept a number only if it is one of this object's.
        keys = self.numbers * 2**16 + self.objects
        pixel_keys = numbers.astype(np.int64) * 2**16 + objects
        place = np.searchsorted(keys, pixel_keys).clip(0, len(keys) - 1)
        return np.where(keys[place] == pixel_keys, numbers, self.shown_itself[objects])


def write_numbers(layer: Any) -> None:
    """Make every material of the scene write the numbers into new passes of the layer."""
    group = _node_group()
    for material in bpy.data.materials:
        if material.node_tree:
            material.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    for name, channels in CYCLES_PASSES.items():
        aov = layer.aovs.add()
        aov.name = name
        aov.type = "VALUE" if channels == "X" else "COLOR"


def _node_group() -> Any:
    """Return nodes that write the number into the channel of the ray's current layer."""
    tree = bpy.data.node_groups.new("plenoforge_instance", "ShaderNodeTree")
    nodes = tree.nodes
    link = tree.links.new
    random = nodes.new("ShaderNodeObjectInfo").outputs["Random"]
    depth = nodes.new("ShaderNodeLightPath").outputs["Transparent Depth"]
    for first, name in enumerate(_COLOURS):
        output = nodes.new("ShaderNodeOutputAOV")
        colour = nodes.new("ShaderNodeCombineXYZ")
        output.aov_name = name
        link(colour.outputs[0], output.inputs["Color"])
        for place in range(3):
            is_here = nodes.new("ShaderNodeMath")
            number = nodes.new("ShaderNodeMath")
            is_here.operation = "COMPARE"
            number.operation = "MULTIPLY"
            link(depth, is_here.inputs[0])
            is_here.inputs[1].default_value = 3 * first + place
            is_here.inputs[2].default_value = 0.5
            link(is_here.outputs[0], number.inputs[0])
            link(random, number.inputs[1])
            link(number.outputs[0], colour.inputs[place])
    count = nodes.new("ShaderNodeOutputAOV")
    count.aov_name = _COUNT
    count.inputs["Value"].default_value = 1
    return tree


def shown(objects: Numbers) -> Instances:
    """Return what the open scene shows at its frame. ``objects`` are the objects' numbers."""
    entries = in_render(lambda depsgraph: _entries(depsgraph, objects))
    shown_itself = np.zeros(len(objects.names) + 1, np.uint32)
    for number, object_number, is_instance in entries.values():
        if not is_instance:
            shown_itself[object_number] = number
    names = {name: number for name, (number, *_) in sorted(entries.items())}
    pairs = sorted((number, object_number) for number, object_number, _ in entries.values())
    numbers, object_numbers = np.array(pairs, np.int64).reshape(-1, 2).T
    return Instances(names, numbers, object_numbers, shown_itself)


def _entries(depsgraph: Any, objects: Numbers) -> dict[str, tuple[int, int, bool]]:
    """Return by name the number, the object's number, and whether it is an instance."""
    entries = {}
    for entry in depsgraph.object_instances:
        if not has_no_surface(entry.object.original):
            name, number, object_number = name_and_numbers(entry, objects)
            entries[name] = (number, object_number, bool(entry.is_instance))
    return entries


def name_and_numbers(entry: Any, objects: Numbers) -> tuple[str, int, int]:
    """Return the name, the number and the object's number of an entry of a dependency graph."""
    obj = entry.object.original
    object_number = int(objects.of_index[obj.pass_index])
    if entry.is_instance:
        random_number = int(np.float32(entry.random_id & 0xFFFFFFFF))
        return name_of(entry), min(random_number, _LARGEST), object_number
    return name_of(entry), object_number, object_number


def name_of(entry: Any) -> str:
    """Return the name of an entry of a dependency graph: an object's, or an instance's."""
    name = str(entry.object.original.name_full)
    if not entry.is_instance:
        return name
    places = [str(place) for place in entry.persistent_id if place != _NO_INDEX]
    return f"{entry.parent.name_full} > {name} {' '.join(places)}"
