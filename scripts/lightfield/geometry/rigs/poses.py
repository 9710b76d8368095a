"""A rig of poses that a file lists.

The file is a lightfield.json, a CSV with angles or quaternions, a transforms.json, COLMAP's
images.txt or images.bin, or one that `trajectories` reads. Only its poses are read. The scene YAML
gives the lens.
"""

import csv
import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_bytes, read_error, read_json, read_text
from lightfield.engine import receipts
from lightfield.geometry import colmap
from lightfield.geometry.frames import (
    MIRRORED,
    SKEWED,
    Frame,
    check_mapping,
    check_name,
    read_frames,
    read_numbers,
)
from lightfield.geometry.rigs.rig import Rig, UnitPoses
from lightfield.geometry.rigs.trajectories import (
    FORMATS,
    read_kubric,
    read_trajectory,
    refuse_others,
    unit,
)
from lightfield.geometry.rotations import (
    OPENCV_AXES,
    TOLERANCE,
    Floats,
    euler_to_matrix,
    is_mirrored,
    is_skewed,
    matrix_to_euler,
    quaternion_to_matrix,
)
from lightfield.settings.base import FARTHEST, pattern

CSV_HEADER = ["name", "x", "y", "z", "rx", "ry", "rz"]
_QUATERNION_HEADER = ["name", "x", "y", "z", "qw", "qx", "qy", "qz"]
_LF_TYPES = ("PLANE", "CUBOID", "CYLINDER", "SPHERE")
# The axes of a camera in our axes, by the camera_convention of a transforms.json.
_CAMERA_AXES = {"opengl": np.eye(4), "opencv": OPENCV_AXES}
# In bytes. It is enough for 100,000 poses of the longest form.
LARGEST_FILE = 2**28


class PosesFile(NamedTuple):
    """The checked poses of a file.

    There are n ``names``. ``positions`` (n, 3) are in metres. ``rotations`` (n, 3) are XYZ Euler
    angles in radians.
    """

    lf_type: str
    names: list[str]
    positions: Floats
    rotations: Floats


class Listing(NamedTuple):
    """The poses that a file lists, not yet checked. ``matrix_key`` is its name for matrices."""

    lf_type: str
    matrix_key: str
    frames: list[Frame]


class Poses(Rig):
    """Poses from a file.

    Presets set ``max_views``, an even subset. A scene YAML cannot.
    """

    shape = "PLANE"
    is_loose = True

    type: Literal["poses"]
    file: str = Field(
        pattern=pattern(r"\.(json|csv|txt|bin)$", "a path that ends in .json, .csv, .txt or .bin"),
        description="Path of the file with the poses: a lightfield.json, a transforms.json, "
        "COLMAP's images.txt or images.bin, a trajectory of KITTI or TUM (.txt), Kubric's "
        "metadata.json, or a CSV. The CSV's header is name,x,y,z,rx,ry,rz (metres and radians) or "
        "name,x,y,z,qw,qx,qy,qz.",
    )
    max_views: SkipJsonSchema[int | None] = Field(None, ge=1)

    @property
    def positions(self) -> int:
        return len(self._rows(len(_read_poses(Path(self.file)).names)))

    @property
    def lf_type(self) -> str:
        """The type that the file gives."""
        return _read_poses(Path(self.file)).lf_type

    def warnings(self) -> Iterator[str]:
        """Yield a line if angles of the file are most likely degrees."""
        largest = np.abs(_read_poses(Path(self.file)).rotations).max()
        if largest > 2 * math.pi + TOLERANCE:
            yield (
                f"{self.file}: its angles reach {largest:.4g}, which is more than a whole turn in "
                "radians; if they are degrees, convert them to radians"
            )

    def unit_poses(self) -> UnitPoses:
        poses = _read_poses(Path(self.file))
        rows = self._rows(len(poses.names))
        names = [poses.names[row] for row in rows]
        return UnitPoses(names, rows, poses.positions[rows], poses.rotations[rows])

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"max_views": positions}) if positions else None

    def _rows(self, count: int) -> NDArray[np.int64]:
        """Return the rows of the file that are used: all, or ``max_views`` spread evenly."""
        views = min(self.max_views or count, count)
        rows: NDArray[np.int64] = np.round(np.linspace(0, count - 1, views)).astype(np.int64)
        return rows


def _read_poses(path: Path) -> PosesFile:
    """Read and check a file of poses. A file that has not changed is read only once."""
    receipts.note_inputs([path])
    try:
        status = path.stat()
    except OSError as error:
        raise read_error(path, error) from None
    if status.st_size > LARGEST_FILE:
        raise UserError(
            f"{path}: has {units.size(status.st_size)}; must be at most {units.size(LARGEST_FILE)}"
        )
    return _read_checked(path, (status.st_ino, status.st_mtime_ns))


@lru_cache(maxsize=8)
def _read_checked(path: Path, _version: tuple[int, int]) -> PosesFile:
    lf_type, matrix_key, frames = _READERS[path.suffix](path)
    if not frames:
        raise UserError(f"{path}: holds no pose")
    names: set[str] = set()
    for frame in frames:
        check_name(f"{path}: {frame.where}: name", frame.name)
        if frame.name in names:
            raise UserError(f"{path}: {frame.where}: name: {frame.name!r} occurs twice")
        names.add(frame.name)
    world_from_cameras = _stacked([frame.world_from_camera for frame in frames], (4, 4))
    positions = _stacked([frame.position for frame in frames], (3,))
    rotations = _stacked([frame.rotation for frame in frames], (3,))
    places = [frame.where for frame in frames]
    _check_poses(path, places, world_from_cameras, positions, rotations, matrix_key)
    only_matrix = np.isnan(positions[:, 0])
    positions[only_matrix] = world_from_cameras[only_matrix, :3, 3]
    rotations[only_matrix] = matrix_to_euler(world_from_cameras[only_matrix, :3, :3])
    return PosesFile(lf_type, [frame.name for frame in frames], positions, rotations)


def _stacked(arrays: Sequence[Floats | None], shape: tuple[int, ...]) -> Floats:
    """Return the arrays as one. One that is missing is NaN."""
    missing = np.full(shape, math.nan)
    return np.array([missing if array is None else array for array in arrays])


def _check_poses(
    path: Path,
    where: Sequence[str],
    world_from_cameras: Floats,
    positions: Floats,
    rotations: Floats,
    matrix_key: str,
) -> None:
    """Raise `UserError` for a wrong pose of a file.

    ``where`` names each pose. ``world_from_cameras`` (n, 4, 4) and ``positions`` (n, 3) are in
    metres, and ``rotations`` (n, 3) are XYZ Euler angles in radians. Numbers that a pose lacks are
    NaN.
    """

    def refuse(wrong: NDArray[np.bool_], why: str) -> None:
        if wrong.any():
            raise UserError(f"{path}: {where[int(np.argmax(wrong))]}: {why}")

    far = (np.abs(np.hstack([world_from_cameras[:, :3, 3], positions])) > FARTHEST).any(-1)
    refuse(far, f"position: must be within {FARTHEST:g} metres of the origin")
    turns = world_from_cameras[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        last_row = np.abs(world_from_cameras[:, 3] - [0, 0, 0, 1]).max(-1)
        angle_gap = np.abs(turns - euler_to_matrix(rotations)).max((-1, -2))
        place_gap = np.abs(world_from_cameras[:, :3, 3] - positions).max(-1)
    # NaN, of a missing form, is never more than the tolerance.
    refuse(is_skewed(turns), f"{matrix_key}: {SKEWED}")
    refuse(is_mirrored(turns), f"{matrix_key}: {MIRRORED}")
    refuse(last_row > TOLERANCE, f"{matrix_key}: its last row must be 0, 0, 0, 1")
    refuse(angle_gap > TOLERANCE, "world_matrix and rotation: must be the same rotation")
    refuse(
        place_gap > TOLERANCE * np.maximum(1, np.abs(positions).max(-1)),
        "world_matrix and position: must be the same place",
    )


def _read_csv(path: Path) -> Listing:
    """Read a CSV with angles or quaternions."""
    frames = []
    try:
        with StringIO(read_text(path), newline="") as file:
            reader = csv.reader(file)
            keys = next(reader, [])
            _refuse_others(path, keys)
            if keys not in (CSV_HEADER, _QUATERNION_HEADER):
                raise UserError(
                    f"{path}: row 1: must be {','.join(CSV_HEADER)} (metres, radians) "
                    f"or {','.join(_QUATERNION_HEADER)}, not {','.join(keys)}"
                )
            for row in reader:
                if row:
                    frames.append(_csv_frame(path, f"row {reader.line_num}", keys, row))
    except csv.Error as error:
        raise UserError(f"{path}: is not CSV: {error}") from None
    return Listing(Poses.shape, "quaternion", frames)


def _csv_frame(path: Path, where: str, keys: Sequence[str], row: Sequence[str]) -> Frame:
    """Return the pose in a row of a CSV, whose header is ``keys``."""
    if len(row) != len(keys):
        raise UserError(f"{path}: {where}: has {len(row)} values, not {len(keys)}")
    numbers = np.array(
        [
            _number(path, f"{where}: {key}", value)
            for key, value in zip(keys[1:], row[1:], strict=True)
        ]
    )
    if keys == CSV_HEADER:
        return Frame(where, row[0], position=numbers[:3], rotation=numbers[3:])
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = quaternion_to_matrix(_unit(path, where, numbers[3:]))
    world_from_camera[:3, 3] = numbers[:3]
    return Frame(where, row[0], world_from_camera)


def _read_json(path: Path) -> Listing:
    """Read a lightfield.json or a transforms.json."""
    content = read_json(path)
    frames = content.get("frames") if isinstance(content, dict) else None
    if isinstance(content, dict) and frames is None:
        _refuse_others(path, content)
    try:
        if isinstance(content, dict) and (kubric := read_kubric(content)):
            return Listing(Poses.shape, "quaternion", kubric)
        if not isinstance(frames, list):
            raise UserError(f"frames: must be a list of views; {FORMATS}")
        first = frames[0] if frames and isinstance(frames[0], dict) else {}
        if "transform_matrix" in first or "transform_matrix_start" in first:
            return Listing(Poses.shape, "transform_matrix", _transforms_frames(content))
        lf_type = content.get("lf_type", Poses.shape)
        if lf_type not in _LF_TYPES:
            raise UserError(f"lf_type: must be one of {', '.join(_LF_TYPES)}, not {lf_type!r}")
        return Listing(lf_type, "world_matrix", read_frames(frames))
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _transforms_frames(content: Mapping[str, Any]) -> list[Frame]:
    """Return the poses of a transforms.json, whose axes are ours unless it says otherwise.

    Undoes nerfstudio's applied_transform and applied_scale. Source: nerfstudio's
    nerfstudio_dataparser.py and base_dataparser.py; instant-ngp's nerf_loader.cu; MapAnything's
    data_processing/README.md.
    """
    if content.get("from_mitsuba"):
        raise UserError("from_mitsuba: has other axes; write the poses without it")
    convention = content.get("camera_convention", "opengl")
    if not isinstance(convention, str) or convention not in _CAMERA_AXES:
        allowed = " or ".join(_CAMERA_AXES)
        raise UserError(f"camera_convention: is {convention!r}; must be {allowed}")
    applied = np.eye(4)
    if "applied_transform" in content:
        key = "applied_transform"
        applied[:3] = read_numbers(key, content[key], (3, 4))
        if abs(np.linalg.det(applied)) < 1e-12:
            raise UserError(f"{key}: cannot be inverted")
    scale = 1.0
    if "applied_scale" in content:
        scale = float(read_numbers("applied_scale", content["applied_scale"], ()))
        if scale <= 0:
            raise UserError(f"applied_scale: is {scale:g}; must be above 0")
    files = []
    world_from_cameras = []
    for index, frame in enumerate(content["frames"]):
        where = f"frames[{index}]"
        check_mapping(where, frame)
        if "transform_matrix_start" in frame:
            raise UserError(
                f"{where}: transform_matrix_start: describes a camera that moves; give each frame "
                "one transform_matrix"
            )
        key = "transform_matrix"
        world_from_cameras.append(read_numbers(f"{where}: {key}", frame.get(key), (4, 4)))
        if not isinstance(frame.get("file_path"), str):
            raise UserError(f"{where}: file_path: must be a text, not {frame.get('file_path')!r}")
        files.append(frame["file_path"])
    names = _view_names(files)
    originals = _unapplied(np.array(world_from_cameras) @ _CAMERA_AXES[convention], applied, scale)
    return [
        Frame(f"frames[{index}]", name, world_from_camera)
        for index, (name, world_from_camera) in enumerate(zip(names, originals, strict=True))
    ]


def _unapplied(world_from_cameras: Floats, applied: Floats, scale: float) -> Floats:
    """Return camera-to-world matrices (n, 4, 4) before a transform and then a scale were applied.

    The scale changed only the positions. A transform (4, 4) that scales, too, changed either the
    positions alone, or the whole matrices. Raises `UserError` if no rotation can have been before.
    """
    unscaled = world_from_cameras.copy()
    with np.errstate(over="ignore"):
        unscaled[:, :3, 3] /= scale
        originals: Floats = np.linalg.inv(applied) @ unscaled
    are_rotations = _are_rotations(world_from_cameras)
    originals[are_rotations, :3, :3] *= abs(np.linalg.det(applied)) ** (1 / 3)
    if (are_rotations & ~_are_rotations(originals)).any():
        raise UserError(
            "applied_transform: its first 3 × 3 must be a rotation, or one with a scale that is "
            "the same along each axis"
        )
    return originals


def _are_rotations(world_from_cameras: Floats) -> NDArray[np.bool_]:
    """Return which matrices (n, 4, 4) neither scale nor shear nor mirror."""
    turns = world_from_cameras[:, :3, :3]
    return ~is_skewed(turns) & ~is_mirrored(turns)


def _read_colmap(path: Path) -> Listing:
    """Read COLMAP's images.txt or images.bin, or another trajectory in a .txt."""
    is_text = path.suffix == ".txt"
    if is_text and (trajectory := read_trajectory(path, read_text(path))):
        return Listing(Poses.shape, "matrix", trajectory)
    images = [*(_colmap_text(path) if is_text else _colmap_binary(path))]
    names = _view_names([image for _, _, image in images])
    frames = []
    for (where, values, _), name in zip(images, names, strict=True):
        numbers = np.array([_number(path, where, value) for value in values])
        world_from_camera = colmap.world_from_camera(_unit(path, where, numbers[:4]), numbers[4:])
        frames.append(Frame(where, name, world_from_camera))
    return Listing(Poses.shape, "quaternion", frames)


def _colmap_text(path: Path) -> Iterator[tuple[str, Sequence[str], str]]:
    """Yield the place in the file, seven numbers and the name of each image in an images.txt.

    Skips comments and the lines of an image's points. Such a line is empty if the image has no
    points, and some programs leave it out.
    """
    may_be_points = False
    for line in read_text(path).splitlines():
        if not line.strip() or line.startswith("#") or (may_be_points and _are_points(line)):
            may_be_points = False
            continue
        number, *fields = line.split(maxsplit=9)
        where = f"image {number}"
        if len(fields) != 9:
            raise UserError(
                f"{path}: {where}: must be IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; "
                f"{FORMATS}"
            )
        yield where, fields[:7], fields[8]
        may_be_points = True


def _are_points(line: str) -> bool:
    """Return whether a line holds an image's points (x, y, number), and not another image."""
    try:
        return len([float(field) for field in line.split()]) % 3 == 0
    except ValueError:
        return False


def _colmap_binary(path: Path) -> Iterator[tuple[str, Sequence[float], str]]:
    """Yield the place in the file, seven numbers and the name of each image in an images.bin."""
    content = read_bytes(path)
    try:
        (count,), start = struct.unpack_from("<Q", content), 8
        for _ in range(count):
            number, *numbers, _ = struct.unpack_from("<i7di", content, start)
            start += struct.calcsize("<i7di")
            end = content.index(b"\0", start)
            name = content[start:end].decode()
            (points,) = struct.unpack_from("<Q", content, end + 1)
            start = end + 9 + points * struct.calcsize("<ddq")
            if start > len(content):
                raise ValueError
            yield f"image {number}", numbers, name
    except (struct.error, ValueError):
        raise UserError(f"{path}: is not COLMAP's images.bin, or is cut short") from None


_READERS = {".csv": _read_csv, ".json": _read_json, ".txt": _read_colmap, ".bin": _read_colmap}


def _refuse_others(path: Path, header: Sequence[str] | Mapping[str, Any]) -> None:
    """Raise `UserError` for a CSV's ``header``, or a JSON, of a known format that is not read."""
    try:
        refuse_others(header)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _view_names(files: Sequence[str]) -> list[str]:
    """Return the names of views by the paths of their images, without suffix.

    A name has as many folders before it as all names need to differ: cam0_0001, cam1_0001.
    """
    paths = [_parts(file) for file in files]
    for count in range(1, max(map(len, paths), default=0) + 1):
        names = ["_".join(parts[-count:]) for parts in paths]
        if len({*names}) == len(names):
            return names
    return [parts[-1] for parts in paths]


def _parts(file: str) -> list[str]:
    """Return the folders of an image's path, and its name without suffix."""
    stem = re.sub(r"(?i)\.(png|jpe?g|exr|tiff?|webp)$", "", file.replace("\\", "/"))
    return [part for part in stem.split("/")[:-1] if part not in ("", ".", "..")] + [
        stem.rpartition("/")[2]
    ]


def _number(path: Path, where: str, value: str | float) -> float:
    """Return a finite number, which a text may give."""
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UserError(f"{path}: {where}: must be a finite number, not {value!r}")
    return number


def _unit(path: Path, where: str, quaternion: Floats) -> Floats:
    """Return a quaternion (4,) with length 1, because files round it."""
    try:
        return unit(quaternion)
    except UserError as error:
        raise UserError(f"{path}: {where}: {error}") from None
