"""The equidistant fisheye."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lightfield.geometry.lenses.base import Array, CircleFisheye, FisheyeSettings, fov_up_to

LARGEST_FOV = 360.0  # degrees


class EquidistantSettings(FisheyeSettings):
    """An equidistant fisheye in a scene YAML."""

    lens: Literal["equidistant"]
    fov: float = fov_up_to(LARGEST_FOV)


@dataclass(frozen=True, kw_only=True)
class Equidistant(CircleFisheye):
    """r = f θ. Source: Kannala and Brandt 2006, equation 3; Cycles' FISHEYE_EQUIDISTANT."""

    name = "equidistant"
    title = "equidistant fisheye"
    camera_types = ("FISHEYE_EQUIDISTANT",)
    in_cycles = True
    Settings = EquidistantSettings
    largest_fov = LARGEST_FOV

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = np.minimum(r * (self.fov / 2), math.pi)
        return np.maximum(np.sin(theta), 0), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.arctan2(sin, cos) / (self.fov / 2)
