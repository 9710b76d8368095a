"""Images with mirror symmetry: only a part is computed, and the image is unfolded from it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lightfield.geometry.lenses import Array, Lens

_Index = tuple[slice, slice]


@dataclass(frozen=True)
class Fold:
    """An image of ``shape`` (H, W) whose halves may mirror each other.

    ``mirrors`` says whether the lower half mirrors the upper half, and the right half the left.
    """

    shape: tuple[int, int]
    mirrors: tuple[bool, bool] = (False, False)

    @classmethod
    def of_map(cls, source: Lens, target: Lens, rotation: Array) -> "Fold":
        """Return the symmetry of a lens map's coordinates.

        A map has a symmetry if both lenses have it, and the rotation (3, 3) does not move its axis.
        """
        # Rows mirror y, and columns mirror x.
        keeps_y = not np.delete(rotation[1], 1).any()
        keeps_x = not np.delete(rotation[0], 0).any()
        down = source.mirrors[0] and target.mirrors[0] and keeps_y
        across = source.mirrors[1] and target.mirrors[1] and keeps_x
        return cls((target.height, target.width), (down, across))

    @property
    def part(self) -> tuple[int, int]:
        """The height and width of the upper left part, from which the image follows."""
        height, width = self.shape
        if self.mirrors[0]:
            height = math.ceil(height / 2)
        if self.mirrors[1]:
            width = math.ceil(width / 2)
        return height, width

    def _pieces(self) -> Iterator[tuple[_Index, _Index, tuple[int, ...]]]:
        """Yield the four pieces of the image: its place, its origin in the part, the flipped axes.

        Pieces beyond an axis without symmetry are empty.
        """
        height, width = self.shape
        part_height, part_width = self.part
        upper = (slice(part_height), slice(part_height))
        lower = (slice(part_height, height), slice(height - part_height))
        left = (slice(part_width), slice(part_width))
        right = (slice(part_width, width), slice(width - part_width))
        for (rows, from_rows), (columns, from_columns), flipped in (
            (upper, left, ()),
            (upper, right, (1,)),
            (lower, left, (0,)),
            (lower, right, (0, 1)),
        ):
            yield (rows, columns), (from_rows, from_columns), flipped

    def unfolded(self, part: Array) -> Array:
        """Return the image of a part (h, w, …) whose values do not depend on the side."""
        out = np.empty((*self.shape, *part.shape[2:]), part.dtype)
        for piece, origin, flipped in self._pieces():
            out[piece] = np.flip(part[origin], flipped)
        return out

    def steps(self, part: Array) -> Array:
        """Return the image of steps (h, w, 2, 2), whose first index is x or y.

        One reflection changes the sign of y in a step along a row, and of x in a step along a
        column. Two reflections cancel.
        """
        out = self.unfolded(part)
        for piece, _, flipped in self._pieces():
            if len(flipped) == 1:
                out[piece][..., [0, 1], [1, 0]] *= -1
        return out

    def placed(self, points: Array, corner: tuple[int, int], source: Lens) -> Array:
        """Return the image of points (h, w, 2), in float32. x and y count from ``corner``."""
        out = np.empty((*self.shape, 2), np.float32)
        for piece, origin, flipped in self._pieces():
            for axis, side in enumerate((source.width, source.height)):
                values = np.flip(points[(*origin, axis)], flipped)
                if 1 - axis in flipped:
                    values = side - values
                np.subtract(values, corner[axis], out=out[(*piece, axis)], casting="same_kind")
        return out
