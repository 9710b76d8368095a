"""The panorama of longitudes and latitudes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import ANGLE_SLACK, Array, Lens, LensSettings, Pair
from lightfield.settings.base import as_list

Longitude = Annotated[float, Field(ge=-180, le=180)]
Latitude = Annotated[float, Field(ge=-90, le=90)]


class EquirectangularSettings(LensSettings):
    """A panorama, or a part of one, in a scene YAML."""

    lens: Literal["equirectangular"]
    longitude: Annotated[tuple[Longitude, Longitude], as_list(2)] = Field(
        (-180, 180),
        description="Longitudes of the image's left and right edges. 0 is straight ahead.",
        json_schema_extra={"unit": "degrees"},
    )
    latitude: Annotated[tuple[Latitude, Latitude], as_list(2)] = Field(
        (-90, 90),
        description="Latitudes of the image's bottom and top edges. 0 is straight ahead.",
        json_schema_extra={"unit": "degrees"},
    )

    def optics(self) -> dict[str, Any]:
        return {
            "longitude": tuple(map(math.radians, self.longitude)),
            "latitude": tuple(map(math.radians, self.latitude)),
        }


@dataclass(frozen=True, kw_only=True)
class Equirectangular(Lens):
    """Longitude linear in x, latitude linear in y, in radians. Source: Cycles' EQUIRECTANGULAR.

    A ray outside a partial range of longitudes goes to the nearer side of the frame. A pole, which
    has every longitude, goes to longitude 0.
    """

    name = "equirectangular"
    title = "equirectangular panorama"
    # SILVR's reprojection tool writes RECTILINEAR for its equirectangular panoramas.
    camera_types = ("EQUIRECTANGULAR", "RECTILINEAR")
    in_cycles = True
    Settings = EquirectangularSettings
    form = "LONG_MIN,LONG_MAX,LAT_MIN,LAT_MAX|full"

    longitude: Pair = (-math.pi, math.pi)
    latitude: Pair = (-math.pi / 2, math.pi / 2)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.principal_point is not None:
            raise UserError("principal_point: an equirectangular lens has none; use its ranges")
        for name, (low, high), largest in (
            ("longitude", self.longitude, math.inf),
            ("latitude", self.latitude, math.pi / 2),
        ):
            if not (low < high and max(-low, high) <= largest + ANGLE_SLACK):
                raise UserError(
                    f"{name}: {math.degrees(low):g} to {math.degrees(high):g} degrees "
                    "is not a range that grows within the sphere"
                )
        if self.longitude[1] - self.longitude[0] > 2 * math.pi + 2 * ANGLE_SLACK:
            raise UserError("longitude: the range is more than 360 degrees")

    @property
    def is_full(self) -> bool:
        """Whether it sees the whole sphere, the optical axis in its middle."""
        ranges = np.array([self.longitude, self.latitude])
        full_ranges = math.pi * np.array([[-1, 1], [-0.5, 0.5]])
        return bool((np.abs(ranges - full_ranges) <= ANGLE_SLACK).all())

    @property
    def turn(self) -> float:
        """The width of 360 degrees in pixels."""
        return self.width * 2 * math.pi / (self.longitude[1] - self.longitude[0])

    def _rays(self, x: Array, y: Array) -> Array:
        (west, east), (south, north) = self.longitude, self.latitude
        longitude = west + (east - west) * (x / self.width)
        latitude = north - (north - south) * (y / self.height)
        with np.errstate(invalid="ignore"):
            radius = np.maximum(np.cos(latitude), 0)
            right = radius * np.sin(longitude)
            ahead = -radius * np.cos(longitude)
            ray = np.stack([right, np.broadcast_to(np.sin(latitude), right.shape), ahead])
            outside = ~((np.abs(latitude) <= math.pi / 2 + ANGLE_SLACK) & np.isfinite(x))
        np.copyto(ray, np.nan, where=outside)
        return np.moveaxis(ray, 0, -1)

    def _pixels(self, rays: Array) -> Array:
        (west, east), (south, north) = self.longitude, self.latitude
        with np.errstate(invalid="ignore", divide="ignore"):
            rays = rays / np.abs(rays).max(axis=-1, keepdims=True)
        # 0 − z, not −z: atan2(0, −0) is π, and a pole belongs to longitude 0.
        longitude = np.arctan2(rays[..., 0], 0 - rays[..., 2])
        latitude = np.arctan2(rays[..., 1], np.hypot(rays[..., 0], rays[..., 2]))
        turns = np.round((longitude - (west + east) / 2) / (2 * math.pi))
        longitude = longitude - 2 * math.pi * turns
        x = (longitude - west) / (east - west) * self.width
        y = (north - latitude) / (north - south) * self.height
        return np.stack([x, y], axis=-1)

    @property
    def mirrors(self) -> tuple[bool, bool]:
        return sum(self.latitude) == 0, sum(self.longitude) == 0

    @property
    def has_z_depth(self) -> bool:
        return max(-self.longitude[0], self.longitude[1]) <= math.pi / 2 + ANGLE_SLACK

    def _to_camera(self) -> dict[str, Any]:
        return {
            "longitude_min": self.longitude[0],
            "longitude_max": self.longitude[1],
            "latitude_min": self.latitude[0],
            "latitude_max": self.latitude[1],
        }

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        return {
            name: (float(camera[f"{name}_min"]), float(camera[f"{name}_max"]))
            for name in ("longitude", "latitude")
        }

    @classmethod
    def from_flag(cls, text: str, width: int, height: int) -> Self:
        if text == "full":
            return cls(width=width, height=height)
        return super().from_flag(text, width, height)

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        return {
            "longitude": (numbers["LONG_MIN"], numbers["LONG_MAX"]),
            "latitude": (numbers["LAT_MIN"], numbers["LAT_MAX"]),
        }
