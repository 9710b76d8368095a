"""NVIDIA's f-theta fisheye."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from lightfield.geometry.lenses.calibrated import CalibratedSettings, PolynomialOfAngle
from lightfield.settings.base import as_list


class FThetaSettings(CalibratedSettings):
    """NVIDIA's f-theta fisheye in a scene YAML."""

    lens: Literal["f_theta"]
    coefficients: Annotated[tuple[float, float, float, float], as_list(4)] = Field(
        description="The coefficients k2 to k5 of the polynomial that gives the radius from the "
        "angle. NVIDIA's, in pixels, are these times the focal length in pixels."
    )


@dataclass(frozen=True, kw_only=True)
class FTheta(PolynomialOfAngle):
    """r = f (θ + k2 θ² + k3 θ³ + k4 θ⁴ + k5 θ⁵), ``focal_length`` in mm, out to ``fov`` / 2.

    The lens ends where r stops growing with θ. Source: NVIDIA's NCore, whose
    angle_to_pixeldist_poly is in pixels: 0, f, f k2, f k3, f k4, f k5.
    """

    name = "f_theta"
    title = "f-theta fisheye"
    camera_types = ("FISHEYE_F_THETA",)
    coefficient_names = ("k2", "k3", "k4", "k5")
    Settings = FThetaSettings

    @property
    def _terms(self) -> list[float]:
        return [0.0, 1.0, *self.coefficients]
