"""Refocuses the views of a plane of cameras for a dataset's page.

Views through other lenses than a pinhole are resampled to one first, which sees ahead.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from lightfield.export import camera_grid, cameras, refocus
from lightfield.geometry import lenses
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import Rig
from lightfield.geometry.rigs.plane import Plane
from lightfield.imaging import pictures
from lightfield.report.packing import pack_light, webp

Array = NDArray[Any]

PICTURES = 12
# The longer side of a refocused picture in pixels, at most.
_SIDE = 256
# Degrees that the pinhole sees, at most, if the views' own lens is none.
_WIDEST = 90.0
_FEWEST_CAMERAS = 4
_QUALITY = 95


def plane_of(rig: Rig, world_from_cameras: Array) -> camera_grid.CameraGrid | None:
    """Return the grid of a plane whose views can be refocused. None for other rigs."""
    if not isinstance(rig, Plane):
        return None
    grid = camera_grid.find(world_from_cameras)
    return grid if grid and grid.is_flat and grid.views.size >= _FEWEST_CAMERAS else None


class _Pinhole:
    """Makes small views through a pinhole of views through another lens."""

    def __init__(self, lens: Lens) -> None:
        self.lens = _pinhole(lens)
        self._same_lens = isinstance(lens, Rectilinear)
        self._at = lens.pixels(self.lens.pixel_rays())
        self.valid = lens.in_frame(self._at)
        # Pixels that show nothing still need a place.
        self._at = np.nan_to_num(self._at)

    def colour(self, colour: Array) -> Array:
        """Return linear colour (height, width, 3) of the lens as the pinhole shows it."""
        if self._same_lens:
            size = (self.lens.width, self.lens.height)
            return colour if colour.shape[1::-1] == size else pictures.shrunk(colour, *size)
        at = (self._at[..., 1] - 0.5, self._at[..., 0] - 0.5)
        planes = [map_coordinates(plane, at, order=1, mode="nearest") for plane in _planes(colour)]
        return np.stack(planes, axis=-1)

    def sees(self, rays: Array) -> Array:
        """Return which of the rays (..., 3) in the camera's axes the pinhole's image shows."""
        with np.errstate(invalid="ignore"):
            return self.lens.in_frame(self.lens.pixels(rays))


def _planes(colour: Array) -> Array:
    return np.moveaxis(np.asarray(colour, np.float32), -1, 0)


def _pinhole(lens: Lens) -> Rectilinear:
    """Return the lens of the pictures: the views' lens if it is a pinhole, or one within it."""
    side = min(_SIDE, max(lens.width, lens.height))
    if isinstance(lens, Rectilinear):
        return lens.fitted(side)
    fov = min(_WIDEST, *map(math.degrees, lens.field_of_view))
    pinhole = lenses.from_camera({"lens": "rectilinear", "fov": fov, "resolution": [side, side]})
    assert isinstance(pinhole, Rectilinear)
    return pinhole


def collect(
    grid: camera_grid.CameraGrid,
    lens: Lens,
    colours: Sequence[Array],
    numbers: Sequence[int],
    depth: Array,
    scale: tuple[float, float],
) -> dict[str, Any] | None:
    """Return refocused pictures, packed on the ``scale`` of the page's light.

    ``colours`` (height, width, 3) are linear views through the ``lens``, with these ``numbers``.
    ``depth`` (..., height, width) is the Z-depth of what they see, in metres. None if they see no
    surface.
    """
    pinhole = _Pinhole(lens)
    reach = refocus.depth_range(depth[..., pinhole.sees(lens.pixel_rays())])
    if reach is None:
        return None
    distances = refocus.inverse_steps(*reach, PICTURES)
    focal = cameras.focal_pixels(pinhole.lens)
    places = {int(number): place for place, number in np.ndenumerate(grid.views[0])}
    totals = np.zeros((PICTURES, *pinhole.valid.shape, 5), np.float32)
    for number, colour in zip(numbers, colours, strict=True):
        light = np.dstack([pinhole.colour(colour), pinhole.valid])
        view = refocus.MovableView(light, pinhole.valid)
        for total, distance in zip(totals, distances, strict=True):
            right, down = refocus.disparities(grid, focal, distance)[places[number]].tolist()
            view.add_to(total, right, down, 1)
    return {
        "size": [pinhole.lens.width, pinhole.lens.height],
        "distances": distances,
        "pictures": [
            webp(pack_light(refocus.mean_light(total)[..., :3], scale), _QUALITY)
            for total in totals
        ],
    }
