"""Gives the open scene the colours and textures of a model that Blender's importers do not read."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from lightfield.rendering.imports import model_paint
from lightfield.rendering.models.second_readers import ply, stl


def complete(path: Path) -> tuple[bool, list[str]]:
    """Give the imported mesh of a PLY or an STL its colours or textures.

    Return whether there are any, and which ones it cannot have, because Blender has left out faces.
    """
    functions = {".ply": _complete_ply, ".stl": _complete_stl}
    function = functions.get(path.suffix.lower())
    if function is None or not bpy.data.meshes:
        return False, []
    (mesh,) = bpy.data.meshes
    return function(path, mesh)


def _complete_ply(path: Path, mesh: Any) -> tuple[bool, list[str]]:
    content = ply.read_content(path)
    has_textures = bool(content.textures) and content.uvs is not None
    colours = None if has_textures or mesh.color_attributes else content.colours
    if not has_textures and colours is None:
        return False, []
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    if not np.array_equal(corners, content.corners):
        part = "textures" if has_textures else "colours"
        return True, [f"its {part}, because Blender leaves out some of its faces"]
    if colours is not None:
        model_paint.give_colours(mesh, colours)
    elif content.uvs is not None:
        textures = [path.parent / name for name in content.textures]
        model_paint.give_textures(mesh, textures, content.uvs, content.texture_of_face)
    return True, []


def _complete_stl(path: Path, mesh: Any) -> tuple[bool, list[str]]:
    facets, colours = stl.read_facets(path)
    if colours is None:
        return False, []
    if len(mesh.polygons) != len(facets):
        return True, ["the colours of facets, because Blender leaves out some of them"]
    model_paint.give_colours(mesh, np.repeat(colours, 3, axis=0))
    return True, []
