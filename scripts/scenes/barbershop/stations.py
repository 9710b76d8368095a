"""The barbers' stations along the left wall: cabinets, mirrors, basins, tools, and goods."""

import bpy
import numpy as np

from scenes.barbershop.cloth import folded_towel, rolled_towel
from scenes.barbershop.goods import Goods, shelf, stock
from scenes.barbershop.plan import COUNTER_TOP, STATIONS, TOWELS, drawings, put, spots
from scenes.library.points import circle, points, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, prism, sheet, transform, tube

BLADE = "prism 0.0018, -0.005 -0.01, 0.006 -0.01, 0.007 0.02, 0.001 0.10, -0.002 0.10"
TOOLS = f"""
Scissors |
    Steel: {BLADE} at 0 0 0.002 turned 0 0 -11; {BLADE} at 0 0 0.004 turned 0 0 11;
        tube 0.003, 0 -0.008 0.004, 0.016 -0.05 0.004;
        tube 0.003, 0 -0.008 0.004, -0.016 -0.05 0.004; ring 0.014 0.003 at ±0.02 -0.064 0.004
    Brass: lathe 0.004 0, 0.004 0.007, 0 0.0075
Razor |
    Ebony: box 0.014 0.14 0.008 0.003 at 0 0 0.004
    Chrome: prism 0.0025, 0 0, 0.02 0.004, 0.02 0.075, 0.004 0.08, 0 0.07
        at 0.003 0.068 0.003 turned 0 0 -55
    Brass: lathe 0.004 0, 0.004 0.010, 0 0.011 at 0 0.062 0
Hair dryer |
    Chrome: lathe 0.02 -0.07, 0.038 -0.05, 0.04 0.02, 0.026 0.05, 0.024 0.13
        0.028 0.135 at 0 0 0.041 turned 90 0 0
    Black: box 0.12 0.034 0.03 0.012 3 at 0.085 0.02 0.036 turned 0 4 -10
    Red: ring 0.03 0.003 at 0 -0.02 0.041 turned 90 0 0
"""
CLIPPERS = """Black: box 0.048 0.14 0.036 0.014 3 at 0 0 0.019
    Steel: box 0.044 0.03 0.006 at 0 0.082 0.026 turned 20 0 0;
        box 0.0015 0.012 0.003 at -0.02..0.02*14 0.101 0.032 turned 20 0 0
    Gilt: box 0.03 0.06 0.003 0.001 at 0 -0.005 0.037"""
PANEL = "-0.05 0.004, -0.03 0.018, 0 0.02, 0.015 0.006, 0.02 0"  # round a cabinet's panel
KNOB = "Brass: lathe 0.008 0, 0.008 0.014, 0.017 0.02, 0.014 0.03, 0 0.032"
CABINET = """Mahogany: box 0.64 0.41 0.73 at 0 0.205 0.455;
        box 0.05 0.02 0.73 0.006 at ±0.32 0.41 0.455; Ebony: box 0.64 0.35 0.09 at 0 0.175 0.045
    """
STATION = f"""
Counter drawers | left -2.88..2.24*5
    {CABINET}
    Mahogany: frame 0.50 0.11, {PANEL} at 0 0.41 0.18..0.705*4 turned 90 0 180
    {KNOB} at ±0.15 0.412 0.18..0.705*4 turned -90 0 0
Counter doors | left -2.24..2.88*5
    {CABINET}
    Mahogany: frame 0.23 0.60, {PANEL} at ±0.15 0.41 0.45 turned 90 0 180
    {KNOB} at ±0.0375 0.412 0.55 turned -90 0 0
Counter top | left 0 0 0.86
    Marble: box 6.44 0.44 0.04 0.012 3 at 0 0.22 -0.02; box 6.44 0.022 0.09 0.006 at 0 0.023 0.045
Bulb strip | on left -2.625..1.375*3 0.012 1.62, on left -1.375..2.625*3 0.012 1.62
    Brass: box 0.07 1.1 0.03 0.008 2 at 0 0 0.015;
        lathe 0.028 0, 0.024 0.016, 0.018 0.02 at 0 -0.42..0.42*4 0.03
    Bulb: ball 0.036 at 0 -0.42..0.42*4 0.075
Mirror tube | on left -2..2*3 0 2.41
    Chrome: box 0.98 0.07 0.05 0.012 2 at 0 0 0.025
    Lamp tube: tube 0.019, -0.46 0 0.075, 0.46 0 0.075
    Chrome: tube 0.026, -0.02 0 0, 0.02 0 0 at ±0.47 0 0.075; box 0.03 0.04 0.06 at ±0.47 0 0.05
Basin | left -2..2*3 0.24 0.86
    Porcelain: lathe 0.09 0, 0.14 0.02, 0.185 0.08, 0.20 0.13, 0.205 0.14, 0.19 0.135, 0.17 0.08
        0.12 0.03, 0.02 0.02, 0 0.02 scaled 1.15 0.85 1
    Chrome: lathe 0.026 0.021, 0.026 0.026, 0 0.026
Tap | left -2..2*3 0.06 0.86
    Chrome: lathe 0.028 0, 0.028 0.012, 0.014 0.03;
        bend 0.011, 0 0 0.02, 0 0 0.2, 0 0.03 0.26, 0 0.09 0.27, 0 0.13 0.22;
        lathe 0.018 0, 0.01 0.02, 0.01 0.05, 0 0.052 at ±0.07 0 0;
        tube 0.006, -0.026 0 0.045, 0.026 0 0.045 at ±0.07 0 0;
        tube 0.006, 0 -0.026 0.045, 0 0.026 0.045 at ±0.07 0 0
Tool mat | left -2.44..1.56*3 0.26 0.86
    White towel: box 0.30 0.20 0.006 0.002 at 0 0 0.003
Towel rail | left ±1 0.43 0.72
    Brass: bend 0.007, -0.18 0 0, -0.18 0.06 0, -0.16 0.07 0, 0 0.07 0, 0.16 0.07 0, 0.18 0.06 0
        0.18 0 0
"""
MIRROR = """Mirror: plane 0.92 1.1 at 0 0 0.026
    Gilt: frame 0.92 1.1, -0.006 0.02, -0.006 0.034, 0.008 0.04, 0.03 0.03, 0.06 0.05, 0.085 0.05
        0.095 0.03, 0.095 0; ball 0.04 at 0 0.675 0.04 scaled 1 1 0.5"""


def comb(scene: Scene, material: str) -> bpy.types.Mesh:
    """A comb with fine teeth on one half and coarse ones on the other."""
    model = Model(scene, f"{material}: box 0.17 0.01 0.004 0.0015 at 0 0.012 0.002")
    x = np.linspace(-0.083, 0.083, scene.count(46, 8))
    x = np.concatenate([x[: len(x) // 2], x[len(x) // 2 :: 2]])
    model.add(box((0.0018, 0.024, 0.0026)), material, xyz(x, -0.004, 0.002))
    return model.mesh(f"Comb {material.lower()}")


def hair_brush(scene: Scene) -> bpy.types.Mesh:
    """A round-backed brush, its bristles up."""
    model = Model(scene, "Oak: box 0.055 0.10 0.014 0.006 3 at 0 0.05 0.007")
    handle = scene.tube("0 0 0.007, 0 -0.04 0.007, 0 -0.10 0.007", (0.007, 0.010, 0.007), 12)
    model.add(handle, "Oak")
    columns, rows = scene.segments(6, 2), scene.segments(11, 3)
    roots = points(f"-0.02..0.02*{columns} 0.01..0.09*{rows} 0.013")
    upwards = roots * (6.7, 0, 0) + xyz(0, 0, 1)
    hairs = copies(tube("0 0 0, 0 0.015 0", 0.0016, 4), roots, forward=upwards, up=(0, 1, 0))
    model.add(hairs, "Bristle")
    return model.mesh("Hair brush")


def mirrors(scene: Scene) -> None:
    """A mirror at each station in a gilt frame with beads, a crest and scrolls."""
    model = Model(scene, MIRROR)
    bead, count = scene.ball(0.008, 8), scene.segments(44)
    model.add(bead, "Gilt", f"-0.46..0.46*{count} ±0.58 0.034")
    model.add(bead, "Gilt", f"±0.49 -0.55..0.55*{count} 0.034")
    crest = circle(0.2, scene.segments(24, 8), np.radians(20), np.radians(160)) * (1.6, 0.6)
    model.add(prism(crest, 0.03), "Gilt", (0, 0.595, 0.012))
    k = np.arange(12)
    spiral = (1 - 0.075 * k)[:, None] * polar(1, 0.7 * k) * (0.055, 0.04, 1)
    spiral += xyz(0.10, 0.67, 0.045)
    for side in (-1, 1):
        model.add(scene.bend(spiral * (side, 1, 1), 0.008, 30), "Gilt")
    put(model.mesh("Station mirror"), "on left -2..2*3 0.012 1.62")


def station_goods(scene: Scene, bottles: Goods, pots: Goods) -> None:
    """The tools, bottles and pots of the three stations."""
    random = scene.random("station goods")
    tools = {name: Model(scene, parts).mesh(name) for name, _, parts in drawings(TOOLS)}
    model, s = Model(scene, CLIPPERS), np.linspace(0, 1, scene.segments(140, 16))
    cord = xyz(0.012 * np.cos(70 * s) + 0.1 * s, -0.08 - 0.13 * s, 0.014 + 0.01 * np.sin(70 * s))
    model.add(scene.tube(cord, 0.0022, 5), "Black")
    clippers = model.mesh("Clippers")
    kit = [tools["Scissors"], comb(scene, "Black"), comb(scene, "Oak"), hair_brush(scene)]
    kit += [tools["Razor"], tools["Scissors"]]
    for y in STATIONS:
        where = spots(f"left {y} 0 {COUNTER_TOP}")[0]
        for k, tool in enumerate(kit):
            put(tool, where, (0.33 + 0.045 * k, 0.26, 0.0065), (0, 0, random.uniform(-7, 7)))
        put(clippers, where, (-0.36, 0.27, 0), (0, 0, random.uniform(-15, 15)))
        put(tools["Hair dryer"], where, (-0.52, 0.28, 0), (0, 0, random.uniform(60, 85)))
        for x, some in ((-0.42, bottles[:9]), (0.42, bottles[9:])):
            strip = where @ transform((x, 0.04, 0))
            stock(scene, random, [*pots, *some], strip, 0.42, 0.14)


def racks(scene: Scene, bottles: Goods, pots: Goods) -> None:
    """The shelves between the mirrors, with pots and towels below them, and towels over rails."""
    random, board = scene.random("racks"), shelf(scene, 0.56, 0.14)
    folded = [folded_towel(scene, towel) for towel in TOWELS]
    rolled = [rolled_towel(scene, towel) for towel in TOWELS[:2]]
    for y in (-3, -1, 1, 3):
        for z, goods in ((1.24, 1), (1.58, 1), (1.92, 1), (2.26, 0)):
            rack = f"left {y} 0.012 {z}"
            put(board, rack)
            stock(scene, random, [*bottles, *pots] if goods else bottles, rack, 0.54, 0.125)
        side = f"left {y} 0.04 {COUNTER_TOP}"
        stock(scene, random, pots, side, 0.72, 0.14)
        for k in range(3):
            turn = (0, 0, random.uniform(-4, 4))
            put(folded[(k + y) % 4], side, (-0.22, 0.26, 0.045 * k), turn)
        for k, (x, z) in enumerate(((0.13, 0), (0.225, 0), (0.1775, 0.076))):
            put(rolled[k % 2], side, (x, 0.26, z))
    x = np.linspace(-0.16, 0.16, scene.segments(28, 6))
    s = np.linspace(0.46, -0.36, scene.segments(48, 10))[:, None]
    bow = np.clip(s / 0.022, -np.pi / 2, np.pi / 2)
    y = 0.022 * np.sin(bow) + 0.016 * np.sin(38 * x + 2) * np.abs(s) / 0.4
    draped = sheet(xyz(x, y, 0.022 * np.cos(bow) - np.maximum(np.abs(s) - 0.0345, 0)))
    for along, color in ((-1, "red"), (1, "blue")):
        towel = scene.mesh(f"Draped {color} towel", draped, f"{color.capitalize()} towel")
        put(towel, f"left {along} 0.5 0.706")
