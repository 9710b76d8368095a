"""Functions on the interval where they increase, and their inverses there."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lightfield.geometry.lenses.base import Array, slack

# Values that are solved at once. Their arrays stay in the processor's cache.
BLOCK = 2**14


def first_fall(polynomial: np.polynomial.Polynomial) -> float:
    """Return the smallest t > 0 at which a polynomial falls below zero, or inf."""
    # A coefficient may be as large as 1e99.
    with np.errstate(over="ignore", invalid="ignore"):
        roots = np.roots(polynomial.coef[::-1])
        is_real = np.abs(roots.imag) <= 1e-12 * np.abs(roots)
        real = np.sort(roots.real[is_real & (roots.real > 0)])
        after = np.append((real[:-1] + real[1:]) / 2, real[-1:] * 2)
        falling = real[polynomial(after) < 0]
    return float(falling[0]) if falling.size else math.inf


class Increasing:
    """A function that increases on [0, end], and its inverse there.

    ``nodes`` are points from 0 to the end. They bracket every solution, and start Newton's method
    close to it.
    """

    def __init__(
        self, value: Callable[[Any], Any], slope: Callable[[Any], Any], nodes: Array
    ) -> None:
        self.value = value
        self.slope = slope
        self.end = float(nodes[-1])
        self._nodes = nodes
        self._values = np.maximum.accumulate(value(nodes))

    def guess(self, values: Array) -> Array:
        """Return about the t in [0, end] with the ``values``."""
        return np.interp(values, self._values, self._nodes)

    def inverse(self, values: Array) -> Array:
        """Return t in [0, end] with the ``values``, in float64. NaN where no t exists."""
        goal = values.astype(np.float64).ravel()
        last = self._values[-1]
        goal[(goal > last) & (goal <= last * slack(values.dtype))] = last
        t = np.full(goal.shape, np.nan)
        solvable = np.flatnonzero((goal >= self._values[0]) & (goal <= last))
        for first in range(0, solvable.size, BLOCK):
            block = solvable[first : first + BLOCK]
            t[block] = self._solved(goal[block])
        return t.reshape(values.shape)

    def _solved(self, goal: Array) -> Array:
        """Return t in [0, end] at ``goal`` (n,), which has one.

        Newton's method. Bisection keeps it inside a bracket that always contains the solution.
        """
        t = np.empty(goal.shape)
        active = np.arange(goal.size)
        upper = np.clip(np.searchsorted(self._values, goal), 1, self._nodes.size - 1)
        low = self._nodes[upper - 1]
        high = self._nodes[upper]
        now = self.guess(goal)
        for _ in range(100):
            error = self.value(now) - goal
            low = np.where(error <= 0, now, low)
            high = np.where(error >= 0, now, high)
            with np.errstate(invalid="ignore", divide="ignore"):
                newton = now - error / self.slope(now)
            new = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
            t[active] = new
            going = np.abs(new - now) > 4 * np.finfo(np.float64).eps * np.abs(new)
            if not going.any():
                break
            active = active[going]
            goal = goal[going]
            now = new[going]
            low, high = low[going], high[going]
        return t


class IncreasingPolynomial(Increasing):
    """Σ c_i t^i on [0, end], where it increases.

    ``end`` is the smallest of three: the first turning point, ``last``, and the t at which the
    polynomial reaches ``last_value``.
    """

    def __init__(
        self, coefficients: Sequence[float], last: float = math.inf, last_value: float = math.inf
    ) -> None:
        value = np.polynomial.Polynomial(coefficients)
        slope = np.polynomial.Polynomial([i * c for i, c in enumerate(coefficients)][1:])
        end = min(first_fall(slope), last)
        if math.isinf(end):
            end = 1.0
            while value(end) < last_value:
                end *= 2
        if value(end) > last_value > value(0.0):
            # The import takes a quarter of a second, and no other lens needs it.
            from scipy.optimize import brentq

            end = float(brentq(lambda t: value(t) - last_value, 0, end, xtol=1e-300))
        super().__init__(value, slope, np.linspace(0, end, 257))
