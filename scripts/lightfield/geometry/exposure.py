"""The poses of a camera that moves while the shutter is open."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def pose_at(
    world_from_camera: Floats, travel: Sequence[float], turn: Sequence[float], time: float
) -> Floats:
    """Return the camera-to-world matrix (4, 4) at a ``time`` from −½, the start, to ½, the end.

    ``world_from_camera`` is the pose at time 0. ``travel`` (3,) are the metres of a whole exposure
    along the camera's right, up and back. ``turn`` (3,) is a rotation vector in degrees about the
    same axes. Both have constant speed.
    """
    pose = world_from_camera.copy()
    pose[:3, 3] += world_from_camera[:3, :3] @ np.asarray(travel, np.float64) * time
    pose[:3, :3] = world_from_camera[:3, :3] @ _rotation(np.radians(turn) * time)
    return pose


def pose_between(start: Floats, end: Floats, part: float) -> Floats:
    """Return the pose (4, 4) at a ``part`` from 0 to 1 of an exposure, from its two end poses.

    The position moves on a line, and the rotation turns about one axis, by less than 180°.
    """
    rotation = start[:3, :3].T @ end[:3, :3]
    twice_sine = np.array([rotation[2, 1], rotation[0, 2], rotation[1, 0]]) - np.array(
        [rotation[1, 2], rotation[2, 0], rotation[0, 1]]
    )
    length = float(np.linalg.norm(twice_sine))
    angle = float(np.arctan2(length, np.trace(rotation) - 1))
    axis = twice_sine / length if length else np.zeros(3)
    pose = start.copy()
    pose[:3, 3] += (end - start)[:3, 3] * part
    pose[:3, :3] = start[:3, :3] @ _rotation(axis * angle * part)
    return pose


def row_times(height: int, rolling: float) -> Floats:
    """Return the time, −½ to ½, in the middle of the exposure of each row (height,), top first.

    ``rolling`` is the part of the exposure in which one row sees light, as in Cycles.
    """
    rows = np.arange(1, height + 1) / height
    return np.asarray((rows - 0.5) * (1 - rolling))


def _rotation(vector: Floats) -> Floats:
    """Return the matrix (3, 3) of a rotation vector (3,) in radians. Source: Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
