"""A polynomial on the interval where it increases, and its inverse there."""

import math
from collections.abc import Sequence

import numpy as np

from lightfield.geometry.lenses.base import Array, slack


class IncreasingPolynomial:
    """Σ c_i t^i on [0, end], where it increases.

    ``end`` is the smallest of three: the first turning point, ``last``, and the t at which the
    polynomial reaches ``last_value``.
    """

    def __init__(
        self, coefficients: Sequence[float], last: float = math.inf, last_value: float = math.inf
    ) -> None:
        self.value = np.polynomial.Polynomial(coefficients)
        self.slope = np.polynomial.Polynomial([i * c for i, c in enumerate(coefficients)][1:])
        self.end = min(self._turning_point(), last)
        if math.isinf(self.end):
            self.end = 1.0
            while self.value(self.end) < last_value:
                self.end *= 2
        if self.value(self.end) > last_value > self.value(0.0):
            # The import takes a quarter of a second, and no other lens needs it.
            from scipy.optimize import brentq

            self.end = float(brentq(lambda t: self.value(t) - last_value, 0, self.end, xtol=1e-300))
        # Nodes that bracket every solution, and start Newton's method close to it.
        self._nodes = np.linspace(0, self.end, 257)
        self._values = np.maximum.accumulate(self.value(self._nodes))

    def _turning_point(self) -> float:
        roots = np.roots(self.slope.coef[::-1])
        real = np.sort(roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0)])
        after = np.append((real[:-1] + real[1:]) / 2, real[-1:] * 2)
        falling = real[self.slope(after) < 0]
        return float(falling[0]) if falling.size else math.inf

    def inverse(self, values: Array) -> Array:
        """Return t in [0, end] with Σ c_i t^i = ``values``, in float64. NaN where no t exists.

        Newton's method. Bisection keeps it inside a bracket that always contains the solution.
        """
        last = self._values[-1]
        goal = values.astype(np.float64).ravel()
        goal[(goal > last) & (goal <= last * slack(values.dtype))] = last
        t = np.full(goal.shape, np.nan)
        active = np.flatnonzero((goal >= self._values[0]) & (goal <= last))
        goal = goal[active]
        upper = np.clip(np.searchsorted(self._values, goal), 1, self._nodes.size - 1)
        low = self._nodes[upper - 1]
        high = self._nodes[upper]
        now = np.interp(goal, self._values, self._nodes)
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
        return t.reshape(values.shape)
