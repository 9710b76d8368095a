"""What may stand in the middle of the court, on its round plaza."""

import numpy as np

from scenes.library.architecture import ring_of_stones, stones
from scenes.library.points import points, polar
from scenes.library.scene import Model, Scene, place
from scenes.lone_monk.furniture import well
from scenes.lone_monk.monk import HEAD, add_robe, face, hood
from scenes.lone_monk.plan import NORTH, Cloister
from scenes.lone_monk.plants import cypress

# Rings of stones: how many, the radius of their middle, width, middle height, height.
BASIN = [(24, 1.38, 0.5, 0.07, 0.14), (20, 1.24, 0.22, 0.31, 0.34), (20, 1.24, 0.3, 0.52, 0.08)]
TREE_SEAT = [(18, 0.85, 0.26, 0.2, 0.4), (18, 0.85, 0.36, 0.44, 0.08)]
# Bowls of the fountain and its shaft: radius and height.
SHAFT = [(0.22, 0.0), (0.2, 0.3), (0.1, 0.4), (0.09, 1.1), (0.07, 1.2), (0.06, 1.75)]
BOWL = [(0.08, 0), (0.4, 0.08), (0.58, 0.2), (0.62, 0.22), (0.56, 0.2), (0.3, 0.12), (0, 0.12)]
# Steps, shaft and arms of the cross: middle x, y, z and width, depth, height.
CROSS = [
    (0, 0, 0.1, 2.1, 2.1, 0.2),
    (0, 0, 0.3, 1.6, 1.6, 0.2),
    (0, 0, 0.5, 1.1, 1.1, 0.2),
    (0, 0, 0.8, 0.5, 0.5, 0.4),
    (0, 0, 2.3, 0.2, 0.2, 2.6),
    (0, 0, 3.1, 1.1, 0.2, 0.2),
]
PEDESTAL = [
    (0, 0, 0.1, 1.6, 1.6, 0.2),
    (0, 0, 0.28, 1.1, 1.1, 0.16),
    (0, 0, 0.75, 0.75, 0.75, 0.8),
    (0, 0, 1.19, 0.9, 0.9, 0.1),
]


def middle(scene: Scene[Cloister]) -> None:
    """A well in the original."""
    MIDDLES[scene.plan.middle](scene)


def fountain(scene: Scene[Cloister]) -> None:
    """A basin of stones round a shaft with two bowls, all full of water."""
    model = Model(scene)
    for count, radius, width, z, height in points(BASIN):
        model.add(ring_of_stones(int(count), radius, width, z, height), "Limestone")
    model.lathe(profile=[(1.14, 0.42), (1.13, 0.43)], material="Water")
    model.lathe(profile=SHAFT, material="Carved stone")
    for z, size in ((0.95, 1.0), (1.5, 0.55)):
        model.lathe(profile=BOWL, at=(0, 0, z), scaled=size, material="Carved stone")
        surface = [(0.5, 0.19), (0.49, 0.195)]
        model.lathe(profile=surface, at=(0, 0, z), scaled=size, material="Water")
    for x, y, _ in polar(1, np.arange(6) * np.pi / 3):
        jet = [(0.32 * x, 0.32 * y, 1.6), (0.42 * x, 0.42 * y, 1.55), (0.48 * x, 0.48 * y, 1.14)]
        model.bend(radius=0.008, path=jet, material="Water")
    place("Fountain", model.mesh("Fountain"), scene.plan.side(NORTH))


def cross(scene: Scene[Cloister]) -> None:
    """A high cross of stone on steps."""
    model = Model(scene)
    model.add(stones(CROSS, 0.02), "Limestone")
    model.add(scene.ring(0.36, 0.05), "Carved stone", (0, 0, 3.1), (90, 0, 0))
    place("Cross", model.mesh("Cross"), scene.plan.side(NORTH))


def statue(scene: Scene[Cloister]) -> None:
    """A hooded saint of stone on a pedestal."""
    model = Model(scene)
    model.add(stones(PEDESTAL, 0.02), "Limestone")
    figure = Model(scene)
    add_robe(scene, figure, "Carved stone")
    figure.add(hood(scene).transformed(HEAD), "Carved stone")
    figure.add(face().transformed(HEAD), "Carved stone")
    staff = [(0.3, -0.25, 0.0), (0.3, -0.25, 1.9)]
    figure.tube(radius=0.025, path=staff, material="Bronze")
    place("Pedestal", model.mesh("Pedestal"), scene.plan.side(NORTH))
    place("Statue", figure.mesh("Statue"), scene.plan.side(NORTH, (0, 0, 1.24), -90, 1.1))


def tree(scene: Scene[Cloister]) -> None:
    """A cypress in a round seat of stones."""
    model = Model(scene)
    for count, radius, width, z, height in points(TREE_SEAT):
        model.add(ring_of_stones(int(count), radius, width, z, height), "Limestone")
    model.lathe(profile=[(0.74, 0.36), (0.2, 0.4)], material="Soil")
    place("Tree seat", model.mesh("Tree seat"), scene.plan.side(NORTH))
    place("Cypress", cypress(scene), scene.plan.side(NORTH, (0, 0, 0.3), 0, 0.9))


MIDDLES = {"well": well, "fountain": fountain, "cross": cross, "statue": statue, "tree": tree}
