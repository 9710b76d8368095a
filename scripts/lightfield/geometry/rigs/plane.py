"""A plane: an upright wall of cameras that look along +Y."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lightfield.geometry.rigs.grid import Cell, Count, Grid, axis, grid, quads, square_outline
from lightfield.geometry.rigs.rig import UnitPoses, stack
from lightfield.geometry.rotations import Floats
from lightfield.settings.base import as_list


class Plane(Grid):
    """An upright wall of cameras that look along +Y."""

    shape = "PLANE"
    fewest = (2, 2)
    looks = "ahead"

    type: Literal["plane"]
    cameras: Annotated[tuple[Count, Count], as_list(2)] = Field(
        description="Number of cameras along x and along z."
    )

    baseline: float | None = Field(
        None,
        gt=0,
        le=1000,
        description="Distance between neighbouring cameras, along x and along z, in place of size. "
        "A preset that leaves out cameras keeps it.",
        json_schema_extra={"unit": "m"},
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if self.baseline is not None and "size" in self.model_fields_set:
            raise ValueError("baseline: does not go with size, which follows from it; give one")
        return self

    @property
    def extent(self) -> float | tuple[float, float, float]:
        if self.baseline is None:
            return super().extent
        columns, rows = self.cameras
        return (self.baseline * (columns - 1), 0.0, self.baseline * (rows - 1))

    @property
    def steps(self) -> list[float]:
        """The distances of neighbouring cameras across and down, in metres, where there are any."""
        sides = (float(self.sides[0]), float(self.sides[2]))
        return [
            side / (count - 1) for side, count in zip(sides, self.cameras, strict=True) if count > 1
        ]

    def unit_poses(self) -> UnitPoses:
        across, down = grid(axis(self.cameras[0]), -axis(self.cameras[1]))
        return UnitPoses.of_sides(("", stack(across, 0.0, down), np.array([math.pi / 2, 0.0, 0.0])))

    def cells(self) -> list[Cell]:
        columns, rows = self.cameras
        return quads(np.arange(columns * rows).reshape(rows, columns))

    def unit_outline(self) -> list[Floats]:
        return square_outline()
