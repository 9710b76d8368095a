"""Where a dataset's files lie: its views, passes, reprojections and exports, and its checksums.

A dataset is a folder with lightfield.json, exr/<view>.exr, and reprojections. Each reprojection is
a folder with its own lightfield.json and images.
"""

import re
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from lightfield.core.files import read_bytes, write_text
from lightfield.core.names import IMU, READER
from lightfield.core.paths import inside
from lightfield.formats.lightfield import NAME, OMNIDIRECTIONAL, LightField
from lightfield.formats.passes import FLOW, NAMES, Pass
from lightfield.formats.sensors import SensorSettings, parameter_file, settings_in

IMAGES = "exr"
"""The folder of a dataset's own views."""

FRAME_FOLDERS = "f[0-9]*"
"""The pattern of the folders of a sequence's frames, in a rig's folder."""

OTHER_FILES = "other_files.tar"
"""The tar beside published shards that has the files of no single view."""

CORNERS = "corners.json"
"""The corners of the calibration boards in each view, if the scene has boards."""

SUMS = "sha256sums.txt"
"""The file with a dataset's checksums. Only a valid dataset has it."""

VALIDATION = "validation.json"
OUTPUTS = (VALIDATION, SUMS)
"""The files in a dataset that say whether it is valid, and of which bytes."""

REPORT = "report"
"""The folder in a dataset that is not published with it."""

README = "README.md"
CARD = "card.json"
WALK = "walk.html"
PACKAGED = (README, CARD, READER, WALK)
"""The files that a package adds to a dataset."""

IMU_FILES = (f"{IMU}/imu.csv", f"{IMU}/groundtruth.csv", f"{IMU}/views.csv")
"""The files of an inertial sensor: what it measures, the true motion, and the views' times."""

DEPTH_PICTURE = "{view}_depth.png"
"""The picture that scripts/reproject.py puts beside a view with --depth-png."""


@dataclass(frozen=True)
class Manifest:
    """How to find the files of one kind of export, so that they are published and checked.

    - ``lists``: a glob pattern for the export's lists, which lie beside a lightfield.json.
    - ``pictures``: reads a list, and returns the paths of its images, relative to the list. They
      have the size of the views. Raises `UserError` for a file that is no such list.
    - ``beside``: names with ``{view}`` of images that may lie beside the views and beside these
      pictures. They have the same size.
    - ``files``: returns the SHA-256 of every file of the export, if its list has them.
    """

    lists: str
    pictures: Callable[[Path], Sequence[str]]
    beside: tuple[str, ...] = ()
    files: Callable[[Path], Mapping[str, str]] = lambda _: {}


@dataclass(frozen=True, eq=False)
class ImageSet:
    """The views of one lightfield.json: the dataset's own (``name`` "") or a reprojection's.

    ``source`` are the dataset's own views, from which a reprojection was made.
    """

    name: str
    lightfield: LightField
    source: "ImageSet | None" = None

    @property
    def folder(self) -> str:
        """The folder of its images, relative to the dataset."""
        return self.name or IMAGES

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The suffixes that its views may have, the one with more information first."""
        return (".exr", ".png") if self.name else (".exr",)

    @property
    def prefix(self) -> str:
        """The prefix of its files' paths and of its checks' names."""
        return f"{self.name}/" if self.name else ""

    @cached_property
    def sensor(self) -> SensorSettings | None:
        """The settings of the sensor that developed the views. None if there is none."""
        return settings_in(self.lightfield.content)

    @cached_property
    def views(self) -> list[str]:
        return [view.name for view in self.lightfield.views]

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The positions of its views by their names."""
        return {name: number for number, name in enumerate(self.views)}


@dataclass(frozen=True)
class File:
    """An image file: its ``path`` relative to the dataset, its set, and its view.

    Masks, depth maps and pictures for trainers are not views: their ``view`` is −1. They only need
    to be readable and of their set's size. ``of_pass`` is the pass of the view that the file holds.
    """

    path: str
    set: int
    view: int = -1
    of_pass: Pass | None = None

    @property
    def is_view(self) -> bool:
        """Whether it is a view's picture, not a pass or a picture beside it."""
        return self.view >= 0 and self.of_pass is None


def further_parts(package: Path) -> list[Path]:
    """Return the further parts beside the first part of a package: x.2.tar beside x.tar."""
    tars = package.parent.glob(f"{package.stem}.*.tar")
    # Another rig's name may begin with this rig's name.
    return sorted(tar for tar in tars if re.fullmatch(r"\.\d+", tar.stem[len(package.stem) :]))


def frame_folders(rig: Path) -> list[str]:
    """Return the folders of a sequence's frames in a rig's folder, in the order of time."""
    return sorted(path.parent.name for path in rig.glob(f"{FRAME_FOLDERS}/{NAME}"))


def frame_number(folder: str) -> int:
    """Return the frame of the animation whose folder in a sequence has this name: f00001."""
    return int(folder.removeprefix("f"))


def frame_times(numbers: Sequence[int]) -> list[float]:
    """Return the time of each frame of a sequence: 0 for the first, 1 for the last."""
    first, last = numbers[0], numbers[-1]
    return [(number - first) / max(last - first, 1) for number in numbers]


def read_set(dataset: Path, name: str, source: ImageSet | None = None) -> ImageSet:
    """Read the lightfield.json of a dataset (``name`` "") or a reprojection. Raises `UserError`."""
    lightfield = LightField.read(dataset / name / NAME)
    settings_in(lightfield.content)
    return ImageSet(name, lightfield, source)


def rendered(sets: Sequence[ImageSet]) -> ImageSet | None:
    """Return the set of the rendered views, or None if its lightfield.json could not be read."""
    return sets[0] if sets and not sets[0].name else None


def source_view(source: ImageSet | None, name: str) -> int | None:
    """Return the number of the view from which the reprojected view ``name`` was made.

    Return None if there is no such view.
    """
    numbers = source.numbers if source else {}
    # The names of a light and of a cube map's face follow the view's name.
    while name not in numbers and "_" in name:
        name = name.rpartition("_")[0]
    return numbers.get(name)


def view_files(dataset: Path, image_set: ImageSet, number: int) -> tuple[list[File], list[str]]:
    """Return the existing files of a set's views, and the paths of the missing files.

    ``number`` is the set's place among the sets. A reprojection is EXR, PNG or both: if one view
    has a format, all views must have it.
    """
    present = file_names(dataset / image_set.folder)
    files = []
    missing = []
    for suffix in _formats(image_set, present):
        for view, name in enumerate(image_set.views):
            path = f"{image_set.folder}/{name}{suffix}"
            if name + suffix in present:
                files.append(File(path, number, view))
            else:
                missing.append(path)
    return files, missing


def _formats(image_set: ImageSet, present: Set[str]) -> list[str]:
    """Return the suffixes that any of a set's views has. EXR if no view is there."""
    formats = []
    for suffix in image_set.suffixes:
        if any(view + suffix in present for view in image_set.views):
            formats.append(suffix)
    return formats or [".exr"]


def file_names(folder: Path) -> set[str]:
    """Return the names of the files in a folder."""
    return {path.name for path in folder.glob("*") if path.is_file()}


def pass_files(dataset: Path, sets: Sequence[ImageSet]) -> tuple[list[File], list[str]]:
    """Return the existing files of passes and flow, and the paths of the missing files."""
    files = expected_pass_files(sets)
    present = [file for file in files if (dataset / file.path).is_file()]
    missing = {file.path for file in files} - {file.path for file in present}
    return present, sorted(missing)


def expected_pass_files(sets: Sequence[ImageSet]) -> list[File]:
    """Return the files of passes and flow that the sets must have."""
    files = []
    for number, image_set in enumerate(sets):
        folder = Path(image_set.name)
        for index, view in enumerate(image_set.lightfield.views):
            for view_pass in image_set.lightfield.passes:
                path = view_pass.path(folder, view.name).as_posix()
                files.append(File(path, number, index, view_pass))
            if view.flow:
                path = FLOW.path(folder, view.flow).as_posix()
                files.append(File(path, number, index, FLOW))
    return files


def side_files(sets: Sequence[ImageSet]) -> list[str]:
    """Return the paths of the files beside images: corners, names, parameters, inertial sensors."""
    rendered_set = rendered(sets)
    passes = rendered_set.lightfield.passes if rendered_set else []
    paths = [f"{view_pass.name}/{NAMES}" for view_pass in passes if view_pass.kind == "id"]
    if rendered_set and has_corners(rendered_set.lightfield):
        paths.append(CORNERS)
    if rendered_set and IMU in rendered_set.lightfield.content:
        paths += IMU_FILES
    for image_set in sets:
        if image_set.sensor:
            paths += [f"{image_set.folder}/{parameter_file(view)}" for view in image_set.views]
    return paths


def has_corners(lightfield: LightField) -> bool:
    """Return whether a dataset has corners of calibration boards."""
    has_boards = bool(lightfield.content.get("scene", {}).get("targets"))
    return has_boards and OMNIDIRECTIONAL not in lightfield.content


def read_sums(path: Path) -> dict[str, str]:
    """Return the SHA-256 of each file that a sha256sums.txt names.

    Raises `UserError` for a name that leads out of the folder of the list.
    """
    sums = {}
    for number, line in enumerate(read_bytes(path).decode().splitlines(), 1):
        digest, separator, name = line.partition("  ")
        if separator:
            inside(path.parent, name, f"{path}: line {number}")
            sums[name] = digest
    return sums


def write_sums(path: Path, sums: Mapping[str, str]) -> None:
    """Write the SHA-256 of files by their paths, as sha256sum does."""
    write_text(path, "".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items())))
