"""The effort, samples or seconds, at which a method has a given error.

`effort_for` and `effort_within` follow a method's measured points, because an error may end at its
bias, or rise again. `fit` draws one line through all points of a method without bias, because the
line has less noise than each point.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np


def effort_within(error: float, points: Sequence[tuple[float, float]]) -> float | None:
    """Return the effort at which a method first has at most this ``error``. None if it never has.

    ``points`` have efforts and errors, in rising order of effort. Between two points the error is a
    power of the effort. If even the first point has less error, the effort is the first point's.
    """
    below = next((i for i, (_, reached) in enumerate(points) if reached <= error), None)
    if below is None:
        return None
    if below == 0:
        return points[0][0]
    (x0, e0), (x1, e1) = points[below - 1 : below + 1]
    # An error far below the reference's own may be measured as 0 or less by chance.
    part = math.log(e0 / error) / math.log(e0 / max(e1, 1e-6 * error))
    return float(x0 * (x1 / x0) ** part)


def effort_for(
    error: float, points: Sequence[tuple[float, float]], *, before: bool = False
) -> float:
    """Return the effort for an ``error`` as `effort_within`, but also after the last point.

    There, and on request ``before`` the first point, the error is inversely proportional to the
    effort.
    """
    first_effort, first_error = points[0]
    if before and error >= first_error:
        return first_effort * first_error / error
    effort = effort_within(error, points)
    if effort is None:
        last_effort, last_error = points[-1]
        return last_effort * last_error / error
    return effort


def whole_samples(effort: float) -> int:
    """Return the fewest samples that are at least an ``effort``."""
    # A rounding error must not add a sample.
    return math.ceil(round(effort, 6))


@dataclass(frozen=True)
class Line:
    """A power law y = factor · x^slope, fitted in logarithms, and the slope's standard error."""

    slope: float
    slope_error: float
    factor: float

    def at(self, x: float) -> float:
        """Return y at x."""
        return float(self.factor * x**self.slope)

    def inverse(self, y: float) -> float:
        """Return x at y. At most 1e300, as for a line that hardly falls or rises."""
        with np.errstate(divide="ignore", invalid="ignore"):
            exponent = np.log10(y / self.factor) / np.float64(self.slope)
        return float(10 ** np.fmin(exponent, 300.0))


def fit(x: Sequence[float], y: Sequence[float]) -> Line | None:
    """Fit a power law by least squares of the logarithms.

    Return None for fewer than three different x, or if a number is not above 0.
    """
    if len(set(x)) < 3 or min(*x, *y) <= 0:
        return None
    if min(y) == max(y):
        # The fit would be level except for rounding.
        return Line(0.0, 0.0, float(y[0]))
    (slope, intercept), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    return Line(float(slope), math.sqrt(covariance[0, 0]), float(np.exp(intercept)))


def interpolated(x: float, points: Sequence[tuple[float, float]]) -> float | None:
    """Return y at x by power laws between points (x, y), in any order. None outside of them."""
    points = sorted(points)
    for (x0, y0), (x1, y1) in pairwise(points):
        if x0 <= x <= x1 and x1 > x0 and min(y0, y1) > 0:
            return float(y0 * (y1 / y0) ** (math.log(x / x0) / math.log(x1 / x0)))
    return None
