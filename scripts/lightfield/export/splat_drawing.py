"""Draws Gaussian splats as trainers do, through any lens, so that they can be compared with views.

The rules are gsplat's: Gaussians are projected linearly at their centres, 0.3 pixel² is added to
their covariance, and they are blended from the nearest to the farthest. Source: gsplat's
cuda/_torch_impl.py and its CUDA kernels.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.compiled import inline, kernel
from lightfield.export.source import Bools
from lightfield.formats.gaussians import GREY, Floats, Gaussians
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear

_NEAREST = 0.01  # m, as in gsplat
_BLUR = 0.3  # pixel²
# Half a step of the numerical derivative, in parts of the distance.
_STEP = 1e-4
# gsplat linearises a perspective projection at most this much beyond the image's edge, in widths.
_BEYOND = 0.15
_HALF = 0.5
# A Gaussian covers at most the first part of a pixel, and is left out below the second. No more is
# added to a pixel before less than the third part passes.
_MOST = 0.999
_LEAST = 1 / 255
_DARK = 1e-4


@dataclass(frozen=True)
class Drawn:
    """A drawn view over black.

    - ``colour``: sRGB-encoded, (h, w, 3).
    - ``coverage``: the part (h, w) of each pixel that Gaussians cover.
    - ``distance``: the distance (h, w) in metres up to which Gaussians cover half of the pixel. inf
      where they never do. A mean would mix a surface with what shows through it.
    """

    colour: Floats
    coverage: Floats
    distance: Floats


@dataclass(frozen=True)
class Projected:
    """The Gaussians that a view may see, from the nearest to the farthest.

    - ``numbers`` (m,): their numbers among all.
    - ``pixels`` (m, 2): their centres in the image.
    - ``covariance`` (m, 2, 2): in pixel².
    - ``shades`` (m, 3): sRGB-encoded colours.
    - ``distance`` (m,): in metres.
    - ``opacities`` (m,): 0 to 1.
    """

    numbers: NDArray[np.intp]
    pixels: Floats
    covariance: Floats
    shades: Floats
    distance: Floats
    opacities: Floats

    def draw(self, height: int, width: int) -> Drawn:
        """Return the image."""
        colour = np.zeros((height, width, 3))
        distance = np.full((height, width), np.inf)
        transmitted = np.ones((height, width))
        _blend(
            self.pixels,
            self.covariance,
            self.shades,
            self.distance,
            self.opacities,
            colour,
            distance,
            transmitted,
            np.zeros((height, width), bool),
        )
        return Drawn(colour, 1 - transmitted, distance)

    def corrections(self, drawn: Drawn, target: Floats, counted: Bools) -> tuple[Floats, Floats]:
        """Return by how much Gaussians should change so that ``drawn`` becomes the ``target``.

        ``target`` (h, w, 4) is a colour over black and a coverage. Only pixels that are ``counted``
        (h, w) matter. The result is two sums (m, 4) over the pixels that a Gaussian covers: of what
        they miss times the derivative by its colour and by its opacity, and of these derivatives'
        absolute values.
        """
        picture = np.dstack([drawn.colour, drawn.coverage])
        shape = counted.shape
        changes = np.zeros((len(self.numbers), 4))
        weights = np.zeros_like(changes)
        _gather(
            self.pixels,
            self.covariance,
            np.column_stack([self.shades, np.ones(len(self.shades))]),
            self.opacities,
            picture,
            target - picture,
            counted,
            np.zeros_like(picture),
            np.ones(shape),
            np.zeros(shape, bool),
            changes,
            weights,
        )
        return changes, weights


def draw(gaussians: Gaussians, view: View, lens: Lens) -> Drawn:
    """Return what a ``view`` shows through a ``lens``."""
    return project(gaussians, view, lens).draw(lens.height, lens.width)


def project(gaussians: Gaussians, view: View, lens: Lens) -> Projected:
    """Return the Gaussians that a ``view`` may see through a ``lens``."""
    local = view.to_camera(gaussians.positions)
    away = np.linalg.norm(local, axis=1)
    along = -local[:, 2] if isinstance(lens, Rectilinear) else away
    visible = np.flatnonzero(along > _NEAREST)
    pixels = lens.pixels(local[visible])
    has_pixel = np.isfinite(pixels[:, 0])
    order = np.argsort(along[visible[has_pixel]], kind="stable")
    pixels = pixels[has_pixel][order]
    visible = visible[has_pixel][order]
    turn = view.world_from_camera[:3, :3].T @ _matrices(gaussians.rotations[visible])
    spread = turn * gaussians.scales[visible][:, np.newaxis]
    footprint = _slopes(lens, local[visible]) @ spread
    covariance = footprint @ footprint.transpose(0, 2, 1)
    covariance[:, 0, 0] += _BLUR
    covariance[:, 1, 1] += _BLUR
    offset = gaussians.positions[visible] - view.world_from_camera[:3, 3]
    shades = _colours(gaussians.harmonics[visible], offset)
    return Projected(
        visible, pixels, covariance, shades, away[visible], gaussians.opacities[visible]
    )


def _matrices(quaternions: Floats) -> Floats:
    """Return the rotations (n, 3, 3) of unit quaternions (n, 4): w, x, y, z."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(np.roll(quaternions, -1, axis=1)).as_matrix())


def _slopes(lens: Lens, local: Floats) -> Floats:
    """Return by how much pixels move per metre (n, 2, 3) at points (n, 3) before the camera."""
    if isinstance(lens, Rectilinear):
        # So that a Gaussian beyond the edge does not fill the image.
        low, high = -_BEYOND * lens.width, (1 + _BEYOND) * lens.width
        pixels = lens.pixels(local)
        pixels[:, 0] = pixels[:, 0].clip(low, high)
        low, high = -_BEYOND * lens.height, (1 + _BEYOND) * lens.height
        pixels[:, 1] = pixels[:, 1].clip(low, high)
        rays = lens.rays(pixels[:, 0], pixels[:, 1])
        local = rays * (local[:, 2:] / rays[:, 2:])
    step = _STEP * np.linalg.norm(local, axis=1)[:, np.newaxis]
    slopes = np.empty((len(local), 2, 3))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slopes[..., axis] = (lens.pixels(local + shift) - lens.pixels(local - shift)) / (2 * step)
    return slopes


def _colours(harmonics: Floats, offset: Floats) -> Floats:
    """Return the colours (n, 3) of Gaussians that are seen along ``offset`` (n, 3)."""
    basis = _basis(offset / np.linalg.norm(offset, axis=1, keepdims=True))
    shades = np.einsum("nk,nkc->nc", basis[:, : harmonics.shape[1]], harmonics)
    colours: Floats = np.maximum(shades + GREY, 0)
    return colours


def _basis(direction: Floats) -> Floats:
    """Return the 16 real spherical harmonics (n, 16) of unit directions (n, 3), up to degree 3.

    With the signs and the order of 3D Gaussian splatting. Source: its utils/sh_utils.py, and Sloan
    2013, "Efficient spherical harmonic evaluation".
    """
    x, y, z = direction.T
    first = math.sqrt(3 / (4 * math.pi))
    second = math.sqrt(15 / (4 * math.pi))
    polar = math.sqrt(5 / (16 * math.pi))
    third = math.sqrt(35 / (32 * math.pi))
    middle = math.sqrt(105 / (4 * math.pi))
    low = math.sqrt(21 / (32 * math.pi))
    axial = math.sqrt(7 / (16 * math.pi))
    return np.stack(
        [
            np.full_like(x, math.sqrt(1 / (4 * math.pi))),
            -first * y,
            first * z,
            -first * x,
            second * x * y,
            -second * y * z,
            polar * (2 * z * z - x * x - y * y),
            -second * x * z,
            second / 2 * (x * x - y * y),
            -third * y * (3 * x * x - y * y),
            middle * x * y * z,
            -low * y * (4 * z * z - x * x - y * y),
            axial * z * (2 * z * z - 3 * x * x - 3 * y * y),
            -low * x * (4 * z * z - x * x - y * y),
            middle / 2 * z * (x * x - y * y),
            -third * x * (x * x - 3 * y * y),
        ],
        axis=1,
    )


@inline
def _box(
    pixel: Array, a: float, c: float, opacity: float, height: int, width: int
) -> tuple[int, int, int, int]:
    """Return the rows and the columns, first and end, that a Gaussian covers.

    ``a`` and ``c`` are its variances along rows and columns.
    """
    # Beyond this many standard deviations, it covers less than 1 / 255.
    reach = math.sqrt(2 * math.log(max(255 * opacity, 1.0)))
    return (
        max(0, math.floor(pixel[1] - reach * math.sqrt(c))),
        min(height, math.ceil(pixel[1] + reach * math.sqrt(c))),
        max(0, math.floor(pixel[0] - reach * math.sqrt(a))),
        min(width, math.ceil(pixel[0] + reach * math.sqrt(a))),
    )


@inline
def _falloff(u: float, v: float, covariance: Array) -> Any:
    """Return by how much a Gaussian is fainter at (u, v) from its centre, 0 to 1."""
    a = covariance[0, 0]
    b = covariance[0, 1]
    c = covariance[1, 1]
    return math.exp(-(c * u * u - 2 * b * u * v + a * v * v) / (a * c - b * b) / 2)


@inline
def _part(opacity: float, i: int, j: int, transmitted: Array, opaque: Array) -> float:
    """Return the part of pixel (i, j) that a Gaussian of this ``opacity`` there covers.

    It is 0 if the pixel takes no more of it. Notes whether the pixel is then ``opaque``.
    """
    alpha = min(_MOST, opacity)
    if opaque[i, j] or alpha < _LEAST:
        alpha = 0.0
    elif transmitted[i, j] * (1 - alpha) <= _DARK:
        opaque[i, j] = True
        alpha = 0.0
    return alpha


@kernel
def _blend(
    pixels: Array,
    covariance: Array,
    shades: Array,
    away: Array,
    opacities: Array,
    colour: Array,
    distance: Array,
    transmitted: Array,
    opaque: Array,
) -> None:
    """Add the ``shades`` (n, 3) of Gaussians to ``colour`` (h, w, 3), from the nearest on.

    ``transmitted`` (h, w) is the part of the light that passes through. A pixel is ``opaque``
    (h, w) before less than 1e-4 passes. A Gaussian is left out where it covers less than 1 / 255.
    """
    height, width = transmitted.shape
    for n in range(len(pixels)):
        a = covariance[n, 0, 0]
        c = covariance[n, 1, 1]
        if not a * c - covariance[n, 0, 1] ** 2 > 0:
            continue
        top, bottom, left, right = _box(pixels[n], a, c, opacities[n], height, width)
        for i in range(top, bottom):
            for j in range(left, right):
                falloff = _falloff(j + 0.5 - pixels[n, 0], i + 0.5 - pixels[n, 1], covariance[n])
                alpha = _part(opacities[n] * falloff, i, j, transmitted, opaque)
                if alpha == 0:
                    continue
                for k in range(3):
                    colour[i, j, k] += alpha * transmitted[i, j] * shades[n, k]
                rest = transmitted[i, j] * (1 - alpha)
                if transmitted[i, j] > _HALF >= rest:
                    distance[i, j] = away[n]
                transmitted[i, j] = rest


@kernel
def _gather(
    pixels: Array,
    covariance: Array,
    shades: Array,
    opacities: Array,
    picture: Array,
    missing: Array,
    counted: Array,
    passed: Array,
    transmitted: Array,
    opaque: Array,
    changes: Array,
    weights: Array,
) -> None:
    """Add to each Gaussian's ``changes`` (n, 4) what the pixels that it covers are ``missing``.

    - ``picture``: what `_blend` drew, (h, w, 4), with the coverage last. ``shades`` (n, 4) end
      with 1.
    - ``missing``: what to add to the picture, (h, w, 4), in the pixels that are ``counted`` (h, w).
    - ``passed`` (h, w, 4) is the sum of the nearer Gaussians.
    - ``changes`` and ``weights``, (n, 4), are sums over the pixels: of what they miss, by how much
      the Gaussian's colour matters there. Last come the sums for its opacity, by the derivative.
    """
    height, width = transmitted.shape
    for n in range(len(pixels)):
        a = covariance[n, 0, 0]
        c = covariance[n, 1, 1]
        if not a * c - covariance[n, 0, 1] ** 2 > 0:
            continue
        top, bottom, left, right = _box(pixels[n], a, c, opacities[n], height, width)
        for i in range(top, bottom):
            for j in range(left, right):
                falloff = _falloff(j + 0.5 - pixels[n, 0], i + 0.5 - pixels[n, 1], covariance[n])
                alpha = _part(opacities[n] * falloff, i, j, transmitted, opaque)
                if alpha == 0:
                    continue
                share = alpha * transmitted[i, j]
                for k in range(4):
                    passed[i, j, k] += share * shades[n, k]
                    if not counted[i, j]:
                        continue
                    # Before what lies behind, it adds its own colour and takes theirs.
                    behind = (picture[i, j, k] - passed[i, j, k]) / (1 - alpha)
                    slope = falloff * (transmitted[i, j] * shades[n, k] - behind)
                    changes[n, 3] += slope * missing[i, j, k]
                    weights[n, 3] += abs(slope)
                    if k < 3:
                        changes[n, k] += share * missing[i, j, k]
                        weights[n, k] += share
                transmitted[i, j] *= 1 - alpha
