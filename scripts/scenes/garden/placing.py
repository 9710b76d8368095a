"""Where plants and stones are put: spots at random, and places on the ground."""

from collections.abc import Callable

import numpy as np
from mathutils import Matrix, Vector

from scenes.garden.plan import TAU, ground_height
from scenes.library.objects import transform
from scenes.library.points import Array, xyz


def spread(
    random: np.random.Generator,
    count: int,
    corners: tuple[float, float, float, float],
    spacing: float,
    allowed: Callable[[Array, Array], Array],
) -> Array:
    """Up to `count` points (n, 2) in a rectangle, at least `spacing` apart, where allowed."""
    chosen = np.empty((0, 2))
    for _ in range(12):
        tries = random.uniform(corners[:2], corners[2:], (count, 2))
        for point in tries[allowed(*tries.T)]:
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

    Upright but for a random tilt in radians, or square to the slope. sink: metres at scale 1.
    """
    (x, y), step = spots.T, 0.25
    rise_x = ground_height(x + step, y) - ground_height(x - step, y)
    rise_y = ground_height(x, y + step) - ground_height(x, y - step)
    ups = xyz(-rise_x, -rise_y, 2 * step) if sloping else xyz(0 * x, 0, 1)
    matrices = []
    for at, up in zip(xyz(x, y, ground_height(x, y)), ups, strict=True):
        size = random.uniform(*scale)
        turn = transform(rotation=(*random.normal(0, tilt, 2), random.uniform(0, TAU)), scale=size)
        square = Vector(up).to_track_quat("Z", "Y").to_matrix().to_4x4()
        matrices.append(Matrix.Translation(at - (0, 0, sink * size)) @ square @ turn)
    return matrices
