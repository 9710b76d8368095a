"""Finds the grids of cameras that look in parallel, by their poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.export.source import Floats
from lightfield.formats.lightfield import LightField

# Places and rotations are equal if they differ by less.
_DIGITS = 9  # of metres
_SAME_ROTATION = 1e-6


@dataclass(frozen=True, eq=False)
class CameraGrid:
    """Cameras that look in parallel, in layers, rows and columns.

    - ``views`` (layers, rows, columns): their numbers. The first layer is nearest to the scene. The
      first row is the highest, and the first column is on the left, as the cameras see them.
    - ``right`` (columns,), ``up`` (rows,), ``back`` (layers,): the places in metres along the axes
      of the cameras.
    - ``rotation`` (3, 3): from the cameras' axes to the world.
    """

    views: NDArray[np.int64]
    right: Floats
    up: Floats
    back: Floats
    rotation: Floats

    @property
    def is_flat(self) -> bool:
        """Whether the cameras are in a plane that is parallel to their images."""
        return len(self.back) == 1

    @property
    def steps(self) -> Floats:
        """The distances in metres from column to column, and from row to row upwards."""
        return np.concatenate([np.diff(self.right), np.diff(self.up[::-1])])

    @property
    def cell(self) -> tuple[float, float]:
        """The mean distance in metres of neighbours across, and up. 0 without neighbours."""
        sides = [float(axis[-1] - axis[0]) for axis in (self.right, self.up)]
        columns, rows = (max(len(axis) - 1, 1) for axis in (self.right, self.up))
        return sides[0] / columns, -sides[1] / rows

    @property
    def world_from_centre(self) -> Floats:
        """The camera-to-world matrix (4, 4) of a camera in the middle of the grid."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        middle = [(axis[0] + axis[-1]) / 2 for axis in (self.right, self.up, self.back)]
        matrix[:3, 3] = self.rotation @ middle
        return matrix

    @property
    def offsets(self) -> Floats:
        """The places (rows, columns, 2) of a layer's cameras: metres right and up of the middle."""
        right = self.right - (self.right[0] + self.right[-1]) / 2
        up = self.up - (self.up[0] + self.up[-1]) / 2
        return np.stack(np.meshgrid(right, up), axis=-1)


def find(world_from_cameras: Floats) -> CameraGrid | None:
    """Return the grid of cameras (n, 4, 4). None if they do not look in parallel, or in no grid."""
    rotations = world_from_cameras[:, :3, :3]
    if not np.allclose(rotations, rotations[0], atol=_SAME_ROTATION):
        return None
    places = np.round(world_from_cameras[:, :3, 3] @ rotations[0], _DIGITS)
    right, column = np.unique(places[:, 0], return_inverse=True)
    down, row = np.unique(-places[:, 1], return_inverse=True)
    back, layer = np.unique(places[:, 2], return_inverse=True)
    views = np.full((len(back), len(down), len(right)), -1)
    if views.size != len(places):
        return None
    views[layer, row, column] = np.arange(len(places))
    is_full = bool((views >= 0).all())
    return CameraGrid(views, right, -down, back, rotations[0]) if is_full else None


def plane_of(lightfield: LightField) -> CameraGrid:
    """Return the grid of a plane's views.

    Raises `UserError` if the views are not a grid of several cameras in the plane of their images.
    """
    grid = find(lightfield.world_from_cameras)
    if grid is None or not grid.is_flat or grid.views.size == 1:
        raise UserError(
            f"{lightfield.path}: frames: are not a grid of cameras in a plane that look in "
            "parallel; this export needs a rig of type plane"
        )
    return grid
