"""Converts scene-linear light to 8-bit and 16-bit pixels, and back: exposure, Reinhard, sRGB."""

import functools

import numpy as np
import numpy.typing as npt

from lightfield.core.compiled import kernel
from lightfield.geometry.lenses import Array


def tone_map(color: Array, exposure: float, reinhard: float) -> Array:
    """Return linear ``color`` brightened by ``exposure`` stops, then compressed by Reinhard.

    v ↦ v (1 + v / m²) / (1 + v) with m = ``reinhard``, from 1e-9 to 1e9. The value m becomes 1, and
    m = 1 changes nothing. With any other m, values below 0, which are colours outside Rec. 709,
    become 0. NaN stays NaN. Source: Reinhard et al. 2002, equation 4, applied to each channel as in
    SILVR's tool.
    """
    if exposure == 0 and reinhard == 1:
        return color
    out = np.empty(color.shape, np.float32)
    _tone_map(
        color.reshape(-1), np.float32(2.0**exposure), np.float32(1.0 / reinhard**2), out.reshape(-1)
    )
    return out


@kernel
def _tone_map(values: Array, gain: np.float32, inverse_square: np.float32, out: Array) -> None:
    one = np.float32(1)
    zero = np.float32(0)
    huge = np.float32(1e18)
    for i in range(values.size):
        v = values[i] * gain
        if v < 0:
            # The curve has a pole at −1, unless it is a line.
            out[i] = v if inverse_square == one else zero
        elif v > huge:
            # v / (1 + v) is 1 here, and v² may be infinite.
            out[i] = one + v * inverse_square
        else:
            out[i] = v * (one + v * inverse_square) / (one + v)


def encode_srgb(linear: npt.ArrayLike) -> Array:
    """Return the sRGB encoding in [0, 1] of linear values, which are clipped to [0, 1].

    Source: IEC 61966-2-1.
    """
    v = np.clip(linear, 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def decode_srgb(encoded: npt.ArrayLike) -> Array:
    """Return the linear values of sRGB-encoded values in [0, 1]: the inverse of `encode_srgb`."""
    v = np.asarray(encoded, np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


@functools.cache
def _thresholds() -> Array:
    """The 255 linear values at which the rounded 8-bit code goes up by one, float32."""
    return decode_srgb((np.arange(255) + 0.5) / 255).astype(np.float32)


@functools.cache
def _first_guess() -> Array:
    """The code at each of 4096 equal steps of the square root of the linear value."""
    steps = (np.arange(4097) / 4096) ** 2
    return np.searchsorted(_thresholds(), steps, side="right").astype(np.uint8)


def to_8_bit(color: Array) -> Array:
    """Return linear (..., C) float32 colour as sRGB uint8, rounded to nearest. NaN becomes 0."""
    out = np.empty(color.shape, np.uint8)
    _encode(np.ascontiguousarray(color).reshape(-1), _thresholds(), _first_guess(), out.reshape(-1))
    return out


def to_16_bit(color: Array) -> Array:
    """Return linear (..., C) float32 colour as sRGB uint16, rounded to nearest. NaN becomes 0."""
    encoded = encode_srgb(np.nan_to_num(color.astype(np.float64)))
    return np.asarray(np.rint(encoded * 65535), np.uint16)


@kernel
def _encode(values: Array, thresholds: Array, guess: Array, out: Array) -> None:
    for i in range(values.size):
        v = values[i]
        if not v > 0:
            out[i] = 0
        elif v >= 1:
            out[i] = 255
        else:
            code = int(guess[int(np.sqrt(v) * np.float32(4096))])
            while code < 255 and thresholds[code] <= v:
                code += 1
            while code > 0 and thresholds[code - 1] > v:
                code -= 1
            out[i] = code
