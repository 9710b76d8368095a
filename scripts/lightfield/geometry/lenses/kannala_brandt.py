"""The fisheye of Kannala and Brandt, as OpenCV calibrates it."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from lightfield.geometry.lenses.calibrated import (
    CalibratedSettings,
    PolynomialOfAngle,
    odd_polynomial,
)
from lightfield.settings.base import as_list


class KannalaBrandtSettings(CalibratedSettings):
    """OpenCV's fisheye in a scene YAML."""

    lens: Literal["kannala_brandt"]
    coefficients: Annotated[tuple[float, float, float, float], as_list(4)] = Field(
        description="The coefficients k1 to k4 of the polynomial that gives the radius from the "
        "angle."
    )


@dataclass(frozen=True, kw_only=True)
class KannalaBrandt(PolynomialOfAngle):
    """r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹), ``focal_length`` in mm, out to ``fov`` / 2.

    The lens ends where r stops growing with θ. Source: Kannala and Brandt 2006, equation 6, as
    OpenCV's fisheye module has it.
    """

    name = "kannala_brandt"
    title = "Kannala–Brandt fisheye"
    camera_types = ("FISHEYE_KANNALA_BRANDT",)
    coefficient_names = ("k1", "k2", "k3", "k4")
    Settings = KannalaBrandtSettings

    @property
    def _terms(self) -> list[float]:
        return odd_polynomial(self.coefficients)
