"""Pears and grapes in the bowl, and lemons beside it."""

import numpy as np

from scenes.library.points import circle, directions, points, smooth_path, unit, xyz
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import Shape, copies, join, sheet, transform

PEAR = [
    (0.003, 0.003),
    (0.014, 0),
    (0.029, 0.01),
    (0.0365, 0.03),
    (0.034, 0.049),
    (0.024, 0.069),
    (0.0165, 0.085),
    (0.0125, 0.095),
    (0.006, 0.0985),
    (0.001, 0.097),
]
LEMON = [
    (0.0005, 0),
    (0.004, 0.0015),
    (0.0075, 0.006),
    (0.02, 0.0165),
    (0.0275, 0.034),
    (0.0245, 0.05),
    (0.012, 0.063),
    (0.006, 0.068),
    (0.004, 0.072),
    (0.0005, 0.0735),
]
# Places, and turns in degrees.
PEARS = [
    (0.022, -0.052, 0.028, -38, 12, 40),
    (0.052, 0.0, 0.032, 26, 14, -60),
    (0.085, -0.04, 0.03, 8, 38, 150),
]
GRAPE = 0.0098
# The bunch: a path from the bowl's middle over its rim to the board, and the width there.
BUNCH = [
    (0.03, -0.03, 0.075),
    (0.0, -0.06, 0.085),
    (-0.035, -0.085, 0.072),
    (-0.058, -0.1, 0.035),
    (-0.07, -0.112, 0.014),
]
WIDTHS = (0.022, 0.028, 0.026, 0.022, 0.010)
VINE_LEAVES = [(0.045, -0.02, 0.104, 0.5, -0.35, 2.3), (0.035, -0.028, 0.1, -0.35, 0.3, 4.4)]


def pears(scene: Scene) -> None:
    model = Model(scene)
    model.add(scene.lathe(smooth_path(PEAR, scene.segments(48, 12)), 56), "Pear")
    stalk = scene.bend([(0, 0, 0.094), (0.001, 0, 0.108), (0.005, 0.002, 0.12)], 0.0015, 10, 7)
    model.add(stalk, "Stalk")
    mesh = model.mesh("Pear", True)
    for number, row in enumerate(points(PEARS)):
        place(f"Pear {number}", mesh, transform(row[:3], np.radians(row[3:])))


def grapes(scene: Scene) -> None:
    """A bunch of grapes that hangs out of the bowl, on stalks, with two leaves."""
    random = scene.random("grapes")
    path = smooth_path(BUNCH, 60)
    widths = np.interp(np.linspace(0, 1, 61), np.linspace(0, 1, 5), WIDTHS)
    found: list[np.ndarray] = []
    for _ in range(2600):
        index = random.integers(61)
        at = path[index] + directions(random, 1)[0] * widths[index] * random.random() ** 0.4
        if at[2] > GRAPE and all(np.linalg.norm(at - other) > 1.78 * GRAPE for other in found):
            found.append(at)
    places = np.array(found)
    towards = directions(random, len(places))
    size = GRAPE * random.uniform(0.9, 1.06, len(places))
    up = unit(np.cross(towards, directions(random, len(places))))
    grape = scene.ball(1.0, 26).scaled(1, 1.1, 1)
    scene.add("Grapes", copies(grape, places, towards, up, size), "Grape")
    nearest = path[np.linalg.norm(places[:, None] - path, axis=-1).argmin(axis=1)]
    bows = np.stack([nearest, (nearest + places) / 2 + (0, 0, 0.002), places], axis=1)
    stem = np.concatenate([points([(0.055, -0.012, 0.118), (0.045, -0.02, 0.1)]), path])
    stalks = [*(scene.tube(bow, 0.0008, 5) for bow in bows), scene.tube(stem, 0.0015, 7)]
    scene.add("Stalks", join(stalks), "Stalk")
    for number, row in enumerate(points(VINE_LEAVES)):
        matrix = transform(row[:3], row[3:], 0.062)
        scene.add(f"Vine leaf {number}", _leaf(scene), "Leaf", matrix=matrix)


def _leaf(scene: Scene) -> Shape:
    """A vine leaf of length 1 along +Y: five lobes, bent along its veins."""
    angle = np.linspace(-np.pi, np.pi, scene.segments(120, 30))
    lobes = 0.62 + 0.26 * np.cos(5 * angle / 1.18) + 0.04 * np.cos(31 * angle)
    edge = lobes * (1 - 0.75 * np.exp(-((np.abs(angle) - np.pi) ** 2) / 0.03))
    s = np.linspace(0.02, 1, scene.segments(14, 5))[:, None]
    x = s * edge * np.sin(angle)
    y = s * edge * np.cos(angle)
    z = 0.05 * np.cos(5 * angle / 1.18) * s - 0.22 * s**2
    return sheet(xyz(x, y + 0.1, z)[:, ::-1])


def lemons(scene: Scene) -> None:
    """A whole lemon, and one cut in two."""
    profile = smooth_path(LEMON, scene.segments(56, 14))
    whole = scene.mesh("Lemon", scene.lathe(profile, 64), "Lemon")
    place("Lemon", whole, transform((0.19, -0.125, 0.0275), np.radians((90, 0, 50))))
    half = profile[profile[:, 1] < 0.036]
    radius, height = half[-1]
    rings = radius * np.linspace(1, 0.002, scene.segments(24, 6))
    cut = rings[:, None, None] * circle(1.0, scene.segments(72, 6))
    cut = sheet(xyz(cut[..., 0], cut[..., 1], height), closed=True).painted(1)
    shape = join([scene.lathe(half, 72, capped=False), cut]).moved(0, 0, -height)
    mesh = scene.mesh("Half lemon", shape, "Lemon", "Lemon flesh", smooth=np.radians(40))
    place("Half lemon 0", mesh, transform((0.105, -0.185, 0.0276), np.radians((-72, 0, 160))))
    turn = (np.radians(7), np.radians(-5), 2.0)
    place("Half lemon 1", mesh, transform((0.165, -0.06, 0.0345), turn))
