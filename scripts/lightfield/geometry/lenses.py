"""Lens geometry: every projection as a small class of two inverse methods.

The camera looks along −Z with +Y up and +X right. Pixel coordinates run right (x) and down (y)
from the image's top left corner, pixel centres at (i + 0.5). θ is a ray's angle from the optical
axis, r the distance from the principal point. Conventions are those of Blender's Cycles, measured
on its Position pass with bpy 5.0.1:

- equidistant: on a non-square image the image circle is an ellipse that touches all four edges;
  the sensor plays no part. The other lenses given by a field of view alone follow suit here.
- equisolid and polynomial: r is in millimetres on the sensor, so circles stay circles when the
  sensor's pixels are square.
- polynomial: θ = −(k0 + k1 r + k2 r² + k3 r³ + k4 r⁴), so a usual lens has k1 < 0, and k1 > 0
  turns the image by 180°.
- equirectangular: longitude grows to the right, latitude upwards, (0, 0) is the optical axis.

Arithmetic follows the input: float32 in, float32 out, anything else float64. NaN marks what a
lens cannot do: a pixel without a ray (outside the image circle), a ray that the lens does not see.
The image's frame is not part of a lens: both methods extend beyond it, and a caller that reads
pixels has to check that they lie in [0, width] × [0, height].
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from lightfield.core.errors import UserError

Array = npt.NDArray[Any]
Pair = tuple[float, float]

SENSOR_WIDTH = 36.0  # mm, Blender's default
CLIP = (0.1, 1000.0)  # m, a new Blender camera's clipping, which its projection matrix contains
# Blender keeps angles in float32, whose π, π/2 and 2π exceed the true ones by less than this.
ANGLE_SLACK = 1e-6
CUBE_FACES = "fblrud"


def _slack(dtype: np.dtype[Any]) -> float:
    """Return the factor by which rounding may carry a point on the rim beyond it."""
    return 1.0 + 8.0 * float(np.finfo(dtype).eps)


def _as_float(*arrays: npt.ArrayLike) -> list[Array]:
    """Return the arrays in float32 if all are, else in float64."""
    same = all(np.asarray(array).dtype == np.float32 for array in arrays)
    return [np.asarray(array, np.float32 if same else np.float64) for array in arrays]


@dataclass(frozen=True, kw_only=True)
class Lens(ABC):
    """A projection on an image of ``width`` × ``height`` pixels.

    ``sensor_size`` is in mm (default: 36 wide, square pixels), ``principal_point`` in pixels
    (default: the image's centre).
    """

    width: int
    height: int
    sensor_size: Pair | None = None
    principal_point: Pair | None = None

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise UserError(f"resolution: {self.width} × {self.height} is not an image")
        if not all(0.0 < side < math.inf for side in self.sensor):
            raise UserError(f"sensor_size: {list(self.sensor)} must be positive millimetres")
        if not all(math.isfinite(coordinate) for coordinate in self.center):
            raise UserError(f"principal_point: {list(self.center)} must be finite pixels")

    @property
    def sensor(self) -> Pair:
        """The sensor's width and height in mm."""
        return self.sensor_size or (SENSOR_WIDTH, SENSOR_WIDTH * self.height / self.width)

    @property
    def center(self) -> Pair:
        """The principal point in pixels."""
        return self.principal_point or (self.width / 2, self.height / 2)

    def rays(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Array:
        """Return unit rays (..., 3) of the pixel coordinates ``x``, ``y`` (...).

        NaN where the lens has no ray.
        """
        x, y = np.broadcast_arrays(*_as_float(x, y))
        # One dimension at least, for numpy computes with scalars in float64.
        rays = self._rays(np.atleast_1d(x), np.atleast_1d(y))
        return rays.astype(x.dtype, copy=False).reshape(*x.shape, 3)

    def pixels(self, rays: npt.ArrayLike) -> Array:
        """Return the pixel coordinates (..., 2) of ``rays`` (..., 3) of any length above zero.

        NaN where the lens does not see the ray; what it sees may lie outside the frame.
        """
        (array,) = _as_float(rays)
        pixels = self._pixels(np.atleast_2d(array)).astype(array.dtype, copy=False)
        pixels[~np.isfinite(pixels).all(axis=-1)] = np.nan
        return pixels.reshape(*array.shape[:-1], 2)

    @abstractmethod
    def _rays(self, x: Array, y: Array) -> Array:
        """Return `rays` of arrays of one shape and dtype."""

    @abstractmethod
    def _pixels(self, rays: Array) -> Array:
        """Return `pixels` of an array; NaN or inf in either coordinate marks a miss."""

    @property
    @abstractmethod
    def has_z_depth(self) -> bool:
        """Whether every ray has cos θ ≥ 0, so that Z-depth can hold its depth."""

    @abstractmethod
    def _camera(self) -> dict[str, Any]:
        """Return the ``camera`` mapping of lightfield.json, less the principal point."""

    def to_lightfield(self) -> dict[str, Any]:
        """Return ``camera``, ``resolution`` and ``sensor_size`` as lightfield.json has them."""
        camera = self._camera()
        if self.principal_point is not None:
            camera["principal_point"] = list(self.principal_point)
        return {
            "camera": camera,
            "resolution": [self.width, self.height],
            "sensor_size": list(self.sensor),
        }

    def resized(self, width: int, height: int) -> Self:
        """Return the lens of the same field of view with another number of pixels."""
        center = self.principal_point and (
            self.principal_point[0] * width / self.width,
            self.principal_point[1] * height / self.height,
        )
        return replace(
            self, width=width, height=height, sensor_size=self.sensor, principal_point=center
        )


class RadialLens(Lens):
    """A lens whose r depends on θ alone; r is counted in the unit of `_unit`."""

    @property
    @abstractmethod
    def _unit(self) -> Pair:
        """The units of r that a pixel's width and height make."""

    @property
    @abstractmethod
    def _limit(self) -> float:
        """The largest r of the lens."""

    @abstractmethod
    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        """Return sin θ and cos θ at r."""

    @abstractmethod
    def _radius(self, sin: Array, cos: Array) -> Array:
        """Return r of θ, in which ``sin`` ≥ 0; NaN where there is none."""

    def _rays(self, x: Array, y: Array) -> Array:
        u = (x - self.center[0]) * self._unit[0]
        v = (self.center[1] - y) * self._unit[1]
        r = np.hypot(u, v)
        with np.errstate(invalid="ignore", divide="ignore"):
            sin, cos = self._sin_cos(r)
            # The azimuth at r = 0 matters only where θ(0) ≠ 0: there Cycles takes "up".
            ray = np.stack(
                [sin * np.where(r > 0, u / r, 0), sin * np.where(r > 0, v / r, 1), -cos], axis=-1
            )
            ray[~((r <= self._limit * _slack(x.dtype)) & np.isfinite(r))] = np.nan
        return np.asarray(ray)

    def _pixels(self, rays: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            # Scaled by the largest component: no overflow, and NaN for a ray of zero or inf.
            rays = rays / np.abs(rays).max(axis=-1, keepdims=True)
            side = np.hypot(rays[..., 0], rays[..., 1])
            length = np.hypot(side, rays[..., 2])
            r = self._radius(side / length, -rays[..., 2] / length)
            r = np.where(np.abs(r) <= self._limit * _slack(rays.dtype), r, np.nan)
            # The azimuth of the axis itself matters only backwards: "up" there, too.
            u = r * np.where(side > 0, rays[..., 0] / side, 0)
            v = r * np.where(side > 0, rays[..., 1] / side, 1)
            x = self.center[0] + u / self._unit[0]
            y = self.center[1] - v / self._unit[1]
        return np.stack([x, y], axis=-1)

    @property
    def has_z_depth(self) -> bool:
        with np.errstate(invalid="ignore"):
            return bool(self._sin_cos(np.asarray(self._limit))[1] >= -ANGLE_SLACK)


def _millimetres(lens: Lens) -> Pair:
    return (lens.sensor[0] / lens.width, lens.sensor[1] / lens.height)


def _checked_fov(fov: float, largest: float, lens: str) -> None:
    if not 0.0 < fov <= largest + ANGLE_SLACK:
        raise UserError(
            f"fov: {math.degrees(fov):g} degrees is not within 0 to {math.degrees(largest):g}, "
            f"the {lens} lens's limit"
        )


def _checked_focal_length(focal_length: float) -> None:
    if not 0.0 < focal_length < math.inf:
        raise UserError(f"focal_length: {focal_length:g} must be positive millimetres")


@dataclass(frozen=True, kw_only=True)
class Rectilinear(RadialLens):
    """r = f tan θ, ``focal_length`` in mm. Source: the pinhole camera."""

    focal_length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_focal_length(self.focal_length)

    @property
    def _unit(self) -> Pair:
        # r is counted in focal lengths.
        horizontal, vertical = _millimetres(self)
        return (horizontal / self.focal_length, vertical / self.focal_length)

    @property
    def _limit(self) -> float:
        return math.inf

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        length = np.hypot(1, r)
        return r / length, 1 / length

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.where(cos > 0, sin / cos, np.nan)

    def _camera(self) -> dict[str, Any]:
        near, far = CLIP
        unit = self._unit
        # As Blender's calc_matrix_camera; a shifted principal point is in the third column.
        return {
            "type": "PERSP",
            "lens_unit": "MILLIMETERS",
            "focal_length": self.focal_length,
            "projection_matrix": [
                [2 / (self.width * unit[0]), 0.0, 1 - 2 * self.center[0] / self.width, 0.0],
                [0.0, 2 / (self.height * unit[1]), 2 * self.center[1] / self.height - 1, 0.0],
                [0.0, 0.0, (near + far) / (near - far), 2 * near * far / (near - far)],
                [0.0, 0.0, -1.0, 0.0],
            ],
        }


@dataclass(frozen=True, kw_only=True)
class FovLens(RadialLens):
    """A fisheye whose image circle (radius 1) touches the image's edges at ``fov`` / 2 radians."""

    fov: float

    @property
    def _unit(self) -> Pair:
        return (2 / self.width, 2 / self.height)

    @property
    def _limit(self) -> float:
        return 1.0


@dataclass(frozen=True, kw_only=True)
class Equidistant(FovLens):
    """r = f θ. Source: Kannala and Brandt 2006, equation 3; Cycles' FISHEYE_EQUIDISTANT."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_fov(self.fov, 2 * math.pi, "equidistant")

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = np.minimum(r * (self.fov / 2), math.pi)
        return np.maximum(np.sin(theta), 0), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.arctan2(sin, cos) / (self.fov / 2)

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_EQUIDISTANT",
            "fisheye_fov": self.fov,
        }


@dataclass(frozen=True, kw_only=True)
class Stereographic(FovLens):
    """r = 2 f tan(θ/2). Source: Kannala and Brandt 2006, equation 2."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_fov(self.fov, math.radians(359.9999), "stereographic")

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        half = r * math.tan(self.fov / 4)
        square = half * half
        return 2 * half / (1 + square), (1 - half) * (1 + half) / (1 + square)

    def _radius(self, sin: Array, cos: Array) -> Array:
        # Of the two forms of tan(θ/2), the one in which nothing cancels.
        return np.where(cos > 0, sin / (1 + cos), (1 - cos) / sin) / math.tan(self.fov / 4)

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_STEREOGRAPHIC",
            "fisheye_fov": self.fov,
        }


@dataclass(frozen=True, kw_only=True)
class Orthographic(FovLens):
    """r = f sin θ. Source: Kannala and Brandt 2006, equation 5."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_fov(self.fov, math.pi, "orthographic")

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        sin = np.minimum(r * math.sin(self.fov / 2), 1)
        return sin, np.sqrt((1 - sin) * (1 + sin))

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.where(cos >= 0, sin / math.sin(self.fov / 2), np.nan)

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_ORTHOGRAPHIC",
            "fisheye_fov": self.fov,
        }


@dataclass(frozen=True, kw_only=True)
class Equisolid(RadialLens):
    """r = 2 f sin(θ/2), ``focal_length`` in mm, out to ``fov`` / 2 radians.

    Source: Kannala and Brandt 2006, equation 4; Cycles' FISHEYE_EQUISOLID.
    """

    focal_length: float
    fov: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_focal_length(self.focal_length)
        _checked_fov(self.fov, 2 * math.pi, "equisolid")

    @property
    def _unit(self) -> Pair:
        # r is counted in diameters 2 f of the projection, so it is sin(θ/2).
        horizontal, vertical = _millimetres(self)
        return (horizontal / (2 * self.focal_length), vertical / (2 * self.focal_length))

    @property
    def _limit(self) -> float:
        return math.sin(min(self.fov, 2 * math.pi) / 4)

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        r = np.minimum(r, 1)
        return 2 * r * np.sqrt((1 - r) * (1 + r)), 1 - 2 * r * r

    def _radius(self, sin: Array, cos: Array) -> Array:
        # sin(θ/2), in the form in which nothing cancels.
        near = sin / np.sqrt(2 * (1 + np.maximum(cos, 0)))
        return np.where(cos > 0, near, np.sqrt((1 - cos) / 2))

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_EQUISOLID",
            "fisheye_lens": self.focal_length,
            # SILVR's documentation has `lens`, its programs have `fisheye_lens`.
            "lens": self.focal_length,
            "fisheye_fov": self.fov,
        }


class IncreasingPolynomial:
    """Σ c_i t^i on [0, end], where it increases.

    It ends at its first turning point, at t = ``last`` or at the value ``last_value``.
    """

    def __init__(
        self, coefficients: Sequence[float], last: float = math.inf, last_value: float = math.inf
    ) -> None:
        self.value = np.polynomial.Polynomial(coefficients)
        self.slope = np.polynomial.Polynomial([i * c for i, c in enumerate(coefficients)][1:])
        self.end = min(self._turning_point(), last)
        if math.isinf(self.end):
            self.end = 1.0
            while self.value(self.end) < last_value:
                self.end *= 2
        if self.value(self.end) > last_value > self.value(0.0):
            # Imported here because no other lens needs it, and it takes a quarter of a second.
            from scipy.optimize import brentq

            self.end = float(brentq(lambda t: self.value(t) - last_value, 0, self.end, xtol=1e-300))
        # Nodes that bracket every solution, and start Newton's method close to it.
        self._nodes = np.linspace(0, self.end, 257)
        self._values = np.maximum.accumulate(self.value(self._nodes))

    def _turning_point(self) -> float:
        roots = np.roots(self.slope.coef[::-1])
        real = np.sort(roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0)])
        after = np.append((real[:-1] + real[1:]) / 2, real[-1:] * 2)
        falling = real[self.slope(after) < 0]
        return float(falling[0]) if falling.size else math.inf

    def inverse(self, values: Array) -> Array:
        """Return t in [0, end] with Σ c_i t^i = ``values``, in float64; NaN where there is none.

        Newton's method, held by bisection inside a bracket that always contains the solution.
        """
        last = self._values[-1]
        goal = values.astype(np.float64).ravel()
        goal[(goal > last) & (goal <= last * _slack(values.dtype))] = last
        t = np.full(goal.shape, np.nan)
        active = np.flatnonzero((goal >= self._values[0]) & (goal <= last))
        goal = goal[active]
        upper = np.clip(np.searchsorted(self._values, goal), 1, self._nodes.size - 1)
        low, high = self._nodes[upper - 1], self._nodes[upper]
        now = np.interp(goal, self._values, self._nodes)
        for _ in range(100):
            error = self.value(now) - goal
            low, high = np.where(error <= 0, now, low), np.where(error >= 0, now, high)
            with np.errstate(invalid="ignore", divide="ignore"):
                newton = now - error / self.slope(now)
            new = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
            t[active] = new
            going = np.abs(new - now) > 4 * np.finfo(np.float64).eps * np.abs(new)
            if not going.any():
                break
            active, goal, now = active[going], goal[going], new[going]
            low, high = low[going], high[going]
        return t.reshape(values.shape)


@dataclass(frozen=True, kw_only=True)
class Polynomial(RadialLens):
    """θ = −(k0 + k1 r + k2 r² + k3 r³ + k4 r⁴), r in mm, out to ``fov`` / 2 radians.

    ``coefficients`` are k0 to k4 as Blender has them. The lens ends where |θ| stops growing with
    r. Where k0 leaves a hole around the axis that is smaller than a pixel, the centre takes it.
    Source: Cycles' FISHEYE_LENS_POLYNOMIAL.
    """

    coefficients: tuple[float, ...]
    fov: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_fov(self.fov, 2 * math.pi, "polynomial")
        if len(self.coefficients) != 5 or not all(map(math.isfinite, self.coefficients)):
            raise UserError(
                f"coefficients: {list(self.coefficients)} must be five numbers, k0 to k4"
            )
        if not any(self.coefficients[1:]):
            raise UserError("coefficients: k1 to k4 are all zero, so no radius has an angle")
        if abs(self.coefficients[0]) >= self.fov / 2:
            raise UserError(
                f"coefficients: k0 = {self.coefficients[0]:g} is outside the field of view "
                f"of {math.degrees(self.fov):g} degrees"
            )

    @cached_property
    def _sign(self) -> float:
        return -math.copysign(1, next(k for k in self.coefficients[1:] if k))

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        # θ = _sign · (a polynomial that increases with r)
        return IncreasingPolynomial(
            [-self._sign * k for k in self.coefficients], last_value=min(self.fov / 2, math.pi)
        )

    @property
    def _unit(self) -> Pair:
        return _millimetres(self)

    @property
    def _limit(self) -> float:
        return self._increasing.end

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = self._increasing.value(r.astype(np.float64))
        return self._sign * np.sin(theta), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        theta = np.arctan2(sin, cos)
        r = self._increasing.inverse(theta)
        hole = self._increasing.value(0.0)
        if 2 * hole < self._increasing.value(max(self._unit)):
            r = np.where(theta.astype(np.float64) < hole, 0, r)
        return self._sign * r

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_LENS_POLYNOMIAL",
            "fisheye_fov": self.fov,
            **{f"fisheye_polynomial_k{i}": k for i, k in enumerate(self.coefficients)},
        }


@dataclass(frozen=True, kw_only=True)
class KannalaBrandt(RadialLens):
    """r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹), ``focal_length`` in mm, out to ``fov`` / 2.

    The lens ends where r stops growing with θ. Source: Kannala and Brandt 2006, equation 6, as
    OpenCV's fisheye module has it.
    """

    focal_length: float
    coefficients: tuple[float, ...]
    fov: float = 2 * math.pi

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_focal_length(self.focal_length)
        _checked_fov(self.fov, 2 * math.pi, "Kannala–Brandt")
        if len(self.coefficients) != 4 or not all(map(math.isfinite, self.coefficients)):
            raise UserError(
                f"coefficients: {list(self.coefficients)} must be four numbers, k1 to k4"
            )

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        odd = [c for k in (1.0, *self.coefficients) for c in (0.0, k)]
        return IncreasingPolynomial(odd, last=min(self.fov / 2, math.pi))

    @property
    def _unit(self) -> Pair:
        # r is counted in focal lengths.
        horizontal, vertical = _millimetres(self)
        return (horizontal / self.focal_length, vertical / self.focal_length)

    @cached_property
    def _limit(self) -> float:
        return float(self._increasing.value(self._increasing.end))

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = self._increasing.inverse(r)
        return np.maximum(np.sin(theta), 0), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        theta = np.arctan2(sin, cos)
        inside = theta <= self._increasing.end * _slack(theta.dtype)
        return np.where(inside, self._increasing.value(theta.astype(np.float64)), np.nan)

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "FISHEYE_KANNALA_BRANDT",
            "fisheye_lens": self.focal_length,
            "fisheye_fov": self.fov,
            "kannala_brandt": list(self.coefficients),
        }


@dataclass(frozen=True, kw_only=True)
class Equirectangular(Lens):
    """Longitude linear in x, latitude linear in y, in radians. Source: Cycles' EQUIRECTANGULAR.

    A ray outside a partial range of longitudes goes to the side of the frame that it is nearer;
    a pole, which has every longitude, goes to longitude 0.
    """

    longitude: Pair = (-math.pi, math.pi)
    latitude: Pair = (-math.pi / 2, math.pi / 2)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.principal_point is not None:
            raise UserError("principal_point: an equirectangular lens has none; use its ranges")
        for name, (low, high), largest in (
            ("longitude", self.longitude, math.inf),
            ("latitude", self.latitude, math.pi / 2),
        ):
            if not (low < high and max(-low, high) <= largest + ANGLE_SLACK):
                raise UserError(
                    f"{name}: {math.degrees(low):g} to {math.degrees(high):g} degrees "
                    "is not a range that grows within the sphere"
                )
        if self.longitude[1] - self.longitude[0] > 2 * math.pi + 2 * ANGLE_SLACK:
            raise UserError("longitude: the range is more than 360 degrees")

    def _rays(self, x: Array, y: Array) -> Array:
        (west, east), (south, north) = self.longitude, self.latitude
        longitude = west + (east - west) * (x / self.width)
        latitude = north - (north - south) * (y / self.height)
        with np.errstate(invalid="ignore"):
            radius = np.maximum(np.cos(latitude), 0)
            ray = np.stack(
                [radius * np.sin(longitude), np.sin(latitude), -radius * np.cos(longitude)],
                axis=-1,
            )
            ray[~((np.abs(latitude) <= math.pi / 2 + ANGLE_SLACK) & np.isfinite(x))] = np.nan
        return np.asarray(ray)

    def _pixels(self, rays: Array) -> Array:
        (west, east), (south, north) = self.longitude, self.latitude
        with np.errstate(invalid="ignore", divide="ignore"):
            rays = rays / np.abs(rays).max(axis=-1, keepdims=True)
        # 0 − z, not −z: atan2(0, −0) is π, and a pole belongs to longitude 0.
        longitude = np.arctan2(rays[..., 0], 0 - rays[..., 2])
        latitude = np.arctan2(rays[..., 1], np.hypot(rays[..., 0], rays[..., 2]))
        turns = np.round((longitude - (west + east) / 2) / (2 * math.pi))
        longitude = longitude - 2 * math.pi * turns
        x = (longitude - west) / (east - west) * self.width
        y = (north - latitude) / (north - south) * self.height
        return np.stack([x, y], axis=-1)

    @property
    def has_z_depth(self) -> bool:
        return max(-self.longitude[0], self.longitude[1]) <= math.pi / 2 + ANGLE_SLACK

    def _camera(self) -> dict[str, Any]:
        return {
            "type": "PANO",
            "panorama_type": "EQUIRECTANGULAR",
            "longitude_min": self.longitude[0],
            "longitude_max": self.longitude[1],
            "latitude_min": self.latitude[0],
            "latitude_max": self.latitude[1],
        }


def cube_face_rotation(face: str) -> Array:
    """Return the rotation (3, 3) from a cube face's camera to the cube map's.

    Faces are named as the sides of a cuboid rig, and turned as they are there: f looks along −Z,
    b along +Z, l along −X, r along +X, u along +Y and d along −Y; f, b, l and r have +Y up, u has
    +Z up and d has −Z up.
    """
    right, up = {
        "f": ((1, 0, 0), (0, 1, 0)),
        "b": ((-1, 0, 0), (0, 1, 0)),
        "l": ((0, 0, -1), (0, 1, 0)),
        "r": ((0, 0, 1), (0, 1, 0)),
        "u": ((1, 0, 0), (0, 0, 1)),
        "d": ((1, 0, 0), (0, 0, -1)),
    }[face]
    return np.column_stack([right, up, np.cross(right, up)]).astype(np.float64)


@dataclass(frozen=True, kw_only=True)
class CubeMap(Lens):
    """Six square rectilinear faces of 90°, side by side in the order f b l r u d.

    On disk each face is an image of its own; in memory they form one strip, six times as wide as
    high, of which the columns from i · height on are face i. A kernel must not reach across a
    face's border, where the strip's neighbours are no neighbours in space. Source: Greene 1986.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.principal_point is not None:
            raise UserError("principal_point: a cube map has none")
        if self.width != 6 * self.height:
            raise UserError(
                f"resolution: {self.width} × {self.height} is not a cube map's; "
                f"its width is 6 times its height, so {6 * self.height} × {self.height}"
            )

    @property
    def face(self) -> Rectilinear:
        """The lens of one face."""
        return Rectilinear(width=self.height, height=self.height, focal_length=SENSOR_WIDTH / 2)

    def _rays(self, x: Array, y: Array) -> Array:
        size = self.height
        with np.errstate(invalid="ignore"):
            inside = (x >= 0) & (x <= self.width) & (y >= 0) & (y <= size)
        index = np.minimum(np.where(inside, x, 0) // size, 5).astype(np.intp)
        local = self.face.rays(x - (index * size).astype(x.dtype), y)
        rotations = np.stack([cube_face_rotation(face) for face in CUBE_FACES]).astype(x.dtype)
        ray = (rotations[index] @ local[..., None])[..., 0]
        ray[~inside] = np.nan
        return np.asarray(ray)

    def _pixels(self, rays: Array) -> Array:
        rotations = [cube_face_rotation(face).astype(rays.dtype) for face in CUBE_FACES]
        out = np.full((*rays.shape[:-1], 2), np.nan, rays.dtype)
        with np.errstate(invalid="ignore"):
            # The face that a ray meets is the one whose axis it is nearest.
            index = np.argmax(np.stack([-(rays @ r[:, 2]) for r in rotations]), axis=0)
            for i, rotation in enumerate(rotations):
                chosen = index == i
                x, y = np.moveaxis(self.face.pixels(rays[chosen] @ rotation), -1, 0)
                # Rounding must not carry a pixel to the next face of the strip, which is no
                # neighbour in space.
                first, end = np.asarray([i, i + 1], rays.dtype) * self.height
                out[chosen, 0] = np.clip(x + first, first, np.nextafter(end, first))
                out[chosen, 1] = np.clip(y, 0, self.height)
        return out

    @property
    def has_z_depth(self) -> bool:
        return False

    def _camera(self) -> dict[str, Any]:
        return {"type": "PANO", "panorama_type": "CUBE_MAP"}


def _pair(values: Sequence[float]) -> Pair:
    first, second = values
    return float(first), float(second)


def from_lightfield(cfg: Mapping[str, Any]) -> Lens:
    """Return the lens of a lightfield.json, one of ours or one that SILVR's tools wrote.

    A key that is missing or has an unknown value is a `UserError` that names it.
    """
    try:
        return _from_lightfield(cfg)
    except KeyError as error:
        raise UserError(f"{error.args[0]}: is missing, so the lens is not known") from None
    except (TypeError, ValueError) as error:
        raise UserError(f"camera, resolution or sensor_size: {error}") from None


def _from_lightfield(cfg: Mapping[str, Any]) -> Lens:
    camera = cfg["camera"]
    width, height = cfg["resolution"]
    common: dict[str, Any] = {"width": int(width), "height": int(height)}
    if "sensor_size" in cfg:
        common["sensor_size"] = _pair(cfg["sensor_size"])
    if "principal_point" in camera:
        common["principal_point"] = _pair(camera["principal_point"])
    if camera["type"] == "PERSP":
        return _perspective_from_lightfield(camera, common)
    if camera["type"] != "PANO":
        raise UserError(f"camera.type: {camera['type']!r} is neither PERSP nor PANO")
    match camera["panorama_type"]:
        case "FISHEYE_EQUIDISTANT":
            return Equidistant(**common, fov=float(camera["fisheye_fov"]))
        case "FISHEYE_EQUISOLID":
            focal_length = camera["fisheye_lens" if "fisheye_lens" in camera else "lens"]
            fov = float(camera["fisheye_fov"])
            return Equisolid(**common, focal_length=float(focal_length), fov=fov)
        case "FISHEYE_STEREOGRAPHIC":
            return Stereographic(**common, fov=float(camera["fisheye_fov"]))
        case "FISHEYE_ORTHOGRAPHIC":
            return Orthographic(**common, fov=float(camera["fisheye_fov"]))
        case "FISHEYE_LENS_POLYNOMIAL":
            return Polynomial(
                **common,
                coefficients=tuple(float(camera[f"fisheye_polynomial_k{i}"]) for i in range(5)),
                fov=float(camera["fisheye_fov"]),
            )
        case "FISHEYE_KANNALA_BRANDT":
            return KannalaBrandt(
                **common,
                focal_length=float(camera["fisheye_lens"]),
                coefficients=tuple(map(float, camera["kannala_brandt"])),
                fov=float(camera["fisheye_fov"]),
            )
        # SILVR's reprojection tool writes RECTILINEAR for its equirectangular panoramas.
        case "EQUIRECTANGULAR" | "RECTILINEAR":
            return Equirectangular(
                **common,
                longitude=(float(camera["longitude_min"]), float(camera["longitude_max"])),
                latitude=(float(camera["latitude_min"]), float(camera["latitude_max"])),
            )
        case "CUBE_MAP":
            return CubeMap(**common)
        case unknown:
            raise UserError(f"camera.panorama_type: {unknown!r} is not a lens of this program")


def _perspective_from_lightfield(camera: Mapping[str, Any], common: dict[str, Any]) -> Lens:
    width, height = common["width"], common["height"]
    matrix = camera.get("projection_matrix")
    if matrix and "principal_point" not in common:
        shift = (float(matrix[0][2]), float(matrix[1][2]))
        if any(shift):
            common["principal_point"] = (
                width / 2 * (1 - shift[0]),
                height / 2 * (1 + shift[1]),
            )
    sensor_width, sensor_height = common.get(
        "sensor_size", (SENSOR_WIDTH, SENSOR_WIDTH * height / width)
    )
    if camera["lens_unit"] == "MILLIMETERS":
        focal_length = float(camera["focal_length"])
    elif camera["lens_unit"] == "FOV" and matrix:
        focal_length = float(matrix[0][0]) * sensor_width / 2
    elif camera["lens_unit"] == "FOV":
        # Blender's angle spans the sensor's longer side.
        focal_length = max(sensor_width, sensor_height) / 2 / math.tan(float(camera["angle"]) / 2)
    else:
        raise UserError(f"camera.lens_unit: {camera['lens_unit']!r} is not MILLIMETERS or FOV")
    return Rectilinear(**common, focal_length=focal_length)


def from_camera(camera: Mapping[str, Any]) -> Lens:
    """Return the lens of a scene YAML's ``camera`` mapping, which its schema has validated.

    ``fov`` is in degrees: across the image's width for a rectilinear lens, that of the image
    circle for a fisheye. ``sensor_size`` is its width, or both sides, in mm.
    """
    width, height = camera["resolution"]
    common: dict[str, Any] = {"width": int(width), "height": int(height)}
    if "sensor_size" in camera:
        size = camera["sensor_size"]
        sides = size if isinstance(size, Sequence) else (size, size * height / width)
        common["sensor_size"] = _pair(sides)
    if "principal_point" in camera:
        common["principal_point"] = _pair(camera["principal_point"])
    kind = camera["lens"]
    fov = math.radians(camera["fov"]) if "fov" in camera else None
    focal_length = camera.get("focal_length")
    coefficients = tuple(map(float, camera.get("coefficients", ())))

    def required(value: float | None, key: str) -> float:
        if value is None:
            raise UserError(f"camera.{key}: the {kind} lens needs it")
        return float(value)

    match kind:
        case "rectilinear":
            if focal_length is None:
                fov = required(fov, "focal_length or camera.fov")
                if not 0 < fov < math.pi:
                    raise UserError(
                        f"camera.fov: {camera['fov']:g} degrees is not between 0 and 180"
                    )
                sensor_width = common.get("sensor_size", (SENSOR_WIDTH,))[0]
                focal_length = sensor_width / 2 / math.tan(fov / 2)
            return Rectilinear(**common, focal_length=float(focal_length))
        case "equidistant":
            return Equidistant(**common, fov=required(fov, "fov"))
        case "equisolid":
            return Equisolid(
                **common,
                focal_length=required(focal_length, "focal_length"),
                fov=required(fov, "fov"),
            )
        case "stereographic":
            return Stereographic(**common, fov=required(fov, "fov"))
        case "orthographic":
            return Orthographic(**common, fov=required(fov, "fov"))
        case "polynomial":
            return Polynomial(**common, coefficients=coefficients, fov=required(fov, "fov"))
        case "kannala_brandt":
            return KannalaBrandt(
                **common,
                focal_length=required(focal_length, "focal_length"),
                coefficients=coefficients,
                fov=2 * math.pi if fov is None else fov,
            )
        case "equirectangular":
            longitude = map(math.radians, camera.get("longitude", (-180, 180)))
            latitude = map(math.radians, camera.get("latitude", (-90, 90)))
            return Equirectangular(
                **common, longitude=_pair(tuple(longitude)), latitude=_pair(tuple(latitude))
            )
        case "cube_map":
            return CubeMap(**common)
        case _:
            raise UserError(f"camera.lens: {kind!r} is not a lens of this program")
