"""Chooses one of every few cameras, so that no other camera is far from a chosen one."""

import numpy as np

from lightfield.geometry.rotations import Floats

# Coordinates are whole steps of this part of the rig's extent. So the squares of distances are
# exact, and the last digits of a sine decide nothing.
_STEP = 1e-7
# Cameras at one position are this part of the extent apart if their directions differ by 1 rad.
# It is small, so that directions count only there.
_TURN = 1e-3
# A gap is smaller if its square is below this part of the other gap's square.
_SMALLER = 1 - 1e-6


def spread(positions: Floats, directions: Floats, every: int) -> list[int]:
    """Return the numbers of every n-th camera, or of as many cameras that leave smaller gaps.

    The latter are chosen one after the other: the first camera, then always the camera that is
    farthest from all chosen ones. A gap is the distance of a camera from the nearest chosen one.
    ``positions`` and ``directions`` are (n, 3). The directions have length 1.
    """
    regular = [*range(0, len(positions), every)]
    with_regular = _Gaps(positions, directions)
    for camera in regular:
        with_regular.choose(camera)
    with_farthest = _Gaps(positions, directions)
    farthest = []
    for _ in regular:
        farthest.append(int(np.argmax(with_farthest.squares)))
        with_farthest.choose(farthest[-1])
    is_better = np.max(with_farthest.squares) < _SMALLER * np.max(with_regular.squares)
    return sorted(farthest) if is_better else regular


class _Gaps:
    """The squares (n,) of the cameras' distances from the nearest chosen one."""

    def __init__(self, positions: Floats, directions: Floats) -> None:
        extent = float(np.max(np.ptp(positions, axis=0))) or 1.0
        points = np.hstack([(positions - positions[0]) / extent, _TURN * directions])
        steps = np.round(points / _STEP)
        # Axes along which the cameras are alike change no distance.
        self._axes = [np.ascontiguousarray(axis) for axis in steps.T if np.ptp(axis)]
        self.squares = np.full(len(positions), np.inf)

    def choose(self, camera: int) -> None:
        """Shorten the distances to the distances from a chosen camera."""
        squares = np.zeros_like(self.squares)
        for axis in self._axes:
            offsets = axis - axis[camera]
            offsets *= offsets
            squares += offsets
        np.minimum(self.squares, squares, out=self.squares)
        # A chosen camera is not chosen again, also if others have its pose.
        self.squares[camera] = -1
