"""Smooth functions of a place: noise, and a step with soft shoulders."""

import mathutils
import numpy as np
from numpy.typing import ArrayLike

from scenes.library.points import Array


def smoothstep(low: float, high: float, value: ArrayLike) -> Array:
    """0 at `low` and 1 at `high` (which may be the smaller one), level at both."""
    t = np.clip((np.asarray(value, float) - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def noise(places: ArrayLike, seed: int, octaves: int = 1) -> Array:
    """Perlin's improved gradient noise at places (..., 3), about −1..1; octaves halve in size."""
    at = np.asarray(places, float)
    total = np.zeros(at.shape[:-1])
    for octave in range(octaves):
        shift = np.random.default_rng([seed, octave]).uniform(0, 256, 3)
        points = (at.reshape(-1, 3) * 2.0**octave + shift).tolist()
        values = [mathutils.noise.noise(point, noise_basis="PERLIN_NEW") for point in points]
        total += np.reshape(values, total.shape) / 2.0**octave
    return total
