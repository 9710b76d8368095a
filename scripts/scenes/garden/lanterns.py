"""Lanterns of stone and of paper, a light in each."""

import numpy as np

from scenes.garden.plan import CANDLE_COLOR, TAU, GardenPlan
from scenes.library.lights import point_light
from scenes.library.points import circle, points, polar, rectangle, xyz
from scenes.library.scene import Scene, place
from scenes.library.shapes import Shape, box, join, lathe, prism, sheet, transform, tube


def stone_lanterns(scene: Scene[GardenPlan]) -> None:
    """Kasuga lanterns, 1.75 m high: base, shaft, fire box with paper panes, curved roof, knob."""
    shaft = [(0.12, 0.26), (0.115, 0.5), (0.14, 0.53), (0.14, 0.57), (0.115, 0.6), (0.12, 0.86)]
    stack = [
        prism(circle(0.36, 6), 0.12),
        lathe([(0.27, 0.12), (0.27, 0.17), (0.18, 0.24), (0.14, 0.27)], 6),
        scene.lathe(shaft, 32),
        lathe([(0.13, 0.85), (0.19, 0.9), (0.31, 0.97), (0.31, 1.04), (0.27, 1.05)], 6),
        *(box((0.05, 0.05, 0.34), 0.008, 1).moved(x, y, 1.21) for x, y in circle(0.215, 6)),
        prism(circle(0.25, 6), 0.04).moved(0, 0, 1.36),
        scene.lathe(
            [(0.09, 1.63), (0.12, 1.66), (0.05, 1.69), (0.085, 1.75), (0.075, 1.8), (0, 1.88)], 24
        ),
    ]
    u = np.linspace(0, 1, scene.segments(14, 4))[:, None]
    angle = np.arange(6 * 8) * TAU / 48
    side = np.cos(TAU / 12) / np.cos((angle % (TAU / 6)) - TAU / 12)
    upturned = np.clip((side - 0.866) / 0.134, 0, 1) ** 3 * (1 - u) ** 2
    roof = polar((0.45 - 0.36 * u**0.72) * side, angle, 1.42 + 0.22 * u**1.3 + 0.09 * upturned)
    under = roof[:1] * (0.45, 0.45, 1) - (0, 0, 0.03)
    lip = roof[:1] - (0, 0, 0.045)
    stack.append(sheet(np.concatenate([under, lip, roof]), closed=True))
    stone = scene.mesh("Lantern stone", join(stack), "Lantern granite", smooth=0.6)
    corners = circle(0.205, 6)
    panes = scene.mesh("Lantern panes", paper_wall(corners, 1.05, 1.37), "Pane paper", smooth=False)
    for i, (x, y, size) in enumerate(scene.plan.stone_lanterns):
        z = float(scene.plan.ground_height(x, y)) - 0.03
        spot = transform((x, y, z), (0, 0, 0.4 * i), size)
        place(f"Lantern stone.{i}", stone, spot)
        place(f"Lantern panes.{i}", panes, spot)
        point_light(f"Lantern light.{i}", (x, y, z + 1.2 * size), 14.0, CANDLE_COLOR, 0.06)


def paper_wall(outline: np.ndarray, low: float, high: float) -> Shape:
    """Paper round an outline (n, 2), open above and below."""
    return sheet(xyz(*outline.T, [[low], [high]]), closed=True)


def paper_globes(scene: Scene[GardenPlan]) -> None:
    """A string of paper globes, 0.4 m across on hoops of bamboo, over the path."""
    t = np.linspace(0.12, np.pi - 0.12, scene.segments(90, 12))
    hoops = 0.20 * np.sin(t) ** 0.8 * (1 - 0.03 * np.abs(np.sin(t * 9)))
    globe = scene.lathe(np.column_stack([hoops, -0.19 * np.cos(t)]), 40, capped=False)
    globes = [scene.mesh("Globe", globe, f"{tint} globe paper") for tint in ("Cream", "Red")]
    ends = points(scene.plan.globe_rope)
    t = np.linspace(0, 1, 25)[:, None]
    rope = ends[0] + t * (ends[1] - ends[0]) - (0, 0, 1.4) * t * (1 - t)
    scene.add("Lantern rope", tube(rope, 0.006, 5), "Rope")
    for i, (x, y, z) in enumerate(ends):
        pole = scene.tube(xyz(x, y, [-0.1, 1.0, z + 0.08]), 0.03, 12)
        scene.add(f"Lantern pole.{i}", pole, "Dark wood")
    for i, (x, y, z) in enumerate(rope[4:20:5] - (0, 0, 0.26)):
        place(f"Globe.{i}", globes[i % 2], transform((x, y, z), (0, 0, i)))
        point_light(f"Globe light.{i}", (x, y, z), 9.0, CANDLE_COLOR, 0.05)


def floor_lanterns(scene: Scene[GardenPlan]) -> None:
    """Framed paper lanterns beside the path."""
    width, height = 0.13, 0.52
    corners = rectangle(2 * width, 2 * width)
    post = box((0.022, 0.022, height), 0.004, 1)
    bars = [post.moved(x, y, height / 2) for x, y in corners]
    for z in (0.09, 0.3, height - 0.02):
        bars += [box((2 * width, 0.016, 0.016)).moved(0, y, z) for y in (-width, width)]
        bars += [box((0.016, 2 * width, 0.016)).moved(x, 0, z) for x in (-width, width)]
    frame = scene.mesh("Floor lantern frame", join(bars), "Dark wood", smooth=False)
    paper = paper_wall(rectangle(0.248, 0.248), 0.09, height - 0.02)
    panes = scene.mesh("Floor lantern paper", paper, "Floor lantern paper", smooth=False)
    for i, (x, y) in enumerate(scene.plan.floor_lanterns):
        spot = transform((x, y, 0.0), (0, 0, 0.2 + i))
        place(f"Floor lantern frame.{i}", frame, spot)
        place(f"Floor lantern paper.{i}", panes, spot)
        point_light(f"Floor lantern light.{i}", (x, y, 0.24), 5.0, CANDLE_COLOR, 0.04)
