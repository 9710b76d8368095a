"""The orthographic fisheye."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lightfield.geometry.lenses.base import Array, CircleFisheye, FisheyeSettings, fov_up_to

LARGEST_FOV = 180.0  # degrees


class OrthographicSettings(FisheyeSettings):
    """An orthographic fisheye in a scene YAML."""

    lens: Literal["orthographic"]
    fov: float = fov_up_to(LARGEST_FOV)


@dataclass(frozen=True, kw_only=True)
class Orthographic(CircleFisheye):
    """r = f sin θ. Source: Kannala and Brandt 2006, equation 5."""

    name = "orthographic"
    title = "orthographic fisheye"
    camera_types = ("FISHEYE_ORTHOGRAPHIC",)
    Settings = OrthographicSettings
    largest_fov = LARGEST_FOV

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        sin = np.minimum(r * math.sin(self.fov / 2), 1)
        return sin, np.sqrt((1 - sin) * (1 + sin))

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.where(cos >= 0, sin / math.sin(self.fov / 2), np.nan)
