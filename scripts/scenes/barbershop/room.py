"""The room: its floor with mosaic, rug and hair, walls, panels, friezes, ceiling and beams."""

import numpy as np

from scenes.barbershop.plan import HAIR, HALF_X, HALF_Y, ROOM, STATIONS, TAU, put
from scenes.library.architecture import blocks, frame
from scenes.library.points import circle, points, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, grid, lettering, prism, tube

TILE = 0.3125
MOSAIC_HEIGHT = 0.0015
GREEN, CREAM = ([f"{color} glaze {i}" for i in range(3)] for color in ("Green", "Cream"))
MOSAIC_RINGS = (  # inner and outer radius, glazes
    *((0.74, 0.79, GREEN), (0.68, 0.735, CREAM), (0.47, 0.515, CREAM), (0.42, 0.465, GREEN)),
    (0.36, 0.415, ["Red", "Ochre"]),
)
MOSAIC = """Grout: lathe 0.8 0, 0.8 0.0005; Black tile: pipe 0.675 0, 0.675 0.0015, 0.52 0.0015
    Cream: lathe 0.355 0, 0.355 0.0015; Brass: lathe 0.07 0, 0.07 0.0039
    Black tile: word 0.12 0.0005 B at 0 0 0.0043"""
RUG = """Rug red: box 0.78 1.9 0.004 0.001 at 0 0 0.002
    Rug sand: box 0.70 1.82 0.004 0.001 at 0 0 0.0032
    Rug navy: box 0.64 1.76 0.004 0.001 at 0 0 0.0044
    Rug red: box 0.5 1.62 0.004 0.001 at 0 0 0.0056
    Rug navy: box 0.2 0.2 0.0015 at 0 -0.6..0.6*3 0.0078 turned 0 0 45
    Rug sand: box 0.2 0.2 0.0015 at 0 ±0.3 0.0078 turned 0 0 45;
        box 0.1 0.1 0.0015 at 0 -0.6..0.6*3 0.0088 turned 0 0 45
    Rug navy: box 0.1 0.1 0.0015 at 0 ±0.3 0.0088 turned 0 0 45"""
ON_THE_FLOOR = """
Entrance mat | front 1.475 0.42
    Bristle: box 0.9 0.55 0.014 0.005 at 0 0 0.007
    Rug navy: box 0.84 0.49 0.004 0.001 at 0 0 0.0145
    Rug sand: word 0.17 0.0005 WELCOME at 0 0 0.0168 turned 0 0 180
Floor drain | room -0.62 -2.5
    Brass: lathe 0.07 0, 0.068 0.003, 0 0.003
    Black: lathe 0.006 0, 0.006 0.0006 at ±0.045 0 0.003, ±0.039 ±0.0225 0.003, ±0.0225 ±0.039 0.003
        0 ±0.045 0.003
"""
WAINSCOT = """Mahogany: box 0.6 0.018 1 at 0 0.009 0.5; box 0.6 0.035 0.14 0.006 at 0 0.0175 0.07;
        box 0.07 0.03 0.86 0.004 at ±0.265 0.015 0.5; box 0.46 0.028 0.08 0.004 at 0 0.014 0.18;
        box 0.46 0.028 0.09 0.004 at 0 0.014 0.91; box 0.31 0.018 0.49 at 0 0.012 0.543;
        frame 0.42 0.60, -0.06 0.02, -0.02 0.032, 0 0.034, 0.012 0.026, 0.02 0.018
        at 0 0 0.543 turned 90 0 180;
        prism 0.6, 0 0, 0.05 0, 0.05 0.02, 0.038 0.032, 0.02 0.045, 0 0.05
        at -0.3 0 0.97 turned 90 0 90"""
ALONG, ACROSS = "-3.646..3.646*36 0.001 2.765", "-2.396..2.396*24 0.001 2.765"  # the frieze
PETAL = "lathe 0.03 0, 0.03 0.0005"
WALLS = f"""
Walls | room
    Wallpaper: box 0.15 7.8 3 at 2.575 0 1.5; box 5 0.15 3 at 0 -3.825 1.5
    Plaster: box 0.15 7.8 3 at -2.575 0 1.5; box 0.45 0.15 3 at -2.275 3.825 1.5, 0.775 3.825 1.5;
        box 2.6 0.15 1 at -0.75 3.825 0.5; box 2.6 0.15 0.55 at -0.75 3.825 2.725;
        box 0.95 0.15 0.55 at 1.475 3.825 2.725; box 0.55 0.15 3 at 2.225 3.825 1.5;
        box 5.3 7.8 0.1 at 0 0 3.051
Wall lettering | on left 0 0.01 2.545
    Gilt: word 0.18 0.018 HAIRCUTS  ·  HOT TOWELS  ·  SHAVES
Grout | left 0
    Grout: box 7.5 0.004 2.3 at 0 0.002 1.15
    Black tile: box 7.5 0.02 0.022 0.008 2 at 0 0.01 1.1..2.3*2
Beam | room 0 -3..3*5 2.93
    Mahogany x: box 5 0.15 0.14 0.012 2; box 0.12 0.016 0.05 0.005 at -2.25..2.25*10 ±0.083 0.04
Picture rail | room 0 0 2.675
    Mahogany: frame 5 7.5, 0 0, -0.03 0, -0.038 0.012, -0.03 0.035, 0 0.045
Palmette | on left {ALONG}, on right {ALONG}, on front {ACROSS}, on back {ACROSS}
    Green: {PETAL} at -0.0329 -0.018 0 turned 0 0 70 scaled 0.37 1 1
    Red: {PETAL} at -0.0201 -0.0013 0 turned 0 0 35 scaled 0.37 1 1
    Green: {PETAL} at 0 0.005 0 scaled 0.37 1 1
    Red: {PETAL} at 0.0201 -0.0013 0 turned 0 0 -35 scaled 0.37 1 1
    Green: {PETAL} at 0.0329 -0.018 0 turned 0 0 -70 scaled 0.37 1 1
    Ochre: lathe 0.012 0, 0.012 0.001 at 0 -0.03 0;
        bend 0.003, 0 -0.045 0, 0.05 -0.055 0, 0.085 -0.03 0, 0.075 0 0, 0.055 -0.005 0
        0.06 -0.022 0;
        bend 0.003, 0 -0.045 0, -0.05 -0.055 0, -0.085 -0.03 0, -0.075 0 0, -0.055 -0.005 0
        -0.06 -0.022 0
"""


def tiles(scene: Scene) -> None:
    """Bevelled cream and black tiles over a bed of grout."""
    model = Model(scene, "Grout: box 5 7.5 0.05 at 0 0 -0.028")
    i, j = np.indices((round(ROOM[0] / TILE), round(ROOM[1] / TILE)))
    centers = xyz((i + 0.5) * TILE - HALF_X, (j + 0.5) * TILE - HALF_Y, -0.01)
    for k, material in enumerate(("Cream tile", "Black tile")):
        size = (TILE - 0.004, TILE - 0.004, 0.02)
        model.add(blocks(centers[(i + j) % 2 == k], size, 0.003), material)
    put(model.mesh("Floor"), "room")


def medallion(scene: Scene) -> None:
    """An inlaid mosaic in the middle of the floor: rings of stones, a star, and the shop's name."""
    random, model = scene.random("medallion"), Model(scene, MOSAIC)
    for inner, outer, glazes in MOSAIC_RINGS:
        count = scene.segments(TAU * outer / 0.05, 12)
        arc = circle(1.0, 3, -0.93 * np.pi / count, 0.93 * np.pi / count)
        stone = prism(np.concatenate([arc * outer, arc[::-1] * inner]), MOSAIC_HEIGHT)
        glaze = random.integers(len(glazes), size=count)
        for i, material in enumerate(glazes):
            outwards = polar(1, np.flatnonzero(glaze == i) * TAU / count)
            model.add(copies(stone, 0 * outwards, forward=outwards), material)
    words = "BARBER SHOP  ·  EST. 1927  ·  "
    for k, letter in enumerate(words):
        turn = -360 * k / len(words)
        if letter != " ":
            at = polar(0.595, np.radians(turn + 90), MOSAIC_HEIGHT + 0.0004)
            model.add(lettering(letter, 0.0005), "Brass", at, (0, 0, turn), (0.13, 0.13, 1))
    for k, (reach, top) in enumerate(((0.34, 0.0031), (0.24, 0.0023))):
        outwards = polar(1, (np.arange(8) + k / 2) * TAU / 8)
        for side, material in ((1, "Ochre"), (-1, "Navy")):
            ray = prism([(0, 0), (0.05 * side, 0.28 * reach), (0, reach)][::side], top)
            model.add(copies(ray, 0 * outwards, forward=outwards), material)
    put(model.mesh("Floor medallion"), "room")


def rug(scene: Scene) -> None:
    """A bordered rug with lozenges and a fringe, below the low table."""
    model, random = Model(scene, RUG), scene.random("rug")
    for end in points(f"-0.38..0.38*{scene.segments(60, 8)} ±0.975 0.0025"):
        model.add(box((0.006, 0.06, 0.003)), "Rug sand", end, (0, 0, random.uniform(-12, 12)))
    put(model.mesh("Rug"), "room 1.24 0.15")


def hair_clippings(scene: Scene) -> None:
    """Cut hair on the floor round the chairs, as small tufts that are placed many times."""
    random = scene.random("hair clippings")
    for hair, y in zip(HAIR, STATIONS, strict=True):
        model = Model(scene)
        for _ in range(scene.count(60, 6)):
            bow, half = random.uniform(0.004, 0.014), random.uniform(0.008, 0.022)
            path = points("-1 0 0, -0.33 0.7 3, 0.5 1 3, 1 0 1") * (half, bow, 0.0004)
            strand = tube(path, (0.0003, 0.0006, 0.0006, 0.0002), 3)
            at, turn = (*random.normal(0, 0.05, 2), 0.0012), (0, 0, random.uniform(0, 360))
            model.add(strand, hair, at, turn)
        tuft, around = model.mesh(f"Clippings {hair.lower()}"), f"room -1.4 {y} 0.001"
        for _ in range(scene.count(26, 2)):
            at = polar(random.uniform(0.62, 0.85), random.uniform(0, TAU))
            turn, size = (0, 0, random.uniform(0, 360)), random.uniform(0.7, 1.3)
            put(tuft, around, at, turn, size)


def metro_tiles(scene: Scene) -> None:
    """Glazed tiles in running bond over the left wall, green below and cream above."""
    random, model = scene.random("tiles"), Model(scene)
    width, height, gap, green_rows = 0.2, 0.1, 0.003, 11
    row, column = np.indices((23, int(ROOM[1] / width) + 2)).reshape(2, -1)
    left = (column - (row % 2) / 2) * width - HALF_Y
    x0, x1 = np.clip([left, left + width], -HALF_Y, HALF_Y)
    centers = xyz((x0 + x1) / 2, 0.006, (row + 0.5) * height)
    sizes = xyz(x1 - x0 - gap, 0.012, height - gap)
    glaze = random.integers(3, size=len(row))
    for k in range(6):
        here = (glaze == k % 3) & ((row < green_rows) == (k < 3)) & (x1 - x0 > 0.02)
        material = f"{'Green' if k < 3 else 'Cream'} glaze {k % 3}"
        model.add(blocks(centers[here], sizes[here], 0.004), material)
    put(model.mesh("Metro tiles"), "left 0")


def wainscot(scene: Scene) -> None:
    """Raised mahogany panels below a chair rail, on three walls."""
    data, size = Model(scene, WAINSCOT).mesh("Wainscot"), 0.6
    for side, start, stop in (
        ("right", -HALF_Y, HALF_Y),
        ("back", -HALF_X, -2.04),
        ("back", -1.01, HALF_X),
        ("front", -HALF_X, 0.91),
        ("front", 2.04, HALF_X),
    ):
        count = round((stop - start) / size)
        width = (stop - start) / count
        for i in range(count):
            put(data, f"{side} {start + (i + 0.5) * width}", scale=(width / size, 1, 1))


def ceiling(scene: Scene) -> None:
    """Pressed tin tiles, and a cornice."""
    u = np.linspace(-1, 1, scene.segments(32, 6) + 1)
    v = u[:, None]
    square, r = np.maximum(np.abs(u), np.abs(v)), np.hypot(u, v)
    petals = 0.5 + 0.5 * np.cos(8 * np.arctan2(v, u))
    relief = (
        0.020 * np.exp(-(((square - 0.92) / 0.05) ** 2))
        + 0.012 * np.exp(-(((square - 0.74) / 0.04) ** 2))
        + 0.022 * np.exp(-(((r - 0.42) / 0.14) ** 2)) * petals
        + 0.030 * np.exp(-((r / 0.13) ** 2))
    )
    tile = scene.mesh("Tin tile", grid(u / 4, u / 4, relief), "Tin")
    put(tile, "room -2.25..2.25*10 -3.5..3.5*15 3", degrees=(180, 0, 0))
    cornice, t = Model(scene), np.linspace(0, np.pi / 2, scene.segments(8))
    cove = np.column_stack([-0.13 + 0.09 * np.sin(t), 0.035 + 0.10 * (1 - np.cos(t))])
    profile = [(-0.15, 0), (-0.15, 0.03), *cove, (-0.03, 0.16), (0, 0.16)]
    cornice.add(frame(ROOM[0], ROOM[1], profile), "Cream", (0, 0, ROOM[2]), (180, 0, 0))
    put(cornice.mesh("Cornice"), "room")
