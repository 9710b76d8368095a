"""Towels, each of the material that is its colour, lying on z = 0 or over a rail; and shelves."""

import bpy
import numpy as np

from scenes.barbershop.plan import TAU, TOWELS, put, spot
from scenes.library.model import Model
from scenes.library.points import polar, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import sheet

SHELVES = """Oak: box 0.03 0.32 1.75 0.004 at ±0.39 0.16 0.875
    Oak: box 0.78 0.32 0.024 0.003 at 0 0.16 0.068..1.718*6
    Mahogany: box 0.78 0.012 1.75 at 0 0.006 0.875"""


def folded_towel(scene: Scene, towel: str) -> bpy.types.Mesh:
    """A towel folded twice, with a stripe."""
    stripe = "White towel" if towel == "Red towel" else "Red towel"
    parts = f"""{towel}: box 0.26 0.17 0.016 0.007 3 at 0 0 0.008..0.036*3
        {towel}: tube 0.022, -0.13 0.078 0.022, 0.13 0.078 0.022
        {stripe}: box 0.02 0.171 0.002 at -0.09 0 0.0445"""
    return Model(scene, parts).mesh(f"Folded {towel.lower()}")


def rolled_towel(scene: Scene, towel: str) -> bpy.types.Mesh:
    """A rolled towel, lying along y, its end a spiral."""
    lids = f"{towel}: lathe 0.039 -0.0005, 0.039 0.0005 at 0 ±0.106 0.042 turned 90 0 0"
    model, s = Model(scene, lids), np.linspace(1, 0, scene.segments(72, 12))
    x, z, _ = polar(0.012 + 0.030 * s, TAU * 3.2 * s).T
    shrink, y = np.array([(0.93, -0.11), (1, -0.104), (1, 0.104), (0.93, 0.11)]).T[:, :, None]
    model.add(sheet(xyz(x * shrink, y, z * shrink + 0.042)), towel)
    return model.mesh(f"Rolled {towel.lower()}")


def draped_towel(scene: Scene, towel: str) -> bpy.types.Mesh:
    """A towel over a rail along x at the origin, hanging down on both sides."""
    x = np.linspace(-0.16, 0.16, scene.segments(28, 6))
    s = np.linspace(0.46, -0.36, scene.segments(48, 10))[:, None]
    bow = np.clip(s / 0.022, -np.pi / 2, np.pi / 2)
    y = 0.022 * np.sin(bow) + 0.016 * np.sin(38 * x + 2) * np.abs(s) / 0.4
    z = 0.022 * np.cos(bow) - np.maximum(np.abs(s) - 0.0345, 0)
    return scene.mesh(f"Draped {towel.lower()}", sheet(xyz(x, y, z)), towel)


def towel_shelves(scene: Scene) -> None:
    """Open shelves of towels beside the staff door, with a basket on top."""
    basket, random, where = Model(scene), scene.random("towel shelves"), spot("back -0.42 0.036")
    put(Model(scene, SHELVES).mesh("Towel shelves"), where)
    folded = [folded_towel(scene, towel) for towel in TOWELS]
    rolled = [rolled_towel(scene, towel) for towel in TOWELS]
    for level, z in enumerate(np.linspace(0.08, 1.73, 6)[:-1]):
        side = 1 if level % 2 else -1
        for k, x in enumerate((-0.235 * side, 0.05 * side)):
            for pile in range(random.integers(2, 6)):
                turn = (0, 0, random.uniform(-2, 2))
                put(folded[(level + k) % 4], where, (x, 0.17, z + 0.0455 * pile), turn)
        for k, (x, up) in enumerate(((0.25, 0), (0.335, 0), (0.2925, 0.074))):
            put(rolled[(level + k + 1) % 4], where, (side * x, 0.17, z + up))
    basket.draw("Bristle: lathe 0.12 0.004, 0.12 0.01")
    for k in range(9):
        basket.add(scene.ring(0.13 + 0.004 * k, 0.011, 40, 6), "Bristle", (0, 0, 0.011 + 0.02 * k))
    put(basket.mesh("Basket"), where, (0, 0.16, 1.73))
    for k in range(5):
        x, y, z = polar(0.07, k * TAU / 5, 1.87)
        put(rolled[k % 4], where, (x, 0.16 + y, z), (78, 0, 72 * k))
