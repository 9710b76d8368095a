"""The monk, hooded, hands in his sleeves, on his way from the eastern walk to the well."""

import numpy as np

from scenes.library.architecture import stones
from scenes.library.plants import leaves_at
from scenes.library.points import Array, Points, directions, points, polar, xyz
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import Shape, icosphere, join, sheet, transform, tube
from scenes.lone_monk.plan import NORTH, Cloister

# From hem to neck: height, radius, and how deep the folds are, as a part of it.
ROBE = [
    (0.03, 0.31, 0.108),
    (0.1, 0.3, 0.102),
    (0.25, 0.275, 0.091),
    (0.45, 0.25, 0.075),
    (0.7, 0.22, 0.056),
    (0.9, 0.2, 0.04),
    (1.0, 0.185, 0.009),
    (1.03, 0.175, 0),
    (1.06, 0.19, 0.004),
    (1.15, 0.205, 0.018),
    (1.28, 0.205, 0.015),
    (1.38, 0.17, 0.003),
    (1.44, 0.1, 0),
    (1.47, 0.07, 0),
]
CAPE = [
    (1.21, 0.245, 0.048),
    (1.22, 0.25, 0.046),
    (1.3, 0.245, 0.03),
    (1.38, 0.22, 0.014),
    (1.44, 0.17, 0.002),
    (1.49, 0.12, 0),
    (1.53, 0.1, 0),
]
SLEEVE = [(0, 0.18, 1.37), (-0.05, 0.40, 0.98), (0.235, 0.03, 1.09)]  # shoulder, elbow, hand
CORD = [(0.165, 0, 1.03), (0.19, 0, 0.9), (0.215, 0.01, 0.7), (0.245, 0, 0.5)]
HEAD = transform((0.02, 0, 1.59), (0, 0.28, 0))  # bowed
# Beard and brows: middle, radii, hairs, their length, and where they point.
HAIR = [
    (0.06, 0, -0.065, 0.03, 0.05, 0.045, 500, 0.09, 0.35, 0, -1),
    (0.078, -0.03, 0.04, 0.006, 0.02, 0.005, 60, 0.025, 0.4, -0.6, 0),
    (0.078, 0.03, 0.04, 0.006, 0.02, 0.005, 60, 0.025, 0.4, 0.6, 0),
]


def monk(scene: Scene[Cloister]) -> None:
    """The monk, 1.8 m high, facing +X."""
    model = Model(scene)
    add_robe(scene, model, "Robe")
    t = np.linspace(0, 1, 9)[:, None]
    shoulder, elbow, hand = points(SLEEVE)
    arm = (1 - t) ** 2 * shoulder + 2 * t * (1 - t) * elbow + t**2 * hand
    for mirror in (-1, 1):
        model.add(scene.tube(arm * (1, mirror, 1), 0.065 + 0.035 * t[:, 0], 20), "Robe")
    model.add(scene.ring(1.0, 0.07, 20, 6), "Rope", (0, 0, 1.03), scale=(0.165, 0.21, 0.2))
    cord = join([scene.tube(CORD, 0.010, 6), icosphere(1, 0.022).moved(0.245, 0, 0.5)])
    for hangs in ((0, 0.05, -0.05), (0, 0.08, 0.05)):
        model.add(cord, "Rope", hangs)
    model.add(
        stones([(0.2, 0.11, 0.03, 0.24, 0.09, 0.06), (0.13, -0.11, 0.03, 0.24, 0.09, 0.06)], 0.025),
        "Wood",
    )
    model.add(hood(scene).transformed(HEAD), "Robe")
    model.add(face().transformed(HEAD), "Skin")
    random = scene.random("hair")
    for *at, count, length, x, y, z in points(HAIR):
        n = scene.count(count)
        root = directions(random, n) * at[3:] + at[:3]
        hair = leaves_at(random, root, random.normal((x, y, z), 0.25, (n, 3)), length, 0.12)
        model.add(hair.transformed(HEAD), "Daisy")
    x, y, turn = scene.plan.monk
    mesh = model.mesh("Monk", smooth=np.radians(50))
    place("Monk", mesh, scene.plan.side(NORTH, (x, y, 0.015), turn, 1.06))


def add_robe(scene: Scene, model: Model, material: str) -> None:
    """Add robe and cape, in folds."""
    around = np.linspace(0, 2 * np.pi, scene.segments(72, 12), endpoint=False)
    z = points(ROBE)[:, :1]
    swing = 9 * around + 1.3 * np.sin(2 * around)
    folds = np.sin(swing + 0.8 * z) + np.sin(14 * around + 2 * z) / 2
    model.add(garment(ROBE, around, folds, 0.88), material)
    model.add(garment(CAPE, around, np.sin(7 * around + 0.6), 0.82), material)


def garment(profile: Points, around: Array, folds: Array, depth: float) -> Shape:
    """Cloth round the body: its profile in rows of height, radius and folds; folds −1..1."""
    z, radius, fold = points(profile).T[:, :, None]
    return sheet(polar(radius * (1 + fold * folds), around, z) * (depth, 1.12, 1), closed=True)


def hood(scene: Scene) -> Shape:
    """A deep hood, open towards +X, that runs out into a point behind; with its rolled rim."""
    around = np.linspace(0, 2 * np.pi, scene.segments(28, 8) + 1)
    back = np.linspace(np.radians(50), np.pi, 12)[:, None]
    pointed = np.clip((back - 2.2) / (np.pi - 2.2), 0, 1) ** 2
    y = 0.14 * np.sin(back) * np.cos(around)
    z = 0.175 * np.sin(back) * np.sin(around)
    shell = xyz(0.19 * np.cos(back) - 0.09 * pointed, y, z - 0.06 * pointed)
    return join([sheet(shell[:, :-1], closed=True), scene.tube(shell[0], 0.014)])


def face() -> Shape:
    """The face, with hollows for the eyes, and a nose."""
    ball = icosphere(4)
    skin = ball.vertices * (0.085, 0.075, 0.115)
    for y in (-0.03, 0.03):
        from_eye = np.linalg.norm(skin - (0.078, y, 0.022), axis=1)
        skin[:, 0] -= 0.018 * np.exp(-((from_eye / 0.02) ** 2))
    nose = tube([(0.073, 0, 0.035), (0.10, 0, -0.005), (0.08, 0, -0.02)], [0.008, 0.014, 0.013])
    return join([ball.reshaped(skin), nose])
