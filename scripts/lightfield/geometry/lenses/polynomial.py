"""Blender's polynomial fisheye."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import (
    Array,
    Fisheye,
    FisheyeSettings,
    Pair,
    checked_coefficients,
    fov_up_to,
)
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial
from lightfield.settings.base import as_list


class PolynomialSettings(FisheyeSettings):
    """Blender's polynomial fisheye in a scene YAML."""

    lens: Literal["polynomial"]
    coefficients: Annotated[tuple[float, float, float, float, float], as_list(5)] = Field(
        description="The coefficients k0 to k4 of the polynomial that gives the angle from the "
        "radius.",
        json_schema_extra={"unit": "radians/mm^i"},
    )
    fov: float = fov_up_to(360)

    def optics(self) -> dict[str, Any]:
        return {**super().optics(), "coefficients": self.coefficients}


@dataclass(frozen=True, kw_only=True)
class Polynomial(Fisheye):
    """θ = −(k0 + k1 r + k2 r² + k3 r³ + k4 r⁴), r in mm, out to ``fov`` / 2 radians.

    ``coefficients`` are k0 to k4 as in Blender. The lens ends where |θ| stops growing with r. k0
    may leave a hole around the axis. If the hole is smaller than a pixel, its rays go to the
    centre. Source: Cycles' FISHEYE_LENS_POLYNOMIAL.
    """

    name = "polynomial"
    title = "polynomial fisheye"
    camera_types = ("FISHEYE_LENS_POLYNOMIAL",)
    in_cycles = True
    Settings = PolynomialSettings
    form = "K0,K1,K2,K3,K4,SENSOR_WIDTH,FOV"

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_coefficients(self.coefficients, 5, "k0 to k4")
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
            [-self._sign * k for k in self.coefficients], last_value=self.fov / 2
        )

    @property
    def _unit(self) -> Pair:
        return self._pixel_size()

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

    def _to_camera(self) -> dict[str, Any]:
        terms = {f"fisheye_polynomial_k{i}": k for i, k in enumerate(self.coefficients)}
        return {**super()._to_camera(), **terms}

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        terms = tuple(float(camera[f"fisheye_polynomial_k{i}"]) for i in range(5))
        return {**super()._from_camera(camera), "coefficients": terms}

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        return {"fov": numbers["FOV"], "coefficients": tuple(numbers[f"K{i}"] for i in range(5))}
