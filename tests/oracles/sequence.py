"""Compares the exports of a sequence with the lightfield.json and the depth of every frame."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.formats.layout import ImageSet, frame_folders
from lightfield.formats.lightfield import View
from lightfield.formats.passes import PASSES
from lightfield.geometry.flow import shorter
from lightfield.imaging import images
from lightfield.validation.cameras import camera_of
from lightfield.validation.files import read_sets
from lightfield.validation.sequence import export_lists
from oracles import exported_cameras, exported_depth, exported_pictures
from oracles.exported_cameras import Expected, SetExport
from oracles.exported_depth import converted
from oracles.readers import read_sequence
from oracles.readers.contents import Exported, Floats, Flow

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


def faults(rig: Path) -> list[str]:
    """Return what is wrong in the exports of the sequence in a rig's folder."""
    rig = rig.resolve()
    problems: list[str] = []
    for path in export_lists(rig):
        source = path.parents[2].relative_to(rig).as_posix().removeprefix(".")
        frames = []
        for folder in frame_folders(rig):
            sets, _ = read_sets(rig / folder, [source] if source else [])
            frames.append(Frame(rig / folder, sets))
        lens = frames[0].views.lightfield.lens
        numbers = {frame.folder.name: frame.number for frame in frames}
        try:
            name, exported = read_sequence(path, (lens.width, lens.height), numbers)
        except UserError as error:
            problems.append(str(error))
            continue
        sources = [(frame.folder, frame.views) for frame in frames]
        for depth_range in exported[0].ranges:
            problems += exported_depth.range_faults(depth_range, sources)
        for frame, content in zip(frames, exported, strict=True):
            problems += _camera_faults(name, frame, content)
            problems += _depth_faults(frame, content)
    return [problem.replace(f"{rig}/", "") for problem in problems]


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
            first = min(exported.views, key=lambda view: view.name or "").world_from_camera[:3, 3]
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


def _depth_faults(frame: Frame, exported: Exported) -> Iterator[str]:
    """Yield the points, pictures and flow that do not agree with a frame's views."""
    # Ranges are of all frames.
    of_frame = [SetExport(len(frame.sets) - 1, replace(exported, ranges=[]), False)]
    yield from exported_depth.faults(frame.folder, frame.sets, of_frame)
    yield from exported_pictures.faults(frame.folder, frame.sets, of_frame)
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
    camera = camera_of(image_set, number)
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
    local = lens.pixel_rays() * distance[..., None] + moved @ view.world_from_camera[:3, :3]
    motion = np.stack([moves[f"next.{axis}"] for axis in "XY"], axis=-1)
    pixels = np.indices(has_flow.shape)[::-1].transpose(1, 2, 0) + 0.5
    off: Floats = lens.pixels(local[has_flow]) - (pixels + motion)[has_flow]
    off[:, 0] = shorter(lens, off[:, 0])
    wrong = int((~(np.abs(off) <= _FLOW_PIXELS).all(axis=-1)).sum())
    if wrong:
        yield f"{flow.path}: {wrong} pixels do not move as {motion_file} says"
