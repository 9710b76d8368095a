"""Depth as normalised disparity, as players and coders of immersive video keep it."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.export.source import Floats, SourceDataset
from lightfield.formats.lightfield import View
from lightfield.geometry.depth import conventional_depth

FARTHEST = 999.9
"""Metres. Disparity treats misses, and everything farther, as if they were at this distance."""


def depth_range(depth: Floats) -> tuple[float, float]:
    """Return the nearest and the farthest depth in metres of a view, NaN being unknown."""
    depths = np.minimum(depth[depth > 0], FARTHEST)
    # A plane seen head on has one depth, and a range needs two. Neither is beyond the farthest.
    near = min(float(depths.min(initial=FARTHEST)), FARTHEST / 1.001)
    return near, max(float(depths.max(initial=near)), 1.001 * near)


class Farther:
    """Counts the depths that an export moves to `FARTHEST`."""

    def __init__(self) -> None:
        self._pixels = 0
        self._farther = 0

    def count(self, depth: Floats) -> None:
        """Count the depth (h, w) of a view, in metres. A miss, inf, is not moved."""
        self._pixels += depth.size
        self._farther += int((np.isfinite(depth) & (depth > FARTHEST)).sum())

    def report(self, place: Path) -> None:
        """Print how many depths were moved, if any, in the export at ``place``."""
        if self._farther:
            print(
                f"note: {place}: {self._farther} of {self._pixels} depths are farther than "
                f"{FARTHEST} m, and become {FARTHEST} m, as a miss does"
            )


def levels(
    depth: Floats, limits: tuple[float, float], bits: int, lowest: int
) -> NDArray[np.uint16]:
    """Return normalised disparity in integers of ``bits`` bits, 0 where depth is unknown.

    It is (1 / depth − 1 / far) / (1 / near − 1 / far), 0 to 1, of the ``limits`` near and far.
    Known depths have at least the level ``lowest``.
    """
    near, far = limits
    with np.errstate(invalid="ignore", divide="ignore"):
        disparity = (1 / depth - 1 / far) / (1 / near - 1 / far)
    highest = 2**bits - 1
    quantised = np.clip(np.round(disparity * highest), lowest, highest)
    return np.where(depth > 0, quantised, 0).astype(np.uint16)


class DisparityFrames:
    """The normalised disparity of a ``view`` in each of the ``frames``, read one after the other.

    ``limits`` are its nearest and its farthest depth in all frames, in metres.
    """

    def __init__(self, frames: Sequence[SourceDataset], view: View, farther: Farther) -> None:
        self._frames = frames
        self._view = view
        ranges = []
        for depth in self._depths():
            farther.count(depth)
            ranges.append(depth_range(depth))
        nearest, farthest = zip(*ranges, strict=True)
        self.limits: tuple[float, float] = (min(nearest), max(farthest))

    def levels(self, bits: int, lowest: int) -> Iterator[NDArray[np.uint16]]:
        """Yield the `levels` (h, w) of each frame."""
        for depth in self._depths():
            yield levels(depth, self.limits, bits, lowest)

    def _depths(self) -> Iterator[Floats]:
        meaning = conventional_depth(self._frames[0].lens)
        return (frame.depth(self._view, meaning) for frame in self._frames)
