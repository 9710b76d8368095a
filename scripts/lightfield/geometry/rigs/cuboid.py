"""A cuboid: cameras on its six sides, each looking outward."""

import math
from typing import Literal

import numpy as np

from lightfield.geometry.rigs.grid import BoxGrid, Cell, axis, grid, quads
from lightfield.geometry.rigs.rig import UnitPoses, stack


class Cuboid(BoxGrid):
    """Cameras on the six sides of a cuboid, each looking outward."""

    type: Literal["cuboid"]

    @staticmethod
    def count(cameras: tuple[int, ...]) -> int:
        nx, ny, nz = cameras
        return 2 * (nx * nz + ny * nz + nx * ny)

    def unit_poses(self) -> UnitPoses:
        x, y, z = (axis(count) for count in self.cameras)
        front, back = grid(x, -z), grid(-x, -z)
        left, right = grid(y, -z), grid(-y, -z)
        up, down = grid(-x, y), grid(x, -y)
        level = math.pi / 2
        return UnitPoses.of_sides(
            ("f", stack(front[0], 0.5, front[1]), np.array([level, 0.0, 0.0])),
            ("b", stack(back[0], -0.5, back[1]), np.array([level, 0.0, math.pi])),
            ("l", stack(-0.5, *left), np.array([level, 0.0, math.pi / 2])),
            ("r", stack(0.5, *right), np.array([level, 0.0, -math.pi / 2])),
            ("u", stack(*up, 0.5), np.array([math.pi, 0.0, 0.0])),
            ("d", stack(*down, -0.5), np.array([0.0, 0.0, 0.0])),
        )

    def _row(self) -> tuple[int, int]:
        nx, ny, nz = self.cameras
        # The row is on the longer of the front and the left side.
        if nx >= ny:
            return nz // 2 * nx, nx
        # The left side follows the front and the back, which have nx · nz cameras each.
        return 2 * nx * nz + nz // 2 * ny, ny

    def cells(self) -> list[Cell]:
        nx, ny, nz = self.cameras
        cells = []
        start = 0
        for columns, rows in ((nx, nz), (nx, nz), (ny, nz), (ny, nz), (nx, ny), (nx, ny)):
            cells += quads(np.arange(start, start + columns * rows).reshape(rows, columns))
            start += columns * rows
        return cells
