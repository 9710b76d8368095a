"""What exports claim of a view's depth, answered while the view is read for everything else."""

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
    """What is asked of one view.

    ``points`` (n, 3) are claimed to be lifted from it. ``meaning`` says for which depth, "z" or
    "distance", the nearest and the farthest are asked for; None asks for neither. ``step`` asks for
    the world points at every so-manyth pixel; 0 asks for none.
    """

    points: NDArray[Any]
    meaning: str | None = None
    step: int = 0


@dataclass(frozen=True)
class Answer:
    """What a view says.

    ``apart`` (n,) is how many metres each point is from what its pixel sees, NaN if that is
    nothing. ``nearest`` and ``farthest`` are in metres, inf for a miss; ``has_unknown`` says
    whether a depth is NaN. ``seen`` (m, 3) are the world points that were asked for.
    """

    apart: Floats
    nearest: float
    farthest: float
    has_unknown: bool
    seen: Floats


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
    seen = np.empty((0, 3))
    if question.step:
        down, across = (np.arange(question.step // 2, side, question.step) for side in depth.shape)
        columns, rows = (axis.ravel() for axis in np.meshgrid(across, down))
        seen = camera.lift(depth[rows, columns].astype(np.float64), columns, rows)
        seen = seen[np.isfinite(seen).all(axis=1)]
    apart = _apart(question.points, camera, depth)
    return Answer(apart, nearest, farthest, has_unknown, seen)


def converted(depth: NDArray[Any], camera: Camera, meaning: str) -> NDArray[Any]:
    """Return a view's depth (height, width) as "z" or "distance"; NaN where that cannot be."""
    if meaning == camera.depth:
        return depth
    values: NDArray[Any] = depth * _factors(camera.lens, meaning)
    return values


@lru_cache(maxsize=1)
def _factors(lens: Lens, meaning: str) -> Floats:
    """Return by what (height, width) the other kind of depth is multiplied to have this one."""
    cosine = -lens.pixel_rays()[..., 2]
    cosine = np.where(cosine > 0, cosine, np.nan)
    factors: Floats = cosine if meaning == "z" else 1 / cosine
    return factors


def _apart(points: NDArray[Any], camera: Camera, depth: NDArray[Any]) -> Floats:
    """Return how far world points (n, 3) are from what their pixels see; NaN if that is nothing."""
    # A damaged point may be anywhere.
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = camera.pixels(points.astype(np.float64))
        size = [camera.lens.width, camera.lens.height]
        inside = ((pixels >= 0) & (pixels < size)).all(axis=1)
        columns, rows = np.where(inside[:, np.newaxis], pixels, 0).astype(np.int64).T
        lifted = camera.lift(depth[rows, columns].astype(np.float64), columns, rows)
        apart = np.linalg.norm(lifted - points, axis=1)
    return np.where(inside & np.isfinite(apart), apart, np.nan)
