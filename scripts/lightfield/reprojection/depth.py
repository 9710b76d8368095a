"""Resamples depth through a lens map. It interpolates on a surface, never between two."""

from typing import Any

import numpy as np

from lightfield.core.compiled import inline, kernel
from lightfield.geometry.lenses import Array
from lightfield.imaging.halves import to_half
from lightfield.reprojection.kernels import Topology, source_index
from lightfield.reprojection.lens_map import LensMap

_STRIP = 64  # rows resampled at a time

# Depth is interpolated where its third differences are below this part of it. A step between
# surfaces of half this size remains unseen: 1e-4, or for halves the size of their rounding.
_SMOOTH = {np.dtype(np.float32): np.float32(2e-4), np.dtype(np.float16): np.float32(4e-3)}


@kernel
def _inverse_distance(depth: Array, cos: Array, is_z: bool, out: Array) -> None:
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            # The cosine is NaN for a pixel without a ray, outside the image circle.
            out[i, j] = (cos[i, j] if is_z else cos[i, j] * 0 + np.float32(1)) / z


@kernel
def _curvatures(a: Any, b: Any, c: Any, d: Any, tolerance: Any) -> tuple[Any, Any]:
    """Return the second differences of four neighbours, at the second and the third.

    NaN unless the four lie on one smooth surface. They do if their third difference is small, or if
    they curve slightly, evenly, and in one direction. A step between two surfaces curves in both.
    """
    before, after = a - 2 * b + c, b - 2 * c + d
    third = abs(after - before)
    if not third <= tolerance * b:
        even = third <= np.float32(0.5) * max(abs(before), abs(after))
        if not (even and before * after > 0 and abs(c - b) <= np.float32(0.05) * b):
            return np.float32(np.nan), np.float32(np.nan)
    return before, after


@inline
def _cell(
    inverse: Array,
    row: int,
    column: int,
    tolerance: Any,
    topology: Topology,
) -> Any:
    """Return the 2 × 2 pixels from (row, column) on, and the curvatures along their four sides."""
    height, width = inverse.shape
    within = row >= 1 and row < height - 2 and column >= 1 and column < width - 2
    if within:
        # Unsigned, so that numba does not check whether an index counts from the end.
        one = np.uint64(1)
        two = np.uint64(2)
        i = np.uint64(row)
        j = np.uint64(column)
        a0 = inverse[i, j - one]
        a1 = inverse[i, j]
        a2, a3 = inverse[i, j + one], inverse[i, j + two]
        b0 = inverse[i + one, j - one]
        b1 = inverse[i + one, j]
        b2, b3 = inverse[i + one, j + one], inverse[i + one, j + two]
        c1 = inverse[i - one, j]
        c2 = inverse[i - one, j + one]
        d1 = inverse[i + two, j]
        d2 = inverse[i + two, j + one]
    else:
        a0 = _value(inverse, row, column - 1, topology)
        a1 = _value(inverse, row, column, topology)
        a2 = _value(inverse, row, column + 1, topology)
        a3 = _value(inverse, row, column + 2, topology)
        b0 = _value(inverse, row + 1, column - 1, topology)
        b1 = _value(inverse, row + 1, column, topology)
        b2 = _value(inverse, row + 1, column + 1, topology)
        b3 = _value(inverse, row + 1, column + 2, topology)
        c1 = _value(inverse, row - 1, column, topology)
        c2 = _value(inverse, row - 1, column + 1, topology)
        d1 = _value(inverse, row + 2, column, topology)
        d2 = _value(inverse, row + 2, column + 1, topology)
    return (
        (a1, a2, b1, b2),
        _curvatures(a0, a1, a2, a3, tolerance),
        _curvatures(b0, b1, b2, b3, tolerance),
        _curvatures(c1, a1, b1, d1, tolerance),
        _curvatures(c2, a2, b2, d2, tolerance),
    )


@inline
def _bend(before: Any, after: Any, f: Any) -> Any:
    """Return what a cubic adds to a line at fraction ``f``, by Everett's interpolation formula."""
    one = np.float32(1)
    g = one - f
    return (g * (g * g - one) * before + f * (f * f - one) * after) * np.float32(1 / 6)


@kernel
def _value(inverse: Array, row: int, column: int, topology: Topology) -> Any:
    row, column = source_index(row, column, inverse.shape[0], inverse.shape[1], topology)
    return inverse[row, column] if row >= 0 else np.float32(np.nan)


@kernel
def _pick(
    inverse: Array,
    valid: Array,
    centers: Array,
    cos: Array,
    as_z: bool,
    tolerance: np.float32,
    topology: Topology,
    out: Array,
) -> None:
    height, width = inverse.shape
    half = np.float32(0.5)
    last_row, last_column = 0, 0
    cell = _cell(inverse, 0, 0, tolerance, topology)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x, y = centers[i, j, 0], centers[i, j, 1]
            if x != x:
                out[i, j] = np.nan
                continue
            row, column = int(np.floor(y - half)), int(np.floor(x - half))
            # Neighbours of a magnified image often share a cell.
            if row != last_row or column != last_column:
                cell = _cell(inverse, row, column, tolerance, topology)
                last_row, last_column = row, column
            (a, b, c, d), upper, lower, left, right = cell
            fx, fy = x - half - np.float32(column), y - half - np.float32(row)
            top = a + fx * (b - a) + _bend(upper[0], upper[1], fx)
            bottom = c + fx * (d - c) + _bend(lower[0], lower[1], fx)
            across = _bend(left[0], left[1], fy)
            across += fx * (_bend(right[0], right[1], fy) - across)
            smooth = top + fy * (bottom - top) + across
            if smooth > 0:
                low, high = min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
                picked = min(max(smooth, low), high)
            else:
                nearest = min(int(y), height - 1), min(int(x), width - 1)
                picked = inverse[nearest]
                if valid[nearest] != valid[nearest]:
                    # Beyond the rim of the image circle, take the nearest of the four pixels.
                    shortest = np.float32(4)
                    for q in range(2):
                        for p in range(2):
                            k, m = source_index(row + q, column + p, height, width, topology)
                            away = (fx - p) * (fx - p) + (fy - q) * (fy - q)
                            if k >= 0 and valid[k, m] == valid[k, m] and away < shortest:
                                shortest = away
                                picked = inverse[k, m]
            if picked == 0:
                out[i, j] = np.inf
            else:
                out[i, j] = (cos[i, j] if as_z else np.float32(1)) / picked


def resample_depth(depth: Array, source_is_z: bool, target_is_z: bool, lens_map: LensMap) -> Array:
    """Resample a depth window (h, w), half or float, at the target pixels' centres.

    ``source_is_z`` and ``target_is_z`` say whether an image holds Z-depth or distance. On a smooth
    surface, 1 / distance is interpolated, because it is nearly linear on a plane. The result stays
    within the range of the four pixels around. Elsewhere, the pixel that the ray falls in gives the
    depth. Beyond the rim of the image circle, it is the nearest of the four pixels. So no depth
    lies between two surfaces. Returns (H, W), half or float. A miss (inf) stays inf, and NaN marks
    a pixel without a source.
    """
    if lens_map.strip is not None:
        # Repeat the edge: depth on the next face would be along another axis.
        border = (lens_map.strip.shape[0] - depth.shape[0]) // 2
        depth = np.hstack([np.pad(face, border, mode="edge") for face in np.hsplit(depth, 6)])
    inverse = np.empty(depth.shape, np.float32)
    _inverse_distance(
        np.ascontiguousarray(depth, np.float32), lens_map.source_cos, source_is_z, inverse
    )
    out = np.empty(lens_map.target_cos.shape, depth.dtype)
    for first in range(0, len(out), _STRIP):
        rows = slice(first, first + _STRIP)
        strip = np.empty(out[rows].shape, np.float32)
        _pick(
            inverse,
            lens_map.source_cos,
            lens_map.centers[rows],
            lens_map.target_cos[rows],
            target_is_z,
            _SMOOTH[depth.dtype],
            lens_map.topology,
            strip,
        )
        out[rows] = to_half(strip) if out.dtype == np.float16 else strip
    return out
