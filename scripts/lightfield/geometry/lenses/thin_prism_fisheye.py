"""COLMAP's fisheye with tangential and thin-prism distortion."""

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
from lightfield.geometry.lenses.increasing_polynomial import Increasing
from lightfield.settings.base import as_list


class ThinPrismFisheyeSettings(CalibratedSettings):
    """COLMAP's THIN_PRISM_FISHEYE in a scene YAML."""

    lens: Literal["thin_prism_fisheye"]
    coefficients: Annotated[
        tuple[float, float, float, float, float, float, float, float], as_list(8)
    ] = Field(
        description="The coefficients k1, k2, p1, p2, k3, k4, sx1 and sy1, in COLMAP's order. k "
        "are radial, p are tangential, and s are the thin prism's."
    )


@dataclass(frozen=True, kw_only=True)
class ThinPrismFisheye(BentLens, PolynomialOfAngle):
    """r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹), bent by p1, p2, sx1 and sy1 in the plane of θ.

    ``coefficients`` are k1, k2, p1, p2, k3, k4, sx1 and sy1. Source: COLMAP's THIN_PRISM_FISHEYE,
    after Weng, Cohen and Herniou 1992. COLMAP has no pixel for θ ≥ 90°; this lens has.
    """

    name = "thin_prism_fisheye"
    title = "thin-prism fisheye"
    camera_types = ("FISHEYE_THIN_PRISM",)
    coefficient_names = ("k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1")
    Settings = ThinPrismFisheyeSettings

    @property
    def _terms(self) -> list[float]:
        k1, k2, _, _, k3, k4, *_ = self.coefficients
        return odd_polynomial((k1, k2, k3, k4))

    @cached_property
    def _bend(self) -> Bend:
        _, _, p1, p2, _, _, sx1, sy1 = self.coefficients
        # COLMAP's y runs down.
        return Bend(tangential=(p2, -p1), prism=(sx1, -sy1))

    @property
    def _plane(self) -> Increasing:
        return self._increasing
