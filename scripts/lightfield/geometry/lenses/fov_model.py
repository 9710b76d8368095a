"""The FOV model of Devernay and Faugeras."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array, Pair
from lightfield.geometry.lenses.calibrated import (
    CalibratedSettings,
    ClosedForm,
    checked_range,
)
from lightfield.settings.base import as_list


class FovModelSettings(CalibratedSettings):
    """A lens of the FOV model in a scene YAML."""

    lens: Literal["fov_model"]
    coefficients: Annotated[tuple[float], as_list(1)] = Field(
        description="The coefficient omega: the field of view of the model's ideal fisheye, in "
        "radians, above 0 and below π."
    )


@dataclass(frozen=True, kw_only=True)
class FovModel(ClosedForm):
    """r = atan(2 tan θ tan(ω / 2)) / ω, r in focal lengths, out to ``fov`` / 2 radians.

    The lens ends at θ = 90°, r = π / (2 ω). Source: Devernay and Faugeras 2001; COLMAP's FOV.
    """

    name = "fov_model"
    title = "FOV-model lens"
    camera_types = ("FISHEYE_FOV_MODEL",)
    coefficient_names = ("omega",)
    Settings = FovModelSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        (omega,) = self.coefficients
        checked_range("omega", omega, 0 < omega < math.pi, "above 0 and below π (radians)")

    @property
    def _rim(self) -> Pair:
        return math.pi / 2, math.pi / (2 * self.coefficients[0])

    def _angle(self, r: Array) -> tuple[Array, Array]:
        (omega,) = self.coefficients
        sin = np.sin(omega * r)
        cos = 2 * math.tan(omega / 2) * np.cos(omega * r)
        length = np.hypot(sin, cos)
        return sin / length, cos / length

    def _distance(self, sin: Array, cos: Array) -> Array:
        (omega,) = self.coefficients
        return np.arctan2(2 * math.tan(omega / 2) * sin, cos) / omega
