"""A small radiance field on the CPU: hash grids and two small networks, with gradients by hand.

One network makes density of a place, the other colour of it and the direction. Each has a grid of
its own, so that what teaches the one does not disturb the other. Rays are integrated as in NeRF
(Mildenhall et al. 2020, equation 3); the grids are those of Müller et al. 2022; all of space is
drawn into a cube by the contraction of mip-NeRF 360 (Barron et al. 2022, equation 10). Depth is
taught: along a ray, samples are dense around it, and the loss has the negative logarithm of the
light's part that comes from there.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lightfield.core.compiled import kernel, part

Array = np.ndarray[Any, Any]

# Cells along a side of a grid, of each level; entries of a level's table, and values of one.
RESOLUTIONS = (16, 26, 43, 70, 115, 189, 311, 512)
ENTRIES, FEATURES = 1 << 16, 2
HIDDEN = 32
# Metres; what has no depth is at FAR.
NEAR, FAR = 0.1, 100.0
# Samples of a ray before the surface and around it, within this part of its distance.
BEFORE, AROUND, BAND = 6, 4, 0.03
# Of a ray that is shown, from NEAR to FAR.
SHOWN = 256
RAYS, STEPS = 2048, 400
RATE, LAST_RATE = 1e-2, 1e-3
DEPTH_WEIGHT = 0.1
_TINY = 1e-5


class Field:
    """A field around ``center`` (3,), finest within ``radius`` metres, learned in ``steps``."""

    def __init__(self, center: Array, radius: float, steps: int) -> None:
        self.center, self.radius, self.all_steps = center, radius, steps
        self.random = np.random.default_rng(0)
        self.shape, self.look = Network(0, 1, self.random), Network(9, 3, self.random)
        self.parameters = [*self.shape.parameters, *self.look.parameters]
        self.means = [np.zeros_like(one) for one in self.parameters]
        self.squares = [np.zeros_like(one) for one in self.parameters]
        self.done = 0

    def learn(self, origins: Array, rays: Array, colour: Array, distance: Array) -> float:
        """Take one step towards rays (n, 3) of unit length; return the loss.

        They start at ``origins`` (n, 3), have ``colour`` (n, 3) from 0 to 1, and meet the first
        surface at ``distance`` (n,) in metres, inf for none.
        """
        ends, taught = self._intervals(distance)
        places = self.random.random(taught.shape, np.float32)
        loss, gradients = self.loss(origins, rays, colour, ends, taught, places)
        self._adam(gradients)
        return loss

    def loss(
        self,
        origins: Array,
        rays: Array,
        colour: Array,
        ends: Array,
        taught: Array,
        places: Array,
    ) -> tuple[float, list[Array]]:
        """Return the loss and its gradients by parameter.

        Each interval between ``ends`` (n, m + 1) of rays has a sample at ``places`` (n, m), from 0
        to 1; light is to come from those that are ``taught`` (n, m).
        """
        count, samples = places.shape
        along, steps = _samples(ends, places)
        points = self._points(origins[:, None] + rays[:, None] * along[..., None])
        density = _density(self.shape.forward(points)).reshape(along.shape)
        bases = np.repeat(_harmonics(rays), samples, axis=0)
        seen = _sigmoid(self.look.forward(points, bases)).reshape(count, samples, 3)
        steps = steps / self.radius
        weights, left = _weights(density, steps)
        error = np.einsum("nm,nmc->nc", weights, seen) - colour
        there = (weights * taught).sum(axis=1) + _TINY
        loss = (error**2).mean() - DEPTH_WEIGHT * np.log(there).mean()

        error *= 2 / error.size
        of_weights = np.einsum("nc,nmc->nm", error, seen)
        of_weights -= taught * (DEPTH_WEIGHT / count / there)[:, None]
        of_seen = (weights[..., None] * error[:, None]) * seen * (1 - seen)
        onward = np.cumsum((of_weights * weights)[:, ::-1], axis=1)[:, ::-1]
        behind = np.hstack([onward[:, 1:], np.zeros((count, 1), np.float32)])
        of_density = _finite(steps) * (left * of_weights - behind)
        of_shape = self.shape.backward((of_density * density).reshape(-1, 1))
        return float(loss), [*of_shape, *self.look.backward(of_seen.reshape(-1, 3))]

    def show(self, origins: Array, rays: Array) -> Array:
        """Return the colour (n, 3) of rays, as `learn` has them, from density alone."""
        ends = np.append(np.geomspace(NEAR, FAR, SHOWN), np.inf).astype(np.float32)
        along, steps = _samples(ends, np.float32(0.5))
        found = []
        for first in range(0, len(rays), 1024):
            start, ray = origins[first : first + 1024], rays[first : first + 1024]
            points = self._points(start[:, None] + ray[:, None] * along[:, None])
            density = _density(self.shape.forward(points)).reshape(len(ray), SHOWN)
            weights, _ = _weights(density, steps / self.radius)
            # What is hidden needs no colour.
            seen = np.zeros((*weights.shape, 3), np.float32)
            lit = weights > 1e-3
            bases = np.broadcast_to(_harmonics(ray)[:, None], (*weights.shape, 9))[lit]
            seen[lit] = _sigmoid(self.look.forward(points[lit.reshape(-1)], bases))
            found.append(np.einsum("nm,nmc->nc", weights, seen))
        return np.concatenate(found)

    def _intervals(self, distance: Array) -> tuple[Array, Array]:
        """Return the ends (n, m + 1) of intervals of rays, and which are taught to have surface.

        In order they are before the surface, around it, and beyond all: the surface of a ray that
        meets none.
        """
        surface = np.clip(distance, 2 * NEAR, FAR)[:, None]
        before = NEAR * (surface * (1 - BAND) / NEAR) ** np.linspace(0, 1, BEFORE, endpoint=False)
        around = surface * np.linspace(1 - BAND, 1 + BAND, AROUND + 1)
        beyond = np.full_like(surface, np.inf)
        ends = np.hstack([before, around, beyond]).astype(np.float32)
        return ends, np.hstack([before < 0, around[:, 1:] > 0, surface == FAR])

    def _points(self, world: Array) -> Array:
        """Return world points (…, 3) as (n, 3) in the unit cube."""
        local = ((world - self.center) / self.radius).reshape(-1, 3)
        away = np.maximum(np.linalg.norm(local, axis=-1, keepdims=True), 1)
        return np.asarray(0.5 + local * (2 - 1 / away) / away / 4, np.float32)

    def _adam(self, gradients: Sequence[Array]) -> None:
        """Move the parameters. Source: Kingma and Ba 2015, with a rate that falls."""
        self.done += 1
        rate = RATE * (LAST_RATE / RATE) ** (self.done / self.all_steps)
        rate *= np.sqrt(1 - 0.99**self.done) / (1 - 0.9**self.done)
        states = zip(self.parameters, gradients, self.means, self.squares, strict=True)
        for parameter, gradient, mean, square in states:
            mean += 0.1 * (gradient - mean)
            square += 0.01 * (gradient**2 - square)
            parameter -= np.float32(rate) * mean / (np.sqrt(square) + np.float32(1e-12))


class Network:
    """Two layers of weights over what a hash grid holds at a place and ``beside`` other numbers."""

    def __init__(self, beside: int, outputs: int, random: np.random.Generator) -> None:
        inputs = len(RESOLUTIONS) * FEATURES + beside
        tables = random.uniform(-1e-4, 1e-4, (len(RESOLUTIONS), ENTRIES, FEATURES))
        first = random.standard_normal((inputs + 1, HIDDEN)) * np.sqrt(2 / inputs)
        first[-1] = 0
        second = random.standard_normal((HIDDEN, outputs)) * np.sqrt(2 / HIDDEN)
        self.parameters = [one.astype(np.float32) for one in (tables, first, second)]

    def forward(self, points: Array, *beside: Array) -> Array:
        """Return the outputs (n, k) at points (n, 3) of the unit cube."""
        tables, first, second = self.parameters
        encoded = np.empty((len(points), len(RESOLUTIONS), FEATURES), np.float32)
        for level, resolution in enumerate(RESOLUTIONS):
            _encode(points, resolution, tables[level], encoded[:, level])
        self.points, self.inputs = points, np.hstack([encoded.reshape(len(points), -1), *beside])
        self.hidden = np.maximum(self.inputs @ first[:-1] + first[-1], 0)
        return np.asarray(self.hidden @ second)

    def backward(self, gradient: Array) -> list[Array]:
        """Return the gradients of the parameters from that of what `forward` returned last."""
        tables, first, second = self.parameters
        hidden = gradient @ second.T * (self.hidden > 0)
        of_first = np.vstack([self.inputs.T @ hidden, hidden.sum(axis=0)])
        encoded = hidden @ first[: len(RESOLUTIONS) * FEATURES].T
        encoded = encoded.reshape(len(hidden), len(RESOLUTIONS), FEATURES)
        of_tables = np.zeros_like(tables)
        for level, resolution in enumerate(RESOLUTIONS):
            _scatter(self.points, resolution, encoded[:, level], of_tables[level])
        return [of_tables, of_first, self.hidden.T @ gradient]


def _density(raw: Array) -> Array:
    return np.exp(np.clip(raw, -15, 12))


def _sigmoid(raw: Array) -> Array:
    return 1 / (1 + np.exp(-np.clip(raw, -30, 30)))


def _samples(ends: Array, places: Array) -> tuple[Array, Array]:
    """Return how far samples are in intervals (…, m + 1), and the lengths that they stand for."""
    steps = np.diff(ends)
    return ends[..., :-1] + places * _finite(steps), steps


def _finite(steps: Array) -> Array:
    return np.where(np.isinf(steps), np.float32(0), steps)


def _weights(density: Array, steps: Array) -> tuple[Array, Array]:
    """Return the part of a ray's light that each sample gives, and what gets past each."""
    depth = np.cumsum(density * _finite(steps), axis=1)
    left = np.exp(-depth)
    reached = np.hstack([np.ones_like(left[:, :1]), left[:, :-1]])
    weights = reached - left
    weights[:, -1] = reached[:, -1]
    return weights, left


def _harmonics(rays: Array) -> Array:
    """Return polynomials (n, 9) of unit rays (n, 3), which span the harmonics to degree 2."""
    x, y, z = rays.T
    ones = np.ones_like(x)
    return np.stack(
        [ones, x, y, z, x * y, y * z, x * z, x * x - y * y, 3 * z * z - 1], axis=1
    ).astype(np.float32)


@part
def _entry(x, y, z, resolution, entries):  # type: ignore[no-untyped-def]
    """Return where a corner of the grid is in its table. Source: Müller et al. 2022, equation 4."""
    side = resolution + 1
    if side * side * side <= entries:
        return (z * side + y) * side + x
    return (x ^ (y * 2654435761) ^ (z * 805459861)) & (entries - 1)


@part
def _corner(point, corner, resolution, entries):  # type: ignore[no-untyped-def]
    """Return the entry of one of the 8 corners of the cell around a point, and its weight."""
    x, y, z = point[0] * resolution, point[1] * resolution, point[2] * resolution
    left, low, front = int(x), int(y), int(z)
    x, y, z = x - left, y - low, z - front
    i, j, k = corner & 1, (corner >> 1) & 1, corner >> 2
    weight = (x if i else 1 - x) * (y if j else 1 - y) * (z if k else 1 - z)
    return _entry(left + i, low + j, front + k, resolution, entries), weight


@kernel
def _encode(points, resolution, table, out):  # type: ignore[no-untyped-def]
    """Write what a level of the grid holds at points (n, 3) of the unit cube into out (n, k)."""
    for number in range(points.shape[0]):
        one = np.float32(0)
        two = np.float32(0)
        for corner in range(8):
            entry, weight = _corner(points[number], corner, resolution, table.shape[0])
            one += weight * table[entry, 0]
            two += weight * table[entry, 1]
        out[number, 0] = one
        out[number, 1] = two


@kernel
def _scatter(points, resolution, gradient, out):  # type: ignore[no-untyped-def]
    """Add the gradient (n, k) of what `_encode` wrote to that of the table."""
    for number in range(points.shape[0]):
        for corner in range(8):
            entry, weight = _corner(points[number], corner, resolution, out.shape[0])
            out[entry, 0] += weight * gradient[number, 0]
            out[entry, 1] += weight * gradient[number, 1]
