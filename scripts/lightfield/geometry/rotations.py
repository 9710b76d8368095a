"""Rotations as Blender writes them: matrices, and XYZ Euler angles in radians."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Files and Blender round numbers. An element of a matrix may differ by this much from a rotation's.
TOLERANCE = 1e-4

# The axes of a camera of computer vision (x right, y down, z forward) in Blender's (x right, y up,
# z backward).
OPENCV_AXES = np.diag([1.0, -1.0, -1.0, 1.0])


def is_skewed(matrix: Floats) -> Bools:
    """Return which matrices (…, 3, 3) scale or shear. NaN does not."""
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(matrix @ matrix.swapaxes(-1, -2) - np.eye(3)).max((-1, -2))
    return np.asarray(deviation > TOLERANCE)


def is_mirrored(matrix: Floats) -> Bools:
    """Return which matrices (…, 3, 3) turn a right hand into a left hand. NaN does not."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.linalg.det(matrix) < 0)


def euler_to_matrix(euler: Floats) -> Floats:
    """Return the rotations (…, 3, 3) of XYZ Euler angles (…, 3): Rz · Ry · Rx, as in Blender."""
    cx, cy, cz = np.moveaxis(np.cos(euler), -1, 0)
    sx, sy, sz = np.moveaxis(np.sin(euler), -1, 0)
    rows = [
        [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
        [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
        [-sy, sx * cy, cx * cy],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_euler(matrix: Floats) -> Floats:
    """Return the XYZ Euler angles (…, 3), in radians, of rotations (…, 3, 3).

    Two sets of angles give the same rotation. This returns the set with the smaller sum of
    magnitudes, as Blender's Matrix.to_euler does. At gimbal lock the rotation about Z is 0.
    """
    # A fresh zero is positive: rounding noise and -0 must not decide between +π and −π.
    m = np.where(np.abs(matrix) < 1e-15, 0.0, matrix)
    cosine = np.hypot(m[..., 0, 0], m[..., 1, 0])
    locked = cosine < 1e-12

    def angles(sign: float) -> Floats:
        x = np.where(
            locked,
            np.arctan2(-m[..., 1, 2], m[..., 1, 1]),
            np.arctan2(sign * m[..., 2, 1], sign * m[..., 2, 2]),
        )
        # Undo the rotation about X, and take Z from the result. So X and Z agree even near gimbal
        # lock. Source: Day, "Extracting Euler angles from a rotation matrix".
        sine = np.sin(x)
        cos = np.cos(x)
        z = np.arctan2(
            sine * m[..., 0, 2] - cos * m[..., 0, 1], cos * m[..., 1, 1] - sine * m[..., 1, 2]
        )
        y = np.arctan2(-m[..., 2, 0], sign * cosine)
        return np.stack([x, y, np.where(locked, 0.0, z)], axis=-1)

    first, second = angles(1.0), angles(-1.0)
    smaller = np.abs(second).sum(-1) < np.abs(first).sum(-1) - 1e-12
    return np.where((smaller & ~locked)[..., None], second, first)


def quaternion_to_matrix(quaternion: Floats) -> Floats:
    """Return the rotation (3, 3) of a unit quaternion (4,), in the order w, x, y, z."""
    w, x, y, z = quaternion
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix: Floats = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return matrix


def matrix_to_quaternion(matrix: Floats) -> Floats:
    """Return unit quaternions (…, 4), in the order w, x, y, z, of rotations (…, 3, 3)."""
    # SciPy takes long to import, and no plan needs it.
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(matrix).as_quat(), 1, axis=-1)


def looking_at(positions: Floats, target: Floats, up: Sequence[float] = (0.0, 0.0, 1.0)) -> Floats:
    """Return the rotations (n, 3, 3) of cameras at ``positions`` (n, 3) that look at a point (3,).

    +Y is as near to ``up`` as possible, an axis of the world. A camera straight above or below the
    point has its +X along the world's +X, if +Z is up. Raises `UserError` for a camera at the point
    itself.
    """
    back = positions - target
    length = np.linalg.norm(back, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise UserError(
            f"look_at: a camera is at {target.tolist()} itself, so it cannot look at that point"
        )
    back = back / length
    right = np.cross(up, back)
    upright = np.linalg.norm(right, axis=-1) <= 1e-4
    sides = np.sign(back[upright] @ np.array(up))[:, np.newaxis]
    right[upright] = np.cross(np.roll(up, -1), back[upright]) * sides
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    matrices: Floats = np.stack([right, np.cross(back, right), back], axis=-1)
    return matrices


def nearest_to_axes(positions: Floats, axes: Floats) -> Floats | None:
    """Return the point (3,) nearest to the optical axes of cameras, by least squares.

    ``axes`` (n, 3) are the unit directions in which the cameras at ``positions`` (n, 3) look. None
    if the axes are parallel.
    """
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.matrix_rank(normal, tol=1e-6 * len(positions)) < 3:
        return None
    point: Floats = np.linalg.solve(normal, (across @ positions[:, :, None]).sum(axis=0))[:, 0]
    return point
