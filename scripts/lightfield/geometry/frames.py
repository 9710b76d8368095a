"""The frames of lightfield.json: the name and the pose of each view.

This is their only reader. `lightfield.formats.lightfield` makes views of them, and
`lightfield.geometry.rigs.poses` makes a rig of them.
"""

from collections.abc import Mapping, Sequence
from reprlib import repr as shortened
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.rotations import Floats, is_mirrored, is_skewed
from lightfield.settings.base import FARTHEST

# Cameras are at one place if they are nearer to each other than this, in metres.
ONE_PLACE = 1e-6

# Planning a dataset of more views would take minutes.
MOST_VIEWS = 100_000

# In bytes, because the name becomes a file's.
LONGEST_NAME = 200

SKEWED = "its first 3 × 3 must be a rotation, without scale"
MIRRORED = "its first 3 × 3 must be a rotation, and mirrors"


class Frame(NamedTuple):
    """A view's name and pose as a file gives them. A form of the pose that it lacks is None.

    ``where`` says in messages where the frame stands in its file. ``world_from_camera`` (4, 4) is
    camera-to-world, in metres. ``position`` (3,) is in metres, and ``rotation`` (3,) holds XYZ
    Euler angles in radians: there are both or neither. ``others`` are the frame's other keys.
    """

    where: str
    name: str
    world_from_camera: Floats | None = None
    position: Floats | None = None
    rotation: Floats | None = None
    others: Mapping[str, Any] = MappingProxyType({})


def read_frames(frames: Any) -> list[Frame]:
    """Return the frames of a lightfield.json, from the value of its key ``frames``.

    A pose is ``world_matrix``, or ``position`` and ``rotation``, or both, which are not compared.
    Raises `UserError` that names the frame and the key, but not the file.
    """
    check_list(frames)
    if not frames:
        raise UserError("frames: is empty")
    if len(frames) > MOST_VIEWS:
        raise UserError(f"frames: are {len(frames):,}; must be at most {MOST_VIEWS:,}")
    views = [_frame(f"frames[{index}]", content) for index, content in enumerate(frames)]
    names: set[str] = set()
    for frame in views:
        if frame.name in names:
            raise UserError(f"{frame.where}: {frame.name}: is the name of two frames")
        names.add(frame.name)
    _check_rotations([frame for frame in views if frame.world_from_camera is not None])
    return views


def _check_rotations(frames: Sequence[Frame]) -> None:
    """Raise `UserError` for the first matrix of ``frames`` that scales, shears or mirrors."""
    turns = np.array([frame.world_from_camera for frame in frames]).reshape(-1, 4, 4)[:, :3, :3]
    for wrong, problem in ((is_skewed(turns), SKEWED), (is_mirrored(turns), MIRRORED)):
        if wrong.any():
            raise UserError(f"{frames[int(np.argmax(wrong))].where}: world_matrix: {problem}")


def check_list(frames: Any) -> None:
    """Raise `UserError` unless ``frames`` is a list."""
    if not isinstance(frames, list):
        raise UserError("frames: must be a list of views")


def check_mapping(where: str, content: Any) -> None:
    """Raise `UserError` unless one of ``frames`` is a mapping."""
    if not isinstance(content, dict):
        raise UserError(f"{where}: must be a mapping, not {shortened(content)}")


def check_name(where: str, name: Any) -> None:
    """Raise `UserError` if a view's name cannot name its files."""
    if (
        not isinstance(name, str)
        or not name.isprintable()
        or not 0 < len(name.encode()) <= LONGEST_NAME
        or name != name.strip(" .")
        or set(name) & set("/\\")
    ):
        raise UserError(f"{where}: must be a file name, not {shortened(name)}")


def read_numbers(where: str, value: Any, shape: tuple[int, ...]) -> Floats:
    """Return the numbers of nested lists as an array of the given shape.

    Raises `UserError` that names the wrong element, as in ``world_matrix[0][3]``.
    """
    _check_numbers(where, value, shape)
    return np.array(value, np.float64)


def _check_numbers(where: str, value: Any, shape: tuple[int, ...]) -> None:
    if shape:
        length, *rest = shape
        if not isinstance(value, list) or len(value) != length:
            raise UserError(f"{where}: must be a list of {length}, not {shortened(value)}")
        for index, element in enumerate(value):
            _check_numbers(f"{where}[{index}]", element, tuple(rest))
    # NaN fails the comparison, too.
    elif (
        not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= FARTHEST
    ):
        raise UserError(
            f"{where}: must be a finite number from -{FARTHEST:g} to {FARTHEST:g}, "
            f"not {shortened(value)}"
        )


def _frame(where: str, content: Any) -> Frame:
    """Return one of ``frames``."""
    check_mapping(where, content)
    others = dict(content)
    name = others.pop("name", None)
    check_name(f"{where}: name", name)
    pose = {
        key: read_numbers(f"{where}: {key}", others.pop(key), shape)
        for key, shape in (("world_matrix", (4, 4)), ("position", (3,)), ("rotation", (3,)))
        if key in others
    }
    for missing_key, given_key in (("position", "rotation"), ("rotation", "position")):
        if missing_key not in pose and given_key in pose:
            raise UserError(f"{where}: {missing_key}: is missing beside {given_key}")
    if "flow" in others:
        # It names files, too.
        check_name(f"{where}: flow", others["flow"])
    if not pose:
        raise UserError(f"{where}: world_matrix: is missing, or position and rotation are")
    return Frame(
        where,
        name,
        world_from_camera=pose.get("world_matrix"),
        position=pose.get("position"),
        rotation=pose.get("rotation"),
        others=others,
    )
