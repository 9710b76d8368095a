"""The consumers' camera models. Each projects directions to pixels.

Directions (…, 3) are in the axes of lightfield.json: x right, y up, the camera looks along −z.
Pixels (…, 2) count right and down from the image's corner, centres at ½.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pycolmap
from numpy.polynomial import polynomial
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Camera(Protocol):
    """An image of ``width`` × ``height`` pixels, and how directions are projected to it."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    def pixels(self, rays: Floats) -> Floats:
        """Return the pixels (…, 2) of directions (…, 3). NaN for those that it cannot project."""


@dataclass(frozen=True)
class Pinhole:
    """COLMAP's PINHOLE, and what the others call perspective."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def pixels(self, rays: Floats) -> Floats:
        x, y, z = np.moveaxis(rays, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            forward = np.where(z < 0, -z, np.nan)
            return np.stack(
                [self.cx + self.fx * x / forward, self.cy - self.fy * y / forward], axis=-1
            )


@dataclass(frozen=True)
class OpenCVFisheye:
    """OPENCV_FISHEYE: r = θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹, in focal lengths.

    Without distortion it is the equidistant lens, which also sees behind the camera.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    def pixels(self, rays: Floats) -> Floats:
        x, y, z = np.moveaxis(rays, -1, 0)
        side = np.hypot(x, y)
        theta = np.arctan2(side, -z)
        radius = theta * polynomial.polyval(theta**2, [1, self.k1, self.k2, self.k3, self.k4])
        along = _along(radius, side)
        return np.stack([self.cx + self.fx * along * x, self.cy - self.fy * along * y], axis=-1)


@dataclass(frozen=True)
class OfColmap:
    """A camera that COLMAP's own code projects. ``parameters`` are the ``model``'s."""

    width: int
    height: int
    model: str
    parameters: tuple[float, ...]

    def pixels(self, rays: Floats) -> Floats:
        camera = pycolmap.Camera(
            model=self.model, width=self.width, height=self.height, params=self.parameters
        )
        directions = (rays * [1, -1, -1]).reshape(-1, 3)
        return np.asarray(camera.img_from_cam(directions)).reshape(*rays.shape[:-1], 2)


@dataclass(frozen=True)
class PolynomialFisheye:
    """instant-ngp's ftheta: θ = p0 + p1 r + p2 r² + p3 r³ + p4 r⁴, r in pixels, up to 90°.

    Where p1 < 0 the image is turned by 180°.
    """

    width: int
    height: int
    cx: float
    cy: float
    terms: tuple[float, float, float, float, float]

    @property
    def is_equidistant(self) -> bool:
        return self.terms[0] == 0 and not any(self.terms[2:])

    def pixels(self, rays: Floats) -> Floats:
        x, y, z = np.moveaxis(rays, -1, 0)
        side = np.hypot(x, y)
        theta = np.arctan2(side, -z)
        # Invert the polynomial with a table so fine that linear interpolation is exact enough.
        reach = math.hypot(max(self.cx, self.width - self.cx), max(self.cy, self.height - self.cy))
        table = np.linspace(0, reach, 16 * max(self.width, self.height))
        sign = math.copysign(1.0, self.terms[1])
        angles = np.maximum.accumulate(sign * polynomial.polyval(table, self.terms))
        radius = np.interp(theta, angles, table, right=np.nan)
        along = sign * _along(np.where(theta < math.pi / 2, radius, np.nan), side)
        return np.stack([self.cx + along * x, self.cy - along * y], axis=-1)


@dataclass(frozen=True)
class FTheta:
    """NCore's f-theta camera: r = p0 + p1 θ + … + p5 θ⁵ in pixels, up to ``largest`` radians.

    ``linear`` (c, d, e) maps r times the unit direction (x, y) to (c x + d y, e x + y).
    """

    width: int
    height: int
    cx: float
    cy: float
    terms: tuple[float, ...]
    linear: tuple[float, ...]
    largest: float

    def pixels(self, rays: Floats) -> Floats:
        x, y, z = np.moveaxis(rays, -1, 0)
        side = np.hypot(x, y)
        theta = np.arctan2(side, -z)
        # The rim of a rounded angle belongs to the image.
        seen = np.where(theta <= self.largest * (1 + 1e-9), theta, np.nan)
        radius = polynomial.polyval(seen, np.array(self.terms))
        along = _along(radius, side)
        right, down = along * x, -along * y
        c, d, e = self.linear
        return np.stack([self.cx + c * right + d * down, self.cy + e * right + down], axis=-1)


@dataclass(frozen=True)
class Panorama:
    """Longitude is linear in x and grows to the right. Latitude is linear in y. Both in radians.

    The upper left corner has ``west`` and ``north``, the lower right corner ``east`` and ``south``.
    """

    width: int
    height: int
    west: float
    east: float
    north: float
    south: float

    def pixels(self, rays: Floats) -> Floats:
        x, y, z = np.moveaxis(rays, -1, 0)
        middle = (self.west + self.east) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            longitude = np.arctan2(x, -z)
            longitude = middle + (longitude - middle + math.pi) % (2 * math.pi) - math.pi
            latitude = np.arctan2(y, np.hypot(x, z))
            u = np.divide(longitude - self.west, self.east - self.west)
            v = np.divide(self.north - latitude, self.north - self.south)
        return np.stack([u * self.width, v * self.height], axis=-1)


def _along(radius: Floats, side: Floats) -> Floats:
    """Return the factors that scale a direction's (x, y) to pixels: 0 on the axis."""
    with np.errstate(invalid="ignore"):
        return np.where(side > 0, radius / np.where(side > 0, side, 1), 0 * radius)
