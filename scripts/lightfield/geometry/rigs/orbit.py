"""The base class of rigs around an object: cameras on a sphere look at its middle."""

from abc import abstractmethod
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from lightfield.geometry.rigs.rig import CountedRig, UnitPoses, ball_outline, stack
from lightfield.geometry.rotations import Floats, looking_at, matrix_to_euler
from lightfield.settings.base import as_list

Elevation = Annotated[float, Field(ge=-90, le=90)]


def _growing(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise ValueError(f"must have the smaller value first, not {list(limits)}")
    return limits


Elevations = Annotated[tuple[Elevation, Elevation], as_list(2), AfterValidator(_growing)]


class Orbit(CountedRig):
    """``size`` is the sphere's diameter, or an ellipsoid's along x, y and z.

    Cameras of an ellipsoid look at its middle, too.
    """

    shape = "SPHERE"
    is_round = True
    looks = "inward"

    @model_validator(mode="after")
    def _faces_inside_already(self) -> Self:
        if self.face_inside:
            raise ValueError(
                f"face_inside: does not go with type {self.type}, whose cameras look inside already"
            )
        return self

    @abstractmethod
    def directions(self) -> Floats:
        """Return the cameras' places on the sphere of radius 1, (count, 3)."""

    def unit_poses(self) -> UnitPoses:
        places = self.directions() / 2
        # Divide by the longest side, so that a sphere's places are exactly as in the unit box.
        longest = max(self.sides.tolist())
        from_middle = places * (self.sides / (longest or 1.0))
        at_middle = ~from_middle.any(axis=-1)
        # A camera in the middle, of a rig without extent, looks as it would in the unit box.
        from_middle[at_middle] = places[at_middle]
        turns = matrix_to_euler(looking_at(from_middle, np.zeros(3)))
        return UnitPoses.of_sides(("", places, turns))

    def unit_outline(self) -> list[Floats]:
        return ball_outline()


def on_sphere(azimuth: Floats, height: Floats) -> Floats:
    """Return points (n, 3) of the sphere of radius 1 at azimuths in radians and heights."""
    around = np.sqrt(np.maximum(1 - height**2, 0))
    return stack(around * np.sin(azimuth), around * np.cos(azimuth), height)
