"""Finds the views from which exported points were lifted.

A point that was lifted from a view lies on the ray of a pixel's centre. Exporters lift one view
after the other. So the views of two points bound the views of all points between them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.validation.readers.contents import FLOAT32, Floats

Ints = NDArray[np.int64]

# At most this many pairs of a point and a view are tested at once.
MOST_PAIRS = 300_000


def likely_views(points: NDArray[Any], lens: Lens, matrices: Floats) -> tuple[Ints, Ints]:
    """Return pairs as two arrays of indices: points, and views from which they may be lifted.

    ``points`` (n, 3) must be in the order of their views, whose ``matrices`` are (m, 4, 4). The
    search bisects. It tests the middle point with all views. The views on whose pixels' rays it
    lies bound the views of the points before and after it. A point may be in no pair, or in
    several.
    """
    low = np.array([0])
    high = np.array([len(points)])
    first = np.array([0])
    last = np.array([len(matrices) - 1])
    pairs = [(np.empty(0, np.int64), np.empty(0, np.int64))]
    while True:
        settled = first == last
        for start, end, view in zip(low[settled], high[settled], first[settled], strict=True):
            pairs.append((np.arange(start, end), np.full(end - start, view)))
        is_open = (first < last) & (low < high)
        low, high, first, last = (each[is_open] for each in (low, high, first, last))
        counts = last - first + 1
        if not 0 < counts.sum() <= MOST_PAIRS:
            break
        middle = (low + high) // 2
        which = np.repeat(np.arange(len(middle)), counts)
        view = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts - first, counts)
        near = on_pixel_rays(points[middle[which]], lens, matrices[view])
        which = which[near]
        view = view[near]
        pairs.append((middle[which], view))
        least = last.copy()
        most = first.copy()
        np.minimum.at(least, which, view)
        np.maximum.at(most, which, view)
        unknown = most < least
        least = np.where(unknown, first, least)
        most = np.where(unknown, last, most)
        low = np.concatenate([low, middle + 1])
        high = np.concatenate([middle, high])
        first = np.concatenate([first, least])
        last = np.concatenate([most, last])
    point_indices, view_indices = zip(*pairs, strict=True)
    return np.concatenate(point_indices), np.concatenate(view_indices)


def on_pixel_rays(points: NDArray[Any], lens: Lens, matrices: Floats) -> NDArray[np.bool_]:
    """Return whether each point (n, 3) lies on the ray of a pixel's centre of its view.

    ``matrices`` are (n, 4, 4).
    """
    # A damaged point may be anywhere.
    with np.errstate(invalid="ignore", over="ignore"):
        away = points.astype(np.float64) - matrices[:, :3, 3]
        local = np.einsum("nij,ni->nj", matrices[:, :3, :3], away)
        pixels = lens.pixels(local)
        x, y = np.floor(pixels.T) + 0.5
        rays = lens.rays(x, y)
        beside = local - (local * rays).sum(axis=1, keepdims=True) * rays
        inside = ((pixels >= 0) & (pixels < [lens.width, lens.height])).all(axis=1)
        near: NDArray[np.bool_] = inside & (np.linalg.norm(beside, axis=1) <= resolved(points))
    return near


def resolved(points: NDArray[Any]) -> Floats:
    """Return how many metres (n,) points (n, 3) may be off because they are stored as float32."""
    with np.errstate(invalid="ignore"):
        limit: Floats = FLOAT32 * (1 + np.abs(points.astype(np.float64)).max(axis=1, initial=0))
    return limit
