"""Estimates how many faces modifiers make, before Blender makes them."""

from typing import Any

import bpy

from lightfield.core import memory, units
from lightfield.core.errors import UserError

# Blender takes at least this for a face of a subdivided mesh, and 108 bytes were measured.
_BYTES_OF_FACE = 100


def refuse_too_many_faces() -> None:
    """Raise `UserError` if an object of the open file gets faces that do not fit into memory.

    Blender would take minutes, and then end with a signal.
    """
    available = memory.available()
    for obj in (obj for obj in bpy.data.objects if obj.type == "MESH"):
        faces = faces_of(obj)
        size = faces * _BYTES_OF_FACE
        if size > available:
            names = ", ".join(modifier.name for modifier in obj.modifiers if modifier.show_render)
            raise UserError(
                f"the object {obj.name} gets {faces:.2g} faces by its modifiers ({names}), which "
                f"take {units.size(size)} or more of this machine's {units.size(available)} of "
                "memory; lower their counts, or their levels for renders"
            )


def faces_of(obj: Any) -> int:
    """Return how many faces a mesh has after modifiers that multiply them. Others may add more."""
    faces, corners = len(obj.data.polygons), len(obj.data.loops)
    for modifier in obj.modifiers:
        if not modifier.show_render:
            continue
        factor = 1
        match modifier.type:
            case "ARRAY" if modifier.fit_type == "FIXED_COUNT":
                factor = modifier.count
            case "MIRROR":
                factor = 2 ** sum(modifier.use_axis)
            case "SUBSURF" | "MULTIRES" if levels := _levels(modifier):
                # The first level makes a face of each corner, and each other level four of a face.
                faces, factor = corners, 4 ** (levels - 1)
                corners *= 4
        faces *= factor
        corners *= factor
    return faces


def _levels(modifier: Any) -> int:
    """Return how often a render subdivides each face."""
    render = bpy.context.scene.render
    levels: int = modifier.render_levels
    return min(levels, render.simplify_subdivision_render) if render.use_simplify else levels
