"""Places the eye of a video: on a turntable around what the cameras look at, or on a walk.

Both paths end where they begin. The eye always looks at the same point, the target. The cameras'
volume is given by its planes (n, 4), as in `lightfield.report.walk.bounds`.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lightfield.geometry.rotations import looking_at, nearest_to_axes

Array = NDArray[Any]

# Cameras look inward if the mean cosine between their directions and the way to their middle is
# above this.
_INWARD = 0.5
# They surround their target if no two neighbours are farther apart, in radians as seen from above.
_WIDEST_GAP = math.radians(120)
# An eye that looks more steeply, in radians, has no turntable around a vertical line.
_STEEP = math.radians(60)
# The eye turns by at most so much to each side, in radians, to find where it leaves the volume, in
# so many steps.
_WIDEST_TURN = math.pi / 2
_STEPS = 500
# Places this near to the volume, in metres, are in it.
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Standpoint:
    """Where an eye begins, ``at`` (3,), and the ``target`` (3,) at which it looks."""

    at: Array
    target: Array

    @property
    def ahead(self) -> Array:
        """The unit direction (3,) to the target."""
        way = self.target - self.at
        ahead: Array = way / np.linalg.norm(way)
        return ahead

    @property
    def is_steep(self) -> bool:
        return abs(float(self.ahead[2])) > math.sin(_STEEP)

    @property
    def up(self) -> Array:
        """The direction (3,) that is up in all pictures: the world's, unless the eye looks down."""
        return np.array([0.0, 1.0, 0.0] if self.is_steep else [0.0, 0.0, 1.0])

    def poses(self, places: Array) -> Array:
        """Return the poses (n, 4, 4) of eyes at ``places`` (n, 3) that look at the target."""
        poses = np.tile(np.eye(4), (len(places), 1, 1))
        poses[:, :3, :3] = looking_at(places, self.target, self.up.tolist())
        poses[:, :3, 3] = places
        return poses


def common_target(world_from_cameras: Array) -> Array | None:
    """Return the point (3,) nearest to the axes of all cameras. None if they do not look inward."""
    places = world_from_cameras[:, :3, 3]
    ahead = -world_from_cameras[:, :3, 2]
    inward = places.mean(axis=0) - places
    lengths = np.linalg.norm(inward, axis=1)
    cosines = (inward * ahead).sum(axis=1) / np.maximum(lengths, 1e-9)
    if cosines.mean() < _INWARD:
        return None
    return nearest_to_axes(places, ahead)


def turntable(standpoint: Standpoint, places: Array, planes: Array, count: int) -> Array:
    """Return the poses (count, 4, 4) of an eye that goes around the target.

    If the cameras at ``places`` (n, 3) surround the target, the eye makes a full circle at its
    distance and height. Otherwise it sways to both sides, half as far as it stays in their volume.
    """
    turns = np.arange(count) * 2 * math.pi / count
    if not _surround(standpoint, places):
        turns = _reach(standpoint, planes) / 2 * np.sin(turns)
    return standpoint.poses(_turned(standpoint, turns))


def walk(standpoint: Standpoint, planes: Array, count: int) -> Array:
    """Return the poses (count, 4, 4) of an eye that walks a loop, forward and to both sides.

    The loop is half as far forward and half as far to each side as the volume reaches, but no
    farther forward than a quarter of the way to the target.
    """
    right = standpoint.poses(standpoint.at[None])[0, :3, 0]
    most = float(np.linalg.norm(standpoint.target - standpoint.at)) / 2
    sideways = min(most, *(_free_way(standpoint.at, way, planes) for way in (right, -right)))
    forward = min(most, _free_way(standpoint.at, standpoint.ahead, planes))
    turns = np.arange(count)[:, None] * 2 * math.pi / count
    loop = (
        forward / 4 * (1 - np.cos(turns)) * standpoint.ahead + sideways / 2 * np.sin(turns) * right
    )
    return standpoint.poses(standpoint.at + loop)


def _surround(standpoint: Standpoint, places: Array) -> bool:
    """Return whether cameras are on all sides of the target, as seen from above."""
    offsets = places - standpoint.target
    angles = np.sort(np.arctan2(offsets[:, 1], offsets[:, 0]))
    gaps = np.diff(angles, append=angles[0] + 2 * math.pi)
    return not standpoint.is_steep and float(gaps.max()) <= _WIDEST_GAP + 1e-9


def _reach(standpoint: Standpoint, planes: Array) -> float:
    """Return the largest angle in radians by which the eye may turn to both sides."""
    angles = np.geomspace(1e-4, _WIDEST_TURN, _STEPS)
    is_inside = _inside(_turned(standpoint, angles), planes) & _inside(
        _turned(standpoint, -angles), planes
    )
    leaving = np.flatnonzero(~is_inside)
    last = (leaving[0] if leaving.size else _STEPS) - 1
    return float(angles[last]) if last >= 0 else 0.0


def _turned(standpoint: Standpoint, angles: Array) -> Array:
    """Return the places (n, 3) of the eye, turned by ``angles`` (n,) around the target."""
    turns = Rotation.from_rotvec(angles[:, None] * standpoint.up)
    places: Array = standpoint.target + turns.apply(standpoint.at - standpoint.target)
    return places


def _inside(places: Array, planes: Array) -> Array:
    inside: Array = (places @ planes[:, :3].T + planes[:, 3] <= _TOLERANCE).all(axis=1)
    return inside


def _free_way(at: Array, way: Array, planes: Array) -> float:
    """Return how far in metres an eye may go from ``at`` along a unit ``way`` in the volume."""
    towards = planes[:, :3] @ way
    to_plane = -(planes[:, :3] @ at + planes[:, 3])
    is_ahead = towards > 1e-9
    return max(0.0, float((to_plane[is_ahead] / towards[is_ahead]).min()))
