"""A spiral around an object: cameras rise while they go round it, and look at the middle."""

from typing import Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.rigs.orbit import Elevations, Orbit, on_sphere
from lightfield.geometry.rotations import Floats


class Spiral(Orbit):
    """Cameras that rise while they go round an object, and look at its middle."""

    type: Literal["spiral"]
    turns: float = Field(
        2.0,
        gt=0,
        le=1000,
        description="How many times the spiral goes around the object.",
        json_schema_extra={"unit": "turns"},
    )
    elevation: Elevations = Field(
        (0.0, 60.0),
        description="Elevation of the first and the last camera above the horizontal, as seen from "
        "the middle.",
        json_schema_extra={"unit": "degrees"},
    )

    @property
    def elevations(self) -> tuple[float, float]:
        return self.elevation

    def directions(self) -> Floats:
        along = np.linspace(0, 1, self.count)
        low, high = np.radians(self.elevation)
        return on_sphere(2 * np.pi * self.turns * along, np.sin(low + (high - low) * along))
