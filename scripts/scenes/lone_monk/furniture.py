"""The well, and the monks' objects: benches, lanterns, jars, a chair with a book, a broom."""

import numpy as np

from scenes.library.architecture import arch_outline, ring_of_stones, stones, upright
from scenes.library.plants import folded_leaf
from scenes.library.points import points, polar, xyz
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import copies, join
from scenes.lone_monk import plan
from scenes.lone_monk.plan import NORTH, WALK_FLOOR, Cloister

# The well's rings of stones: how many, the radius of their middle, width, middle height, height.
COURSES = [
    (20, 1.20, 0.62, 0.08, 0.16),
    (16, 0.98, 0.42, 0.22, 0.16),
    (14, 0.68, 0.2, 0.42, 0.24),
    (14, 0.68, 0.2, 0.655, 0.22),
    (14, 0.68, 0.2, 0.87, 0.2),
    (10, 0.69, 0.32, 1.035, 0.12),
]
TAUT = [(0.1, 0, 2.42), (0.1, 0, 2), (0.1, 0.01, 1.62)]  # rope
SLACK = [(-0.3, 0.3, 1.13), (-0.22, 0.2, 1.3), (-0.12, 0.04, 1.9), (-0.1, 0, 2.42)]
# Boards and posts: middle x, y, z and width, depth, height; seen from the front, which is −Y.
BENCH = [
    (0, -0.18, 0.45, 1.6, 0.14, 0.035),
    (0, -0.03, 0.45, 1.6, 0.14, 0.035),
    (0, 0.12, 0.45, 1.6, 0.14, 0.035),
    (0, 0.215, 0.62, 1.6, 0.03, 0.12),
    (0, 0.215, 0.78, 1.6, 0.03, 0.12),
    (-0.7, -0.2, 0.215, 0.06, 0.06, 0.43),
    (0.7, -0.2, 0.215, 0.06, 0.06, 0.43),
    (-0.7, 0.19, 0.43, 0.06, 0.06, 0.86),
    (0.7, 0.19, 0.43, 0.06, 0.06, 0.86),
    (-0.7, 0, 0.4, 0.045, 0.4, 0.06),
    (0.7, 0, 0.4, 0.045, 0.4, 0.06),
]
CHAIR_BOARDS = [
    (-0.16, -0.01, 0.455, 0.1, 0.44, 0.025),
    (-0.053, -0.01, 0.455, 0.1, 0.44, 0.025),
    (0.053, -0.01, 0.455, 0.1, 0.44, 0.025),
    (0.16, -0.01, 0.455, 0.1, 0.44, 0.025),
    (0, 0.2, 0.6, 0.38, 0.016, 0.07),
    (0, 0.225, 0.76, 0.38, 0.016, 0.07),
    (0, 0.255, 0.93, 0.38, 0.016, 0.07),
]
# Sticks: how thick, from x, y, z, and to x, y, z.
CHAIR_STICKS = [
    (0.02, -0.2, -0.19, 0, -0.2, -0.19, 0.46),
    (0.02, 0.2, -0.19, 0, 0.2, -0.19, 0.46),
    (0.02, -0.19, 0.18, 0, -0.19, 0.18, 0.47),
    (0.02, 0.19, 0.18, 0, 0.19, 0.18, 0.47),
    (0.02, -0.19, 0.18, 0.44, -0.19, 0.27, 1.02),
    (0.02, 0.19, 0.18, 0.44, 0.19, 0.27, 1.02),
    (0.013, -0.2, -0.19, 0.2, -0.2, 0.18, 0.2),
    (0.013, 0.2, -0.19, 0.2, 0.2, 0.18, 0.2),
    (0.013, -0.2, -0.19, 0.28, 0.2, -0.19, 0.28),
    (0.014, -0.19, 0.18, 0.25, 0.19, 0.18, 0.25),
]
JAR = [
    (0.12, 0),
    (0.2, 0.12),
    (0.25, 0.3),
    (0.25, 0.42),
    (0.19, 0.6),
    (0.12, 0.68),
    (0.12, 0.72),
    (0.145, 0.75),
    (0.14, 0.77),
    (0.1, 0.75),
    (0.1, 0.6),
]


def well(scene: Scene[Cloister]) -> None:
    """Steps, a ring of stones, and an iron arch that carries pulley, rope and two buckets."""
    model = Model(scene)
    for count, radius, width, z, height in points(COURSES):
        ring = ring_of_stones(int(count), radius, width, z, height)
        model.add(ring, "Limestone", degrees=(0, 0, 50 * z))
    model.add(scene.lathe([(0.585, 0), (0.585, 0.96)], capped=False), "Limestone")
    model.add(scene.lathe([(0.59, 0.30), (0.58, 0.31)]), "Water")

    x, z = arch_outline(0.68, 1.08, 2.25, 0.45, scene.segments(24)).T
    curl = np.linspace(0, 1.6 * np.pi, scene.segments(20))
    spiral = upright(scene.tube(polar(0.028 * curl, curl) - (0.18, 0, 0), 0.01, 6))
    foot = join([scene.lathe([(0.06, 1.09), (0.05, 1.12), (0.03, 1.14)]), spiral.moved(0, 0, 2.2)])
    cross = (
        scene.tube([(0, 0, 2.52), (0, 0, 3.05)], 0.015),
        scene.tube([(-0.1, 0, 2.95), (0.1, 0, 2.95)], 0.014),
    )
    model.add(join([scene.tube(xyz(x, 0, z), 0.022), *cross]), "Iron")
    for x, turn in ((0.68, 0), (-0.68, 180)):
        model.add(foot, "Iron", (x, 0, 0), (0, 0, turn))

    pulley = (0, 0, 2.42)
    wheel = scene.lathe([(0.02, -0.03), (0.12, -0.03), (0.09, 0), (0.12, 0.03), (0.02, 0.03)])
    model.add(upright(wheel), "Wood", pulley)
    over = np.linspace(np.pi, 0, 9)
    coil = np.linspace(0, 8 * np.pi, scene.segments(90))
    model.add(upright(scene.tube(polar(0.1, over), 0.013, 6)), "Rope", pulley)
    for path in (TAUT, SLACK):
        model.add(scene.bend(path, 0.013, 12, 6), "Rope")
    model.add(scene.tube(polar(0.13, coil, 0.003 * coil), 0.013, 6), "Rope", (-0.43, 0.53, 1.11))
    place("Well", model.mesh("Well"), scene.plan.side(NORTH))
    pail = bucket(scene).mesh("Bucket")
    place("Bucket.0", pail, scene.plan.side(NORTH, (0.10, 0.01, 1.25)))
    place("Bucket.1", pail, scene.plan.side(NORTH, (1.02, -0.62, 0.305), 34))


def bucket(scene: Scene) -> Model:
    """A wooden bucket of staves with iron hoops and a handle. It stands on its origin."""
    model = Model(scene)
    staves = ring_of_stones(14, 0.12, 0.018, 0.13, 0.26)
    flare = 1 + 0.35 * staves.vertices[:, 2:] * (1, 1, 0)
    model.add(staves.reshaped(staves.vertices * flare), "Wood")
    model.add(scene.lathe([(0.115, 0.02), (0.115, 0.03)], 14), "Wood")
    for corner in points([(0.134, 0.05), (0.143, 0.19)]):
        band = points([(0, 0), (0.004, 0), (0.004, 0.025), (0, 0.025)]) + corner
        model.add(scene.lathe(band, 20, capped=False), "Iron")
    handle = scene.tube(polar(1, np.linspace(0, np.pi, 13)) * (0.14, 0.12, 1), 0.006, 6)
    model.add(upright(handle), "Iron", (0, 0, 0.25))
    return model


def benches(scene: Scene[Cloister]) -> None:
    """Benches 1.6 m long along the walls of the walks, and three in the court."""
    seat = [scene.mesh("Bench", stones(BENCH, 0.006), "Wood", smooth=False)]
    scene.plan.on_sides(
        "Bench", seat, scene.plan.bay_axes[[1, -2]], scene.plan.back - 0.32, WALK_FLOOR
    )
    for number, x in ((plan.EAST, 2.9), (NORTH, -3.3), (plan.WEST, 2.7)):
        scene.plan.on_sides("Court bench", seat, x, scene.plan.arcade - 0.66, 0.015, sides=[number])


def lanterns(scene: Scene[Cloister]) -> None:
    """Lanterns of iron with a candle, hung under the vaults' bosses."""
    model = Model(scene)
    around = polar(0.11, np.arange(6) * np.pi / 3)
    roof = scene.lathe([(0.13, -0.82), (0.02, -0.7)], 6)
    plate = scene.lathe([(0.11, -1.14), (0.12, -1.12)], 6)
    bars = copies(scene.tube([(0, 0, -1.12), (0, 0, -0.82)], 0.008, 4), around)
    model.add(join([scene.tube([(0, 0, 0), (0, 0, -0.7)], 0.008, 5), roof, plate, bars]), "Iron")
    model.add(scene.lathe([(0.03, -1.12), (0.03, -0.97)], 8), "Daisy")
    boss = (scene.plan.walk_middle, plan.SPRINGING + plan.VAULT_RISE - 0.1)
    scene.plan.on_sides("Lantern", [model.mesh("Lantern")], scene.plan.bay_axes[::2], *boss)


def jars(scene: Scene[Cloister]) -> None:
    """Oil jars in the corners of the walks."""
    jar = Model(scene)
    jar.add(scene.lathe(JAR, 28, capped=False), "Pot")
    x, y, turn, size = points(
        [(0.4, -0.4, 50, 0.9), (0.95, -0.5, 180, 1.15), (1.5, -0.4, 280, 0.75)]
    ).T
    scene.plan.on_sides(
        "Jar", [jar.mesh("Jar")], x - scene.plan.back, y + scene.plan.back, WALK_FLOOR, turn, size
    )


def chair(scene: Scene[Cloister]) -> None:
    """A ladder-back chair on the lawn with a book on it."""
    model = Model(scene)
    book = (0.03, -0.03, 0.468)
    turn = (0, 0, 23)
    model.add(stones(CHAIR_BOARDS, 0.006), "Wood")
    for radius, *ends in points(CHAIR_STICKS):
        model.add(scene.tube(np.reshape(ends, (2, 3)), radius), "Wood")
    model.add(stones([(0, 0, 0.012, 0.16, 0.22, 0.024)], 0.002), "Robe", book, turn)
    model.add(stones([(0.004, 0, 0.012, 0.155, 0.21, 0.02)], 0.001), "Daisy", book, turn)
    place("Chair", model.mesh("Chair"), scene.plan.side(NORTH, (*scene.plan.chair, 0.0), -63))


def broom(scene: Scene[Cloister]) -> None:
    """A broom against a column."""
    random = scene.random("broom")
    model = Model(scene)
    model.add(scene.tube([(0, 0, 0.32), (0, 0.16, 0.9), (0, 0.32, 1.5)], 0.013, 6), "Wood")
    foot = random.normal((0, 0, 0.33), (0.02, 0.02, 0), (90, 3))
    down = random.normal((0, -0.25, -1), (0.22, 0.12, 0), (90, 3))
    model.add(copies(folded_leaf(0.03), foot, down, (0, 1, 0.2), 0.33), "Rope")
    place(
        "Broom",
        model.mesh("Broom"),
        scene.plan.side(plan.SOUTH, (-3.1, scene.plan.arcade - 0.62, 0.0), 11),
    )
