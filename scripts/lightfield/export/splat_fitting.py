"""Fits colours and opacities of Gaussians to the views that train. Their places and sizes stay.

A drawn colour is linear in the Gaussians' colours. So each round draws all views, and adds to each
colour the mean of what its pixels miss, by its share of each pixel. This is SIRT, the simultaneous
iterative reconstruction technique of tomography. Opacities change likewise, by the derivative of
the drawn colour and coverage.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lightfield.core.progress import Progress
from lightfield.export.source import Bools, Floats, SourceDataset
from lightfield.export.splat_drawing import project
from lightfield.export.splats import pixel_step
from lightfield.export.trainer_splits import splits
from lightfield.formats.gaussians import GREY, HARMONIC_0, Gaussians
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.imaging.pictures import shrunk

# More rounds hardly improve views that do not train, and in the end make them worse.
_ROUNDS = 3
# Weights in pixels below which Gaussians change less: few pixels say little.
_LEAST_WEIGHTS = np.array([0.001, 0.001, 0.001, 0.05])
# No Gaussian vanishes, and none hides all else.
_OPACITIES = (1 / 255, 0.999)


def fitted(gaussians: Gaussians, source: SourceDataset, count: int) -> Gaussians:
    """Return ``gaussians`` with colours and opacities that show the views that train.

    ``count`` is the largest number for which they were made, so it tells how large they are.
    """
    views = splits(source.lightfield).train
    lens = _coarse_lens(source, views, count)
    progress = Progress(_ROUNDS * len(views), "fit", "views")
    for _ in range(_ROUNDS):
        changes = np.zeros((len(gaussians), 4))
        weights = np.zeros_like(changes)
        for view in views:
            seen = project(gaussians, view, lens)
            drawn = seen.draw(lens.height, lens.width)
            change, weight = seen.corrections(drawn, *_target(source, view, lens))
            changes[seen.numbers] += change
            weights[seen.numbers] += weight
            progress.done()
        gaussians = _changed(gaussians, changes / (weights + _LEAST_WEIGHTS))
    return gaussians


def _coarse_lens(source: SourceDataset, views: Sequence[View], count: int) -> Lens:
    """Return the views' lens, with larger pixels if Gaussians are much larger than pixels."""
    # Gaussians stay at least two pixels large: a drawn Gaussian is blurred by about half a pixel.
    side = max(1, int(pixel_step(source, views, count) / 2))
    lens = source.lens
    return lens if side == 1 else lens.resized(lens.width // side, lens.height // side)


def _target(source: SourceDataset, view: View, lens: Lens) -> tuple[Floats, Bools]:
    """Return a view's colour over black and coverage (h, w, 4), and which pixels (h, w) it has."""
    counted = source.valid(view)
    coverage = source.alpha(view) / 255
    target = np.where(counted[..., None], np.dstack([source.encoded(view), coverage]), 0)
    if counted.shape == (lens.height, lens.width):
        return target, counted
    small = shrunk(np.dstack([target, counted]), lens.width, lens.height).astype(np.float64)
    # Pixels at the border of the lens mix with what it does not see.
    return small[..., :4], small[..., 4] > 0.99


def _changed(gaussians: Gaussians, changes: Floats) -> Gaussians:
    """Return ``gaussians`` after ``changes`` (n, 4) of their colours and opacities."""
    harmonics = gaussians.harmonics.copy()
    harmonics[:, 0] += changes[:, :3] / HARMONIC_0
    harmonics[:, 0] = harmonics[:, 0].clip(-GREY / HARMONIC_0, (1 - GREY) / HARMONIC_0)
    return replace(
        gaussians,
        harmonics=harmonics,
        opacities=(gaussians.opacities + changes[:, 3]).clip(*_OPACITIES),
    )
