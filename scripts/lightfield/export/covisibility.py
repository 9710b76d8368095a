"""Measures how much of what one view sees another view sees, too, from their depth."""

import numpy as np
from numpy.typing import NDArray

from lightfield.core.progress import Progress
from lightfield.export.source import Floats, SourceDataset
from lightfield.reading.surface import SeenSurface

# Shares are counted at about this many pixels along the longer side of a view.
_PIXELS = 64


def shares(source: SourceDataset) -> NDArray[np.float32]:
    """Return the share of each view's pixels whose surface each view sees, (n, n).

    Rows are the views whose pixels count, and columns the views that see them. On the diagonal is
    the share of pixels with a surface. Raises `UserError` if the views have no depth.
    """
    views = source.lightfield.views
    progress = Progress(2 * len(views), "covisibility", "views")
    points: list[Floats] = []
    parts = np.empty(len(views))
    for number, view in enumerate(views):
        of_view, parts[number] = _points(source.view(view).surface())
        points.append(of_view)
        progress.done()
    owners = np.repeat(np.arange(len(views)), [len(of_view) for of_view in points])
    everything = np.concatenate(points)
    result = np.empty((len(views), len(views)), np.float32)
    for column, view in enumerate(views):
        seen = source.view(view).surface().sees(everything)
        result[:, column] = np.bincount(owners[seen], minlength=len(views)) * parts
        progress.done()
    return result


def _points(surface: SeenSurface) -> tuple[Floats, float]:
    """Return evenly spread points (n, 3) of a surface, and the part of the image of each."""
    step = max(1, max(surface.distance.shape) // _PIXELS)
    points, _ = surface.points(step)
    first = step // 2
    return points, 1 / surface.distance[first::step, first::step].size
