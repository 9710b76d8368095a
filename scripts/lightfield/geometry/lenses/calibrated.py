"""The lenses of calibrated cameras: a focal length, a principal point and coefficients."""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import (
    ANGLE_SLACK,
    Array,
    Fisheye,
    FisheyeSettings,
    FocalLength,
    Pair,
    checked_coefficients,
    checked_focal_length,
    fov_up_to,
    slack,
)
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial

# The part of an image that has no ray is counted on an image of at most this side, in pixels.
_COUNTED_SIDE = 1024


class CalibratedSettings(FisheyeSettings):
    """A calibrated camera in a scene YAML. Each lens adds its coefficients."""

    focal_length: FocalLength
    coefficients: tuple[float, ...]
    fov: float = fov_up_to(360, default=360)

    def optics(self) -> dict[str, Any]:
        return {
            **super().optics(),
            "focal_length": self.focal_length,
            "coefficients": self.coefficients,
        }


@dataclass(frozen=True, kw_only=True)
class CalibratedLens(Fisheye):
    """A lens of ``focal_length`` mm with ``coefficients``, out to ``fov`` / 2 radians.

    r is counted in focal lengths. Pixels that are not square have two focal lengths in pixels:
    focal_length · width / sensor width, and focal_length · height / sensor height. In
    lightfield.json, the coefficients stand under the lens's name.
    """

    coefficient_names: ClassVar[tuple[str, ...]]

    focal_length: float
    coefficients: tuple[float, ...]
    fov: float = 2 * math.pi

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "name" in vars(cls):
            names = ",".join(cls.coefficient_names).upper()
            cls.form = f"FOCAL_LENGTH,SENSOR_WIDTH,{names}[,FOV]"

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_focal_length(self.focal_length)
        first, *_, last = self.coefficient_names * 2
        names = first if len(self.coefficient_names) == 1 else f"{first} to {last}"
        checked_coefficients(self.coefficients, len(self.coefficient_names), names)

    @property
    def _unit(self) -> Pair:
        return self._pixel_size(self.focal_length)

    @property
    def _end(self) -> float:
        """The largest θ in radians."""
        with np.errstate(invalid="ignore"):
            return float(np.arccos(self._sin_cos(np.asarray(self._limit))[1]))

    @property
    def description(self) -> str:
        return f"{self.title}, {2 * math.degrees(self._end):.4g}°"

    @property
    def clipped(self) -> str | None:
        if self._end > self.fov / 2 - ANGLE_SLACK:
            return None
        rays = self.fitted(_COUNTED_SIDE).pixel_rays(np.float32)
        blank = float(np.isnan(rays[..., 0]).mean())
        if blank == 0:
            return None
        return (
            f"the {self.title} ends at {math.degrees(self._end):.4g}°, {self._limit:.4g} focal "
            f"lengths from its principal point, so {100 * blank:.2g} % of the image has no ray; "
            "choose a smaller limit by fov"
        )

    def _to_camera(self) -> dict[str, Any]:
        return {
            "fisheye_lens": self.focal_length,
            **super()._to_camera(),
            self.name: list(self.coefficients),
        }

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        return {
            **super()._from_camera(camera),
            "focal_length": float(camera["fisheye_lens"]),
            "coefficients": tuple(map(float, camera[cls.name])),
        }

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        return {
            "focal_length": numbers["FOCAL_LENGTH"],
            "coefficients": tuple(numbers[name.upper()] for name in cls.coefficient_names),
            **({"fov": numbers["FOV"]} if "FOV" in numbers else {}),
        }


class PolynomialOfAngle(CalibratedLens):
    """A lens whose r is a polynomial of θ. It ends where r stops growing with θ."""

    @property
    @abstractmethod
    def _terms(self) -> Sequence[float]:
        """The polynomial's coefficients, from the constant upwards."""

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        return IncreasingPolynomial(self._terms, last=self.fov / 2)

    @property
    def _end(self) -> float:
        return self._increasing.end

    @cached_property
    def _limit(self) -> float:
        return float(self._increasing.value(self._increasing.end))

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = self._increasing.inverse(r)
        return np.sin(theta), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        theta = np.arctan2(sin, cos)
        inside = theta <= self._increasing.end * slack(theta.dtype)
        return np.where(inside, self._increasing.value(theta.astype(np.float64)), np.nan)


class ClosedForm(CalibratedLens):
    """A lens whose r and θ follow from each other by closed forms, in float64.

    Rounding may carry their arguments a little beyond the rim.
    """

    @property
    @abstractmethod
    def _rim(self) -> Pair:
        """The largest θ of the equation, in radians, and its r, which may be infinite."""

    @abstractmethod
    def _angle(self, r: Array) -> tuple[Array, Array]:
        """Return sin θ and cos θ at r."""

    @abstractmethod
    def _distance(self, sin: Array, cos: Array) -> Array:
        """Return r at θ."""

    @cached_property
    def _end(self) -> float:
        return min(self._rim[0], self.fov / 2)

    @cached_property
    def _limit(self) -> float:
        theta, r = self._rim
        if self.fov / 2 >= theta:
            return r
        sin, cos = np.sin([self.fov / 2]), np.cos([self.fov / 2])
        return float(self._distance(sin, cos)[0])

    @property
    def has_z_depth(self) -> bool:
        return self._end <= math.pi / 2 + ANGLE_SLACK

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        return self._angle(r.astype(np.float64))

    def _radius(self, sin: Array, cos: Array) -> Array:
        is_inside = np.arctan2(sin, cos) <= self._end * slack(sin.dtype)
        r = self._distance(sin.astype(np.float64), cos.astype(np.float64))
        return np.where(is_inside, np.minimum(r, self._limit), np.nan)


def checked_range(name: str, value: float, is_inside: bool, allowed: str) -> None:
    """Raise `UserError` for a coefficient outside its range, which ``allowed`` describes."""
    if not is_inside:
        raise UserError(f"coefficients: {name} = {value} must be {allowed}")


def odd_polynomial(terms: Sequence[float]) -> list[float]:
    """Return the coefficients of θ + c1 θ³ + c2 θ⁵ + …, whose even powers have none."""
    coefficients = [0.0] * (2 * len(terms) + 2)
    coefficients[1::2] = (1.0, *terms)
    return coefficients
