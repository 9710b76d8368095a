"""Finds the cameras near a camera, without comparing all pairs.

Cameras at the very same place are one place in a k-d tree, so a thousand of them cost no more.
Importing scipy's tree takes a third of a second, so import this file only where it is needed.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lightfield.geometry.lenses import Array

# The tree's distances may differ from numpy's in the last digits.
ROUNDING = 1e-9


class Cameras:
    """The cameras at ``positions``, (n, 3) in metres."""

    def __init__(self, positions: Array) -> None:
        self._positions = positions
        places, place_of_camera = np.unique(positions, axis=0, return_inverse=True)
        self._tree = cKDTree(places)
        # The cameras, place by place, in their order.
        by_place = np.argsort(place_of_camera.ravel(), kind="stable")
        self._cameras = np.split(by_place, np.cumsum(np.bincount(place_of_camera.ravel()))[:-1])

    def nearest(self, camera: int, count: int, tie: float) -> NDArray[np.int64]:
        """Return the ``count`` nearest other cameras in ascending order, and all that tie.

        A camera ties if it is at most ``tie`` metres farther. If many cameras are at one place, it
        returns only the first ``count`` of them.
        """
        count = min(count, len(self._positions) - 1)
        reach = self._distances(camera, min(count + 1, self._tree.n))[-1] + tie
        cameras = self._within(camera, reach, count + 1)
        neighbours: NDArray[np.int64] = cameras[cameras != camera]
        return neighbours

    def nearest_apart(self, camera: int, least_distance: float, tie: float) -> NDArray[np.int64]:
        """Return, in ascending order, all cameras as near as the nearest one elsewhere.

        "Elsewhere" means at least ``least_distance`` metres away. ``tie`` is a part of the
        distance: cameras that are farther by at most this count as equally far.
        """
        count = 2
        while True:
            distances = self._distances(camera, min(count, self._tree.n))
            elsewhere = distances[distances > least_distance * (1 + ROUNDING)]
            if len(elsewhere) or count >= self._tree.n:
                break
            count *= 2
        reach = elsewhere[0] if len(elsewhere) else distances[-1]
        return self._within(camera, reach * (1 + tie))

    def _distances(self, camera: int, count: int) -> Array:
        """Return the distances of the nearest places, beginning with the camera's own."""
        distances, _ = self._tree.query(self._positions[camera], k=[*range(1, count + 1)])
        return np.asarray(distances)

    def _within(self, camera: int, reach: float, most: int | None = None) -> NDArray[np.int64]:
        """Return the cameras within ``reach`` metres, at most the first ``most`` of each place."""
        places = self._tree.query_ball_point(
            self._positions[camera], reach * (1 + ROUNDING), return_sorted=False
        )
        return np.sort(np.concatenate([self._cameras[place][:most] for place in places]))
