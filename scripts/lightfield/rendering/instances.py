"""The numbers that keep instances apart: those of collections, particles and geometry nodes, too.

Blender gives each instance a random number, made of the names and places in lists that lead to it,
and Cycles hands it to the shader as Object Info's Random. Here every material writes it into passes
of its own, and so it is the same in every view, frame, process and machine. As a float it has 24
bits: of n instances of an object some n² / 5e7 pairs have one number. An object that is no instance
has its own.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.rendering.ids import has_no_surface
from lightfield.rendering.render_graph import in_render

Array = NDArray[Any]

# A ray goes through what is cut out, and each layer writes: so many, each a channel of its own.
LAYERS = 12
_COLOURS = [f"plenoforge_instance_{number}" for number in range(LAYERS // 3)]
_COUNT = "plenoforge_layers"
# What of Cycles' passes has the numbers.
CYCLES_PASSES = {**dict.fromkeys(_COLOURS, "RGB"), _COUNT: "X"}
_LARGEST = 2**32 - 2**8
_NO_INDEX = 2**31 - 1


@dataclass(frozen=True)
class Instances:
    """What the scene shows at a frame: objects themselves, and instances of them.

    ``names`` maps the name of each to its number. ``numbers`` (n,) are the same numbers in order,
    and ``objects`` (n,) the indices of their objects. ``shown_itself`` holds, by the index of an
    object, the number of the object that is shown itself, or 0.
    """

    names: dict[str, int]
    numbers: Array
    objects: Array
    shown_itself: Array


def set_up(layer: Any) -> None:
    """Let every material of the scene write the numbers, and the layer have passes for them."""
    shown.cache_clear()
    group = _node_group()
    for material in bpy.data.materials:
        if material.node_tree:
            material.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    for name, channels in CYCLES_PASSES.items():
        aov = layer.aovs.add()
        aov.name = name
        aov.type = "VALUE" if channels == "X" else "COLOR"


def _node_group() -> Any:
    """Return nodes that write the number into the channel of the layer that the ray has come to."""
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
            is_here.operation, number.operation = "COMPARE", "MULTIPLY"
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


@cache
def shown() -> Instances:
    """Return what the opened scene shows at its frame."""
    entries = in_render(_entries)
    shown_itself = np.zeros(
        max((thing.pass_index for thing in bpy.data.objects), default=0) + 1, np.uint32
    )
    for number, index, is_instance in entries.values():
        if not is_instance:
            shown_itself[index] = number
    names = {name: number for name, (number, *_) in sorted(entries.items())}
    pairs = sorted((number, index) for number, index, _ in entries.values())
    numbers, objects = np.array(pairs, np.int64).reshape(-1, 2).T
    return Instances(names, numbers, objects, shown_itself)


def _entries(depsgraph: Any) -> dict[str, tuple[int, int, bool]]:
    """Return by name each thing's number, its object's index, and whether it is an instance."""
    entries = {}
    for entry in depsgraph.object_instances:
        thing = entry.object.original
        if has_no_surface(thing):
            continue
        name = str(thing.name_full)
        number = int(thing.pass_index)
        if entry.is_instance:
            places = [str(place) for place in entry.persistent_id if place != _NO_INDEX]
            name = f"{entry.parent.name_full} > {name} {' '.join(places)}"
            number = min(int(np.float32(entry.random_id & 0xFFFFFFFF)), _LARGEST)
        entries[name] = (number, int(thing.pass_index), bool(entry.is_instance))
    return entries


def decoded(passes: dict[str, Array], objects: Array) -> Array:
    """Return the number (h, w) uint32 of what each pixel shows; 0 where it is not known.

    ``passes`` are those of `CYCLES_PASSES`, ``objects`` (h, w) the objects' indices. What a surface
    without a material shows is not written, nor beyond the last layer: there it is the object, if
    that is shown itself.
    """
    instances = shown()
    layers = np.concatenate([passes[name] for name in _COLOURS], axis=-1).astype(np.float64)
    last = passes[_COUNT].astype(int).clip(1, LAYERS) - 1
    random = np.take_along_axis(layers, last, axis=-1)[..., 0]
    numbers = np.rint(random * 2.0**32).clip(0, _LARGEST).astype(np.uint32)
    # Only where it is a number of this object.
    keys = instances.numbers * 2**16 + instances.objects
    wanted = numbers.astype(np.int64) * 2**16 + objects
    place = np.searchsorted(keys, wanted).clip(0, len(keys) - 1)
    return np.where(keys[place] == wanted, numbers, instances.shown_itself[objects])
