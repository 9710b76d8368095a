"""The ground of the court: paths of stone, the plaza round the well, and four lawns in kerbs."""

from collections.abc import Sequence
from itertools import pairwise

import bpy
import numpy as np
from numpy.random import Generator

from scenes.library.architecture import blocks, cut, ring_of_stones, stones
from scenes.library.plants import blade, folded_leaf
from scenes.library.points import noise, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, copies, grid, icosphere, join, transform
from scenes.lone_monk.plan import CROSS_PATH, PLAZA, WALK_FLOOR, Cloister

CELLS = 16  # of grass along a lawn's edge


def paving(scene: Scene[Cloister]) -> None:
    """The paths by the arcades and to the well, its plaza, the walks' floors, and bare earth."""
    scene.add("Ground", grid([-120, 120], [-120, 120], -0.03), "Dry earth")
    random = scene.random("paving")
    paths = Model(scene)
    plaza = Model(scene)
    coarser = min(1.0, scene.detail) ** -0.5
    outer = scene.plan.arcade - 0.25
    slab = (0.52 * coarser, 0.41)
    tile = (0.3 * coarser, 0.3)
    far = scene.plan.back + 0.1
    paths.add(
        slabs(random, (-outer, scene.plan.lawn, scene.plan.lawn, outer), slab, 0.015), "Paving"
    )
    paths.add(
        slabs(random, (-CROSS_PATH, CROSS_PATH, PLAZA - 0.1, scene.plan.lawn), slab, 0.015),
        "Paving",
    )
    paths.add(slabs(random, (-far, outer, outer, far), tile, WALK_FLOOR), "Terracotta floor")
    paths.add(stones([(0, outer - 0.15, 0.03, 1.75, 0.34, 0.1)], 0.015), "Paving")
    for radius in np.linspace(1.0, PLAZA - 0.145, 5):
        count = max(8, round(2 * np.pi * radius / slab[0]))
        ring = ring_of_stones(count, radius, 0.28, -0.045, 0.12)
        plaza.add(ring, "Paving", degrees=(0, 0, random.uniform(0, 60)))
    scene.plan.on_sides("Paving", [paths.mesh("Paving")])
    scene.plan.on_sides("Plaza", [plaza.mesh("Plaza")], sides=[0])


def slabs(random: Generator, area: Sequence[float], size: Sequence[float], top: float) -> Shape:
    """Slabs 12 cm thick of about a length and depth, in rows over the rectangle x0, x1, y0, y1.

    Each is a little higher or lower than its neighbours. The plaza is left out.
    """
    x0, x1, y0, y1 = area
    rows = []
    for low, high in pairwise(np.linspace(y0, y1, round((y1 - y0) / size[1]) + 1)):
        middle, length = cut(random, x0, x1, max(1, round((x1 - x0) / size[0])))
        z = top - 0.06 + random.uniform(-0.004, 0.004, len(middle))
        row = xyz(middle, (low + high) / 2, z), xyz(length - 0.014, high - low - 0.014, 0.12)
        rows.append(np.concatenate(row, axis=1))
    laid = np.concatenate(rows)
    return stones(laid[np.hypot(laid[:, 0], laid[:, 1]) > PLAZA + 0.16])


def lawns(scene: Scene[Cloister]) -> None:
    """Turf and grass, gravel, or slabs; the corner of each lawn next to the middle is cut round."""
    random = scene.random("lawns")
    cell = (scene.plan.lawn - CROSS_PATH) / CELLS
    lawn = Model(scene)
    along = np.linspace(CROSS_PATH, scene.plan.lawn, 25)
    x, y = np.meshgrid(along, along)
    bumps = 0.012 * noise(xyz(x, y) * 1.5, scene.seed) - 0.01
    surface = grid(along, along, np.where(np.hypot(x, y) < PLAZA - 0.2, -0.1, bumps))
    lawn.add(surface, "Turf" if scene.plan.ground == "lawn" else "Dry earth")
    if scene.plan.ground == "paved":
        quarter = (CROSS_PATH, scene.plan.lawn, CROSS_PATH, scene.plan.lawn)
        coarser = min(1.0, scene.detail) ** -0.5
        lawn.add(slabs(scene.random("slabs"), quarter, (0.9 * coarser, 0.75), 0.02), "Paving")
    # Kerb stones round it, and round its cut corner.
    corner = np.arcsin(CROSS_PATH / PLAZA)
    arc = ring_of_stones(5, PLAZA + 0.05, 0.1, 0.0, 0.14, np.pi / 2 - 2 * corner)
    lawn.add(arc.transformed(transform(rotation=(0, 0, corner))), "Limestone")
    for line, start in ((CROSS_PATH, PLAZA * np.cos(corner)), (scene.plan.lawn, CROSS_PATH)):
        length = (scene.plan.lawn - start) / 9
        run = start + (np.arange(9) + 0.5) * length
        lawn.add(blocks(xyz(run, line), (length - 0.01, 0.1, 0.14)), "Limestone")
        lawn.add(blocks(xyz(line, run), (0.1, length - 0.01, 0.14)), "Limestone")
    scene.plan.on_sides("Lawn", [lawn.mesh("Lawn")])
    if scene.plan.ground == "paved":
        return
    random_patch = {"lawn": grass, "gravel": pebbles}[scene.plan.ground]
    patches = [random_patch(scene, random, cell) for _ in range(6)]
    x, y = CROSS_PATH + (np.indices((CELLS, CELLS)).reshape(2, -1) + 0.5) * cell
    x, y = np.stack([x, y])[:, np.hypot(x, y) > PLAZA + 0.3]
    turn = 90 * random.integers(4, size=len(x))
    size = random.uniform(0.95, 1.15, len(x))
    scene.plan.on_sides("Grass", patches, x, y, 0, turn, size)


def grass(scene: Scene, random: Generator, cell: float) -> bpy.types.Mesh:
    """A square of grass, with a daisy here and there."""
    count = scene.count(150)
    foot = xyz(*random.uniform(-cell / 2, cell / 2, (2, count)), -0.01)
    forward = random.normal(0, (1, 1, 0), (count, 3))
    up = random.normal((0, 0, 1), 0.3, (count, 3))
    parts = [copies(blade(0.055, 3, 0.35), foot, forward, up, random.uniform(0.035, 0.085, count))]
    for _ in range(random.integers(2)):
        petals = polar(1, np.arange(8) * np.pi / 4, 0.25)
        middle = foot[0] + (0, 0, 0.08)
        parts.append(copies(folded_leaf(0.5), middle + 0 * petals, petals, size=0.013).painted(1))
    return scene.mesh("Grass", join(parts), "Grass", "Daisy", smooth=False)


def pebbles(scene: Scene, random: Generator, cell: float) -> bpy.types.Mesh:
    """A square of loose pebbles."""
    count = scene.count(260)
    at = xyz(*random.uniform(-cell / 2, cell / 2, (2, count)), 0.0)
    stone = icosphere(1).scaled(1.0, 0.8, 0.45)
    forward = random.normal(0, (1, 1, 0), (count, 3))
    scattered = copies(stone, at, forward, (0, 0, 1), random.uniform(0.008, 0.03, count))
    return scene.mesh("Pebbles", scattered, "Limestone")
