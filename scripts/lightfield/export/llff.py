"""LLFF's poses_bounds.npy: a camera in each row, and the depths that it sees.

A row has 17 numbers. It begins with a 3 × 5 matrix, row by row: the camera-to-world rotation with
columns down, right and backwards, the position, and height, width and focal length in pixels. The
nearest and the farthest Z in metres follow. Source: load_llff.py of the original NeRF.
"""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np

from lightfield.core.files import write_bytes
from lightfield.export import cameras
from lightfield.export.source import Floats
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.visibility import pixel_indices
from lightfield.reading.surface import SeenSurface

# The bounds leave out this percentage of the nearest and of the farthest points.
_OUTLIERS = 0.1
# Depth is measured at every n-th pixel across and down.
_STEP = 4


def depths(lens: Rectilinear, view: View, surface: SeenSurface) -> Floats:
    """Return the Z of the points of a surface that are in a view's frame."""
    points = surface.points(_STEP)[0]
    local = view.to_camera(points)
    inside = pixel_indices(lens, local)[2]
    return np.asarray(-local[inside, 2])


def write_poses_bounds(
    path: Path,
    lens: Rectilinear,
    views: Sequence[View],
    seen_depths: Mapping[str, Sequence[Floats]],
) -> None:
    """Write a row for each view. ``seen_depths`` are the Z that each sees, by the views' names."""
    rows = [_row(lens, view, np.concatenate(seen_depths[view.name])) for view in views]
    content = BytesIO()
    np.save(content, np.array(rows, np.float64))
    write_bytes(path, content.getvalue())


def _row(lens: Rectilinear, view: View, seen_depths: Floats) -> Floats:
    """Return a camera's 17 numbers. ``seen_depths`` (n,) are the Z that it sees."""
    right, up, back, position = view.world_from_camera[:3].T
    size = np.array([lens.height, lens.width, cameras.focal_pixels(lens)[0]])
    # A camera that sees nothing may have any bounds.
    bounds = [0.1, 100.0]
    if len(seen_depths):
        bounds = np.percentile(seen_depths, [_OUTLIERS, 100 - _OUTLIERS]).tolist()
    return np.concatenate([np.stack([-up, right, back, position, size], axis=1).ravel(), bounds])
