"""Writes a COLMAP model, for gsplat, 3DGRUT, Brush and the original 3D Gaussian splatting.

- ``sparse/0/``: cameras, images and points3D, in binary or as text. For the cameras of a head also
  rigs and frames. Their images lie in a folder for each camera, with equal names.
- ``images/``: the views as 8-bit PNG.
- ``masks/<image>.png``: for views with pixels that show nothing. 0 means ignored.
- ``stereo/depth_maps/<image>.geometric.bin``: Z-depth in metres, if the settings ask for it.

Poses are world to camera, with x right, y down and z forward. The first camera of a head is its
rig's reference. Points are lifted from depth. Each
has the views that see it. One view is enough, because depth says where the point is. Source:
COLMAP's format.rst, scene/reconstruction_io, sensor/rig.h and sensor/models.h.
"""

import struct
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.core.files import atomic_path
from lightfield.export import cameras, heads
from lightfield.export.pictures import write_pictures
from lightfield.export.points import (
    Observations,
    Points,
    joined,
    lift,
    lift_one_each,
    observations,
)
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import (
    NO_DEPTH,
    TO_RECTILINEAR,
    ForTraining,
    PointCount,
    sideways_refusal,
    tracked_points,
)
from lightfield.formats.lightfield import View
from lightfield.geometry.colmap import pose, relative_pose
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.division import Division
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.extended_unified import ExtendedUnified
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.fov_model import FovModel
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.thin_prism_fisheye import ThinPrismFisheye
from lightfield.geometry.lenses.unified import Unified

PINHOLE = (1, "PINHOLE")
OPENCV = (4, "OPENCV")
OPENCV_FISHEYE = (5, "OPENCV_FISHEYE")
FULL_OPENCV = (6, "FULL_OPENCV")
EUCM = (16, "EUCM")
# Whole panoramas. Since COLMAP 4.1.
EQUIRECTANGULAR = (17, "EQUIRECTANGULAR")
# COLMAP has the coefficients of these lenses in the same order.
_CALIBRATED: dict[type[Lens], tuple[int, str]] = {
    KannalaBrandt: OPENCV_FISHEYE,
    FovModel: (7, "FOV"),
    ThinPrismFisheye: (10, "THIN_PRISM_FISHEYE"),
    Fisheye624: (11, "RAD_TAN_THIN_PRISM_FISHEYE"),
    Division: (13, "DIVISION"),
    ExtendedUnified: EUCM,
}
_ALL: tuple[type[Lens], ...] = (
    *(Rectilinear, Equidistant, Equirectangular, BrownConrady, Unified),
    *_CALIBRATED,
)
# Who does not read a model, but reads the others of COLMAP's.
_NOT_READ_BY = {
    "FULL_OPENCV": "gsplat stops at",
    "FOV": "gsplat and 3DGRUT stop at, and Brush takes for a pinhole",
    "THIN_PRISM_FISHEYE": "gsplat and 3DGRUT stop at",
    "RAD_TAN_THIN_PRISM_FISHEYE": "gsplat, 3DGRUT and Brush stop at",
    "DIVISION": "gsplat, 3DGRUT and Brush stop at",
    "EUCM": "gsplat, 3DGRUT and Brush stop at",
}

# COLMAP's type of the sensors of a rig.
_CAMERA_SENSOR = 0

# A file beside the model, if the scene has a split: the names of the test images, one per line. The
# original 3D Gaussian splatting reads it.
TESTS = "test.txt"


class ColmapModel(ForTraining):
    """The options of exports that are COLMAP models."""

    format: Literal["binary", "text"] = Field("binary", description="Form of COLMAP's files.")
    points: PointCount = tracked_points()
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; COLMAP takes whole ones; {TO_RECTILINEAR}"
            if self.depth:
                return "is a panorama, for which COLMAP has no depth maps; leave out depth: true"
        elif not isinstance(lens, _ALL):
            return f"has a lens that COLMAP lacks; {TO_RECTILINEAR}, or equidistant below 180°"
        # The models of all other lenses project only points in front of the camera.
        elif not isinstance(lens, Division) and (refusal := sideways_refusal(lens, "COLMAP's")):
            return refusal
        return NO_DEPTH if self.depth and not has_depth else None

    def write_model(self, source: SourceDataset, folder: Path) -> None:
        """Write the model of a source's views into ``folder``."""
        for lens, path in source.lenses.items():
            if problem := misreading(lens):
                print(f"warning: {path}: camera: {problem}", file=sys.stderr)
        views = source.lightfield.views
        if any(view.split for view in views):
            tests = [f"{view.name}.png\n".encode() for view in splits(source.lightfield).test]
            _write(folder / "sparse" / "0" / TESTS, tests)
        colmap_model = model(source, self.points)
        write = colmap_model.write_binary if self.format == "binary" else colmap_model.write_text
        write(folder / "sparse" / "0")
        for view, _ in write_pictures(
            source, folder, "colmap", picture="images/{}.png", mask="masks/{}.png.png"
        ):
            if self.depth:
                depth_maps = folder / "stereo" / "depth_maps"
                _write_depth(depth_maps / f"{view.name}.png.geometric.bin", source, view)


class Colmap(ColmapModel):
    """A COLMAP model, for gsplat, 3DGRUT, Brush and the original 3D Gaussian splatting."""

    name = "colmap"
    summary = "COLMAP model for gsplat, 3DGRUT, Brush and the original 3D Gaussian splatting."
    rank = 2
    loader = "import pycolmap\nmodel = pycolmap.Reconstruction('{}/sparse/0')"
    needs_surfaces = True

    def joins(self, lens: Lens, other: Lens) -> bool:
        return True

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write the model of a source's views into ``folder``."""
        self.write_model(heads.by_camera(source), folder)


def model(source: SourceDataset, count: int) -> "Model":
    """Lift ``count`` points. Return them with the views that see each. Print their number.

    A view that sees none of them gets one more point, of its own surface. Without it, gsplat's
    depth loss ends in a KeyError.
    """
    points = lift(source, count=count)
    seen_points = observations(source, points)
    blind_views = [
        view
        for view, seen in zip(source.lightfield.views, seen_points, strict=True)
        if not len(seen.indices)
    ]
    missing_points = lift_one_each(source, blind_views)
    if len(missing_points.positions):
        points = joined([points, missing_points])
        seen_points = observations(source, points)
    view_counts = np.bincount(
        np.concatenate([seen.indices for seen in seen_points]), minlength=len(points.positions)
    )
    visible = np.flatnonzero(view_counts)
    seen_once = int((view_counts == 1).sum())
    print(f"{len(visible):,} points; only one view sees {seen_once:,} of them")
    return Model(source, points, seen_points, visible)


def camera(lens: Lens) -> tuple[tuple[int, str], list[float]]:
    """Return COLMAP's model (id, name) of a lens, and its parameters in pixels."""
    if isinstance(lens, Rectilinear):
        return PINHOLE, [*cameras.focal_pixels(lens), *lens.center]
    if isinstance(lens, Equirectangular):
        return EQUIRECTANGULAR, [float(lens.width), float(lens.height)]
    if isinstance(lens, Equidistant):
        fx, fy, *distortion = cameras.opencv_fisheye(lens)
        return OPENCV_FISHEYE, [fx, fy, *lens.center, *distortion]
    assert isinstance(lens, CalibratedLens)
    fx, fy = cameras.focal_pixels(lens)
    if isinstance(lens, Unified):
        # It is an extended unified lens with β = 1, whose focal length counts in other units.
        (xi,) = lens.coefficients
        return EUCM, [fx / (1 + xi), fy / (1 + xi), *lens.center, xi / (1 + xi), 1.0]
    parameters = [fx, fy, *lens.center, *lens.coefficients]
    if isinstance(lens, BrownConrady):
        is_short = not any(lens.coefficients[4:])
        return (OPENCV, parameters[:8]) if is_short else (FULL_OPENCV, parameters)
    return _CALIBRATED[type(lens)], parameters


def misreading(lens: Lens) -> str | None:
    """Return how readers of COLMAP models misread a lens's model, or None if they do not.

    Source: examples/datasets/colmap.py of gsplat, dataset_colmap.py of 3DGRUT, and
    colmap-reader/src/lib.rs and formats/colmap.rs of Brush.
    """
    (_, name), _ = camera(lens)
    if name in _NOT_READ_BY:
        return f"is COLMAP's {name}, which {_NOT_READ_BY[name]}; give them perspective views"
    if name == "OPENCV":
        return (
            "gsplat undistorts it as if the first pixel's centre were at (0, 0), and moves pixels "
            "by up to a half; give gsplat perspective views, or the export ncore"
        )
    return cameras.misreading(lens)


class Model:
    """The ``visible`` points, numbered from 1, and the images that see them, from 1 in order."""

    def __init__(
        self,
        source: SourceDataset,
        points: Points,
        seen_points: Sequence[Observations],
        visible: NDArray[np.intp],
    ) -> None:
        self.cameras = heads.sensors(source)
        self.views = source.lightfield.views
        self.points = points.chosen(visible)
        number = np.zeros(len(points.positions), np.int64)
        number[visible] = np.arange(1, len(visible) + 1)
        self.seen = []
        for seen in seen_points:
            numbers = number[seen.indices]
            is_visible = numbers > 0
            self.seen.append(Observations(numbers[is_visible], seen.pixels[is_visible]))

    def tracks(self) -> Iterator[list[tuple[int, int]]]:
        """Yield each point's (image, index among the image's points)."""
        sizes = [len(o.indices) for o in self.seen]
        image = np.repeat(np.arange(1, len(sizes) + 1), sizes)
        place = np.concatenate([np.arange(size) for size in sizes])
        point = np.concatenate([o.indices for o in self.seen])
        order = np.argsort(point, kind="stable")
        bounds = np.searchsorted(point[order], np.arange(1, len(self.points.positions) + 2))
        for start, end in pairwise(bounds):
            rows = order[start:end]
            yield list(zip(image[rows].tolist(), place[rows].tolist(), strict=True))

    def rows(self) -> Iterator[tuple[int, list[float], tuple[int, ...], list[tuple[int, int]]]]:
        """Yield number, position, colour and track of each point."""
        for index, track in enumerate(self.tracks()):
            position = self.points.positions[index].tolist()
            yield index + 1, position, tuple(self.points.colours[index].tolist()), track

    @cached_property
    def camera_numbers(self) -> dict[str, int]:
        """The number of each view's camera, from 1, by the view's name."""
        numbered = enumerate(self.cameras, 1)
        return {view.name: number for number, camera in numbered for view in camera.views}

    @property
    def has_rig(self) -> bool:
        """Whether the cameras are a head."""
        return self.cameras[0].mount is not None

    def sensors(self) -> Iterator[tuple[int, Sequence[float]]]:
        """Yield the number of each camera but the first, and its pose in the first one's axes."""
        for number, first_from_camera in enumerate(heads.from_first(self.cameras)[1:], 2):
            quaternion, translation = relative_pose(first_from_camera)
            yield number, [*quaternion, *translation]

    def frames(self) -> Iterator[tuple[int, Sequence[float], list[tuple[int, int]]]]:
        """Yield the number of each place of the body, the first camera's pose, and its images.

        An image is the number of its camera, and its own.
        """
        image_numbers = {view.name: number for number, view in enumerate(self.views, 1)}
        for number, (first, *others) in enumerate(heads.places(self.cameras), 1):
            images = [
                (self.camera_numbers[view.name], image_numbers[view.name])
                for view in (first, *others)
            ]
            quaternion, translation = pose(first.world_from_camera)
            yield number, [*quaternion, *translation], images

    def write_binary(self, folder: Path) -> None:
        _write(folder / "cameras.bin", self._binary_cameras())
        _write(folder / "images.bin", self._binary_images())
        _write(folder / "points3D.bin", self._binary_points())
        if self.has_rig:
            _write(folder / "rigs.bin", self._binary_rigs())
            _write(folder / "frames.bin", self._binary_frames())

    def _binary_cameras(self) -> Iterator[bytes]:
        yield struct.pack("<Q", len(self.cameras))
        for number, sensor in enumerate(self.cameras, 1):
            (model, _), parameters = camera(sensor.lens)
            size = (sensor.lens.width, sensor.lens.height)
            yield struct.pack(f"<iiQQ{len(parameters)}d", number, model, *size, *parameters)

    def _binary_rigs(self) -> Iterator[bytes]:
        yield struct.pack("<QIIiI", 1, 1, len(self.cameras), _CAMERA_SENSOR, 1)
        for number, sensor_from_rig in self.sensors():
            yield struct.pack("<iIB7d", _CAMERA_SENSOR, number, True, *sensor_from_rig)

    def _binary_frames(self) -> Iterator[bytes]:
        frames = [*self.frames()]
        yield struct.pack("<Q", len(frames))
        for number, rig_from_world, images in frames:
            yield struct.pack("<II7dI", number, 1, *rig_from_world, len(images))
            for camera_number, image in images:
                yield struct.pack("<iIQ", _CAMERA_SENSOR, camera_number, image)

    def _binary_images(self) -> Iterator[bytes]:
        yield struct.pack("<Q", len(self.views))
        for number, (view, seen) in enumerate(zip(self.views, self.seen, strict=True), 1):
            quaternion, translation = pose(view.world_from_camera)
            camera_number = self.camera_numbers[view.name]
            yield struct.pack("<i7di", number, *quaternion, *translation, camera_number)
            yield f"{view.name}.png".encode() + b"\0" + struct.pack("<Q", len(seen.indices))
            table = np.empty(len(seen.indices), [("pixel", "<f8", 2), ("point", "<i8")])
            table["pixel"] = seen.pixels
            table["point"] = seen.indices
            yield table.tobytes()

    def _binary_points(self) -> Iterator[bytes]:
        yield struct.pack("<Q", len(self.points.positions))
        for number, position, colour, track in self.rows():
            yield struct.pack("<Q3d3BdQ", number, *position, *colour, 0.0, len(track))
            yield struct.pack(f"<{2 * len(track)}i", *(part for pair in track for part in pair))

    def write_text(self, folder: Path) -> None:
        _write(folder / "cameras.txt", self._text_cameras())
        _write(folder / "images.txt", self._text_images())
        _write(folder / "points3D.txt", self._text_points())
        if self.has_rig:
            _write(folder / "rigs.txt", self._text_rigs())
            _write(folder / "frames.txt", self._text_frames())

    def _text_cameras(self) -> Iterator[bytes]:
        for number, sensor in enumerate(self.cameras, 1):
            (_, model), parameters = camera(sensor.lens)
            size = f"{sensor.lens.width} {sensor.lens.height}"
            yield f"{number} {model} {size} {_text(parameters)}\n".encode()

    def _text_rigs(self) -> Iterator[bytes]:
        yield f"1 {len(self.cameras)} CAMERA 1".encode()
        for number, sensor_from_rig in self.sensors():
            yield f" CAMERA {number} 1 {_text(sensor_from_rig)}".encode()
        yield b"\n"

    def _text_frames(self) -> Iterator[bytes]:
        for number, rig_from_world, images in self.frames():
            data = " ".join(f"CAMERA {camera_number} {image}" for camera_number, image in images)
            yield f"{number} 1 {_text(rig_from_world)} {len(images)} {data}\n".encode()

    def _text_points(self) -> Iterator[bytes]:
        # Without a point the file would be empty.
        yield b"# number, x, y, z, red, green, blue, error, image and place of each view\n"
        for number, position, colour, track in self.rows():
            places = _text(part for pair in track for part in pair)
            yield f"{number} {_text(position)} {_text(colour)} 0 {places}\n".encode()

    def _text_images(self) -> Iterator[bytes]:
        for number, (view, seen) in enumerate(zip(self.views, self.seen, strict=True), 1):
            quaternion, translation = pose(view.world_from_camera)
            name = f"{self.camera_numbers[view.name]} {view.name}.png"
            yield f"{number} {_text(quaternion + translation)} {name}\n".encode()
            points = zip(seen.pixels.tolist(), seen.indices.tolist(), strict=True)
            yield (" ".join(f"{x!r} {y!r} {index}" for (x, y), index in points) + "\n").encode()


def _text(numbers: Iterable[float]) -> str:
    return " ".join(map(repr, numbers))


def _write(path: Path, parts: Iterable[bytes]) -> None:
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.writelines(parts)


def _write_depth(path: Path, source: SourceDataset, view: View) -> None:
    depth = source.depth(view, "z")
    finite_depth = np.where(np.isfinite(depth), depth, 0).astype("<f4")
    height, width = finite_depth.shape
    _write(path, [f"{width}&{height}&1&".encode(), finite_depth.tobytes()])
