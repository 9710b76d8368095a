"""Poses as COLMAP has them: world to camera, with x right, y down and z forward.

Source: COLMAP's format.rst.
"""

import numpy as np

from lightfield.geometry.rotations import (
    OPENCV_AXES,
    Floats,
    matrix_to_quaternion,
    quaternion_to_matrix,
)

_FLIP = OPENCV_AXES[:3, :3]


def pose(world_from_camera: Floats) -> tuple[list[float], list[float]]:
    """Return the quaternion (w, x, y, z) and the translation of a camera-to-world matrix (4, 4)."""
    turn = _FLIP @ world_from_camera[:3, :3].T
    return matrix_to_quaternion(turn).tolist(), (-turn @ world_from_camera[:3, 3]).tolist()


def relative_pose(first_from_other: Floats) -> tuple[list[float], list[float]]:
    """Return the pose, from one camera to another, of a matrix (4, 4) from the other to the one.

    The matrix is between our axes. The quaternion (w, x, y, z) and the translation are between
    COLMAP's.
    """
    first = np.eye(4)
    first[:3, :3] = _FLIP
    return pose(first @ first_from_other)


def world_from_camera(quaternion: Floats, translation: Floats) -> Floats:
    """Return the camera-to-world matrix (4, 4) of a unit quaternion (w, x, y, z) and (3,)."""
    turn = quaternion_to_matrix(quaternion)
    matrix = np.eye(4)
    matrix[:3, :3] = turn.T @ _FLIP
    matrix[:3, 3] = -turn.T @ translation
    return matrix
