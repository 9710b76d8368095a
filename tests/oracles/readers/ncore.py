"""A sequence of NCore v4 in a folder, read as its SequenceComponentGroupsReader does.

Its metadata is in one compressed file, which NCore reads, and in the files of each group and array.
The reader compares both. Source: NCore's data/v4/components.py, data/types.py, sensors/camera.py.
"""

import lzma
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import read_json, reading
from lightfield.geometry.exposure import pose_between
from oracles.readers.cameras import Camera, FTheta, OfColmap, OpenCVFisheye, Pinhole
from oracles.readers.contents import (
    Cloud,
    Exported,
    ExportedCamera,
    ExportedView,
    Floats,
    number,
    numbers,
)

METADATA = ".zmetadata.cbor.xz"
# The only camera of views that are no head.
CAMERA = "camera"
# The coordinate frames of the points and the world.
POINT_POSE = "('points', 'world')"
POINTS = "lidars/points/frames"
# The first has no rows of different times.
SHUTTERS = ("GLOBAL", "ROLLING_TOP_TO_BOTTOM")

# From NCore's camera to that of lightfield.json (y up, looks along −z).
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_PNG = b"\x89PNG\r\n\x1a\n"


class Store:
    """The store in a ``folder``. Its metadata is that of the compressed file."""

    def __init__(self, folder: Path, exported: Exported) -> None:
        self.folder = folder
        path = folder / METADATA
        with reading(path, "compressed metadata of an NCore store"):
            content, _ = _cbor(_decompressed(path, lzma.decompress), 0)
            self.metadata = dict(content["metadata"])
        # `Path.relative_to` is slow for many files.
        depth = len(folder.parts)
        names = {
            "/".join(file.parts[depth:]) for file in folder.rglob(".z*") if file.name != METADATA
        }
        for name in sorted(names | self.metadata.keys()):
            if name not in names or name not in self.metadata:
                place = folder / name if name not in names else path
                exported.faults.append(f"{place}: {name} is missing")
            elif read_json(folder / name) != self.metadata[name]:
                exported.faults.append(f"{folder / name}: differs from {METADATA}")

    def attributes(self, group: str) -> dict[str, Any]:
        return dict(self.metadata[f"{group}/.zattrs"])

    def file(self, name: str) -> Path:
        return self.folder / name

    def array(self, name: str) -> NDArray[Any]:
        """Return an array of one chunk."""
        described = self.metadata[f"{name}/.zarray"]
        compressor = described["compressor"]
        if compressor and compressor["id"] != "zlib":
            raise ValueError(f"{name}: is not compressed with zlib")
        shape = tuple(described["shape"])
        # An array without axes has the chunk 0, too.
        chunk = self.folder / name / (".".join("0" * len(shape)) or "0")
        with reading(chunk, "chunk of a Zarr array"):
            content = _decompressed(chunk, zlib.decompress if compressor else bytes)
            return np.frombuffer(content, described["dtype"]).reshape(shape)


def _decompressed(path: Path, decompress: Callable[[bytes], bytes]) -> bytes:
    try:
        return decompress(path.read_bytes())
    except (lzma.LZMAError, zlib.error, EOFError) as error:
        raise ValueError(str(error)) from None


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the sequence of an export."""
    exported = Exported()
    sequence = read_sequence(listing, exported)
    read_camera(sequence, CAMERA, size, exported)
    read_points(sequence.store, 0, exported)
    return exported


@dataclass(frozen=True)
class Sequence:
    """A store, the names of its cameras, and the ``interval`` of its times in microseconds."""

    store: Store
    cameras: list[str]
    interval: dict[str, Any]


def read_sequence(listing: Path, exported: Exported) -> Sequence:
    """Read the views.json of an export, and the metadata of its store."""
    path = listing.parent / "views.json"
    with reading(path, "sequence of NCore"):
        sequence = read_json(path)
        (entry,) = sequence["component_stores"]
        store = Store(listing.parent / str(entry["path"]), exported)
        root = store.metadata[".zattrs"]
        for key in (
            "sequence_id",
            "sequence_timestamp_interval_us",
            "generic_meta_data",
            "version",
        ):
            exported.expect(f"{path}: {key}", sequence[key] == root[key], True)
        cameras = [str(name) for name in entry["components"]["cameras"]]
        return Sequence(store, cameras, sequence["sequence_timestamp_interval_us"])


def read_camera(sequence: Sequence, name: str, size: tuple[int, int], exported: Exported) -> None:
    """Read the lens of a camera, and all its views."""
    store = sequence.store
    intrinsics = f"intrinsics/default/cameras/{name}"
    lens_file = store.file(f"{intrinsics}/.zattrs")
    with reading(lens_file, "camera of NCore"):
        camera = _camera(store.attributes(intrinsics), str(lens_file), exported)
        exported.cameras.append(ExportedCamera(str(lens_file), camera))
        shutter = store.attributes(intrinsics)["camera_model_parameters"]["shutter_type"]
        exported.expect(f"{lens_file}: shutter_type", shutter in SHUTTERS, True)
    _read_views(sequence, name, size, shutter != SHUTTERS[0], exported)


def _read_views(
    sequence: Sequence,
    name: str,
    size: tuple[int, int],
    is_rolling: bool,
    exported: Exported,
) -> None:
    store, interval = sequence.store, sequence.interval
    poses_file = store.file("poses/default/dynamic_poses/.zattrs")
    frames_file = store.file(f"cameras/{name}/frames/.zattrs")
    with reading(poses_file, "poses of NCore"):
        trajectory = store.attributes("poses/default/dynamic_poses")[f"('{name}', 'world')"]
        times = [int(time) for time in trajectory["timestamps_us"]]
        matrices = numbers(trajectory["poses"], (len(times), 4, 4))
    with reading(frames_file, "times of NCore's frames"):
        spans = store.attributes(f"cameras/{name}/frames")["frames_timestamps_us"]
        poses = dict(zip(times, enumerate(matrices @ _FLIP), strict=True))
        have_poses = all(time in poses for span in spans for time in span)
        exported.expect(f"{frames_file}: times are those of the poses", have_poses, True)
        # A rolling shutter takes time. Otherwise, readers use one pose for the whole frame.
        fit_shutter = all(start < end if is_rolling else start == end for start, end in spans)
        exported.expect(f"{frames_file}: times last as the shutter says", fit_shutter, True)
        rising = bool((np.diff(times) > 0).all())
        exported.expect(f"{poses_file}: times rise", rising, True)
        within = [interval["start"], interval["stop"] - 1] == [times[0], times[-1]]
        exported.expect(f"{poses_file}: times are those of the sequence", within, True)
    for span in spans if have_poses and fit_shutter else ():
        frame = f"cameras/{name}/frames/{span[1]}"
        place = store.file(f"{frame}/generic_data/.zattrs")
        with reading(place, "frame of NCore"):
            about = store.attributes(f"{frame}/generic_data")
            exposed = about.get("exposure_us")
            view = _view(poses_file, str(about["name"]), span, exposed, poses, exported)
            exported.views.append(view)
        picture = store.file(f"{frame}/image/0")
        with reading(picture, "PNG"):
            content = picture.read_bytes()
            exported.expect(f"{picture}: first bytes", content[:8], _PNG)
            exported.expect(f"{picture}: size", struct.unpack(">II", content[16:24]), size)
            dtype = store.metadata[f"{frame}/image/.zarray"]["dtype"]
            exported.expect(f"{picture}: type", dtype, f"|S{len(content)}")
        mask = f"{frame}/generic_data/mask"
        if f"{mask}/.zarray" in store.metadata:
            shape = store.array(mask).shape
            exported.expect(f"{store.file(mask)}: shape", shape, (size[1], size[0]))


def _view(
    file: Path,
    name: str,
    span: tuple[int, int],
    exposed: tuple[int, int] | None,
    poses: dict[int, tuple[int, Floats]],
    exported: Exported,
) -> ExportedView:
    """Return the view of a frame. ``poses`` are numbers and poses by their times.

    ``exposed`` are the start and the end of a moving camera's exposure. In its middle it is at the
    view's pose.
    """
    begin, finish = exposed or span
    row, matrix = poses[(begin + finish) // 2]
    if exposed is None:
        return ExportedView(file, f"poses[{row}]", name, matrix)
    ends = poses[begin][1], poses[finish][1]
    for time in span:
        number_of_pose, pose = poses[time]
        between = pose_between(*ends, (time - begin) / (finish - begin))
        exported.expect(f"{file}: poses[{number_of_pose}] ({name})", pose.tolist(), between)
    return ExportedView(file, f"poses[{row}]", name, matrix, ends)


def read_points(store: Store, time: int, exported: Exported) -> None:
    """Read the points: what a lidar at the world's origin measures at a time in microseconds."""
    bundle = f"{POINTS}/{time}/ray_bundle"
    place = store.file(bundle)
    with reading(place, "points of NCore"):
        pose = store.attributes("poses/default/static_poses")[POINT_POSE]["pose"]
        matrix = numbers(pose, (4, 4))
        directions = store.array(f"{bundle}/direction").astype(np.float64)
        distances = store.array(f"{bundle}_returns/distance_m").astype(np.float64)[0]
        # A damaged number may be anything.
        with np.errstate(over="ignore", invalid="ignore"):
            lengths = np.linalg.norm(directions, axis=-1)
            points: Floats = directions * distances[:, None] @ matrix[:3, :3].T + matrix[:3, 3]
        exported.expect(f"{place}: n_rays", store.attributes(bundle)["n_rays"], len(points))
        colours = store.array(f"{POINTS}/{time}/generic_data/rgb").shape
        exported.expect(f"{place}: colours", colours, (len(points), 3))
    for index in np.flatnonzero(~(np.abs(lengths - 1) < 1e-5)).tolist():
        exported.faults.append(f"{place}: point {index}: its direction is not a unit vector")
    exported.clouds.append(Cloud(place, "point", np.arange(len(points)), points))


def _camera(attributes: dict[str, Any], place: str, exported: Exported) -> Camera:
    parameters = attributes["camera_model_parameters"]
    width, height = (int(side) for side in parameters["resolution"])
    cx, cy = numbers(parameters["principal_point"], (2,)).tolist()
    kind = attributes["camera_model_type"]
    if kind == "opencv-pinhole":
        prism = parameters["thin_prism_coeffs"]
        exported.expect(f"{place}: thin_prism_coeffs", prism, [0.0] * 4)
        fx, fy = numbers(parameters["focal_length"], (2,)).tolist()
        k1, k2, *others = numbers(parameters["radial_coeffs"], (6,)).tolist()
        tangential = numbers(parameters["tangential_coeffs"], (2,)).tolist()
        distortion = (k1, k2, *tangential, *others)
        if any(distortion):
            return OfColmap(width, height, "FULL_OPENCV", (fx, fy, cx, cy, *distortion))
        return Pinhole(width, height, fx, fy, cx, cy)
    if kind == "opencv-fisheye":
        fx, fy = numbers(parameters["focal_length"], (2,)).tolist()
        radial = numbers(parameters["radial_coeffs"], (4,)).tolist()
        return OpenCVFisheye(width, height, fx, fy, cx, cy, *radial)
    if kind != "ftheta":
        raise ValueError(f"camera_model_type: {kind!r} is none of NCore's")
    exported.expect(f"{place}: reference_poly", parameters["reference_poly"], "ANGLE_TO_PIXELDIST")
    forward = numbers(parameters["angle_to_pixeldist_poly"], (6,))
    largest = number(parameters["max_angle"])
    angles = np.linspace(0, largest, 9)
    radii = np.polynomial.polynomial.polyval(angles, forward)
    # The other polynomial is the inverse, and the image circle touches the upper edge.
    backward = numbers(parameters["pixeldist_to_angle_poly"], (6,))
    again = np.polynomial.polynomial.polyval(radii, backward)
    exported.expect(f"{place}: pixeldist_to_angle_poly", again, angles)
    exported.expect(f"{place}: max_angle in pixels", radii[-1], height / 2)
    terms = tuple(forward.tolist())
    linear = tuple(numbers(parameters["linear_cde"], (3,)).tolist())
    # Principal points of f-theta count from the middle of the first pixel.
    return FTheta(width, height, cx + 0.5, cy + 0.5, terms, linear, largest)


def _cbor(content: bytes, place: int) -> tuple[Any, int]:
    """Decode one value of CBOR. Return it and the place after it. Source: RFC 8949."""
    kind, low = content[place] >> 5, content[place] & 31
    place += 1
    if kind == 7:
        if low == 27:
            return struct.unpack_from(">d", content, place)[0], place + 8
        return {20: False, 21: True, 22: None}[low], place
    value = low
    if low >= 24:
        form = {24: ">B", 25: ">H", 26: ">I", 27: ">Q"}[low]
        value = struct.unpack_from(form, content, place)[0]
        place += struct.calcsize(form)
    if kind in (0, 1):
        return (value if kind == 0 else -1 - value), place
    if kind == 3:
        return content[place : place + value].decode(), place + value
    entries = []
    for _ in range(value * {4: 1, 5: 2}[kind]):
        entry, place = _cbor(content, place)
        entries.append(entry)
    return (entries if kind == 4 else dict(zip(entries[::2], entries[1::2], strict=True))), place
