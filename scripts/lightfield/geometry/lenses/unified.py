"""The unified model of Geyer, Barreto and Mei."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from lightfield.geometry.lenses.base import Array
from lightfield.geometry.lenses.calibrated import CalibratedSettings, checked_range
from lightfield.geometry.lenses.sphere_projection import SphereProjection
from lightfield.settings.base import as_list


class UnifiedSettings(CalibratedSettings):
    """A lens of the unified model in a scene YAML."""

    lens: Literal["unified"]
    coefficients: Annotated[tuple[float], as_list(1)] = Field(
        description="The coefficient xi: the distance from the sphere's centre to the point of "
        "projection, above -1. The focal length is Mei's gamma."
    )


@dataclass(frozen=True, kw_only=True)
class Unified(SphereProjection):
    """r = sin θ / (cos θ + ξ), r in focal lengths, out to ``fov`` / 2 radians.

    ``focal_length`` is Mei's γ, as in Kalibr's "omni" and OpenCV's omnidir: near the axis, r is
    θ / (1 + ξ). With ξ > 1, the lens ends where r stops growing, at cos θ = −1 / ξ. Otherwise, r is
    infinite at cos θ = −ξ. Source: Mei and Rives 2007, without distortion.
    """

    name = "unified"
    title = "unified-model fisheye"
    camera_types = ("FISHEYE_UNIFIED",)
    coefficient_names = ("xi",)
    Settings = UnifiedSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        (xi,) = self.coefficients
        checked_range("xi", xi, xi > -1, "above -1")

    @property
    def _scale(self) -> float:
        return 1 + self.coefficients[0]

    @property
    def _bend(self) -> float:
        (xi,) = self.coefficients
        return (xi - 1) / (xi + 1)

    def _sphere_point(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        return sin, cos

    def _direction(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        return sin, cos
