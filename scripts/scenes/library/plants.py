"""Leaves, blades of grass, and branching trees."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from scenes.library.points import Array, directions, noise, polar, unit, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, copies, facets, join, sheet, tube

TAU = 2 * np.pi


def oval_leaf() -> Shape:
    """A folded leaf of four triangles, 1 long along +Y."""
    rim = [(0, 0, 0), (0.3, 0.4, 0.06), (0, 1, -0.06), (-0.3, 0.4, 0.06), (0, 0.42, 0)]
    return facets(rim, (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))


def folded_leaf(width: float) -> Shape:
    """A leaf of two triangles folded along its midrib, 1 long along +Y."""
    x = width / 2
    z = 0.3 * width
    return facets([(0, 0, 0), (-x, 0.45, z), (0, 1, 0), (x, 0.45, z)], (0, 2, 1), (0, 3, 2))


def leaves_at(
    random: Generator, at: Array, forward: Array, length: ArrayLike, width: float
) -> Shape:
    """Folded leaves at places (n, 3) that point forward (n, 3), their faces turned at random."""
    return copies(folded_leaf(width), at, forward, directions(random, len(at)), length)


def leaf_cloud(
    random: Generator, count: int, radii: ArrayLike, length: ArrayLike, width: float
) -> Shape:
    """Folded leaves in the outer shell of an ellipsoid about the origin, turned outwards."""
    out = directions(random, count)
    depth = 1 - 0.3 * random.random((count, 1)) ** 2
    lumps = 1 + 0.10 * noise(out * 2.5, int(random.integers(10**6)))[:, None]
    forward = out + random.normal(0, 0.6, (count, 3))
    spots = out * depth * lumps * np.asarray(radii)
    return leaves_at(random, spots, forward, length, width)


def blade(width: float, rows: int, bow: float) -> Shape:
    """A blade of grass, 1 long, rising along +Z and bowing towards +Y."""
    t = np.linspace(0, 1, rows)[:, None]
    half = (width * (1 - t**1.6) + 0.0004) * (-1, 1)
    return sheet(xyz(half, bow * t**2, t * (1 - 0.25 * bow * t)))


def tuft(
    random: Generator, leaf: Shape, count: int, radius: float, lengths: tuple[float, float]
) -> Shape:
    """Blades of grass that stand within a disc."""
    spots = polar(radius * np.sqrt(random.random(count)), random.uniform(0, TAU, count), -0.03)
    forward = polar(1, random.uniform(0, TAU, count), random.normal(0, 0.25, count))
    up = xyz(*random.normal(0, 0.22, (2, count)), 1)
    return copies(leaf, spots, forward, up, random.uniform(*lengths, count))


@dataclass
class Growth:
    """How a tree grows. Each list has one entry a generation of branches, the trunk first."""

    lengths: Sequence[float]  # metres
    children: Sequence[int]  # side branches of each branch; the last generation bears the leaves
    angles: Sequence[float]  # radians between a branch and its parent
    upward: Sequence[float]  # how strongly a branch turns up (down where negative)
    radius: float  # of the trunk's foot, metres
    wander: float = 0.16  # how crooked the branches are
    bare: float = 0.4  # part of a branch before its first side branch


def branches(scene: Scene, random: Generator, growth: Growth) -> tuple[Shape, Array]:
    """A tree's wood, and the points of its twigs (n, k, 3)."""
    parts: list[Shape] = []
    twigs: list[Array] = []

    def grow(start: Array, heading: Array, length: float, radius: float, level: int) -> None:
        count, tip = (9, 0.5) if level == 0 else (6, 0.3)
        path = np.tile(start, (count, 1))
        upward = growth.upward[level]
        for k in range(1, count):  # it changes course at random, and turns towards the light
            heading = unit(heading + random.normal(0, growth.wander, 3) + (0, 0, upward))
            path[k] = path[k - 1] + heading * length / (count - 1)
        sides = scene.segments((12, 7, 5, 3)[level])
        parts.append(tube(path, radius * np.linspace(1, tip, count), sides, capped=False))
        if level == len(growth.lengths) - 1:
            twigs.append(path)
            return
        azimuth = random.uniform(0, TAU)
        for t in np.linspace(growth.bare if level == 0 else 0.3, 1.0, growth.children[level]):
            azimuth += 2.4
            low = min(int(t * (count - 1)), count - 2)
            spot = path[low] + (t * (count - 1) - low) * (path[low + 1] - path[low])
            along = unit(path[low + 1] - path[low])
            side = unit(np.cross(along, polar(1, azimuth, 0.3)))
            angle = growth.angles[level] * random.uniform(0.75, 1.2) * (1.0 if t < 0.99 else 0.4)
            size = growth.lengths[level + 1] * random.uniform(0.75, 1.15) * (1.15 - 0.4 * t)
            thick = radius * (1 - (1 - tip) * t) * 0.62
            grow(spot, np.cos(angle) * along + np.sin(angle) * side, size, thick, level + 1)

    up = np.array([0.0, 0.0, 1.0])
    grow(-0.2 * up, up, growth.lengths[0], growth.radius, 0)
    return join(parts), np.array(twigs)


def leaves_on(
    random: Generator, twigs: Array, leaf: Shape, count: int, size: tuple, droop: float, off: float
) -> Shape:
    """`count` leaves on each of the twigs (n, k, 3), flat side up, their stalks near the twig.

    size: from and to, metres. droop: how much they point down. off: metres from the twig.
    """
    number = len(twigs) * count
    which = np.repeat(np.arange(len(twigs)), count)
    at = random.uniform(0.15, 1.0, number) * (twigs.shape[1] - 1)
    low = np.minimum(at.astype(int), twigs.shape[1] - 2)
    part = (at - low)[:, None]
    spots = twigs[which, low] * (1 - part) + twigs[which, low + 1] * part
    spots = spots + random.normal(0, off, (number, 3))
    away = unit(twigs[:, -1] - twigs[:, 0])[which]
    forward = away + random.normal(0, 0.6, (number, 3)) - (0, 0, droop)
    up = random.normal((0, 0, 1), 0.45, (number, 3))
    return copies(leaf, spots, forward, up, random.uniform(*size, number))
