"""Images' channels as halves or floats, and the pixels that kernels work on."""

from typing import Any

import numpy as np

from lightfield.core.compiled import kernel
from lightfield.geometry.lenses import Array
from lightfield.imaging.images import HALF_MAX

# isort: split
# After `compiled`, which keeps from numba what could change a kernel, and what it need not import.
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic


def widen(red: Array, green: Array, blue: Array, alpha: Array | None = None) -> Array:
    """Return (h, w) half or float channels as (h, w, 4) float32. The default alpha is 0."""
    out = np.empty((*red.shape, 4), np.float32)
    for index, channel in enumerate((red, green, blue, 0 if alpha is None else alpha)):
        out[:, :, index] = channel
    return out


def narrow(pixels: Array, out: Array) -> None:
    """Write the first n channels of (h, w, 4) float32 pixels into ``out``, (n, h, w) half."""
    _narrow(pixels, out.view(np.uint16))


def to_half(values: Array) -> Array:
    """Return (h, w) float32 values as half. Values beyond its range become infinite."""
    out = np.empty(values.shape, np.float16)
    _to_half(values, out.view(np.uint16))
    return out


@intrinsic  # type: ignore[untyped-decorator]
def _float_to_half(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        half = builder.fptrunc(arguments[0], ir.HalfType())
        return builder.bitcast(half, ir.IntType(16))

    return types.uint16(types.float32), generate


@kernel  # ten times as fast as numpy
def _to_half(values: Array, out: Array) -> None:
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[i, j] = _float_to_half(values[i, j])


@kernel  # four times as fast as numpy
def _narrow(values: Array, out: Array) -> None:
    for i in range(values.shape[0]):
        for c in range(out.shape[0]):
            for j in range(values.shape[1]):
                # A filter may overshoot the half range. Clamp, so that no value becomes infinite.
                value = min(max(values[i, j, c], -np.float32(HALF_MAX)), np.float32(HALF_MAX))
                out[c, i, j] = _float_to_half(value)
