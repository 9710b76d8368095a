"""The torii, a vermilion gate over the path."""

import numpy as np

from scenes.garden.plan import TORII, ground_height
from scenes.library.objects import transform
from scenes.library.points import points, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, box, join, sheet


def torii(scene: Scene) -> None:
    """Two leaning posts with black feet, a tie beam, and two lintels that rise at their ends."""
    red = [lintel(scene, 1.95, (3.17, 3.36), 0.12, 0.14)]
    red.append(box((3.4, 0.12, 0.2), 0.01).moved(0, 0, 2.6))
    red.append(box((0.22, 0.1, 0.4), 0.01).moved(0, 0, 2.9))
    black = [lintel(scene, 2.2, (3.36, 3.46), 0.17, 0.2)]
    for side in (-1, 1):
        foot, head = np.array([side * 1.5, 0, -0.2]), np.array([side * 1.36, 0, 3.2])
        red.append(scene.tube(np.linspace(foot, head, 9), np.linspace(0.15, 0.125, 9), 32))
        black.append(scene.tube(np.linspace(foot, foot + 0.16 * (head - foot), 3), 0.18, 32))
    spot = transform((*TORII, float(ground_height(*TORII))))
    shape = join([*red, join(black).painted(1)])
    scene.add("Torii", shape, "Vermilion", "Black lacquer", matrix=spot, smooth=0.6)


def lintel(
    scene: Scene, half: float, heights: tuple[float, float], depth: float, rise: float
) -> Shape:
    """A beam along x that is wider above than below and curves upwards to its ends."""
    x = np.linspace(1, -1, scene.segments(24, 6))[:, None]
    y, top = points("-1 0, 1 0, 1 1, -1 1").T  # around its section
    z = rise * np.abs(x) ** 2.4 + np.where(top == 1, heights[1], heights[0])
    rows = xyz(half * x * (1 + 0.03 * top), depth * y * (1 + 0.15 * top), z)
    return sheet(rows, closed=True, capped=True)
