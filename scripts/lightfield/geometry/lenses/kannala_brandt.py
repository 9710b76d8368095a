"""OpenCV's fisheye."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import (
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
from lightfield.settings.base import as_list


class KannalaBrandtSettings(FisheyeSettings):
    """OpenCV's fisheye in a scene YAML."""

    lens: Literal["kannala_brandt"]
    focal_length: FocalLength
    coefficients: Annotated[tuple[float, float, float, float], as_list(4)] = Field(
        description="The coefficients k1 to k4 of the polynomial that gives the radius from the "
        "angle."
    )
    fov: float = fov_up_to(360, default=360)

    def optics(self) -> dict[str, Any]:
        return {
            **super().optics(),
            "focal_length": self.focal_length,
            "coefficients": self.coefficients,
        }


@dataclass(frozen=True, kw_only=True)
class KannalaBrandt(Fisheye):
    """r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹), ``focal_length`` in mm, out to ``fov`` / 2.

    The lens ends where r stops growing with θ. Source: Kannala and Brandt 2006, equation 6, as
    OpenCV's fisheye module has it.
    """

    name = "kannala_brandt"
    title = "Kannala–Brandt fisheye"
    camera_types = ("FISHEYE_KANNALA_BRANDT",)
    Settings = KannalaBrandtSettings
    form = "FOCAL_LENGTH,SENSOR_WIDTH,K1,K2,K3,K4[,FOV]"

    focal_length: float
    coefficients: tuple[float, ...]
    fov: float = 2 * math.pi

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_focal_length(self.focal_length)
        checked_coefficients(self.coefficients, 4, "k1 to k4")

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        # θ + k1 θ³ + k2 θ⁵ + …: the even powers of θ have no coefficient.
        coefficients = np.zeros(10)
        coefficients[1::2] = (1.0, *self.coefficients)
        return IncreasingPolynomial(coefficients.tolist(), last=self.fov / 2)

    @property
    def _unit(self) -> Pair:
        # r is counted in focal lengths.
        return self._pixel_size(self.focal_length)

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

    def _to_camera(self) -> dict[str, Any]:
        return {
            "fisheye_lens": self.focal_length,
            **super()._to_camera(),
            "kannala_brandt": list(self.coefficients),
        }

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        return {
            **super()._from_camera(camera),
            "focal_length": float(camera["fisheye_lens"]),
            "coefficients": tuple(map(float, camera["kannala_brandt"])),
        }

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        return {
            "focal_length": numbers["FOCAL_LENGTH"],
            "coefficients": tuple(numbers[f"K{i}"] for i in range(1, 5)),
            "fov": numbers.get("FOV", 2 * math.pi),
        }
