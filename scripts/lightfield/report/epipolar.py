"""Makes epipolar-plane images: one line of pixels from every camera of a row, beneath each other.

Bolles, Baker and Marimont, *Epipolar-plane image analysis*, 1987. Cameras of a straight row share
the planes through their baseline. Let u be the tangent of the angle from the perpendicular to the
baseline. In such a plane, a point at the perpendicular distance D draws a straight line. It shifts
by 1/D in u for each metre along the baseline. Cameras of a level ring share only the plane of the
ring. Over the azimuth in the world, infinitely far points stand still there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs import Rig

Array = NDArray[Any]

_FEWEST_CAMERAS = 3
TILTS = tuple(range(-40, 41, 10))
"""Degrees by which an image's plane, or a ring's cone, is raised above the level one."""
COLUMNS = {"line": 512, "ring": 720}
# A straight row's images end at this angle. Beyond it, tangents grow too fast for the pixels.
WIDEST = math.radians(60)


@dataclass(frozen=True)
class Row:
    """Cameras in a straight ``line`` or a level ``ring``, in order.

    - ``views``: their numbers.
    - ``axes`` (3, 3), in rows. For a line: its direction, the cameras' viewing direction, and up.
      For a ring: the directions at azimuth 90° and 0°, and up.
    - ``places``: metres along a line, or the azimuth in radians round a ring.
    """

    kind: Literal["line", "ring"]
    views: list[int]
    axes: Array
    places: Array


def find_row(rig: Rig, world_from_cameras: Array) -> Row | None:
    """Return the row in the middle of a rig, or None if no three cameras are in a row.

    ``world_from_cameras`` (views, 4, 4) are the poses of all its views. A grid has the middle row
    of its front. A sphere has the level of cameras nearest the equator.
    """
    if rig.is_omnidirectional:
        return None
    faces = rig.views_a_position
    local = (world_from_cameras[::faces, :3, 3] - rig.middle) @ rig.turn
    numbers = rig.middle_row(local)
    if len(numbers) < _FEWEST_CAMERAS:
        return None
    views = [number * faces for number in numbers]
    if rig.is_round:
        azimuth = np.arctan2(local[numbers, 0], local[numbers, 1])
        order = np.argsort(azimuth, kind="stable")
        return Row("ring", [views[i] for i in order], rig.turn.T, azimuth[order])
    places = world_from_cameras[views, :3, 3]
    along = places[-1] - places[0]
    length = float(np.linalg.norm(along))
    if length == 0:
        return None
    along = along / length
    if along @ world_from_cameras[views[0], :3, 0] < 0:
        along = -along
        views = views[::-1]
        places = places[::-1]
    forward = -world_from_cameras[views[0], :3, 2]
    forward = forward - (forward @ along) * along
    forward = forward / np.linalg.norm(forward)
    axes = np.stack([along, forward, np.cross(along, forward)])
    return Row("line", views, axes, (places - places.mean(axis=0)) @ along)


def directions(row: Row, tilt: float, columns: int) -> Array:
    """Return the world directions (columns, 3) of an image whose plane is raised by ``tilt``.

    For a line, their part perpendicular to it has the length 1: D times a direction reaches the
    depth D. For a ring they are unit vectors.
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
    world_from_camera: Array,
    colour: Array,
    depth: Array | None,
    meaning: str | None,
    rays: Array,
) -> tuple[Array, Array]:
    """Return the light (n, 3) and depth (n,) that a view has along world ``rays`` (n, 3).

    ``depth`` is the stored depth with this ``meaning``. The returned depth is in lengths of the
    rays: a point lies at position + depth · ray. Light is interpolated. Depth comes from the
    nearest pixel. NaN depth marks rays that the lens does not see.
    """
    height, width = colour.shape[:2]
    camera_rays = rays @ world_from_camera[:3, :3]
    x, y = np.moveaxis(lens.pixels(camera_rays), -1, 0)
    with np.errstate(invalid="ignore"):
        visible = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    light = np.zeros((len(rays), 3), np.float32)
    at = (y[visible] - 0.5, x[visible] - 0.5)
    for channel in range(3):
        light[visible, channel] = map_coordinates(colour[..., channel], at, order=1, mode="nearest")
    reach = np.full(len(rays), np.nan)
    reach[visible] = np.inf
    if depth is not None:
        column = np.minimum(x[visible].astype(int), width - 1)
        line = np.minimum(y[visible].astype(int), height - 1)
        stored = depth[line, column].astype(np.float64)
        distance = converted(stored, lens.rays(column + 0.5, line + 0.5), meaning, "distance")
        reach[visible] = distance / np.linalg.norm(camera_rays[visible], axis=-1)
    return light, reach


def thinned(views: Sequence[int], most: int) -> list[int]:
    """Return at most ``most`` positions in ``views``: evenly spread, with the first and last."""
    count = min(len(views), most)
    return [round(i) for i in np.linspace(0, len(views) - 1, count).tolist()]
