"""Draws Gaussian splats as trainers do, through any lens, so that they can be compared with views.

The rules are gsplat's: Gaussians are projected linearly at their centres, 0.3 pixel² is added to
their covariance, and they are blended from the nearest to the farthest. Source: gsplat's
cuda/_torch_impl.py and its CUDA kernels.
"""

import math
from dataclasses import dataclass

import numpy as np

from lightfield.core.compiled import kernel
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


def draw(gaussians: Gaussians, view: View, lens: Lens) -> Drawn:
    """Return what a ``view`` shows through a ``lens``."""
    local = view.to_camera(gaussians.positions)
    away = np.linalg.norm(local, axis=1)
    along = -local[:, 2] if isinstance(lens, Rectilinear) else away
    visible = np.flatnonzero(along > _NEAREST)
    visible = visible[np.isfinite(lens.pixels(local[visible])[:, 0])]
    local = local[visible]
    turn = view.world_from_camera[:3, :3].T @ _matrices(gaussians.rotations[visible])
    spread = turn * gaussians.scales[visible][:, np.newaxis]
    footprint = _slopes(lens, local) @ spread
    covariance = footprint @ footprint.transpose(0, 2, 1)
    covariance[:, 0, 0] += _BLUR
    covariance[:, 1, 1] += _BLUR
    order = np.argsort(along[visible], kind="stable")
    offset = gaussians.positions[visible] - view.world_from_camera[:3, 3]
    shades = _colours(gaussians.harmonics[visible], offset)
    colour = np.zeros((lens.height, lens.width, 3))
    distance = np.full((lens.height, lens.width), np.inf)
    transmitted = np.ones((lens.height, lens.width))
    opaque = np.zeros((lens.height, lens.width), bool)
    _blend(
        lens.pixels(local)[order],
        covariance[order],
        shades[order],
        away[visible][order],
        gaussians.opacities[visible][order],
        colour,
        distance,
        transmitted,
        opaque,
    )
    return Drawn(colour, 1 - transmitted, distance)


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
        x, y = pixels[n]
        a = covariance[n, 0, 0]
        b = covariance[n, 0, 1]
        c = covariance[n, 1, 1]
        determinant = a * c - b * b
        if not determinant > 0:
            continue
        # Beyond this many standard deviations, it covers less than 1 / 255.
        reach = math.sqrt(2 * math.log(max(255 * opacities[n], 1.0)))
        first_row = max(0, math.floor(y - reach * math.sqrt(c)))
        last_row = min(height, math.ceil(y + reach * math.sqrt(c)))
        first_column = max(0, math.floor(x - reach * math.sqrt(a)))
        last_column = min(width, math.ceil(x + reach * math.sqrt(a)))
        for i in range(first_row, last_row):
            v = i + 0.5 - y
            for j in range(first_column, last_column):
                u = j + 0.5 - x
                square = (c * u * u - 2 * b * u * v + a * v * v) / determinant
                alpha = min(0.999, opacities[n] * math.exp(-square / 2))
                if opaque[i, j] or alpha < 1 / 255:
                    continue
                rest = transmitted[i, j] * (1 - alpha)
                if rest <= 1e-4:
                    opaque[i, j] = True
                    continue
                for k in range(3):
                    colour[i, j, k] += alpha * transmitted[i, j] * shades[n, k]
                if transmitted[i, j] > _HALF >= rest:
                    distance[i, j] = away[n]
                transmitted[i, j] = rest
