"""Pictures of a view's passes: one of each that the dataset has."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.colors import hsv_to_rgb

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField, View
from lightfield.dataset.passes import FLOW, Pass
from lightfield.imaging import images, pictures
from lightfield.imaging.pictures import Array
from lightfield.imaging.tonemap import to_8_bit
from lightfield.report.packing import webp

# The longer side of a picture in pixels, at most.
SIDE = 320
# A motion of fewer pixels is none.
STILL = 0.01
# Neighbouring numbers have hues as far apart as can be.
GOLDEN = (math.sqrt(5) - 1) / 2


def collect(
    folder: Path, lightfield: LightField, view: View, exposure: float
) -> Iterator[tuple[str, str, str]]:
    """Yield name, meaning and picture of each pass of a view, of those that can be read.

    ``exposure`` is that of light, in stops.
    """
    step = math.ceil(max(lightfield.lens.width, lightfield.lens.height) / SIDE)
    wanted = [(found, view.name) for found in lightfield.passes]
    wanted += [(FLOW, view.flow)] if view.flow else []
    for found, name in wanted:
        try:
            channels = images.read_image(found.path(folder, name), found.channels).channels
        except UserError:
            continue  # which validation says
        planes = [channels[channel][::step, ::step] for channel in found.channels]
        shown = _picture(found, np.stack(planes, axis=-1), exposure)
        yield found.name, found.meaning, webp(shown)


def _picture(found: Pass, pixels: Array, exposure: float) -> Array:
    """Return a pass's pixels (h, w, channels) as 8-bit sRGB (h, w, 3)."""
    match found.kind:
        case "light" if found.name == "albedo":
            # From 0 to 1, whatever the light.
            return to_8_bit(np.ascontiguousarray(pixels, np.float32))
        case "light":
            return pictures.develop(pixels.astype(np.float32), exposure)
        case "normal":
            colours = np.where(pixels.any(axis=-1, keepdims=True), pixels / 2 + 0.5, 0)
        case "id":
            colours = _distinct(pixels[..., 0]) * (pixels > 0)
        case "matte":
            hashes = np.ascontiguousarray(pixels[..., ::2]).view(np.uint32)
            parts = pixels[..., 1::2]
            colours = np.sum(_distinct(hashes) * parts[..., None], axis=-2)
        case _:
            colours = _directions(*np.moveaxis(pixels[..., -2:], -1, 0))
            if found == FLOW:
                x, y, visible = np.moveaxis(pixels, -1, 0)
                colours = _directions(x, y) * np.where(visible > 0, 1, 0.4)[..., None]
    return np.asarray(np.rint(colours.clip(0, 1) * 255), np.uint8)


def _distinct(numbers: Array) -> Array:
    """Return a colour (…, 3) for each number (…)."""
    hue = numbers.astype(np.float64) * GOLDEN % 1
    return np.asarray(hsv_to_rgb(np.stack([hue, np.full_like(hue, 0.6), 0.6 + 0.4 * hue], -1)))


def _directions(x: Array, y: Array) -> Array:
    """Return a colour (…, 3) for each motion: its hue is where to, its saturation how far."""
    length = np.hypot(x, y)
    # What stands still moves by rounding alone.
    far = max(np.quantile(length, 0.99), STILL)
    hue = np.arctan2(-y, x) / (2 * np.pi) % 1
    return np.asarray(hsv_to_rgb(np.stack([hue, (length / far).clip(0, 1), np.ones_like(hue)], -1)))
