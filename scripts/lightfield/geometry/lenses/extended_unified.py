"""The extended unified model of Khomutenko."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array
from lightfield.geometry.lenses.calibrated import CalibratedSettings, checked_range
from lightfield.geometry.lenses.sphere_projection import SphereProjection
from lightfield.settings.base import as_list


class ExtendedUnifiedSettings(CalibratedSettings):
    """A lens of the extended unified model in a scene YAML."""

    lens: Literal["extended_unified"]
    coefficients: Annotated[tuple[float, float], as_list(2)] = Field(
        description="The coefficients alpha, from 0 to 1, and beta, above 0."
    )


@dataclass(frozen=True, kw_only=True)
class ExtendedUnified(SphereProjection):
    """r = sin θ / (α d + (1 − α) cos θ), d = √(β sin² θ + cos² θ), out to ``fov`` / 2 radians.

    r is in focal lengths. With α > 0.5, the lens ends where r stops growing, at
    cos θ = −(1 − α) d / α. Otherwise, r is infinite at cos θ = −α d / (1 − α). Source: Khomutenko,
    Garcia and Martinet 2016; COLMAP's EUCM.
    """

    name = "extended_unified"
    title = "extended-unified-model fisheye"
    camera_types = ("FISHEYE_EXTENDED_UNIFIED",)
    coefficient_names = ("alpha", "beta")
    Settings = ExtendedUnifiedSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        alpha, beta = self.coefficients
        checked_range("alpha", alpha, 0 <= alpha <= 1, "from 0 to 1")
        checked_range("beta", beta, beta > 0, "above 0")

    @property
    def _scale(self) -> float:
        return math.sqrt(self.coefficients[1])

    @property
    def _bend(self) -> float:
        return 2 * self.coefficients[0] - 1

    def _sphere_point(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        return self._scale * sin, cos

    def _direction(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        across = sin / self._scale
        length = np.hypot(across, cos)
        return across / length, cos / length
