"""Points as numpy arrays: outlines, paths, and noise."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import mathutils
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[Any]
Points = ArrayLike  # points (n, 2) or (n, 3)


def points(data: Points) -> Array:
    """Points (n, k) as an array of floats."""
    return np.asarray(data, float)


def evenly(start: float, stop: float, count: int) -> list[float]:
    """Values from start to stop, both included, at even steps."""
    return np.linspace(start, stop, count).tolist()


def lattice(
    x: float | Sequence[float] = 0.0,
    y: float | Sequence[float] = 0.0,
    z: float | Sequence[float] = 0.0,
) -> Array:
    """Places (n, 3) at all combinations of the coordinates, each one value or several."""
    return np.array(list(product(*(np.atleast_1d(values).tolist() for values in (x, y, z)))))


def mirrored(x: float, y: float = 0.0, z: float = 0.0) -> Array:
    """Two places (2, 3), left and right of the plane x = 0."""
    return lattice((-x, x), y, z)


def xyz(x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Array:
    """Points (…, 3) of coordinates that broadcast against each other."""
    return np.stack(np.broadcast_arrays(*(np.asarray(v, float) for v in (x, y, z))), axis=-1)


def polar(radius: ArrayLike, angle: ArrayLike, z: ArrayLike = 0.0) -> Array:
    """Points (…, 3) of distance from the Z axis, angle from +X in radians, and height."""
    r = np.asarray(radius, float)
    a = np.asarray(angle, float)
    return xyz(r * np.cos(a), r * np.sin(a), z)


def unit(vectors: ArrayLike) -> Array:
    """Vectors (…, k) scaled to length 1."""
    v = np.asarray(vectors, float)
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def directions(random: np.random.Generator, count: int) -> Array:
    """Unit vectors (count, 3), evenly spread over the sphere."""
    return unit(random.normal(size=(count, 3)))


def circle(radius: float, segments: int, start: float = 0.0, stop: float = 2 * np.pi) -> Array:
    """Points (n, 2) of a circle, or of an arc from angle `start` to `stop` with both ends."""
    is_full = np.isclose(stop - start, 2 * np.pi)
    return polar(radius, np.linspace(start, stop, segments, endpoint=not is_full))[:, :2]


def rectangle(width: float, height: float) -> Array:
    """The corners (4, 2) of a rectangle about the origin, counter-clockwise."""
    return np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, height / 2)


def smooth_path(path: Points, steps: int) -> Array:
    """Points (steps + 1, k) of a cubic spline through the path, at even steps of chord length."""
    p = points(path)
    chord = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    return np.asarray(CubicSpline(chord, p)(np.linspace(0, chord[-1], steps + 1)))


def smoothstep(low: float, high: float, value: ArrayLike) -> Array:
    """0 at `low` and 1 at `high`, with level ends. `high` may be smaller than `low`."""
    t = np.clip((np.asarray(value, float) - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def noise(places: ArrayLike, seed: int, octaves: int = 1) -> Array:
    """Perlin's improved gradient noise at places (..., 3), about −1..1. Octaves halve in size."""
    at = np.asarray(places, float)
    total = np.zeros(at.shape[:-1])
    for octave in range(octaves):
        shift = np.random.default_rng([seed, octave]).uniform(0, 256, 3)
        spots = (at.reshape(-1, 3) * 2.0**octave + shift).tolist()
        values = [mathutils.noise.noise(spot, noise_basis="PERLIN_NEW") for spot in spots]
        total += np.reshape(values, total.shape) / 2.0**octave
    return total
