"""The loops of a lens map: which area each target pixel covers, and which samples need care."""

import math

import numpy as np

from lightfield.core.compiled import inline, kernel
from lightfield.geometry.lenses import Array
from lightfield.reprojection.kernels import CAREFUL, INSIDE, NOTHING

_MOST_SAMPLES = 256  # in each direction, for a footprint that meets a pole


@inline
def _difference(before: float, middle: float, after: float, period: float) -> float:
    """Return the central difference. One-sided if one neighbour is missing, and 0 if both are."""
    backward, forward = middle - before, after - middle
    if period > 0:
        backward -= period * np.rint(backward / period)
        forward -= period * np.rint(forward / period)
    if forward != forward:
        forward = backward
    if backward != backward:
        backward = forward
    mean = (forward + backward) / 2
    # The difference of grazing rays has no bound. Limit it to a value larger than any image.
    return min(max(mean, -1e9), 1e9) if mean == mean else 0.0


@kernel
def extent(step: Array, counts: Array) -> int:
    """Return the largest distance in x or y of a pixel's samples from its centre, in source pixels.

    ``step`` is (2, 2) and ``counts`` (2,), as in a lens map.
    """
    widest = np.float32(0)
    for axis in range(2):
        width = abs(step[axis, 0] * np.float32(counts[0] - 1))
        width += abs(step[axis, 1] * np.float32(counts[1] - 1))
        widest = max(widest, width)
    return int(np.ceil(widest / 2))


@inline
def _fill_footprint(jacobian: Array, widest: float, steps: Array, counts: Array) -> int:
    """Fill the ``steps`` (2, 2) between samples and their ``counts`` (2,). Return the larger count.

    A pixel is the mean over its area, in the target and in the source. Let a target pixel span s
    source pixels. By the variances, it needs a further box of width √(s² − 1). n samples at
    distance d have the variance of a box of width d √(n² − 1), which gives d. The bicubic kernel
    lets d exceed a pixel, so n can be small. If s is at most little above 1, one sample is enough:
    magnifying does not blur.
    """
    largest_count = 1
    for direction in range(2):
        squared = jacobian[0, direction] ** 2 + jacobian[1, direction] ** 2
        box = min(math.sqrt(max(squared - 1, 0.0)), widest)
        counts[direction] = 1
        if box > 0.5:
            count = int(min(max(math.ceil(0.75 * box), 2), _MOST_SAMPLES))
            scale = box / math.sqrt(squared) / math.sqrt(count * count - 1)
            counts[direction] = count
            steps[0, direction] = jacobian[0, direction] * scale
            steps[1, direction] = jacobian[1, direction] * scale
            largest_count = max(largest_count, count)
    return largest_count


@kernel
def measure(
    middle: Array,
    left: Array,
    right: Array,
    above: Array,
    below: Array,
    size: tuple[int, int],
    period: float,
    widest: float,
    centers: Array,
    magnification: Array,
    footprints: Array,
    counts: Array,
) -> int:
    """Measure what target pixels cover, from their coordinates (h, w, 2) and their neighbours'.

    Fills ``centers``, which are NaN outside the source's ``size``. Fills ``magnification``, which
    is 1 / √|det| of the Jacobian. ``period`` is the source's width if it wraps around, or else 0.

    For the adaptive filter, ``counts`` and ``footprints`` are not empty. It fills ``counts`` with
    the number of samples in each direction, and ``footprints``, which must be zeros, with the steps
    between samples. No box is wider than ``widest``, in source pixels. Returns the largest count.
    """
    jacobian = np.empty((2, 2))
    fills_footprints = len(counts) > 0
    largest_count = 1
    for i in range(middle.shape[0]):
        for j in range(middle.shape[1]):
            x, y = middle[i, j, 0], middle[i, j, 1]
            if not (0 <= x <= size[0] and 0 <= y <= size[1]):
                centers[i, j] = np.nan
                magnification[i, j] = np.nan
                if fills_footprints:
                    counts[i, j] = 1
                continue
            centers[i, j, 0] = x
            centers[i, j, 1] = y
            for c in range(2):
                span = period if c == 0 else 0.0
                center = middle[i, j, c]
                jacobian[c, 0] = _difference(left[i, j, c], center, right[i, j, c], span)
                jacobian[c, 1] = _difference(above[i, j, c], center, below[i, j, c], span)
            area = abs(jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0])
            magnification[i, j] = 1 / math.sqrt(area)
            if fills_footprints:
                count = _fill_footprint(jacobian, widest, footprints[i, j], counts[i, j])
                largest_count = max(largest_count, count)
    return largest_count


@kernel
def distance_to_missing(cos: Array, out: Array) -> None:
    """Fill ``out`` with the distance, in rows or columns, to the nearest pixel without a ray."""
    height, width = cos.shape
    for i in range(height):
        for j in range(width):
            nearest = np.int32(0)
            if cos[i, j] == cos[i, j] and i > 0 and 0 < j < width - 1:
                nearest = min(
                    min(out[i - 1, j - 1], out[i - 1, j]), min(out[i - 1, j + 1], out[i, j - 1])
                )
            out[i, j] = nearest + 1 if cos[i, j] == cos[i, j] else 0
    for i in range(height - 1, -1, -1):
        for j in range(width - 1, -1, -1):
            nearest = np.int32(0)
            if i < height - 1 and 0 < j < width - 1:
                nearest = min(
                    min(out[i + 1, j - 1], out[i + 1, j]), min(out[i + 1, j + 1], out[i, j + 1])
                )
            out[i, j] = min(out[i, j], nearest + 1)


@kernel
def mark(
    coordinates: Array,
    distance: Array,
    reach: int,
    footprints: Array,
    counts: Array,
    flags: Array,
) -> None:
    """Fill the ``flags`` of samples, whose filter reads ``reach`` pixels around each footprint."""
    height, width = distance.shape
    for i in range(flags.shape[0]):
        for j in range(flags.shape[1]):
            x, y = coordinates[i, j, 0], coordinates[i, j, 1]
            if x != x:
                flags[i, j] = NOTHING
                continue
            around = reach
            if len(counts):
                around += extent(footprints[i, j], counts[i, j])
            away = distance[min(int(y), height - 1), min(int(x), width - 1)]
            flags[i, j] = INSIDE if away > around else CAREFUL


@kernel
def bounds(
    points: Array, margin: int, footprints: Array, counts: Array
) -> tuple[float, float, float, float, int]:
    """Return the least and largest x and y that are read around ``points``, and the largest extent.

    Adds ``margin`` on each side, and the extent of each point's footprint. The bounds are inf and
    −inf if no point has coordinates.
    """
    left = top = np.inf
    right = bottom = -np.inf
    largest_extent = 0
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            x, y = points[i, j, 0], points[i, j, 1]
            if x != x:
                continue
            around = margin
            if len(counts):
                point_extent = extent(footprints[i, j], counts[i, j])
                largest_extent = max(largest_extent, point_extent)
                around += point_extent
            left, right = min(left, x - around), max(right, x + around)
            top, bottom = min(top, y - around), max(bottom, y + around)
    return left, top, right, bottom, largest_extent
