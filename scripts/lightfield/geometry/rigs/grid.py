"""The base class of rigs that have a number of cameras along each axis."""

import math
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.geometry.rigs.rig import Rig
from lightfield.geometry.rotations import Floats
from lightfield.settings.base import as_list

Count = Annotated[int, Field(ge=1, le=2000)]
Cell = tuple[int, ...]

_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]])


class Grid(Rig):
    """A rig of ``cameras`` along each axis. A thinned rig keeps at least ``fewest`` if it can."""

    fewest: ClassVar[tuple[int, ...]]

    cameras: tuple[int, ...]

    @staticmethod
    def count(cameras: tuple[int, ...]) -> int:
        """Return the number of positions that this many cameras along each axis make."""
        return math.prod(cameras)

    @property
    def positions(self) -> int:
        return self.count(self.cameras)

    def middle_row(self, places: Floats) -> list[int]:
        first, columns = self._row()
        return list(range(first, first + columns))

    def _row(self) -> tuple[int, int]:
        """Return the first number and the length of the row in the middle."""
        return self.cameras[1] // 2 * self.cameras[0], self.cameras[0]

    def _thinned_to(self, positions: int) -> Self | None:
        """Remove cameras from the axis that has kept the largest part of its cameras.

        So all axes thin alike. Each axis keeps ``fewest`` as long as the number of views allows.
        """
        for fewest in (self.fewest, [1] * len(self.cameras)):
            counts = list(self.cameras)
            axes = range(len(counts))
            while self.count(tuple(counts)) > positions:
                shortenable = [axis for axis in axes if counts[axis] > fewest[axis]]
                if not shortenable:
                    break
                parts = {axis: counts[axis] / self.cameras[axis] for axis in shortenable}
                # Of equal parts the last axis, the vertical one, loses a camera first.
                fullest = max(shortenable, key=lambda axis: (parts[axis], axis))
                counts[fullest] -= 1
            else:
                return self.model_copy(update={"cameras": self._filled(counts, positions)})
        return None

    def _filled(self, counts: list[int], positions: int) -> tuple[int, ...]:
        """Return ``counts`` with as many cameras added back as fit, axis by axis."""
        for axis, full in enumerate(self.cameras):
            while counts[axis] < full:
                counts[axis] += 1
                if self.count(tuple(counts)) > positions:
                    counts[axis] -= 1
                    break
        return tuple(counts)


class BoxGrid(Grid):
    shape = "CUBOID"
    fewest = (2, 2, 2)

    cameras: Annotated[tuple[Count, Count, Count], as_list(3)] = Field(
        description="Number of cameras along x, y and z."
    )

    def unit_outline(self) -> list[Floats]:
        return box_outline()


def axis(count: int) -> Floats:
    """Return evenly spaced places from −½ to ½. A single place is in the middle."""
    return np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)


def grid(columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return the column's and the row's value of each camera, row by row."""
    return np.tile(columns, len(rows)), np.repeat(rows, len(columns))


def quads(numbers: NDArray[Any]) -> list[Cell]:
    """Return the cells of a grid (rows, columns), which holds the numbers of positions."""
    corners = (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1])
    return [tuple(map(int, cell)) for cell in np.stack(corners, axis=-1).reshape(-1, 4)]


def square_outline() -> list[Floats]:
    """Return an upright square, perpendicular to y."""
    return [np.stack([_SQUARE[:, 0], np.zeros(5), _SQUARE[:, 1]], axis=-1)]


def box_outline() -> list[Floats]:
    faces = [np.column_stack([_SQUARE, np.full(5, z)]) for z in (-0.5, 0.5)]
    edges = [np.array([[x, y, -0.5], [x, y, 0.5]]) for x, y in _SQUARE[:4]]
    return faces + edges
