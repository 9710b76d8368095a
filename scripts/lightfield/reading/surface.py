"""The surface that a view sees: points on it, and which points nothing hides."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import ONE_SURFACE, lies_on, pixel_indices

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# A view sees a point that lies on its surface within this part of the distance. The surface is at a
# pixel's centre, and the point is anywhere in the pixel.
_ON_SURFACE = 0.01


@dataclass(frozen=True)
class SeenSurface:
    """The first surface around a camera.

    - ``lens``: the camera's lens.
    - ``view``: the camera's pose.
    - ``rays``: the unit rays (h, w, 3) of all pixels' centres, in the camera's coordinates.
    - ``distance``: the distance (h, w) of the surface from the camera in metres, along the rays.
    """

    lens: Lens
    view: View
    rays: Floats
    distance: Floats

    def points(self, step: int) -> tuple[Floats, Floats]:
        """Return the world points (n, 3) at every ``step``-th pixel, and their normals (n, 3).

        A normal is perpendicular to the plane through the point and its neighbours to the right and
        below. It points to the camera. NaN at the rim, and where a neighbour is on another surface.
        """
        first = step // 2
        part = np.s_[first::step, first::step]
        with np.errstate(invalid="ignore"):
            world = self.rays * self.distance[..., None] @ self.view.world_from_camera[:3, :3].T
            right = np.full_like(world, np.nan)
            below = np.full_like(world, np.nan)
            right[:, :-1] = world[:, 1:] - world[:, :-1]
            below[:-1] = world[1:] - world[:-1]
            normal = np.cross(below, right)
            near = np.maximum(np.linalg.norm(right, axis=-1), np.linalg.norm(below, axis=-1))
            normal[~(near < ONE_SURFACE * self.distance)] = np.nan
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            normal *= -np.sign((normal * world).sum(axis=-1, keepdims=True))
        hits = np.isfinite(self.distance[part]) & (self.distance[part] > 0)
        return world[part][hits] + self.view.world_from_camera[:3, 3], normal[part][hits]

    def sees(self, points: Floats) -> Bools:
        """Return which world points (n, 3) lie on this surface, so that nothing hides them."""
        local = self.view.to_camera(points)
        expected = np.linalg.norm(local, axis=1)
        column, row, inside = pixel_indices(self.lens, local)
        distance = np.where(inside, self.distance[row, column], np.nan)
        return lies_on(distance, expected, part=_ON_SURFACE)
