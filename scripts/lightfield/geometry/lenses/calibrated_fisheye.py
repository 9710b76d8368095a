"""Fisheyes of calibrated cameras whose radius is a polynomial of the angle."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lightfield.geometry.lenses.base import Array, slack
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial


@dataclass(frozen=True, kw_only=True)
class CalibratedFisheye(CalibratedLens):
    """r = f (θ + c1 θ³ + c2 θ⁵ + …), out to ``fov`` / 2 or to where r stops growing with θ."""

    @property
    @abstractmethod
    def _terms(self) -> Sequence[float]:
        """The coefficients c1, c2, …"""

    @cached_property
    def _increasing(self) -> IncreasingPolynomial:
        # The even powers of θ have no coefficient.
        coefficients = np.zeros(2 * len(self._terms) + 2)
        coefficients[1::2] = (1.0, *self._terms)
        return IncreasingPolynomial(coefficients.tolist(), last=self.fov / 2)

    @cached_property
    def _limit(self) -> float:
        return float(self._increasing.value(self._increasing.end))

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        theta = self._increasing.inverse(r)
        return np.sin(theta), np.cos(theta)

    def _radius(self, sin: Array, cos: Array) -> Array:
        theta = np.arctan2(sin, cos)
        inside = theta <= self._increasing.end * slack(theta.dtype)
        return np.where(inside, self._increasing.value(theta.astype(np.float64)), np.nan)
