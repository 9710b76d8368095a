"""Where things are in the garden: the court, the pond, the path, the ground's height, and spots.

The rigs stand in the middle of the court: no geometry comes near x, y in ±1 m, z in 0.5 … 1.5 m.
"""

from collections.abc import Callable, Sequence

import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library.materials import Color
from scenes.library.points import Array, noise, polar, smoothstep, xyz
from scenes.library.shapes import towards, transform

TAU = 2 * np.pi

COURT = (-2.7, -3.8, 4.3, 4.9)  # of raked gravel: a rectangle x0, y0, x1, y1
POND_CENTER = np.array([-5.5, 0.6])
POND_RADIUS = 2.3
WATER_LEVEL = -0.07
STATUE = (0.0, 3.75)
FIRE = (3.1, 1.1)
TORII = (0.2, -8.5)
MAPLE = (-2.05, -3.0)
ROCK_ISLANDS = ((2.75, -2.05, 0.75), (-1.85, 2.55, 0.5))  # x, y, radius
STONE_LANTERNS = ((4.95, 3.1, 1.0), (-1.3, -5.2, 1.1), (-4.6, 4.2, 0.9))  # x, y, scale
IN_THE_MOSS = [(x, y) for x, y, _ in STONE_LANTERNS]  # what stands there
IN_THE_MOSS += [MAPLE, (TORII[0] - 1.5, TORII[1]), (TORII[0] + 1.5, TORII[1])]
CANDLE_COLOR: Color = (1.0, 0.55, 0.22)  # of the lamps in lanterns and beside candles
SUN_AZIMUTH = np.radians(-174.0)


def pond_distance(x: ArrayLike, y: ArrayLike) -> Array:
    """Approximate distance in metres outside the pond's shore, negative within."""
    dx = x - POND_CENTER[0]
    dy = (y - POND_CENTER[1]) * 0.8
    angle = np.arctan2(dy, dx)
    shore = 1 + 0.13 * np.sin(2 * angle + 1.0) + 0.07 * np.sin(3 * angle) + 0.03 * np.sin(7 * angle)
    return np.hypot(dx, dy) - POND_RADIUS * shore


def pond_shore(angle: Array) -> Array:
    """The pond's outline (n, 2) by angle. `pond_distance` is 0 on it."""
    reach = np.full(len(angle), POND_RADIUS)
    for _ in range(30):
        points = POND_CENTER + polar(reach, angle)[:, :2]
        reach = reach - 0.7 * pond_distance(*points.T)
    return points


def court_distance(x: ArrayLike, y: ArrayLike) -> Array:
    """Distance outside the court's rectangle, negative within."""
    x0, y0, x1, y1 = COURT
    dx = np.maximum(x0 - x, x - x1)
    dy = np.maximum(y0 - y, y - y1)
    return np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) + np.minimum(np.maximum(dx, dy), 0)


def path_distance(x: ArrayLike, y: ArrayLike) -> Array:
    """Distance from the middle of the path that leads from the court to the torii and beyond."""
    middle = TORII[0] * smoothstep(-4.0, -8.0, y) + 0.15 * np.sin(y)
    return np.where(y < -3.5, np.abs(x - middle), np.hypot(x - middle, y + 3.5))


def ground_height(x: ArrayLike, y: ArrayLike) -> Array:
    """Height of the terrain: flat by the court, mossy mounds around, hills far off."""
    flat = xyz(x, y)
    distance = np.hypot(x, y)
    away = np.minimum(court_distance(x, y), path_distance(x, y) - 0.6)
    mounds = 0.30 * (noise(flat / 3.1, 11, 2) + 0.45) * smoothstep(0.1, 2.2, away)
    hills = 2.5 * (noise(flat / 23.0, 12, 2) + 0.3) * smoothstep(9.0, 40.0, distance)
    height = mounds + hills + 7.0 * smoothstep(25.0, 170.0, distance)
    shore = pond_distance(x, y)
    height = WATER_LEVEL + 0.06 + (height - WATER_LEVEL - 0.06) * smoothstep(0.0, 1.3, shore)
    height -= 0.6 * smoothstep(0.05, -0.9, shore)
    return np.where(court_distance(x, y) < 0.02, -0.08, height)


def spread(
    random: np.random.Generator,
    count: int,
    corners: Sequence[float],
    spacing: float,
    allowed: Callable[[Array, Array], Array] = lambda x, y: x == x,
    **off: float,
) -> Array:
    """Up to `count` points (n, 2) in a rectangle, at least `spacing` apart, where allowed.

    off: how far, at least, from court, pond and path.
    """
    distances = {"court": court_distance, "pond": pond_distance, "path": path_distance}
    chosen = np.empty((0, 2))
    for _ in range(12):
        x, y = tries = random.uniform(corners[:2], corners[2:], (count, 2)).T
        away = [distances[name](x, y) > least for name, least in off.items()]
        for point in tries.T[np.all([allowed(x, y), *away], axis=0)]:
            if len(chosen) < count and (np.hypot(*(chosen - point).T) >= spacing).all():
                chosen = np.vstack([chosen, point])
    return chosen


def standing(
    random: np.random.Generator,
    spots: Array,
    scale: tuple[float, float],
    sink: float = 0.0,
    tilt: float = 0.0,
    sloping: bool = False,
) -> list[Matrix]:
    """Places on the ground at spots (n, 2), each turned and scaled at random.

    Each is upright with a random tilt in radians, or perpendicular to the slope. sink: metres at
    scale 1.
    """
    x, y = spots.T
    step = 0.25
    rise_x = ground_height(x + step, y) - ground_height(x - step, y)
    rise_y = ground_height(x, y + step) - ground_height(x, y - step)
    ups = xyz(-rise_x, -rise_y, 2 * step) if sloping else xyz(0 * x, 0, 1)
    matrices = []
    for at, up in zip(xyz(x, y, ground_height(x, y)), ups, strict=True):
        size = random.uniform(*scale)
        turn = transform(rotation=(*random.normal(0, tilt, 2), random.uniform(0, TAU)), scale=size)
        matrices.append(towards(at - (0, 0, sink * size), up, "Z") @ turn)
    return matrices
