"""A plane: an upright wall of cameras that look along +Y."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.core.settings import as_list
from lightfield.geometry.rigs.grid import Cell, Count, Grid, axis, grid, quads, square_outline
from lightfield.geometry.rigs.rig import UnitPoses, stack
from lightfield.geometry.rotations import Floats


class Plane(Grid):
    shape = "PLANE"
    fewest = (2, 2)

    type: Literal["plane"]
    cameras: Annotated[tuple[Count, Count], as_list(2)] = Field(
        description="Number of cameras along x and along z."
    )

    def unit_poses(self) -> UnitPoses:
        across, down = grid(axis(self.cameras[0]), -axis(self.cameras[1]))
        return UnitPoses.of_sides(("", stack(across, 0.0, down), np.array([math.pi / 2, 0.0, 0.0])))

    def cells(self) -> list[Cell]:
        columns, rows = self.cameras
        return quads(np.arange(columns * rows).reshape(rows, columns))

    def unit_outline(self) -> list[Floats]:
        return square_outline()
