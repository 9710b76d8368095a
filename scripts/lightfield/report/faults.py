"""Makes pictures of the views that fail a validation check."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.imaging import images, pictures
from lightfield.report.packing import webp

Array = NDArray[Any]

# At most this many views of each check are shown.
MOST = 6
# The longer side of a picture in pixels, at most.
SIDE = 256
WRONG = (255, 0, 255)
"""The colour of pixels with an impossible value."""
MISS = (176, 176, 176)


@dataclass(frozen=True)
class FaultyView:
    """One view: colour and depth as data URIs. ``depth`` is None if the file has none."""

    name: str
    colour: str
    depth: str | None


def collect(folder: Path, views: Sequence[str]) -> list[FaultyView]:
    """Return pictures of the first of the ``views`` in ``folder``. Leaves out unreadable files."""
    candidates = (_fault(folder, view) for view in views[:MOST])
    return [fault for fault in candidates if fault]


def _fault(folder: Path, view: str) -> FaultyView | None:
    exr = folder / f"{view}.exr"
    png = folder / f"{view}.png"
    path = exr if exr.is_file() or not png.is_file() else png
    try:
        image = images.read_image(path)
        shown = image.srgb if path == png else _colour(image.colour)
    except (UserError, LookupError):
        return None
    depth = webp(_depth(image.channels["Z"])) if "Z" in image.channels else None
    return FaultyView(path.name, webp(shown), depth)


def _colour(colour: Array) -> Array:
    """Return scene-linear colour (height, width, 3) developed and thinned, marked where wrong."""
    wrong = ~np.isfinite(colour).all(axis=-1)
    right = np.where(wrong[..., None], 0, colour).clip(min=0).astype(np.float32)
    step = _step(wrong)
    shown = pictures.develop(right[::step, ::step], pictures.exposure_for(right))
    return _marked(shown, wrong)


def _depth(depth: Array) -> Array:
    """Return depth (height, width) in colours: near is light, far is dark, wrong is marked."""
    wrong = np.isneginf(depth) | (depth <= 0)
    hit = np.isfinite(depth) & ~wrong
    thinned = depth[:: _step(wrong), :: _step(wrong)]
    low, high = np.log(np.percentile(depth[hit], [2, 98])) if hit.any() else (0.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = (np.log(thinned.astype(np.float64)) - low) / max(high - low, 1e-6)
    coloured = matplotlib.colormaps["viridis_r"](
        np.nan_to_num(place, posinf=0.0, neginf=0.0), bytes=True
    )[..., :3]
    hidden = ~np.isfinite(thinned)[..., None]
    shown: Array = np.where(hidden, np.array(MISS, np.uint8), coloured)
    return _marked(shown, wrong)


def _step(pixels: Array) -> int:
    step: int = math.ceil(max(pixels.shape) / SIDE)
    return step


def _marked(shown: Array, wrong: Array) -> Array:
    """Return thinned pixels. A pixel is marked if any pixel in its block is ``wrong``."""
    step = _step(wrong)
    for axis in (0, 1):
        wrong = np.logical_or.reduceat(wrong, range(0, wrong.shape[axis], step), axis=axis)
    marked: Array = np.where(wrong[..., None], np.array(WRONG, np.uint8), shown)
    return marked
