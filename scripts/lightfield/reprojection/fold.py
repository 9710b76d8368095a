"""Images that mirror themselves: of those a part is computed, and the rest unfolded from it."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lightfield.geometry.lenses import Array, Lens

_Index = tuple[slice, slice]


@dataclass(frozen=True)
class Fold:
    """An image of ``shape`` (H, W), of which two halves may mirror the others.

    ``mirrors`` says whether the lower half does the upper one, and the right half the left one.
    """

    shape: tuple[int, int]
    mirrors: tuple[bool, bool] = (False, False)

    @classmethod
    def of_map(cls, source: Lens, target: Lens, rotation: Array) -> "Fold":
        """Return the fold of where the target's pixels lie in the source.

        A rotation (3, 3) keeps left and right, or up and down, apart where it leaves that axis
        alone.
        """
        # Rows mirror y, and columns x.
        kept = [not np.delete(rotation[axis], axis).any() for axis in (1, 0)]
        down, across = (
            all(three) for three in zip(source.mirrors, target.mirrors, kept, strict=True)
        )
        return cls((target.height, target.width), (down, across))

    @property
    def part(self) -> tuple[int, int]:
        """The height and width of the upper left part, from which the rest follows."""
        height, width = (
            -(-side // 2) if mirrored else side
            for side, mirrored in zip(self.shape, self.mirrors, strict=True)
        )
        return height, width

    def _pieces(self) -> Iterator[tuple[_Index, _Index, tuple[int, ...]]]:
        """Yield a piece of the image, of what in the part it is an image, and the axes flipped."""
        ways = [
            [(slice(half), slice(half)), (slice(half, side), slice(side - half))]
            for side, half in zip(self.shape, self.part, strict=True)
        ]
        for down, across in itertools.product(range(2), repeat=2):
            (rows, from_rows), (columns, from_columns) = ways[0][down], ways[1][across]
            flipped = tuple(axis for axis, is_flipped in enumerate((down, across)) if is_flipped)
            yield (rows, columns), (from_rows, from_columns), flipped

    def unfolded(self, part: Array) -> Array:
        """Return the image of a part (h, w, …) whose values stay as they are."""
        out = np.empty((*self.shape, *part.shape[2:]), part.dtype)
        for piece, origin, flipped in self._pieces():
            out[piece] = np.flip(part[origin], flipped)
        return out

    def steps(self, part: Array) -> Array:
        """Return the image of steps (h, w, 2, 2), the first index of which is x or y.

        Mirrored once, a step along a row has another y, and one along a column another x.
        """
        out = self.unfolded(part)
        for piece, _, flipped in self._pieces():
            if len(flipped) == 1:
                out[piece][..., [0, 1], [1, 0]] *= -1
        return out

    def placed(self, points: Array, corner: tuple[int, int], source: Lens) -> Array:
        """Return the image of points (h, w, 2), (x, y), in float32 and counted from ``corner``."""
        out = np.empty((*self.shape, 2), np.float32)
        for piece, origin, flipped in self._pieces():
            for axis, (first, side) in enumerate(
                zip(corner, (source.width, source.height), strict=True)
            ):
                values = np.flip(points[(*origin, axis)], flipped)
                if 1 - axis in flipped:
                    values = side - values
                np.subtract(values, first, out=out[(*piece, axis)], casting="same_kind")
        return out
