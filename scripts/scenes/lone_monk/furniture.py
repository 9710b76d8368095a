"""What the monks use: benches, lanterns and jars in the walks; a chair, a book, a broom outside."""

import numpy as np

from scenes.library.architecture import stones
from scenes.library.model import Model
from scenes.library.objects import place
from scenes.library.plants import folded_leaf
from scenes.library.points import points, polar
from scenes.library.scene import Scene
from scenes.library.shapes import copies, join
from scenes.lone_monk import plan
from scenes.lone_monk.plan import ARCADE, BACK, WALK_FLOOR, on_sides, side

# Boards and posts: middle x, y, z and width, depth, height; seen from the front, which is −Y.
BENCH = """0 -0.18 0.45 1.6 0.14 0.035, 0 -0.03 0.45 1.6 0.14 0.035, 0 0.12 0.45 1.6 0.14 0.035
    0 0.215 0.62 1.6 0.03 0.12, 0 0.215 0.78 1.6 0.03 0.12
    -0.7 -0.2 0.215 0.06 0.06 0.43, 0.7 -0.2 0.215 0.06 0.06 0.43
    -0.7 0.19 0.43 0.06 0.06 0.86, 0.7 0.19 0.43 0.06 0.06 0.86
    -0.7 0 0.4 0.045 0.4 0.06, 0.7 0 0.4 0.045 0.4 0.06"""
CHAIR_BOARDS = """-0.16 -0.01 0.455 0.1 0.44 0.025, -0.053 -0.01 0.455 0.1 0.44 0.025
    0.053 -0.01 0.455 0.1 0.44 0.025, 0.16 -0.01 0.455 0.1 0.44 0.025
    0 0.2 0.6 0.38 0.016 0.07, 0 0.225 0.76 0.38 0.016 0.07, 0 0.255 0.93 0.38 0.016 0.07"""
# Sticks: how thick, from x, y, z, and to x, y, z.
CHAIR_STICKS = """0.02 -0.2 -0.19 0 -0.2 -0.19 0.46, 0.02 0.2 -0.19 0 0.2 -0.19 0.46
    0.02 -0.19 0.18 0 -0.19 0.18 0.47, 0.02 0.19 0.18 0 0.19 0.18 0.47
    0.02 -0.19 0.18 0.44 -0.19 0.27 1.02, 0.02 0.19 0.18 0.44 0.19 0.27 1.02
    0.013 -0.2 -0.19 0.2 -0.2 0.18 0.2, 0.013 0.2 -0.19 0.2 0.2 0.18 0.2
    0.013 -0.2 -0.19 0.28 0.2 -0.19 0.28, 0.014 -0.19 0.18 0.25 0.19 0.18 0.25"""
JAR = """0.12 0, 0.2 0.12, 0.25 0.3, 0.25 0.42, 0.19 0.6, 0.12 0.68
    0.12 0.72, 0.145 0.75, 0.14 0.77, 0.1 0.75, 0.1 0.6"""


def benches(scene: Scene) -> None:
    """Benches 1.6 m long along the walls of the walks, and three in the court."""
    seat = [scene.mesh("Bench", stones(BENCH, 0.006), "Wood", smooth=False)]
    on_sides("Bench", seat, plan.BAY_AXES[[1, 5]], BACK - 0.32, WALK_FLOOR)
    for number, x in ((plan.EAST, 2.9), (plan.NORTH, -3.3), (plan.WEST, 2.7)):
        on_sides("Court bench", seat, x, ARCADE - 0.66, 0.015, sides=[number])


def lanterns(scene: Scene) -> None:
    """Lanterns of iron with a candle, hung under the vaults' bosses."""
    model, around = Model(scene), polar(0.11, np.arange(6) * np.pi / 3)
    roof, plate = scene.lathe("0.13 -0.82, 0.02 -0.7", 6), scene.lathe("0.11 -1.14, 0.12 -1.12", 6)
    bars = copies(scene.tube("0 0 -1.12, 0 0 -0.82", 0.008, 4), around)
    model.add(join([scene.tube("0 0 0, 0 0 -0.7", 0.008, 5), roof, plate, bars]), "Iron")
    model.add(scene.lathe("0.03 -1.12, 0.03 -0.97", 8), "Daisy")
    boss = (plan.WALK_MIDDLE, plan.SPRINGING + plan.VAULT_RISE - 0.1)
    on_sides("Lantern", [model.mesh("Lantern")], plan.BAY_AXES[::2], *boss)


def jars(scene: Scene) -> None:
    """Oil jars in the corners of the walks."""
    jar = Model(scene)
    jar.add(scene.lathe(JAR, 28, capped=False), "Pot")
    x, y, turn, size = points("0.4 -0.4 50 0.9, 0.95 -0.5 180 1.15, 1.5 -0.4 280 0.75").T
    on_sides("Jar", [jar.mesh("Jar")], x - BACK, y + BACK, WALK_FLOOR, turn, size)


def chair(scene: Scene) -> None:
    """A ladder-back chair on the lawn with a book on it."""
    model, book, turn = Model(scene), (0.03, -0.03, 0.468), (0, 0, 23)
    model.add(stones(CHAIR_BOARDS, 0.006), "Wood")
    for radius, *ends in points(CHAIR_STICKS):
        model.add(scene.tube(np.reshape(ends, (2, 3)), radius), "Wood")
    model.add(stones("0 0 0.012 0.16 0.22 0.024", 0.002), "Robe", book, turn)
    model.add(stones("0.004 0 0.012 0.155 0.21 0.02", 0.001), "Daisy", book, turn)
    place("Chair", model.mesh("Chair"), side(plan.NORTH, (4.5, -2.2, 0.0), -63))


def broom(scene: Scene) -> None:
    """A broom against a column."""
    random, model = scene.random("broom"), Model(scene)
    model.add(scene.tube("0 0 0.32, 0 0.16 0.9, 0 0.32 1.5", 0.013, 6), "Wood")
    foot = random.normal((0, 0, 0.33), (0.02, 0.02, 0), (90, 3))
    down = random.normal((0, -0.25, -1), (0.22, 0.12, 0), (90, 3))
    model.add(copies(folded_leaf(0.03), foot, down, (0, 1, 0.2), 0.33), "Rope")
    place("Broom", model.mesh("Broom"), side(plan.SOUTH, (-3.1, ARCADE - 0.62, 0.0), 11))
