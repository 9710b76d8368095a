"""A hemisphere around an object: cameras spread evenly over elevations, looking at the middle."""

import math
from typing import Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.rigs.orbit import Elevations, Orbit, on_sphere
from lightfield.geometry.rotations import Floats

GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


class Hemisphere(Orbit):
    """Cameras around an object, spread evenly over elevations, that look at its middle."""

    type: Literal["hemisphere"]
    elevation: Elevations = Field(
        (0.0, 90.0),
        description="Elevation of the lowest and the highest camera above the horizontal, as seen "
        "from the middle.",
        json_schema_extra={"unit": "degrees"},
    )
    pattern: Literal["fibonacci", "rings"] = Field(
        "fibonacci",
        description="How the cameras are spread. fibonacci: a spiral with the golden angle between "
        "cameras. rings: rings with equal distances.",
    )

    @property
    def elevations(self) -> tuple[float, float]:
        return self.elevation

    def directions(self) -> Floats:
        if self.pattern == "fibonacci":
            low, high = (math.sin(math.radians(angle)) for angle in self.elevation)
            # Equal steps of height are equal areas. Source: Gonzalez 2010, "Measurement of areas on
            # a sphere using Fibonacci and latitude-longitude lattices".
            number = np.arange(self.count, dtype=np.float64)
            height = low + (high - low) * (number + 0.5) / self.count
            return on_sphere(GOLDEN_ANGLE * number, height)
        lowest, highest = np.radians(self.elevation)
        rows = max(1, round(math.sqrt(self.count * (highest - lowest) / (2 * math.pi))))
        elevations = np.linspace(lowest, highest, 2 * rows + 1)[1::2]
        # Each ring has cameras in proportion to its length. Rounding keeps the sum.
        ends = np.round(self.count * np.cumsum(np.cos(elevations)) / np.cos(elevations).sum())
        counts = np.diff(ends, prepend=0).astype(int)
        azimuth = np.concatenate([2 * np.pi * np.arange(n) / n for n in counts if n])
        return on_sphere(azimuth, np.repeat(np.sin(elevations), counts))
