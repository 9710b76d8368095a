"""The floor: tiles, a mosaic in their middle, a rug, a mat, and cut hair round the chairs."""

import numpy as np

from scenes.barbershop.plan import HAIR, HALF_X, HALF_Y, ROOM, STATIONS, TAU, put, spot
from scenes.library.architecture import blocks
from scenes.library.lettering import lettering
from scenes.library.model import Model
from scenes.library.points import circle, points, polar, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import copies, prism, tube

TILE = 0.3125
MOSAIC_HEIGHT = 0.0015
GREEN, CREAM = ([f"{color} glaze {i}" for i in range(3)] for color in ("Green", "Cream"))
MOSAIC_RINGS = (  # inner and outer radius, glazes
    *((0.74, 0.79, GREEN), (0.68, 0.735, CREAM), (0.47, 0.515, CREAM), (0.42, 0.465, GREEN)),
    (0.36, 0.415, ["Red", "Ochre"]),
)
MOSAIC = """Grout: lathe 0.8 0, 0.8 0.0005
    Black tile: pipe 0.675 0, 0.675 0.0015, 0.52 0.0015
    Cream: lathe 0.355 0, 0.355 0.0015
    Brass: lathe 0.07 0, 0.07 0.0039
    Black tile: word 0.12 0.0005 B at 0 0 0.0043"""
RUG = """Rug red: box 0.78 1.9 0.004 0.001 at 0 0 0.002
    Rug sand: box 0.70 1.82 0.004 0.001 at 0 0 0.0032
    Rug navy: box 0.64 1.76 0.004 0.001 at 0 0 0.0044
    Rug red: box 0.5 1.62 0.004 0.001 at 0 0 0.0056
    Rug navy: box 0.2 0.2 0.0015 at 0 -0.6..0.6*3 0.0078 turned 0 0 45
    Rug sand: box 0.2 0.2 0.0015 at 0 ±0.3 0.0078 turned 0 0 45
    Rug sand: box 0.1 0.1 0.0015 at 0 -0.6..0.6*3 0.0088 turned 0 0 45
    Rug navy: box 0.1 0.1 0.0015 at 0 ±0.3 0.0088 turned 0 0 45"""
ON_THE_FLOOR = """
Entrance mat | front 1.475 0.42
    Bristle: box 0.9 0.55 0.014 0.005 at 0 0 0.007
    Rug navy: box 0.84 0.49 0.004 0.001 at 0 0 0.0145
    Rug sand: word 0.17 0.0005 WELCOME at 0 0 0.0168 turned 0 0 180
Floor drain | room -0.62 -2.5
    Brass: lathe 0.07 0, 0.068 0.003, 0 0.003
    Black: lathe 0.006 0, 0.006 0.0006 at ±0.045 0 0.003, ±0.039 ±0.0225 0.003
        ±0.0225 ±0.039 0.003, 0 ±0.045 0.003
"""


def tiles(scene: Scene) -> None:
    """Bevelled cream and black tiles over a bed of grout."""
    model = Model(scene, "Grout: box 5 7.5 0.05 at 0 0 -0.028")
    i, j = np.indices((round(ROOM[0] / TILE), round(ROOM[1] / TILE)))
    centers = xyz((i + 0.5) * TILE - HALF_X, (j + 0.5) * TILE - HALF_Y, -0.01)
    for k, material in enumerate(("Cream tile", "Black tile")):
        size = (TILE - 0.004, TILE - 0.004, 0.02)
        model.add(blocks(centers[(i + j) % 2 == k], size, 0.003), material)
    put(model.mesh("Floor"), spot("room"))


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
    put(model.mesh("Floor medallion"), spot("room"))


def rug(scene: Scene) -> None:
    """A bordered rug with lozenges and a fringe, below the low table."""
    model, random = Model(scene, RUG), scene.random("rug")
    for end in points(f"-0.38..0.38*{scene.segments(60, 8)} ±0.975 0.0025"):
        model.box((0.006, 0.06, 0.003), "Rug sand", end, (0, 0, random.uniform(-12, 12)))
    put(model.mesh("Rug"), spot("room 1.24 0.15"))


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
        tuft, around = model.mesh(f"Clippings {hair.lower()}"), spot(f"room -1.4 {y} 0.001")
        for _ in range(scene.count(26, 2)):
            at = polar(random.uniform(0.62, 0.85), random.uniform(0, TAU))
            turn, size = (0, 0, random.uniform(0, 360)), random.uniform(0.7, 1.3)
            put(tuft, around, at, turn, size)
