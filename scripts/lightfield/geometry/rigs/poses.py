"""A rig of poses that a file lists.

The file is a lightfield.json, a CSV with angles or quaternions, a transforms.json, or COLMAP's
images.txt or images.bin. Only its poses are read. The scene YAML gives the lens.
"""

import csv
import math
import re
import struct
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from lightfield.core.disk_space import gigabytes
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_problem, read_text
from lightfield.core.settings import FARTHEST, pattern
from lightfield.geometry import colmap
from lightfield.geometry.rigs.rig import Rig, UnitPoses
from lightfield.geometry.rotations import (
    Floats,
    euler_to_matrix,
    matrix_to_euler,
    quaternion_to_matrix,
)

CSV_HEADER = ["name", "x", "y", "z", "rx", "ry", "rz"]
QUATERNION_HEADER = ["name", "x", "y", "z", "qw", "qx", "qy", "qz"]
LF_TYPES = ("PLANE", "CUBOID", "CYLINDER", "SPHERE")
# Files round: how far a matrix may be from a rotation, and one form of a pose from the other.
TOLERANCE = 1e-4
# In bytes: enough for 100,000 poses of the longest form.
LARGEST_FILE = 2**28


class PosesFile(NamedTuple):
    """The poses of a file: names (n), positions (n, 3), and XYZ Euler angles (n, 3) in radians."""

    lf_type: str
    names: list[str]
    positions: Floats
    rotations: Floats


class Poses(Rig):
    """Poses from a file. Presets, but no scene YAML, set ``max_views``: an even subset."""

    shape = "PLANE"
    is_loose = True

    type: Literal["poses"]
    file: str = Field(
        pattern=pattern(r"\.(json|csv|txt|bin)$", "a path that ends in .json, .csv, .txt or .bin"),
        description="A lightfield.json; a CSV of name,x,y,z,rx,ry,rz in metres and radians, or of "
        "name,x,y,z,qw,qx,qy,qz; a transforms.json; COLMAP's images.txt or images.bin.",
    )
    max_views: SkipJsonSchema[int | None] = Field(None, ge=1)

    @property
    def positions(self) -> int:
        return len(self._rows(len(_read_poses(Path(self.file)).names)))

    @property
    def lf_type(self) -> str:
        """That of its file."""
        return _read_poses(Path(self.file)).lf_type

    def unit_poses(self) -> UnitPoses:
        poses = _read_poses(Path(self.file))
        rows = self._rows(len(poses.names))
        names = [poses.names[row] for row in rows]
        return UnitPoses(names, rows, poses.positions[rows], poses.rotations[rows])

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"max_views": positions}) if positions else None

    def _rows(self, count: int) -> NDArray[np.int64]:
        """Return which rows of the file are used: all, or ``max_views`` spread evenly."""
        views = min(self.max_views or count, count)
        rows: NDArray[np.int64] = np.round(np.linspace(0, count - 1, views)).astype(np.int64)
        return rows


def _read_poses(path: Path) -> PosesFile:
    """Read a file of poses, and check all of it. The same file is read only once."""
    try:
        status = path.stat()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None
    if status.st_size > LARGEST_FILE:
        size = gigabytes(status.st_size)
        raise UserError(f"{path}: has {size}; must be at most {gigabytes(LARGEST_FILE)}")
    return _read_whole(path, status.st_mtime_ns)


@lru_cache(maxsize=8)
def _read_whole(path: Path, _changed: int) -> PosesFile:
    rows = _ROWS[path.suffix](path)
    lf_type, form = next(rows)
    names: dict[str, str] = {}
    vectors, matrices = [], []
    for where, name, vector, matrix in rows:
        check_name(f"{path}: {where}: name", name)
        if name in names:
            raise UserError(f"{path}: {where}: name: {name!r} is there twice")
        names[name] = where
        vectors.append([_number(path, f"{where}: {key}", value) for key, value in vector])
        matrices.append([_number(path, f"{where}: {key}", value) for key, value in matrix])
    if not names:
        raise UserError(f"{path}: holds no pose")
    nothing = [math.nan]
    table = np.array([vector or nothing * 6 for vector in vectors])
    given = np.array([matrix or nothing * 16 for matrix in matrices]).reshape(-1, 4, 4)
    check_poses(path, list(names.values()), given, table, form)
    alone = np.isnan(table[:, 0])
    table[alone] = np.hstack([given[alone, :3, 3], matrix_to_euler(given[alone, :3, :3])])
    return PosesFile(lf_type, list(names), table[:, :3], table[:, 3:])


def check_name(where: str, name: Any) -> None:
    """Raise `UserError` if a view's name cannot name its files."""
    if (
        not isinstance(name, str)
        or not name.isprintable()
        or not 0 < len(name.encode()) <= 200
        or name != name.strip(" .")
        or set(name) & set("/\\")
    ):
        raise UserError(f"{where}: must be a file name, not {name!r}")


def check_poses(
    path: Path, where: Sequence[str], matrices: Floats, vectors: Floats, form: str = "world_matrix"
) -> None:
    """Raise `UserError` for a wrong pose of a file. A pose has one of two forms, or both.

    ``where`` names each pose. ``matrices`` (n, 4, 4) are camera-to-world. ``vectors`` (n, 6) are
    positions in metres and XYZ Euler angles in radians. A form that a pose lacks is NaN. ``form``
    is what the file calls the matrices.
    """

    def refuse(wrong: NDArray[np.bool_], why: str) -> None:
        if wrong.any():
            raise UserError(f"{path}: {where[int(np.argmax(wrong))]}: {why}")

    positions = np.concatenate([matrices[:, :3, 3], vectors[:, :3]], axis=1)
    far = (np.abs(positions) > FARTHEST).any(-1)
    refuse(far, f"position: must be within {FARTHEST:g} metres of the origin")
    turns = matrices[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(turns @ turns.swapaxes(-1, -2) - np.eye(3)).max((-1, -2))
        mirrored = np.linalg.det(turns) < 0
        last = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(-1)
        apart = np.abs(turns - euler_to_matrix(vectors[:, 3:])).max((-1, -2))
        away = np.abs(matrices[:, :3, 3] - vectors[:, :3]).max(-1)
    # Of a form that is not given all these are NaN, which is never more.
    refuse(skew > TOLERANCE, f"{form}: its first 3 × 3 must be a rotation, without scale")
    refuse(mirrored, f"{form}: its first 3 × 3 must be a rotation, and mirrors")
    refuse(last > TOLERANCE, f"{form}: its last row must be 0, 0, 0, 1")
    refuse(apart > TOLERANCE, "world_matrix and rotation: must be the same rotation")
    refuse(
        away > TOLERANCE * np.maximum(1, np.abs(vectors[:, :3]).max(-1)),
        "world_matrix and position: must be the same place",
    )


def _number(path: Path, where: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number) or isinstance(value, bool):
        raise UserError(f"{path}: {where}: must be a finite number, not {value!r}")
    return number


def _csv_rows(path: Path) -> Iterator[Any]:
    """Yield what `_json_rows` yields, from a CSV with angles or quaternions."""
    yield Poses.shape, "quaternion"
    try:
        # Spreadsheets begin a file with a byte order mark.
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            keys = next(reader, [])
            if keys not in (CSV_HEADER, QUATERNION_HEADER):
                raise UserError(
                    f"{path}: row 1: must be {','.join(CSV_HEADER)} (metres, radians) "
                    f"or {','.join(QUATERNION_HEADER)}, not {','.join(keys)}"
                )
            for row in reader:
                if not row:
                    continue
                where = f"row {reader.line_num}"
                if len(row) != len(keys):
                    raise UserError(f"{path}: {where}: has {len(row)} values, not {len(keys)}")
                if keys == CSV_HEADER:
                    yield where, row[0], list(zip(keys[1:], row[1:], strict=True)), []
                    continue
                numbers = [
                    _number(path, f"{where}: {key}", value)
                    for key, value in zip(keys[1:], row[1:], strict=True)
                ]
                matrix = np.eye(4)
                matrix[:3, :3] = quaternion_to_matrix(_unit(path, where, numbers[3:]))
                matrix[:3, 3] = numbers[:3]
                yield where, row[0], [], _keyed(matrix)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: is not CSV: {error}") from None


def _json_rows(path: Path) -> Iterator[Any]:
    """Yield lf_type and the matrices' key, then where, name, position and angles, and matrix.

    Position and angles are one list of (key, value), and so is the matrix; one may be empty.
    """
    content = read_json(path)
    frames = content.get("frames") if isinstance(content, dict) else None
    if not isinstance(frames, list):
        raise UserError(f"{path}: frames: must be a list of views")
    if frames and isinstance(frames[0], dict) and "transform_matrix" in frames[0]:
        yield from _transforms_rows(path, content)
        return
    lf_type = content.get("lf_type", Poses.shape)
    if lf_type not in LF_TYPES:
        allowed = ", ".join(LF_TYPES)
        raise UserError(f"{path}: lf_type: must be one of {allowed}, not {lf_type!r}")
    yield lf_type, "world_matrix"
    for index, frame in enumerate(frames):
        where = f"frames[{index}]"
        if not isinstance(frame, dict):
            raise UserError(f"{path}: {where}: must be a mapping, not {frame!r}")
        vector, matrix = [], []
        if "world_matrix" not in frame or "position" in frame or "rotation" in frame:
            for key in ("position", "rotation"):
                vector += _numbered(path, f"{where}: {key}", key, frame.get(key), 3)
        if "world_matrix" in frame:
            matrix = _matrix(path, where, "world_matrix", frame["world_matrix"], 4)
        yield where, frame.get("name"), vector, matrix


def _transforms_rows(path: Path, content: dict[str, Any]) -> Iterator[Any]:
    """Yield what `_json_rows` yields, from a transforms.json, whose axes are ours.

    Undoes nerfstudio's applied_transform. Source: nerfstudio's data
    conventions; instant-ngp's nerf_dataset_tips.md.
    """
    yield Poses.shape, "transform_matrix"
    undone = np.eye(4)
    if "applied_transform" in content:
        key = "applied_transform"
        rows = _matrix(path, key, key, content[key], 3)
        undone[:3] = np.reshape([_number(path, k, value) for k, value in rows], (3, 4))
        if abs(np.linalg.det(undone)) < 1e-12:
            raise UserError(f"{path}: {key}: cannot be undone")
        undone = np.linalg.inv(undone)
    for index, frame in enumerate(content["frames"]):
        where = f"frames[{index}]"
        if not isinstance(frame, dict):
            raise UserError(f"{path}: {where}: must be a mapping, not {frame!r}")
        rows = _matrix(path, where, "transform_matrix", frame.get("transform_matrix"), 4)
        numbers = [_number(path, f"{where}: {key}", value) for key, value in rows]
        matrix = undone @ np.reshape(numbers, (4, 4))
        yield where, _view_name(path, where, frame.get("file_path")), [], _keyed(matrix)


def _colmap_rows(path: Path) -> Iterator[Any]:
    """Yield what `_json_rows` yields, from COLMAP's images.txt or images.bin."""
    yield Poses.shape, "quaternion"
    read = _colmap_text if path.suffix == ".txt" else _colmap_binary
    for where, numbers, name in read(path):
        values = [_number(path, where, value) for value in numbers]
        quaternion = _unit(path, where, values[:4])
        matrix = colmap.camera_to_world(quaternion, np.array(values[4:]))
        yield where, _view_name(path, where, name), [], _keyed(matrix)


def _colmap_text(path: Path) -> Iterator[tuple[str, Sequence[Any], str]]:
    """Yield where it stands, seven numbers and the name of each image in an images.txt.

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
                f"{path}: {where}: must be IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"
            )
        yield where, fields[:7], fields[8]
        may_be_points = True


def _are_points(line: str) -> bool:
    """Return whether a line holds an image's points (x, y, number), and not another image."""
    try:
        return len([float(word) for word in line.split()]) % 3 == 0
    except ValueError:
        return False


def _colmap_binary(path: Path) -> Iterator[tuple[str, Sequence[Any], str]]:
    """Yield where it stands, seven numbers and the name of each image in an images.bin."""
    content = path.read_bytes()
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
        raise UserError(f"{path}: is no images.bin of COLMAP's, or is cut short") from None


_ROWS = {".csv": _csv_rows, ".json": _json_rows, ".txt": _colmap_rows, ".bin": _colmap_rows}


def _view_name(path: Path, where: str, image: Any) -> str:
    """Return the name of an image file without its folders and suffix."""
    if not isinstance(image, str):
        raise UserError(f"{path}: {where}: file_path: must be a text, not {image!r}")
    return re.sub(r"(?i)\.(png|jpe?g|exr|tiff?|webp)$", "", image.rpartition("/")[2])


def _unit(path: Path, where: str, quaternion: Sequence[float]) -> Floats:
    """Return a quaternion (4,) with length 1, because files round it."""
    length = math.hypot(*quaternion)
    if not abs(length - 1) <= TOLERANCE:
        raise UserError(f"{path}: {where}: quaternion: has the length {length:g}; must be 1")
    return np.array(quaternion) / length


def _keyed(matrix: Floats) -> list[tuple[str, float]]:
    return [("matrix", value) for value in matrix.ravel().tolist()]


def _matrix(path: Path, where: str, key: str, value: Any, rows: int) -> list[tuple[str, Any]]:
    """Return (key, value) for each number of a matrix with four columns."""
    numbers = []
    for index, (_, row) in enumerate(_numbered(path, f"{where}: {key}", "row", value, rows)):
        row_key = f"{key}[{index}]"
        numbers += _numbered(path, f"{where}: {row_key}", row_key, row, 4)
    return numbers


def _numbered(path: Path, where: str, key: str, values: Any, count: int) -> list[tuple[str, Any]]:
    """Return (key, value) for each value of a list."""
    if not isinstance(values, list) or len(values) != count:
        raise UserError(f"{path}: {where}: must be a list of {count}, not {values!r}")
    return [(f"{key}[{index}]", value) for index, value in enumerate(values)]
