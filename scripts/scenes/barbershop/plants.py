"""Potted plants on the sill, in the corners, and hanging."""

import bpy
import numpy as np

from scenes.barbershop.goods import Goods, stock
from scenes.barbershop.plan import against, put, standing
from scenes.library.points import evenly, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, sheet

POTTED = {"Fern": ("Terracotta", 44), "Snake plant": ("Navy", 16), "Rubber tree": ("Brass", 26)}


def plant_cord(scene: Scene) -> None:
    """The cords of the hanging plant."""
    cord = Model(scene)
    cord.tube(radius=0.003, path=[(0.105, 0, 0.165), (0, 0, 0.78)], material="Brass")
    cord.bend(
        radius=0.003, path=[(0.105, 0, 0.165), (0.084, 0, 0), (0, 0, -0.01)], material="Brass"
    )
    put(
        cord.mesh(name="Plant cord"),
        where=[standing(x=-2.24, y=3.42, z=1.62, turned=turn) for turn in evenly(0, 240, 3)],
    )


def plant_hook(scene: Scene) -> None:
    """The rod that they hang from."""
    hook = Model(scene)
    hook.tube(radius=0.003, path=[(0, 0, 0.77), (0, 0, 1.38)], material="Brass")
    put(hook.mesh(name="Plant hook"), where=standing(x=-2.24, y=3.42, z=1.62))


def leaf(scene: Scene, length: float, width: float, droop: float) -> Shape:
    """A leaf that grows along x from the origin, arching down, with a folded midrib."""
    n = scene.segments(10, 4)
    t = np.linspace(0, 1, n + 1)
    half = width / 2 * np.sin(np.pi * t**0.8) ** 0.8
    across = np.array([[-1], [0], [1]])
    angle = droop / n * np.arange(n)
    x, sunk = np.cumsum([[0, *np.cos(angle)], [0, *np.sin(angle)]], axis=1) * length / n
    return sheet(xyz(x, half * across, 0.25 * half * np.abs(across) - sunk))


def plant(scene: Scene, kind: str) -> bpy.types.Mesh:
    """A plant about 0.6 m tall with its pot."""
    random, (clay, count) = scene.random(kind), POTTED[kind]
    model = Model(scene)
    model.lathe(
        profile=[
            (0.09, 0),
            (0.1, 0.01),
            (0.125, 0.17),
            (0.14, 0.17),
            (0.14, 0.21),
            (0.125, 0.21),
            (0.118, 0.18),
            (0, 0.18),
        ],
        material=clay,
    )
    model.lathe(profile=[(0.117, 0.18), (0.117, 0.186), (0, 0.19)], material="Soil")
    for k in range(scene.segments(count, 6)):
        turn = k * 137.508 + random.uniform(-15, 15)
        if kind == "Fern":
            at = (0, 0, 0.185)
            rise = random.uniform(40, 80)
            blade = leaf(scene, random.uniform(0.24, 0.42), 0.035, np.radians(rise + 35))
        elif kind == "Snake plant":
            at = polar(0.07 * np.sqrt((k % 8) / 8), np.radians(turn), 0.18)
            blade = leaf(scene, random.uniform(0.3, 0.55), 0.06, 0.15)
            rise = random.uniform(76, 88)
        else:
            at = (0, 0, 0.24 + 0.5 * k / count)
            rise = random.uniform(15, 55)
            blade = leaf(scene, random.uniform(0.16, 0.24), 0.10, 0.9)
        model.add(blade, f"Leaf {k % 3}", at, (0, -rise, turn))
    if kind == "Rubber tree":
        model.bend(
            radius=0.009, path=[(0, 0, 0.18), (0.01, 0, 0.4), (0, 0.01, 0.75)], material="Soil"
        )
    return model.mesh(kind)


def plants(scene: Scene, bottles: Goods, pots: Goods) -> None:
    """Plants on the sill, bottles between them; others in the corners, one hanging."""
    random = scene.random("plants")
    fern, snake, rubber = (plant(scene, kind) for kind in POTTED)
    for x, data in ((-1.8, fern), (-0.95, snake), (-0.3, fern), (0.35, rubber)):
        turn = (0, 0, random.uniform(0, 360))
        put(
            data,
            against("front", along=x, away=0.08, z=1),
            degrees=turn,
            scale=random.uniform(0.5, 0.6),
        )
    for x in (-1.4, -0.63, 0.03):
        stock(scene, random, bottles, against("front", along=x, away=0.05, z=1), 0.34, 0.12)
    put(rubber, standing(x=2.18, y=3.38, turned=40), scale=1.5)
    put(snake, standing(x=-2.22, y=3.46, turned=10), scale=1.3)
    put(fern, standing(x=-2.24, y=3.42, z=1.62, turned=200), scale=0.8)
