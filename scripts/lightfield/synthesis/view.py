"""A view from anywhere: the surfaces that the best of a dataset's views see, drawn and blended.

Each of the chosen views is drawn as a surface that is torn where depth jumps. At each of 2 × 2
samples a pixel, the views are blended by angle and distance, as in Buehler et al. 2001,
"Unstructured Lumigraph Rendering". Pixels that no view sees are marked, and filled with what is
around and behind them (push-pull: Gortler et al. 1996, "The Lumigraph").
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_cdt

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import View
from lightfield.export.source import SourceDataset, pixel_indices
from lightfield.geometry.depth import z_from_distance
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.imaging import images
from lightfield.synthesis import kernels
from lightfield.synthesis.defaults import BEST

# A view is chosen by how well it sees points in so many directions across and down the picture, at
# two distances that are typical of the scene.
DIRECTIONS = 12
# Of a source's penalty: the weight of its distance from the surface beside that of its angle.
DISTANCE = 0.1
# An angle in radians that is as good as none.
SHARP = 0.05
# The tangent of the angle of incidence beyond which neighbours are taken for different surfaces.
STEEPEST = 6.0
# Vertices beside a tear have the colour of two surfaces: they count less, and most where nothing
# else is.
TORN_WEIGHT = 0.1
# Towards its edge, over so many pixels, a view counts less and less: its edge is not seen.
RIM = 12
# So much of a colour's difference from its neighbours is added to it: interpolation takes it away.
SHARPENED = 0.7
# Samples across and down a pixel.
SAMPLES = 2


@dataclass(frozen=True)
class Synthesised:
    """A picture: linear ``colour`` (h, w, 3); ``distance`` (h, w) in metres, inf where nothing was
    hit, NaN in holes; ``holes`` (h, w), which pixels no view sees, or the lens does not.

    Holes that the lens sees have the colour of what is around and behind them, or are black; others
    are NaN. If no view sees anything, all are black.
    """

    colour: Array
    distance: Array
    holes: Array

    def hole_fraction(self, rays: Array) -> float:
        """Return the part of the lens's ``rays`` (h, w, 3) that no view sees."""
        return float(self.holes[np.isfinite(rays[..., 0])].mean())

    def channels(self, depth: str, rays: Array) -> dict[str, Array]:
        """Return R, G, B, A and Z, which is "z" or "distance", as an EXR has them."""
        with np.errstate(over="ignore"):
            colour = np.nan_to_num(self.colour.clip(max=images.HALF_MAX)).astype(np.float16)
        distance = z_from_distance(self.distance, rays) if depth == "z" else self.distance
        named = dict(zip("RGB", np.moveaxis(colour, -1, 0), strict=True))
        return named | {"A": (~self.holes).astype(np.float16), "Z": distance.astype(np.float32)}


@dataclass(frozen=True)
class Surface:
    """A view as it is drawn: ``inverse`` distance (h, w), the ``root`` of colour (h, w, 3), and
    ``certainty`` (h, w), how much each vertex counts.

    ``right`` and ``down`` (h, w) are where neighbours are of one surface. The vertices ``torn``
    (h, w) have one that is not; ``corners`` (n, 4, 3) are the rays of their pixels' corners.
    """

    inverse: Array
    root: Array
    certainty: Array
    right: Array
    down: Array
    torn: Array
    corners: Array


Reader = Callable[[View], tuple[Array, Array]]


def reader(source: SourceDataset) -> Reader:
    """Return what reads views of a dataset for `Sources`; raises `UserError` without depth."""
    if source.lightfield.depth is None:
        raise UserError(f"{source.lightfield.path}: depth: is null; a synthesis needs it")

    def read(view: View) -> tuple[Array, Array]:
        colour = images.read_image(source.path(view), "RGB").colour
        return colour, source.depth(view, "distance")

    return read


class Sources:
    """The ``views`` that pictures are made of, through one ``lens``; ``most`` are held in memory.

    ``read`` returns a view's linear colour (h, w, 3), and its distances (h, w) in metres. Holes are
    black unless ``fills_holes``: what views without a background do not see is most often nothing.
    """

    def __init__(
        self,
        lens: Lens,
        views: Sequence[View],
        read: Reader,
        *,
        fills_holes: bool = True,
        most: int = 2 * BEST,
    ) -> None:
        self.lens = lens
        self.views = views
        self.read = read
        self.fills_holes = fills_holes
        self.most = most
        self.matrices: Array = np.array([view.matrix for view in views])
        self._held: OrderedDict[int, Surface] = OrderedDict()

    @cached_property
    def rays(self) -> Array:
        return self.lens.pixel_rays().astype(np.float32)

    @cached_property
    def distances(self) -> Array:
        """Those that are typical of what some of the views see."""
        some = range(0, len(self.views), max(1, len(self.views) // 4))
        return typical(np.concatenate([self.surface(index).inverse.ravel() for index in some]))

    def surface(self, index: int) -> Surface:
        """Return a view as a surface, from memory if it was one of the last."""
        if index not in self._held:
            self._held[index] = self._surface(*self.read(self.views[index]))
            if len(self._held) > self.most:
                self._held.popitem(last=False)
        self._held.move_to_end(index)
        return self._held[index]

    def _surface(self, colour: Array, distance: Array) -> Surface:
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(distance > 0, 1 / distance, np.nan).astype(np.float32)
        inverse[~np.isfinite(colour).all(axis=-1)] = np.nan
        right = np.empty(inverse.shape, bool)
        down = np.empty(inverse.shape, bool)
        kernels.link(inverse, steepest(self.lens), right, down)
        torn = np.isfinite(inverse) & ~_is_amid(right, down)
        certainty = np.where(torn, TORN_WEIGHT, 1) * self._to_rim
        root = np.sqrt(np.nan_to_num(colour).clip(min=0)).astype(np.float32)
        sharp = np.empty_like(root)
        kernels.sharpen(root, right, down, np.float32(SHARPENED), sharp)
        # Sharpened, the mixed colours beside a tear would be farther from those of their surface.
        sharp[torn] = root[torn]
        row, column = np.nonzero(torn)
        corners = self.lens.rays(
            column[:, None] + np.array([0.0, 1, 1, 0]), row[:, None] + np.array([0.0, 0, 1, 1])
        )
        corners = corners.astype(np.float32)
        return Surface(inverse, sharp, certainty.astype(np.float32), right, down, torn, corners)

    @cached_property
    def _to_rim(self) -> Array:
        return to_rim(self.lens)

    def best(self, target: Array, lens: Lens, count: int) -> list[int]:
        """Return the ``count`` views that together see best what a ``target`` (4, 4) looks at.

        One after the other is taken that adds most to the sum over all directions, by a logarithm
        of what the views taken so far are worth there: to see all directions counts for more than
        to see some of them perfectly.
        """
        x = (np.arange(DIRECTIONS) + 0.5) * lens.width / DIRECTIONS
        y = (np.arange(DIRECTIONS) + 0.5) * lens.height / DIRECTIONS
        rays = lens.rays(x[None, :], y[:, None]).reshape(-1, 3)
        rays = rays[np.isfinite(rays[:, 0])] @ target[:3, :3].T
        away = np.concatenate([distance * rays for distance in self.distances])
        points = target[:3, 3] + away
        quality = np.zeros((len(self.views), len(points)))
        for index, matrix in enumerate(self.matrices):
            offset = points - matrix[:3, 3]
            _, _, seen = pixel_indices(self.lens, offset @ matrix[:3, :3])
            quality[index] = np.where(seen, 1 / penalty(away, offset), 0)
        chosen: list[int] = []
        worth = np.zeros(len(points))
        for _ in range(min(count, len(self.views))):
            gains = np.log1p(worth + quality).sum(axis=1)
            gains[chosen] = -1
            chosen.append(int(np.argmax(gains)))
            worth += quality[chosen[-1]]
        return chosen

    def synthesise(self, target: Array, lens: Lens, count: int = BEST) -> Synthesised:
        """Return the picture of a camera at ``target`` (4, 4), made of the ``count`` best views."""
        return self.blended(target, lens, self.best(target, lens, count))

    def blended(self, target: Array, lens: Lens, chosen: Sequence[int]) -> Synthesised:
        """Return the picture of a camera at ``target`` (4, 4), made of the ``chosen`` views."""
        fine = lens.resized(SAMPLES * lens.width, SAMPLES * lens.height)
        shape = (len(chosen), fine.height, fine.width)
        inverses = np.full(shape, -1, np.float32)
        drawn = np.zeros((*shape, 4), np.float32)
        for place, index in enumerate(chosen):
            surface = self.surface(index)
            self._draw(surface, self.matrices[index], target, fine, inverses[place], drawn[place])
        colour = np.empty((lens.height, lens.width, 3), np.float32)
        inverse = np.empty((lens.height, lens.width), np.float32)
        seen = np.empty((lens.height, lens.width), np.float32)
        kernels.blend(inverses, drawn, colour, inverse, seen)
        outside = np.isnan(lens.pixel_rays()[..., 0])
        seen[outside] = 0
        holes = seen == 0
        inverse[holes] = np.nan
        with np.errstate(divide="ignore"):
            distance = 1 / inverse
        if self.fills_holes:
            fill(colour, inverse, (~holes).astype(np.float32), _wraps(lens))
        else:
            colour[holes] = 0
        colour[outside] = np.nan
        return Synthesised(colour, distance, holes)

    def _draw(
        self,
        surface: Surface,
        here: Array,
        target: Array,
        lens: Lens,
        inverse: Array,
        drawn: Array,
    ) -> None:
        """Draw what a view ``here`` (4, 4) sees; ``inverse`` and ``drawn`` as in `kernels.draw`."""
        wraps = _wraps(lens)
        pixels, seen = self._projected(self.rays, surface.inverse, here, target, lens)
        length = np.linalg.norm(seen, axis=-1)
        worth = 1 / penalty(seen, self.rays @ _turn(here)) ** 2
        values = np.dstack([surface.inverse / length, surface.root, surface.certainty, worth])
        values = values.astype(np.float32, copy=False)
        kernels.draw(pixels, values, surface.right, surface.down, wraps, inverse, drawn)
        corners, _ = self._projected(
            surface.corners, surface.inverse[surface.torn][:, None], here, target, lens
        )
        kernels.draw_pixels(corners, values[surface.torn], wraps, inverse, drawn)

    def _projected(
        self, rays: Array, inverse: Array, here: Array, target: Array, lens: Lens
    ) -> tuple[Array, Array]:
        """Return the pixels (..., 2) of points at 1 / ``inverse`` (...) along ``rays`` (..., 3).

        And the points as the target sees them, in units of their distances ``here``, so that
        infinity is a number as any.
        """
        offset = (here[:3, 3] - target[:3, 3]).astype(np.float32)
        seen = rays @ _turn(here) + inverse[..., None] * offset
        pixels: Array = lens.pixels(seen @ _turn(target).T)
        return pixels.astype(np.float32, copy=False), seen


def fill(colour: Array, inverse: Array, seen: Array, wraps: bool) -> None:
    """Fill pixels of which only a part, or nothing, is ``seen`` (h, w) from coarser levels.

    ``colour`` (h, w, 3) and ``inverse`` (h, w), the inverse distance, are filled in place. Source:
    Gortler et al. 1996, section 3.4; what is behind a hole's edge counts more than what is before.
    """
    if (seen >= 1).all():
        return
    if seen.size == 1:
        colour[seen == 0] = inverse[seen == 0] = 0
        return
    shape = tuple(-(-side // 2) for side in seen.shape)
    small, small_inverse = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32)
    small_seen = np.zeros(shape, np.float32)
    kernels.shrink(colour, inverse, seen, small, small_inverse, small_seen)
    fill(small, small_inverse, small_seen, wraps)
    kernels.enlarge(small, small_inverse, wraps, colour, inverse, seen)


def typical(inverse: Array) -> Array:
    """Return two distances in metres: a quarter and three quarters of ``inverse`` are nearer."""
    distances: Array = 1 / np.maximum(np.nanpercentile(inverse, [75, 25]), 1e-4)
    return distances


def _turn(matrix: Array) -> Array:
    """Return what turns a camera's vectors (..., 3), as rows, into the world's."""
    return np.asarray(matrix[:3, :3].T, np.float32)


def to_rim(lens: Lens) -> Array:
    """Return how far each pixel (h, w) is from the edge of what a lens sees: 0 to 1, in `RIM`."""
    seen = np.pad(np.isfinite(lens.pixel_rays()[..., 0]), 1, constant_values=_wraps(lens))
    pixels: Array = (
        distance_transform_cdt(seen)[1:-1, 1:-1]
        if not seen.all()
        else np.full((lens.height, lens.width), RIM)
    )
    return (pixels / RIM).clip(max=1)


def pixel_angle(lens: Lens) -> float:
    """Return the angle in radians between the rays of two pixels in the middle of a picture."""
    here, there = lens.rays(lens.center[0] + np.array([0.0, 1.0]), np.array(lens.center[1]))
    return float(2 * np.arcsin(np.linalg.norm(there - here) / 2))


def steepest(lens: Lens) -> np.float32:
    """Return the part by which a surface's distances may differ from one pixel to the next."""
    return np.float32(STEEPEST * pixel_angle(lens))


def penalty(seen: Array, source: Array) -> Array:
    """Return how unlike (...) a point looks from a source that sees it along ``source`` (..., 3).

    ``seen`` (..., 3) is from the target's camera to the point, in the same unit.
    """
    here = np.linalg.norm(seen, axis=-1)
    there = np.linalg.norm(source, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.linalg.norm(seen / here[..., None] - source / there[..., None], axis=-1)
        farther: Array = np.maximum(there / here - 1, 0)
    unlike: Array = angle + DISTANCE * farther + SHARP
    return unlike


def _wraps(lens: Lens) -> bool:
    """Whether the left edge of a lens's picture continues its right one."""
    return isinstance(lens, Equirectangular) and lens.is_full


def _is_amid(right: Array, down: Array) -> Array:
    """Return which vertices (h, w) have all triangles around them that the picture has room for.

    A triangle is there where its corner at the right angle is of one surface with the other two.
    """
    upper = right[:-1, :-1] & down[:-1, :-1]
    lower = right[1:, :-1] & down[:-1, 1:]
    whole = np.ones(right.shape, bool)
    whole[:-1, :-1] &= upper
    whole[:-1, 1:] &= upper & lower
    whole[1:, :-1] &= upper & lower
    whole[1:, 1:] &= lower
    return whole
