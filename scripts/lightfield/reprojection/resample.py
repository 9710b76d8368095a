"""Resampling through a lens map: colour by a choice of filters, depth by surface.

Sources are held as (h, w, 4) float32 windows of the image; what is not finite is no sample: it is
left out and the other weights are scaled up, and where nothing is left the result is NaN.
"""

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
import numpy as np
import OpenImageIO as oiio
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

from lightfield.core.errors import UserError
from lightfield.geometry.lenses import Array
from lightfield.imaging.images import HALF_MAX

if TYPE_CHECKING:
    from lightfield.reprojection.lens_map import LensMap

NEAREST = "nearest"
ADAPTIVE = "adaptive"
ST_WARP = "st_warp"

# Source pixels that a filter reads on each side of the one that a sample falls in.
SUPPORT = {NEAREST: 0, "bilinear": 1, "bicubic": 2, "lanczos": 3, ADAPTIVE: 2, ST_WARP: 2}
_TAPS = {"bilinear": 2, "bicubic": 4, "lanczos": 6, ADAPTIVE: 4}
FILTERS = tuple(SUPPORT)
DEFAULT_FILTER = ADAPTIVE

_STRIP = 64  # rows, or rows of samples, resampled at a time

# Depth is interpolated where its third differences are below this fraction of it, so a step of
# half as much may remain unseen: 1e-4, or for halves what their own steps are.
_SMOOTH = {np.dtype(np.float32): np.float32(2e-4), np.dtype(np.float16): np.float32(4e-3)}

_F = TypeVar("_F", bound=Callable[..., Any])


# Infinities and NaNs keep their meaning: only contraction and the sign of zero are relaxed, and
# dividing by zero gives one of them.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}}


def kernel(function: _F) -> _F:
    """Compile a function, and keep the machine code for the next process."""
    return cast(_F, numba.njit(cache=True, **_OPTIONS)(function))


def _inline(function: _F) -> _F:
    """Compile a function into each of its callers."""
    return cast(_F, numba.njit(inline="always", **_OPTIONS)(function))


@intrinsic  # type: ignore[untyped-decorator]
def _half_to_float(typing: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        half = builder.bitcast(arguments[0], ir.HalfType())
        return builder.fpext(half, ir.FloatType())

    return types.float32(types.uint16), generate


@intrinsic  # type: ignore[untyped-decorator]
def _float_to_half(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        half = builder.fptrunc(arguments[0], ir.HalfType())
        return builder.bitcast(half, ir.IntType(16))

    return types.uint16(types.float32), generate


@kernel
def _widen_half(red: Array, green: Array, blue: Array, out: Array) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j, 0] = _half_to_float(red[i, j])
            out[i, j, 1] = _half_to_float(green[i, j])
            out[i, j, 2] = _half_to_float(blue[i, j])
            out[i, j, 3] = 0


@kernel
def _narrow_to_half(values: Array, out: Array) -> None:
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            for c in range(out.shape[0]):
                # A kernel may overshoot; beyond the half range lies infinity.
                value = min(max(values[i, j, c], -np.float32(HALF_MAX)), np.float32(HALF_MAX))
                out[c, i, j] = _float_to_half(value)


def widen(red: Array, green: Array, blue: Array, alpha: Array | None = None) -> Array:
    """Return (h, w) half or float channels as (h, w, 4) float32; without ``alpha`` it is 0."""
    out = np.empty((*red.shape, 4), np.float32)
    if red.dtype == green.dtype == blue.dtype == np.float16:
        _widen_half(red.view(np.uint16), green.view(np.uint16), blue.view(np.uint16), out)
    else:
        out[:, :, 0], out[:, :, 1], out[:, :, 2], out[:, :, 3] = red, green, blue, 0
    if alpha is not None:
        out[:, :, 3] = alpha
    return out


def narrow(pixels: Array, count: int) -> Array:
    """Return the first ``count`` channels of (h, w, 4) float32 pixels as half, (count, h, w)."""
    out = np.empty((count, *pixels.shape[:2]), np.float16)
    _narrow_to_half(pixels, out.view(np.uint16))
    return out


@kernel
def _linear_weights(t: Any) -> tuple[Any, Any]:
    """Weights of the two pixels around a point at ``t`` in [0, 1) past the left one."""
    return np.float32(1) - t, t


@kernel
def _cubic_weights(t: Any) -> tuple[Any, Any, Any, Any]:
    """Weights of four pixels, for a point at ``t`` in [0, 1) past the second.

    Source: Catmull and Rom 1974; the cubic convolution of third order of Keys 1981 (a = −1/2).
    """
    half, one = np.float32(0.5), np.float32(1)
    return (
        t * (t * (one - half * t) - half),
        one + t * t * (np.float32(1.5) * t - np.float32(2.5)),
        t * (half + t * (np.float32(2) - np.float32(1.5) * t)),
        t * t * (half * t - half),
    )


@kernel
def _lanczos_weights(t: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Weights of six pixels, for a point at ``t`` in [0, 1) past the third.

    sinc(u) sinc(u / 3) (Turkowski 1990), made to sum to one.
    """
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    if t < np.float32(1e-5):
        return zero, zero, one, zero, zero, zero
    # sin(π u / 3) at u = t + 2, t + 1, …, t − 3, by the addition theorem.
    third = np.float32(np.pi / 3) * t
    a, b = half * np.sin(third), np.float32(math.sqrt(0.75)) * np.cos(third)
    w0 = (b - a) / ((t + 2) * (t + 2))
    w1 = -(b + a) / ((t + 1) * (t + 1))
    w2 = 2 * a / (t * t)
    w3 = (b - a) / ((t - 1) * (t - 1))
    w4 = -(b + a) / ((t - 2) * (t - 2))
    w5 = 2 * a / ((t - 3) * (t - 3))
    # sin(π u) is the same in all but for the sign, which is in them, and drops out.
    scale = one / (w0 + w1 + w2 + w3 + w4 + w5)
    return w0 * scale, w1 * scale, w2 * scale, w3 * scale, w4 * scale, w5 * scale


def _sampler(taps: int) -> Callable[..., tuple[Any, Any, Any, Any]]:
    """Make the function that samples at (x, y) where all ``taps`` × ``taps`` pixels exist."""
    reach = taps // 2 - 1

    def sample(source: Array, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
        x -= np.float32(0.5)
        y -= np.float32(0.5)
        wx: Any
        wy: Any
        # The branches of the other kernels are gone before types are found.
        if taps == 2:
            wx, wy = _linear_weights(x - np.floor(x)), _linear_weights(y - np.floor(y))
        elif taps == 4:
            wx, wy = _cubic_weights(x - np.floor(x)), _cubic_weights(y - np.floor(y))
        else:
            wx, wy = _lanczos_weights(x - np.floor(x)), _lanczos_weights(y - np.floor(y))
        # Unsigned, so that no index is checked for counting from the end.
        column = np.uint64(int(x) - reach)
        row = np.uint64(int(y) - reach)
        s0 = s1 = s2 = s3 = np.float32(0)
        for a in range(np.uint64(taps)):
            r0 = r1 = r2 = r3 = np.float32(0)
            for b in range(np.uint64(taps)):
                r0 += wx[b] * source[row + a, column + b, 0]
                r1 += wx[b] * source[row + a, column + b, 1]
                r2 += wx[b] * source[row + a, column + b, 2]
                r3 += wx[b] * source[row + a, column + b, 3]
            s0 += wy[a] * r0
            s1 += wy[a] * r1
            s2 += wy[a] * r2
            s3 += wy[a] * r3
        return s0, s1, s2, s3

    return _inline(sample)


_sample_2, _sample_4, _sample_6 = _sampler(2), _sampler(4), _sampler(6)


@kernel
def _is_light(s0: Any, s1: Any, s2: Any, s3: Any) -> bool:
    """Whether all are finite and none is negative."""
    return bool(s0 + s1 + s2 + s3 < np.inf and min(min(s0, s1), min(s2, s3)) >= 0)


@kernel
def _source_index(
    row: int,
    column: int,
    home: int,
    height: int,
    width: int,
    topology: tuple[bool, bool, bool, int],
) -> tuple[int, int]:
    """The pixel that continues the image at (row, column), or row −1 if none does.

    ``home`` is a column of the panel that must not be left.
    """
    wraps, top, bottom, panels = topology
    if wraps:
        # Beyond a pole lies the same row, half a turn away.
        if row < 0 and top:
            row, column = -1 - row, column + width // 2
        elif row >= height and bottom:
            row, column = 2 * height - 1 - row, column + width // 2
        column %= width
    if row < 0 or row >= height or column < 0 or column >= width:
        return -1, 0
    if panels > 1 and column // (width // panels) != home // (width // panels):
        return -1, 0
    return row, column


@kernel
def _fill_weights(taps: int, t: Any, out: Array) -> None:
    if taps == 2:
        out[0], out[1] = _linear_weights(t)
    elif taps == 4:
        out[0], out[1], out[2], out[3] = _cubic_weights(t)
    else:
        out[0], out[1], out[2], out[3], out[4], out[5] = _lanczos_weights(t)


@kernel
def _careful(
    source: Array,
    valid: Array,
    x: Any,
    y: Any,
    home: int,
    taps: int,
    topology: tuple[bool, bool, bool, int],
    result: Array,
) -> bool:
    """Sample at (x, y) where pixels may be missing or negative; whether any is there.

    ``home`` is a column of the panel that the target pixel's centre lies on.
    Where one is missing, the answer is bilinear among those of the four nearest that are there:
    a kernel with negative lobes does not survive the loss of a part of it. Nor do such lobes make
    light negative: what comes out below zero is raised to the darkest of the pixels.
    """
    height, width = source.shape[0], source.shape[1]
    column, row = int(np.floor(x - np.float32(0.5))), int(np.floor(y - np.float32(0.5)))
    fx, fy = x - np.float32(0.5) - np.float32(column), y - np.float32(0.5) - np.float32(row)
    wx, wy = np.empty(6, np.float32), np.empty(6, np.float32)
    darkest = np.empty(4, np.float32)
    while True:
        _fill_weights(taps, fx, wx)
        _fill_weights(taps, fy, wy)
        complete = True
        total = np.float32(0)
        result[:] = 0
        darkest[:] = 0
        for a in range(taps):
            for b in range(taps):
                i, j = _source_index(
                    row + a - taps // 2 + 1,
                    column + b - taps // 2 + 1,
                    home,
                    height,
                    width,
                    topology,
                )
                if i >= 0 and valid[i, j] == valid[i, j] and np.isfinite(np.sum(source[i, j])):
                    weight = wy[a] * wx[b]
                    total += weight
                    for c in range(4):
                        result[c] += weight * source[i, j, c]
                        darkest[c] = min(darkest[c], source[i, j, c])
                else:
                    complete = False
        if complete or taps == 2:
            break
        taps = 2
    # The bilinear weights of all that is there may be zero: the point lies on what is not.
    if total < np.float32(1e-4):
        return False
    for c in range(4):
        result[c] = max(result[c] / total, darkest[c])
    return True


@kernel
def _nearest(source: Array, valid: Array, points: Array, flags: Array, out: Array) -> None:
    height, width = source.shape[0], source.shape[1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = np.nan
            if flags[i, j] > 0:
                row = min(int(points[i, j, 1]), height - 1)
                column = min(int(points[i, j, 0]), width - 1)
                p = source[row, column]
                if valid[row, column] == valid[row, column] and np.isfinite(
                    p[0] + p[1] + p[2] + p[3]
                ):
                    out[i, j] = p


def _interpolator(taps: int) -> Callable[..., None]:
    """Make the function that samples ``taps`` × ``taps`` pixels at every point."""

    def interpolate(
        source: Array,
        valid: Array,
        points: Array,
        flags: Array,
        topology: tuple[bool, bool, bool, int],
        out: Array,
    ) -> None:
        result = np.empty(4, np.float32)
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                flag, x, y = flags[i, j], points[i, j, 0], points[i, j, 1]
                if flag == 1:
                    if taps == 2:
                        s0, s1, s2, s3 = _sample_2(source, x, y)
                    elif taps == 4:
                        s0, s1, s2, s3 = _sample_4(source, x, y)
                    else:
                        s0, s1, s2, s3 = _sample_6(source, x, y)
                    if _is_light(s0, s1, s2, s3):
                        out[i, j, 0] = s0
                        out[i, j, 1] = s1
                        out[i, j, 2] = s2
                        out[i, j, 3] = s3
                        continue
                if flag > 0 and _careful(source, valid, x, y, int(x), taps, topology, result):
                    out[i, j] = result
                else:
                    out[i, j] = np.nan

    return kernel(interpolate)


_interpolate = {2: _interpolator(2), 4: _interpolator(4), 6: _interpolator(6)}


@kernel
def _adaptive(
    source: Array,
    valid: Array,
    centers: Array,
    footprints: Array,
    counts: Array,
    flags: Array,
    topology: tuple[bool, bool, bool, int],
    out: Array,
) -> None:
    """Average bicubic samples that cover each pixel's footprint in the source."""
    result = np.empty(4, np.float32)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = np.nan
            flag = flags[i, j]
            if flag == 0:
                continue
            across, down = counts[i, j, 0], counts[i, j, 1]
            x, y = centers[i, j, 0], centers[i, j, 1]
            ux, uy = footprints[i, j, 0, 0], footprints[i, j, 1, 0]
            vx, vy = footprints[i, j, 0, 1], footprints[i, j, 1, 1]
            a0 = a1 = a2 = a3 = np.float32(0)
            found = 0
            for q in range(down):
                v = np.float32(q) - np.float32(0.5) * np.float32(down - 1)
                for p in range(across):
                    u = np.float32(p) - np.float32(0.5) * np.float32(across - 1)
                    px = x + u * ux + v * vx
                    py = y + u * uy + v * vy
                    s0 = s1 = s2 = s3 = np.float32(np.nan)
                    if flag == 1:
                        s0, s1, s2, s3 = _sample_4(source, px, py)
                    if not _is_light(s0, s1, s2, s3):
                        if not _careful(source, valid, px, py, int(x), 4, topology, result):
                            continue
                        s0, s1, s2, s3 = result[0], result[1], result[2], result[3]
                    found += 1
                    a0 += s0
                    a1 += s1
                    a2 += s2
                    a3 += s3
            if found:
                scale = np.float32(1) / np.float32(found)
                out[i, j, 0] = a0 * scale
                out[i, j, 1] = a1 * scale
                out[i, j, 2] = a2 * scale
                out[i, j, 3] = a3 * scale


@kernel
def _block_mean(fine: Array, samples: int, out: Array) -> None:
    """Average blocks of ``samples`` × ``samples`` pixels, of those that are numbers."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            a0 = a1 = a2 = a3 = np.float32(0)
            found = 0
            for p in range(i * samples, (i + 1) * samples):
                for q in range(j * samples, (j + 1) * samples):
                    if fine[p, q, 0] == fine[p, q, 0]:
                        found += 1
                        a0 += fine[p, q, 0]
                        a1 += fine[p, q, 1]
                        a2 += fine[p, q, 2]
                        a3 += fine[p, q, 3]
            scale = np.float32(1) / np.float32(found) if found else np.float32(np.nan)
            out[i, j, 0] = a0 * scale
            out[i, j, 1] = a1 * scale
            out[i, j, 2] = a2 * scale
            out[i, j, 3] = a3 * scale


def _resample(source: Array, lens_map: "LensMap", rows: slice, out: Array) -> None:
    """Fill ``out`` with the samples of the map's sample rows ``rows``, one pixel a sample."""
    points, flags = lens_map.samples[rows], lens_map.flags[rows]
    name = lens_map.settings["filter"]
    if name == NEAREST:
        _nearest(source, lens_map.source_cos, points, flags, out)
    else:
        _interpolate[_TAPS[name]](
            source, lens_map.source_cos, points, flags, lens_map.topology, out
        )


@kernel
def _continue_faces(source: Array, strip: Array, out: Array) -> None:
    """Give each face of a cube map a border, bicubic samples of the faces around it."""
    size, side = source.shape[0], strip.shape[0]
    border = (side - size) // 2
    wx, wy = np.empty(6, np.float32), np.empty(6, np.float32)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            row, column = i - border, j % side - border
            if 0 <= row < size and 0 <= column < size:
                out[i, j] = source[row, j // side * size + column]
                continue
            x, y = strip[i, j, 0] - np.float32(0.5), strip[i, j, 1] - np.float32(0.5)
            column, row = int(np.floor(x)), int(np.floor(y))
            _fill_weights(4, x - np.float32(column), wx)
            _fill_weights(4, y - np.float32(row), wy)
            first = int(strip[i, j, 0]) // size * size
            for c in range(4):
                total = darkest = np.float32(0)
                for a in range(4):
                    for b in range(4):
                        p = min(max(row + a - 1, 0), size - 1)
                        q = min(max(column + b - 1, first), first + size - 1)
                        total += wy[a] * wx[b] * source[p, q, c]
                        darkest = min(darkest, source[p, q, c])
                # NaN, which stays, marks what is no sample.
                out[i, j, c] = darkest if total < darkest else total


def _with_borders(source: Array, lens_map: "LensMap") -> Array:
    """Return the window, of a cube map with what surrounds each face."""
    if lens_map.strip is None:
        return source
    out = np.empty((*lens_map.strip.shape[:2], 4), np.float32)
    _continue_faces(source, lens_map.strip, out)
    return out


def resample_color(source: Array, lens_map: "LensMap") -> Array:
    """Resample a source window (h, w, 4) float32 to (H, W, 4); NaN where it has no source."""
    out = np.empty((*lens_map.target_cos.shape, 4), np.float32)
    for rows, strip in color_strips(source, lens_map):
        out[rows] = strip
    return out


def color_strips(source: Array, lens_map: "LensMap") -> Iterator[tuple[slice, Array]]:
    """Yield the rows of what `resample_color` returns, as many at a time as the caches hold."""
    height, width = lens_map.target_cos.shape
    source = _with_borders(source, lens_map)
    if source.shape[:2] != lens_map.source_cos.shape:
        raise UserError(
            f"the source window has {source.shape[1]} × {source.shape[0]} pixels and the lens map "
            f"expects {lens_map.source_cos.shape[1]} × {lens_map.source_cos.shape[0]}"
        )
    if lens_map.settings["filter"] == ST_WARP:
        yield slice(0, height), _st_warp(source, lens_map)
        return
    samples = lens_map.settings["samples"]
    step = max(1, _STRIP // samples)
    for first in range(0, height, step):
        rows = slice(first, min(first + step, height))
        out = np.empty((rows.stop - first, width, 4), np.float32)
        if lens_map.footprints is not None and lens_map.counts is not None:
            _adaptive(
                source,
                lens_map.source_cos,
                lens_map.centers[rows],
                lens_map.footprints[rows],
                lens_map.counts[rows],
                lens_map.flags[rows],
                lens_map.topology,
                out,
            )
        elif samples == 1:
            _resample(source, lens_map, rows, out)
        else:
            fine = np.empty((len(out) * samples, width * samples, 4), np.float32)
            _resample(source, lens_map, slice(first * samples, rows.stop * samples), fine)
            _block_mean(fine, samples, out)
        yield rows, out


def _st_warp(source: Array, lens_map: "LensMap") -> Array:
    """Resample with OpenImageIO's st_warp and its Catmull-Rom filter."""
    height, width = lens_map.target_cos.shape
    valid = np.isfinite(source).all(axis=-1) & ~np.isnan(lens_map.source_cos)
    # A fifth channel counts the weights that fell on valid pixels.
    channels = np.dstack([np.where(valid[..., None], source, 0), valid]).astype(np.float32)
    scale = np.array([source.shape[1], source.shape[0]], np.float32)
    st = np.where((lens_map.flags == 0)[..., None], -1, lens_map.samples / scale)
    warped = _image_buffer(np.zeros((*st.shape[:2], 5), np.float32))
    if not oiio.ImageBufAlgo.st_warp(
        warped, _image_buffer(channels), _image_buffer(st.astype(np.float32)), "catmull-rom",
        nthreads=1,
    ):  # fmt: skip
        raise UserError(f"filter: st_warp failed: {warped.geterror()}")
    samples = lens_map.settings["samples"]
    pixels = np.asarray(warped.get_pixels(oiio.FLOAT))
    blocks = pixels.reshape(height, samples, width, samples, 5).mean(axis=(1, 3))
    weight = blocks[..., 4:]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(weight > 1e-3, blocks[..., :4] / weight, np.nan))


def _image_buffer(pixels: Array) -> Any:
    height, width, count = pixels.shape
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, count, "float"))
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, count), np.ascontiguousarray(pixels))
    return buffer


@kernel
def _inverse_distance(depth: Array, cos: Array, is_z: bool, out: Array) -> None:
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            z = depth[i, j]
            # The cosine is NaN outside the image circle, and marks what has no ray.
            out[i, j] = (cos[i, j] if is_z else cos[i, j] * 0 + np.float32(1)) / z


@kernel
def _inverse_distance_half(bits: Array, cos: Array, is_z: bool, out: Array) -> None:
    for i in range(bits.shape[0]):
        for j in range(bits.shape[1]):
            z = _half_to_float(bits[i, j])
            out[i, j] = (cos[i, j] if is_z else cos[i, j] * 0 + np.float32(1)) / z


@kernel
def _curvatures(a: Any, b: Any, c: Any, d: Any, tolerance: Any) -> tuple[Any, Any]:
    """The second differences of four neighbours, about the second and the third.

    NaN unless the four are of one smooth surface: where their third difference is small against
    them, or where they curve one way, evenly, and not by much. A step between two surfaces curves
    both ways.
    """
    before, after = a - 2 * b + c, b - 2 * c + d
    third = abs(after - before)
    if not third <= tolerance * b:
        even = third <= np.float32(0.5) * max(abs(before), abs(after))
        if not (even and before * after > 0 and abs(c - b) <= np.float32(0.05) * b):
            return np.float32(np.nan), np.float32(np.nan)
    return before, after


@_inline
def _cell(
    inverse: Array,
    row: int,
    column: int,
    home: int,
    tolerance: Any,
    topology: tuple[bool, bool, bool, int],
) -> Any:
    """The four pixels whose first is (row, column), and their curvatures along the four sides."""
    height, width = inverse.shape
    within = row >= 1 and row < height - 2 and column >= 1 and column < width - 2
    if within and topology[3] > 1:
        panel = width // topology[3]
        within = (column - 1) // panel == (column + 2) // panel
    if within:
        # Unsigned, so that no index is checked for counting from the end.
        one, two, i, j = np.uint64(1), np.uint64(2), np.uint64(row), np.uint64(column)
        a0, a1 = inverse[i, j - one], inverse[i, j]
        a2, a3 = inverse[i, j + one], inverse[i, j + two]
        b0, b1 = inverse[i + one, j - one], inverse[i + one, j]
        b2, b3 = inverse[i + one, j + one], inverse[i + one, j + two]
        c1, c2 = inverse[i - one, j], inverse[i - one, j + one]
        d1, d2 = inverse[i + two, j], inverse[i + two, j + one]
    else:
        a0 = _value(inverse, row, column - 1, home, topology)
        a1 = _value(inverse, row, column, home, topology)
        a2 = _value(inverse, row, column + 1, home, topology)
        a3 = _value(inverse, row, column + 2, home, topology)
        b0 = _value(inverse, row + 1, column - 1, home, topology)
        b1 = _value(inverse, row + 1, column, home, topology)
        b2 = _value(inverse, row + 1, column + 1, home, topology)
        b3 = _value(inverse, row + 1, column + 2, home, topology)
        c1 = _value(inverse, row - 1, column, home, topology)
        c2 = _value(inverse, row - 1, column + 1, home, topology)
        d1 = _value(inverse, row + 2, column, home, topology)
        d2 = _value(inverse, row + 2, column + 1, home, topology)
    return (
        (a1, a2, b1, b2),
        _curvatures(a0, a1, a2, a3, tolerance),
        _curvatures(b0, b1, b2, b3, tolerance),
        _curvatures(c1, a1, b1, d1, tolerance),
        _curvatures(c2, a2, b2, d2, tolerance),
    )


@_inline
def _bend(before: Any, after: Any, f: Any) -> Any:
    """What a cubic adds to a line at fraction ``f``, by Everett's interpolation formula."""
    one = np.float32(1)
    g = one - f
    return (g * (g * g - one) * before + f * (f * f - one) * after) * np.float32(1 / 6)


@kernel
def _value(
    inverse: Array, row: int, column: int, home: int, topology: tuple[bool, bool, bool, int]
) -> Any:
    row, column = _source_index(row, column, home, inverse.shape[0], inverse.shape[1], topology)
    return inverse[row, column] if row >= 0 else np.float32(np.nan)


@kernel
def _pick(
    inverse: Array,
    valid: Array,
    centers: Array,
    cos: Array,
    as_z: bool,
    tolerance: np.float32,
    topology: tuple[bool, bool, bool, int],
    out: Array,
) -> None:
    height, width = inverse.shape
    half = np.float32(0.5)
    last_row, last_column = 0, 0
    cell = _cell(inverse, 0, 0, 0, tolerance, topology)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x, y = centers[i, j, 0], centers[i, j, 1]
            if x != x:
                out[i, j] = np.nan
                continue
            row, column = int(np.floor(y - half)), int(np.floor(x - half))
            # Where pixels are magnified, neighbours share a cell.
            if row != last_row or column != last_column:
                cell = _cell(inverse, row, column, int(x), tolerance, topology)
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
                found = min(max(smooth, low), high)
            else:
                nearest = min(int(y), height - 1), min(int(x), width - 1)
                found = inverse[nearest]
                if valid[nearest] != valid[nearest]:
                    # Beyond the rim of the image circle: the nearest of the four pixels around.
                    shortest = np.float32(4)
                    for q in range(2):
                        for p in range(2):
                            k, m = _source_index(
                                row + q, column + p, int(x), height, width, topology
                            )
                            away = (fx - p) * (fx - p) + (fy - q) * (fy - q)
                            if k >= 0 and valid[k, m] == valid[k, m] and away < shortest:
                                shortest = away
                                found = inverse[k, m]
            if found == 0:
                out[i, j] = np.inf
            else:
                out[i, j] = (cos[i, j] if as_z else np.float32(1)) / found


def resample_depth(
    depth: Array, source_is_z: bool, target_is_z: bool, lens_map: "LensMap"
) -> Array:
    """Resample a depth window (h, w), half or float, at the target pixels' centres.

    ``source_is_z`` and ``target_is_z`` say which of Z-depth and distance the two images hold. On a
    smooth surface 1 / distance is interpolated, which is nearly linear for a plane, within the
    range of the four pixels around; elsewhere the pixel that the ray falls in is taken, or beyond
    the rim of the image circle the nearest of those four, so no depth lies between two surfaces.
    Returns (H, W) float32; a miss (inf) stays inf, NaN marks a pixel without a source.
    """
    if lens_map.strip is not None:
        # A depth beyond its face's edge would be along another axis, or between two surfaces.
        border = (lens_map.strip.shape[0] - depth.shape[0]) // 2
        depth = np.hstack([np.pad(face, border, mode="edge") for face in np.hsplit(depth, 6)])
    inverse = np.empty(depth.shape, np.float32)
    if depth.dtype == np.float16:
        bits = np.ascontiguousarray(depth).view(np.uint16)
        _inverse_distance_half(bits, lens_map.source_cos, source_is_z, inverse)
    else:
        _inverse_distance(depth, lens_map.source_cos, source_is_z, inverse)
    out = np.empty(lens_map.target_cos.shape, np.float32)
    _pick(
        inverse,
        lens_map.source_cos,
        lens_map.centers,
        lens_map.target_cos,
        target_is_z,
        _SMOOTH[depth.dtype],
        lens_map.topology,
        out,
    )
    return out
