"""The equisolid fisheye."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from lightfield.geometry.lenses.base import (
    Array,
    Fisheye,
    FisheyeSettings,
    FocalLength,
    Pair,
    checked_focal_length,
    fov_up_to,
)


class EquisolidSettings(FisheyeSettings):
    """An equisolid fisheye in a scene YAML."""

    lens: Literal["equisolid"]
    focal_length: FocalLength
    fov: float = fov_up_to(360)

    def optics(self) -> dict[str, Any]:
        return {**super().optics(), "focal_length": self.focal_length}


@dataclass(frozen=True, kw_only=True)
class Equisolid(Fisheye):
    """r = 2 f sin(θ/2), ``focal_length`` in mm, out to ``fov`` / 2 radians.

    Source: Kannala and Brandt 2006, equation 4; Cycles' FISHEYE_EQUISOLID.
    """

    name = "equisolid"
    title = "equisolid fisheye"
    camera_types = ("FISHEYE_EQUISOLID",)
    in_cycles = True
    Settings = EquisolidSettings
    form = "FOCAL_LENGTH,SENSOR_WIDTH,FOV"

    focal_length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_focal_length(self.focal_length)

    @property
    def _unit(self) -> Pair:
        # r is counted in diameters 2 f of the projection, so it is sin(θ/2).
        return self._pixel_size(2 * self.focal_length)

    @property
    def _limit(self) -> float:
        return math.sin(min(self.fov, 2 * math.pi) / 4)

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        r = np.minimum(r, 1)
        return 2 * r * np.sqrt((1 - r) * (1 + r)), 1 - 2 * r * r

    def _radius(self, sin: Array, cos: Array) -> Array:
        # sin(θ/2), in the form in which nothing cancels.
        near = sin / np.sqrt(2 * (1 + np.maximum(cos, 0)))
        return np.where(cos > 0, near, np.sqrt((1 - cos) / 2))

    def _to_camera(self) -> dict[str, Any]:
        # SILVR's documentation has `lens`, its programs have `fisheye_lens`.
        lengths = {"fisheye_lens": self.focal_length, "lens": self.focal_length}
        return {**lengths, **super()._to_camera()}

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        focal_length = camera["fisheye_lens" if "fisheye_lens" in camera else "lens"]
        return {**super()._from_camera(camera), "focal_length": float(focal_length)}
