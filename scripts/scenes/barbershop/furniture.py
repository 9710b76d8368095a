"""Seats, the reception desk and the low table with their things, and cabinets full of goods."""

from collections.abc import Sequence

import numpy as np

from scenes.barbershop.cloth import folded_towel
from scenes.barbershop.goods import Goods, scattered, shelf, stock
from scenes.barbershop.plan import INKS, STATIONS, put, spots
from scenes.barbershop.prints import magazine
from scenes.barbershop.stations import PANEL
from scenes.library.points import rectangle, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, box, copies, join, prism, sheet, transform

CHAIR = """Chrome: lathe 0.33 0, 0.33 0.02, 0.30 0.05, 0.14 0.075, 0.10 0.10, 0.085 0.2, 0.085 0.28
    Steel: lathe 0.06 0.24, 0.06 0.36, 0.15 0.38, 0.16 0.40; Rubber: ring 0.33 0.012 at 0 0 0.014
    Cream: box 0.50 0.50 0.07 0.02 3 at 0 0.02 0.435
    Oxblood: box 0.52 0.52 0.10 0.035 3 at 0 0.03 0.515
    Chrome: bend 0.017, 0 0.24 0.42, 0 0.30 0.55, 0 0.27 0.71, 0 0 0.735, 0 -0.24 0.72, 0 -0.26 0.6
        0 -0.2 0.44 at ±0.31 0 0
    Cream: box 0.04 0.34 0.05 0.012 2 at ±0.31 0.02 0.44
    Oxblood: box 0.075 0.40 0.05 0.022 3 at ±0.31 0.02 0.765
    Chrome: bend 0.014, 0 0.22 0.40, 0 0.36 0.34, 0 0.45 0.18, 0 0.52 0.13 at ±0.215 0 0
    Oxblood: box 0.34 0.05 0.20 0.02 3 at 0 0.345 0.29 turned -38 0 0
    Iron: box 0.44 0.20 0.018 0.006 at 0 0.54 0.125 turned 18 0 0
    Chrome: box 0.40 0.012 0.01 0.003 at 0 0.46 0.112, 0 0.492 0.1224, 0 0.524 0.1328
        0 0.556 0.1432, 0 0.588 0.1536, 0 0.62 0.164 turned 18 0 0;
        bend 0.011, 0.12 0 0.30, 0.30 -0.04 0.30, 0.38 -0.05 0.36, 0.40 -0.05 0.47
    Ebony: ball 0.024 at 0.40 -0.05 0.48"""
CHAIR_BACK = """Cream: box 0.48 0.07 0.56 0.03 3 at 0 0 0.27
    Chrome: frame 0.36 0.42, -0.012 0, -0.012 0.006, 0 0.01, 0.012 0.006, 0.012 0
        at 0 -0.036 0.28 turned 90 0 0
    Brass: lathe 0.5 0, 0.5 0.004 at 0 -0.036 0.28 turned 90 0 0 scaled 0.2 0.13 1
    Black: word 0.045 0.0005 FINEST at 0 -0.0405 0.28 turned 90 0 0
    Brass: ball 0.012 at ±0.165 -0.036 0.085..0.475*2
    Chrome: tube 0.009, 0 0 0.5, 0 0.01 0.68 at ±0.09 0 0
    Oxblood: box 0.27 0.09 0.13 0.04 3 at 0 0.02 0.72"""
BENCH = """Oxblood: box 2 0.64 0.16 0.02 2 at 0 0.36 0.21;
        box 0.95 0.54 0.10 0.04 3 at ±0.49 0.42 0.34;
        box 1.9 0.12 0.52 0.05 3 at 0 0.12 0.56 turned 10 0 0;
        tube 0.07, -0.98 0.06 0.82, 0.98 0.06 0.82;
        lathe 0 0, 0.05 0.004, 0.085 0.01, 0.09 0.03, 0.09 0.63, 0.085 0.65, 0.05 0.655
        0 0.658 at ±1.02 0.06 0.55 turned -90 0 0; box 0.15 0.64 0.40 0.03 2 at ±1.02 0.38 0.33
    Brass: ball 0.014 at ±1.02 0.72 0.55 scaled 1 0.5 1
    Ebony: lathe 0.025 0, 0.03 0.03, 0.045 0.07, 0.03 0.1, 0.04 0.14 at ±1.02 0.1..0.62*2 0"""
STOOL = """
Stool | room 1.45 -3.05
    Tan: lathe 0.16 0.66, 0.18 0.67, 0.185 0.70, 0.15 0.73, 0 0.735
    Chrome: tube 0.02, 0 0 0.2, 0 0 0.67;
        bend 0.012, -0.22 0 0, -0.11 0 0.2, 0 0 0.24, 0.11 0 0.2, 0.22 0 0;
        bend 0.012, 0 -0.22 0, 0 -0.11 0.2, 0 0 0.24, 0 0.11 0.2, 0 0.22 0;
        ring 0.13 0.008 at 0 0 0.28
"""
DESK_PANEL = "frame 0.34 0.56, -0.06 0.006, -0.04 0.022, 0 0.024, 0.02 0.008, 0.025 0"
FURNITURE = f"""
Reception desk | room 1.68 -2.45
    Mahogany: box 1.5 0.5 0.88 at 0 0 0.52; Ebony: box 1.42 0.42 0.08 at 0 0 0.04
    Marble: box 1.58 0.58 0.04 0.012 3 at 0 0 0.98
    Mahogany: {DESK_PANEL} at -0.49..0.49*3 0.25 0.5 turned 90 0 180;
        {DESK_PANEL} at -0.75 0 0.5 turned 90 0 -90
    Brass: ring 0.09 0.008 at -0.49..0.49*3 0.256 0.5 turned 90 0 0;
        word 0.13 0.01 B at -0.49..0.49*3 0.258 0.5 turned 90 0 180
    Mahogany: lathe 0.03 0.1, 0.035 0.14, 0.022 0.18, 0.026 0.5, 0.022 0.82, 0.035 0.86
        0.03 0.9 at -0.735..0.735*4 0.25 0
    Brass: tube 0.017, -0.7 0.34 0.16, 0.7 0.34 0.16;
        tube 0.009, 0 0.25 0.12, 0 0.34 0.16 at -0.65..0.65*3 0 0
Till | room 2.1 -2.47 1
    Mahogany: box 0.42 0.40 0.12 0.008 2 at 0 0 0.06
    Brass: box 0.36 0.006 0.08 0.002 at 0 0.203 0.06;
        lathe 0.008 0, 0.016 0.014, 0 0.022 at 0 0.205 0.06 turned -90 0 0
    Gilt: prism 0.38, -0.18 0, 0.19 0, 0.19 0.05, 0.06 0.16, -0.02 0.28, -0.14 0.30
        -0.18 0.26 at -0.19 0 0.12 turned 90 0 90
    Porcelain: lathe 0.004 0, 0.004 0.02, 0.012 0.021, 0.012 0.027, 0 0.028
        at -0.14..0.1*7 0.17 0.186, -0.14..0.1*7 0.14 0.2114, -0.14..0.1*7 0.11 0.2368
        -0.14..0.1*7 0.08 0.2622 turned -40 0 0
    Red: lathe 0.004 0, 0.004 0.02, 0.012 0.021, 0.012 0.027, 0 0.028 at 0.14 0.17 0.186
        0.14 0.14 0.2114, 0.14 0.11 0.2368, 0.14 0.08 0.2622 turned -40 0 0
    Gilt: box 0.32 0.10 0.12 0.012 2 at 0 -0.09 0.46; Black: box 0.28 0.11 0.07 at 0 -0.09 0.465
    White: box 0.05 0.004 0.055 at -0.09..0.09*4 -0.033 0.465
    Black: word 0.05 0.0005 5 at -0.09 -0.0305 0.465 turned 90 0 180;
        word 0.05 0.0005 2 at -0.03 -0.0305 0.465 turned 90 0 180;
        word 0.05 0.0005 . at 0.03 -0.0305 0.465 turned 90 0 180;
        word 0.05 0.0005 1 at 0.09 -0.0305 0.465 turned 90 0 180
    Chrome: bend 0.006, -0.19 0 0.25, -0.225 0 0.25, -0.225 0.05 0.30, -0.225 0.10 0.33
    Ebony: ball 0.016 at -0.24 0.10 0.33 scaled 1.6 1 1
    Brass: ring 0.05 0.006 at ±0.19 -0.05 0.27 turned 0 90 0
Desk bell | room 1.58 -2.33 1
    Ebony: lathe 0.042 0, 0.042 0.008, 0.03 0.012
    Brass: lathe 0.04 0.014, 0.038 0.03, 0.025 0.043, 0.006 0.048, 0.004 0.056, 0 0.058
Telephone | room 1.7 -2.55 1 160
    Black: prism 0.18, -0.1 0, 0.1 0, 0.1 0.03, 0.03 0.1, -0.06 0.11, -0.1 0.05
        at -0.09 0 0 turned 90 0 90
    Steel: lathe 0.055 0, 0.052 0.01, 0.02 0.014, 0 0.014 at 0 0.066 0.066 turned -45 0 0
    White: ball 0.008 at ±0.037 0.0724 0.0724, ±0.0185 0.095 0.0497, ±0.0185 0.05 0.095
    Black: bend 0.014, -0.12 -0.03 0.14, -0.08 -0.03 0.155, 0.08 -0.03 0.155, 0.12 -0.03 0.14;
        lathe 0.03 0, 0.032 0.02, 0.015 0.04 at ±0.115 -0.03 0.105;
        box 0.1 0.03 0.03 0.008 at 0 -0.03 0.12
Card box | room 1.32 -2.33 1 12
    Oak: box 0.10 0.06 0.025 0.003 at 0 0 0.0125
    White: box 0.085 0.001 0.05 at 0 -0.02..0.004*3 0.045 turned 12 0 0
    Paper: box 0.085 0.001 0.05 at 0 -0.014..0.01*3 0.045 turned 12 0 0
Low table | room 1.24 0.15 0.008
    Mahogany: box 0.42 0.9 0.03 0.01 2 at 0 0 0.415; box 0.34 0.82 0.06 0.004 at 0 0 0.37;
        box 0.32 0.78 0.016 0.004 at 0 0 0.13;
        lathe 0.014 0.004, 0.02 0.03, 0.016 0.1, 0.026 0.13, 0.018 0.2, 0.027 0.3, 0.02 0.35
        0.024 0.4 at ±0.16 ±0.39 0
Ashtray | room 1.29 0.48 0.4385
    Amber glass: lathe 0.05 0, 0.065 0.004, 0.07 0.035, 0.062 0.04, 0.054 0.034, 0.045 0.012, 0 0.01
Trolley | room -1.55 -3.2 0.003 -20
    Chrome: tube 0.009, 0 0 0.06, 0 0 0.8 at ±0.23 ±0.16 0; ball 0.013 at ±0.23 ±0.16 0.805
    Rubber: lathe 0.028 -0.009, 0.03 0, 0.028 0.009 at ±0.23 ±0.16 0.03 turned 90 0 30
    Cream: box 0.46 0.32 0.012 0.003 at 0 0 0.2, 0 0 0.48, 0 0 0.74
    Chrome: frame 0.44 0.30, 0 0, 0 0.035, 0.006 0.035, 0.006 0 at 0 0 0.2, 0 0 0.48, 0 0 0.74
Display cabinet | right -1.65 0.035
    Mahogany: box 0.9 0.36 0.5 0.006 at 0 0.18 0.25; box 0.9 0.02 1.5 at 0 0.01 1.25;
        box 0.024 0.36 1.5 at ±0.438 0.18 1.25; box 0.96 0.39 0.05 0.015 2 at 0 0.18 2.025;
        box 0.93 0.38 0.03 0.008 at 0 0.18 0.5;
        frame 0.30 0.32, {PANEL} at ±0.215 0.36 0.25 turned 90 0 180;
        frame 0.35 1.37, 0 -0.012, 0 0.01, 0.04 0.01, 0.04 -0.012
        at ±0.215 0.35 1.255 turned 90 0 180
    Pane: plane 0.35 1.37 at ±0.215 0.35 1.255 turned 90 0 180
    Brass: ball 0.012 at ±0.035 0.372 1.1, ±0.035 0.388 0.3
    Oak: box 0.85 0.31 0.012 at 0 0.17 0.884, 0 0.17 1.254, 0 0.17 1.624
Hat box | right -1.85 0.22 2.05, right -1.85 0.22 2.196 30
    Teal: lathe 0.15 0, 0.15 0.14; Cream: lathe 0.155 0.1, 0.155 0.142, 0.15 0.146
    Red: box 0.316 0.02 0.002 at 0 0 0.147
Back cupboard | back 1.68
    Oak: box 1.4 0.3 0.8 0.006 at 0 0.19 0.42; Mahogany: box 1.44 0.34 0.03 0.008 at 0 0.20 0.835
    Oak: frame 0.25 0.6, {PANEL} at -0.525..0.525*4 0.34 0.42 turned 90 0 180
    Brass: ball 0.013 at -0.415..0.635*4 0.365 0.55
Radio | back 2.08 0.19 0.85 -8
    Mahogany: prism 0.16, 0.17 0, 0.17 0.14, 0.16 0.184, 0.137 0.215, 0.1 0.243, 0.05 0.262
        0 0.2675, -0.05 0.262, -0.1 0.243, -0.137 0.215, -0.16 0.184, -0.17 0.14, -0.17 0
        at 0 0.08 0 turned 90 0 0
    Bristle: lathe 0.10 0, 0.10 0.004 at 0 0.0805 0.155 turned -90 0 0
    Mahogany: box 0.008 0.006 0.12 0.002 at ±0.08 0.086 0.155;
        box 0.008 0.006 0.183 0.002 at ±0.04 0.086 0.155; box 0.008 0.006 0.2 0.002 at 0 0.086 0.155
    Cream: lathe 0.018 0, 0.016 0.018, 0 0.019 at -0.1..0.1*3 0.08 0.032 turned -90 0 0
Towel steamer | back 1.33 0.19 0.85
    Cream: box 0.38 0.22 0.30 0.025 3 at 0 0 0.16; Chrome: box 0.30 0.01 0.22 0.004 at 0 0.112 0.17
    Cream: box 0.26 0.01 0.18 0.004 at 0 0.116 0.17
    Chrome: bend 0.007, -0.11 0.12 0.11, -0.11 0.145 0.12, -0.11 0.145 0.22, -0.11 0.12 0.23
    White: lathe 0.026 0, 0.026 0.008, 0 0.01 at 0.08 0.12 0.2 turned -90 0 0
    Red: word 0.05 0.0005 HOT at 0.02 0.1225 0.12 turned 90 0 180
    Rubber: lathe 0.015 0, 0.02 0.015 at ±0.15 ±0.05 0
"""
LOLLY_JAR = """Steel: lathe 0.064 0, 0.064 0.004
    Pane: pipe 0.06 0.004, 0.07 0.02, 0.07 0.14, 0.05 0.17"""
LEDGER = """Oxblood: box 0.36 0.25 0.006 0.002 at 0 0 0.003
    Paper: box 0.17 0.235 0.012 0.003 at -0.087 0 0.012 turned 0 -2 0;
        box 0.17 0.235 0.012 0.003 at 0.087 0 0.012 turned 0 2 0
    Black: tube 0.004, 0.02 -0.06 0.026, 0.13 0.03 0.024"""


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
    button = scene.ball(0.009, 8).scaled(1, 1, 0.6)
    return join([front, back, copies(button, places[(a + b) % 2 == 0])])


def barber_chairs(scene: Scene) -> None:
    """Three hydraulic chairs, turned to their mirrors, on mats of ribbed rubber."""
    seat, back = Model(scene, CHAIR), Model(scene, CHAIR_BACK)
    seat.add(cushion(scene, (0.50, 0.50, 0.05), (4, 4)), "Oxblood", (0, 0.03, 0.56))
    padding = cushion(scene, (0.46, 0.54, 0.07), (4, 4))
    back.add(padding, "Oxblood", (0, 0.03, 0.28), (90, 0, 180))
    seat_mesh, back_mesh = seat.mesh("Barber chair"), back.mesh("Barber chair back")
    for y, turn in zip(STATIONS, (128, 104, 66), strict=True):
        where = f"room -1.38 {y} 0.009 {turn}"
        put(seat_mesh, where)
        put(back_mesh, where, (0, -0.25, 0.58), (14, 0, 0))
    mat = Model(scene, "Rubber: lathe 0.60 0.001, 0.60 0.007, 0.575 0.012, 0.56 0.009, 0 0.009")
    for k in range(7):
        mat.add(scene.ring(0.14 + 0.06 * k, 0.003, 48, 6), "Rubber", (0, 0, 0.009))
    put(mat.mesh("Chair mat"), "room -1.4 -2..2*3")


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
    put(model.mesh("Waiting bench"), "right 0.15")


def desk_things(scene: Scene) -> None:
    """A jar of lollies on the desk, and an open appointment book with a pen."""
    random, model = scene.random("lollies"), Model(scene, LOLLY_JAR)
    stick = scene.tube("0 0 0, 0 0 0.07", 0.0015, 5)
    for k, at in enumerate(scattered(random, scene.count(40, 6), 0.055, 0.02, 0.13)):
        model.add(scene.ball(0.013, 10), INKS[k % 6], at)
        model.add(stick, "White", at, random.uniform(-25, 25, 3))
    put(model.mesh("Lolly jar"), "room 1.1 -2.39 1")
    model, random = Model(scene, LEDGER), scene.random("ledger")
    for side in (-1, 1):
        for k in range(14):
            width = random.uniform(0.05, 0.14) if k else 0.13
            at = (side * 0.085 - (0.14 - width) / 2, 0.1 - 0.015 * k, 0.0195)
            model.add(box((width, 0.003, 0.0006)), "Navy" if k else "Red", at, (0, side * 2, 0))
    put(model.mesh("Appointment book"), "room 1.35 -2.53 1 -8")


def magazines(scene: Scene) -> None:
    """Magazines fanned on the low table, and piles of them on its lower board."""
    random, where = scene.random("magazines"), "room 1.24 0.15 0.008"
    issues = [magazine(scene, i) for i in range(6)]
    for k in range(scene.segments(7, 2)):
        at = (-0.02 + 0.015 * k, -0.28 + 0.055 * k, 0.4255 + 0.0062 * k)
        put(issues[k % 6], where, at, (0, 0, -100 + 13 * k))
    for k in range(scene.segments(12, 2)):
        at = (0, 0.18 * (k % 2 * 2 - 1), 0.1335 + 0.0062 * (k // 2))
        put(issues[(k * 5 + 1) % 6], where, at, (0, 0, random.uniform(82, 98)))


def stocked(scene: Scene, bottles: Goods, pots: Goods) -> None:
    """Goods in the display cabinet and on the trolley, and on shelves behind the desk."""
    random, wares, board = scene.random("stock"), [*bottles, *pots], shelf(scene, 1.4, 0.16)
    for z in (0.516, 0.89, 1.26, 1.63):
        stock(scene, random, wares, f"right -1.65 0.065 {z}", 0.84, 0.27)
    for z, goods in ((1.25, bottles), (1.6, wares), (1.95, wares), (2.3, wares)):
        rack = f"back 1.68 {0.022 if z == 1.25 else 0} {z}"  # the lowest clears the rail
        put(board, rack)
        stock(scene, random, goods, rack, 1.36, 0.14)
    stock(scene, random, pots, "back 1.7 0.1 0.85", 0.34, 0.18)
    trolley, towel = "room -1.55 -3.2 0.003 -20", folded_towel(scene, "Blue towel")
    for k in range(3):
        put(towel, trolley, (-0.06, 0, 0.487 + 0.0455 * k), (0, 0, 2 * k))
        put(towel, trolley, (0.03, 0, 0.207 + 0.0455 * k), (0, 0, -2 * k))
    stock(scene, random, pots, spots(trolley)[0] @ transform((0, -0.13, 0.747)), 0.42, 0.26)
