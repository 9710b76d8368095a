"""Compares a reprojected view with the rendered view from which it was made.

Both are at one place, so each ray of the one is a ray of the other. A colour must lie between the
colours that the rendered view has around the ray. A distance must be the one that lies there on the
same surface. A few pixels may differ: filters overshoot, and edges move by part of a pixel.

A wrong colour between those around it is not found. So in noise, and in fine textures, a view may
be taken for another.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.formats.layout import ImageSet
from lightfield.geometry.depth import converted
from lightfield.imaging.images import Image
from lightfield.imaging.tonemap import encode_srgb

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# About this many pixels of a view are compared, spread evenly.
_PIXELS = 500
# A colour is compared with the source's colours within this many pixels. They are the source's
# pixels in a magnified image, and the view's pixels in a reduced one. Some filters reach farther,
# but give little weight to the colours there.
REACH = 1.0
# Where that is more than this many pixels of the source, colours are not compared.
_LARGEST_REACH = 24
# By this part of the range of colours around it, a filter may overshoot the range.
_OVERSHOOT = 0.3
# A colour may be this much outside the range: a step of 8 bits, or rounding of half floats.
STEP = 1.5 / 255
ROUNDING = 0.01
# At most this part of the compared colours, and of the distances, may be wrong. Right views with
# the noise of 4 samples reach 0.016, and 0.047 where a fisheye of 180 degrees has only 24²
# pixels. Such views may be refused wrongly.
_MOST_WRONG = 0.05
# Four neighbouring distances are of one surface if the largest is at most this times the smallest.
_ONE_SURFACE = 1.1
# A distance is wrong if its logarithm is off by more than this. The median may be off by less.
_OFF = 0.05
_MEDIAN_OFF = 0.005
# Fewer pixels than this are not judged: a few wrong ones may be chance.
_FEWEST = 20


class _Rays:
    """Evenly spread pixels of a reprojected view, and where its source has their rays.

    ``rows`` and ``columns`` (n,) are the pixels, ``rays`` (n, 3) their rays, and ``places`` (n, 2)
    the pixel coordinates in the source.
    """

    def __init__(self, target: ImageSet, view: int, source: ImageSet, source_view: int) -> None:
        self.lens = target.lightfield.lens
        self.source_lens = source.lightfield.lens
        to_world = target.lightfield.world_from_cameras[view, :3, :3]
        self.turn = source.lightfield.world_from_cameras[source_view, :3, :3].T @ to_world
        step = max(1, int((self.lens.width * self.lens.height / _PIXELS) ** 0.5))
        grid = np.mgrid[step // 2 : self.lens.height : step, step // 2 : self.lens.width : step]
        self.rows, self.columns = grid.reshape(2, -1)
        self.rays = self.lens.rays(self.columns + 0.5, self.rows + 0.5)
        self.places = self._places(0.0, 0.0)

    def _places(self, right: float, down: float) -> Floats:
        rays = self.lens.rays(self.columns + 0.5 + right, self.rows + 0.5 + down)
        places: Floats = self.source_lens.pixels(rays @ self.turn.T)
        return places

    def reach(self) -> Floats:
        """Return within how many pixels of the source (n,) a colour must lie. NaN without a ray."""
        moves = [self._places(*shift) - self.places for shift in ((0.5, 0.0), (0.0, 0.5))]
        return np.asarray(REACH * np.maximum(1.0, 2 * np.abs(moves).max(axis=(0, 2))))


def faults(
    target: ImageSet, view: int, image: Image, source: ImageSet, source_view: int, original: Image
) -> Iterator[str]:
    """Yield how the ``image`` of a reprojected view differs from the ``original``, its source."""
    rays = _Rays(target, view, source, source_view)
    if has_same_light(target):
        wrong = _wrong_colours(target, image, original, rays)
        if len(wrong) >= _FEWEST and wrong.mean() > _MOST_WRONG:
            yield f"{wrong.mean():.0%} of its colours are not those around their places in"
    if "Z" in image.channels and "Z" in original.channels:
        yield from _depth_faults(target, image, source, original, rays)


def has_same_light(target: ImageSet) -> bool:
    """Return whether the views show the light of their source, with a known tone mapping."""
    lightfield = target.lightfield
    is_changed = lightfield.is_relit or lightfield.transparent or target.sensor is not None
    # A look mixes channels, so its colours do not lie between the looks of the colours around.
    is_changed |= lightfield.has_look
    return "reprojection" in lightfield.content and not is_changed


def _wrong_colours(
    target: ImageSet, image: Image, original: Image, rays: _Rays
) -> NDArray[np.bool_]:
    """Return which of the comparable pixels (m,) have a colour that is not around their rays."""
    colour = original.colour.astype(np.float64)
    is_encoded = image.channels["R"].dtype.kind == "u"
    pixels = image.colour[rays.rows, rays.columns].astype(np.float64)
    if is_encoded:
        pixels /= np.iinfo(image.channels["R"].dtype).max
    reach = rays.reach()
    parts = [np.empty(0, bool)]
    height, width = colour.shape[:2]
    with np.errstate(invalid="ignore"):
        radii = np.where(reach <= _LARGEST_REACH, np.ceil(reach), -1).astype(np.int64)
        columns, rows = np.floor(np.nan_to_num(rays.places, nan=-1)).astype(np.int64).T
    for radius in np.unique(radii[radii >= 0]).tolist():
        is_inside = (radius <= columns) & (columns < width - radius)
        is_inside &= (radius <= rows) & (rows < height - radius)
        chosen = np.flatnonzero((radii == radius) & is_inside)
        around = np.arange(-radius, radius + 1)
        window = colour[
            rows[chosen, None, None] + around[:, None], columns[chosen, None, None] + around
        ]
        low = _developed(window.min(axis=(1, 2)), target, is_encoded)
        high = _developed(window.max(axis=(1, 2)), target, is_encoded)
        slack = _OVERSHOOT * (high - low) + (STEP if is_encoded else ROUNDING * (1e-2 + high))
        # The limits are clipped, too: saturated colours of other primaries may be negative.
        values = np.maximum(pixels[chosen], 0)
        parts.append(((values < low - slack) | (values > high + slack)).any(axis=1))
    return np.concatenate(parts)


def _developed(light: Floats, target: ImageSet, is_encoded: bool) -> Floats:
    """Return ``light`` after the exposure and the tone mapping of a reprojection."""
    settings = target.lightfield.content["reprojection"]
    shown = toned(light, settings.get("exposure", 0), settings.get("reinhard", 1))
    return np.asarray(encode_srgb(shown) if is_encoded else shown, np.float64)


def toned(light: NDArray[Any], exposure: float, white: float) -> Floats:
    """Return ``light`` (...) after an exposure in stops and a tone curve. Both grow with light.

    A ``white`` of 1 changes nothing. Negative light becomes 0. Source: Reinhard et al. 2002,
    equation 4. Shares no code with the reprojection.
    """
    with np.errstate(all="ignore"):
        brighter = np.maximum(light, 0) * np.exp2(exposure)
        return np.asarray(brighter * (1 + brighter / white / white) / (1 + brighter), np.float64)


def _depth_faults(
    target: ImageSet, image: Image, source: ImageSet, original: Image, rays: _Rays
) -> Iterator[str]:
    """Yield how the distances differ from the source's, where the source has a smooth surface."""
    around, weights = _four_around(source, original, rays)
    distance = converted(
        image.channels["Z"][rays.rows, rays.columns].astype(np.float64),
        rays.rays,
        target.lightfield.depth,
        "distance",
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        is_surface = around.max(axis=1) <= _ONE_SURFACE * around.min(axis=1)
        is_surface &= np.isfinite(around).all(axis=1) & ~np.isnan(distance)
        expected = 1 / (weights / around).sum(axis=1)
        off = np.abs(np.log(distance / expected))[is_surface]
        ratio = (distance / expected)[is_surface]
    if len(off) < _FEWEST:
        return
    wrong = float(np.mean(~(off <= _OFF)))
    scale = float(np.median(ratio))
    if wrong > _MOST_WRONG:
        yield f"{wrong:.0%} of its depths are not those at their places in"
    elif not abs(np.log(scale)) <= _MEDIAN_OFF:
        yield f"its depths are {scale:.4g} times the depths of"


def _four_around(source: ImageSet, original: Image, rays: _Rays) -> tuple[Floats, Floats]:
    """Return the distances (n, 4) of the four pixels around each ray, and their weights (n, 4).

    The distances are NaN where the source has no four pixels around.
    """
    lens = source.lightfield.lens
    depth = original.channels["Z"].astype(np.float64)
    with np.errstate(invalid="ignore"):
        corner = np.floor(rays.places - 0.5)
        parts = rays.places - 0.5 - corner
        is_inside = ((corner >= 0) & (corner + 1 < [lens.width, lens.height])).all(axis=1)
        columns, rows = np.where(is_inside[:, None], corner, 0).astype(np.int64).T
    distances: list[Floats] = []
    weights: list[Floats] = []
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x = np.minimum(columns + right, lens.width - 1)
        y = np.minimum(rows + down, lens.height - 1)
        values = converted(
            depth[y, x], lens.rays(x + 0.5, y + 0.5), source.lightfield.depth, "distance"
        )
        distances.append(np.where(is_inside, values, np.nan))
        weights.append(np.abs(parts - (1 - right, 1 - down)).prod(axis=1))
    return np.stack(distances, axis=1), np.stack(weights, axis=1)
