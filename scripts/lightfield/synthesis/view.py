"""Synthesises a view from anywhere: draws the surfaces of the best views, and blends them.

Each chosen view is drawn as a surface that is torn where depth jumps. The drawings are blended by
angle and distance, at 2 × 2 samples a pixel, as in Buehler et al. 2001, "Unstructured Lumigraph
Rendering". Pixels that no view sees are marked as holes. They are filled from their surroundings,
mostly from the background (push-pull: Gortler et al. 1996, "The Lumigraph").
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_cdt

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import View
from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.visibility import pixel_indices
from lightfield.imaging import images
from lightfield.reading.dataset import OpenDataset
from lightfield.stages.synthesis import BEST
from lightfield.synthesis import apparent, kernels

# Views are chosen by how well they see points at two distances that are typical of the scene. The
# points lie in this many directions across and down the picture. In one of 90° they are 7.5° apart,
# about as far as neighbours among 642 views on a sphere.
DIRECTIONS = 12
# Neighbours count as different surfaces beyond the angle of incidence with this tangent, 80.5°. So
# steep a surface shows a sixth of the pixels that it would show from the front. Half brings
# 0.001 dB and takes 0.001 of SSIM, and double takes 0.007 dB: see `kernels` for the scene.
_STEEPEST = 6.0
# Vertices beside a tear may mix the colours of two surfaces, so they have this certainty. A quarter
# with splats was better than a sixth without, by 0.1, 0 and 0.2 dB: PSNR of held-out views of the
# garden, the barbershop and the courtyard.
TORN_WEIGHT = 0.25
# From another place, a mirror shows a reflection elsewhere. A reflection that is drawn unmoved
# counts this much, so that it hardly shows beside one that is drawn moved. Half takes 0.003 dB, and
# double brings as much: see `kernels` for the scene. A mirror shows more of it.
UNMOVED_WEIGHT = 0.1
# A view's certainty falls over this many pixels towards its edge, so that the edge does not show.
# Chosen by eye, for views of 256 pixels. Half brings 0.015 dB, and double takes 0.029 dB.
RIM = 12
# Sharpens a view's colours by this amount, because interpolation will blur them. Interpolating and
# sharpening roots brought 0.1 dB in the garden.
SHARPENED = 0.8
# Samples across and down a pixel. Two brought 0.4 dB, and four would add at most 0.05 dB.
SAMPLES = 2


@dataclass(frozen=True)
class Synthesised:
    """A synthesised picture.

    - ``colour`` (h, w, 3): linear. Holes that the lens sees are filled or black, others are NaN. If
      no view sees anything, all are black.
    - ``distance`` (h, w): in metres, inf where nothing was hit, NaN in holes.
    - ``holes`` (h, w): the pixels that no view sees, or that the lens does not see.
    """

    colour: Array
    distance: Array
    holes: Array

    def hole_fraction(self, rays: Array) -> float:
        """Return the part of the lens's ``rays`` (h, w, 3) that no view sees."""
        return float(self.holes[np.isfinite(rays[..., 0])].mean())

    def channels(self, depth: str, rays: Array) -> dict[str, Array]:
        """Return an EXR's channels R, G, B, A and Z. ``depth``, "z" or "distance", is Z's kind."""
        with np.errstate(over="ignore"):
            colour = np.nan_to_num(self.colour.clip(max=images.HALF_MAX)).astype(np.float16)
        z = converted(self.distance, rays, "distance", depth)
        channels = dict(zip("RGB", np.moveaxis(colour, -1, 0), strict=True))
        return channels | {"A": (~self.holes).astype(np.float16), "Z": z.astype(np.float32)}


@dataclass(frozen=True)
class ViewSurface:
    """A view as a surface with a vertex for each pixel.

    - ``inverse`` (h, w): 1 / distance.
    - ``shade`` (h, w, 4): the sharpened root of the colour, and how much each vertex counts.
    - ``right``, ``down`` (h, w): whether the right and the lower neighbour are on the same surface.
    - ``torn`` (h, w): the vertices beside a tear.
    - ``corners`` (n, 4, 3): the rays of the corners of the n torn pixels.
    - ``mirror`` (h, w): the vertices that show a reflection, or something behind glass.
    - ``seeming`` (h, w): like ``inverse``, but reflections are as far away as they seem to be.
    """

    inverse: Array
    shade: Array
    right: Array
    down: Array
    torn: Array
    corners: Array
    mirror: Array
    seeming: Array


Reader = Callable[[View], tuple[Array, Array]]


def reader(source: OpenDataset) -> Reader:
    """Return the function that reads a dataset's views for `Sources`.

    Raises `UserError` if the dataset has no depth.
    """
    if source.depth is None:
        raise UserError(f"{source.lightfield.path}: depth: is null; a synthesis needs it")

    def read(view: View) -> tuple[Array, Array]:
        opened = source.views[view.name]
        return opened.rgb, opened.depth_as("distance")

    return read


class Sources:
    """The ``views`` that pictures are made of, all with the same ``lens``.

    ``read`` returns a view's linear colour (h, w, 3), and its distances (h, w) in metres. At most
    ``most`` views stay in memory. Without ``fills_holes`` holes stay black. That suits views
    without a background, which have nothing in most holes.
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
        self.world_from_cameras: Array = np.array([view.world_from_camera for view in views])
        self._held: OrderedDict[int, ViewSurface] = OrderedDict()
        self._pictures: OrderedDict[int, apparent.Picture] = OrderedDict()
        self._latest_layers: tuple[Array, Array] | None = None

    @cached_property
    def rays(self) -> Array:
        """The rays (h, w, 3) of the lens's pixels."""
        return self.lens.pixel_rays().astype(np.float32)

    @cached_property
    def distances(self) -> Array:
        """Two distances in metres that are typical of the scene, from some of the views."""
        sample = range(0, len(self.views), max(1, len(self.views) // 4))
        return typical(np.concatenate([self._picture(index).inverse.ravel() for index in sample]))

    def surface(self, index: int) -> ViewSurface:
        """Return a view as a surface. Keeps the latest views in memory."""
        if index not in self._held:
            self._held[index] = self._surface(index, *self.read(self.views[index]))
            if len(self._held) > self.most:
                self._held.popitem(last=False)
        self._held.move_to_end(index)
        return self._held[index]

    def _picture(self, index: int) -> apparent.Picture:
        """Return a view as a small picture. Keeps the latest ones in memory."""
        if index not in self._pictures:
            colour, distance = self.read(self.views[index])
            self._pictures[index] = apparent.picture(
                colour, distance, self.world_from_cameras[index]
            )
            if len(self._pictures) > self.most * apparent.NEIGHBOURS:
                self._pictures.popitem(last=False)
        self._pictures.move_to_end(index)
        return self._pictures[index]

    def _steps(self, index: int) -> Array:
        """Return how much farther away a view's pixels (h, w) seem, as `apparent.farther` does."""
        others = [
            self._picture(other) for other in apparent.neighbours(self.world_from_cameras, index)
        ]
        return farther(self._picture(index), others, self.lens)

    def _surface(self, index: int, colour: Array, distance: Array) -> ViewSurface:
        inverse = apparent.inverse_of(colour, distance)
        right, down, torn = _links(inverse, self.lens)
        steps = self._steps(index)
        root = np.sqrt(np.nan_to_num(colour).clip(min=0)).astype(np.float32)
        sharp = np.empty_like(root)
        kernels.sharpen(root, right, down, np.float32(SHARPENED), sharp)
        # Sharpening would move the mixed colours beside a tear away from the colours of their
        # surface.
        sharp[torn] = root[torn]
        row, column = np.nonzero(torn)
        corners = self.lens.rays(
            column[:, None] + np.array([0.0, 1, 1, 0]), row[:, None] + np.array([0.0, 0, 1, 1])
        )
        corners = corners.astype(np.float32)
        certainty = np.where(torn, TORN_WEIGHT, 1) * self._to_rim
        shade = np.dstack([sharp, certainty]).astype(np.float32)
        seeming = inverse * apparent.factors(steps)
        return ViewSurface(inverse, shade, right, down, torn, corners, steps > 0, seeming)

    @cached_property
    def _to_rim(self) -> Array:
        return to_rim(self.lens)

    def best(self, target: Array, lens: Lens, count: int) -> list[int]:
        """Return the ``count`` views that together best see the scene of a ``target`` (4, 4).

        Repeatedly takes the view that adds most. The gain is summed over all directions. It is the
        logarithm of what the views taken so far are worth there. So seeing all directions counts
        more than seeing some of them perfectly.
        """
        x = (np.arange(DIRECTIONS) + 0.5) * lens.width / DIRECTIONS
        y = (np.arange(DIRECTIONS) + 0.5) * lens.height / DIRECTIONS
        rays = lens.rays(x[None, :], y[:, None]).reshape(-1, 3)
        rays = rays[np.isfinite(rays[:, 0])] @ target[:3, :3].T
        away = np.concatenate([distance * rays for distance in self.distances])
        points = target[:3, 3] + away
        quality = np.zeros((len(self.views), len(points)))
        for index, world_from_camera in enumerate(self.world_from_cameras):
            offset = points - world_from_camera[:3, 3]
            _, _, is_seen = pixel_indices(self.lens, offset @ world_from_camera[:3, :3])
            kernels.qualities(away, offset, is_seen, quality[index])
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
        least_cosine = _least_cosine(fine)
        inverses, drawn = self._layers((len(chosen), fine.height, fine.width))
        for place, index in enumerate(chosen):
            self._draw(index, target, fine, least_cosine, inverses[place], drawn[place])
        colour = np.empty((lens.height, lens.width, 3), np.float32)
        inverse = np.empty((lens.height, lens.width), np.float32)
        coverage = np.empty((lens.height, lens.width), np.float32)
        kernels.blend(inverses, drawn, colour, inverse, coverage)
        outside = np.isnan(lens.pixel_rays()[..., 0])
        coverage[outside] = 0
        holes = coverage == 0
        inverse[holes] = np.nan
        with np.errstate(divide="ignore"):
            distance = 1 / inverse
        if self.fills_holes:
            fill(colour, inverse, (~holes).astype(np.float32), _wraps(lens))
        else:
            colour[holes] = 0
        colour[outside] = np.nan
        return Synthesised(colour, distance, holes)

    def _layers(self, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Return empty arrays for `kernels.draw` of this ``shape`` (n, h, w).

        The latest ones are used again, because fresh memory takes as long as a drawing.
        """
        if self._latest_layers is None or self._latest_layers[0].shape != shape:
            self._latest_layers = np.empty(shape, np.float32), np.empty((*shape, 4), np.float32)
        inverses, drawn = self._latest_layers
        inverses.fill(-1)
        return inverses, drawn

    def _draw(
        self,
        index: int,
        target: Array,
        lens: Lens,
        least_cosine: np.float32,
        inverse: Array,
        drawn: Array,
    ) -> None:
        """Draw a view's surface as seen from ``target`` (4, 4).

        ``least_cosine`` is the value of `_least_cosine`. Writes ``inverse`` and ``drawn`` as
        `kernels.draw` does.
        """
        surface = self.surface(index)
        here = self.world_from_cameras[index]
        wraps = _wraps(lens)
        turns = np.stack([_turn(here), target[:3, :3].astype(np.float32)])
        offset = (here[:3, 3] - target[:3, 3]).astype(np.float32)

        def placed(rays: Array, inverse: Array, shade: Array, counts: Array) -> tuple[Array, Array]:
            seen = np.empty((inverse.size, 3), np.float32)
            values = np.empty((inverse.size, 6), np.float32)
            kernels.look(rays, inverse, shade, counts, turns, offset, least_cosine, seen, values)
            is_near = np.isfinite(seen[:, 0])
            points = np.full((inverse.size, 2), np.nan, np.float32)
            points[is_near] = lens.pixels(seen[is_near])
            return points, values

        rays, shade = self.rays.reshape(-1, 3), surface.shade.reshape(-1, 4)
        true = surface.inverse.ravel()
        counts = np.where(surface.mirror, UNMOVED_WEIGHT, 1).astype(np.float32).ravel()
        vertices = placed(rays, true, shade, counts)
        kernels.draw(*vertices, surface.right, surface.down, wraps, inverse, drawn)
        # Each pixel beside a tear is as far away everywhere as in its middle.
        torn = np.repeat(np.flatnonzero(surface.torn), 4)
        corners = placed(surface.corners.reshape(-1, 3), true[torn], shade[torn], counts[torn])
        pixels = np.argwhere(surface.torn)
        kernels.draw_splats(*corners, wraps, pixels, surface.inverse, surface.shade, inverse, drawn)
        if surface.mirror.any():
            links = _mirror_links(surface)
            mirrors = np.full(inverse.shape, -1, np.float32)
            kernels.draw(*vertices, *links, wraps, mirrors, np.empty_like(drawn))
            is_shown = (mirrors >= 0) & (mirrors == inverse)
            # A reflection is drawn only on the mirror. Nothing is nearer than infinitely near.
            seeming = np.where(is_shown, -1, np.inf).astype(np.float32)
            reflections = placed(rays, surface.seeming.ravel(), shade, np.ones_like(counts))
            kernels.draw(*reflections, *links, wraps, seeming, drawn)


def fill(colour: Array, inverse: Array, coverage: Array, wraps: bool) -> None:
    """Fill pixels with ``coverage`` (h, w) below 1 from coarser levels.

    Fills ``colour`` (h, w, 3) and ``inverse`` (h, w), the inverse distance, in place. Source:
    Gortler et al. 1996, section 3.4. Unlike there, the background counts more than the foreground.
    """
    if (coverage >= 1).all():
        return
    if coverage.size == 1:
        colour[coverage == 0] = inverse[coverage == 0] = 0
        return
    shape = tuple(-(-side // 2) for side in coverage.shape)
    small, small_inverse = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32)
    small_coverage = np.zeros(shape, np.float32)
    kernels.shrink(colour, inverse, coverage, small, small_inverse, small_coverage)
    fill(small, small_inverse, small_coverage, wraps)
    kernels.enlarge(small, small_inverse, wraps, colour, inverse, coverage)


def farther(here: apparent.Picture, others: Sequence[apparent.Picture], lens: Lens) -> Array:
    """Return `apparent.farther` of a view's pixels (h, w). ``lens`` is the lens of whole views."""
    height, width = here.inverse.shape
    small = lens if (lens.width, lens.height) == (width, height) else lens.resized(width, height)
    steps = apparent.farther(here, others, small, _links(here.inverse, small)[2])
    row = np.arange(lens.height) * height // lens.height
    column = np.arange(lens.width) * width // lens.width
    enlarged: Array = steps[np.ix_(row, column)]
    return enlarged


def seeming_farther(
    lens: Lens, colours: Array, distances: Array, world_from_cameras: Array
) -> Array:
    """Return `apparent.farther` of the pixels (n, h, w) of all views of a ``lens``.

    ``colours`` (n, h, w, 3) are linear, ``distances`` (n, h, w) in metres.
    """
    shown = [
        apparent.picture(*view) for view in zip(colours, distances, world_from_cameras, strict=True)
    ]
    return np.stack(
        [
            farther(
                picture, [shown[n] for n in apparent.neighbours(world_from_cameras, index)], lens
            )
            for index, picture in enumerate(shown)
        ]
    )


def _mirror_links(surface: ViewSurface) -> tuple[Array, Array]:
    """Return which vertices (h, w) of mirrors share a surface with their right and lower one."""
    mirror = surface.mirror
    right = surface.right & mirror
    down = surface.down & mirror
    right[:, :-1] &= mirror[:, 1:]
    down[:-1] &= mirror[1:]
    return right, down


def _links(inverse: Array, lens: Lens) -> tuple[Array, Array, Array]:
    """Return which pixels (h, w) share a surface with their right and lower one, or are torn."""
    right = np.empty(inverse.shape, bool)
    down = np.empty(inverse.shape, bool)
    kernels.link(inverse, steepest(lens), right, down)
    return right, down, _torn(inverse, right, down)


def _torn(inverse: Array, right: Array, down: Array) -> Array:
    torn: Array = np.isfinite(inverse) & ~_has_all_triangles(right, down)
    return torn


def typical(inverse: Array) -> Array:
    """Return the two distances in metres at the upper and the lower quartile of ``inverse``."""
    distances: Array = 1 / np.maximum(np.nanpercentile(inverse, [75, 25]), 1e-4)
    return distances


def _turn(world_from_camera: Array) -> Array:
    """Return the matrix (3, 3) that turns a camera's row vectors into world vectors."""
    return np.asarray(world_from_camera[:3, :3].T, np.float32)


def to_rim(lens: Lens) -> Array:
    """Return each pixel's distance (h, w) from the image circle's edge, in `RIM`, at most 1."""
    is_seen = np.pad(np.isfinite(lens.pixel_rays()[..., 0]), 1, constant_values=_wraps(lens))
    pixels: Array = (
        distance_transform_cdt(is_seen)[1:-1, 1:-1]
        if not is_seen.all()
        else np.full((lens.height, lens.width), RIM)
    )
    return (pixels / RIM).clip(max=1)


def pixel_angle(lens: Lens) -> float:
    """Return the angle in radians between the rays of two pixels in the middle of a picture."""
    here, there = lens.rays(lens.center[0] + np.array([0.0, 1.0]), np.array(lens.center[1]))
    return float(2 * np.arcsin(np.linalg.norm(there - here) / 2))


def steepest(lens: Lens) -> np.float32:
    """Return the part by which a surface's distances may differ from one pixel to the next."""
    return np.float32(_STEEPEST * pixel_angle(lens))


def _least_cosine(lens: Lens) -> np.float32:
    """Return the cosine of the largest angle from the lens's axis at which vertices can matter.

    `kernels.draw` draws no triangle that reaches farther than LARGEST beyond the picture.
    """
    beyond = float(kernels.LARGEST)
    steps = np.linspace(-beyond, 1 + beyond, 33)
    x, y = np.meshgrid(lens.width * steps, lens.height * steps)
    cosine = -lens.rays(x, y)[..., 2]
    return np.float32(cosine.min() - 1e-3 if np.isfinite(cosine).all() else -1)


def _wraps(lens: Lens) -> bool:
    """Return whether the left edge of a lens's picture continues its right one."""
    return isinstance(lens, Equirectangular) and lens.is_full


def _has_all_triangles(right: Array, down: Array) -> Array:
    """Return which vertices (h, w) have all the triangles around them that fit into the picture.

    A triangle is drawn if its corner at the right angle shares a surface with the other two.
    """
    upper = right[:-1, :-1] & down[:-1, :-1]
    lower = right[1:, :-1] & down[:-1, 1:]
    complete = np.ones(right.shape, bool)
    complete[:-1, :-1] &= upper
    complete[:-1, 1:] &= upper & lower
    complete[1:, :-1] &= upper & lower
    complete[1:, 1:] &= lower
    return complete
