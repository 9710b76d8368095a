"""Bottles, jars, tins and tools, and the shelves that they stand on."""

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix
from numpy.random import Generator

from scenes.barbershop.plan import INKS, TAU, put
from scenes.library.points import Array, evenly, lattice, mirrored, polar
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, mesh_shape

Goods = Sequence[bpy.types.Mesh]

BOTTLES = {  # radius and height in decimetres
    "tonic": [
        (0.3, 0),
        (0.34, 0.04),
        (0.34, 1.2),
        (0.28, 1.4),
        (0.11, 1.55),
        (0.11, 1.8),
        (0.13, 1.85),
    ],
    "cologne": [
        (0.36, 0),
        (0.4, 0.05),
        (0.4, 0.8),
        (0.3, 1.0),
        (0.1, 1.05),
        (0.1, 1.25),
        (0.12, 1.3),
    ],
    "bay rum": [
        (0.26, 0),
        (0.3, 0.05),
        (0.27, 0.6),
        (0.32, 1.3),
        (0.22, 1.6),
        (0.09, 1.75),
        (0.09, 2.1),
        (0.11, 2.15),
    ],
    "witch hazel": [
        (0.38, 0),
        (0.42, 0.06),
        (0.42, 1.5),
        (0.36, 1.65),
        (0.15, 1.75),
        (0.14, 1.95),
        (0.17, 2.0),
    ],
    "oil": [(0.2, 0), (0.24, 0.04), (0.24, 0.9), (0.12, 1.05), (0.08, 1.4), (0.1, 1.45)],
    "flask": [
        (0.22, 0),
        (0.44, 0.1),
        (0.48, 0.45),
        (0.36, 0.8),
        (0.12, 1.0),
        (0.09, 1.5),
        (0.13, 1.55),
    ],
}
GLASSES = ("Clear glass", "Amber glass", "Green glass", "Blue glass", "Yellow glass", "Red glass")


def bottles(scene: Scene) -> Goods:
    """Glass bottles of six outlines in three colours each, with printed labels and stoppers."""
    made = []
    for i, (name, outline) in enumerate(BOTTLES.items()):
        profile = np.array(outline) * 0.1
        neck, top = profile[-1]
        radius = max(profile[1, 0], profile[2, 0]) + 0.0008
        straight = profile[2, 1]
        closing = np.array([(0.9, 0.0005), (1.1, 0.006), (1.1, 0.018), (0.7, 0.024)]) * (neck, 1)
        for variant in range(3):
            model = Model(scene)
            stopper = ("Brass", "Black", "Oak")[(i + variant) % 3]
            model.add(scene.lathe(profile, 28), GLASSES[(i + 2 * variant) % 6])
            model.add(scene.lathe(closing, 20), stopper, (0, 0, top))
            if variant == 1:
                model.add(scene.ball(neck * 1.3, 14), stopper, (0, 0, top + 0.03))
            if name != "flask":
                low = 0.25 * straight
                high = 0.85 * straight
                ink = INKS[(i + variant) % 6]
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
    return [
        talc(scene, "Talc 0", body="Cream", label="Red"),
        talc(scene, "Talc 1", body="Teal", label="Paper"),
        disinfectant_jar(scene),
        spray_bottle(scene),
        soap_dish(scene),
        candle(scene),
        shaving_mug(scene),
        cotton_jar(scene),
        *(
            pomade_tin(scene, number, word)
            for number, word in enumerate(("WAX", "CLAY", "BALM", "SOAP"))
        ),
    ]


def talc(scene: Scene, name: str, body: str, label: str) -> bpy.types.Mesh:
    """An oval tin of talc; body and label are materials."""
    tin = Model(scene)
    tin.lathe(
        profile=[(0.03, 0), (0.034, 0.006), (0.034, 0.13), (0.02, 0.155)],
        scaled=(1, 0.65, 1),
        material=body,
    )
    tin.pipe(profile=[(0.0345, 0.04), (0.0345, 0.1)], scaled=(1, 0.65, 1), material=label)
    tin.lathe(
        profile=[(0.02, 0), (0.022, 0.014), (0.012, 0.02)], at=(0, 0, 0.153), material="Brass"
    )
    return tin.mesh(name)


def disinfectant_jar(scene: Scene) -> bpy.types.Mesh:
    """Combs in a jar of blue disinfectant."""
    jar = Model(scene)
    jar.lathe(profile=[(0.042, 0), (0.046, 0.005), (0.046, 0.16)], material="Disinfectant")
    jar.lathe(profile=[(0.048, 0.1602), (0.048, 0.172), (0.03, 0.176)], material="Chrome")
    jar.box(
        size=(0.022, 0.004, 0.09),
        bevel=0.0015,
        at=(-0.015, 0, 0.205),
        turned=(-6, -8, 0),
        material="Black",
    )
    jar.box(
        size=(0.022, 0.004, 0.09), bevel=0.0015, at=(0, 0, 0.205), turned=(0, 0, 20), material="Oak"
    )
    jar.box(
        size=(0.022, 0.004, 0.09),
        bevel=0.0015,
        at=(0.015, 0, 0.205),
        turned=(6, 8, 40),
        material="Red",
    )
    return jar.mesh("Disinfectant jar")


def spray_bottle(scene: Scene) -> bpy.types.Mesh:
    """A bottle with a trigger."""
    bottle = Model(scene)
    bottle.lathe(
        profile=[(0.034, 0), (0.038, 0.006), (0.038, 0.1), (0.015, 0.135), (0.015, 0.15)],
        material="Blue glass",
    )
    bottle.box(
        size=(0.022, 0.07, 0.024), bevel=0.006, segments=2, at=(0, 0.016, 0.165), material="Black"
    )
    bottle.bend(
        radius=0.004, path=[(0, 0.02, 0.155), (0, 0.04, 0.14), (0, 0.038, 0.115)], material="Red"
    )
    return bottle.mesh("Spray bottle")


def soap_dish(scene: Scene) -> bpy.types.Mesh:
    """A cake of soap in a dish."""
    dish = Model(scene)
    dish.lathe(
        profile=[(0.03, 0), (0.06, 0.008), (0.064, 0.014), (0.055, 0.012), (0, 0.008)],
        scaled=(1, 0.75, 1),
        material="Porcelain",
    )
    dish.box(
        size=(0.075, 0.05, 0.026),
        bevel=0.011,
        segments=3,
        at=(0, 0, 0.026),
        turned=(0, 0, 12),
        material="Soap",
    )
    return dish.mesh("Soap dish")


def candle(scene: Scene) -> bpy.types.Mesh:
    """A candle on a brass saucer."""
    model = Model(scene)
    model.lathe(
        profile=[(0.03, 0), (0.03, 0.075), (0.022, 0.078), (0.018, 0.072), (0, 0.07)],
        material="Soap",
    )
    model.tube(radius=0.0012, path=[(0, 0, 0.068), (0.001, 0, 0.084)], material="Black")
    model.lathe(profile=[(0.05, 0), (0.054, 0.004), (0.04, 0.006)], material="Brass")
    return model.mesh("Candle")


def shaving_mug(scene: Scene) -> bpy.types.Mesh:
    """A mug with a band, and the brush in it."""
    mug = Model(scene)
    mug.lathe(
        profile=[
            (0.03, 0),
            (0.04, 0.01),
            (0.045, 0.075),
            (0.041, 0.075),
            (0.036, 0.02),
            (0, 0.015),
        ],
        material="Porcelain",
    )
    mug.pipe(profile=[(0.0435, 0.035), (0.0446, 0.055)], material="Navy")
    mug.bend(
        radius=0.005,
        path=[(0.042, 0, 0.06), (0.07, 0, 0.06), (0.068, 0, 0.025), (0.038, 0, 0.018)],
        material="Porcelain",
    )
    mug.lathe(
        profile=[(0.009, 0), (0.013, 0.02), (0.009, 0.05), (0.013, 0.055)],
        at=(0.01, 0, 0.035),
        turned=(0, 24, 0),
        material="Ebony",
    )
    mug.lathe(
        profile=[(0.011, 0), (0.02, 0.035), (0.012, 0.05), (0, 0.052)],
        at=(0.033, 0, 0.087),
        turned=(0, 24, 0),
        material="Bristle",
    )
    return mug.mesh("Shaving mug")


def cotton_jar(scene: Scene) -> bpy.types.Mesh:
    """A glass jar of cotton balls."""
    jar = Model(scene)
    jar.lathe(profile=[(0.046, 0), (0.046, 0.003)], material="Steel")
    jar.pipe(profile=[(0.045, 0.002), (0.05, 0.008), (0.05, 0.11), (0.044, 0.12)], material="Pane")
    jar.lathe(
        profile=[(0.047, 0.12), (0.047, 0.13), (0.012, 0.14), (0.014, 0.15), (0, 0.155)],
        material="Chrome",
    )
    spots = scattered(scene.random("cotton"), scene.count(34, 5), 0.034, 0.018, 0.10)
    jar.add(scene.ball(0.015, 10), "White", spots)
    return jar.mesh("Cotton jar")


def pomade_tin(scene: Scene, number: int, word: str) -> bpy.types.Mesh:
    """A round tin with a word on its lid."""
    radius = 0.034 + 0.006 * (number % 2)
    height = 0.03 + 0.012 * number
    seam = height * 0.6
    lid = [
        (radius + 0.001, seam),
        (radius + 0.001, height - 0.003),
        (radius - 0.003, height),
        (0, height),
    ]
    tin = Model(scene)
    tin.lathe(profile=[(radius, 0), (radius, seam)], material=INKS[number])
    tin.lathe(profile=lid, material=("Gilt", "Steel")[number % 2])
    tin.word(letters=word, size=0.016, depth=0.0005, at=(0, 0, height), material="Black")
    return tin.mesh(f"Pomade tin {number}")


def scattered(random: Generator, count: int, radius: float, low: float, high: float) -> Array:
    """Points (count, 3) evenly spread in an upright cylinder round the Z axis."""
    r = radius * np.sqrt(random.uniform(size=count))
    angle = random.uniform(0, TAU, count)
    return polar(r, angle, random.uniform(low, high, count))


def shelf(scene: Scene, width: float, depth: float) -> bpy.types.Mesh:
    """A wooden board on two brass brackets, with a low rail; its top at z = 0, back at y = 0."""
    end = width / 2 - 0.01
    rail = depth - 0.008
    bracket = [
        (0, 0.008, -0.12),
        (0, 0.05, -0.09),
        (0, depth * 0.5, -0.035),
        (0, depth * 0.85, -0.024),
    ]
    board = Model(scene)
    board.box(
        size=(width, depth, 0.02), bevel=0.005, at=(0, depth / 2, -0.01), material="Mahogany x"
    )
    board.bend(radius=0.006, path=bracket, at=mirrored(x=end - 0.07), material="Brass")
    board.box(
        size=(0.02, 0.008, 0.13), at=mirrored(x=end - 0.07, y=0.004, z=-0.08), material="Brass"
    )
    board.tube(radius=0.004, path=[(-end, rail, 0.035), (end, rail, 0.035)], material="Brass")
    board.tube(
        radius=0.003,
        path=[(0, 0, 0), (0, 0, 0.035)],
        at=lattice(x=evenly(-end, end, 4), y=rail),
        material="Brass",
    )
    return board.mesh("Shelf board")


def stock(
    scene: Scene, random: Generator, goods: Goods, where: Matrix, width: float, depth: float
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
