"""Posters, certificates and magazines of our own design, printed in inks that lie on each other."""

from collections.abc import Callable

import bpy
import numpy as np

from scenes.barbershop.plan import HAIR, INKS, SIZES, Barbershop, hanging, put
from scenes.library.points import circle, evenly, lattice, points
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, prism, transform

Picture = Callable[[Model], None]
INK = 0.0005
"""Metres between the inks, so that no two faces coincide. In a print, z counts the inks."""

PRICES = (
    ("Haircut", "1.50"),
    ("Shave", "1.00"),
    ("Beard trim", "0.75"),
    ("Hot towel", "0.50"),
    ("Moustache", "0.40"),
    ("Shampoo", "0.60"),
    ("Children", "0.90"),
    ("The works", "3.50"),
)
TITLES = ("SHAVE", "GENT", "SPORT", "MOTOR", "JAZZ", "RADIO")
# handlebar, walrus, pencil, chevron, …: droop, curl, thickness
MOUSTACHES = [
    (0.10, 0.30, 0.16),
    (0.34, -0.18, 0.26),
    (0.06, 0.02, 0.06),
    (0.20, -0.05, 0.2),
    (0.02, 0.42, 0.12),
    (0.28, 0.1, 0.2),
]


def moustache(scene: Scene, kind: int) -> Shape:
    """A printed moustache, about 1 wide."""
    droop, curl, thick = points(MOUSTACHES)[kind % 6]
    x = np.linspace(-0.5, 0.5, 2 * scene.segments(24, 5) + 1)
    t = np.abs(x) * 2
    middle = -droop * t**1.3 + curl * np.maximum(t - 0.55, 0) ** 1.4 * 2
    half = thick * np.sqrt(np.maximum(1 - t**2.2, 0.002)) * (0.55 + 0.45 * np.minimum(t * 4, 1))
    lower = np.column_stack([x, middle - half / 2])
    upper = np.column_stack([x, middle + half / 2])
    return prism(np.concatenate([lower, upper[::-1]]), 0.6)


def part_disc(scene: Scene, radius: float, start: float = 0, stop: float = 180) -> Shape:
    """A printed part of a disc, between two angles in degrees."""
    return prism(circle(radius, scene.segments(48, 10), *np.radians((start, stop))), 0.6)


def masters(model: Model) -> None:
    """Rays, open scissors, and the shop's claim."""
    model.box(size=(0.56, 0.76, 0.6), material="Navy")
    model.lathe(profile=[(0.165, 0), (0.165, 0.6)], at=(0, 0.05, 2), material="Cream")
    model.word(
        letters="MASTER BARBERS", size=0.068, depth=0.6, at=(0, -0.27, 1.5), material="Cream"
    )
    model.word(letters="since 1927", size=0.045, depth=0.6, at=(0, -0.335, 1.5), material="Ochre")
    ray = prism([(0, 0), *circle(0.26, 2, 0, np.pi / 24)], 0.6)
    for k in range(24):
        model.add(ray, "Ochre", (0, 0.05, 1), (0, 0, 15 * k))
    _scissor_blade(model, z=3, side=1)
    _scissor_blade(model, z=4, side=-1)


def _scissor_blade(model: Model, z: float, side: int) -> None:
    """One half of open scissors; its grip is on the side, 1 right and -1 left."""
    turned = (0, 0, -22 * side)
    blade = [(-0.011, -0.013), (0.011, -0.013), (0.013, 0.022), (0, 0.136), (-0.007, 0.136)]
    model.prism(height=0.6, outline=blade, at=(0, 0, z), turned=turned, material="Red")
    model.box(size=(0.011, 0.04, 0.6), at=(0.0124 * side, -0.031, z), turned=turned, material="Red")
    model.pipe(
        profile=[(0.0286, 0.6), (0.0187, 0.6)], at=(0.0247 * side, -0.061, z), material="Red"
    )


def moustaches(model: Model) -> None:
    """Twelve moustaches to choose from."""
    model.box(size=(0.46, 0.66, 0.6), material="Cream")
    model.word(
        letters="THE GENTLEMEN'S CHOICE", size=0.036, depth=0.6, at=(0, 0.29, 1.5), material="Red"
    )
    for k, (x, y, _) in enumerate(lattice(x=evenly(-0.13, 0.13, 3), y=evenly(0.19, -0.185, 4))):
        ink = ("Black", "Brown hair")[k % 2]
        model.add(moustache(model.scene, k), ink, (x, y, 1), scale=(0.105, 0.13, 1))


def prices(model: Model) -> None:
    """The price list on a black board."""
    model.box(size=(0.66, 0.96, 0.6), material="Black")
    model.word(letters="PRICES", size=0.12, depth=0.6, at=(0, 0.39, 1.5), material="Cream")
    model.box(size=(0.5, 0.006, 0.6), at=(0, 0.32, 1), material="Gilt")
    model.box(
        size=(0.006, 0.006, 0.6),
        at=lattice(x=evenly(0.03, 0.14, 6), y=evenly(0.235, -0.374, 8), z=1),
        material="Gilt",
    )
    model.word(
        letters="no appointment needed", size=0.045, depth=0.6, at=(0, -0.43, 1.5), material="Red"
    )
    for k, (service, price) in enumerate(PRICES):
        y = 0.25 - 0.087 * k
        model.word(letters=service, size=0.06, depth=0.6, at=(-0.14, y, 1.5), material="Cream")
        model.word(letters=price, size=0.06, depth=0.6, at=(0.23, y, 1.5), material="Ochre")


def haircuts(model: Model) -> None:
    """Six heads with their haircuts."""
    model.box(size=(0.66, 0.46, 0.6), material="Teal")
    model.lathe(
        profile=[(0.078, 0), (0.078, 0.6)],
        at=lattice(x=evenly(-0.2, 0.2, 3), y=(0.06, -0.14), z=1),
        material="Cream",
    )
    model.lathe(
        profile=[(0.04, 0), (0.04, 0.6)],
        at=lattice(x=evenly(-0.2, 0.2, 3), y=(0.052, -0.148), z=2),
        scaled=(0.85, 1.2, 1),
        material="Skin",
    )
    model.lathe(
        profile=[(0.004, 0), (0.004, 0.6)],
        at=[
            *lattice(x=evenly(-0.213, 0.187, 3), y=(0.06, -0.14), z=3),
            *lattice(x=evenly(-0.187, 0.213, 3), y=(0.06, -0.14), z=3),
        ],
        material="Black",
    )
    model.word(
        letters="STYLES OF THE SEASON", size=0.045, depth=0.6, at=(0, 0.185, 1.5), material="Cream"
    )
    for k, (x, y, _) in enumerate(lattice(x=evenly(-0.2, 0.2, 3), y=(0.06, -0.14))):
        hair = part_disc(model.scene, 0.046, 10 - 10 * (k % 2), 170 + 6 * k)
        style = (0.95, 1.1 + 0.12 * (k % 3), 1)
        model.add(hair, HAIR[k % 3], (x, y + 0.008, 3), scale=style)
        shape = moustache(model.scene, k)
        model.add(shape, HAIR[k % 3], (x, y - 0.022, 3), scale=(0.036, 0.05, 1))


def pole(model: Model) -> None:
    """A barber's pole, and the price of a shave."""
    model.box(size=(0.36, 0.66, 0.6), material="Ochre")
    model.box(size=(0.12, 0.4, 0.6), at=(0, 0, 1), material="White")
    model.prism(
        height=0.6,
        outline=[(-0.06, -0.03), (0.06, 0.03), (0.06, 0.055), (-0.06, -0.005)],
        at=lattice(y=evenly(-0.165, 0.135, 4), z=2),
        material="Red",
    )
    model.prism(
        height=0.6,
        outline=[(-0.06, -0.03), (0.06, 0.03), (0.06, 0.055), (-0.06, -0.005)],
        at=lattice(y=evenly(-0.115, 0.085, 3), z=2),
        material="Blue",
    )
    model.lathe(
        profile=[(0.045, 0), (0.045, 0.6)], at=lattice(y=(-0.235, 0.235), z=2), material="Black"
    )
    model.box(size=(0.15, 0.03, 0.6), at=lattice(y=(-0.205, 0.205), z=3), material="Black")
    model.word(letters="SHAVE", size=0.042, depth=0.6, at=(-0.125, 0.29, 1.5), material="Black")
    model.word(letters="25 cents", size=0.036, depth=0.6, at=(0.105, -0.3, 1.5), material="Red")


def deco(model: Model) -> None:
    """An advertisement for brilliantine, with a rising sun."""
    model.box(size=(0.46, 0.66, 0.6), material="Red")
    model.word(letters="Brilliantine", size=0.075, depth=0.6, at=(0, -0.22, 1.5), material="Cream")
    model.word(
        letters="keeps every hair in its place",
        size=0.026,
        depth=0.6,
        at=(0, -0.28, 1.5),
        material="Cream",
    )
    for k in range(6):
        arch = part_disc(model.scene, 0.22 - 0.034 * k)
        model.add(arch, ("Ochre", "Navy")[k % 2], (0, -0.12, k + 1))
    ray = prism([(-0.004, 0.1), (0.004, 0.1), (0.012, 0.3), (-0.012, 0.3)], 0.6)
    for k in range(9):
        model.add(ray, "Cream", (0, -0.12, 1), (0, 0, 20 * k - 80))


def landscape(model: Model) -> None:
    """Hills before a red sun."""
    model.box(size=(0.58, 0.38, 0.6), material="Cream")
    model.lathe(profile=[(0.07, 0), (0.07, 0.6)], at=(0.12, 0.07, 1), material="Red")
    x = np.linspace(0.29, -0.29, model.scene.segments(48, 10))
    for k, color in enumerate(("Teal", "Green", "Navy")):
        ridge = 0.02 - 0.07 * k + 0.045 * np.sin(9 * x + 2 * k) + 0.02 * np.sin(23 * x + k)
        hills = [(0.29, -0.19), *zip(x, ridge, strict=True), (-0.29, -0.19)]
        model.add(prism(hills, 0.6), color, (0, 0, 2 + k))


def certificate(model: Model) -> None:
    """A certificate with a seal and a signature."""
    model.box(size=(0.4, 0.28, 0.6), material="Cream")
    model.box(size=(0.38, 0.26, 0.6), at=(0, 0, 1), material="Gilt")
    model.box(size=(0.36, 0.24, 0.6), at=(0, 0, 2), material="Cream")
    model.word(letters="Certificate", size=0.06, depth=0.6, at=(0, 0.075, 3.5), material="Black")
    model.box(size=(0.26, 0.004, 0.6), at=[(0, 0.02, 3), (0, -0.024, 3)], material="Black")
    model.box(size=(0.21, 0.004, 0.6), at=[(0, -0.002, 3), (0, -0.046, 3)], material="Black")
    model.lathe(profile=[(0.028, 0), (0.028, 0.6)], at=(0.12, -0.09, 3), material="Red")
    signature = moustache(model.scene, 4)
    model.add(signature, "Navy", (-0.1, -0.09, 3), scale=(0.1, 0.05, 1))


def portrait(model: Model) -> None:
    """A gentleman, in an oval."""
    model.lathe(profile=[(0.5, 0), (0.5, 0.6)], scaled=(0.24, 0.32, 1), material="Rug sand")
    model.lathe(
        profile=[(0.05, 0), (0.05, 0.6)], at=(0, 0, 2), scaled=(0.85, 1.15, 1), material="Skin"
    )
    scene = model.scene
    hair = "Brown hair"
    model.add(part_disc(scene, 0.1), "Black", (0, -0.15, 1), scale=(1, 0.9, 1))
    model.add(part_disc(scene, 0.05), hair, (0, 0.03, 3), scale=(0.95, 0.9, 1))
    model.add(moustache(scene, 0), hair, (0, -0.018, 4), scale=(0.07, 0.07, 1))


PICTURES: tuple[tuple[Picture, str, str], ...] = (  # the print, its name, the frame's material
    (masters, "masters", "Ebony"),
    (moustaches, "moustaches", "Gilt"),
    (prices, "prices", "Oak"),
    (haircuts, "haircuts", "Ebony"),
    (pole, "pole", "Mahogany"),
    (deco, "deco", "Gilt"),
    (landscape, "landscape", "Gilt"),
    (certificate, "certificate", "Ebony"),
    (portrait, "portrait", "Gilt"),
)


def printed(model: Model, surface: float) -> Model:
    """The model with the inks as layers on a surface at that height."""
    thin = transform((0, 0, surface), scale=(1, 1, INK))
    model.parts = [part.transformed(thin) for part in model.parts]
    return model


def _frame(model: Model, border: str, size: tuple[float, float]) -> None:
    """The print's paper and frame."""
    model.box(size=(*size, 0.01), at=(0, 0, 0.006), material="Paper")
    model.frame(
        size=size,
        profile=[
            (-0.006, 0.011),
            (-0.006, 0.018),
            (0.006, 0.024),
            (0.022, 0.026),
            (0.03, 0.018),
            (0.03, 0),
        ],
        material=border,
    )


def pictures(scene: Scene[Barbershop]) -> None:
    """The framed prints on the walls."""
    meshes = {}
    for picture, name, border in PICTURES:
        model = Model(scene)
        picture(model)
        printed(model, 0.011)
        _frame(model, border, SIZES[name])
        meshes[name] = model.mesh(f"Picture {name}")
    for name, wall, along, z in scene.plan.prints:
        put(meshes[name], hanging(wall, along=along, away=0.001, z=z, room=scene.plan.room))


def magazine(scene: Scene, number: int) -> bpy.types.Mesh:
    """A magazine whose cover is a composition of its own."""
    cover = ("Ochre", "Paper", "Cream")[number % 3]
    model = Model(scene)
    model.box(size=(0.2, 0.27, 12), bevel=0.0012, at=(0, 0, -6), material="Paper")
    model.box(size=(0.199, 0.269, 0.6), material=cover)
    model.box(size=(0.199, 0.06, 0.6), at=(0, 0.1, 1), material=INKS[number])
    model.word(letters=TITLES[number], size=0.06, depth=0.6, at=(0, 0.1, 1.5), material="White")
    model.lathe(
        profile=[(0.065, 0), (0.065, 0.6)], at=(0, -0.02, 1), material=INKS[(number + 2) % 6]
    )
    model.box(size=(0.07, 0.006, 0.6), at=lattice(x=-0.05, y=(-0.09, -0.11), z=1), material="Black")
    model.box(size=(0.05, 0.006, 0.6), at=lattice(x=-0.05, y=(-0.1, -0.12), z=1), material="Black")
    model.add(part_disc(scene, 0.04), "Skin", (0, -0.03, 2))
    return printed(model, 0.006).mesh(f"Magazine {number}")
