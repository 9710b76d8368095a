"""Questions about a view's depth, which check an export's claims.

They are answered while the view is read for all other checks.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.validation.consistency import Camera

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Question:
    """A question about one view.

    - ``points`` (n, 3): points that an export claims to have lifted from it.
    - ``meaning``: asks for the nearest and the farthest depth, as "z" or "distance". None asks for
      neither.
    - ``step``: asks for the world points of every ``step``-th pixel along both axes. 0 asks for
      none.
    """

    points: NDArray[Any]
    meaning: str | None = None
    step: int = 0


@dataclass(frozen=True)
class Answer:
    """The answer of a view.

    - ``gaps`` (n,): how many metres each point is from what its pixel sees. NaN for a miss.
    - ``nearest`` and ``farthest``: depths in metres, inf for a miss.
    - ``has_unknown``: whether a depth is NaN.
    - ``world_points`` (m, 3): the world points of every ``step``-th pixel that hits something.
    """

    gaps: Floats
    nearest: float
    farthest: float
    has_unknown: bool
    world_points: Floats


def answer(question: Question, camera: Camera, depth: NDArray[Any]) -> Answer:
    """Answer a question about a view's ``depth`` (height, width)."""
    nearest = np.inf
    farthest = 0.0
    has_unknown = False
    if question.meaning:
        values = converted(depth, camera, question.meaning)
        is_known = ~np.isnan(values)
        has_unknown = not is_known.all()
        if is_known.any():
            nearest = float(np.nanmin(values))
            farthest = float(np.nanmax(values))
    world_points = np.empty((0, 3))
    if question.step:
        down, across = (np.arange(question.step // 2, side, question.step) for side in depth.shape)
        columns, rows = (axis.ravel() for axis in np.meshgrid(across, down))
        world_points = camera.lift(depth[rows, columns].astype(np.float64), columns, rows)
        world_points = world_points[np.isfinite(world_points).all(axis=1)]
    gaps = _gaps(question.points, camera, depth)
    return Answer(gaps, nearest, farthest, has_unknown, world_points)


def converted(depth: NDArray[Any], camera: Camera, meaning: str) -> NDArray[Any]:
    """Return a view's depth (height, width) as "z" or "distance". NaN where it has no value."""
    if meaning == camera.depth:
        return depth
    values: NDArray[Any] = depth * _factors(camera.lens, meaning)
    return values


@lru_cache(maxsize=1)
def _factors(lens: Lens, meaning: str) -> Floats:
    """Return the factors (height, width) that convert the other kind of depth to this one."""
    cosine = -lens.pixel_rays()[..., 2]
    cosine = np.where(cosine > 0, cosine, np.nan)
    factors: Floats = cosine if meaning == "z" else 1 / cosine
    return factors


def _gaps(points: NDArray[Any], camera: Camera, depth: NDArray[Any]) -> Floats:
    """Return how far world points (n, 3) are from what their pixels see. NaN for a miss."""
    # A damaged point may be anywhere.
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = camera.pixels(points.astype(np.float64))
        size = [camera.lens.width, camera.lens.height]
        inside = ((pixels >= 0) & (pixels < size)).all(axis=1)
        columns, rows = np.where(inside[:, np.newaxis], pixels, 0).astype(np.int64).T
        lifted = camera.lift(depth[rows, columns].astype(np.float64), columns, rows)
        gaps = np.linalg.norm(lifted - points, axis=1)
    return np.where(inside & np.isfinite(gaps), gaps, np.nan)
