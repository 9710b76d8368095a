"""Develops scene-linear light as a camera's sensor and processing would, and turns it back.

The steps, in their order:

1. exposure and vignetting, as PPISP has them;
2. noise (Foi et al. 2008) of the raw signal, which is clipped to [0, 1];
3. colour and response, as PPISP has them;
4. rounding to codes of some bits.

PPISP is NVIDIA's model of a camera's processing (nv-tlabs/ppisp, ppisp/src/ppisp_math.cuh). Without
noise, steps 1 and 3 are exactly its formula. Channels are red, green, blue. Arrays are float64.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.imaging.look import Look
from lightfield.imaging.tonemap import decode_srgb, encode_srgb

Floats = NDArray[np.float64]

# PPISP's matrices from eight latent numbers of colour to offsets of the chromaticities (r, g) of
# blue, red, green and grey (COLOR_PINV_BLOCKS).
_OFFSETS = np.array(
    [
        [[0.0480542, -0.0043631], [-0.0043631, 0.0481283]],
        [[0.0580570, -0.0179872], [-0.0179872, 0.0431061]],
        [[0.0433336, -0.0180537], [-0.0180537, 0.0580500]],
        [[0.0128369, -0.0034654], [-0.0034654, 0.0128158]],
    ]
)
# These chromaticities without an offset: (r, g, 1).
_CHROMATICITIES = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1 / 3, 1 / 3, 1]], np.float64)
# PPISP adds this to an intensity before it divides by it.
_INTENSITY_FLOOR = 1e-5
# The least values of PPISP's toe, shoulder and gamma.
_LEAST = (0.3, 0.3, 0.1)

# Rows developed at a time. Noise is drawn in this order, so another number changes its pixels.
_ROWS = 64
# A raw signal above this is always clipped to 1.
_BRIGHTEST = 1e6
# A pixel has no weight if this many standard deviations of noise could saturate it.
_SAFE_DEVIATIONS = 4
# The least variance of a pixel's light, so that weights stay finite in float32.
_LEAST_VARIANCE = 1e-24

WHITE = 255
"""The value of a clipping mask where a channel is saturated."""
BLACK = 128
"""The value of a clipping mask where a channel is clipped at 0."""


@dataclass(frozen=True)
class SensorParameters:
    """The parameters of one view's sensor.

    - ``exposure``: in stops.
    - ``vignetting`` (3, 5): of each channel PPISP's centre x, y and alpha of r², r⁴, r⁶. The radius
      is in parts of the image's longer side.
    - ``colour`` (8,): PPISP's latent numbers of blue, red, green and grey. 0 changes nothing.
    - ``response`` (3, 4): of each channel PPISP's toe, shoulder, gamma and center, as the formula
      uses them. None is the sRGB encoding.
    - ``gain``, ``floor``: a and b of the noise's variance a · y + b. The raw signal y is 1 where it
      saturates.
    - ``bits``: the number of bits of a code.
    - ``seed``: the seed of the noise, from 0 to 2⁶⁴ − 1.
    - ``has_look``: whether Blender's look stands in place of the response.
    """

    exposure: float
    vignetting: tuple[tuple[float, ...], ...]
    colour: tuple[float, ...]
    response: tuple[tuple[float, ...], ...] | None
    gain: float
    floor: float
    bits: int
    seed: int
    has_look: bool = False

    @property
    def has_noise(self) -> bool:
        return self.gain > 0 or self.floor > 0

    @property
    def has_colour(self) -> bool:
        return any(self.colour)

    @property
    def largest(self) -> int:
        """The code of white."""
        return int(2**self.bits - 1)

    @property
    def stored_largest(self) -> int:
        """White in a PNG, which has 8 or 16 bits."""
        return 255 if self.bits <= 8 else 65535

    @cached_property
    def homography(self) -> Floats:
        """PPISP's matrix (3, 3) of colour, which acts on (R, G, R + G + B)."""
        return homography(self.colour)

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as a file has them, with the tensors of PPISP's own code."""
        return {
            "exposure": self.exposure,
            "vignetting": [list(channel) for channel in self.vignetting],
            "colour": list(self.colour),
            "response": self.response and [list(channel) for channel in self.response],
            "noise": {"a": self.gain, "b": self.floor, "seed": self.seed},
            "bits": self.bits,
            "ppisp": {
                "exposure_params": self.exposure,
                "vignetting_params": [list(channel) for channel in self.vignetting],
                "color_params": list(self.colour),
                "crf_params": self.response and [_raw(channel) for channel in self.response],
            },
        }

    @classmethod
    def from_json(cls, content: Any) -> "SensorParameters":
        """Return the parameters of a file's content. Raises `UserError` for another content."""
        try:
            response = content["response"]
            return cls(
                exposure=float(content["exposure"]),
                vignetting=tuple(tuple(map(float, channel)) for channel in content["vignetting"]),
                colour=tuple(map(float, content["colour"])),
                response=response and tuple(tuple(map(float, channel)) for channel in response),
                gain=float(content["noise"]["a"]),
                floor=float(content["noise"]["b"]),
                bits=int(content["bits"]),
                seed=int(content["noise"]["seed"]),
                has_look="look" in content,
            )
        except (LookupError, TypeError, ValueError):
            raise UserError("has no parameters of a sensor") from None


def _raw(response: Sequence[float]) -> list[float]:
    """Return toe, shoulder, gamma and center as PPISP's crf_params: before softplus and sigmoid."""
    *powers, center = response
    raw = [math.log(math.expm1(power - least)) for power, least in zip(powers, _LEAST, strict=True)]
    return [*raw, math.log(center / (1 - center))]


@dataclass(frozen=True)
class Sensed:
    """A view as the sensor sees it.

    ``pixels`` (h, w, 3) are the codes, scaled to uint8, or to uint16 for more than 8 bits.
    ``clipped`` (h, w, 3) uint8 is `WHITE` or `BLACK` where a channel is clipped, else 0.
    ``weights`` (h, w, 3) float32 are the weights for `merged`. None if nobody asked for them.
    """

    pixels: NDArray[np.uint8 | np.uint16]
    clipped: NDArray[np.uint8]
    weights: NDArray[np.float32] | None


def sense(
    light: NDArray[Any],
    parameters: SensorParameters,
    with_weights: bool = True,
    look: Look | None = None,
) -> Sensed:
    """Develop scene-linear ``light`` (h, w, 3). NaN counts as 0.

    A ``look`` stands in place of the response. Then there are no weights.
    """
    height, width = light.shape[:2]
    dtype = np.uint8 if parameters.stored_largest == 255 else np.uint16
    pixels: NDArray[np.uint8 | np.uint16] = np.empty((height, width, 3), dtype)
    clipped = np.empty((height, width, 3), np.uint8)
    weights = np.empty((height, width, 3), np.float32) if with_weights else None
    random = np.random.Generator(np.random.Philox(key=parameters.seed))
    for rows in _strips(height):
        falloff = vignetting(parameters, width, height, rows)
        strip = np.nan_to_num(light[rows].astype(np.float64), posinf=_BRIGHTEST).clip(0)
        clean = np.minimum(strip * 2.0**parameters.exposure * falloff, _BRIGHTEST)
        raw = noisy(clean, parameters, random)
        colour = _recolour(raw, parameters)
        shown = look.developed(colour.clip(0, 1)) if look else _respond(colour, parameters)
        codes = np.rint(shown * parameters.largest)
        scale = parameters.stored_largest / parameters.largest
        pixels[rows] = np.rint(codes * scale).astype(dtype)
        is_white = (codes == parameters.largest) | (raw >= 1)
        clipped[rows] = np.where(is_white, WHITE, np.where(codes == 0, BLACK, 0))
        if weights is not None:
            weights[rows] = _weights(clean, falloff, parameters)
    return Sensed(pixels, clipped, weights)


def _strips(height: int) -> Iterator[slice]:
    for first in range(0, height, _ROWS):
        yield slice(first, min(first + _ROWS, height))


def vignetting(parameters: SensorParameters, width: int, height: int, rows: slice) -> Floats:
    """Return the part of the light (rows, width, 3) that vignetting leaves in some rows."""
    longer = max(width, height)
    x = (np.arange(width) + 0.5 - width / 2) / longer
    y = (np.arange(rows.start, rows.stop) + 0.5 - height / 2) / longer
    falloffs = []
    for center_x, center_y, *alphas in parameters.vignetting:
        square = (x - center_x) ** 2 + ((y - center_y) ** 2)[:, None]
        falloff = np.ones_like(square)
        for power, alpha in enumerate(alphas, start=1):
            falloff += alpha * square**power
        falloffs.append(falloff.clip(0, 1))
    return np.stack(falloffs, axis=-1)


def noisy(clean: Floats, parameters: SensorParameters, random: np.random.Generator) -> Floats:
    """Return the raw signal with noise, clipped to [0, 1]. Without noise, return ``clean``.

    The noise is Poissonian and Gaussian, so that its variance is a · y + b before clipping.
    Source: Foi et al., Practical Poissonian-Gaussian noise modeling and fitting for single-image
    raw-data, IEEE Transactions on Image Processing 17 (2008), equations 1 to 4 and 30.
    """
    if not parameters.has_noise:
        return clean
    raw = clean.copy()
    if parameters.gain > 0:
        raw[:] = parameters.gain * random.poisson(clean / parameters.gain)
    if parameters.floor > 0:
        raw += math.sqrt(parameters.floor) * random.standard_normal(clean.shape)
    return np.clip(raw, 0, 1)


def homography(colour: Sequence[float]) -> Floats:
    """Return PPISP's matrix of colour: it moves four chromaticities to their offset places.

    Source: compute_homography in ppisp_math.cuh.
    """
    latent = np.array(colour, np.float64).reshape(4, 2)
    targets = _CHROMATICITIES.copy()
    targets[:, :2] += np.einsum("nij,nj->ni", _OFFSETS, latent)
    corners = targets[:3].T
    # Grey is a mix of the three corners. Its parts scale them.
    parts = np.linalg.solve(corners, targets[3])
    from_chromaticities = np.linalg.inv(_CHROMATICITIES[:3].T)
    matrix = corners @ np.diag(parts) @ from_chromaticities
    return np.asarray(matrix / matrix[2, 2])


def _recolour(raw: Floats, parameters: SensorParameters) -> Floats:
    """Apply PPISP's colour to a raw signal (…, 3), and keep its intensity R + G + B."""
    intensity = raw.sum(axis=-1)
    moved = _with_intensity(raw, intensity) @ parameters.homography.T
    moved *= (intensity / (moved[..., 2] + _INTENSITY_FLOOR))[..., None]
    return _without_intensity(moved)


def _colour_undone(colour: Floats, parameters: SensorParameters) -> Floats:
    """Return the raw signal that `_recolour` turns into ``colour``."""
    moved = _with_intensity(colour, colour.sum(axis=-1))
    back = moved @ np.linalg.inv(parameters.homography).T
    # `_recolour` divides by the moved intensity plus a small number. Solve for the factor.
    third = np.maximum(moved[..., 2], 0)
    scaled = np.maximum(back[..., 2], 0)
    root = np.sqrt(third**2 + 4 * _INTENSITY_FLOOR * scaled)
    factor = np.divide(2 * scaled, third + root, out=np.ones_like(root), where=root > 0)
    return _without_intensity(back / np.where(factor > 0, factor, 1)[..., None])


def _with_intensity(colour: Floats, intensity: Floats) -> Floats:
    return np.stack([colour[..., 0], colour[..., 1], intensity], axis=-1)


def _without_intensity(moved: Floats) -> Floats:
    blue = moved[..., 2] - moved[..., 0] - moved[..., 1]
    return np.stack([moved[..., 0], moved[..., 1], blue], axis=-1)


def _respond(colour: Floats, parameters: SensorParameters) -> Floats:
    """Return the response (…, 3) to linear colour, which is clipped to [0, 1].

    Source: apply_crf_ppisp in ppisp_math.cuh.
    """
    if parameters.response is None:
        return np.asarray(encode_srgb(colour), np.float64)
    out = np.empty_like(colour)
    for channel, (toe, shoulder, gamma, center) in enumerate(parameters.response):
        middle = _middle(toe, shoulder, center)
        value = colour[..., channel].clip(0, 1)
        low = middle * (np.minimum(value, center) / center) ** toe
        high = 1 - (1 - middle) * ((1 - np.maximum(value, center)) / (1 - center)) ** shoulder
        out[..., channel] = np.where(value <= center, low, high).clip(0) ** gamma
    return out


def _response_undone(encoded: Floats, parameters: SensorParameters) -> Floats:
    """Return the linear colour (…, 3) to which `_respond` gives ``encoded``, 0 to 1."""
    if parameters.response is None:
        return decode_srgb(encoded)
    out = np.empty_like(encoded)
    for channel, (toe, shoulder, gamma, center) in enumerate(parameters.response):
        middle = _middle(toe, shoulder, center)
        value = encoded[..., channel].clip(0, 1) ** (1 / gamma)
        low = center * (np.minimum(value, middle) / middle) ** (1 / toe)
        rest = (1 - np.maximum(value, middle)) / (1 - middle)
        high = 1 - (1 - center) * rest ** (1 / shoulder)
        out[..., channel] = np.where(value <= middle, low, high)
    return out


def _middle(toe: float, shoulder: float, center: float) -> float:
    """Return the response to ``center`` before gamma. There toe and shoulder have equal slopes."""
    return shoulder * center / (toe + center * (shoulder - toe))


def _weights(clean: Floats, falloff: Floats, parameters: SensorParameters) -> Floats:
    """Return 1 / variance of the light that a code gives. 0 where noise could saturate it.

    The variance comes from noise and rounding. It follows from the signal without noise, so that
    weights are independent of the noise that they average. It leaves out that colour mixes the
    channels' variances.
    """
    variance = parameters.gain * clean + parameters.floor
    margin = _SAFE_DEVIATIONS * np.sqrt(variance)
    colour = _recolour(clean, parameters)
    encoded = _respond(colour, parameters)
    half_code = 0.5 / parameters.largest
    width = _response_undone(np.minimum(encoded + half_code, 1), parameters)
    width -= _response_undone(np.maximum(encoded - half_code, 0), parameters)
    saturates = (clean + margin >= 1) | (colour + margin >= 1) | (encoded >= 1 - half_code)
    if parameters.has_colour:
        # Colour mixes the channels, so one that is clipped spoils the others.
        saturates = np.broadcast_to(saturates.any(axis=-1, keepdims=True), saturates.shape)
    gain = 2.0**parameters.exposure * falloff
    light_variance = np.divide(
        variance + width**2 / 12, gain**2, out=np.full_like(gain, np.inf), where=gain > 0
    )
    weights: Floats = 1 / np.maximum(light_variance, _LEAST_VARIANCE)
    weights[saturates] = 0
    return weights


def light_of(pixels: NDArray[Any], parameters: SensorParameters) -> Floats:
    """Return the scene-linear light (h, w, 3) that a sensor's ``pixels`` (h, w, 3) show.

    It differs from the light that was developed by noise, by rounding, and where it was clipped.
    Light is NaN where vignetting leaves none. Raises `UserError` after a look.
    """
    if parameters.has_look:
        raise UserError("look: cannot be turned back into light")
    height, width = pixels.shape[:2]
    encoded = pixels / parameters.stored_largest
    raw = _colour_undone(_response_undone(encoded, parameters), parameters)
    gain = 2.0**parameters.exposure * vignetting(parameters, width, height, slice(0, height))
    light: Floats = np.divide(raw, gain, out=np.full_like(raw, np.nan), where=gain > 0)
    return light


def merged(lights: Sequence[Floats], weights: Sequence[NDArray[Any]]) -> Floats:
    """Return the mean of the brackets' light (h, w, 3), weighted. NaN where no bracket has weight.

    ``lights`` are results of `light_of`.
    """
    total = np.zeros_like(lights[0])
    sum_of_weights = np.zeros_like(lights[0])
    for light, weight in zip(lights, weights, strict=True):
        exact_weight = weight.astype(np.float64)
        total += np.where(exact_weight > 0, exact_weight * light, 0)
        sum_of_weights += exact_weight
    empty = np.full_like(total, np.nan)
    return np.divide(total, sum_of_weights, out=empty, where=sum_of_weights > 0)
