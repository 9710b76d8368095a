"""Reads poses as KITTI, TUM and Kubric write them, and recognises poses that are not read.

Sources: KITTI's devkit/readme.txt; the file formats of the TUM RGB-D benchmark; Kubric's
core/objects.py and file_io.py; nerfstudio's camera_paths.py; Polycam's polyform; RealityScan's
exports; EuRoC's sensor.yaml.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.frames import Frame, read_numbers
from lightfield.geometry.rotations import OPENCV_AXES, TOLERANCE, Floats, quaternion_to_matrix

FORMATS = (
    "poses may be in a lightfield.json, a transforms.json, COLMAP's images.txt or images.bin, a "
    "trajectory of KITTI or TUM (.txt), Kubric's metadata.json, or a CSV with the header "
    "name,x,y,z,rx,ry,rz or name,x,y,z,qw,qx,qy,qz"
)
# What a JSON is that has a key, and what a CSV is whose header has a word.
_OTHER_JSON = {
    "camera_path": "a camera path of nerfstudio, whose world is scaled and turned",
    "t_00": "one camera of Polycam; convert the whole capture to a transforms.json",
}
_OTHER_CSV = {
    "p_RS_R_x": "EuRoC's poses of a body and not of a camera",
    "heading": "a table of RealityScan; export a transforms.json or COLMAP's files there",
}


def refuse_others(header: Sequence[str] | Mapping[str, Any]) -> None:
    """Raise `UserError` for the header of a CSV, or a JSON, of a known format that is not read."""
    hints = _OTHER_JSON if isinstance(header, Mapping) else _OTHER_CSV
    for word, format_name in hints.items():
        if any(word in key for key in header):
            raise UserError(f"is {format_name}; {FORMATS}")


def read_trajectory(path: Path, text: str) -> list[Frame] | None:
    """Return the poses of a trajectory of KITTI or TUM. None if the text is neither."""
    lines = {
        f"line {number}": line.split()
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    }
    first = next(iter(lines.values()), [])
    reader = _READERS.get(len(first))
    if reader is None or _numbers(first) is None:
        return None
    frames = []
    for index, (where, words) in enumerate(lines.items()):
        numbers = _numbers(words)
        if numbers is None or len(words) != len(first):
            raise UserError(f"{path}: {where}: must be {len(first)} finite numbers")
        try:
            name, world_from_camera = reader(index, words, numbers)
        except UserError as error:
            raise UserError(f"{path}: {where}: {error}") from None
        frames.append(Frame(where, name, world_from_camera @ OPENCV_AXES))
    return frames


def _numbers(words: Sequence[str]) -> Floats | None:
    """Return the numbers that words stand for. None if one is not a finite number."""
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        return None
    return numbers if np.isfinite(numbers).all() else None


def _of_kitti(index: int, words: Sequence[str], numbers: Floats) -> tuple[str, Floats]:
    """Return a pose's name, which is the name of KITTI's image, and its camera-to-world matrix."""
    return f"{index:06d}", np.vstack([numbers.reshape(3, 4), [0, 0, 0, 1]])


def _of_tum(index: int, words: Sequence[str], numbers: Floats) -> tuple[str, Floats]:
    """Return a pose's name, which is its time, and its camera-to-world matrix."""
    return words[0], _matrix(numbers[1:4], numbers[[7, 4, 5, 6]])


_LineReader = Callable[[int, Sequence[str], Floats], tuple[str, Floats]]
# By how many numbers a line has.
_READERS: Mapping[int, _LineReader] = {12: _of_kitti, 8: _of_tum}


def read_kubric(content: Mapping[str, Any]) -> list[Frame] | None:
    """Return the poses of a metadata.json of Kubric, whose axes are ours. None if it is none.

    Raises `UserError` that names the key, but not the file.
    """
    camera = content.get("camera")
    if not isinstance(camera, Mapping) or not isinstance(camera.get("positions"), list):
        return None
    count = len(camera["positions"])
    positions = read_numbers("camera: positions", camera["positions"], (count, 3))
    quaternions = read_numbers("camera: quaternions", camera.get("quaternions"), (count, 4))
    frames = []
    for index, (position, quaternion) in enumerate(zip(positions, quaternions, strict=True)):
        where = f"camera: quaternions[{index}]"
        try:
            world_from_camera = _matrix(position, quaternion)
        except UserError as error:
            raise UserError(f"{where}: {error}") from None
        # The name of Kubric's image.
        frames.append(Frame(where, f"rgba_{index:05d}", world_from_camera))
    return frames


def _matrix(position: Floats, quaternion: Floats) -> Floats:
    """Return a camera-to-world matrix (4, 4). The quaternion (w, x, y, z) may be rounded."""
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(unit(quaternion))
    matrix[:3, 3] = position
    return matrix


def unit(quaternion: Floats) -> Floats:
    """Return a quaternion (4,) with length 1, because files round it. Raises `UserError`."""
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1) <= TOLERANCE:
        raise UserError(f"quaternion: has the length {length:g}; must be 1")
    return quaternion / length
