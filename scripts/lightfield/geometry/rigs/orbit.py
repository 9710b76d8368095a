"""The base class of rigs around an object: cameras on a sphere look at its middle."""

from abc import abstractmethod
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from lightfield.geometry.rigs.rig import CountedRig, UnitPoses, stack
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

    @property
    @abstractmethod
    def elevations(self) -> tuple[float, float]:
        """The elevations of the lowest and the highest camera, in degrees."""

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
        """Return the circles at the lowest and highest elevation, and four arcs between them."""
        low, high = np.radians(self.elevations)
        around = np.linspace(0, 2 * np.pi, 73)
        # The widest circle is the equator, if cameras are below and above it.
        heights = sorted({low, high, min(max(low, 0.0), high)})
        circles = [on_sphere(around, np.full(73, np.sin(height))) / 2 for height in heights]
        if low == high:
            return circles
        rising = np.sin(np.linspace(low, high, 37))
        arcs = [on_sphere(np.full(37, azimuth), rising) / 2 for azimuth in around[:72:18]]
        return circles + arcs


def on_sphere(azimuth: Floats, height: Floats) -> Floats:
    """Return points (n, 3) of the sphere of radius 1 at azimuths in radians and heights."""
    around = np.sqrt(np.maximum(1 - height**2, 0))
    return stack(around * np.sin(azimuth), around * np.cos(azimuth), height)
