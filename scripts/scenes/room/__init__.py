"""The small scene of the smoke build: a closed room of plain shapes, rendered in no time."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from scenes.library.lights import area_light
from scenes.library.materials import MaterialGraph, plains
from scenes.library.scene import Scene
from scenes.library.shapes import box, transform

# Inner size of the room in metres; its floor is at z = 0 and it is centred on x = y = 0.
SIZE = (6.0, 6.0, 3.0)
PAINTS = [
    ("sphere", (0.7, 0.15, 0.1), 0.6),
    ("torus", (0.1, 0.5, 0.2), 0.6),
    ("pillar", (0.75, 0.7, 0.6), 0.6),
    ("cone", (0.1, 0.2, 0.7), 0.6),
    ("box", (0.8, 0.6, 0.1), 0.6),
]


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene; the room has nothing random, so the parameters change nothing."""
    scene = Scene(0, 1.0)
    walls = box(SIZE)
    plains(PAINTS)
    graph = MaterialGraph("walls")  # checks 0.5 m wide
    tints = {"Color1": (0.75, 0.72, 0.68), "Color2": (0.35, 0.42, 0.5)}
    checks = {"Vector": graph.geometry("Position"), "Scale": 2.0} | tints
    graph.finish(graph.principled(Base_Color=graph.add("TexChecker", checks), Roughness=0.6))
    inwards = walls._replace(quads=walls.quads[:, ::-1])
    scene.add("room", inwards, "walls", matrix=transform((0, 0, SIZE[2] / 2)), smooth=False)
    for name, shape, location, rotation in (
        ("sphere", scene.ball(0.5, 32), (2, 1, 0.5), (0, 0, 0)),
        ("torus", scene.ring(0.5, 0.15, 48, 12), (-1.8, 1.8, 1.2), (np.radians(70), 0, 0.3)),
        ("pillar", scene.lathe([(0.2, 0), (0.2, 3)], 32), (-2, -2, 0), (0, 0, 0)),
        ("cone", scene.lathe([(0.5, 0), (0, 1)], 32), (1, -2, 0), (0, 0, 0)),
        ("box", box((0.7, 0.7, 0.7)), (2.2, -1.2, 0.35), (0, 0, 1)),
    ):
        scene.add(name, shape, name, matrix=transform(location, rotation), smooth=False)
    area_light("lamp", transform((0, 0, SIZE[2] - 0.05)), (2, 2), 300, (1.0, 1.0, 1.0))
