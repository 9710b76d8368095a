"""The numbers by which the passes of objects and materials name them: the same in every view.

They are places in the sorted list of full names, from 1, and so follow from the .blend alone.
Cycles gives all instances of one object the number of that object; what keeps them apart is in
`lightfield.rendering.instances`.
"""

from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.rendering import animation

# Blender's greatest index.
MOST = 32767
# What these are has no surface.
_WITHOUT_SURFACE = ("ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER")


def assign(kind: str) -> None:
    """Number the blocks of a ``kind``, "object" or "material"; `UserError` for too many."""
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
    """Return the numbers that `assign` has given, by full name."""
    numbers = {str(block.name_full): int(block.pass_index) for block in _blocks(kind)}
    return dict(sorted(numbers.items(), key=lambda item: item[1]))


def _blocks(kind: str) -> list[Any]:
    if kind == "material":
        return list(bpy.data.materials)
    return [thing for thing in bpy.data.objects if not has_no_surface(thing)]


def has_no_surface(thing: Any) -> bool:
    """Whether an object is of a type that no ray can meet."""
    return thing.type in _WITHOUT_SURFACE
