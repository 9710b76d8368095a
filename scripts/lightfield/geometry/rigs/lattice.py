"""A lattice: cameras that fill a box, all looking along +Y."""

import math
from typing import Literal

import numpy as np

from lightfield.geometry.rigs.grid import BoxGrid, Cell, axis, grid, quads
from lightfield.geometry.rigs.rig import UnitPoses, stack


class Lattice(BoxGrid):
    """Cameras that fill a box, all looking along +Y."""

    looks = "ahead"

    type: Literal["lattice"]

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
