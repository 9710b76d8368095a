"""The stereographic fisheye."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lightfield.geometry.lenses.base import Array, CircleFisheye, FisheyeSettings, fov_up_to

LARGEST_FOV = 359.9999  # degrees


class StereographicSettings(FisheyeSettings):
    """A stereographic fisheye in a scene YAML."""

    lens: Literal["stereographic"]
    fov: float = fov_up_to(LARGEST_FOV)


@dataclass(frozen=True, kw_only=True)
class Stereographic(CircleFisheye):
    """r = 2 f tan(θ/2). Source: Kannala and Brandt 2006, equation 2."""

    name = "stereographic"
    title = "stereographic fisheye"
    camera_types = ("FISHEYE_STEREOGRAPHIC",)
    Settings = StereographicSettings
    largest_fov = LARGEST_FOV

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        half = r * math.tan(self.fov / 4)
        square = half * half
        return 2 * half / (1 + square), (1 - half) * (1 + half) / (1 + square)

    def _radius(self, sin: Array, cos: Array) -> Array:
        # tan(θ/2), in the form in which nothing cancels.
        return np.where(cos > 0, sin / (1 + cos), (1 - cos) / sin) / math.tan(self.fov / 4)
