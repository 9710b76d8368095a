"""The lenses of calibrated cameras: a focal length, a principal point and coefficients."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lightfield.geometry.lenses.base import (
    Fisheye,
    FisheyeSettings,
    FocalLength,
    Pair,
    checked_coefficients,
    checked_focal_length,
    fov_up_to,
)


class CalibratedSettings(FisheyeSettings):
    """A calibrated camera in a scene YAML. Each lens adds its coefficients."""

    focal_length: FocalLength
    coefficients: tuple[float, ...]
    fov: float = fov_up_to(360, default=360)

    def optics(self) -> dict[str, Any]:
        return {
            **super().optics(),
            "focal_length": self.focal_length,
            "coefficients": self.coefficients,
        }


@dataclass(frozen=True, kw_only=True)
class CalibratedLens(Fisheye):
    """A lens of ``focal_length`` mm with ``coefficients``, out to ``fov`` / 2 radians.

    r is counted in focal lengths. Pixels that are not square have two focal lengths in pixels:
    focal_length · width / sensor width, and focal_length · height / sensor height. In
    lightfield.json, the coefficients stand under the lens's name.
    """

    coefficient_names: ClassVar[tuple[str, ...]]

    focal_length: float
    coefficients: tuple[float, ...]
    fov: float = 2 * math.pi

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "name" in vars(cls):
            names = ",".join(cls.coefficient_names).upper()
            cls.form = f"FOCAL_LENGTH,SENSOR_WIDTH,{names}[,FOV]"

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_focal_length(self.focal_length)
        first, *_, last = self.coefficient_names * 2
        names = first if len(self.coefficient_names) == 1 else f"{first} to {last}"
        checked_coefficients(self.coefficients, len(self.coefficient_names), names)

    @property
    def _unit(self) -> Pair:
        return self._pixel_size(self.focal_length)

    def _to_camera(self) -> dict[str, Any]:
        return {
            "fisheye_lens": self.focal_length,
            **super()._to_camera(),
            self.name: list(self.coefficients),
        }

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        return {
            **super()._from_camera(camera),
            "focal_length": float(camera["fisheye_lens"]),
            "coefficients": tuple(map(float, camera[cls.name])),
        }

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        return {
            "focal_length": numbers["FOCAL_LENGTH"],
            "coefficients": tuple(numbers[name.upper()] for name in cls.coefficient_names),
            "fov": numbers.get("FOV", 2 * math.pi),
        }
