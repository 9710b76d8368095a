"""How far away reflections, and things behind glass, seem to be.

A mirror's depth is that of its glass, but what it shows moves as if it were behind it. So where
views disagree on a surface, a farther distance at which they agree is taken instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter, median_filter, uniform_filter

from lightfield.core.compiled import kernel
from lightfield.geometry.lenses import Array, Lens
from lightfield.imaging import pictures

# The inverse of the distance is tried in this many equal steps from the surface to infinity.
STEPS = 16
# A view is compared with this many others, those with the nearest cameras.
NEIGHBOURS = 6
# Larger views are compared at this many pixels along the longer side.
LARGEST = 256
# Differences of roots of colours are averaged over windows of this many pixels along a side.
WINDOW = 7
# Views disagree if the roots of their colours differ by more than this.
DISAGREE = 0.02
# They agree farther away if their difference is there less than this part of what it was.
BETTER = 0.85
# A window needs details to be compared: at least this standard deviation of the roots, and a
# surface in one piece: at most this part of its pixels beside a tear.
DETAIL = 0.04
TORN = 0.1
# A window must be seen by more than this many other views on average.
OTHERS = 1.0
# Reflections grow by at most this many pixels, on surfaces whose inverse distances differ by less
# than this part, where the difference in this smaller window is less than this part.
REACH = 16
FLAT = 0.3
EDGE = 3
GROWS = 1.0
# Views see the same surface if their distances differ by less than this part.
SAME = np.float32(0.05)
# Beyond this inverse distance, in 1/m, nothing can seem to be farther away.
FARTHEST = np.float32(0.02)


@dataclass(frozen=True)
class Picture:
    """A view to compare: ``root`` (h, w, 3) of its colour, ``inverse`` (h, w) distance, ``matrix``.

    ``inverse`` is in 1/m, NaN where there is no ray. ``matrix`` (4, 4) is camera-to-world.
    """

    root: Array
    inverse: Array
    matrix: Array


def picture(colour: Array, distance: Array, matrix: Array) -> Picture:
    """Return a view's linear ``colour`` (h, w, 3) and ``distance`` (h, w) as a small picture."""
    inverse = inverse_of(colour, distance)
    height, width = shape = small_shape(inverse.shape)
    colour = np.nan_to_num(colour).clip(min=0)
    if shape != inverse.shape:
        colour = pictures.shrunk(colour, width, height)
        row, column = (
            (np.arange(small) * full + full // 2) // small
            for small, full in zip(shape, inverse.shape, strict=True)
        )
        inverse = inverse[np.ix_(row, column)]
    return Picture(np.sqrt(colour).astype(np.float32), inverse, matrix)


def inverse_of(colour: Array, distance: Array) -> Array:
    """Return 1 / ``distance`` (h, w), NaN where ``colour`` (h, w, 3) or the distance is missing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse: Array = np.where(distance > 0, 1 / distance, np.nan).astype(np.float32)
    inverse[~np.isfinite(colour).all(axis=-1)] = np.nan
    return inverse


def small_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    """Return the shape of the `picture` of a view with a ``shape``."""
    shrink = max(1.0, max(shape) / LARGEST)
    height, width = (max(1, round(side / shrink)) for side in shape)
    return height, width


def neighbours(matrices: Array, index: int) -> list[int]:
    """Return the views to compare a view with, of the ``matrices`` (n, 4, 4) of all views."""
    apart = np.linalg.norm(matrices[:, :3, 3] - matrices[index, :3, 3], axis=1)
    nearest = np.argsort(apart, kind="stable")
    return [int(other) for other in nearest if other != index][:NEIGHBOURS]


def factors(steps: Array) -> Array:
    """Return the factors (...) of inverse distances for steps (...) of `farther`."""
    result: Array = (1 - steps / np.float32(STEPS)).astype(np.float32)
    return result


def farther(here: Picture, others: Sequence[Picture], lens: Lens, torn: Array) -> Array:
    """Return by how many steps (h, w) of 1 / `STEPS` inverse distances are too large.

    ``torn`` (h, w) are the pixels beside a tear. ``lens`` is that of the pictures.
    """
    steps = np.zeros(here.inverse.shape, np.uint8)
    comparison = _Comparison(here, others, lens)
    is_near = here.inverse > FARTHEST
    on_surface = comparison.differences(steps, is_near)
    difference = _mean_difference(*on_surface, WINDOW)
    grey = here.root.mean(axis=-1)
    detail = np.sqrt(np.maximum(_mean(grey * grey) - _mean(grey) ** 2, 0))
    disagree = is_near & (difference < np.inf) & (difference > DISAGREE)
    disagree &= (detail > DETAIL) & (_mean(torn.astype(np.float32)) < TORN)
    if not disagree.any():
        return steps
    around = maximum_filter(disagree, WINDOW) & is_near
    least = difference
    for step in range(1, STEPS):
        there = comparison.differences(np.full_like(steps, step), around)
        moved = _mean_difference(*there, WINDOW)
        is_better = disagree & (moved < least)
        steps[is_better] = step
        least = np.where(is_better, moved, least)
    agree = disagree & (least < BETTER * difference)
    # Single pixels follow most of those around them.
    most = _mean(agree.astype(np.float32)) > 0.5
    steps = np.where(most, median_filter(steps, 5), 0).astype(np.uint8)
    return _grown(steps, comparison, on_surface) if steps.any() else steps


def _grown(steps: Array, comparison: "_Comparison", on_surface: tuple[Array, Array]) -> Array:
    """Return the ``steps`` (h, w) of reflections that grow to their edges.

    A pixel near a reflection joins it if the views agree better there than ``on_surface``.
    """
    inverse = comparison.here.inverse
    apart, (row, column) = distance_transform_edt(steps == 0, return_indices=True)
    nearest = steps[row, column]
    is_near = (apart > 0) & (apart <= REACH)
    is_near &= np.abs(inverse - inverse[row, column]) < FLAT * inverse[row, column]
    there = comparison.differences(nearest, is_near)
    is_better = is_near & (
        _mean_difference(*there, EDGE) < GROWS * _mean_difference(*on_surface, EDGE)
    )
    joins = _mean(((steps > 0) | is_better).astype(np.float32), EDGE) > 0.5
    joins &= is_better | (steps > 0)
    return np.where(joins, nearest, 0).astype(np.uint8)


def _mean(values: Array, window: int = WINDOW) -> Array:
    mean: Array = uniform_filter(values, window)
    return mean


def _mean_difference(total: Array, number: Array, window: int) -> Array:
    """Return the mean difference (h, w) in windows, inf where too few views see them."""
    count = _mean(number, window)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean: Array = np.where(count > OTHERS, _mean(total, window) / count, np.inf)
    return mean


class _Comparison:
    """Compares a picture with others that see the same surfaces."""

    def __init__(self, here: Picture, others: Sequence[Picture], lens: Lens) -> None:
        self.here = here
        self.others = others
        self.lens = lens
        self.rays = (lens.pixel_rays() @ here.matrix[:3, :3].T).astype(np.float32)
        self.seen: list[Array] = []

    def differences(self, steps: Array, compared: Array) -> tuple[Array, Array]:
        """Return the sum (h, w) of the roots' differences, and the number (h, w) of them.

        Only the pixels ``compared`` (h, w) count, farther away by ``steps`` (h, w). The first call
        must have steps of 0. It finds which others see which surface.
        """
        total = np.zeros(compared.shape, np.float32)
        number = np.zeros(compared.shape, np.float32)
        is_first = not self.seen
        for place, other in enumerate(self.others):
            pixels = compared if is_first else compared & self.seen[place]
            inverse = self.here.inverse[pixels]
            offset = (self.here.matrix[:3, 3] - other.matrix[:3, 3]).astype(np.float32)
            offsets = self.rays[pixels] + (inverse * factors(steps[pixels]))[:, None] * offset
            points = self.lens.pixels(offsets @ other.matrix[:3, :3].astype(np.float32))
            points = points.astype(np.float32)
            if is_first:
                along = inverse / np.linalg.norm(offsets, axis=1).astype(np.float32)
                is_seen = np.zeros(len(points), bool)
                _find_seen(other.inverse, points, along, is_seen)
                points = points[is_seen]
                seen = np.zeros(compared.shape, bool)
                seen[pixels] = is_seen
                self.seen.append(seen)
                pixels = seen
            differences = np.full(len(points), np.nan, np.float32)
            _compare(self.here.root[pixels], other.root, points, differences)
            number[pixels] += np.isfinite(differences)
            total[pixels] += np.nan_to_num(differences)
        return total, number


@kernel
def _find_seen(inverse: Array, places: Array, along: Array, is_seen: Array) -> None:
    """Mark the ``places`` (n, 2) where a picture sees the surface that is expected there.

    ``along`` (n,) are the expected inverse distances, ``inverse`` (h, w) those that it sees.
    """
    height, width = inverse.shape
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1]
        if x >= 0 and y >= 0 and x < width and y < height:
            is_seen[n] = abs(inverse[int(y), int(x)] - along[n]) < SAME * along[n]


@kernel
def _compare(root: Array, other: Array, places: Array, differences: Array) -> None:
    """Write the mean ``differences`` (n,) of ``root`` (n, 3) from ``other`` (h, w, 3) at places."""
    height, width = other.shape[:2]
    half = np.float32(0.5)
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1]
        if not (x >= 0 and y >= 0 and x < width and y < height):
            continue
        x = min(max(x - half, np.float32(0)), np.float32(width - 1))
        y = min(max(y - half, np.float32(0)), np.float32(height - 1))
        j, i = int(x), int(y)
        right, below = min(j + 1, width - 1), min(i + 1, height - 1)
        u, v = x - np.float32(j), y - np.float32(i)
        total = np.float32(0)
        for c in range(3):
            upper = (1 - u) * other[i, j, c] + u * other[i, right, c]
            lower = (1 - u) * other[below, j, c] + u * other[below, right, c]
            total += abs((1 - v) * upper + v * lower - root[n, c])
        differences[n] = total / np.float32(3)
