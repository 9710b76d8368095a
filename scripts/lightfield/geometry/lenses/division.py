"""Fitzgibbon's division model."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array, Pair
from lightfield.geometry.lenses.calibrated import CalibratedSettings, ClosedForm
from lightfield.settings.base import as_list


class DivisionSettings(CalibratedSettings):
    """A lens of the division model in a scene YAML."""

    lens: Literal["division"]
    coefficients: Annotated[tuple[float], as_list(1)] = Field(
        description="The coefficient k of the division by 1 + k r². It is negative for a barrel "
        "distortion."
    )


@dataclass(frozen=True, kw_only=True)
class Division(ClosedForm):
    """tan θ = r / (1 + k r²), r in focal lengths, out to ``fov`` / 2 radians.

    With k > 0, the lens ends where θ stops growing with r, at r = 1 / √k. With k < 0, 1 + k r² is
    the cosine's sign, as in COLMAP: the lens sees beyond 90°. With k = 0, it is rectilinear.
    Source: Fitzgibbon 2001; COLMAP's SIMPLE_DIVISION and DIVISION.
    """

    name = "division"
    title = "division-model lens"
    camera_types = ("FISHEYE_DIVISION",)
    focuses_on_plane = True
    coefficient_names = ("k",)
    Settings = DivisionSettings

    @property
    def _rim(self) -> Pair:
        (k,) = self.coefficients
        if k > 0:
            return math.atan(1 / (2 * math.sqrt(k))), 1 / math.sqrt(k)
        return math.pi if k < 0 else math.pi / 2, math.inf

    def _angle(self, r: Array) -> tuple[Array, Array]:
        (k,) = self.coefficients
        cos = 1 + (k * r) * r
        length = np.hypot(r, cos)
        return r / length, cos / length

    def _distance(self, sin: Array, cos: Array) -> Array:
        (k,) = self.coefficients
        root = np.sqrt(np.maximum(cos * cos - 4 * k * sin * sin, 0))
        # Two forms of the same root of k r² sin θ − r cos θ + sin θ, in which nothing cancels.
        return np.where(cos > 0, 2 * sin / (cos + root), (root - cos) / (-2 * k * sin))
