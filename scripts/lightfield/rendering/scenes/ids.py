"""Numbers the objects and materials for their passes: the same in every view.

The number of an object is its place in the sorted list of full names, from 1. So it depends on the
.blend alone. Cycles gives all instances of an object the object's number.
`lightfield.rendering.scenes.instances` tells them apart.

Cycles' passes hold Blender's pass index. Shaders and drivers can read it, too. So each block gets
an index that no other block has, and what reads an index computes the file's own from it.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.render_graph import in_render

# Blender's greatest pass index.
MOST = 32767
# Types of objects without a surface.
_WITHOUT_SURFACE = ("ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER")
# The file's own pass index, as a custom property of objects and materials.
_OWN = "plenoforge_pass_index"
_INDEX_OUTPUTS = {"object": "Object Index", "material": "Material Index"}


@dataclass(frozen=True)
class Numbers:
    """The numbers of the open scene's blocks of a kind.

    - ``names``: the number of each block by its full name.
    - ``of_index`` (32768,): uint16, the number of the block with each pass index, 0 for none.
    """

    names: dict[str, int]
    of_index: NDArray[np.uint16]


def assign(kinds: Collection[str]) -> dict[str, Numbers]:
    """Give the blocks of some ``kinds``, "object" and "material", an index of their own.

    Return the numbers of each kind. The scene must be at its frame. Raises `UserError` for too many
    blocks of a kind.
    """
    if not kinds:
        return {}
    own = _own_indices([*bpy.data.objects, *bpy.data.materials])
    for block, index in own.items():
        block[_OWN] = index
        # An Attribute node that asks for the index reads a custom property of this name instead.
        if "pass_index" not in block:
            block["pass_index"] = index
        # Else drivers would not find the new properties.
        block.update_tag()
    _redirect_paths()
    steps: dict[str, list[tuple[int, int]]] = {}
    for kind in kinds:
        blocks = _by_name(kind)
        if len(blocks) > MOST:
            raise UserError(
                f"render.passes: {kind}: the scene has {len(blocks)} {kind}s, and Blender numbers "
                f"{MOST} at most; leave this pass out"
            )
        in_order = sorted(blocks, key=lambda block: own[block])
        of_file = [own[block] for block in in_order]
        is_unique = len({0, *of_file}) == len(of_file) + 1
        indices = of_file if is_unique else range(1, len(of_file) + 1)
        for block, index in zip(in_order, indices, strict=True):
            animation.mute(block, ("pass_index",))
            block.pass_index = index
        if not is_unique:
            steps[kind] = list(zip(indices, of_file, strict=True))
    for material in bpy.data.materials:
        if material.node_tree:
            of_material = {"material": [(0, own[material])]} if "material" in steps else {}
            _restore_indices(material.node_tree, steps | of_material)
    return {kind: _numbers(kind) for kind in kinds}


def _own_indices(blocks: Iterable[Any]) -> dict[Any, int]:
    """Return the pass index that the file gives each of the ``blocks`` at the current frame."""
    own = {block: int(block.pass_index) for block in blocks}
    animated = [block for block in own if "pass_index" in animation.paths(block)]
    if animated:
        # The viewport does not animate what it hides.
        own |= in_render(
            lambda depsgraph: {
                block: int(block.evaluated_get(depsgraph).pass_index) for block in animated
            }
        )
    return own


def _redirect_paths() -> None:
    """Let drivers and Attribute nodes that lead to a pass index read the file's own."""
    for _, block in animation.animated():
        for target in animation.driver_targets(block):
            target.data_path = re.sub(r"(^|\.)pass_index$", f'["{_OWN}"]', target.data_path)
    owners = (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights)
    trees = [*bpy.data.node_groups, *(owner.node_tree for owner in owners if owner.node_tree)]
    for tree in trees:
        for node in tree.nodes:
            if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type != "GEOMETRY":
                node.attribute_name = re.sub(r"\.pass_index$", f'["{_OWN}"]', node.attribute_name)


def _restore_indices(tree: Any, steps: dict[str, list[tuple[int, int]]]) -> None:
    """Let a material's nodes compute the file's own indices from the assigned ones.

    It copies groups that read an index, because other materials and lamps may use them. ``steps``
    holds the argument of `_restored` for each kind.
    """
    for node in list(tree.nodes):
        if getattr(node, "node_tree", None) and _reads_index(node.node_tree):
            node.node_tree = node.node_tree.copy()
            _restore_indices(node.node_tree, steps)
        elif node.bl_idname == "ShaderNodeObjectInfo":
            for kind, kind_steps in steps.items():
                output = node.outputs[_INDEX_OUTPUTS[kind]]
                links = list(output.links)
                own = _restored(tree, output, kind_steps) if links else None
                for link in links:
                    is_muted = link.is_muted
                    tree.links.new(own, link.to_socket).is_muted = is_muted


def _reads_index(tree: Any) -> bool:
    return any(
        any(node.outputs[name].is_linked for name in _INDEX_OUTPUTS.values())
        if node.bl_idname == "ShaderNodeObjectInfo"
        else bool(getattr(node, "node_tree", None)) and _reads_index(node.node_tree)
        for node in tree.nodes
    )


def _restored(tree: Any, index: Any, steps: list[tuple[int, int]]) -> Any:
    """Return the output of new nodes that compute the file's own index from an assigned one.

    ``steps`` are pairs of both, in ascending order. Every number is an integer, and so exact.
    Cycles must not know that a result is constant: it would sample the light in another way.
    """

    def math(operation: str, first: Any, *others: Any) -> Any:
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, (first, *others), strict=False):
            if isinstance(value, float):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return node.outputs[0]

    result = math("MULTIPLY_ADD", index, 0.0, float(steps[0][1]))
    for (_, before), (first, own) in pairwise(steps):
        if own != before:
            is_beyond = math("GREATER_THAN", index, first - 0.5)
            result = math("MULTIPLY_ADD", is_beyond, float(own - before), result)
    return result


def _numbers(kind: str) -> Numbers:
    """Return the numbers of the blocks of a kind, which have an index of their own."""
    names = {}
    of_index = np.zeros(MOST + 1, np.uint16)
    for number, block in enumerate(_by_name(kind), 1):
        names[str(block.name_full)] = number
        of_index[block.pass_index] = number
    # A miss has this index.
    of_index[0] = 0
    return Numbers(names, of_index)


def _by_name(kind: str) -> list[Any]:
    """Return the blocks of a kind that are numbered, in order."""
    if kind == "material":
        blocks = list(bpy.data.materials)
    else:
        blocks = [obj for obj in bpy.data.objects if not has_no_surface(obj)]
    return sorted(blocks, key=lambda block: str(block.name_full))


def has_no_surface(obj: Any) -> bool:
    """Return whether no ray can meet an object of this type."""
    return obj.type in _WITHOUT_SURFACE
