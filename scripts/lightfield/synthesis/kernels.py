"""The loops of view synthesis: where a surface tears, how it is drawn, how drawings are blended.

A view is a surface: a vertex at each pixel's centre, a triangle between neighbours that belong
together. Pixels beside a tear are drawn one by one, too. ``inverse`` is 1 / distance in 1/m: 0
where nothing was hit, NaN where there is no ray.
"""

import math
from typing import Any

import numpy as np

from lightfield.core.compiled import kernel
from lightfield.geometry.lenses import Array

# Neighbours that differ in inverse distance more than a surface does that is seen at the steepest
# angle are one surface, even so, if their next neighbours differ nearly as much: on a plane the
# inverse distance changes evenly.
EVEN = np.float32(0.5)
# Drawings at one pixel are of one surface if their inverse distances differ by less than this part.
SAME = np.float32(0.03)
# What is this small, in 1/m, is as far as the sky.
FAR = np.float32(1e-4)
# A triangle that is larger than this part of the picture is an artefact at a lens's rim.
LARGEST = np.float32(0.25)
# Of a triangle's width times its height: rounding moves its edges by no more.
ROUNDING = np.float32(1e-6)


@kernel
def _is_one_surface(before: Any, a: Any, b: Any, after: Any, step_part: Any) -> bool:
    """Whether two neighbours ``a`` and ``b`` in a row of inverse distances are of one surface."""
    step = b - a
    if not abs(step) < np.inf:
        return False
    if abs(step) <= max(step_part * max(a, b), FAR):
        return True
    if min(a, b) == 0:
        return False
    # Comparisons with NaN, beyond the image, are false.
    return bool(
        abs((a - before) - step) < EVEN * abs(step) and abs((after - b) - step) < EVEN * abs(step)
    )


@kernel
def link(inverse: Array, steepest: np.float32, right: Array, down: Array) -> None:
    """Mark the vertices (h, w) that are of one surface with the next to the right, and below.

    ``steepest`` is the part by which inverse distances of neighbours on one surface may differ.
    """
    height, width = inverse.shape
    nan = np.float32(np.nan)
    for i in range(height):
        for j in range(width):
            right[i, j] = down[i, j] = False
            a = inverse[i, j]
            if j + 1 < width:
                before = inverse[i, j - 1] if j > 0 else nan
                after = inverse[i, j + 2] if j + 2 < width else nan
                right[i, j] = _is_one_surface(before, a, inverse[i, j + 1], after, steepest)
            if i + 1 < height:
                before = inverse[i - 1, j] if i > 0 else nan
                after = inverse[i + 2, j] if i + 2 < height else nan
                down[i, j] = _is_one_surface(before, a, inverse[i + 1, j], after, steepest)


@kernel
def _draw_pole(top: Any, bottom: Any, values: Array, inverse: Array, drawn: Array) -> None:
    """Draw a triangle around a panorama's pole where nothing is drawn yet, in one colour."""
    height, width = inverse.shape
    first = 0
    end = min(int(bottom + np.float32(0.5)), height)
    if top + bottom > height:
        first = max(int(top), 0)
        end = height
    for i in range(first, end):
        for j in range(width):
            if inverse[i, j] < 0:
                inverse[i, j] = np.mean(values[:, 0])
                for c in range(4):
                    drawn[i, j, c] = np.mean(values[:, c + 1])


@kernel
def _draw_triangle(
    corners: Array, values: Array, wraps: bool, inverse: Array, drawn: Array
) -> None:
    """Draw a triangle where nothing nearer is drawn yet.

    ``corners`` (3, 2) are pixels, ``values`` (3, 5) inverse distance, R, G, B and weight.
    """
    height, width = inverse.shape
    zero, half = np.float32(0), np.float32(0.5)
    x0, y0 = corners[0, 0], corners[0, 1]
    x1, y1 = corners[1, 0], corners[1, 1]
    x2, y2 = corners[2, 0], corners[2, 1]
    if wraps:
        # The shorter of the two paths around.
        turn = np.float32(width)
        x1 -= turn * np.rint((x1 - x0) / turn)
        x2 -= turn * np.rint((x2 - x0) / turn)
        if abs(x2 - x1) > half * turn:
            _draw_pole(min(y0, y1, y2), max(y0, y1, y2), values, inverse, drawn)
            return
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    # Y points down: what was counterclockwise in the source is so here, or is seen from behind.
    if not area > 0:
        return
    left, right = min(x0, x1, x2), max(x0, x1, x2)
    top, bottom = min(y0, y1, y2), max(y0, y1, y2)
    if right - left > LARGEST * width or bottom - top > LARGEST * height:
        return
    # A pixel's centre on an edge that two triangles share must be in one of them.
    rounding = ROUNDING * (right - left) * (bottom - top)
    first = math.ceil(left - half)
    last = math.floor(right - half)
    if not wraps:
        first = max(first, 0)
        last = min(last, width - 1)
    for i in range(max(math.ceil(top - half), 0), min(int(bottom - half), height - 1) + 1):
        y = np.float32(i) + half
        for column in range(first, last + 1):
            x = np.float32(column) + half
            w0 = (x1 - x) * (y2 - y) - (x2 - x) * (y1 - y)
            w1 = (x2 - x) * (y0 - y) - (x0 - x) * (y2 - y)
            w2 = area - w0 - w1
            if min(w0, w1, w2) < -rounding:
                continue
            w0, w1, w2 = max(w0, zero), max(w1, zero), max(w2, zero)
            total = w0 + w1 + w2
            w0, w1, w2 = w0 / total, w1 / total, w2 / total
            j = column % width if wraps else column
            near = w0 * values[0, 0] + w1 * values[1, 0] + w2 * values[2, 0]
            if near > inverse[i, j]:
                inverse[i, j] = near
                for c in range(4):
                    drawn[i, j, c] = (
                        w0 * values[0, c + 1] + w1 * values[1, c + 1] + w2 * values[2, c + 1]
                    )


@kernel
def draw(
    pixels: Array,
    values: Array,
    right: Array,
    down: Array,
    wraps: bool,
    inverse: Array,
    drawn: Array,
) -> None:
    """Draw a surface whose vertices (h, w) fall on ``pixels`` (h, w, 2).

    ``values`` (h, w, 5) are as in `_draw_triangle`, ``inverse`` (H, W) and ``drawn`` (H, W, 4) what
    is drawn: inverse distance, −1 where nothing is, and R, G, B, weight. ``wraps`` is whether the
    picture's left edge continues its right one.
    """
    height, width = pixels.shape[:2]
    corners = np.empty((3, 2), np.float32)
    corner_values = np.empty((3, 5), np.float32)
    for i in range(height - 1):
        for j in range(width - 1):
            for lower in range(2):
                # Of a quad, the triangle left above and the one right below.
                if lower:
                    whole = right[i + 1, j] and down[i, j + 1]
                    places = ((i, j + 1), (i + 1, j + 1), (i + 1, j))
                else:
                    whole = right[i, j] and down[i, j]
                    places = ((i, j), (i, j + 1), (i + 1, j))
                if not whole:
                    continue
                for k in range(3):
                    row, column = places[k]
                    corners[k] = pixels[row, column]
                    corner_values[k] = values[row, column]
                _draw_triangle(corners, corner_values, wraps, inverse, drawn)


@kernel
def draw_pixels(pixels: Array, values: Array, wraps: bool, inverse: Array, drawn: Array) -> None:
    """Draw single pixels of a view, whose corners (n, 4, 2) run clockwise from the upper left.

    ``values`` (n, 5) and the others are as in `draw`.
    """
    corners = np.empty((3, 2), np.float32)
    corner_values = np.empty((3, 5), np.float32)
    for n in range(len(pixels)):
        corner_values[:] = values[n]
        for second in range(2):
            corners[0] = pixels[n, 0]
            corners[1] = pixels[n, 1 + second]
            corners[2] = pixels[n, 2 + second]
            _draw_triangle(corners, corner_values, wraps, inverse, drawn)


@kernel
def blend(inverses: Array, drawn: Array, colour: Array, inverse: Array, holes: Array) -> None:
    """Blend drawings (k, H, W) of which the nearest surface counts, by their weights.

    ``colour`` (H, W, 3) and ``inverse`` (H, W) become NaN where no drawing has anything: there are
    ``holes`` (H, W).
    """
    number, height, width = inverses.shape
    for i in range(height):
        for j in range(width):
            nearest = np.float32(-1)
            for k in range(number):
                nearest = max(nearest, inverses[k, i, j])
            holes[i, j] = nearest < 0
            if holes[i, j]:
                colour[i, j], inverse[i, j] = np.nan, np.nan
                continue
            total = mean = red = green = blue = np.float32(0)
            for k in range(number):
                if inverses[k, i, j] < nearest - max(SAME * nearest, FAR):
                    continue
                weight = drawn[k, i, j, 3]
                total += weight
                red += weight * drawn[k, i, j, 0]
                green += weight * drawn[k, i, j, 1]
                blue += weight * drawn[k, i, j, 2]
                mean += weight * inverses[k, i, j]
            inverse[i, j] = mean / total
            colour[i, j, 0] = red / total
            colour[i, j, 1] = green / total
            colour[i, j, 2] = blue / total
