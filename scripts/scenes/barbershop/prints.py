"""Posters, certificates and magazines of our own design, printed in inks that lie on each other."""

import bpy
import numpy as np

from scenes.barbershop.plan import HAIR, INKS, drawings, hanging, put
from scenes.library.points import circle, points
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, prism, transform

INK = 0.0005
"""Metres between the inks, so that no two faces coincide. In what is printed z counts the inks."""

FRAME = """Paper: box {size} 0.01 at 0 0 0.006
    {border}: frame {size}, -0.006 0.011, -0.006 0.018, 0.006 0.024, 0.022 0.026, 0.03 0.018
        0.03 0"""
HUNG = """masters right -0.45 1.68, moustaches right 0.25 1.62, landscape right 0.25 2.24
    deco right 0.88 1.66, certificate right -0.45 2.36, portrait right 0.88 2.28
    pole right 1.72 2.18, portrait right 1.35 1.50, certificate right 2.25 2.45
    haircuts right -1.65 2.45, pole right -3.35 1.75, portrait right -2.75 1.5
    landscape right -2.8 1.98, certificate right -2.75 2.42, deco right 3.2 1.9
    prices back 0.45 1.68, haircuts back 0.45 2.55, moustaches back -2.27 1.7
    landscape back -1.52 2.48, certificate back -2.25 2.35, portrait back -0.35 2.55
    certificate front 2.25 1.55, portrait front 2.25 1.95, portrait front -2.3 1.5
    pole front -2.28 2.15, certificate front 2.25 2.35"""  # picture, wall, along, height
PICTURES = """
masters | Ebony 0.6 0.8
    Navy: box 0.56 0.76 0.6
    Cream: lathe 0.165 0, 0.165 0.6 at 0 0.05 2; word 0.068 0.6 MASTER BARBERS at 0 -0.27 1.5
    Ochre: word 0.045 0.6 since 1927 at 0 -0.335 1.5
moustaches | Gilt 0.5 0.7
    Cream: box 0.46 0.66 0.6; Red: word 0.036 0.6 THE GENTLEMEN'S CHOICE at 0 0.29 1.5
prices | Oak 0.7 1.0
    Black: box 0.66 0.96 0.6; Cream: word 0.12 0.6 PRICES at 0 0.39 1.5
    Gilt: box 0.5 0.006 0.6 at 0 0.32 1; box 0.006 0.006 0.6 at 0.03..0.14*6 0.235..-0.374*8 1
    Red: word 0.045 0.6 no appointment needed at 0 -0.43 1.5
haircuts | Ebony 0.7 0.5
    Teal: box 0.66 0.46 0.6; Cream: lathe 0.078 0, 0.078 0.6 at -0.2..0.2*3 0.06..-0.14*2 1
    Skin: lathe 0.04 0, 0.04 0.6 at -0.2..0.2*3 0.052..-0.148*2 2 scaled 0.85 1.2 1
    Black: lathe 0.004 0, 0.004 0.6 at -0.213..0.187*3 0.06..-0.14*2 3
        -0.187..0.213*3 0.06..-0.14*2 3
    Cream: word 0.045 0.6 STYLES OF THE SEASON at 0 0.185 1.5
pole | Mahogany 0.4 0.7
    Ochre: box 0.36 0.66 0.6; White: box 0.12 0.4 0.6 at 0 0 1
    Red: prism 0.6, -0.06 -0.03, 0.06 0.03, 0.06 0.055, -0.06 -0.005 at 0 -0.165..0.135*4 2
    Blue: prism 0.6, -0.06 -0.03, 0.06 0.03, 0.06 0.055, -0.06 -0.005 at 0 -0.115..0.085*3 2
    Black: lathe 0.045 0, 0.045 0.6 at 0 ±0.235 2; box 0.15 0.03 0.6 at 0 ±0.205 3;
        word 0.042 0.6 SHAVE at -0.125 0.29 1.5; Red: word 0.036 0.6 25 cents at 0.105 -0.30 1.5
deco | Gilt 0.5 0.7
    Red: box 0.46 0.66 0.6
    Cream: word 0.075 0.6 Brilliantine at 0 -0.22 1.5;
        word 0.026 0.6 keeps every hair in its place at 0 -0.28 1.5
landscape | Gilt 0.62 0.42
    Cream: box 0.58 0.38 0.6; Red: lathe 0.07 0, 0.07 0.6 at 0.12 0.07 1
certificate | Ebony 0.44 0.32
    Cream: box 0.40 0.28 0.6; Gilt: box 0.38 0.26 0.6 at 0 0 1; Cream: box 0.36 0.24 0.6 at 0 0 2
    Black: word 0.06 0.6 Certificate at 0 0.075 3.5; box 0.26 0.004 0.6 at 0 0.02 3, 0 -0.024 3;
        box 0.21 0.004 0.6 at 0 -0.002 3, 0 -0.046 3; Red: lathe 0.028 0, 0.028 0.6 at 0.12 -0.09 3
portrait | Gilt 0.26 0.34
    Rug sand: lathe 0.5 0, 0.5 0.6 scaled 0.24 0.32 1
    Skin: lathe 0.05 0, 0.05 0.6 at 0 0 2 scaled 0.85 1.15 1
"""
PRICES = """Haircut 1.50, Shave 1.00, Beard trim 0.75, Hot towel 0.50, Moustache 0.40, Shampoo 0.60,
    Children 0.90, The works 3.50"""
MAGAZINE = """Paper: box 0.20 0.27 12 0.0012 at 0 0 -6; {cover}: box 0.199 0.269 0.6
    {ink}: box 0.199 0.06 0.6 at 0 0.1 1
    White: word 0.06 0.6 {title} at 0 0.1 1.5; {disc}: lathe 0.065 0, 0.065 0.6 at 0 -0.02 1
    Black: box 0.07 0.006 0.6 at -0.05 -0.09..-0.11*2 1;
        box 0.05 0.006 0.6 at -0.05 -0.10..-0.12*2 1"""
TITLES = ("SHAVE", "GENT", "SPORT", "MOTOR", "JAZZ", "RADIO")
MOUSTACHES = """0.10 0.30 0.16, 0.34 -0.18 0.26, 0.06 0.02 0.06, 0.20 -0.05 0.2, 0.02 0.42 0.12
    0.28 0.1 0.2"""  # handlebar, walrus, pencil, chevron, …: droop, curl, thickness


def moustache(scene: Scene, kind: int) -> Shape:
    """A printed moustache, about 1 wide."""
    droop, curl, thick = points(MOUSTACHES)[kind % 6]
    x = np.linspace(-0.5, 0.5, 2 * scene.segments(24, 5) + 1)
    t = np.abs(x) * 2
    middle = -droop * t**1.3 + curl * np.maximum(t - 0.55, 0) ** 1.4 * 2
    half = thick * np.sqrt(np.maximum(1 - t**2.2, 0.002)) * (0.55 + 0.45 * np.minimum(t * 4, 1))
    lower, upper = np.column_stack([x, middle - half / 2]), np.column_stack([x, middle + half / 2])
    return prism(np.concatenate([lower, upper[::-1]]), 0.6)


def part_disc(scene: Scene, radius: float, start: float = 0, stop: float = 180) -> Shape:
    """A printed part of a disc, between two angles in degrees."""
    return prism(circle(radius, scene.segments(48, 10), *np.radians((start, stop))), 0.6)


def masters(model: Model) -> None:
    """Rays, and open scissors."""
    ray = prism([(0, 0), *circle(0.26, 2, 0, np.pi / 24)], 0.6)
    for k in range(24):
        model.add(ray, "Ochre", (0, 0.05, 1), (0, 0, 15 * k))
    scissors = """Red: prism 0.6, -0.011 -0.013, 0.011 -0.013, 0.013 0.022, 0 0.136, -0.007 0.136
        at 0 0 {z} turned 0 0 {turn}; box 0.011 0.04 0.6 at {x} -0.031 {z} turned 0 0 {turn};
        pipe 0.0286 0.6, 0.0187 0.6 at {grip} -0.061 {z}"""
    model.draw(scissors.format(turn=-22, z=3, x=0.0124, grip=0.0247))
    model.draw(scissors.format(turn=22, z=4, x=-0.0124, grip=-0.0247))


def moustaches(model: Model) -> None:
    for k, (x, y) in enumerate(points("-0.13..0.13*3 0.19..-0.185*4")):
        ink = ("Black", "Brown hair")[k % 2]
        model.add(moustache(model.scene, k), ink, (x, y, 1), scale=(0.105, 0.13, 1))


def prices(model: Model) -> None:
    for k, row in enumerate(PRICES.split(",")):
        (service, price), y = row.strip().rsplit(maxsplit=1), 0.25 - 0.087 * k
        model.draw(f"Cream: word 0.06 0.6 {service} at -0.14 {y} 1.5")
        model.draw(f"Ochre: word 0.06 0.6 {price} at 0.23 {y} 1.5")


def haircuts(model: Model) -> None:
    for k, (x, y) in enumerate(points("-0.2..0.2*3 0.06..-0.14*2")):
        hair = part_disc(model.scene, 0.046, 10 - 10 * (k % 2), 170 + 6 * k)
        style = (0.95, 1.1 + 0.12 * (k % 3), 1)
        model.add(hair, HAIR[k % 3], (x, y + 0.008, 3), scale=style)
        shape = moustache(model.scene, k)
        model.add(shape, HAIR[k % 3], (x, y - 0.022, 3), scale=(0.036, 0.05, 1))


def deco(model: Model) -> None:
    for k in range(6):
        arch = part_disc(model.scene, 0.22 - 0.034 * k)
        model.add(arch, ("Ochre", "Navy")[k % 2], (0, -0.12, k + 1))
    ray = prism("-0.004 0.1, 0.004 0.1, 0.012 0.3, -0.012 0.3", 0.6)
    for k in range(9):
        model.add(ray, "Cream", (0, -0.12, 1), (0, 0, 20 * k - 80))


def landscape(model: Model) -> None:
    x = np.linspace(0.29, -0.29, model.scene.segments(48, 10))
    for k, color in enumerate(("Teal", "Green", "Navy")):
        ridge = 0.02 - 0.07 * k + 0.045 * np.sin(9 * x + 2 * k) + 0.02 * np.sin(23 * x + k)
        hills = [(0.29, -0.19), *zip(x, ridge, strict=True), (-0.29, -0.19)]
        model.add(prism(hills, 0.6), color, (0, 0, 2 + k))


def certificate(model: Model) -> None:
    signature = moustache(model.scene, 4)
    model.add(signature, "Navy", (-0.1, -0.09, 3), scale=(0.1, 0.05, 1))


def portrait(model: Model) -> None:
    scene, hair = model.scene, "Brown hair"
    model.add(part_disc(scene, 0.1), "Black", (0, -0.15, 1), scale=(1, 0.9, 1))
    model.add(part_disc(scene, 0.05), hair, (0, 0.03, 3), scale=(0.95, 0.9, 1))
    model.add(moustache(scene, 0), hair, (0, -0.018, 4), scale=(0.07, 0.07, 1))


DETAILS = (masters, moustaches, prices, haircuts, deco, landscape, certificate, portrait)
"""What is on the pictures of the same names besides what their text draws."""


def printed(model: Model, surface: float) -> Model:
    """The model with the inks as layers on a surface at that height."""
    thin = transform((0, 0, surface), scale=(1, 1, INK))
    model.parts = [part.transformed(thin) for part in model.parts]
    return model


def pictures(scene: Scene) -> None:
    """The framed prints, hung where the walls were bare."""
    made = {}
    for name, look, parts in drawings(PICTURES):
        model, (border, *size) = Model(scene, parts), look.split()
        for draw in DETAILS:
            if draw.__name__ == name:
                draw(model)
        printed(model, 0.011).draw(FRAME.format(border=border, size=" ".join(size)))
        made[name] = model.mesh(f"Picture {name}")
    for row in HUNG.replace("\n", ",").split(","):
        name, side, along, z = row.split()
        put(made[name], hanging(side, along=float(along), away=0.001, z=float(z)))


def magazine(scene: Scene, number: int) -> bpy.types.Mesh:
    """A magazine whose cover is a composition of its own."""
    look = {"cover": ("Ochre", "Paper", "Cream")[number % 3], "title": TITLES[number]}
    inks = {"ink": INKS[number], "disc": INKS[(number + 2) % 6]}
    model = Model(scene, MAGAZINE.format(**look, **inks))
    model.add(part_disc(scene, 0.04), "Skin", (0, -0.03, 2))
    return printed(model, 0.006).mesh(f"Magazine {number}")
