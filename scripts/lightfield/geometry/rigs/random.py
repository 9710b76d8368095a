"""Random places in a box, each with free space around it, level and in any direction."""

from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic.json_schema import SkipJsonSchema

from lightfield.core.errors import UserError
from lightfield.core.files import read_keys
from lightfield.geometry.rigs.grid import box_outline
from lightfield.geometry.rigs.rig import CountedRig, UnitPoses, stack
from lightfield.geometry.rotations import Floats

# The settings that determine the places, together with the scene.
BOX = {"count", "seed", "clearance", "size", "center", "rotation"}


class Random(CountedRig):
    """Cameras at random places in free space, with at least ``clearance`` around them.

    ``file`` is not for scene YAMLs: scripts/free_places.py writes the free places to it. Without
    it, the rig places its cameras as in an empty scene.
    """

    shape = "CUBOID"
    looks = "anywhere"

    type: Literal["random"]
    seed: int = Field(
        0,
        ge=0,
        le=2**31 - 1,
        description="Seed of the random places. Another seed gives other places.",
    )
    clearance: float = Field(
        0.2,
        gt=0,
        le=1000,
        description="Smallest allowed distance from a camera to the nearest surface.",
        json_schema_extra={"unit": "m"},
    )
    file: SkipJsonSchema[str | None] = None

    @model_validator(mode="after")
    def _stands_still(self) -> Self:
        if self.frames is not None:
            raise ValueError(
                "frames: does not go with type random, whose places are free at one frame only"
            )
        return self

    def placed(self, file: Path | str) -> Self:
        """Return the rig with its cameras at the places in a file."""
        return self.model_copy(update={"file": str(file)})

    @property
    def box(self) -> dict[str, Any]:
        """The settings that determine the places, as values of JSON."""
        return self.model_dump(mode="json", include=BOX)

    def unit_poses(self) -> UnitPoses:
        if self.file is None:
            places = np.stack([self.candidate(view, 0) for view in range(self.count)])
        else:
            places = self._places_from_file()
        directions = [self._numbers(view)[0] for view in range(self.count)]
        azimuth = 2 * np.pi * np.array(directions)
        return UnitPoses.of_sides(("", places, stack(np.pi / 2, 0.0, azimuth)))

    def _places_from_file(self) -> Floats:
        written = read_keys(str(self.file), "free_places.py", "box", "places")["places"]
        try:
            positions = np.array(written, float)
        except (TypeError, ValueError):
            positions = np.empty(0)
        if positions.shape != (self.count, 3):
            raise UserError(f"{self.file}: places: must be {self.count} of 3 numbers each")
        return positions

    def unit_outline(self) -> list[Floats]:
        return box_outline()

    def candidate(self, view: int, number: int) -> Floats:
        """Return the ``number``-th place (3,) in the unit box for a view."""
        return self._numbers(view, number + 1)[-3:] - 0.5

    def _numbers(self, view: int, places: int = 0) -> Floats:
        """Return a view's random numbers from 0 to 1: one for its direction, three for a place."""
        numbers: Floats = np.random.default_rng([self.seed, view]).random(1 + 3 * places)
        return numbers
