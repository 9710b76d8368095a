"""What people sit on: the barbers' chairs, the waiting bench, the stool at the desk."""

from collections.abc import Sequence

import numpy as np

from scenes.barbershop.plan import STATIONS, put, spot, spots
from scenes.library.model import Model
from scenes.library.points import rectangle, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, copies, join, prism, sheet

CHAIR = """Chrome: lathe 0.33 0, 0.33 0.02, 0.30 0.05, 0.14 0.075, 0.10 0.10, 0.085 0.2, 0.085 0.28
    Steel: lathe 0.06 0.24, 0.06 0.36, 0.15 0.38, 0.16 0.40
    Rubber: ring 0.33 0.012 at 0 0 0.014
    Cream: box 0.50 0.50 0.07 0.02 3 at 0 0.02 0.435
    Oxblood: box 0.52 0.52 0.10 0.035 3 at 0 0.03 0.515
    Chrome: bend 0.017, 0 0.24 0.42, 0 0.30 0.55, 0 0.27 0.71, 0 0 0.735, 0 -0.24 0.72
        0 -0.26 0.6, 0 -0.2 0.44 at ±0.31 0 0
    Cream: box 0.04 0.34 0.05 0.012 2 at ±0.31 0.02 0.44
    Oxblood: box 0.075 0.40 0.05 0.022 3 at ±0.31 0.02 0.765
    Chrome: bend 0.014, 0 0.22 0.40, 0 0.36 0.34, 0 0.45 0.18, 0 0.52 0.13 at ±0.215 0 0
    Oxblood: box 0.34 0.05 0.20 0.02 3 at 0 0.345 0.29 turned -38 0 0
    Iron: box 0.44 0.20 0.018 0.006 at 0 0.54 0.125 turned 18 0 0
    Chrome: box 0.40 0.012 0.01 0.003 at 0 0.46 0.112, 0 0.492 0.1224, 0 0.524 0.1328
        0 0.556 0.1432, 0 0.588 0.1536, 0 0.62 0.164 turned 18 0 0
    Chrome: bend 0.011, 0.12 0 0.30, 0.30 -0.04 0.30, 0.38 -0.05 0.36, 0.40 -0.05 0.47
    Ebony: ball 0.024 at 0.40 -0.05 0.48"""
CHAIR_BACK = """Cream: box 0.48 0.07 0.56 0.03 3 at 0 0 0.27
    Chrome: frame 0.36 0.42, -0.012 0, -0.012 0.006, 0 0.01, 0.012 0.006, 0.012 0
        at 0 -0.036 0.28 turned 90 0 0
    Brass: lathe 0.5 0, 0.5 0.004 at 0 -0.036 0.28 turned 90 0 0 scaled 0.2 0.13 1
    Black: word 0.045 0.0005 FINEST at 0 -0.0405 0.28 turned 90 0 0
    Brass: ball 0.012 at ±0.165 -0.036 0.085..0.475*2
    Chrome: tube 0.009, 0 0 0.5, 0 0.01 0.68 at ±0.09 0 0
    Oxblood: box 0.27 0.09 0.13 0.04 3 at 0 0.02 0.72"""
BENCH = """Oxblood: box 2 0.64 0.16 0.02 2 at 0 0.36 0.21
    Oxblood: box 0.95 0.54 0.10 0.04 3 at ±0.49 0.42 0.34
    Oxblood: box 1.9 0.12 0.52 0.05 3 at 0 0.12 0.56 turned 10 0 0
    Oxblood: tube 0.07, -0.98 0.06 0.82, 0.98 0.06 0.82
    Oxblood: lathe 0 0, 0.05 0.004, 0.085 0.01, 0.09 0.03, 0.09 0.63, 0.085 0.65, 0.05 0.655
        0 0.658 at ±1.02 0.06 0.55 turned -90 0 0
    Oxblood: box 0.15 0.64 0.40 0.03 2 at ±1.02 0.38 0.33
    Brass: ball 0.014 at ±1.02 0.72 0.55 scaled 1 0.5 1
    Ebony: lathe 0.025 0, 0.03 0.03, 0.045 0.07, 0.03 0.1, 0.04 0.14 at ±1.02 0.1..0.62*2 0"""
STOOL = """
Stool | room 1.45 -3.05
    Tan: lathe 0.16 0.66, 0.18 0.67, 0.185 0.70, 0.15 0.73, 0 0.735
    Chrome: tube 0.02, 0 0 0.2, 0 0 0.67
    Chrome: bend 0.012, -0.22 0 0, -0.11 0 0.2, 0 0 0.24, 0.11 0 0.2, 0.22 0 0
    Chrome: bend 0.012, 0 -0.22 0, 0 -0.11 0.2, 0 0 0.24, 0 0.11 0.2, 0 0.22 0
    Chrome: ring 0.13 0.008 at 0 0 0.28
"""


def cushion(scene: Scene, size: Sequence[float], tufts: Sequence[int]) -> Shape:
    """A padded panel, flat, its front at +Z, with buttons deep in diamond tufts.

    size: width, height, thickness. tufts: columns, rows.
    """
    (width, height, thickness), (columns, rows) = size, tufts
    u = np.linspace(-1, 1, scene.segments(12 * max(tufts), 8) + 1)
    v = u[:, None]
    edge = np.sqrt((1 - u**8) * (1 - v**8))
    a, b = u * columns, v * rows
    puff = np.abs(np.sin(np.pi * (a + b) / 2) * np.sin(np.pi * (a - b) / 2)) ** 0.4
    front = sheet(xyz(u * width / 2, v * height / 2, thickness * edge * (0.6 + 0.4 * puff)))
    back = prism(rectangle(width, height), 1e-4).moved(0, 0, -1e-4)
    a, b = np.meshgrid(np.arange(1 - columns, columns), np.arange(1 - rows, rows))
    places = xyz(a * width / 2 / columns, b * height / 2 / rows, 0.6 * thickness)
    ball = scene.ball(0.009, 8)
    button = ball.reshaped(ball.vertices * (1, 1, 0.6))
    return join([front, back, copies(button, places[(a + b) % 2 == 0])])


def barber_chairs(scene: Scene) -> None:
    """Three hydraulic chairs of chrome, enamel and buttoned leather, turned to their mirrors."""
    seat, back = Model(scene, CHAIR), Model(scene, CHAIR_BACK)
    seat.add(cushion(scene, (0.50, 0.50, 0.05), (4, 4)), "Oxblood", (0, 0.03, 0.56))
    padding = cushion(scene, (0.46, 0.54, 0.07), (4, 4))
    back.add(padding, "Oxblood", (0, 0.03, 0.28), (90, 0, 180))
    seat_mesh, back_mesh = seat.mesh("Barber chair"), back.mesh("Barber chair back")
    for y, turn in zip(STATIONS, (128, 104, 66), strict=True):
        where = spot(f"room -1.38 {y} 0.009 {turn}")
        put(seat_mesh, where)
        put(back_mesh, where, (0, -0.25, 0.58), (14, 0, 0))


def chair_mats(scene: Scene) -> None:
    """A ribbed rubber mat below each chair."""
    mat = Model(scene, "Rubber: lathe 0.60 0.001, 0.60 0.007, 0.575 0.012, 0.56 0.009, 0 0.009")
    for k in range(7):
        mat.add(scene.ring(0.14 + 0.06 * k, 0.003, 48, 6), "Rubber", (0, 0, 0.009))
    data = mat.mesh("Chair mat")
    for where in spots("room -1.4 -2..2*3"):
        put(data, where)


def waiting_bench(scene: Scene) -> None:
    """A buttoned leather bench with rolled arms and turned feet."""
    model = Model(scene, BENCH)
    seat = cushion(scene, (0.92, 0.50, 0.05), (6, 3))
    model.add(seat, "Oxblood", "±0.49 0.42 0.385")
    back = cushion(scene, (1.86, 0.42, 0.09), (12, 3))
    model.add(back, "Oxblood", (0, 0.175, 0.60), (80, 0, 180))
    nails = f"±0.055 0.703 0.16..0.48*{scene.segments(12)}"
    for x in (-1.02, 1.02):
        model.add(scene.ball(0.006, 6).moved(x, 0, 0), "Brass", nails)
    put(model.mesh("Waiting bench"), spot("right 0.15"))
