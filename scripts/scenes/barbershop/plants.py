"""Potted plants on the sill, in the corners, and hanging."""

import bpy
import numpy as np

from scenes.barbershop.goods import Goods, stock
from scenes.barbershop.plan import Barbershop, put, standing
from scenes.library.points import evenly, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, sheet

POTTED = {"Fern": ("Terracotta", 44), "Snake plant": ("Navy", 16), "Rubber tree": ("Brass", 26)}


def in_corner(plan: Barbershop, corner: tuple[int, int], x: float, y: float) -> tuple[float, float]:
    """A place x and y metres from the walls of a corner, which is given by its signs."""
    return corner[0] * (plan.half_x - x), corner[1] * (plan.half_y - y)


def plant_cord(scene: Scene[Barbershop]) -> None:
    """The cords of the hanging plant."""
    cord = Model(scene)
    cord.tube(radius=0.003, path=[(0.105, 0, 0.165), (0, 0, 0.78)], material="Brass")
    cord.bend(
        radius=0.003, path=[(0.105, 0, 0.165), (0.084, 0, 0), (0, 0, -0.01)], material="Brass"
    )
    x, y = in_corner(scene.plan, scene.plan.hanging_corner, 0.26, 0.33)
    put(
        cord.mesh(name="Plant cord"),
        where=[
            standing(x, y, z=1.62 + scene.plan.raised, turned=turn) for turn in evenly(0, 240, 3)
        ],
    )


def plant_hook(scene: Scene[Barbershop]) -> None:
    """The rod that they hang from."""
    hook = Model(scene)
    hook.tube(radius=0.003, path=[(0, 0, 0.77), (0, 0, 1.38)], material="Brass")
    x, y = in_corner(scene.plan, scene.plan.hanging_corner, 0.26, 0.33)
    put(hook.mesh(name="Plant hook"), where=standing(x, y, z=1.62 + scene.plan.raised))


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


def plants(scene: Scene[Barbershop], bottles: Goods) -> None:
    """Plants on the sills, bottles between them; others in the corners, one hanging."""
    plan = scene.plan
    random = scene.random("plants")
    fern, snake, rubber = (plant(scene, kind) for kind in POTTED)
    for along, width in plan.windows:
        for aside, data in ((-1.05, fern), (-0.2, snake), (0.45, fern), (1.1, rubber)):
            if abs(aside) > width / 2 - 0.15:
                continue
            turn = (0, 0, random.uniform(0, 360))
            size = random.uniform(0.5, 0.6)
            put(data, plan.at_front(along + aside, away=0.08, z=1), degrees=turn, scale=size)
        for aside in (-0.65, 0.12, 0.78):
            if abs(aside) < width / 2 - 0.15:
                sill = plan.at_front(along + aside, away=0.05, z=1)
                stock(scene, random, bottles, sill, 0.34, 0.12)
    if plan.tree_corner:
        x, y = in_corner(plan, plan.tree_corner, 0.32, 0.37)
        put(rubber, standing(x, y, turned=40), scale=1.5)
    if plan.hanging_corner:
        x, y = in_corner(plan, plan.hanging_corner, 0.28, 0.29)
        put(snake, standing(x, y, turned=10), scale=1.3)
        x, y = in_corner(plan, plan.hanging_corner, 0.26, 0.33)
        put(fern, standing(x, y, z=1.62 + plan.raised, turned=200), scale=0.8)
