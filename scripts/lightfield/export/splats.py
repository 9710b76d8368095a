"""Makes Gaussians of the surfaces that views see, without training.

Each surface point gets one Gaussian, from the view that sees it best. A Gaussian is as large as its
pixel's footprint on the surface, and lies flat on it. Its colour is a mean over the views that see
the point.

With the rays r, their change from pixel to pixel r_u and r_v, the surface's normal n and its
distance d, the footprint is spanned by a_u = d (r_u − r (r_u·n) / (r·n)), and likewise a_v. The
covariance of the Gaussian is σ² (a_u a_uᵀ + a_v a_vᵀ + t² n nᵀ).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lightfield.core.progress import Progress
from lightfield.export.source import Bools, Floats, SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.formats.gaussians import Gaussians, harmonics_of
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rotations import matrix_to_quaternion
from lightfield.geometry.visibility import ONE_SURFACE, lies_on

Singles = NDArray[np.float32]

# Views are read at this many times as many pixels as there may be Gaussians: several views see most
# points, and one of them owns each. A sphere of 36 views needs five.
_PIXELS = 5
# Standard deviations of a Gaussian in pixels, and its opacity. Beside a tear, a pixel mixes two
# surfaces' colours, so its Gaussian is smaller and fainter. The sky has no details to keep sharp.
_SIGMA = 0.5
_TORN_SIGMA = 0.3
_SKY_SIGMA = 0.8
_OPACITY = 0.99
_TORN_OPACITY = 0.4
_THICKNESS = 0.1  # of the footprint's shorter side
# Footprints grow until the incidence has this cosine, and no further.
_LEAST_COSINE = 0.2
# A view owns a point unless another view sees it better by more than this factor.
_OWNS = 1.05
# Pixels beside a tear own a point only if no other view sees it well.
_TORN_SCORE = 100.0
# Another view sees a point if its surface is there, within the first part of the distance. Or the
# point lies between two of its pixels whose distances differ by less than the second part.
_ON_SURFACE = 0.003
_SLANTED = 0.03
# Neighbours share a surface if their inverse distances differ by less than this part, or as much as
# the next pixels', by less than half.
_FLAT = 0.05
# The sky is this many times as far away as the farthest surface.
_SKY = 10.0


@dataclass(frozen=True)
class _Grid:
    """The pixels of a lens that are read, about one in ``step``. Arrays (h, w, …)."""

    lens: Lens
    step: float
    _rays: dict[tuple[float, float], Floats] = field(default_factory=dict, init=False, repr=False)

    @property
    def columns(self) -> NDArray[np.intp]:
        return _evenly(self.lens.width, self.step)

    @property
    def rows(self) -> NDArray[np.intp]:
        return _evenly(self.lens.height, self.step)

    def rays(self, right: float = 0, below: float = 0) -> Floats:
        """Return the unit rays (h, w, 3) of the pixels, or of places beside them."""
        # All views ask for the same few, and some lenses compute them slowly.
        key = (right, below)
        if key not in self._rays:
            x = self.columns + 0.5 + right
            y = self.rows + 0.5 + below
            self._rays[key] = np.asarray(self.lens.rays(x[None, :], y[:, None]))
        return self._rays[key]

    def of(self, image: Floats, right: int = 0, below: int = 0) -> Floats:
        """Return an image's values at the pixels, or at pixels beside them. Repeats its edges."""
        row = (self.rows + below).clip(0, self.lens.height - 1)
        column = (self.columns + right).clip(0, self.lens.width - 1)
        return np.asarray(image[np.ix_(row, column)])


@dataclass(frozen=True)
class _Samples:
    """What a view shows at the pixels of a grid, in the camera's coordinates. Arrays (h, w, …)."""

    view: View
    distance: Singles
    normal: Singles
    colour: Singles
    alpha: Singles
    torn: Bools
    score: Singles


def make(source: SourceDataset, count: int) -> Gaussians:
    """Return at most ``count`` Gaussians of all surfaces and the sky, from the views that train."""
    views = splits(source.lightfield).train
    step = pixel_step(source, views, count)
    while True:
        gaussians = _owned(source, views, _Grid(source.lens, step))
        if len(gaussians) <= count:
            return gaussians
        step *= 1.02 * math.sqrt(len(gaussians) / count)


def pixel_step(source: SourceDataset, views: Sequence[View], count: int) -> float:
    """Return the step in pixels, at least 1, with which ``count`` Gaussians read ``views``."""
    pixels = len(views) * source.lens.width * source.lens.height
    return max(1.0, math.sqrt(pixels / (_PIXELS * count)))


def _owned(source: SourceDataset, views: Sequence[View], grid: _Grid) -> Gaussians:
    """Return a Gaussian for each pixel of the ``grid`` that owns its point."""
    rays = grid.rays()
    progress = Progress(2 * len(views), "Gaussians", "views")
    seen = []
    for view in views:
        seen.append(_samples(source, view, grid, rays))
        progress.done()
    farthest = [np.max(each.distance, initial=0, where=np.isfinite(each.distance)) for each in seen]
    sky = _SKY * (float(max(farthest)) or 1.0)
    parts = []
    for samples in seen:
        parts.append(_gaussians(samples, seen, grid, rays, sky))
        progress.done()
    names = Gaussians.__dataclass_fields__
    return Gaussians(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names})


def _samples(source: SourceDataset, view: View, grid: _Grid, rays: Floats) -> _Samples:
    """Read a view at the pixels of a ``grid``."""
    image = source.depth(view, "distance")
    distance = grid.of(image)
    colour, alpha = _colours(source, view, grid, image, distance)
    normal = _normals(grid, image, rays)
    torn = _torn(distance)
    shown = np.isfinite(rays[..., 0]) & (distance > 0) & (alpha > 0)
    if source.lightfield.transparent:
        shown &= np.isfinite(distance)
    return _Samples(
        view,
        distance.astype(np.float32),
        normal.astype(np.float32),
        colour,
        alpha,
        torn,
        np.where(shown, _scores(rays, distance, normal, torn), np.inf).astype(np.float32),
    )


def _colours(
    source: SourceDataset, view: View, grid: _Grid, image: Floats, distance: Floats
) -> tuple[Singles, Singles]:
    """Return colours (h, w, 3) and coverage (h, w), 0 to 1: means of the pixels on one surface."""
    coverage = source.alpha(view) / 255
    # Transparent views are encoded in front of black.
    encoded = np.nan_to_num(source.encoded(view)) / np.where(coverage > 0, coverage, 1)[..., None]
    sums = np.zeros((*distance.shape, 4))
    weights = np.zeros(distance.shape)
    side = max(1, round(grid.step))
    offsets = range(-(side // 2), side - side // 2)
    for below in offsets:
        for right in offsets:
            there = grid.of(image, right, below)
            weight = lies_on(there, distance, part=ONE_SURFACE) | (there == distance)
            weights += weight
            sums[..., :3] += weight[..., None] * grid.of(encoded, right, below)
            sums[..., 3] += weight * grid.of(coverage, right, below)
    means = (sums / np.maximum(weights, 1)[..., None]).astype(np.float32)
    return means[..., :3], means[..., 3]


def _normals(grid: _Grid, image: Floats, rays: Floats) -> Floats:
    """Return the surfaces' unit normals (h, w, 3), towards the camera. Of the sky, the rays back.

    A normal is perpendicular to the nearer neighbour in each direction. Surfaces that are seen more
    obliquely than `_LEAST_COSINE` are turned towards the camera.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        here = rays * grid.of(image)[..., None]
        across = _nearer(grid, image, here, (1, 0))
        down = _nearer(grid, image, here, (0, 1))
        normal = np.cross(down, across)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        flat = np.isfinite(normal[..., :1])
        normal = np.where(flat, normal, -rays)
        cosine = -(normal * rays).sum(axis=-1, keepdims=True)
        normal *= np.where(cosine < 0, -1, 1)
        cosine = np.abs(cosine)
        along = normal + cosine * rays
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        least = _LEAST_COSINE
        turned = math.sqrt(1 - least**2) * along - least * rays
    return np.asarray(np.where(cosine < least, turned, normal))


def _nearer(grid: _Grid, image: Floats, here: Floats, way: tuple[int, int]) -> Floats:
    """Return the vector (h, w, 3) to the nearer of both neighbours along a row or a column."""
    right, below = way
    after = grid.rays(right, below) * grid.of(image, right, below)[..., None] - here
    before = here - grid.rays(-right, -below) * grid.of(image, -right, -below)[..., None]
    lengths = [np.linalg.norm(each, axis=-1, keepdims=True) for each in (after, before)]
    far_after, far_before = (np.where(np.isnan(each), np.inf, each) for each in lengths)
    return np.asarray(np.where(far_after <= far_before, after, before))


def _torn(distance: Floats) -> Bools:
    """Return which pixels (h, w) lie beside a neighbour on another surface."""
    inverse = 1 / distance
    torn = np.zeros(distance.shape, bool)
    for axis in (0, 1):
        lines = np.moveaxis(inverse, axis, 0)
        step = np.diff(lines, axis=0)
        nan = np.full_like(lines[:1], np.nan)
        before = np.concatenate([nan, step[:-1]])[: len(step)]
        after = np.concatenate([step[1:], nan])[: len(step)]
        steep = np.abs(step) > _FLAT * np.maximum(lines[1:], lines[:-1])
        goes_on = np.abs(before - step) < np.abs(step) / 2
        goes_on |= np.abs(after - step) < np.abs(step) / 2
        tear = steep & ~goes_on
        beside = np.moveaxis(torn, axis, 0)
        beside[1:] |= tear
        beside[:-1] |= tear
    return torn


def _scores(rays: Floats, distance: Floats, normal: Floats, torn: Bools) -> Floats:
    """Return how badly a view sees its points (h, w): from afar, obliquely, or off its axis."""
    cosine = np.abs((normal * rays).sum(axis=-1))
    angle = np.arccos((-rays[..., 2]).clip(-1, 1)) / (math.pi / 2)
    away = np.where(np.isinf(distance), 1.0, distance)
    scores: Floats = away**2 / cosine * (1 + 0.5 * angle**2) * np.where(torn, _TORN_SCORE, 1.0)
    return scores


def _gaussians(
    samples: _Samples, seen: Sequence[_Samples], grid: _Grid, rays: Floats, sky: float
) -> Gaussians:
    """Return the Gaussians of one view's pixels that own their points."""
    pixels = np.flatnonzero(np.isfinite(samples.score))
    distance = samples.distance.ravel()[pixels].astype(np.float64)
    is_sky = np.isinf(distance)
    distance[is_sky] = sky
    turn = samples.view.world_from_camera[:3, :3]
    local = rays.reshape(-1, 3)[pixels] * distance[:, None]
    positions = local @ turn.T + samples.view.world_from_camera[:3, 3]
    others = [other for other in seen if other is not samples]
    owned, colours = _shared_colours(samples, others, grid, pixels, positions, is_sky)
    torn = samples.torn.ravel()[pixels[owned]]
    sigma = np.where(is_sky[owned], _SKY_SIGMA, np.where(torn, _TORN_SIGMA, _SIGMA))
    scales, axes = _axes(grid, rays, samples, pixels[owned], distance[owned], sigma)
    opacity = np.where(torn, _TORN_OPACITY, _OPACITY)
    return Gaussians(
        positions[owned],
        scales,
        matrix_to_quaternion(turn @ axes),
        harmonics_of(colours),
        opacity * samples.alpha.ravel()[pixels[owned]],
    )


def _shared_colours(
    samples: _Samples,
    others: Sequence[_Samples],
    grid: _Grid,
    pixels: NDArray[np.intp],
    positions: Floats,
    is_sky: Bools,
) -> tuple[NDArray[np.intp], Floats]:
    """Return which of a view's points (n, 3) no other view sees better, and their colours (m, 3).

    The views that see a point count by how well they see it, and half if they do not own it.
    """
    score = samples.score.ravel()[pixels].astype(np.float64)
    weights = 1 / score
    sums = weights[:, None] * samples.colour.reshape(-1, 3)[pixels]
    owned = np.arange(len(pixels))
    for other in others:
        column, row, sees = _where_seen(other, grid, positions[owned], is_sky[owned])
        other_score = other.score[row, column]
        weight = np.where(sees, 0.5 / other_score, 0)
        weights[owned] += weight
        sums[owned] += weight[:, None] * other.colour[row, column]
        owned = owned[~sees | (other_score * _OWNS >= score[owned])]
    return owned, (sums / weights[:, None])[owned]


def _where_seen(
    other: _Samples, grid: _Grid, positions: Floats, is_sky: Bools
) -> tuple[NDArray[np.intp], NDArray[np.intp], Bools]:
    """Return the columns and rows (n,) of points in a view's grid, and which it sees."""
    local = other.view.to_camera(positions)
    height, width = other.distance.shape
    pixels = grid.lens.pixels(local) * (width / grid.lens.width, height / grid.lens.height)
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels < (width, height))).all(axis=-1)
    pixels = np.where(inside[:, None], pixels, 0)
    column, row = np.floor(pixels).astype(np.intp).T
    expected = np.linalg.norm(local, axis=1)
    found = other.distance[row, column]
    sees = lies_on(found, expected, part=_ON_SURFACE)
    # The neighbours towards which the point lies in its pixel.
    right = (column + np.where(pixels[:, 0] - column > 0.5, 1, -1)).clip(0, width - 1)
    below = (row + np.where(pixels[:, 1] - row > 0.5, 1, -1)).clip(0, height - 1)
    with np.errstate(invalid="ignore"):
        for neighbour in (
            other.distance[row, right],
            other.distance[below, right],
            other.distance[below, column],
        ):
            between = (neighbour - expected) * (found - expected) < 0
            sees |= between & (np.abs(neighbour - found) < _SLANTED * expected)
    return column, row, inside & np.where(is_sky, np.isinf(found), sees)


def _axes(
    grid: _Grid,
    rays: Floats,
    samples: _Samples,
    pixels: NDArray[np.intp],
    distance: Floats,
    sigma: Floats,
) -> tuple[Floats, Floats]:
    """Return Gaussians' standard deviations (n, 3), and their axes (n, 3, 3) as columns."""
    half = grid.step / 2
    ray = rays.reshape(-1, 3)[pixels]
    normal = samples.normal.reshape(-1, 3)[pixels].astype(np.float64)
    sides = []
    for right, below in ((half, 0.0), (0.0, half)):
        change = np.nan_to_num(grid.rays(right, below) - grid.rays(-right, -below))
        change = change.reshape(-1, 3)[pixels]
        slope = (change * normal).sum(axis=1) / (ray * normal).sum(axis=1)
        sides.append(distance[:, None] * (change - ray * slope[:, None]))
    thin = _THICKNESS * np.minimum(*(np.linalg.norm(side, axis=1) for side in sides))
    edges = np.stack([*sides, thin[:, None] * normal], axis=-1) * sigma[:, None, None]
    axes, scales, _ = np.linalg.svd(edges)
    axes[np.linalg.det(axes) < 0, :, 0] *= -1
    return np.maximum(scales, 1e-7), axes


def _evenly(side: int, step: float) -> NDArray[np.intp]:
    """Return the middles of even parts of a ``side`` in pixels, each about ``step`` long."""
    count = max(1, round(side / step))
    return ((np.arange(count) + 0.5) * side / count).astype(np.intp)
