"""Handles Grease Pencil drawings. Blender draws them over what Cycles has rendered."""

from collections.abc import Iterator
from typing import Any

import bpy

from lightfield.core.errors import UserError


def set_up(layer: Any, camera_type: str, has_light_groups: bool = False) -> None:
    """Show drawings only in perspective views, and hide them behind surfaces there.

    Blender draws them in perspective, whatever the lens. It hides them behind surfaces only if the
    view layer has a depth pass. Raises `UserError` for shown drawings with light groups.
    """
    if camera_type != "PERSP":
        layer.use_grease_pencil = False
    elif drawn := _drawings():
        if has_light_groups:
            raise UserError(
                f"render.light_groups: {drawn[0].name_full} is Grease Pencil, which is drawn over "
                "the colour and is in no light group; make it a mesh, or remove it"
            )
        layer.use_pass_z = True


def warnings(camera_type: str) -> Iterator[str]:
    """Yield a line if the views of a camera of this type lack drawings, or passes of them.

    The viewport must show what is rendered: see `viewport.show_what_is_rendered`.
    """
    shown = sorted(str(obj.name_full) for obj in _drawings() if not obj.hide_viewport)
    if not shown:
        return
    names = f"{', '.join(shown[:8])}{' …' if len(shown) > 8 else ''}"
    if camera_type != "PERSP":
        yield (
            f"Grease Pencil is left out: {names}: Blender draws it through perspective lenses "
            "alone; give the rig a rectilinear lens, or make the drawing a mesh"
        )
    else:
        yield (
            f"Grease Pencil is only in the colour: {names}: no depth and no pass has it; make the "
            "drawing a mesh if they need it"
        )


def _drawings() -> list[Any]:
    return [obj for obj in bpy.data.objects if obj.type == "GREASEPENCIL"]
