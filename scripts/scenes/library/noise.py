"""Smooth functions of a place: Perlin's noise, and a step with soft shoulders."""

import numpy as np
from numpy.typing import ArrayLike

from scenes.library.points import Array


def smoothstep(low: float, high: float, value: ArrayLike) -> Array:
    """0 at `low` and 1 at `high` (which may be the smaller one), level at both."""
    t = np.clip((np.asarray(value, float) - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def noise(points: ArrayLike, seed: int, octaves: int = 1) -> Array:
    """Perlin's gradient noise at points (..., 3), about −1..1; further octaves halve in size.

    Ken Perlin, "Improving Noise", SIGGRAPH 2002, with an integer hash in place of the table.
    """
    shape = np.shape(points)[:-1]
    p = np.asarray(points, float).reshape(-1, 3)
    total = np.zeros(len(p))
    for octave in range(octaves):
        total += _perlin(p * 2.0**octave, seed + 101 * octave) / 2.0**octave
    return total.reshape(shape)


def _perlin(p: Array, seed: int) -> Array:
    cell = np.floor(p)
    f = p - cell
    lattice = cell.astype(np.int64).astype(np.uint32)  # wraps round: only hashed
    blend = f * f * f * (f * (f * 6 - 15) + 10)
    result = np.zeros(p.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        h = np.full(p.shape[:-1], seed * 2654435761 % 2**32, dtype=np.uint32)
        for axis in range(3):
            h = (h ^ (lattice[..., axis] + np.uint32(corner[axis]))) * np.uint32(0x85EBCA6B)
            h ^= h >> np.uint32(15)
        h = h * np.uint32(0xC2B2AE35)
        h ^= h >> np.uint32(16)
        d = f - np.array(corner)
        weight = np.prod(np.where(np.array(corner) == 1, blend, 1 - blend), axis=-1)
        first = (h >> np.uint32(4)) % np.uint32(3)  # the axis a gradient lacks: 12 edges of a cube
        u = np.where(first == 0, d[..., 1], d[..., 0])
        v = np.where(first == 2, d[..., 1], d[..., 2])
        dot = np.where(h & 1, u, -u) + np.where(h & 2, v, -v)
        result += weight * dot
    return result
