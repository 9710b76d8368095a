"""The error of rendered views by their pass ``variance``, without a reference."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from lightfield.core.errors import UserError
from lightfield.formats.passes import VARIANCE
from lightfield.measurement.metrics import Reference, exposed_alike
from lightfield.reading.dataset import OpenView

# Reading more views would take long, and hardly change their mean.
MOST_VIEWS = 8


def relative_error(views: Sequence[OpenView]) -> float | None:
    """Return the expected relative mean squared error of views that have the pass ``variance``.

    It is the mean of at most `MOST_VIEWS`, spread evenly. The error is as in
    `lightfield.measurement.metrics`. Return None if no view can be read.
    """
    chosen = views[:: math.ceil(len(views) / MOST_VIEWS)]
    readable = [*_readable(chosen)]
    if not readable:
        return None
    return float(np.mean([view.own_error for view in exposed_alike(readable)]))


def _readable(views: Sequence[OpenView]) -> Iterator[Reference]:
    """Yield the colour and the variance of each view that can be read."""
    for view in views:
        try:
            colour, variance = view.rgb, view.read(VARIANCE)
        except UserError:
            continue  # Validation reports it.
        yield Reference(
            colour.astype(np.float64), variance.astype(np.float64), None, view.has_ray, 0.0
        )
