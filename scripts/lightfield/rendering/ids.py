"""Numbers the objects and materials for their passes: the same in every view.

A number is the place in the sorted list of full names, from 1. So it depends on the .blend alone.
Cycles gives all instances of an object the object's number. `lightfield.rendering.instances` tells
them apart.
"""

from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.rendering import animation

# Blender's greatest pass index.
MOST = 32767
# Types of objects without a surface.
_WITHOUT_SURFACE = ("ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER")


def assign(kind: str) -> None:
    """Number the blocks of a ``kind``, "object" or "material". Raises `UserError` for too many."""
    blocks = sorted(_blocks(kind), key=lambda block: str(block.name_full))
    if len(blocks) > MOST:
        raise UserError(
            f"render.passes: {kind}: the scene has {len(blocks)} {kind}s, and Blender numbers "
            f"{MOST} at most; leave this pass out"
        )
    for number, block in enumerate(blocks, 1):
        animation.mute(block, ("pass_index",))
        block.pass_index = number


def names(kind: str) -> dict[str, int]:
    """Return the numbers from `assign`, by full name."""
    numbers = {str(block.name_full): int(block.pass_index) for block in _blocks(kind)}
    return dict(sorted(numbers.items(), key=lambda item: item[1]))


def _blocks(kind: str) -> list[Any]:
    if kind == "material":
        return list(bpy.data.materials)
    return [obj for obj in bpy.data.objects if not has_no_surface(obj)]


def has_no_surface(obj: Any) -> bool:
    """Return whether no ray can meet an object of this type."""
    return obj.type in _WITHOUT_SURFACE
