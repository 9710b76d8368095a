"""Writes a sequence of NCore v4, which gsplat and 3DGRUT read: fisheyes past 180° too.

- ``views.json``: the sequence, and where its store is.
- ``views.ncore4.zarr/``: the store.
  - ``cameras/camera/frames/<time>/``: a view as PNG, its name, and a mask if the view has pixels
    that show nothing. There 0 means ignored. The cameras of a head have their own names, and frames
    at the same times.
  - ``intrinsics``: f-theta or OpenCV's fisheye for fisheyes, OpenCV's pinhole for perspective
    views.
  - ``poses``: camera to world, with x right, y down and z forward, in metres.
  - ``lidars/points``: the points, as one frame of a lidar at the world's origin. All versions of
    gsplat's and 3DGRUT's readers take these. With other points, too, they stop.

Frames are in the order of the views' names. NCore needs a different time for each. So each is
exposed a second after the one before, in microseconds.

- A still camera's exposure takes an instant.
- A moving camera's takes half a second. The camera has poses at its start, middle and end, whose
  times are ``exposure_us`` of the frame. NCore's readers use the pose at the frame's start time for
  all rows. So the frame is the exposure's middle.
- With a rolling shutter, the frame lasts from the first row's time to the last row's time.

Source: NCore's data/v4/components.py, data/types.py and sensors/camera.py, and gsplat's
datasets/ncore.py.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras, heads
from lightfield.export.points import Points, lift
from lightfield.export.source import SourceDataset
from lightfield.export.zarr_store import ZarrStore
from lightfield.exporters.base import ForTraining, PointCount
from lightfield.formats.lightfield import View
from lightfield.geometry.exposure import Floats, pose_between, row_times
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.f_theta import FTheta
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import OPENCV_AXES
from lightfield.imaging import images

SEQUENCE = "views"
CAMERA = "camera"
_LIDAR = "points"
_LIDAR_FRAMES = f"lidars/{_LIDAR}/frames"
WORLD = "world"
# NCore's readers open the component of this name.
_DEFAULT = "default"

# Microseconds between the views.
STEP = 1_000_000
# Microseconds of a moving camera's exposure.
EXPOSURE = 500_000

# NCore inverts r(θ) by so many steps. Rays may miss a lens by so many pixels.
_NEWTON_STEPS = 3
_MOST_MISS = 0.25


@dataclass(frozen=True)
class TimedView:
    """The times of a view's picture in microseconds, and the camera's poses (4, 4) by their times.

    ``source`` has the view. All rows see light from ``start`` to ``end``, or the first at ``start``
    and the last at ``end``. ``exposure`` is the exposure of a moving camera.
    """

    source: SourceDataset
    view: View
    start: int
    end: int
    poses: Mapping[int, Floats]
    exposure: tuple[int, int] | None = None

    @classmethod
    def of(
        cls,
        source: SourceDataset,
        view: View,
        begin: int,
        duration: int,
        rows: tuple[float, float] | None,
    ) -> "TimedView":
        """Return the frame of a view. Its exposure lasts from ``begin``, for this ``duration``.

        ``rows`` are the times, −½ to ½, of the first and the last row of a rolling shutter.
        """
        if view.exposure is None:
            return cls(source, view, begin, begin, {begin: view.world_from_camera})
        middle = begin + duration // 2
        start, end = (middle + round(time * duration) for time in rows or (0, 0))
        poses = {
            time: pose_between(*view.exposure, (time - begin) / duration)
            for time in sorted({begin, start, middle, end, begin + duration})
        }
        return cls(source, view, start, end, poses, (begin, begin + duration))


@dataclass(frozen=True)
class Stream:
    """The frames of a camera. ``is_rolling`` says whether its rows have times of their own."""

    name: str
    lens: Lens
    frames: Sequence[TimedView]
    is_rolling: bool

    @classmethod
    def of(cls, source: SourceDataset, sensor: heads.HeadSensor, number: int) -> "Stream":
        """Return the stream of a source's camera. In a head, equal times are equal places."""
        rows = row_times_of(source, sensor.lens)
        views = sorted(sensor.views, key=lambda view: view.name)
        frames = [
            TimedView.of(source, view, index * STEP, EXPOSURE, rows)
            for index, view in enumerate(views)
        ]
        name = f"{CAMERA}{number or ''}"
        if sensor.mount:
            name = free_name(sensor.mount.name, f"{source.lightfield.path}: head")
        return cls(name, sensor.lens, frames, rows is not None)


def free_name(name: str, place: str) -> str:
    """Return the name of a camera. Raises `UserError` with the ``place`` if NCore has it itself."""
    if name in (_LIDAR, WORLD):
        raise UserError(f"{place}: NCore has a {name} itself; give the camera another name")
    return name


def row_times_of(source: SourceDataset, lens: Lens) -> tuple[float, float] | None:
    """Return the times of a lens's first and last row with a rolling shutter. None without one.

    Raises `UserError` if resampling mixed the rows.
    """
    motion = source.rendered.known_render.camera_motion
    if motion is None or motion.rolling in (None, 1):
        return None
    rotation = source.lightfield.content.get("reprojection", {}).get("rotation", ())
    if source.lens != source.rendered.lens or any(rotation):
        raise UserError(
            f"{source.lightfield.path}: reprojection: mixes the rows of a rolling shutter, and "
            "NCore needs their times; export the rendered views"
        )
    times = row_times(lens.height, motion.rolling)
    return float(times[0]), float(times[-1])


class NCoreSequence(ForTraining):
    """The options of exports that are sequences of NCore v4."""

    has_row_times = True
    needs_surfaces = True

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, KannalaBrandt | FTheta) and (miss := _miss(lens)) > _MOST_MISS:
            return (
                f"shows rays that NCore's inverse misses by {miss:.2g} pixels; give it a smaller "
                "fov, or reproject to equidistant"
            )
        if isinstance(lens, Equidistant | Rectilinear | BrownConrady | KannalaBrandt | FTheta):
            return None
        return "has a lens that NCore lacks; reproject to rectilinear or equidistant"

    def joins(self, lens: Lens, other: Lens) -> bool:
        return True

    def write_sequence(
        self,
        streams: Sequence[Stream],
        seen: Mapping[int, SourceDataset],
        count: int,
        folder: Path,
    ) -> None:
        """Write the ``streams`` into ``folder``, with ``count`` points of each of the ``seen``.

        These are views by the time at which a lidar measures their points, in microseconds.
        """
        end = max(max(frame.poses) for stream in streams for frame in stream.frames)
        sequence = {
            "sequence_id": SEQUENCE,
            # The end is not included.
            "sequence_timestamp_interval_us": {"start": 0, "stop": end + 1},
            "generic_meta_data": {},
            "version": "v4",
        }
        name = f"{SEQUENCE}.ncore4.zarr"
        store = ZarrStore(folder / name, sequence | {"component_group_name": ""})
        components = {
            "cameras": [stream.name for stream in streams],
            "cuboids": [_DEFAULT],
            "intrinsics": [_DEFAULT],
            "lidars": [_LIDAR],
            "masks": [_DEFAULT],
            "poses": [_DEFAULT],
        }
        for component, instances in components.items():
            store.group(component)
            for instance in instances:
                names = {
                    "component_name": component,
                    "component_instance_name": instance,
                    "component_version": "v1",
                }
                store.group(f"{component}/{instance}", names | {"generic_meta_data": {}})
        store.group("cuboids/default/cuboids", {"cuboid_track_observations": []})
        _write_poses(store, streams)
        _write_lenses(store, streams)
        store.group(_LIDAR_FRAMES, {"frames_timestamps_us": [[time, time] for time in seen]})
        for time, source in seen.items():
            _write_points(store, lift(source, count=count), time)
        progress = Progress(sum(len(stream.frames) for stream in streams), self.name, "views")
        for stream in streams:
            _write_frames(store, stream, progress)
        digest = store.close()
        versions = {
            component: {
                instance: {"version": "v1", "generic_meta_data": {}} for instance in instances
            }
            for component, instances in components.items()
        }
        stores = [{"path": name, "md5": digest, "components": versions}]
        write_json(folder / f"{SEQUENCE}.json", sequence | {"component_stores": stores})


class NCore(NCoreSequence):
    """A sequence of NCore v4, for gsplat and 3DGRUT."""

    name = "ncore"
    summary = "NCore v4 for gsplat and 3DGRUT, also for fisheyes wider than 180°."
    rank = 9
    loader = (
        "python simple_trainer.py mcmc --data-type ncore --data-dir {}/views.json"
        " --data-factor 1 --init-type lidar --with-ut --with-eval3d  # gsplat"
    )

    points: PointCount = Field(
        50000, description="Largest number of points, which are computed from depth."
    )

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        source = heads.by_camera(source)
        streams = [Stream.of(source, sensor, n) for n, sensor in enumerate(heads.sensors(source))]
        if len(streams[0].frames) < 2:
            raise UserError(
                f"{source.lightfield.path}: frames: has one view; NCore needs two or more"
            )
        self.write_sequence(streams, {0: source}, self.points, folder)


def camera(lens: Lens, is_rolling: bool = False) -> dict[str, Any]:
    """Return NCore's type of a lens, and its parameters in pixels and radians."""
    common = {
        "resolution": [lens.width, lens.height],
        "shutter_type": "ROLLING_TOP_TO_BOTTOM" if is_rolling else "GLOBAL",
        "external_distortion_parameters": None,
    }
    parameters: dict[str, Any]
    if isinstance(lens, Rectilinear | BrownConrady):
        radial, tangential = [0.0] * 6, [0.0] * 2
        if isinstance(lens, BrownConrady):
            named = cameras.distortion(lens)
            radial = [named[f"k{number}"] for number in range(1, 7)]
            tangential = [named["p1"], named["p2"]]
        parameters = {
            "principal_point": list(lens.center),
            "focal_length": list(cameras.focal_pixels(lens)),
            "radial_coeffs": radial,
            "tangential_coeffs": tangential,
            "thin_prism_coeffs": [0.0] * 4,
        }
        # gsplat does not know NCore's "ideal-pinhole".
        return {
            "camera_model_type": "opencv-pinhole",
            "camera_model_parameters": common | parameters,
        }
    if isinstance(lens, KannalaBrandt):
        parameters = {
            "principal_point": list(lens.center),
            "focal_length": list(cameras.focal_pixels(lens)),
            "radial_coeffs": list(lens.coefficients),
            "max_angle": cameras.largest_angle(lens),
        }
        return {
            "camera_model_type": "opencv-fisheye",
            "camera_model_parameters": common | parameters,
        }
    if isinstance(lens, FTheta):
        parameters = _ftheta(lens)
        return {"camera_model_type": "ftheta", "camera_model_parameters": common | parameters}
    if not isinstance(lens, Equidistant):
        raise TypeError(f"{type(lens).__name__} is not a lens of this export")
    pixels_a_radian = lens.height / lens.fov
    parameters = {
        # Here pixel centres are whole numbers.
        "principal_point": [lens.center[0] - 0.5, lens.center[1] - 0.5],
        "reference_poly": "ANGLE_TO_PIXELDIST",
        "pixeldist_to_angle_poly": [0.0, 1 / pixels_a_radian, 0.0, 0.0, 0.0, 0.0],
        "angle_to_pixeldist_poly": [0.0, pixels_a_radian, 0.0, 0.0, 0.0, 0.0],
        "max_angle": lens.fov / 2,
        # The first stretches x: the image circle touches all four edges.
        "linear_cde": [lens.width / lens.height, 0.0, 0.0],
    }
    return {"camera_model_type": "ftheta", "camera_model_parameters": common | parameters}


def _polynomials(lens: KannalaBrandt | FTheta) -> tuple[Polynomial, Polynomial]:
    """Return r(θ) in focal lengths, and the θ(r) from which NCore starts Newton's method.

    For OpenCV's fisheye, NCore's start is proportional to r.
    """
    largest = cameras.largest_angle(lens)
    if isinstance(lens, KannalaBrandt):
        k1, k2, k3, k4 = lens.coefficients
        fx, fy = cameras.focal_pixels(lens)
        side = max(lens.width / 2 / fx, lens.height / 2 / fy)
        return Polynomial([0, 1, 0, k1, 0, k2, 0, k3, 0, k4]), Polynomial([0, largest / side])
    forward = Polynomial([0, 1, *lens.coefficients])
    angles = np.linspace(0, largest, 257)[1:]
    radii = forward(angles)
    # Without a constant: the axis is at r = 0. The powers of r / r_max are of one size.
    powers = (radii[:, None] / radii[-1]) ** np.arange(1, 6)
    fitted, *_ = np.linalg.lstsq(powers, angles, rcond=None)
    return forward, Polynomial([0, *(fitted / radii[-1] ** np.arange(1, 6))])


def _miss(lens: KannalaBrandt | FTheta) -> float:
    """Return by how many pixels NCore's three steps of Newton's method miss the lens at most."""
    forward, start = _polynomials(lens)
    angles = np.linspace(0, cameras.largest_angle(lens), 257)
    radii = forward(angles)
    found = start(radii)
    slope = forward.deriv()
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON_STEPS):
            found = found - (forward(found) - radii) / slope(found)
        errors = np.abs(found - angles) * max(cameras.focal_pixels(lens))
    return float(np.max(np.nan_to_num(errors, nan=np.inf)))


def _ftheta(lens: FTheta) -> dict[str, Any]:
    """Return NCore's parameters of an f-theta lens, whose polynomial is NCore's reference."""
    fx, fy = cameras.focal_pixels(lens)
    forward, start = _polynomials(lens)
    return {
        "principal_point": [lens.center[0] - 0.5, lens.center[1] - 0.5],
        "reference_poly": "ANGLE_TO_PIXELDIST",
        # Both have six coefficients, and r in pixels.
        "pixeldist_to_angle_poly": [k / fy**power for power, k in enumerate(start.coef.tolist())],
        "angle_to_pixeldist_poly": [fy * k for k in forward.coef.tolist()],
        "max_angle": cameras.largest_angle(lens),
        "linear_cde": [fx / fy, 0.0, 0.0],
    }


def _write_poses(store: ZarrStore, streams: Sequence[Stream]) -> None:
    lidar = {"pose": np.eye(4).tolist(), "dtype": "float64"}
    store.group("poses/default/static_poses", {str((_LIDAR, WORLD)): lidar})
    poses = {str((stream.name, WORLD)): _poses(stream.frames) for stream in streams}
    store.group("poses/default/dynamic_poses", poses)


def _poses(frames: Sequence[TimedView]) -> dict[str, Any]:
    """Return the poses of a camera by their times."""
    matrices = [matrix for frame in frames for matrix in frame.poses.values()]
    return {
        "poses": [(matrix @ OPENCV_AXES).tolist() for matrix in matrices],
        "timestamps_us": [time for frame in frames for time in frame.poses],
        "dtype": "float64",
    }


def _write_lenses(store: ZarrStore, streams: Sequence[Stream]) -> None:
    store.group("intrinsics/default/cameras")
    for stream in streams:
        intrinsics = camera(stream.lens, stream.is_rolling)
        store.group(f"intrinsics/default/cameras/{stream.name}", intrinsics)
    store.group("intrinsics/default/lidars")
    # These are masks for all frames. Each frame has its own.
    store.group("masks/default/cameras")
    for stream in streams:
        store.group(f"masks/default/cameras/{stream.name}", {"mask_names": []})


def _write_points(store: ZarrStore, points: Points, time: int) -> None:
    """Write the points as what a lidar at the origin measures at a ``time`` in microseconds."""
    count = len(points.positions)
    distances = np.linalg.norm(points.positions, axis=1)
    with np.errstate(invalid="ignore"):
        directions = points.positions / distances[:, None]
    directions[distances == 0] = [1, 0, 0]
    frame = f"{_LIDAR_FRAMES}/{time}"
    store.group(frame)
    store.group(f"{frame}/generic_data", {})
    store.array(f"{frame}/generic_data/rgb", points.colours)
    store.group(f"{frame}/ray_bundle", {"n_rays": count})
    store.array(f"{frame}/ray_bundle/direction", directions.astype("<f4"))
    store.array(f"{frame}/ray_bundle/timestamp_us", np.full(count, time, "<u8"))
    returns = f"{frame}/ray_bundle_returns"
    store.group(returns, {"n_returns": 1})
    store.array(f"{returns}/distance_m", distances.astype("<f4")[None])
    store.array(f"{returns}/intensity", np.zeros((1, count), "<f4"))
    is_valid = np.packbits(np.ones(count, bool))
    sizes = {"n_returns": 1, "n_rays": count}
    store.array(f"{frame}/ray_bundle_returns_valid_mask_packed", is_valid, sizes)


def _write_frames(store: ZarrStore, stream: Stream, progress: Progress) -> None:
    folder = f"cameras/{stream.name}/frames"
    times = [[frame.start, frame.end] for frame in stream.frames]
    store.group(folder, {"frames_timestamps_us": times})
    for frame in stream.frames:
        view = frame.view
        place = f"{folder}/{frame.end}"
        store.group(place)
        about: dict[str, Any] = {"name": view.name}
        if frame.exposure:
            about["exposure_us"] = list(frame.exposure)
        store.group(f"{place}/generic_data", about)
        valid = frame.source.valid(view)
        if not valid.all():
            store.array(f"{place}/generic_data/mask", valid.astype(np.uint8) * 255)
        # gsplat takes three channels.
        picture = store.folder / f"{view.name.replace('/', '_')}.png"
        images.write_png(picture, frame.source.opaque(view))
        store.encoded(f"{place}/image", picture, {"format": "png"})
        progress.done()
