"""What is fixed to the walls, the clock, the pole, the radiator, and what stands in corners."""

import numpy as np

from scenes.barbershop.plan import TAU, put
from scenes.library.points import points, polar
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, box, lettering, sheet, tube

FITTINGS = """
Radiator section | front -1.301..-0.199*20 0.14 0.03
    Cream: bend 0.022, 0 0 0.09, 0 0 0.2, 0 0 0.5, 0 0 0.62 at 0 ±0.05 0;
        box 0.05 0.16 0.05 0.02 3 at 0 0 0.09, 0 0 0.36, 0 0 0.63
Radiator pipes | front -0.75 0.14
    Brass: bend 0.012, 0.58 0 0.12, 0.66 0 0.12, 0.68 0 0.09, 0.68 0 0;
        bend 0.012, -0.58 0 0.12, -0.66 0 0.12, -0.68 0 0.09, -0.68 0 0
    Cream: box 0.05 0.10 0.09 0.01 at ±0.52 0 0.045
    Brass: lathe 0.012 0, 0.03 0.008, 0.032 0.03, 0.022 0.045, 0 0.048 at 0.67 0 0.135
Switch | on front 2.12 0 1.22, on back -0.92 0 1.25, on left ±1.45 0.01 1.03, on left 0.55 0.01 1.03
    Brass: box 0.08 0.12 0.008 0.003 at 0 0 0.004;
        lathe 0.009 0, 0.006 0.006, 0.004 0.022, 0 0.024 at ±0.018 0 0.007 turned 20 0 0
Vent | on right 2.9 0 2.46, on left ±3.52 0 2.46
    Gilt: frame 0.36 0.16, 0 0, 0 0.012, 0.02 0.012, 0.025 0
    Black: box 0.36 0.16 0.002 at 0 0 0.001
    Gilt: box 0.36 0.014 0.003 at 0 -0.065..0.065*7 0.007 turned 35 0 0
Dustpan | room -1.98 -3.05 0.002 100
    Red: box 0.26 0.22 0.006 at 0 0 0.004 turned -3 0 0; box 0.005 0.22 0.05 at ±0.13 0 0.027;
        box 0.26 0.005 0.07 at 0 -0.11 0.04; Black: tube 0.012, 0 -0.11 0.05, 0 -0.26 0.07
"""
CLOCK = """Mahogany: lathe 0.22 0, 0.22 0.03, 0.205 0.05, 0.185 0.045, 0.18 0.02, 0 0.02
    White: lathe 0.181 0, 0.181 0.022, 0 0.022; Brass: ring 0.183 0.006 at 0 0 0.044
    Black: prism 0.0012, -0.006 -0.02, 0.006 -0.02, 0.006 0.068, 0 0.085, -0.006 0.068
        at 0 0 0.026 turned 0 0 55;
        prism 0.0012, -0.004 -0.02, 0.004 -0.02, 0.004 0.104, 0 0.13
        -0.004 0.104 at 0 0 0.028 turned 0 0 -60
    Red: prism 0.0012, -0.0015 -0.02, 0.0015 -0.02, 0.0015 0.112, 0 0.14, -0.0015 0.112
        at 0 0 0.030 turned 0 0 160
    Brass: lathe 0.01 0.022, 0.01 0.034, 0 0.036"""
NUMERALS = ("XII", "I", "II", "III", "IIII", "V", "VI", "VII", "VIII", "IX", "X", "XI")
POLE_CAP = """lathe 0 -0.10, 0.03 -0.095, 0.045 -0.06, 0.09 -0.045, 0.095 -0.01, 0.085 0
        0.085 0.012, 0 0.012"""
POLE = f"""Chrome: {POLE_CAP}; {POLE_CAP} at 0 0 0.62 turned 180 0 0
    Opal globe: ball 0.10 at 0 0 0.78; Pane: pipe 0.083 0, 0.083 0.62
    Chrome: tube 0.016, 0 0.06 0, 0 0.15 0 at 0 0 -0.03..0.65*2;
        box 0.09 0.015 0.12 0.006 at 0 0.15 -0.03..0.65*2"""
BROOM = """Oak: tube 0.012, 0 0 0.10, 0 0 1.35; box 0.30 0.05 0.04 0.01 at 0 0 0.10"""
BIN = """Steel: lathe 0.13 0, 0.14 0.01, 0.16 0.38, 0.166 0.385, 0.158 0.385, 0.13 0.02, 0 0.015;
        ring 0.148 0.005 at 0 0 0.10; ring 0.157 0.005 at 0 0 0.28"""


def clock(scene: Scene) -> None:
    """A railway clock beside the staff door, at ten past ten."""
    model = Model(scene, CLOCK)
    for k in range(60):
        size = (0.0025, 0.010, 0.001) if k % 5 else (0.006, 0.022, 0.001)
        at = polar(0.166, np.radians(90 - 6 * k), 0.0226)
        model.add(box(size), "Black", at, (0, 0, -6 * k))
    for k, numeral in enumerate(NUMERALS):
        at = polar(0.132, np.radians(90 - 30 * k), 0.0226)
        model.add(lettering(numeral, 0.0005), "Black", at, scale=(0.034, 0.042, 1))
    put(model.mesh("Clock"), "on back -0.88 0.001 2.5")


def barber_pole(scene: Scene) -> None:
    """The turning pole, its helix real geometry, between the window and the door."""
    model, sides = Model(scene, POLE), scene.segments(48, 16) // 8 * 8
    t = np.linspace(0, 1, scene.segments(64, 8))[:, None]
    angle = np.arange(sides) * TAU / sides + 1.25 * TAU * t
    column = sheet(polar(0.07, angle, 0.62 * t), closed=True)
    stripe = np.arange(len(column.quads)) % sides * 8 // sides % 4
    for kind, material in enumerate(("Red", "White", "Blue", "White")):
        model.add(Shape(column.vertices, column.quads[stripe == kind]), material)
    put(model.mesh("Barber pole"), "front 0.78 0.158 1.38 180")


def broom_and_bins(scene: Scene) -> None:
    """A broom leaning in the corner by the counter, and two bins of paper."""
    broom, waste, random = Model(scene, BROOM), Model(scene, BIN), scene.random("waste")
    for x, y in points(f"-0.14..0.14*{scene.count(34, 6)} -0.018..0.018*3"):
        broom.add(tube([(x, y, 0.085), (x * 1.1, y * 1.4, 0)], 0.0035, 5), "Bristle")
    put(broom.mesh("Broom"), "room -2.02 -3.5 0.004", degrees=(7, -4, 35))
    for k in range(scene.count(14, 3)):
        at = (*random.uniform(-0.08, 0.08, 2), 0.33 + 0.02 * (k % 3))
        crumpled = box((0.07, 0.05, 0.04), 0.015)
        waste.add(crumpled, ("Paper", "White")[k % 2], at, random.uniform(0, 360, 3))
    put(waste.mesh("Waste bin"), "room -2.28 -3.45, room 0.72 -2.55 0 70")
