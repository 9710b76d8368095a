"""The fisheye with six radial, two tangential and four thin-prism coefficients."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field

from lightfield.geometry.lenses.bent import Bend, BentLens
from lightfield.geometry.lenses.calibrated import (
    CalibratedSettings,
    PolynomialOfAngle,
    odd_polynomial,
)
from lightfield.geometry.lenses.increasing_polynomial import Increasing, IncreasingPolynomial
from lightfield.settings.base import as_list


class Fisheye624Settings(CalibratedSettings):
    """Project Aria's Fisheye624 in a scene YAML."""

    lens: Literal["fisheye624"]
    coefficients: Annotated[
        tuple[float, float, float, float, float, float, float, float, float, float, float, float],
        as_list(12),
    ] = Field(
        description="The coefficients k0 to k5, p0, p1 and s0 to s3, in Project Aria's order. k "
        "are radial, p are tangential, and s are the thin prism's."
    )


@dataclass(frozen=True, kw_only=True)
class Fisheye624(BentLens, PolynomialOfAngle):
    """r = f (θ + k0 θ³ + k1 θ⁵ + … + k5 θ¹³), bent by p0, p1 and s0 to s3 in the plane of r.

    ``coefficients`` are k0 to k5, p0, p1 and s0 to s3. Source: Project Aria's
    FisheyeRadTanThinPrism, which is COLMAP's RAD_TAN_THIN_PRISM_FISHEYE. COLMAP has no pixel for
    θ ≥ 90°; this lens has.
    """

    name = "fisheye624"
    title = "Fisheye624"
    camera_types = ("FISHEYE_624",)
    coefficient_names = (
        *("k0", "k1", "k2", "k3", "k4", "k5"),
        *("p0", "p1", "s0", "s1", "s2", "s3"),
    )
    Settings = Fisheye624Settings

    @property
    def _terms(self) -> list[float]:
        return odd_polynomial(self.coefficients[:6])

    @cached_property
    def _bend(self) -> Bend:
        p0, p1, s0, s1, s2, s3 = self.coefficients[6:]
        # Aria's y runs down.
        return Bend(tangential=(p0, -p1), prism=(s0, -s2), prism_growth=(s1, -s3))

    @cached_property
    def _plane(self) -> Increasing:
        # The bend acts on the points that the radial part has moved.
        last = float(self._increasing.value(self._increasing.end))
        return IncreasingPolynomial((0.0, 1.0), last=last)
