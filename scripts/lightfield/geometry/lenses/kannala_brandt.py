"""The fisheye of Kannala and Brandt, as OpenCV calibrates it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array, slack
from lightfield.geometry.lenses.calibrated import CalibratedLens, CalibratedSettings
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial
from lightfield.settings.base import as_list


class KannalaBrandtSettings(CalibratedSettings):
    """OpenCV's fisheye in a scene YAML."""

    lens: Literal["kannala_brandt"]
    coefficients: Annotated[tuple[float, float, float, float], as_list(4)] = Field(
        description="The coefficients k1 to k4 of the polynomial that gives the radius from the "
        "angle."
    )


@dataclass(frozen=True, kw_only=True)
class KannalaBrandt(CalibratedLens):
    """r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹), ``focal_length`` in mm, out to ``fov`` / 2.

    The lens ends where r stops growing with θ. Source: Kannala and Brandt 2006, equation 6, as
    OpenCV's fisheye module has it.
    """

    name = "kannala_brandt"
    title = "Kannala–Brandt fisheye"
    camera_types = ("FISHEYE_KANNALA_BRANDT",)
    coefficient_names = ("k1", "k2", "k3", "k4")
    Settings = KannalaBrandtSettings

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        # θ + k1 θ³ + k2 θ⁵ + …: the even powers of θ have no coefficient.
        coefficients = np.zeros(10)
        coefficients[1::2] = (1.0, *self.coefficients)
        return IncreasingPolynomial(coefficients.tolist(), last=self.fov / 2)

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
