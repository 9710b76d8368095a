"""The loops that resample colour: weights, samples that need care, and whole strips of pixels.

Sources are (h, w, 4) float32. A pixel that is not finite is left out, and the other weights are
scaled up. If no pixel remains, the result is NaN. ``valid`` (h, w) is NaN where the source has no
ray. ``coordinates`` (H, W, 2) are the (x, y) of each sample in the source. ``flags`` (H, W) are
`NOTHING`, `INSIDE` or `CAREFUL`. ``topology`` is a lens map's topology.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lightfield.core.compiled import inline, kernel, part
from lightfield.geometry.lenses import Array

# isort: split
# After `compiled`, which keeps from numba what could change a kernel, and what it need not import.
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

# The flags of samples.
NOTHING = 0  # The source does not see the ray.
INSIDE = 1  # Every source pixel that the filter reads exists.
CAREFUL = 2  # Some may be missing: at the image's edge, seam or pole, or the image circle's rim.

Weights = Callable[[Any], tuple[Any, ...]]
Topology = tuple[bool, bool, bool]


class _Pixel(types.Type):  # type: ignore[misc]
    """The type of a pixel's four channels in one register, with which kernels compute at once.

    Compilers see only sometimes that they could do so.
    """

    def __init__(self, channel: Any) -> None:
        super().__init__(f"pixel of {channel}")
        self.channel = channel


@register_model(_Pixel)
class _PixelModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _vector(kind))


# As in `compiled`.
_FLAGS = ("contract", "nsz")


def _vector(kind: Any) -> Any:
    channel = ir.FloatType() if kind.channel == types.float32 else ir.DoubleType()
    return ir.VectorType(channel, 4)


def _spread(builder: Any, value: Any) -> Any:
    """Return a register with one value in all four channels."""
    pixel = ir.Constant(ir.VectorType(value.type, 4), ir.Undefined)
    for channel in range(4):
        pixel = builder.insert_element(pixel, value, ir.IntType(32)(channel))
    return pixel


def _place(context: Any, builder: Any, kinds: Any, array: Any, index: Any) -> Any:
    """Return the pointer to the pixel at an index of a contiguous array (..., 4) float32."""
    kind, index_kinds = kinds[:2]
    indices = [
        context.cast(builder, value, index_kind, types.intp)
        for value, index_kind in zip(cgutils.unpack_tuple(builder, index), index_kinds, strict=True)
    ]
    indices.append(context.get_constant(types.intp, 0))
    content = context.make_array(kind)(context, builder, array)
    place = cgutils.get_item_pointer(context, builder, kind, content, indices)
    return builder.bitcast(place, _vector(_Pixel(types.float32)).as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def _load(typing: Any, array: Any, index: Any) -> Any:
    """Return the pixel at an ``index`` of a contiguous array (..., 4) float32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature.args, *arguments), align=4)

    return _Pixel(types.float32)(array, index), generate


@intrinsic  # type: ignore[untyped-decorator]
def _store(typing: Any, array: Any, index: Any, pixel: Any) -> Any:
    """Write a pixel to an ``index`` of a contiguous array (..., 4) float32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature.args, *arguments[:2])
        value = arguments[2]
        if pixel.channel == types.float64:
            value = builder.fptrunc(value, place.type.pointee)
        builder.store(value, place, align=4)
        return context.get_dummy_value()

    return types.void(array, index, pixel), generate


@intrinsic  # type: ignore[untyped-decorator]
def _filled(typing: Any, value: Any) -> Any:
    """Return a pixel with one value in all four channels."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _spread(builder, arguments[0])

    return _Pixel(value)(value), generate


@intrinsic  # type: ignore[untyped-decorator]
def _scaled(typing: Any, weight: Any, pixel: Any) -> Any:
    """Return a pixel times a ``weight``, in the weight's precision."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors = _spread(builder, arguments[0])
        value = arguments[1]
        if value.type != factors.type:
            value = builder.fpext(value, factors.type)
        return builder.fmul(factors, value, flags=_FLAGS)

    return _Pixel(weight)(weight, pixel), generate


@intrinsic  # type: ignore[untyped-decorator]
def _sum(typing: Any, first: Any, second: Any) -> Any:
    """Return the sum of two pixels."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fadd(*arguments, flags=_FLAGS)

    return first(first, second), generate


@intrinsic  # type: ignore[untyped-decorator]
def _channels(typing: Any, pixel: Any) -> Any:
    """Return a pixel's four channels as numbers."""
    numbers = types.UniTuple(pixel.channel, 4)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        indices = map(ir.IntType(32), range(4))
        channels = [builder.extract_element(arguments[0], index) for index in indices]
        return context.make_tuple(builder, numbers, channels)

    return numbers(pixel), generate


@part
def linear_weights(t: Any) -> tuple[Any, ...]:
    """Return the weights of the two pixels around a point at ``t`` in [0, 1) past the left one."""
    return np.float32(1) - t, t


@part
def cubic_weights(t: Any) -> tuple[Any, ...]:
    """Return the weights of four pixels, for a point at ``t`` in [0, 1) past the second.

    Source: Catmull and Rom 1974; the cubic convolution of third order of Keys 1981 (a = −1/2).
    """
    half = np.float32(0.5)
    one = np.float32(1)
    return (
        t * (t * (one - half * t) - half),
        one + t * t * (np.float32(1.5) * t - np.float32(2.5)),
        t * (half + t * (np.float32(2) - np.float32(1.5) * t)),
        t * t * (half * t - half),
    )


@part
def lanczos_weights(t: Any) -> tuple[Any, ...]:
    """Return the weights of six pixels, for a point at ``t`` in [0, 1) past the third.

    sinc(u) sinc(u / 3) (Turkowski 1990), scaled to sum to one.
    """
    zero = np.float32(0)
    half = np.float32(0.5)
    one = np.float32(1)
    if t < np.float32(1e-5):
        return zero, zero, one, zero, zero, zero
    # sin(π u / 3) at u = t + 2, t + 1, …, t − 3, by the addition theorem.
    third = np.float32(np.pi / 3) * t
    a = half * np.sin(third)
    b = np.float32(math.sqrt(0.75)) * np.cos(third)
    w0 = (b - a) / ((t + 2) * (t + 2))
    w1 = -(b + a) / ((t + 1) * (t + 1))
    w2 = 2 * a / (t * t)
    w3 = (b - a) / ((t - 1) * (t - 1))
    w4 = -(b + a) / ((t - 2) * (t - 2))
    w5 = 2 * a / ((t - 3) * (t - 3))
    # |sin(π u)| is equal for all. The weights have its sign, and scaling cancels its size.
    scale = one / (w0 + w1 + w2 + w3 + w4 + w5)
    return w0 * scale, w1 * scale, w2 * scale, w3 * scale, w4 * scale, w5 * scale


@kernel
def source_index(
    row: int, column: int, height: int, width: int, topology: Topology
) -> tuple[int, int]:
    """Return the pixel that continues the image at (row, column). The row is −1 if none does."""
    wraps, top, bottom = topology
    if wraps:
        # The same row continues beyond a pole, half a turn away.
        if row < 0 and top:
            row = -1 - row
            column = column + width // 2
        elif row >= height and bottom:
            row = 2 * height - 1 - row
            column = column + width // 2
        column %= width
    if row < 0 or row >= height or column < 0 or column >= width:
        return -1, 0
    return row, column


@inline
def _sample(source: Array, row: int, column: int, wy: Any, wx: Any) -> Any:
    """Return the weighted sum of the pixels from (row, column) on, all of which exist."""
    total = _scaled(wy[0], _sample_of_row(source, row, column, wx))
    for a in range(1, len(wy)):
        total = _sum(total, _scaled(wy[a], _sample_of_row(source, row + a, column, wx)))
    return total


@inline
def _sample_of_row(source: Array, row: int, column: int, wx: Any) -> Any:
    total = _scaled(wx[0], _load(source, (row, column)))
    for b in range(1, len(wx)):
        total = _sum(total, _scaled(wx[b], _load(source, (row, column + b))))
    return total


@inline
def _finite_and_not_negative(pixel: Any) -> bool:
    s0, s1, s2, s3 = _channels(pixel)
    return bool(s0 + s1 + s2 + s3 < np.inf and min(min(s0, s1), min(s2, s3)) >= 0)


@kernel
def _sum_of_present(
    source: Array,
    valid: Array,
    row: int,
    column: int,
    wy: Any,
    wx: Any,
    topology: Topology,
    result: Array,
) -> tuple[Any, bool]:
    """Sum the existing pixels from (row, column) on. Return their weight, and whether all exist.

    Fills ``result`` (2, 4) with the sum, and with the minimum of the pixels and zero.
    """
    height, width = source.shape[0], source.shape[1]
    complete = True
    total = np.float32(0)
    result[:] = 0
    for a in range(len(wy)):
        for b in range(len(wx)):
            i, j = source_index(row + a, column + b, height, width, topology)
            if i >= 0 and valid[i, j] == valid[i, j] and np.isfinite(np.sum(source[i, j])):
                weight = wy[a] * wx[b]
                total += weight
                for c in range(4):
                    result[0, c] += weight * source[i, j, c]
                    result[1, c] = min(result[1, c], source[i, j, c])
            else:
                complete = False
    return total, complete


@kernel
def _careful(
    source: Array,
    valid: Array,
    row: int,
    column: int,
    fy: Any,
    fx: Any,
    wy: Any,
    wx: Any,
    topology: Topology,
    result: Array,
) -> bool:
    """Sample where pixels may be missing or negative. Return whether any pixel exists.

    The sample lies (``fy``, ``fx``) past pixel (``row``, ``column``). A kernel with negative lobes
    needs all its pixels. If one is missing, the result is bilinear among the existing ones of the
    four nearest. Such lobes must not make light negative either. So a value below zero is raised
    to the darkest pixel.
    """
    reach = len(wx) // 2 - 1
    total, complete = _sum_of_present(
        source, valid, row - reach, column - reach, wy, wx, topology, result
    )
    if not complete:
        ly, lx = linear_weights(fy), linear_weights(fx)
        total, _ = _sum_of_present(source, valid, row, column, ly, lx, topology, result)
    # All existing pixels may have a weight of zero, if the sample lies on a missing pixel.
    if total < np.float32(1e-4):
        return False
    for c in range(4):
        result[0, c] = max(result[0, c] / total, result[1, c])
    return True


@kernel
def nearest(
    source: Array, valid: Array, coordinates: Array, flags: Array, topology: Topology, out: Array
) -> None:
    """Take the pixel that each sample falls in."""
    height, width = source.shape[0], source.shape[1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = np.nan
            if flags[i, j] != NOTHING:
                row = min(int(coordinates[i, j, 1]), height - 1)
                column = min(int(coordinates[i, j, 0]), width - 1)
                p = source[row, column]
                # In float64, because the sum of a Cryptomatte's hashes may exceed float32.
                total = np.float64(p[0]) + p[1] + p[2] + p[3]
                if valid[row, column] == valid[row, column] and np.isfinite(total):
                    out[i, j] = p


def interpolating(weights: Weights) -> Callable[..., None]:
    """Make the kernel that interpolates at every sample."""

    def interpolate(
        source: Array,
        valid: Array,
        coordinates: Array,
        flags: Array,
        topology: Topology,
        out: Array,
    ) -> None:
        half = np.float32(0.5)
        result = np.empty((2, 4), np.float32)
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                flag = flags[i, j]
                if flag == NOTHING:
                    out[i, j] = np.nan
                    continue
                x, y = coordinates[i, j, 0] - half, coordinates[i, j, 1] - half
                fx, fy = x - np.floor(x), y - np.floor(y)
                row, column = int(np.floor(y)), int(np.floor(x))
                wx, wy = weights(fx), weights(fy)
                if flag == INSIDE:
                    reach = len(wx) // 2 - 1
                    pixel = _sample(source, row - reach, column - reach, wy, wx)
                    if _finite_and_not_negative(pixel):
                        _store(out, (i, j), pixel)
                        continue
                if _careful(source, valid, row, column, fy, fx, wy, wx, topology, result):
                    out[i, j] = result[0]
                else:
                    out[i, j] = np.nan

    return kernel(interpolate)


def covering(weights: Weights) -> Callable[..., None]:
    """Make the kernel that averages interpolated samples over each pixel's footprint."""

    def cover(
        source: Array,
        valid: Array,
        centers: Array,
        footprints: Array,
        counts: Array,
        flags: Array,
        topology: Topology,
        out: Array,
    ) -> None:
        half = np.float32(0.5)
        result = np.empty((2, 4), np.float32)
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] = np.nan
                flag = flags[i, j]
                if flag == NOTHING:
                    continue
                across, down = counts[i, j, 0], counts[i, j, 1]
                x, y = centers[i, j, 0], centers[i, j, 1]
                ux, uy = footprints[i, j, 0, 0], footprints[i, j, 1, 0]
                vx, vy = footprints[i, j, 0, 1], footprints[i, j, 1, 1]
                total = _filled(np.float32(0))
                sample_count = 0
                for q in range(down):
                    v = np.float32(q) - half * np.float32(down - 1)
                    for p in range(across):
                        u = np.float32(p) - half * np.float32(across - 1)
                        px = x + u * ux + v * vx - half
                        py = y + u * uy + v * vy - half
                        fx, fy = px - np.floor(px), py - np.floor(py)
                        row, column = int(np.floor(py)), int(np.floor(px))
                        wx, wy = weights(fx), weights(fy)
                        pixel = _filled(np.float32(np.nan))
                        if flag == INSIDE:
                            reach = len(wx) // 2 - 1
                            pixel = _sample(source, row - reach, column - reach, wy, wx)
                        if not _finite_and_not_negative(pixel):
                            if not _careful(
                                source, valid, row, column, fy, fx, wy, wx, topology, result
                            ):
                                continue
                            pixel = _load(result, (0,))
                        sample_count += 1
                        total = _sum(total, pixel)
                if sample_count:
                    scale = np.float32(1) / np.float32(sample_count)
                    _store(out, (i, j), _scaled(scale, total))

    return kernel(cover)


@kernel
def block_mean(fine: Array, samples: int, out: Array) -> None:
    """Average blocks of ``samples`` × ``samples`` pixels, without pixels that are NaN."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            a0 = a1 = a2 = a3 = np.float32(0)
            sample_count = 0
            for p in range(i * samples, (i + 1) * samples):
                for q in range(j * samples, (j + 1) * samples):
                    if fine[p, q, 0] == fine[p, q, 0]:
                        sample_count += 1
                        a0 += fine[p, q, 0]
                        a1 += fine[p, q, 1]
                        a2 += fine[p, q, 2]
                        a3 += fine[p, q, 3]
            scale = np.float32(1) / np.float32(sample_count) if sample_count else np.float32(np.nan)
            out[i, j, 0] = a0 * scale
            out[i, j, 1] = a1 * scale
            out[i, j, 2] = a2 * scale
            out[i, j, 3] = a3 * scale


@kernel
def continue_faces(source: Array, strip: Array, out: Array) -> None:
    """Give each face of a cube map a border: bicubic samples of the faces around it."""
    size, side = source.shape[0], strip.shape[0]
    border = (side - size) // 2
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            row = i - border
            column = j % side - border
            if 0 <= row < size and 0 <= column < size:
                out[i, j] = source[row, j // side * size + column]
                continue
            x = strip[i, j, 0] - np.float32(0.5)
            y = strip[i, j, 1] - np.float32(0.5)
            column, row = int(np.floor(x)), int(np.floor(y))
            wx = cubic_weights(x - np.float32(column))
            wy = cubic_weights(y - np.float32(row))
            first = int(strip[i, j, 0]) // size * size
            for c in range(4):
                total = darkest = np.float32(0)
                for a in range(4):
                    for b in range(4):
                        p = min(max(row + a - 1, 0), size - 1)
                        q = min(max(column + b - 1, first), first + size - 1)
                        total += wy[a] * wx[b] * source[p, q, c]
                        darkest = min(darkest, source[p, q, c])
                # NaN marks a missing pixel. This comparison keeps it.
                out[i, j, c] = darkest if total < darkest else total
