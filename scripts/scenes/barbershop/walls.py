"""Walls and ceiling: paper, glazed tiles, panels, friezes, pressed tin and beams."""

import numpy as np

from scenes.barbershop.plan import HALF_X, HALF_Y, HEIGHT, ROOM, put, spot, spots, wall
from scenes.library.architecture import blocks, frame
from scenes.library.model import Model
from scenes.library.points import xyz
from scenes.library.scene import Scene
from scenes.library.shapes import grid

WAINSCOT = """Mahogany: box 0.6 0.018 1 at 0 0.009 0.5
    Mahogany: box 0.6 0.035 0.14 0.006 at 0 0.0175 0.07
    Mahogany: box 0.07 0.03 0.86 0.004 at ±0.265 0.015 0.5
    Mahogany: box 0.46 0.028 0.08 0.004 at 0 0.014 0.18
    Mahogany: box 0.46 0.028 0.09 0.004 at 0 0.014 0.91
    Mahogany: box 0.31 0.018 0.49 at 0 0.012 0.543
    Mahogany: frame 0.42 0.60, -0.06 0.02, -0.02 0.032, 0 0.034, 0.012 0.026, 0.02 0.018
        at 0 0 0.543 turned 90 0 180
    Mahogany: prism 0.6, 0 0, 0.05 0, 0.05 0.02, 0.038 0.032, 0.02 0.045, 0 0.05
        at -0.3 0 0.97 turned 90 0 90"""
ALONG, ACROSS = "-3.646..3.646*36 0.001 2.765", "-2.396..2.396*24 0.001 2.765"  # the frieze
PETAL = "lathe 0.03 0, 0.03 0.0005"
WALLS = f"""
Walls | room
    Wallpaper: box 0.15 7.8 3 at 2.575 0 1.5
    Wallpaper: box 5 0.15 3 at 0 -3.825 1.5
    Plaster: box 0.15 7.8 3 at -2.575 0 1.5
    Plaster: box 0.45 0.15 3 at -2.275 3.825 1.5, 0.775 3.825 1.5
    Plaster: box 2.6 0.15 1 at -0.75 3.825 0.5
    Plaster: box 2.6 0.15 0.55 at -0.75 3.825 2.725
    Plaster: box 0.95 0.15 0.55 at 1.475 3.825 2.725
    Plaster: box 0.55 0.15 3 at 2.225 3.825 1.5
    Plaster: box 5.3 7.8 0.1 at 0 0 3.051
Wall lettering | on left 0 0.01 2.545
    Gilt: word 0.18 0.018 HAIRCUTS  ·  HOT TOWELS  ·  SHAVES
Grout | left 0
    Grout: box 7.5 0.004 2.3 at 0 0.002 1.15
    Black tile: box 7.5 0.02 0.022 0.008 2 at 0 0.01 1.1..2.3*2
Beam | room 0 -3..3*5 2.93
    Mahogany x: box 5 0.15 0.14 0.012 2
    Mahogany x: box 0.12 0.016 0.05 0.005 at -2.25..2.25*10 ±0.083 0.04
Picture rail | room 0 0 2.675
    Mahogany: frame 5 7.5, 0 0, -0.03 0, -0.038 0.012, -0.03 0.035, 0 0.045
Palmette | on left {ALONG}, on right {ALONG}, on front {ACROSS}, on back {ACROSS}
    Green: {PETAL} at -0.0329 -0.018 0 turned 0 0 70 scaled 0.37 1 1
    Red: {PETAL} at -0.0201 -0.0013 0 turned 0 0 35 scaled 0.37 1 1
    Green: {PETAL} at 0 0.005 0 scaled 0.37 1 1
    Red: {PETAL} at 0.0201 -0.0013 0 turned 0 0 -35 scaled 0.37 1 1
    Green: {PETAL} at 0.0329 -0.018 0 turned 0 0 -70 scaled 0.37 1 1
    Ochre: lathe 0.012 0, 0.012 0.001 at 0 -0.03 0
    Ochre: bend 0.003, 0 -0.045 0, 0.05 -0.055 0, 0.085 -0.03 0, 0.075 0 0, 0.055 -0.005 0
        0.06 -0.022 0
    Ochre: bend 0.003, 0 -0.045 0, -0.05 -0.055 0, -0.085 -0.03 0, -0.075 0 0
        -0.055 -0.005 0, -0.06 -0.022 0
"""


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
    put(model.mesh("Metro tiles"), wall("left", 0))


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
            put(data, wall(side, start + (i + 0.5) * width), scale=(width / size, 1, 1))


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
    for where in spots("room -2.25..2.25*10 -3.5..3.5*15 3"):
        put(tile, where, degrees=(180, 0, 0))
    cornice, t = Model(scene), np.linspace(0, np.pi / 2, scene.segments(8))
    cove = np.column_stack([-0.13 + 0.09 * np.sin(t), 0.035 + 0.10 * (1 - np.cos(t))])
    profile = [(-0.15, 0), (-0.15, 0.03), *cove, (-0.03, 0.16), (0, 0.16)]
    cornice.add(frame(ROOM[0], ROOM[1], profile), "Cream", (0, 0, HEIGHT), (180, 0, 0))
    put(cornice.mesh("Cornice"), spot("room"))
