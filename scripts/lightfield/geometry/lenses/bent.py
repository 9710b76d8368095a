"""Lenses of calibrated cameras that are not quite radial: decentred, or with a thin prism."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lightfield.geometry.lenses.base import Array, Pair
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.increasing_polynomial import BLOCK, Increasing

_MOST_STEPS = 100
# A step that does not help is shortened by this factor, down to this part of a whole step.
_SHORTER, _SHORTEST = 0.25, 1e-3
# A solution must return to its point within this part of the point's r.
_PRECISION = 1e-10
# Rounding allows no smaller error than about this part of r.
_ROUNDING = 8 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Bend:
    """Tangential and thin-prism distortion: how far a plane's points x = (u, v) move.

    D(x) = 2 (p · x) x + (p + s + s′ q) q, with q = |x|². ``tangential`` is p, ``prism`` is s, and
    ``prism_growth`` is s′. Sources: Brown 1966; Weng, Cohen and Herniou 1992.
    """

    tangential: Pair
    prism: Pair = (0.0, 0.0)
    prism_growth: Pair = (0.0, 0.0)

    def __bool__(self) -> bool:
        return any((*self.tangential, *self.prism, *self.prism_growth))

    def moves(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return how far points move to the right and up."""
        q = u * u + v * v
        (across, upwards), (right, up) = self.tangential, self._sideways(q)
        along = 2 * (across * u + upwards * v)
        return along * u + right * q, along * v + up * q

    def jacobian(self, u: Array, v: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return the derivatives of `moves`: right by u and by v, and up by u and by v."""
        q = u * u + v * v
        (across, upwards), (right, up) = self.tangential, self._sideways(2 * q)
        along = across * u + upwards * v
        return (
            (2 * (along + u * (across + right)), 2 * (u * upwards + v * right)),
            (2 * (v * across + u * up), 2 * (along + v * (upwards + up))),
        )

    def _sideways(self, q: Array) -> tuple[Array, Array]:
        """Return p + s + s′ q."""
        terms = zip(self.tangential, self.prism, self.prism_growth, strict=True)
        right, up = (p + s + growth * q for p, s, growth in terms)
        return right, up

    def steepest(self, t: Array) -> Array:
        """Return a bound of how much the bend brings neighbours at the radius ``t`` together.

        It bounds the size of the symmetric Jacobian's eigenvalues.
        """
        terms = zip(self.prism, self.prism_growth, strict=True)
        prism = np.hypot(*(s + 2 * growth * t * t for s, growth in terms))
        return np.asarray(2 * t * (3 * math.hypot(*self.tangential) + prism))


@dataclass(frozen=True, kw_only=True)
class BentLens(CalibratedLens):
    """A calibrated lens whose points a `Bend` moves.

    The bend depends on a point's place in a plane where the lens is radial. The lens ends at the
    circle in that plane beyond which its image may fold. Up to there, no two rays have one pixel:
    the symmetric Jacobian of the whole distortion is positive.
    """

    @property
    @abstractmethod
    def _bend(self) -> Bend:
        """The bend, with u to the right and v up."""

    @property
    @abstractmethod
    def _plane(self) -> Increasing:
        """The lens's r over the radius t in the plane of the bend."""

    @cached_property
    def _largest_t(self) -> float:
        """The largest t of the lens."""
        end = self._plane.end
        if not self._bend:
            return end
        # Steps that grow with t, because t has no bound for a lens of 180 degrees.
        t = np.sinh(np.linspace(0, math.asinh(end), 4097))[1:]
        folds = np.flatnonzero(~(self._spread(t) > 0))
        if not folds.size:
            return end
        low, high = (0.0, *t)[folds[0]], t[folds[0]]
        while low < (middle := (low + high) / 2) < high:
            low, high = (middle, high) if self._spread(middle) > 0 else (low, middle)
        return float(low)

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")
    def _spread(self, t: Array) -> Array:
        """Return a lower bound of the symmetric Jacobian's eigenvalues at t."""
        radial = np.minimum(self._plane.slope(t), self._plane.value(t) / t)
        return np.asarray(radial - self._bend.steepest(t))

    @property
    def _end(self) -> float:
        sin, cos = self._sin_cos(np.asarray(self._limit))
        return float(np.arctan2(sin, cos))

    @cached_property
    def _limit(self) -> float:
        return float(self._plane.value(self._largest_t))

    @property
    def mirrors(self) -> tuple[bool, bool]:
        return (False, False) if self._bend else super().mirrors

    def _bent(self, u: Array, v: Array) -> tuple[Array, Array]:
        if not self._bend:
            return u, v
        r = np.hypot(u, v)
        t = self._plane.inverse(np.minimum(r, self._limit))
        scale = _quotient(t, r, 1.0)
        right, up = self._bend.moves(u * scale, v * scale)
        return (u + right).astype(u.dtype), (v + up).astype(v.dtype)

    def _unbent(self, u: Array, v: Array) -> tuple[Array, Array]:
        if not self._bend:
            return u, v
        points = np.stack(np.broadcast_arrays(u, v)).astype(np.float64)
        flat = points.reshape(2, -1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for first in range(0, flat.shape[1], BLOCK):
                block = slice(first, first + BLOCK)
                flat[:, block] = self._solved(flat[:, block])
            return points[0].astype(u.dtype), points[1].astype(v.dtype)

    def _solved(self, goals: Array) -> Array:
        """Return the radial points (2, n) that the bend moves to ``goals``. NaN without one.

        Newton's method. A step that brings a point no closer to its goal is shortened.
        """
        solved = np.full(goals.shape, np.nan)
        r = np.hypot(*goals)
        active = np.flatnonzero(np.isfinite(r))
        goals, r = goals[:, active], r[active]
        t = self._plane.guess(np.minimum(r, self._limit)) + np.maximum(r - self._limit, 0)
        places = goals * _quotient(t, r, 1.0)
        steps, lengths = np.zeros_like(goals), np.ones_like(r)
        errors = np.full(r.shape, np.inf)
        for _ in range(_MOST_STEPS):
            new = places + lengths * steps
            radial, new_steps, new_errors = self._newton(new, goals)
            better = new_errors < errors
            places = np.where(better, new, places)
            steps = np.where(better, new_steps, steps)
            errors = np.where(better, new_errors, errors)
            lengths = np.where(better, 1, lengths * _SHORTER)
            right = better & (errors <= _PRECISION * r)
            solved[:, active[right]] = radial[:, right]
            going = np.flatnonzero((errors > _ROUNDING * r) & (lengths > _SHORTEST))
            if not going.size:
                break
            active, goals, r = active[going], goals[:, going], r[going]
            places, steps = places[:, going], steps[:, going]
            lengths, errors = lengths[going], errors[going]
        return solved

    def _newton(self, places: Array, goals: Array) -> tuple[Array, Array, Array]:
        """Return the radial points (2, n) of places in the bend's plane, and what they lack.

        That is the step (2, n) in the plane towards the ``goals``, and the distance (n,) of the
        bent points from them. Beyond the lens's end, the radial part goes on with slope 1, and the
        bend stays as it is at the end, so that all goals have a place.
        """
        t = np.hypot(*places)
        inner = np.minimum(t, self._largest_t)
        slope = np.where(t > self._largest_t, 1, self._plane.slope(inner))
        r = self._plane.value(inner) + (t - inner)
        ratio = _quotient(r, t, 1.0)
        radial = places * ratio
        kept = places * _quotient(inner, t, 1.0)
        offsets: Array = goals - radial - self._bend.moves(*kept)
        (uu, uv), (vu, vv) = self._bend.jacobian(*kept)
        across, upwards = places * _quotient(np.ones_like(t), t, 0.0)
        beyond = np.flatnonzero(t > self._largest_t)
        # There, the bend changes with the direction alone.
        for by_u, by_v in ((uu, uv), (vu, vv)) if beyond.size else ():
            along = (by_u * across + by_v * upwards)[beyond]
            shrinks = inner[beyond] / t[beyond]
            by_u[beyond] = (by_u[beyond] - along * across[beyond]) * shrinks
            by_v[beyond] = (by_v[beyond] - along * upwards[beyond]) * shrinks
        growth = slope - ratio
        mixed = growth * across * upwards
        uu += ratio + growth * across * across
        vv += ratio + growth * upwards * upwards
        uv += mixed
        vu += mixed
        right, up = offsets
        steps = np.stack([vv * right - uv * up, uu * up - vu * right]) / (uu * vv - uv * vu)
        return radial, steps, np.hypot(right, up)


def _quotient(above: Array, below: Array, at_zero: float) -> Array:
    """Return above / below, and ``at_zero`` where ``below`` is 0."""
    return np.divide(above, below, out=np.full_like(below, at_zero), where=below > 0)
