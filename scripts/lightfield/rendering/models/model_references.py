"""The files that a model names, and the folders in which they may lie."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from lightfield.core.errors import UserError
from lightfield.core.files import special_kind


class FileReference(NamedTuple):
    """A file that a model names: where it is named, its name as it stands there, and its path."""

    named_by: Path
    name: str
    path: Path


class Survey(NamedTuple):
    """The files that a model names, and its parts that Blender leaves out."""

    references: list[FileReference]
    left_out: list[str]


def refuse_outside(
    model: Path, references: Iterable[FileReference], shared_folder: str | None
) -> None:
    """Raise `UserError` if a model names a file that is not in its folder, nor in the shared one.

    Subfolders count. Links are followed, so a link in the folder may lead outside. If the model is
    a link, the folder that it leads to is also its own. A missing file publishes nothing.
    """
    folders = [model.parent, Path(os.path.realpath(model)).parent, shared_folder]
    allowed = [os.path.realpath(folder) for folder in folders if folder is not None]
    for reference in references:
        # Path.exists() raises for a path that is too long.
        if not os.path.exists(reference.path):  # noqa: PTH110
            continue
        place = Path(os.path.realpath(reference.path))
        if not any(place.is_relative_to(folder) for folder in allowed):
            by_layer = "" if reference.named_by == model else f"{reference.named_by} "
            raise UserError(
                f"{model}: {by_layer}names {printable(reference.name)}, which is outside the "
                f"model's folder; put a copy into {model.parent}, or name the folder that models "
                f"share: scene: {{shared_folder: {printable(os.path.relpath(place.parent))}}}"
            )


def refuse_special(model: Path, references: Iterable[FileReference]) -> None:
    """Raise `UserError` if a model names a FIFO or a device. Blender might read it without end."""
    for reference in references:
        if kind := special_kind(reference.path):
            raise UserError(
                f"{model}: names {printable(reference.name)}, which is {kind}; put a file there"
            )


def printable(name: str | Path) -> str:
    """Return a name for a message, also if its bytes are not UTF-8."""
    return os.fsencode(name).decode("utf-8", "replace")
