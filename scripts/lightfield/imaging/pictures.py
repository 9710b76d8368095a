"""Makes pictures of views for people: exposed, tone-mapped, in sRGB."""

from typing import Any

import numpy as np
from PIL import Image

from lightfield.imaging.look import Look
from lightfield.imaging.tonemap import to_8_bit, tone_map

Array = np.ndarray[Any, Any]

# The scene-linear grey that the eye sees as the middle between black and white.
MIDDLE_GREY = 0.18
# The brightest value that still shows as less than white, in multiples of middle grey's exposure.
WHITE = 5.0
# If there are more views, thin them evenly, so that people can still recognise each.
MOST_VIEWS = 120


def luminance(colour: Array) -> Array:
    """Return the luminance (...) of linear (..., 3) float32 colour. Source: ITU-R BT.709."""
    weights = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
    return np.asarray(colour @ weights)


def exposure_for(colour: Array, look: Look | None = None) -> float:
    """Return the exposure in stops that puts the typical pixel of (..., 3) at middle grey.

    A ``look`` has its own exposure, so it needs none. Typical is the geometric mean of the
    luminance (Reinhard et al. 2002, equation 1) over pixels that are not black. So pixels outside
    an image circle do not count.
    """
    if look:
        return 0.0
    light = luminance(colour)
    lit = light[np.isfinite(light) & (light > 1e-6)]
    return float(np.log2(MIDDLE_GREY / np.exp(np.log(lit).mean()))) if lit.size else 0.0


def develop(colour: Array, exposure: float, look: Look | None = None) -> Array:
    """Turn scene-linear (height, width, 3) colour into 8-bit sRGB pixels, by a ``look`` if any."""
    if look:
        return look.to_pixels(colour * np.float32(2.0**exposure), 8)
    return to_8_bit(tone_map(np.ascontiguousarray(colour), exposure, WHITE))


def thumbnail(
    image: Array, side: int, exposure: float | None = None, look: Look | None = None
) -> Array:
    """Return linear (height, width, 4) pixels with associated alpha as a small sRGB picture.

    Its longer side has at most ``side`` pixels. Transparent views lie on a middle grey. Without
    ``exposure``, the picture has its own.
    """
    height, width = image.shape[:2]
    scale = min(1.0, side / max(width, height))
    small = shrunk(image, max(1, round(width * scale)), max(1, round(height * scale)))
    if exposure is None:
        exposure = exposure_for(small[..., :3], look)
    grey = MIDDLE_GREY / 2**exposure
    return develop(small[..., :3] + grey * (1 - small[..., 3:].clip(0, 1)), exposure, look)


def shrunk(colour: Array, width: int, height: int) -> Array:
    """Return (…, …, channels) colour resized to ``width`` × ``height`` pixels, without aliasing.

    The filter is Lanczos's of three lobes.
    """
    planes = np.moveaxis(np.asarray(colour, np.float32), -1, 0)
    size = (width, height)
    small = [
        np.asarray(
            Image.fromarray(np.ascontiguousarray(plane)).resize(size, Image.Resampling.LANCZOS)
        )
        for plane in planes
    ]
    smaller: Array = np.stack(small, axis=-1).clip(min=0)
    return smaller


def shrunk_8_bit(pixels: Array, width: int, height: int) -> Array:
    """Return uint8 (…, …, 3) pixels resized as `shrunk` does."""
    # The filter overshoots at edges.
    return np.asarray(np.rint(shrunk(pixels, width, height).clip(max=255)), np.uint8)
