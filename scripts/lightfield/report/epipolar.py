"""Epipolar-plane images: one line of sight of every camera of a row, beneath each other.

Bolles, Baker and Marimont, *Epipolar-plane image analysis*, 1987. Cameras of a straight row share
the planes through their baseline. In such a plane, with u the tangent of the angle from the
perpendicular to the baseline, a point at the perpendicular distance D draws a straight line that
shifts by 1/D in u for each metre along the baseline. Cameras of a level ring share only the plane
of the ring; there, over the azimuth in the world, the endlessly far stands still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from lightfield.geometry.depth import stored_distance
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs import Rig

Array = NDArray[Any]

FEWEST_CAMERAS = 3
TILTS = tuple(range(-40, 41, 10))
"""Degrees by which an image's plane, or cone round a ring, is raised above the level one."""
COLUMNS = {"line": 512, "ring": 720}
# A straight row's images end at this angle, where tangents grow faster than there are pixels.
WIDEST = math.radians(60)


@dataclass(frozen=True)
class Row:
    """Cameras in a straight ``line`` or a level ``ring``, in order.

    ``views`` are their numbers; ``axes`` (3, 3) are in its rows: of a line its direction, the
    direction that the cameras look in, and up; of a ring the directions at azimuth 90° and 0°,
    and up. ``places`` are metres along a line, or the azimuth in radians round a ring.
    """

    kind: Literal["line", "ring"]
    views: list[int]
    axes: Array
    places: Array


def find_row(rig: Rig, matrices: Array) -> Row | None:
    """Return the row in the middle of a rig, or None where no three cameras are in one.

    ``matrices`` (views, 4, 4) are the poses of all its views. A grid's is its front's middle row;
    a sphere's is the level of cameras nearest the equator.
    """
    if rig.is_omnidirectional:
        return None
    faces = rig.views_a_position
    local = (matrices[::faces, :3, 3] - np.array(rig.center)) @ rig.turn
    numbers = rig.middle_row(local)
    if len(numbers) < FEWEST_CAMERAS:
        return None
    views = [number * faces for number in numbers]
    if rig.is_round:
        azimuth = np.arctan2(local[numbers, 0], local[numbers, 1])
        order = np.argsort(azimuth, kind="stable")
        return Row("ring", [views[i] for i in order], rig.turn.T, azimuth[order])
    places = matrices[views, :3, 3]
    along = places[-1] - places[0]
    length = float(np.linalg.norm(along))
    if length == 0:
        return None
    along = along / length
    if along @ matrices[views[0], :3, 0] < 0:
        along = -along
        views = views[::-1]
        places = places[::-1]
    forward = -matrices[views[0], :3, 2]
    forward = forward - (forward @ along) * along
    forward = forward / np.linalg.norm(forward)
    axes = np.stack([along, forward, np.cross(along, forward)])
    return Row("line", views, axes, (places - places.mean(axis=0)) @ along)


def directions(row: Row, tilt: float, columns: int) -> Array:
    """Return the world directions (columns, 3) of an image whose plane is raised by ``tilt``.

    A line's have the length 1 perpendicular to it, so that they times D reach the depth D; a
    ring's have the length 1.
    """
    side, ahead, up = row.axes
    middle = (np.arange(columns) + 0.5) / columns
    lift = math.radians(tilt)
    if row.kind == "line":
        tangents = (2 * middle - 1) * math.tan(WIDEST)
        rays: Array = tangents[:, np.newaxis] * side + math.cos(lift) * ahead + math.sin(lift) * up
        return rays
    azimuth = (2 * middle - 1) * math.pi
    level = np.sin(azimuth)[:, np.newaxis] * side + np.cos(azimuth)[:, np.newaxis] * ahead
    rays = math.cos(lift) * level + math.sin(lift) * up
    return rays


def sample(
    lens: Lens,
    matrix: Array,
    colour: Array,
    depth: Array | None,
    meaning: str | None,
    rays: Array,
) -> tuple[Array, Array]:
    """Return the light (n, 3) and depth (n,) that a view has along world ``rays`` (n, 3).

    ``depth`` is what the view stores, ``meaning`` says which; the result is in lengths of the
    rays: a point lies at position + depth · ray. Light is interpolated, depth is the nearest
    pixel's. NaN depth marks what the lens does not see.
    """
    height, width = colour.shape[:2]
    own = rays @ matrix[:3, :3]
    x, y = np.moveaxis(lens.pixels(own), -1, 0)
    with np.errstate(invalid="ignore"):
        seen = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    light = np.zeros((len(rays), 3), np.float32)
    at = (y[seen] - 0.5, x[seen] - 0.5)
    for channel in range(3):
        light[seen, channel] = map_coordinates(colour[..., channel], at, order=1, mode="nearest")
    reach = np.full(len(rays), np.nan)
    reach[seen] = np.inf
    if depth is not None:
        column = np.minimum(x[seen].astype(int), width - 1)
        line = np.minimum(y[seen].astype(int), height - 1)
        found = depth[line, column].astype(np.float64)
        found = stored_distance(found, lens.rays(column + 0.5, line + 0.5), meaning)
        reach[seen] = found / np.linalg.norm(own[seen], axis=-1)
    return light, reach


def thinned(views: Sequence[int], most: int) -> list[int]:
    """Return at most ``most`` positions in ``views``, evenly spread, first and last among them."""
    count = min(len(views), most)
    return [round(i) for i in np.linspace(0, len(views) - 1, count).tolist()]
