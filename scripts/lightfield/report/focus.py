"""Refocuses the views of a plane of perspective cameras for a dataset's page."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.export import camera_grid, cameras, refocus
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
_FEWEST_CAMERAS = 4
_QUALITY = 95


def plane_of(rig: Rig, lens: Lens, world_from_cameras: Array) -> camera_grid.CameraGrid | None:
    """Return the grid of a plane whose views can be refocused. None for other rigs and lenses."""
    if not isinstance(rig, Plane) or not isinstance(lens, Rectilinear):
        return None
    grid = camera_grid.find(world_from_cameras)
    return grid if grid and grid.is_flat and grid.views.size >= _FEWEST_CAMERAS else None


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
    ``depth`` (...) is the Z-depth of what they see, in metres. None if it has no surface.
    """
    reach = refocus.depth_range(depth)
    if reach is None:
        return None
    small = lens.fitted(min(_SIDE, max(lens.width, lens.height)))
    assert isinstance(small, Rectilinear)
    focal = cameras.focal_pixels(small)
    distances = refocus.inverse_steps(*reach, PICTURES)
    places = {int(number): place for place, number in np.ndenumerate(grid.views[0])}
    totals = np.zeros((PICTURES, small.height, small.width, 5), np.float32)
    valid = np.ones((small.height, small.width), np.bool_)
    for number, colour in zip(numbers, colours, strict=True):
        if small != lens:
            colour = pictures.shrunk(colour, small.width, small.height)
        view = refocus.MovableView(np.dstack([colour, valid]), valid)
        for total, distance in zip(totals, distances, strict=True):
            right, down = refocus.disparities(grid, focal, distance)[places[number]].tolist()
            view.add_to(total, right, down, 1)
    return {
        "size": [small.width, small.height],
        "distances": distances,
        "pictures": [
            webp(pack_light(refocus.mean_light(total)[..., :3], scale), _QUALITY)
            for total in totals
        ],
    }
