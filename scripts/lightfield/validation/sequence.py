"""Checks the exports of a whole sequence, which lie in the rig's folder beside its frames.

`validate_sequence` checks that each export has its files, with their bytes and the views' size. The
frames themselves are datasets, which `validate` checks.
"""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, sha256
from lightfield.formats.export_lists import IN_FOLDERS, MANIFEST
from lightfield.formats.layout import REPORT, frame_folders
from lightfield.formats.lightfield import NAME, LightField
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.validation.files import (
    ListedFiles,
    listed_files,
    present_files,
    set_strays_aside,
    stray_problems,
    strays_among,
)
from lightfield.validation.result import Check, Result

LISTS = (f"exports/*/{MANIFEST}", f"*/exports/*/{MANIFEST}")


def export_lists(rig: Path) -> list[Path]:
    """Return the lists of all exports of the whole sequence in a rig's folder."""
    frames = frame_folders(rig)
    lists = [path for pattern in LISTS for path in rig.glob(pattern)]
    return sorted(path for path in lists if path.relative_to(rig).parts[0] not in frames)


def validate_sequence(rig: Path, frames: Sequence[str], lists: Sequence[Path]) -> Result:
    """Check the exports of the sequence in a rig's folder.

    - ``frames``: the folders of the frames in it.
    - ``lists``: the export.json of each export that it must have.

    The result holds all faults, and the checksums of the exports' files.
    """
    rig = absolute_path(rig)
    owned: list[str] = []
    intact: list[str] = []
    problems: list[str] = []
    views = 0
    for path in map(absolute_path, lists):
        try:
            owned += _owned(rig, path)
            listed = listed_files(rig, path, IN_FOLDERS)
            first = _first_frame(rig, path, frames)
        except UserError as error:
            problems.append(str(error))
            continue
        intact += [path.relative_to(rig).as_posix(), *listed.other_files]
        problems += [*listed.problems, *_picture_faults(rig, listed, first.lens)]
        views += len(frames) * len(first.views)
    exports = Check(
        "exports",
        not problems if lists else None,
        f"{len(lists)} exports of {len(frames)} frames",
        problems=[problem.replace(f"{rig}/", "") for problem in problems],
    )
    strays = stray_problems(rig, _strays(rig, frames, owned), "sequence")
    files = Check("files", not strays, f"{len(intact)} files", problems=strays)
    digests = {path: sha256(rig / path) for path in sorted(intact)}
    return Result(f"{rig.parent.name}/{rig.name}", views, [exports, files], digests)


def remove_strays(rig: Path, frames: Collection[str], lists: Sequence[Path], folder: Path) -> None:
    """Move former exports out of a rig's folder into ``folder``.

    Moves nothing if a list of an export cannot be read.
    """
    owned: list[str] = []
    for path in map(absolute_path, lists):
        try:
            owned += _owned(absolute_path(rig), path)
        except UserError:
            return
    set_strays_aside(rig, _strays(rig, frames, owned), folder)


def _owned(rig: Path, path: Path) -> list[str]:
    """Return an export's list and the files in it, by their paths in the rig's folder."""
    folder = path.parent.relative_to(rig)
    return [(folder / name).as_posix() for name in (path.name, *IN_FOLDERS.files(path))]


def _strays(rig: Path, frames: Collection[str], owned: Collection[str]) -> list[str]:
    """Return the files in a rig's folder that are of no frame and of no export."""
    return strays_among(rig, present_files(rig, {*frames, REPORT}), owned)


def _first_frame(rig: Path, path: Path, folders: Sequence[str]) -> LightField:
    """Return the views of an export's source in the first frame.

    Raises `UserError` if another frame has another lens or other views.
    """
    source = path.parents[2].relative_to(rig)
    lightfields = [LightField.read(rig / folder / source / NAME) for folder in folders]
    if len(lightfields) < 2:
        raise UserError(f"{path}: exports a sequence, which must have two frames or more")
    first = lightfields[0]
    names = [view.name for view in first.views]
    for lightfield in lightfields:
        if lightfield.lens != first.lens or [view.name for view in lightfield.views] != names:
            problem = "has another lens or other views than the first frame"
            raise UserError(f"{lightfield.path}: {problem}")
    return first


def _picture_faults(rig: Path, listed: ListedFiles, lens: Lens) -> Iterator[str]:
    """Yield the pictures that cannot be read, or that do not have the size of the views."""
    for picture in listed.pictures:
        try:
            header = images.read_header(rig / picture)
        except UserError as error:
            yield str(error)
            continue
        if (header.width, header.height) != (lens.width, lens.height):
            size = f"{header.width} × {header.height}"
            yield f"{picture}: is {size}; must be {lens.width} × {lens.height}"
