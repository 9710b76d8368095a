"""Measures how much of a method's error is bias, and whether neighbouring views share this bias.

A light-field method can average independent noise away. It cannot tell a bias that several views
share from texture.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

import numpy as np

from lightfield.measurement import metrics
from lightfield.measurement.experiment import Experiment, Method
from lightfield.measurement.trials import Trials, ViewWindow, both_see
from lightfield.planning.sampling import standard_error

# Fewer common pixels than this have no correlation.
_FEWEST_COMMON_PIXELS = 256


@dataclass(frozen=True)
class Bias:
    """The parts of a method's error of all pixels: means over windows.

    - ``squared_bias`` and ``variance``: they add up to ``error``. See `metrics.bias_and_variance`.
    - ``standard_error``: the standard error of ``squared_bias`` over the windows.
    - ``correlation``: of the biases of neighbouring views where both see the same surface. None if
      they have too few ``common_pixels``, or if the bias is within the noise of 0.
    """

    seeds: int
    error: float
    squared_bias: float
    variance: float
    standard_error: float
    correlation: float | None
    common_pixels: int

    def figures(self) -> dict[str, Any]:
        """Return all figures for JSON."""
        return asdict(self)


def measure(
    renderer: Trials,
    pairs: Sequence[tuple[ViewWindow, ViewWindow]],
    references: Sequence[tuple[metrics.Reference, metrics.Reference]],
    method: Method,
    seeds: int,
) -> Bias:
    """Render pairs of windows of neighbouring views with ``seeds`` seeds, at least two.

    All ``references`` have one exposure.
    """
    windows = [window for pair in pairs for window in pair]
    experiment = Experiment(renderer, windows, [each for pair in references for each in pair])
    experiment.run([method], range(1, 1 + seeds))
    renders = [[trial.colour for trial in trials] for trials in experiment.renders(method)]
    parts = [
        metrics.bias_and_variance(colours, reference)
        for colours, reference in zip(renders, experiment.references, strict=True)
    ]
    squared_biases = [squared_bias for squared_bias, _ in parts]
    variance = fmean(variance for _, variance in parts)
    products = [np.zeros((0, 3))]
    pairs_of_renders = zip(renders[::2], renders[1::2], strict=True)
    for pair, truths, colours in zip(pairs, references, pairs_of_renders, strict=True):
        # Without depth, nobody knows what both see. Without other views, the pair is of one view.
        if truths[0].depth is not None and pair[0].view != pair[1].view:
            cameras = renderer.camera(pair[0].view), renderer.camera(pair[1].view)
            products.append(metrics.bias_products(colours, truths, both_see(cameras, pair, truths)))
    common = np.concatenate(products)
    enough = len(common) >= _FEWEST_COMMON_PIXELS
    return Bias(
        seeds=seeds,
        error=fmean(squared_biases) + variance,
        squared_bias=fmean(squared_biases),
        variance=variance,
        standard_error=standard_error(squared_biases),
        correlation=metrics.correlation_of_biases(common) if enough else None,
        common_pixels=len(common),
    )
