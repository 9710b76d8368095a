"""The double-sphere model of Usenko."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array
from lightfield.geometry.lenses.calibrated import CalibratedSettings, checked_range
from lightfield.geometry.lenses.sphere_projection import SphereProjection
from lightfield.settings.base import as_list


class DoubleSphereSettings(CalibratedSettings):
    """A lens of the double-sphere model in a scene YAML."""

    lens: Literal["double_sphere"]
    coefficients: Annotated[tuple[float, float], as_list(2)] = Field(
        description="The coefficients xi, above -1 and below 1, and alpha, from 0 to 1."
    )


@dataclass(frozen=True, kw_only=True)
class DoubleSphere(SphereProjection):
    """r = sin θ / (α d + (1 − α)(ξ + cos θ)), d = √(sin² θ + (ξ + cos θ)²), out to ``fov`` / 2.

    r is in focal lengths. With α > 0.5, the lens ends where r stops growing, or else where r is
    infinite: both at cos θ = −w2. Source: Usenko, Demmel and Cremers 2018.
    """

    name = "double_sphere"
    title = "double-sphere fisheye"
    camera_types = ("FISHEYE_DOUBLE_SPHERE",)
    coefficient_names = ("xi", "alpha")
    Settings = DoubleSphereSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        xi, alpha = self.coefficients
        checked_range("xi", xi, -1 < xi < 1, "above -1 and below 1")
        checked_range("alpha", alpha, 0 <= alpha <= 1, "from 0 to 1")

    @property
    def _scale(self) -> float:
        return 1.0

    @property
    def _bend(self) -> float:
        return 2 * self.coefficients[1] - 1

    def _sphere_point(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        xi, _ = self.coefficients
        # ξ + cos θ, in the forms in which nothing cancels near θ = 0 and 180°.
        square = sin * sin
        ahead = (xi + 1) - square / (1 + cos)
        behind = (xi - 1) + square / (1 - cos)
        return sin, np.where(cos > 0, ahead, behind)

    def _direction(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        xi, _ = self.coefficients
        # From the second sphere's centre to the first sphere, in the form in which nothing cancels.
        rest = (1 - xi) * (1 + xi)
        root = np.sqrt(rest + (xi * cos) ** 2)
        reach = np.where(xi * cos > 0, xi * cos + root, rest / (root - xi * cos))
        across, along = reach * sin, reach * cos - xi
        # Rounded to a unit vector, which is exact on the axis.
        length = np.hypot(across, along)
        return across / length, along / length
