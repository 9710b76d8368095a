"""Checks the exports of a whole sequence, which lie in the rig's folder beside those of the frames.

`validate_sequence` reads each export back, and compares it with the lightfield.json, the depth and
the pass motion of every frame. The frames themselves are datasets, which `validate` checks.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, sha256
from lightfield.dataset.exports import MANIFEST
from lightfield.dataset.lightfield import NAME, View
from lightfield.dataset.passes import PASSES
from lightfield.geometry.flow import shorter
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.validation import exported_cameras
from lightfield.validation.depth_questions import converted
from lightfield.validation.exported_cameras import Expected, SetExport
from lightfield.validation.exported_depth import ExportedDepth
from lightfield.validation.files import (
    File,
    ImageSet,
    ListedFiles,
    Manifest,
    listed_files,
    present_files,
    read_sets,
    set_strays_aside,
    stray_problems,
    strays_among,
)
from lightfield.validation.pixels import Examiner
from lightfield.validation.readers import read_sequence
from lightfield.validation.readers.contents import Exported, Floats, Flow
from lightfield.validation.result import Check, Result

LISTS = (f"exports/*/{MANIFEST}", f"*/exports/*/{MANIFEST}")
# The exports that number the cameras. cam00 tests.
NUMBERED = ("colmap_frames", "neural_3d_video")
# Flow must lead as exactly to where the pass motion leads, in pixels.
_FLOW_PIXELS = 0.01


@dataclass(frozen=True)
class Frame:
    """A frame of a sequence: its folder, and the views of the export's source there.

    ``sets`` are the rendered views, and those of the source if it is a reprojection.
    """

    folder: Path
    sets: Sequence[ImageSet]

    @property
    def views(self) -> ImageSet:
        return self.sets[-1]

    @property
    def number(self) -> int:
        """The frame of the animation."""
        return int(self.views.lightfield.content["frame"])


def frame_folders(rig: Path) -> list[str]:
    """Return the folders of a sequence's frames in a rig's folder, in the order of time."""
    return sorted(path.parent.name for path in rig.glob(f"f[0-9]*/{NAME}"))


def export_lists(rig: Path) -> list[Path]:
    """Return the lists of all exports of the whole sequence in a rig's folder."""
    frames = frame_folders(rig)
    lists = [path for pattern in LISTS for path in rig.glob(pattern)]
    return sorted(path for path in lists if path.relative_to(rig).parts[0] not in frames)


def validate_sequence(
    rig: Path, frames: Sequence[str], lists: Sequence[Path], manifest: Manifest
) -> Result:
    """Check the exports of the sequence in a rig's folder.

    - ``frames``: the folders of the frames in it.
    - ``lists``: the export.json of each export that it must have.
    - ``manifest``: how to read such a list.

    The result holds all faults. Its checksums are those of the exports' files.
    """
    rig = absolute_path(rig)
    owned: list[str] = []
    intact: list[str] = []
    problems: dict[str, list[str]] = {"exports": [], "exported_cameras": [], "exported_depth": []}
    views = 0
    for path in map(absolute_path, lists):
        try:
            owned += _owned(rig, path, manifest)
            listed = listed_files(rig, path, manifest)
            frames_read = _read_frames(rig, path, frames)
            lens = frames_read[0].views.lightfield.lens
            numbers = {frame.folder.name: frame.number for frame in frames_read}
            name, exported = read_sequence(path, (lens.width, lens.height), numbers)
        except UserError as error:
            problems["exports"].append(str(error))
            continue
        intact += [path.relative_to(rig).as_posix(), *listed.other_files]
        problems["exports"] += [*listed.problems, *_picture_faults(rig, listed, lens)]
        for frame, content in zip(frames_read, exported, strict=True):
            views += len(content.views)
            problems["exported_cameras"] += _camera_faults(name, frame, content)
            problems["exported_depth"] += _depth_faults(frame, content)
    details = {
        "exports": f"{len(lists)} exports of {len(frames)} frames",
        "exported_cameras": f"{views} cameras of {len(frames)} frames",
        "exported_depth": "points and flow of the frames",
    }
    checks = [
        Check(
            name,
            not problems[name] if lists else None,
            details[name],
            problems=[problem.replace(f"{rig}/", "") for problem in problems[name]],
        )
        for name in problems
    ]
    strays = stray_problems(rig, _strays(rig, frames, owned), "sequence")
    checks.append(Check("files", not strays, f"{len(intact)} files", problems=strays))
    digests = {path: sha256(rig / path) for path in sorted(intact)}
    return Result(f"{rig.parent.name}/{rig.name}", views, checks, digests)


def remove_strays(
    rig: Path, frames: Collection[str], lists: Sequence[Path], manifest: Manifest, folder: Path
) -> None:
    """Move former exports out of a rig's folder into ``folder``.

    Moves nothing if a list of an export cannot be read.
    """
    owned: list[str] = []
    for path in map(absolute_path, lists):
        try:
            owned += _owned(absolute_path(rig), path, manifest)
        except UserError:
            return
    set_strays_aside(rig, _strays(rig, frames, owned), folder)


def _owned(rig: Path, path: Path, manifest: Manifest) -> list[str]:
    """Return an export's list and the files in it, by their paths in the rig's folder."""
    folder = path.parent.relative_to(rig)
    return [(folder / name).as_posix() for name in (path.name, *manifest.files(path))]


def _strays(rig: Path, frames: Collection[str], owned: Collection[str]) -> list[str]:
    """Return the files in a rig's folder that are of no frame and of no export."""
    return strays_among(rig, present_files(rig, frames), owned)


def _read_frames(rig: Path, path: Path, folders: Sequence[str]) -> list[Frame]:
    """Return the frames with the source of an export. Raises `UserError` if they do not fit."""
    source = path.parents[2].relative_to(rig).as_posix().removeprefix(".")
    frames = []
    for folder in folders:
        sets, checks = read_sets(rig / folder, [source] if source else [])
        problems = [
            problem for check in checks if check.passed is False for problem in check.problems
        ]
        if problems:
            raise UserError(f"{folder}: {problems[0]}")
        frames.append(Frame(rig / folder, sets))
    if len(frames) < 2:
        raise UserError(f"{path}: is of a sequence, which must have two frames or more")
    first = frames[0].views
    for frame in frames:
        if frame.views.lightfield.lens != first.lightfield.lens or frame.views.views != first.views:
            problem = "has another lens or other views than the first frame"
            raise UserError(f"{frame.folder / frame.views.name / NAME}: {problem}")
    return frames


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


# ---- cameras ---------------------------------------------------------------------------------


def _camera_faults(name: str, frame: Frame, exported: Exported) -> Iterator[str]:
    """Yield how an export's frame differs from the frame's lightfield.json."""
    expected = Expected(frame.folder, frame.views)
    if name in NUMBERED or name == "multipleview":
        views = _numbered(expected, exported) if name in NUMBERED else _training(expected)
        lightfield = frame.views.lightfield.changed(views=views)
        expected = Expected(frame.folder, replace(frame.views, lightfield=lightfield))
    yield from exported.faults
    yield from exported_cameras.faults(exported, expected)


def _numbered(expected: Expected, exported: Exported) -> list[View]:
    """Return the views that an export must have, with the names cam00, cam01 and so on.

    cam00 tests: it is the first test view of the split. Another rig's test view may take its place.
    Without a split, it is the first view by name.
    """
    views = sorted(expected.image_set.lightfield.views, key=lambda view: view.name)
    tests = views[:1]
    trains = views[1:]
    if expected.has_split:
        tests = [view for view in expected.image_set.lightfield.views if view.split == "test"]
        others = expected.views_of_other_rigs.values()
        tests = tests or [view for view in others if view.split == "test"]
        trains = [view for view in expected.image_set.lightfield.views if view.split == "train"]
        if tests and tests[0].name not in expected.numbers:
            # Any of the other rigs' test views may be the first.
            first = min(exported.views, key=lambda view: view.name or "").matrix[:3, 3]
            tests.sort(key=lambda view: float(np.linalg.norm(view.position - first)))
    chosen = [(view, "test") for view in tests[:1]] + [(view, "train") for view in trains]
    digits = max(2, len(str(len(chosen) - 1)))
    return [
        replace(view, name=f"cam{number:0{digits}d}", others={**view.others, "split": part})
        for number, (view, part) in enumerate(chosen)
    ]


def _training(expected: Expected) -> list[View]:
    """Return the views that train, with the names image1, image2 and so on."""
    views = sorted(expected.image_set.lightfield.views, key=lambda view: view.name)
    trains = [view for view in views if view.split in (None, "train")]
    return [replace(view, name=f"image{number}") for number, view in enumerate(trains, 1)]


# ---- depth -----------------------------------------------------------------------------------


def _depth_faults(frame: Frame, exported: Exported) -> Iterator[str]:
    """Yield the points and the flow that do not agree with the depth of a frame's views."""
    number = len(frame.sets) - 1
    depth = ExportedDepth(frame.folder, frame.sets, [SetExport(number, exported, False)])
    examiner = Examiner(frame.folder, frame.sets)
    if exported.clouds:
        answers = {}
        for (set_number, place), question in depth.questions.items():
            image_set = frame.sets[set_number]
            file = File(f"{image_set.folder}/{image_set.views[place]}.exr", set_number, place)
            answer = examiner.answer_depth(file, question)
            if answer:
                answers[set_number, place] = answer
        for check in depth.checks(answers, lambda ask: [examiner.answer_depth(*q) for q in ask]):
            yield from check.problems
    if exported.flows is not None:
        names = [flow.view for flow in exported.flows]
        for view in sorted({*names} ^ {*frame.views.views}):
            yield f"scene_flow: {frame.folder.name}/{view}.exr: is missing, or of no view"
        for flow in exported.flows:
            if flow.view in frame.views.numbers:
                yield from _flow_faults(frame, flow)


def _flow_faults(frame: Frame, flow: Flow) -> Iterator[str]:
    """Yield how a view's flow differs from its pass motion: it must lead to the same pixels."""
    image_set = frame.views
    number = image_set.numbers[flow.view]
    camera = image_set.camera(number)
    view = image_set.lightfield.views[number]
    motion_file = PASSES["motion"].path(frame.folder / image_set.name, flow.view)
    try:
        channels = images.read_image(flow.path).channels
        moves = images.read_image(motion_file).channels
        depth = images.read_image(frame.folder / image_set.folder / f"{flow.view}.exr", ["Z"])
    except UserError as error:
        yield str(error)
        return
    has_flow = channels["V"] > 0
    lens = camera.lens
    distance = converted(depth.channels["Z"], camera, "distance")
    moved = np.stack([channels[axis] for axis in "XYZ"], axis=-1).astype(np.float64)
    local = lens.pixel_rays() * distance[..., None] + moved @ view.matrix[:3, :3]
    motion = np.stack([moves[f"next.{axis}"] for axis in "XY"], axis=-1)
    pixels = np.indices(has_flow.shape)[::-1].transpose(1, 2, 0) + 0.5
    off: Floats = lens.pixels(local[has_flow]) - (pixels + motion)[has_flow]
    off[:, 0] = shorter(lens, off[:, 0])
    wrong = int((~(np.abs(off) <= _FLOW_PIXELS).all(axis=-1)).sum())
    if wrong:
        yield f"{flow.path}: {wrong} pixels do not move as {motion_file} says"
