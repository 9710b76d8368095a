"""A ring around an object: cameras at one elevation, spread evenly, look at the middle."""

import math
from typing import Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.rigs.orbit import Elevation, Orbit, on_sphere
from lightfield.geometry.rotations import Floats


class Ring(Orbit):
    """Cameras around an object, spread evenly at one elevation, that look at its middle."""

    type: Literal["ring"]
    elevation: Elevation = Field(
        0.0,
        description="Elevation of all cameras above the horizontal, as seen from the middle.",
        json_schema_extra={"unit": "degrees"},
    )

    @property
    def elevations(self) -> tuple[float, float]:
        return (self.elevation, self.elevation)

    def directions(self) -> Floats:
        azimuth = 2 * np.pi * np.arange(self.count) / self.count
        return on_sphere(azimuth, np.full(self.count, math.sin(math.radians(self.elevation))))
