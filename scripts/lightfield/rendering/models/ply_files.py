"""Finds the textures that a PLY names."""

from pathlib import Path

from lightfield.rendering.models.model_references import FileReference, Survey
from lightfield.rendering.models.second_readers import ply


def survey(path: Path) -> Survey:
    """Return the textures that the comments of a PLY name.

    Raises `UserError` if its header is broken.
    """
    textures = ply.read_header(path).textures
    return Survey([FileReference(path, name, path.parent / name) for name in textures], [])
