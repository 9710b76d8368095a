"""A lattice: cameras that fill a box, all looking along +Y."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lightfield.core.settings import as_list
from lightfield.geometry.rigs.grid import Cell, Count, Grid, axis, box_outline, grid, quads
from lightfield.geometry.rigs.rig import UnitPoses, stack
from lightfield.geometry.rotations import Floats


class Lattice(Grid):
    shape = "CUBOID"
    fewest = (2, 2, 2)
    unit_volume = 1.0

    type: Literal["lattice"]
    cameras: Annotated[tuple[Count, Count, Count], as_list(3)] = Field(
        description="Cameras along x, y and z."
    )

    def unit_poses(self) -> UnitPoses:
        x, y, z = (axis(count) for count in self.cameras)
        across, layer = grid(x, np.repeat(-z, len(y)))
        back = np.tile(np.repeat(y, len(x)), len(z))
        return UnitPoses.of_sides(
            ("", stack(across, back, layer), np.array([math.pi / 2, 0.0, 0.0]))
        )

    def _row(self) -> tuple[int, int]:
        nx, ny, nz = self.cameras
        return (nz // 2 * ny + ny // 2) * nx, nx

    def cells(self) -> list[Cell]:
        nx, ny, nz = self.cameras
        index = np.arange(nx * ny * nz).reshape(nz, ny, nx)
        faces = [index[0], index[-1], index[:, 0], index[:, -1], index[:, :, 0], index[:, :, -1]]
        return [cell for face in faces for cell in quads(face)]

    def unit_outline(self) -> list[Floats]:
        return box_outline()
