"""Finds the textures of a PLY, and gives its mesh what Blender does not read."""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.rendering import model_paint
from lightfield.rendering.model_references import FileReference, Survey
from lightfield.rendering.second_readers import ply


def survey(path: Path) -> Survey:
    """Return the textures that the comments of a PLY name.

    Raises `UserError` if its header is broken.
    """
    textures = ply.read_header(path).textures
    return Survey([FileReference(path, name, path.parent / name) for name in textures], [])


def complete(path: Path, mesh: Any) -> tuple[bool, list[str]]:
    """Give a mesh the colours and textures of its PLY that Blender has not read.

    Return whether there are any, and which ones it cannot have, because Blender has left out faces.
    """
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
