"""The loops of view synthesis: they tear surfaces, draw them, blend the drawings, and fill holes.

A view becomes a surface. It has a vertex at each pixel's centre, and triangles between neighbours
on one surface. Pixels beside a tear are also drawn one by one, as soft splats of their own size.
``inverse`` is 1 / distance in 1/m: 0 where nothing was hit, NaN where there is no ray. A larger
inverse is nearer.
"""

import math
from typing import Any

import numpy as np

from lightfield.core.compiled import kernel
from lightfield.geometry.lenses import Array

# Figures in decibels: PSNR of held-out views of the garden, the barbershop and the courtyard. Half
# and double of the constants that say so were tried in the garden alone: 8 of 42 views of 224², on
# a sphere of 0.5 m, were made from the others, at 26.84 dB.

# A view at twice the target's distance from the surface has half the detail. It has the penalty of
# an angle of 0.1 rad, or 6°. Half and double change less than 0.001 dB.
DISTANCE = np.float32(0.1)
# Added to the penalty, in radians. So a view in the target's own direction weighs at most four
# times as much as one 3° aside: noise averages, and no view jumps into sight. Half brings 0.002 dB,
# and double takes 0.012 dB.
SHARP = np.float32(0.05)
# A view counts by how many times nearer than the target it is, but not more than so many times.
# Four of its pixels then lie across one of the target's, which is finer than the samples. Counting
# near views more brought 0 to 0.1 dB.
CLOSEST = np.float32(4)
# On a plane the inverse distance changes evenly: its steps differ by none of their size. At a jump
# between two level surfaces they differ by all of it. This is the middle. 0.25 and 0.75 take 0.001
# and 0.003 dB.
EVEN = np.float32(0.5)
# A drawing that is off by a pixel is off in inverse distance by the pixel's angle times the tangent
# of incidence, which is at most 6 within a surface. This is 3 % for a pixel of 0.3° (a fisheye of
# 600 pixels) and 10 % for one of 1° (180 pixels). So drawings at a pixel show one surface if their
# inverse distances differ by less than this part. Half and double change less than 0.001 dB.
SAME = np.float32(0.03)
# A surface hides another one that is farther by this part. Between SAME and HIDDEN the weight falls
# to 0. Half and double change less than 0.001 dB. `lightfield.geometry.visibility` asks the same of
# distances, with a yes or a no: a weight that falls off cannot share its functions, and inverse
# distances are 0 at a miss, where its ratios have no meaning.
HIDDEN = np.float32(0.1)
# A drawing far behind the nearest one counts as if its inverse distance were this part of the
# nearest one's. With splats, it brought 0.1, 0 and 0.2 dB.
BEHIND = np.float32(0.15)
# A pixel's splat reaches so far from its middle, in pixels across and down. There a pixel without
# neighbours on its surface has an opacity of 2 · 0.25² = 1/8, the least that a sample shows.
SPLAT = np.float32(0.75)
# Colours blend inside a splat if the inverse distances of pixels differ by less than this part. Of
# two such pixels, one hides less than a third of the other's weight (SAME, HIDDEN).
SPLAT_SAME = np.float32(0.05)
# A surface hides everything behind it if its vertices have at least this certainty. It is above the
# certainty of vertices beside a tear, 0.25, and below 1. So a triangle with one such corner hides
# in its greater part. 0.33 and 0.75 change at most 0.001 dB.
CERTAIN = np.float32(0.5)
# Added to the roots of colours before inverting them, so that black has an inverse. Its square is
# 3 of the 255 levels of sRGB: what is darker looks black. Half takes 0.006 dB, and double brings
# 0.008 dB.
DARK = np.float32(0.03)
# A surface with an inverse distance this small, in 1/m, counts as sky. At 10 km, a step of 10 m
# moves it by 1 mrad, less than a pixel of 90° in 1,000 pixels.
FAR = np.float32(1e-4)
# A triangle larger than this part of the picture is an artefact at a lens's rim: it would magnify a
# view's pixel to a quarter of the picture.
LARGEST = np.float32(0.25)
# Rounding moves a triangle's edges by at most this part of its width times its height: about ten
# roundings of float32, each of 6e-8, and some more to be safe.
ROUNDING = np.float32(1e-6)


@kernel
def _is_one_surface(before: Any, a: Any, b: Any, after: Any, step_part: Any) -> bool:
    """Return whether two neighbours ``a`` and ``b`` in a row of inverses are on one surface."""
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
    """Mark the vertices (h, w) that share a surface with their right and their lower neighbour.

    ``steepest`` is the part by which the inverses of neighbours on one surface may differ.
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
def _penalty(from_target: Any, from_view: Any) -> Any:
    """Return how differently a target and a view see a point. Less is better.

    The vectors (x, y, z) lead from the target's and from the view's camera to the point, in the
    same unit.
    """
    x, y, z = from_target
    u, v, w = from_view
    target_distance = math.sqrt(x * x + y * y + z * z)
    view_distance = math.sqrt(u * u + v * v + w * w)
    cosine = (x * u + y * v + z * w) / (target_distance * view_distance)
    # The chord between both directions.
    angle = math.sqrt(max(2 - 2 * cosine, 0))
    return angle + DISTANCE * max(view_distance / target_distance - 1, 0) + SHARP


@kernel
def qualities(from_target: Array, from_view: Array, is_seen: Array, quality: Array) -> None:
    """Write how well a view sees points: 1 / penalty, 0 for points that it does not see.

    The vectors (n, 3) are as in `_penalty`.
    """
    for n in range(len(is_seen)):
        quality[n] = 0
        if is_seen[n]:
            quality[n] = 1 / _penalty(
                (from_target[n, 0], from_target[n, 1], from_target[n, 2]),
                (from_view[n, 0], from_view[n, 1], from_view[n, 2]),
            )


@kernel
def _turned(matrix: Array, x: Any, y: Any, z: Any) -> Any:
    """Return the product of a vector and a ``matrix`` (3, 3)."""
    return (
        x * matrix[0, 0] + y * matrix[1, 0] + z * matrix[2, 0],
        x * matrix[0, 1] + y * matrix[1, 1] + z * matrix[2, 1],
        x * matrix[0, 2] + y * matrix[1, 2] + z * matrix[2, 2],
    )


@kernel
def look(
    rays: Array,
    inverse: Array,
    shade: Array,
    counts: Array,
    turns: Array,
    offset: Array,
    least_cosine: np.float32,
    seen: Array,
    values: Array,
) -> None:
    """Look from a target at the points at 1 / ``inverse`` (n,) along a view's ``rays`` (n, 3).

    - ``shade`` (n, 4): the points' R, G, B and certainty.
    - ``counts`` (n,): how much the points count.
    - ``turns`` (2, 3, 3): turn row vectors from the view into the world, and into the target.
    - ``offset`` (3,): from the target to the view, in the world.
    - ``least_cosine``: points at a larger angle from the target's axis are skipped.
    - ``seen`` (n, 3): gets the vectors from the target to the points in its own axes. Their unit is
      the point's distance from the view, so that infinitely far points need no special case. Those
      of skipped points are NaN.
    - ``values`` (n, 6): gets what `_draw_triangle` needs.
    """
    for n in range(len(inverse)):
        ray = _turned(turns[0], rays[n, 0], rays[n, 1], rays[n, 2])
        x = ray[0] + inverse[n] * offset[0]
        y = ray[1] + inverse[n] * offset[1]
        z = ray[2] + inverse[n] * offset[2]
        length = math.sqrt(x * x + y * y + z * z)
        point = _turned(turns[1], x, y, z)
        # Comparisons with NaN, where there is no ray, are false.
        if not -point[2] >= least_cosine * length:
            seen[n] = np.nan
            continue
        for c in range(3):
            seen[n, c] = point[c]
        values[n, 0] = inverse[n] / length
        for c in range(4):
            values[n, c + 1] = shade[n, c]
        # The unit of `length` is the view's distance, so a near view counts more: it sees more.
        worth = min(length, CLOSEST) / _penalty((x, y, z), ray)
        values[n, 5] = counts[n] * worth * worth


@kernel
def _signed_weight(certainty: Any, worth: Any) -> Any:
    """Return the weight of a drawn pixel. It is negative if the pixel hides nothing behind it."""
    weight = certainty * worth
    return weight if certainty >= CERTAIN else -weight


@kernel
def _draw_pole(
    top: Any, bottom: Any, values: Array, corners: Any, inverse: Array, drawn: Array
) -> None:
    """Draw a triangle around a panorama's pole in one colour, where nothing is drawn yet."""
    height, width = inverse.shape
    first = 0
    end = min(int(bottom + np.float32(0.5)), height)
    if top + bottom > height:
        first = max(int(top), 0)
        end = height
    mean = np.zeros(6, np.float32)
    for corner in corners:
        mean += values[corner] / np.float32(3)
    for i in range(first, end):
        for j in range(width):
            if inverse[i, j] < 0:
                inverse[i, j] = mean[0]
                drawn[i, j, :3] = mean[1:4]
                drawn[i, j, 3] = _signed_weight(mean[4], mean[5])


@kernel
def _draw_triangle(
    points: Array, values: Array, corners: Any, wraps: bool, inverse: Array, drawn: Array
) -> None:
    """Draw a triangle where nothing nearer is drawn yet.

    ``corners`` are three vertices. ``points`` (n, 2) are the vertices' places in pixels. Their
    ``values`` (n, 6) are inverse, R, G, B, certainty and worth.
    """
    height, width = inverse.shape
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    a, b, c = corners
    x0, y0 = points[a, 0], points[a, 1]
    x1, y1 = points[b, 0], points[b, 1]
    x2, y2 = points[c, 0], points[c, 1]
    if wraps:
        # Take the shorter of the two ways around.
        turn = np.float32(width)
        x1 -= turn * np.rint((x1 - x0) / turn)
        x2 -= turn * np.rint((x2 - x0) / turn)
        if abs(x2 - x1) > half * turn:
            _draw_pole(min(y0, y1, y2), max(y0, y1, y2), values, corners, inverse, drawn)
            return
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    # Skip triangles seen from behind: they turn the other way round.
    if not area > 0:
        return
    left, right = min(x0, x1, x2), max(x0, x1, x2)
    top, bottom = min(y0, y1, y2), max(y0, y1, y2)
    if right - left > LARGEST * width or bottom - top > LARGEST * height:
        return
    # A centre on an edge that two triangles share must lie in at least one of them.
    rounding = -ROUNDING * (right - left) * (bottom - top)
    first = math.ceil(left - half)
    last = math.floor(right - half)
    if not wraps:
        first = max(first, 0)
        last = min(last, width - 1)
    start = np.float32(first) + half
    for i in range(max(math.ceil(top - half), 0), min(int(bottom - half), height - 1) + 1):
        y = np.float32(i) + half
        # Twice the areas of the triangles that the centre and two corners make.
        row0 = (x1 - start) * (y2 - y) - (x2 - start) * (y1 - y)
        row1 = (x2 - start) * (y0 - y) - (x0 - start) * (y2 - y)
        for column in range(first, last + 1):
            step = np.float32(column - first)
            w0 = row0 - step * (y2 - y1)
            w1 = row1 - step * (y0 - y2)
            w2 = area - w0 - w1
            if w0 < rounding or w1 < rounding or w2 < rounding:
                continue
            w0, w1, w2 = max(w0, zero), max(w1, zero), max(w2, zero)
            part = one / (w0 + w1 + w2)
            weights = (w0 * part, w1 * part, w2 * part)
            j = column % width if wraps else column
            _draw_pixel(i, j, values, corners, weights, inverse, drawn)


@kernel
def _draw_pixel(
    i: int, j: int, values: Array, corners: Any, weights: Any, inverse: Array, drawn: Array
) -> None:
    """Draw a triangle's pixel unless something nearer is drawn. ``weights`` are its corners'."""
    a, b, c = corners
    w0, w1, w2 = weights
    nearness = w0 * values[a, 0] + w1 * values[b, 0] + w2 * values[c, 0]
    if nearness > inverse[i, j]:
        inverse[i, j] = nearness
        for k in range(3):
            drawn[i, j, k] = w0 * values[a, k + 1] + w1 * values[b, k + 1] + w2 * values[c, k + 1]
        certainty = w0 * values[a, 4] + w1 * values[b, 4] + w2 * values[c, 4]
        worth = w0 * values[a, 5] + w1 * values[b, 5] + w2 * values[c, 5]
        drawn[i, j, 3] = _signed_weight(certainty, worth)


@kernel
def draw(
    points: Array,
    values: Array,
    right: Array,
    down: Array,
    wraps: bool,
    inverse: Array,
    drawn: Array,
) -> None:
    """Draw a surface with a vertex for each pixel of a view (h, w), row by row.

    - ``points`` (h · w, 2): where the vertices are, in pixels.
    - ``values`` (h · w, 6): as in `_draw_triangle`.
    - ``right``, ``down`` (h, w): as `link` marks them.
    - ``wraps``: whether the picture's left edge continues its right one.
    - ``inverse`` (H, W): the inverse distance of the drawn surface, −1 where nothing is drawn yet.
    - ``drawn`` (H, W, 4): R, G, B and the weight, which is certainty times worth. The weight is
      negative if the pixel hides nothing behind it.
    """
    height, width = right.shape
    for i in range(height - 1):
        for j in range(width - 1):
            # A quad has an upper left and a lower right triangle.
            corner = i * width + j
            below = corner + width
            if right[i, j] and down[i, j]:
                _draw_triangle(points, values, (corner, corner + 1, below), wraps, inverse, drawn)
            if right[i + 1, j] and down[i, j + 1]:
                _draw_triangle(
                    points, values, (corner + 1, below + 1, below), wraps, inverse, drawn
                )


@kernel
def _splat_sample(pixel: Any, u: Any, v: Any, surface: Array, shade: Array) -> Any:
    """Return a splat's opacity, 0 to 1, and its R, G, B at a place.

    ``u`` and ``v`` lead from the middle of the view's ``pixel`` (row, column) to the place, right
    and down in pixels. ``surface`` (h, w) is the view's inverse distance, and ``shade`` (h, w, 4)
    its colour. The four pixels around the place are interpolated linearly. Those on other surfaces
    do not count, but take away opacity.
    """
    height, width = surface.shape
    zero, one = np.float32(0), np.float32(1)
    row, column = pixel
    own = surface[row, column]
    below = row + 1 if v > 0 else row - 1
    beside = column + 1 if u > 0 else column - 1
    u, v = abs(u), abs(v)
    covered = red = green = blue = zero
    for k in range(4):
        i = below if k // 2 else row
        j = beside if k % 2 else column
        if i < 0 or j < 0 or i >= height or j >= width:
            continue
        # Comparisons with NaN, where there is no ray, are false.
        if not abs(surface[i, j] - own) <= max(SPLAT_SAME * max(surface[i, j], own), FAR):
            continue
        part = (u if k % 2 else one - u) * (v if k // 2 else one - v)
        covered += part
        red += part * shade[i, j, 0]
        green += part * shade[i, j, 1]
        blue += part * shade[i, j, 2]
    opacity = min((covered + covered) * covered, one)
    return opacity, red / covered, green / covered, blue / covered


@kernel
def _parallelogram(corners: Any, wraps: bool, width: int) -> Any:
    """Return the middle x, y of a pixel of a view, and its sides to the right and down.

    ``corners`` are as in `_draw_splat`, and ``width`` is the picture's.
    """
    quarter, half = np.float32(0.25), np.float32(0.5)
    x0, x1, x2, x3, y0, y1, y2, y3 = corners
    if wraps:
        # Take the shorter of the two ways around.
        turn = np.float32(width)
        x1 -= turn * np.rint((x1 - x0) / turn)
        x2 -= turn * np.rint((x2 - x0) / turn)
        x3 -= turn * np.rint((x3 - x0) / turn)
    x = quarter * (x0 + x1 + x2 + x3)
    y = quarter * (y0 + y1 + y2 + y3)
    across_x = half * (x1 + x2 - x0 - x3)
    across_y = half * (y1 + y2 - y0 - y3)
    down_x = half * (x2 + x3 - x0 - x1)
    down_y = half * (y2 + y3 - y0 - y1)
    return x, y, across_x, across_y, down_x, down_y


@kernel
def _draw_splat(
    corners: Any,
    values: Any,
    wraps: bool,
    pixel: Any,
    surface: Array,
    shade: Array,
    inverse: Array,
    drawn: Array,
) -> None:
    """Draw a view's ``pixel`` (row, column) as a soft splat where nothing nearer is drawn yet.

    ``corners`` are the x of its four corners and their y. The pixel becomes a parallelogram.
    ``values`` are its inverse distance and its weight. As many of 2 × 2 samples show it as its
    opacity says. They hide all behind them, so that the order of drawing does not matter.
    """
    height, width = inverse.shape
    quarter, half = np.float32(0.25), np.float32(0.5)
    nearness, weight = values
    x, y, across_x, across_y, down_x, down_y = _parallelogram(corners, wraps, width)
    area = across_x * down_y - across_y * down_x
    # Skip splats seen from behind, and splats that the lens does not see.
    if not area > 0:
        return
    wide = SPLAT * (abs(across_x) + abs(down_x))
    high = SPLAT * (abs(across_y) + abs(down_y))
    if wide > half * LARGEST * width or high > half * LARGEST * height:
        return
    first = math.ceil(x - wide - half)
    last = math.floor(x + wide - half)
    if not wraps:
        first = max(first, 0)
        last = min(last, width - 1)
    top = max(math.ceil(y - high - half), 0)
    bottom = min(math.floor(y + high - half), height - 1)
    for i in range(top, bottom + 1):
        to_y = np.float32(i) + half - y
        for place in range(first, last + 1):
            j = place % width if wraps else place
            if nearness <= inverse[i, j]:
                continue
            to_x = np.float32(place) + half - x
            u = (to_x * down_y - to_y * down_x) / area
            v = (to_y * across_x - to_x * across_y) / area
            if abs(u) >= SPLAT or abs(v) >= SPLAT:
                continue
            opacity, red, green, blue = _splat_sample(pixel, u, v, surface, shade)
            # The four samples of a pixel show splats with an opacity of at least 1/8, 7/8, 5/8 and
            # 3/8.
            if opacity < quarter * (half + np.float32((2 * (i % 2) + 3 * (j % 2)) % 4)):
                continue
            inverse[i, j] = nearness
            drawn[i, j, 0] = red
            drawn[i, j, 1] = green
            drawn[i, j, 2] = blue
            drawn[i, j, 3] = weight


@kernel
def _mean_of_four(values: Array, first: int, column: int) -> Any:
    """Return the mean of four rows of ``values`` (n, m) in a column."""
    total = np.float32(0)
    for row in range(first, first + 4):
        total += values[row, column]
    return np.float32(0.25) * total


@kernel
def draw_splats(
    points: Array,
    values: Array,
    wraps: bool,
    pixels: Array,
    surface: Array,
    shade: Array,
    inverse: Array,
    drawn: Array,
) -> None:
    """Draw single pixels of a view as soft splats.

    ``points`` (4n, 2) and ``values`` (4n, 6) belong to the corners of n pixels, clockwise from the
    upper left. ``pixels`` (n, 2) are their rows and columns. ``surface`` (h, w) and ``shade`` (h,
    w, 4) are as in `_splat_sample`, and the other arguments as in `draw`.

    Source: Zwicker et al. 2001, "Surface Splatting", with a linear kernel.
    """
    for n in range(len(pixels)):
        first = 4 * n
        p0, p1, p2, p3 = points[first], points[first + 1], points[first + 2], points[first + 3]
        corners = (p0[0], p1[0], p2[0], p3[0], p0[1], p1[1], p2[1], p3[1])
        nearness = _mean_of_four(values, first, 0)
        certainty = _mean_of_four(values, first, 4)
        weight = _signed_weight(certainty, _mean_of_four(values, first, 5))
        pixel = (pixels[n, 0], pixels[n, 1])
        _draw_splat(corners, (nearness, weight), wraps, pixel, surface, shade, inverse, drawn)


@kernel
def sharpen(root: Array, right: Array, down: Array, amount: np.float32, sharp: Array) -> None:
    """Write the sharpened colours of ``root`` (h, w, 3) into ``sharp``.

    Subtracts ``amount`` / 4 of each neighbour's difference. Only neighbours on one surface count,
    as `link` marks them.
    """
    height, width = right.shape
    part = amount / np.float32(4)
    for i in range(height):
        for j in range(width):
            for c in range(3):
                here = root[i, j, c]
                difference = np.float32(0)
                if right[i, j]:
                    difference += root[i, j + 1, c] - here
                if j > 0 and right[i, j - 1]:
                    difference += root[i, j - 1, c] - here
                if down[i, j]:
                    difference += root[i + 1, j, c] - here
                if i > 0 and down[i - 1, j]:
                    difference += root[i - 1, j, c] - here
                sharp[i, j, c] = max(here - part * difference, np.float32(0))


@kernel
def _hidden_part(nearness: Any, front: Any) -> Any:
    """Return how much a surface at ``front`` hides a drawing at ``nearness``, 0 to 1.

    Both are inverse distances.
    """
    behind = (front - nearness) / max(front, FAR)
    return min(max((behind - SAME) / (HIDDEN - SAME), np.float32(0)), np.float32(1))


@kernel
def _blend_sample(inverses: Array, drawn: Array, row: int, column: int, light: Array) -> Any:
    """Add a sample's colour to ``light`` (3,). Return its inverse distance, −1 if none sees it.

    A drawing's weight is divided by its squared distance. The distance counts up to the limit that
    `BEHIND` sets. So near surfaces count most, but no single view decides at an edge. If a view is
    certain of a surface, the surface hides everything behind it. Colours are summed as the inverses
    of their roots, so that a highlight in one view counts little.
    """
    count = len(inverses)
    nearest = front = np.float32(-1)
    for k in range(count):
        nearness = inverses[k, row, column]
        nearest = max(nearest, nearness)
        if nearness > front and drawn[k, row, column, 3] > 0:
            front = nearness
    if nearest < 0:
        return nearest
    total = red = green = blue = np.float32(0)
    nearness_weight = nearness_sum = np.float32(0)
    slack = max(SAME * nearest, FAR)
    least = max(BEHIND * nearest, FAR)
    for k in range(count):
        nearness = inverses[k, row, column]
        if nearness < 0:
            continue
        weight = abs(drawn[k, row, column, 3])
        if nearness >= nearest - slack:
            nearness_weight += weight
            nearness_sum += weight * nearness
        counted = max(nearness, least)
        weight *= counted * counted * (1 - _hidden_part(nearness, front))
        red += weight / (drawn[k, row, column, 0] + DARK)
        green += weight / (drawn[k, row, column, 1] + DARK)
        blue += weight / (drawn[k, row, column, 2] + DARK)
        total += weight
    light[0] += (total / red - DARK) ** 2
    light[1] += (total / green - DARK) ** 2
    light[2] += (total / blue - DARK) ** 2
    return nearness_sum / nearness_weight


@kernel
def _second_largest(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return the second largest of four numbers."""
    return max(min(max(a, b), max(c, d)), min(a, b), min(c, d))


@kernel
def _surface_inverse(samples: Array) -> Any:
    """Return the mean of the inverse distances (4,) on the surface of the second nearest.

    −1 stands for none. Other surfaces do not count, because distances must not blend across an
    edge.
    """
    middle = _second_largest(samples[0], samples[1], samples[2], samples[3])
    if middle < 0:
        middle = max(samples[0], samples[1], samples[2], samples[3])
    total = number = np.float32(0)
    for k in range(4):
        if samples[k] >= 0 and abs(samples[k] - middle) <= max(SAME * middle, FAR):
            total += samples[k]
            number += 1
    return total / number


@kernel
def blend(inverses: Array, drawn: Array, colour: Array, inverse: Array, coverage: Array) -> None:
    """Blend the drawings (n, 2h, 2w) of `draw` into ``colour`` (h, w, 3).

    A pixel is the mean of 2 × 2 samples. ``inverse`` (h, w) gets its inverse distance. ``coverage``
    (h, w) gets the part of its samples that any of the n views sees.
    """
    height, width = coverage.shape
    samples = np.empty(4, np.float32)
    light = np.empty(3, np.float32)
    for i in range(height):
        for j in range(width):
            count = 0
            light[:] = 0
            for k in range(4):
                samples[k] = _blend_sample(inverses, drawn, 2 * i + k // 2, 2 * j + k % 2, light)
                if samples[k] >= 0:
                    count += 1
            coverage[i, j] = np.float32(0.25) * count
            if count == 0:
                colour[i, j] = inverse[i, j] = np.nan
                continue
            for c in range(3):
                colour[i, j, c] = light[c] / count
            inverse[i, j] = _surface_inverse(samples)


@kernel
def shrink(
    colour: Array,
    inverse: Array,
    coverage: Array,
    small: Array,
    small_inverse: Array,
    small_coverage: Array,
) -> None:
    """Average 2 × 2 pixels to one of the next coarser level. The farthest pixels count most.

    ``coverage`` (h, w) is the weight of each pixel, from 0 for a hole to 1.
    """
    height, width = coverage.shape
    for i in range(small_coverage.shape[0]):
        for j in range(small_coverage.shape[1]):
            behind = np.float32(np.inf)
            for row in range(2 * i, min(2 * i + 2, height)):
                for column in range(2 * j, min(2 * j + 2, width)):
                    if coverage[row, column] > 0:
                        behind = min(behind, inverse[row, column] + FAR)
            total = coverage_sum = inverse_sum = red = green = blue = np.float32(0)
            for row in range(2 * i, min(2 * i + 2, height)):
                for column in range(2 * j, min(2 * j + 2, width)):
                    if coverage[row, column] > 0:
                        weight = (
                            coverage[row, column] * (behind / (inverse[row, column] + FAR)) ** 2
                        )
                        total += weight
                        coverage_sum += coverage[row, column]
                        inverse_sum += weight * inverse[row, column]
                        red += weight * colour[row, column, 0]
                        green += weight * colour[row, column, 1]
                        blue += weight * colour[row, column, 2]
            small_coverage[i, j] = min(coverage_sum, np.float32(1))
            if total > 0:
                small_inverse[i, j] = inverse_sum / total
                small[i, j, 0] = red / total
                small[i, j, 1] = green / total
                small[i, j, 2] = blue / total


@kernel
def enlarge(
    small: Array, small_inverse: Array, wraps: bool, colour: Array, inverse: Array, coverage: Array
) -> None:
    """Fill pixels with ``coverage`` below 1 from the next coarser level, which has no holes.

    Each takes its four nearest coarse pixels. The farthest count most, as in `shrink`.
    """
    height, width = coverage.shape
    rows, columns = small_inverse.shape
    one, near_part, far_part = np.float32(1), np.float32(0.75), np.float32(0.25)
    for i in range(height):
        for j in range(width):
            covered = coverage[i, j]
            if covered >= one:
                continue
            row, column = i // 2, j // 2
            other_row = min(max(row + 2 * (i % 2) - 1, 0), rows - 1)
            other_column = column + 2 * (j % 2) - 1
            if wraps:
                other_column %= columns
            other_column = min(max(other_column, 0), columns - 1)
            total = inverse_sum = red = green = blue = np.float32(0)
            for k in range(4):
                y = other_row if k // 2 else row
                x = other_column if k % 2 else column
                weight = (far_part if k // 2 else near_part) * (far_part if k % 2 else near_part)
                weight /= (small_inverse[y, x] + FAR) ** 2
                total += weight
                inverse_sum += weight * small_inverse[y, x]
                red += weight * small[y, x, 0]
                green += weight * small[y, x, 1]
                blue += weight * small[y, x, 2]
            if covered == 0:
                colour[i, j] = inverse[i, j] = np.float32(0)
            rest = one - covered
            inverse[i, j] = covered * inverse[i, j] + rest * inverse_sum / total
            colour[i, j, 0] = covered * colour[i, j, 0] + rest * red / total
            colour[i, j, 1] = covered * colour[i, j, 1] + rest * green / total
            colour[i, j, 2] = covered * colour[i, j, 2] + rest * blue / total
            coverage[i, j] = one
