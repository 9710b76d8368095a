"""Reads the light fields of a scene's rigs, for a list of the whole scene."""

from collections.abc import Iterable
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path
from lightfield.formats.lightfield import LightField


def read_lightfields(paths: Iterable[Path], output: Path) -> dict[str, LightField]:
    """Return light fields by their folders in the scene's folder, which has the list ``output``.

    Raises `UserError` for a rig outside the scene's folder.
    """
    scene = absolute_path(output).parent
    lightfields = {}
    for path in paths:
        lightfield = LightField.read(path)
        folder = absolute_path(path).parent
        if not folder.is_relative_to(scene):
            raise UserError(f"{lightfield.path}: must be in {scene}, where --output is")
        lightfields[folder.relative_to(scene).as_posix()] = lightfield
    return lightfields
