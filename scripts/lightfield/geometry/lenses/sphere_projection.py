"""The calibrated lenses that project a point of a sphere or an ellipsoid on a plane."""

import math
from abc import abstractmethod
from functools import cached_property

import numpy as np

from lightfield.geometry.lenses.base import Array, Pair
from lightfield.geometry.lenses.calibrated import ClosedForm


class SphereProjection(ClosedForm):
    """r · _scale = 2 t / (1 + _bend t²) with t = tan(φ / 2). Each lens defines φ from θ.

    The lens ends where r stops growing with t, or where r becomes infinite: at t = 1 / √|_bend|.
    """

    @property
    @abstractmethod
    def _scale(self) -> float:
        """What r is multiplied by."""

    @property
    @abstractmethod
    def _bend(self) -> float:
        """The coefficient of t²."""

    @abstractmethod
    def _sphere_point(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        """Return a vector, across and along the axis, whose angle from the axis is φ at θ."""

    @abstractmethod
    def _direction(self, sin: Array, cos: Array) -> tuple[Array, Array]:
        """Return sin θ and cos θ, given sin φ and cos φ."""

    @cached_property
    def _rim(self) -> Pair:
        size = abs(self._bend)
        sin, cos = 2 * math.sqrt(size) / (1 + size), (size - 1) / (1 + size)
        ray = self._direction(np.array(sin), np.array(cos))
        r = 1 / math.sqrt(size) / self._scale if self._bend > 0 else math.inf
        return math.atan2(*map(float, ray)), r

    def _angle(self, r: Array) -> tuple[Array, Array]:
        scaled = self._scale * r
        t = scaled / (1 + np.sqrt(np.maximum(1 - self._bend * scaled * scaled, 0)))
        square = t * t
        return self._direction(2 * t / (1 + square), (1 - t) * (1 + t) / (1 + square))

    def _distance(self, sin: Array, cos: Array) -> Array:
        across, along = self._sphere_point(sin, cos)
        length = np.hypot(across, along)
        # tan(φ / 2), in the form in which nothing cancels.
        t = np.where(along > 0, across / (length + along), (length - along) / across)
        divisor = 1 + self._bend * t * t
        return np.where(divisor > 0, 2 * t / divisor / self._scale, np.nan)
