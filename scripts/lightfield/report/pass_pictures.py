"""Makes a picture of each pass of a view, and packs its light groups."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.colors import hsv_to_rgb

from lightfield.core.errors import UserError
from lightfield.formats.passes import FLOW, Pass, group_pass, is_group
from lightfield.imaging import pictures
from lightfield.imaging.look import Look
from lightfield.imaging.pictures import Array
from lightfield.imaging.tonemap import to_8_bit
from lightfield.reading.dataset import OpenView
from lightfield.report.packing import light_scale, pack_light, webp

# The longer side of a picture in pixels, at most.
SIDE = 320
# The same for a light group's picture. It is smaller if there are more than _MANY_GROUPS.
_GROUP_SIDE = 256
_SMALLER_GROUP_SIDE = 128
_MANY_GROUPS = 16
# A motion of fewer pixels counts as none.
_STILL = 0.01
# Steps of the golden ratio give neighbouring numbers very different hues.
_GOLDEN = (math.sqrt(5) - 1) / 2


def collect(
    view: OpenView, exposure: float, look: Look | None = None
) -> Iterator[tuple[str, str, str]]:
    """Yield name, meaning and picture of each readable pass of a view. Leaves out light groups.

    ``exposure`` in stops and ``look`` apply to passes of light.
    """
    step = math.ceil(max(view.lens.width, view.lens.height) / SIDE)
    passes = [each for each in view.dataset.lightfield.passes if not is_group(each)]
    if view.camera.flow:
        passes.append(FLOW)
    for view_pass in passes:
        try:
            pixels = np.atleast_3d(view.read(view_pass.name))
        except UserError:
            continue  # Validation reports it.
        picture = _picture(view_pass, pixels[::step, ::step], exposure, look)
        yield view_pass.name, view_pass.meaning, webp(picture)


def light_groups(view: OpenView, exposure: float) -> dict[str, Any] | None:
    """Pack a view's light groups, so that a page can relight it. Return None if none can be read.

    ``exposure`` is the page's exposure in stops.
    """
    names = view.dataset.lightfield.light_groups
    side = _GROUP_SIDE if len(names) <= _MANY_GROUPS else _SMALLER_GROUP_SIDE
    small = view.lens.fitted(side)
    groups = []
    for name in names:
        try:
            colour = view.read(group_pass(name))
        except UserError:
            continue  # Validation reports it.
        colour = np.nan_to_num(colour, posinf=0, neginf=0)
        if colour.shape[:2] != (small.height, small.width):
            colour = pictures.shrunk(colour, small.width, small.height)
        scale = light_scale(colour)
        # Store groups without loss: the sum of many groups would show the losses of each.
        picture = webp(pack_light(colour, scale))
        groups.append({"name": name, "scale": scale, "light": picture})
    if not groups:
        return None
    return {
        "view": view.name,
        "size": [small.width, small.height],
        "exposure": exposure,
        "groups": groups,
    }


def _picture(view_pass: Pass, pixels: Array, exposure: float, look: Look | None) -> Array:
    """Return a pass's pixels (height, width, channels) as 8-bit sRGB (height, width, 3)."""
    colours: Array
    match view_pass.kind:
        case "light" if view_pass.name in ("albedo", "base_colour"):
            # These lie between 0 and 1, so they need no exposure.
            return to_8_bit(np.ascontiguousarray(pixels, np.float32))
        case "light":
            return pictures.develop(pixels.astype(np.float32), exposure, look)
        case "variance":
            return pictures.develop(np.sqrt(pixels), exposure, look)
        case "value":
            colours = np.repeat(pixels.astype(np.float32), 3, axis=-1)
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
            if view_pass == FLOW:
                x, y, visible = np.moveaxis(pixels, -1, 0)
                colours = _directions(x, y) * np.where(visible > 0, 1, 0.4)[..., None]
    return np.asarray(np.rint(colours.clip(0, 1) * 255), np.uint8)


def _distinct(numbers: Array) -> Array:
    """Return a colour (…, 3) for each number (…)."""
    hue = numbers.astype(np.float64) * _GOLDEN % 1
    return np.asarray(hsv_to_rgb(np.stack([hue, np.full_like(hue, 0.6), 0.6 + 0.4 * hue], -1)))


def _directions(x: Array, y: Array) -> Array:
    """Return a colour (…, 3) for each motion: hue is direction, saturation is length."""
    length = np.hypot(x, y)
    # Still pixels move only by rounding errors. Do not amplify those.
    far = max(np.quantile(length, 0.99), _STILL)
    hue = np.arctan2(-y, x) / (2 * np.pi) % 1
    return np.asarray(hsv_to_rgb(np.stack([hue, (length / far).clip(0, 1), np.ones_like(hue)], -1)))
