"""What is sold and used: bottles, jars and tins, and the shelves that they stand on."""

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix
from numpy.random import Generator

from scenes.barbershop.plan import INKS, TAU, drawings, put
from scenes.library.points import Array, points, polar
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, mesh_shape

Goods = Sequence[bpy.types.Mesh]

GLASSES = ("Clear glass", "Amber glass", "Green glass", "Blue glass", "Yellow glass", "Red glass")
BOTTLES = {  # radius and height in decimetres
    "tonic": "0.30 0, 0.34 0.04, 0.34 1.2, 0.28 1.4, 0.11 1.55, 0.11 1.8, 0.13 1.85",
    "cologne": "0.36 0, 0.40 0.05, 0.40 0.8, 0.30 1.0, 0.10 1.05, 0.10 1.25, 0.12 1.3",
    "bay rum": "0.26 0, 0.30 0.05, 0.27 0.6, 0.32 1.3, 0.22 1.6, 0.09 1.75, 0.09 2.1, 0.11 2.15",
    "witch hazel": "0.38 0, 0.42 0.06, 0.42 1.5, 0.36 1.65, 0.15 1.75, 0.14 1.95, 0.17 2.0",
    "oil": "0.20 0, 0.24 0.04, 0.24 0.9, 0.12 1.05, 0.08 1.4, 0.10 1.45",
    "flask": "0.22 0, 0.44 0.1, 0.48 0.45, 0.36 0.8, 0.12 1.0, 0.09 1.5, 0.13 1.55",
}
TALC = """{body}: lathe 0.03 0, 0.034 0.006, 0.034 0.13, 0.02 0.155 scaled 1 0.65 1
    {label}: pipe 0.0345 0.04, 0.0345 0.1 scaled 1 0.65 1
    Brass: lathe 0.02 0, 0.022 0.014, 0.012 0.02 at 0 0 0.153"""
POTS = f"""
Talc 0 |
    {TALC.format(body="Cream", label="Red")}
Talc 1 |
    {TALC.format(body="Teal", label="Paper")}
Disinfectant jar |
    Disinfectant: lathe 0.042 0, 0.046 0.005, 0.046 0.16
    Chrome: lathe 0.048 0.1602, 0.048 0.172, 0.03 0.176
    Black: box 0.022 0.004 0.09 0.0015 at -0.015 0 0.205 turned -6 -8 0
    Oak: box 0.022 0.004 0.09 0.0015 at 0 0 0.205 turned 0 0 20
    Red: box 0.022 0.004 0.09 0.0015 at 0.015 0 0.205 turned 6 8 40
Spray bottle |
    Blue glass: lathe 0.034 0, 0.038 0.006, 0.038 0.10, 0.015 0.135, 0.015 0.15
    Black: box 0.022 0.07 0.024 0.006 2 at 0 0.016 0.165
    Red: bend 0.004, 0 0.02 0.155, 0 0.04 0.14, 0 0.038 0.115
Soap dish |
    Porcelain: lathe 0.03 0, 0.06 0.008, 0.064 0.014, 0.055 0.012, 0 0.008 scaled 1 0.75 1
    Soap: box 0.075 0.05 0.026 0.011 3 at 0 0 0.026 turned 0 0 12
Candle |
    Soap: lathe 0.03 0, 0.03 0.075, 0.022 0.078, 0.018 0.072, 0 0.07
    Black: tube 0.0012, 0 0 0.068, 0.001 0 0.084; Brass: lathe 0.05 0, 0.054 0.004, 0.04 0.006
Shaving mug |
    Porcelain: lathe 0.03 0, 0.04 0.01, 0.045 0.075, 0.041 0.075, 0.036 0.02, 0 0.015
    Navy: pipe 0.0435 0.035, 0.0446 0.055
    Porcelain: bend 0.005, 0.042 0 0.06, 0.07 0 0.06, 0.068 0 0.025, 0.038 0 0.018
    Ebony: lathe 0.009 0, 0.013 0.02, 0.009 0.05, 0.013 0.055 at 0.01 0 0.035 turned 0 24 0
    Bristle: lathe 0.011 0, 0.02 0.035, 0.012 0.05, 0 0.052 at 0.033 0 0.087 turned 0 24 0
"""
COTTON_JAR = """Steel: lathe 0.046 0, 0.046 0.003
    Pane: pipe 0.045 0.002, 0.05 0.008, 0.05 0.11, 0.044 0.12
    Chrome: lathe 0.047 0.12, 0.047 0.13, 0.012 0.14, 0.014 0.15, 0 0.155"""


def bottles(scene: Scene) -> Goods:
    """Glass bottles of six outlines in three colours each, with printed labels and stoppers."""
    made = []
    for i, (name, outline) in enumerate(BOTTLES.items()):
        profile = points(outline) * 0.1
        neck, top = profile[-1]
        radius, straight = max(profile[1, 0], profile[2, 0]) + 0.0008, profile[2, 1]
        closing = points("0.9 0.0005, 1.1 0.006, 1.1 0.018, 0.7 0.024") * (neck, 1)
        for variant in range(3):
            model, stopper = Model(scene), ("Brass", "Black", "Oak")[(i + variant) % 3]
            model.add(scene.lathe(profile, 28), GLASSES[(i + 2 * variant) % 6])
            model.add(scene.lathe(closing, 20), stopper, (0, 0, top))
            if variant == 1:
                model.add(scene.ball(neck * 1.3, 14), stopper, (0, 0, top + 0.03))
            if name != "flask":
                low, high, ink = 0.25 * straight, 0.85 * straight, INKS[(i + variant) % 6]
                model.add(band(scene, radius, low, high), "Paper")
                model.add(band(scene, radius + 0.0004, low + 0.008, low + 0.016), ink)
                stripe = 0.55 * high + 0.45 * low
                model.add(band(scene, radius + 0.0004, stripe, high - 0.008), ink)
            made.append(model.mesh(f"Bottle {name} {variant}"))
    return made


def band(scene: Scene, radius: float, low: float, high: float) -> Shape:
    """A label round a bottle."""
    return scene.lathe([(radius, low), (radius, high)], 28, capped=False)


def pots(scene: Scene) -> Goods:
    """Pomade tins, talc shakers, jars, a spray bottle, soap, a candle, a mug with its brush."""
    made = [Model(scene, parts).mesh(name) for name, _, parts in drawings(POTS)]
    cotton = Model(scene, COTTON_JAR)
    spots = scattered(scene.random("cotton"), scene.count(34, 5), 0.034, 0.018, 0.10)
    cotton.add(scene.ball(0.015, 10), "White", spots)
    made.append(cotton.mesh("Cotton jar"))
    for i, word in enumerate(("WAX", "CLAY", "BALM", "SOAP")):
        r, h = 0.034 + 0.006 * (i % 2), 0.03 + 0.012 * i
        tin = f"""{INKS[i]}: lathe {r} 0, {r} {h * 0.6}
            {("Gilt", "Steel")[i % 2]}: lathe {r + 0.001} {h * 0.6}, {r + 0.001} {h - 0.003}
                {r - 0.003} {h}, 0 {h}
            Black: word 0.016 0.0005 {word} at 0 0 {h}"""
        made.append(Model(scene, tin).mesh(f"Pomade tin {i}"))
    return made


def scattered(random: Generator, count: int, radius: float, low: float, high: float) -> Array:
    """Points (count, 3) evenly spread in an upright cylinder round the Z axis."""
    r, angle = radius * np.sqrt(random.uniform(size=count)), random.uniform(0, TAU, count)
    return polar(r, angle, random.uniform(low, high, count))


def shelf(scene: Scene, width: float, depth: float) -> bpy.types.Mesh:
    """A wooden board on two brass brackets, with a low rail; its top at z = 0, back at y = 0."""
    end, rail = width / 2 - 0.01, depth - 0.008
    parts = f"""Mahogany x: box {width} {depth} 0.02 0.005 at 0 {depth / 2} -0.01
        Brass: bend 0.006, 0 0.008 -0.12, 0 0.05 -0.09, 0 {depth * 0.5} -0.035
            0 {depth * 0.85} -0.024 at ±{end - 0.07} 0 0;
            box 0.02 0.008 0.13 at ±{end - 0.07} 0.004 -0.08;
            tube 0.004, -{end} {rail} 0.035, {end} {rail} 0.035;
            tube 0.003, 0 0 0, 0 0 0.035 at -{end}..{end}*4 {rail} 0"""
    return Model(scene, parts).mesh("Shelf board")


def stock(
    scene: Scene, random: Generator, goods: Goods, where: Matrix | str, width: float, depth: float
) -> None:
    """Stand goods side by side along x on z = 0 of a frame, in two rows where it is deep enough."""
    radii = [np.hypot(*mesh_shape(item).vertices[:, :2].T).max() for item in goods]
    for y in (depth * 0.72, depth * 0.28) if depth > 0.24 else (depth * 0.5,):
        x = 0.02 - width / 2
        while True:
            pick = random.integers(len(goods))
            if x + 2 * radii[pick] > width / 2 - 0.02:
                break
            turn = (0, 0, random.uniform(-25, 25))
            put(goods[pick], where, (x + radii[pick], y, 0), turn)
            gap = 2 * radii[pick] + random.uniform(0.006, 0.03)
            x += gap / min(1.0, scene.detail**0.5)
