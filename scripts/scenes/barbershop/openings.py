"""The shop window, the doors, and the street outside."""

import numpy as np

from scenes.barbershop.plan import TAU, put
from scenes.library.points import points, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, lettering, sheet

CASING = "0 -0.05, 0 0.03, 0.015 0.04, 0.07 0.034, 0.075 0.045, 0.09 0.045, 0.09 0"
REVEAL = "-0.001 -0.15, -0.001 0"
PANEL = "-0.06 0.022, -0.04 0.036, 0.02 0.036, 0.025 0.02"

OPENINGS = f"""
Window frame | on front -0.75 0 1.725
    Mahogany: frame 2.6 1.45, {CASING}; frame 2.6 1.45, {REVEAL};
        box 0.05 1.45 0.06 0.008 at ±0.433 0 -0.07; box 2.6 0.05 0.06 0.008 at 0 0.35 -0.07
    Mahogany x: box 2.9 0.035 0.26 0.012 2 at 0 -0.7425 0.06
Window pane | on front -0.75 -0.075 1.725
    Pane: plane 2.6 1.45
Window letters | front -0.75 -0.078 1.725
    Gilt: word 0.34 0.004 BARBER SHOP at 0 0 0.02 turned 90 0 0;
        word 0.15 0.004 EST. 1927 at 0 0 -0.3 turned 90 0 0
Door frame | on front 1.475 0 1.225
    Mahogany: frame 0.95 2.45, {CASING}; frame 0.95 2.45, {REVEAL};
        box 0.95 0.06 0.07 0.008 at 0 0.905 -0.06
Door | front 1.475 -0.06 0
    Mahogany: box 0.12 0.045 2.09 0.006 at ±0.415 0 1.055; box 0.71 0.043 0.24 0.005 at 0 0 0.13;
        box 0.71 0.043 0.16 0.005 at 0 0 0.82; box 0.71 0.043 0.14 0.005 at 0 0 2.03;
        box 0.71 0.02 0.5 at 0 0 0.5;
        frame 0.71 0.49, -0.05 0.012, -0.03 0.02, 0 0.022 at 0 0 0.495 turned 90 0 180
    Brass: box 0.85 0.003 0.2 at 0 0.024 0.12; box 0.05 0.006 0.4 0.002 at -0.415 0.025 1.05;
        box 0.22 0.008 0.05 0.003 at 0 0.026 0.82;
        bend 0.011, 0 0.02 -0.15, 0 0.07 -0.1, 0 0.075 0, 0 0.07 0.1, 0 0.02 0.15 at -0.415 0 1.05
Door pane | on front 1.475 -0.062 1.43
    Pane: plane 0.95 1.06
Transom pane | on front 1.475 -0.062 2.305
    Pane: plane 0.95 0.29
Door sign | on front 1.475 -0.04 1.5
    Cream: box 0.3 0.16 0.006 0.002; Red: word 0.065 0.0005 CLOSED at 0 0 0.0033
    Green: word 0.09 0.0005 OPEN at 0 0 -0.0033 turned 0 180 0
    Iron: tube 0.0015, -0.13 0.075 0, 0 0.28 -0.01; tube 0.0015, 0.13 0.075 0, 0 0.28 -0.01
Door bell | front 1.675 0 2.2
    Brass: lathe 0.045 0, 0.034 0.02, 0.026 0.05, 0.012 0.065, 0 0.068 at 0 0.12 0;
        bend 0.005, 0 0 0.02, 0 0.03 0.12, 0 0.1 0.12, 0 0.12 0.06
House number | on front 1.475 -0.07 2.305
    Gilt: word 0.2 0.01 27 turned 0 180 0
Staff door frame | on back -1.525 0 1.025
    Mahogany: frame 0.85 2.05, {CASING}
Staff door | back -1.525
    Mahogany: box 0.85 0.02 2.05 at 0 0.01 1.025;
        frame 0.28 0.6, {PANEL} at ±0.2 0 0.5 turned 90 0 180;
        frame 0.28 0.3, {PANEL} at ±0.2 0 1.05 turned 90 0 180;
        frame 0.62 0.55, {PANEL} at 0 0 1.62 turned 90 0 180
    Cream: box 0.6 0.012 0.53 at 0 0.021 1.62
    Black: word 0.15 0.0005 STAFF at 0 0.0275 1.64 turned 90 0 180;
        word 0.07 0.0005 private at 0 0.0275 1.52 turned 90 0 180
    Brass: lathe 0.026 0, 0.012 0.01, 0.012 0.035, 0.03 0.045, 0.026 0.065, 0 0.07
        at -0.37 0.02 1 turned -90 0 0; box 0.05 0.006 0.2 0.002 at -0.37 0.022 0.98
Street lamp | room -2.6 6.2
    Iron: lathe 0.16 -0.1, 0.16 0.2, 0.07 0.35, 0.05 2.9, 0.09 3.0
    Cream: lathe 0.08 3.0, 0.17 3.4, 0.19 3.42, 0.03 3.6, 0 3.66
"""
STREET = """Street stone: box 24 2.6 0.1 at 0 5.3 -0.15, 0 12.3 -0.15
    Iron: box 24 5 0.1 at 0 9.1 -0.25; Brick: box 24 0.3 9 at 0 13.2 4.4
    White: box 1 0.12 1.5 at -10.5..10.5*13 13.05 4.2..7*2;
        box 0.04 0.16 1.34 at -10.5..10.5*13 13.02 4.2..7*2;
        box 0.84 0.16 0.04 at -10.5..10.5*13 13.02 4.3..7.1*2;
        box 1.5 0.16 0.05 at -10.5..10.5*13 13.01 1.75
    Dark glass: box 0.84 0.14 1.34 at -10.5..10.5*13 13.03 4.2..7*2;
        box 1.35 0.14 1.5 at -10.5..10.5*13 13.02 1.35
    Street stone: box 1.2 0.3 0.1 at -10.5..10.5*13 12.98 3.4..6.2*2
    Mahogany: box 1.5 0.2 0.28 at -10.5..10.5*13 13 2.75"""
ROD = """Brass: tube 0.014, -1.44 0 0, 1.44 0 0; ball 0.028 at ±1.44 0 0;
        tube 0.008, 0 0 0, 0 0 -0.09 at ±1.42 0 0"""
TRADES = ("BAKER", "TAILOR", "BOOKS", "HATS", "SHOES", "TEA")


def valance(scene: Scene) -> None:
    """A scalloped red curtain on a brass rod above the window."""
    x = np.linspace(-1.4, 1.4, scene.segments(160, 24))
    drop = np.linspace(-1, 0, scene.segments(10))[:, None]
    scallops = drop * (0.26 + 0.05 * np.cos(x * TAU / 0.35))
    model = Model(scene, ROD)
    folds = 0.025 * np.sin(x * 40) * (0.4 - 0.6 * drop)
    model.add(sheet(xyz(x, scallops, folds)), "Red towel")
    put(model.mesh("Valance"), "on front -0.75 0.09 2.51")


def street(scene: Scene) -> None:
    """What the window shows: pavement, road, a row of brick houses with shops."""
    model = Model(scene, STREET)
    for i, x in enumerate(points("-10.5..10.5*13")[:, 0]):
        model.add(box((1.6, 0.1, 2.2)), ("Teal", "Ochre", "Green")[i // 2 % 3], (x, 13.04, 1.2))
        model.add(box((0.05, 0.16, 1.5)), "White", (x + 0.3 * (-1) ** i, 13.01, 1.35))
        trade = lettering(TRADES[i % 6], 0.02)
        model.add(trade, "Gilt", (x, 12.88, 2.75), (90, 0, 0), (0.24, 0.24, 1))
        for k, color in enumerate((("Green", "Red")[i // 2 % 2], "White")):  # the awning's stripes
            stripes = xyz(x + np.arange(k - 3, 4, 2) * 0.25, 12.6, 2.55)
            model.add(box((0.25, 1.0, 0.02)), color, stripes, (25, 0, 0))
    put(model.mesh("Street"), "room")
