"""Packs light and depth into the 8-bit pixels of pictures, with more range than a display has.

A page decodes them in the browser (templates/page/packing.js), to show exposure and depth. Every
doubling of depth has the same number of steps. So has every stop of light, except for dark light,
which has equal steps down to black.
"""

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lightfield.imaging import pictures
from lightfield.imaging.blender_looks import title
from lightfield.imaging.look import Look

Array = NDArray[Any]

# Steps of light become linear this many stops below white. There they are nearly as fine as the
# steps of 8-bit sRGB. Logarithmic steps would end above black, and change the dark channels of
# saturated colours.
_TOE_STOPS = 7.0
# 12 bits of depth: a step is 0.3 percent in a scene from centimetres to hundreds of metres.
DEPTH_STEPS = 4096
# A table of 48 lights is within 0.6 of 255 levels of AgX in 99 of 100 colours, and has 31 kB.
_LOOK_SIDE = 48
# The toe and the highest light of a look's table, in stops.
_LOOK_STOPS = (-9.0, 8.0)
NO_DEPTH = 0
MISS = DEPTH_STEPS - 1


def light_scale(colour: Array) -> tuple[float, float]:
    """Return the scale (toe, highest) that light (..., 3) is packed on.

    Steps are linear below the toe. It is `_TOE_STOPS` below white at the colour's own exposure.
    """
    toe = 2.0 ** -(_TOE_STOPS + pictures.exposure_for(colour))
    lit = colour[np.isfinite(colour) & (colour > 0)]
    return toe, float(lit.max()) if lit.size else toe


def pack_light(colour: Array, scale: tuple[float, float]) -> NDArray[np.uint8]:
    """Return light (...) as codes from 0, which is black, to 255, which is the ``scale``'s highest.

    Codes have equal steps of log(1 + light / toe).
    """
    toe, highest = scale
    light = np.clip(np.nan_to_num(colour, nan=0.0), 0, highest)
    codes = np.log1p(light / toe) / np.log1p(highest / toe) * 255
    packed: NDArray[np.uint8] = np.round(codes).astype(np.uint8)
    return packed


def light_step(scale: tuple[float, float]) -> float:
    """Return the part by which bright light grows from one code to the next."""
    toe, highest = scale
    return float(np.expm1(np.log1p(highest / toe) / 255))


def depth_range(depth: Array) -> tuple[float, float]:
    """Return (low, high), in log2 metres, of all finite, positive depths."""
    hit = depth[np.isfinite(depth) & (depth > 0)]
    if not hit.size:
        return 0.0, 1.0
    low = np.log2(hit.min())
    high = np.log2(hit.max())
    # Rays that graze the camera's own plane have a Z-depth of nearly nothing.
    low = max(low, np.log2(np.percentile(hit, 1)) - 4)
    return float(low), float(max(high, low + 1.0))


def pack_depth(
    depth: Array, limits: tuple[float, float], farther: Array | None = None
) -> NDArray[np.uint8]:
    """Return depth (...) in metres as (..., 3): the high and the low byte of 16 times its code.

    Codes are `NO_DEPTH` for NaN, `MISS` for inf, and between them ``limits`` in equal steps of
    log2. ``farther`` (...), 0 to 15, is added: `lightfield.synthesis.apparent.farther`.
    """
    low, high = limits
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = (np.log2(depth) - low) / (high - low) * (MISS - 2)
    steps = np.nan_to_num(steps, nan=0.0, posinf=0.0, neginf=0.0)
    codes = np.clip(np.round(steps) + 1, 1, MISS - 1)
    codes = np.where(np.isposinf(depth), MISS, np.where(np.isnan(depth), NO_DEPTH, codes))
    numbers = (codes * 16 + (0 if farther is None else farther)).astype(np.uint16)
    packed = np.zeros((*numbers.shape, 3), np.uint8)
    packed[..., 0] = numbers >> 8
    packed[..., 1] = numbers & 255
    return packed


def pack_look(look: Look) -> dict[str, Any]:
    """Return a look as a table of pixels, which a page interpolates between `_LOOK_SIDE` lights.

    The lights are spaced as light is packed: evenly in log(1 + light / toe), up to ``highest``. The
    table is a picture with red downwards, and green and blue across.
    """
    # The exposure moves the range in which a view transform does something.
    toe, highest = (2.0 ** (stops - look.exposure) for stops in _LOOK_STOPS)
    parts = np.arange(_LOOK_SIDE) / (_LOOK_SIDE - 1)
    table = look.table(toe * np.expm1(parts * np.log1p(highest / toe)))
    return {
        "name": title(vars(look)),
        "side": _LOOK_SIDE,
        "toe": toe,
        "highest": highest,
        "table": webp(table.reshape(_LOOK_SIDE, -1, 3)),
    }


def webp(pixels: NDArray[np.uint8], quality: int | None = None) -> str:
    """Return pixels (height, width, 3) as the data URI of a WebP. Lossless without ``quality``."""
    file = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if quality is None:
        picture.save(file, "WEBP", lossless=True, quality=20, method=1)
    else:
        picture.save(file, "WEBP", quality=quality, method=4)
    return data_uri(file.getvalue(), "image/webp")


def data_uri(content: bytes, kind: str) -> str:
    """Return bytes as a data URI of the MIME type ``kind``."""
    return f"data:{kind};base64,{packed_bytes(content)}"


def packed_bytes(content: bytes) -> str:
    """Return bytes in base 64."""
    return base64.b64encode(content).decode("ascii")
