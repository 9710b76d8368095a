"""A cylinder: rings of cameras round z, open above and below, each looking outward."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.rigs.grid import Cell, Count, Grid, axis, grid, quads
from lightfield.geometry.rigs.rig import UnitPoses, circle, stack
from lightfield.geometry.rotations import Floats
from lightfield.settings.base import as_list


class Cylinder(Grid):
    """Rings of cameras around the z axis, open above and below, each looking outward."""

    shape = "CYLINDER"
    fewest = (3, 2)
    is_round = True

    type: Literal["cylinder"]
    cameras: Annotated[tuple[Count, Count], as_list(2)] = Field(
        description="Number of cameras around each ring, and number of rings from bottom to top."
    )

    def unit_poses(self) -> UnitPoses:
        columns, rows = self.cameras
        angle, down = grid(2 * np.pi * np.arange(columns) / columns, -axis(rows))
        places = stack(0.5 * np.sin(angle), 0.5 * np.cos(angle), down)
        return UnitPoses.of_sides(("", places, stack(math.pi / 2, 0.0, -angle)))

    def cells(self) -> list[Cell]:
        columns, rows = self.cameras
        numbers = np.arange(columns * rows).reshape(rows, columns)
        return quads(np.column_stack([numbers, numbers[:, 0]]))

    def unit_outline(self) -> list[Floats]:
        cosine, sine = circle()
        rings = [stack(cosine, sine, z) for z in (-0.5, 0.5)]
        sides = [
            np.array([[x, y, -0.5], [x, y, 0.5]])
            for x, y in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5))
        ]
        return rings + sides
