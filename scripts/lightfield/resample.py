"""Resampling through a lens map: colour by a choice of filters, depth by surface.

Sources are held as (h, w, 4) float32 windows of the image; what is not finite is no sample: it is
left out and the other weights are scaled up, and where nothing is left the result is NaN.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
import numpy as np
import OpenImageIO as oiio
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

from lightfield.errors import UserError
from lightfield.lenses import Array

if TYPE_CHECKING:
    from lightfield.lens_map import LensMap

NEAREST = "nearest"
ADAPTIVE = "adaptive"
ST_WARP = "st_warp"

# Source pixels that a filter reads on each side of the one that a sample falls in.
SUPPORT = {NEAREST: 0, "bilinear": 1, "bicubic": 2, "lanczos": 3, ST_WARP: 2}
_TAPS = {NEAREST: 1, "bilinear": 2, "bicubic": 4, "lanczos": 6}
FILTERS = tuple(SUPPORT)
DEFAULT_FILTER = "bicubic"

# Depth is interpolated where its third differences are below this fraction of it; a step twice
# as large as what remains unseen, 1e-4, is the accuracy that depth is promised to have.
_SMOOTH = {np.dtype(np.float32): np.float32(2e-4), np.dtype(np.float16): np.float32(4e-3)}

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    # Infinities and NaNs keep their meaning: only contraction and the sign of zero are relaxed.
    fast = {"contract", "nsz"}
    return cast(_F, numba.njit(cache=True, nogil=True, fastmath=fast)(function))


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
def _widen_half(bits: Array, out: Array) -> None:
    for i in range(bits.shape[0]):
        for j in range(bits.shape[1]):
            for c in range(bits.shape[2]):
                out[i, j, c] = _half_to_float(bits[i, j, c])


@kernel
def _narrow_to_half(values: Array, out: Array) -> None:
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            for c in range(out.shape[2]):
                out[i, j, c] = _float_to_half(values[i, j, c])


def widen(pixels: Array) -> Array:
    """Return (h, w, 1 to 4) half or float pixels as (h, w, 4) float32; what they lack is 0."""
    height, width, count = pixels.shape
    out = np.empty((height, width, 4), np.float32)
    out[:, :, count:] = 0
    if pixels.dtype == np.float16:
        _widen_half(pixels.view(np.uint16), out)
    else:
        out[:, :, :count] = pixels
    return out


def narrow(pixels: Array, count: int) -> Array:
    """Return the first ``count`` channels of (h, w, 4) float32 pixels as half, (h, w, count)."""
    out = np.empty((*pixels.shape[:2], count), np.float16)
    _narrow_to_half(pixels, out.view(np.uint16))
    return out


@kernel
def _fill_weights(taps: int, t: float, weights: Array) -> None:
    """Weights of ``taps`` pixels for a point at ``t`` in [0, 1) past the middle-left one."""
    if taps == 2:
        weights[0] = 1 - t
        weights[1] = t
    elif taps == 4:
        # Catmull and Rom 1974: the cubic convolution of third order (Keys 1981, a = −1/2).
        weights[0] = t * (-0.5 + t * (1.0 - 0.5 * t))
        weights[1] = 1.0 + t * t * (1.5 * t - 2.5)
        weights[2] = t * (0.5 + t * (2.0 - 1.5 * t))
        weights[3] = t * t * (0.5 * t - 0.5)
    else:
        # Lanczos with three lobes, sinc(u) sinc(u / 3), made to sum to one.
        total = 0.0
        for k in range(6):
            u = np.pi * (t + 2.0 - k)
            weight = 1.0 if abs(u) < 1e-6 else 3.0 * np.sin(u) * np.sin(u / 3.0) / (u * u)
            weights[k] = weight
            total += weight
        for k in range(6):
            weights[k] /= total


@kernel
def _source_index(
    row: int, column: int, height: int, width: int, wraps: bool, top: bool, bottom: bool
) -> tuple[int, int]:
    """The pixel that continues the image at (row, column), or row −1 if none does."""
    if wraps:
        # Beyond a pole lies the same row, half a turn away.
        if row < 0 and top:
            row, column = -1 - row, column + width // 2
        elif row >= height and bottom:
            row, column = 2 * height - 1 - row, column + width // 2
        column %= width
    if row < 0 or row >= height or column < 0 or column >= width:
        return -1, 0
    return row, column


@kernel
def _careful(
    source: Array,
    valid: Array,
    row: int,
    column: int,
    taps: int,
    fx: float,
    fy: float,
    topology: tuple[bool, bool, bool],
    wx: Array,
    wy: Array,
    result: Array,
) -> bool:
    """Interpolate where pixels may be missing; False if all are.

    Where any is, the answer is bilinear among those of the four nearest that are there: a kernel
    with negative lobes does not survive the loss of a part of it.
    """
    height, width = source.shape[0], source.shape[1]
    wraps, top, bottom = topology
    while taps > 0:
        _fill_weights(taps, fx, wx)
        _fill_weights(taps, fy, wy)
        total = 0.0
        complete = True
        result[:] = 0
        for a in range(taps):
            for b in range(taps):
                weight = wy[a] * wx[b]
                i, j = _source_index(
                    row + a - taps // 2 + 1,
                    column + b - taps // 2 + 1,
                    height, width, wraps, top, bottom,
                )  # fmt: skip
                if i >= 0 and valid[i, j] == valid[i, j]:
                    pixel = source[i, j]
                    if np.isfinite(pixel[0] + pixel[1] + pixel[2] + pixel[3]):
                        total += weight
                        for c in range(4):
                            result[c] += np.float32(weight) * pixel[c]
                        continue
                complete = False
        if complete or taps == 2:
            if total <= 1e-6:
                return False
            for c in range(4):
                result[c] /= np.float32(total)
            return True
        taps = 2
    return False


@kernel
def _interpolate(
    source: Array,
    valid: Array,
    points: Array,
    flags: Array,
    taps: int,
    samples: int,
    topology: tuple[bool, bool, bool],
    out: Array,
) -> None:
    wx = np.empty(6, np.float32)
    wy = np.empty(6, np.float32)
    result = np.empty(4, np.float32)
    reach = taps // 2 - 1
    height, width = source.shape[0], source.shape[1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            a0 = a1 = a2 = a3 = np.float32(0)
            count = 0
            for p in range(i * samples, (i + 1) * samples):
                for q in range(j * samples, (j + 1) * samples):
                    flag = flags[p, q]
                    if flag == 0:
                        continue
                    if taps == 1:
                        row = min(int(points[p, q, 1]), height - 1)
                        column = min(int(points[p, q, 0]), width - 1)
                        pixel = source[row, column]
                        whole = np.isfinite(pixel[0] + pixel[1] + pixel[2] + pixel[3])
                        if whole and valid[row, column] == valid[row, column]:
                            a0 += pixel[0]
                            a1 += pixel[1]
                            a2 += pixel[2]
                            a3 += pixel[3]
                            count += 1
                        continue
                    x = points[p, q, 0] - np.float32(0.5)
                    y = points[p, q, 1] - np.float32(0.5)
                    column = int(np.floor(x))
                    row = int(np.floor(y))
                    fx = x - np.float32(column)
                    fy = y - np.float32(row)
                    if flag == 1:
                        _fill_weights(taps, fx, wx)
                        _fill_weights(taps, fy, wy)
                        s0 = s1 = s2 = s3 = np.float32(0)
                        for a in range(taps):
                            r0 = r1 = r2 = r3 = np.float32(0)
                            for b in range(taps):
                                weight = wx[b]
                                r0 += weight * source[row - reach + a, column - reach + b, 0]
                                r1 += weight * source[row - reach + a, column - reach + b, 1]
                                r2 += weight * source[row - reach + a, column - reach + b, 2]
                                r3 += weight * source[row - reach + a, column - reach + b, 3]
                            weight = wy[a]
                            s0 += weight * r0
                            s1 += weight * r1
                            s2 += weight * r2
                            s3 += weight * r3
                        if np.isfinite(s0 + s1 + s2 + s3):
                            a0 += s0
                            a1 += s1
                            a2 += s2
                            a3 += s3
                            count += 1
                            continue
                    if _careful(source, valid, row, column, taps, fx, fy, topology, wx, wy, result):
                        a0 += result[0]
                        a1 += result[1]
                        a2 += result[2]
                        a3 += result[3]
                        count += 1
            if count == 0:
                a0 = a1 = a2 = a3 = np.float32(np.nan)
            else:
                scale = np.float32(1.0 / count)
                a0 *= scale
                a1 *= scale
                a2 *= scale
                a3 *= scale
            out[i, j, 0] = a0
            out[i, j, 1] = a1
            out[i, j, 2] = a2
            out[i, j, 3] = a3


def resample_color(source: Array, lens_map: "LensMap") -> Array:
    """Resample a source window (h, w, 4) float32 to (H, W, 4); NaN where it has no source."""
    height, width = lens_map.target_cos.shape
    if source.shape[:2] != lens_map.source_cos.shape:
        raise UserError(
            f"the source window has {source.shape[1]} × {source.shape[0]} pixels and the lens map "
            f"expects {lens_map.source_cos.shape[1]} × {lens_map.source_cos.shape[0]}"
        )
    name = lens_map.settings["filter"]
    if name == ST_WARP:
        return _st_warp(source, lens_map)
    out = np.empty((height, width, 4), np.float32)
    _interpolate(
        source,
        lens_map.source_cos,
        lens_map.samples,
        lens_map.flags,
        _TAPS[name],
        lens_map.settings["samples"],
        (lens_map.wraps, *lens_map.poles),
        out,
    )
    return out


def _st_warp(source: Array, lens_map: "LensMap") -> Array:
    """Resample with OpenImageIO's st_warp and its Catmull-Rom filter."""
    height, width = lens_map.target_cos.shape
    valid = np.isfinite(source).all(axis=-1) & ~np.isnan(lens_map.source_cos)
    # A fifth channel counts the weights that fell on valid pixels.
    channels = np.dstack([np.where(valid[..., None], source, 0), valid]).astype(np.float32)
    scale = np.array([source.shape[1], source.shape[0]], np.float32)
    st = np.where((lens_map.flags == 0)[..., None], -1, lens_map.samples / scale)
    result = oiio.ImageBufAlgo.st_warp(
        _image_buffer(channels), _image_buffer(st.astype(np.float32)), "catmull-rom", nthreads=1
    )
    if result.has_error:
        raise UserError(f"filter: st_warp failed: {result.geterror()}")
    warped = np.asarray(result.get_pixels(oiio.FLOAT))
    samples = lens_map.settings["samples"]
    blocks = warped.reshape(height, samples, width, samples, 5).mean(axis=(1, 3))
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
def _bent(a: float, b: float, c: float, d: float, tolerance: np.float32) -> bool:
    """Whether four neighbours are not of one smooth surface: true for NaN, too."""
    largest = max(max(abs(a), abs(b)), max(abs(c), abs(d)))
    smallest = min(min(a, b), min(c, d))
    return not (abs(d - a + 3 * (b - c)) <= tolerance * largest and smallest > 0)


@kernel
def _pick(
    inverse: Array,
    centers: Array,
    cos: Array,
    as_z: bool,
    tolerance: np.float32,
    wraps: bool,
    out: Array,
) -> None:
    height, width = inverse.shape
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            px = centers[i, j, 0]
            if px != px:
                out[i, j] = np.nan
                continue
            py = centers[i, j, 1]
            row = min(int(py), height - 1)
            column = min(int(px), width - 1)
            w = inverse[row, column]
            x = px - np.float32(0.5)
            y = py - np.float32(0.5)
            c = int(np.floor(x))
            r = int(np.floor(y))
            if 1 <= r < height - 2 and ((1 <= c < width - 2) or wraps):
                if 1 <= c < width - 2:
                    c0, c1, c2, c3 = c - 1, c, c + 1, c + 2
                else:
                    c0, c1 = (c - 1) % width, c % width
                    c2, c3 = (c + 1) % width, (c + 2) % width
                a = inverse[r, c1]
                b = inverse[r, c2]
                d = inverse[r + 1, c1]
                e = inverse[r + 1, c2]
                if not (
                    _bent(inverse[r, c0], a, b, inverse[r, c3], tolerance)
                    or _bent(inverse[r + 1, c0], d, e, inverse[r + 1, c3], tolerance)
                    or _bent(inverse[r - 1, c1], a, d, inverse[r + 2, c1], tolerance)
                    or _bent(inverse[r - 1, c2], b, e, inverse[r + 2, c2], tolerance)
                ):
                    fx = x - np.float32(c)
                    fy = y - np.float32(r)
                    upper = a + fx * (b - a)
                    lower = d + fx * (e - d)
                    w = upper + fy * (lower - upper)
            if w == 0:
                out[i, j] = np.inf
            else:
                out[i, j] = (cos[i, j] if as_z else np.float32(1)) / w


def resample_depth(
    depth: Array, source_is_z: bool, target_is_z: bool, lens_map: "LensMap"
) -> Array:
    """Resample a depth window (h, w), half or float, at the target pixels' centres.

    ``source_is_z`` and ``target_is_z`` say which of Z-depth and distance the two images hold. On a
    smooth surface 1 / distance is interpolated bilinearly, which is exact for a plane up to the
    second order of the pixel's angle and never leaves the range of the four pixels; elsewhere the
    pixel that the ray falls in is taken, so no depth lies between two surfaces. Returns (H, W)
    float32; a miss (inf) stays inf, NaN marks a pixel without a source.
    """
    inverse = np.empty(depth.shape, np.float32)
    if depth.dtype == np.float16:
        bits = np.ascontiguousarray(depth).view(np.uint16)
        _inverse_distance_half(bits, lens_map.source_cos, source_is_z, inverse)
    else:
        _inverse_distance(depth, lens_map.source_cos, source_is_z, inverse)
    out = np.empty(lens_map.target_cos.shape, np.float32)
    _pick(
        inverse,
        lens_map.centers,
        lens_map.target_cos,
        target_is_z,
        _SMOOTH[depth.dtype],
        lens_map.wraps,
        out,
    )
    return out
