"""The room: its floor with mosaic, rug and hair, walls, panels, friezes, ceiling and beams."""

import bpy
import numpy as np
from mathutils import Matrix
from numpy.random import Generator

from scenes.barbershop.plan import (
    HAIR,
    HALF_X,
    HALF_Y,
    ROOM,
    STATIONS,
    TAU,
    against,
    hanging,
    put,
    standing,
)
from scenes.library.architecture import blocks, frame
from scenes.library.points import circle, evenly, lattice, mirrored, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, grid, lettering, prism, tube

TILE = 0.3125
MOSAIC_HEIGHT = 0.0015
GREEN = ["Green glaze 0", "Green glaze 1", "Green glaze 2"]
CREAM = ["Cream glaze 0", "Cream glaze 1", "Cream glaze 2"]
MOSAIC_RINGS = (  # inner and outer radius, glazes
    (0.74, 0.79, GREEN),
    (0.68, 0.735, CREAM),
    (0.47, 0.515, CREAM),
    (0.42, 0.465, GREEN),
    (0.36, 0.415, ["Red", "Ochre"]),
)
PETAL = [(0.03, 0), (0.03, 0.0005)]  # of a palmette, before it is narrowed


def walls(scene: Scene) -> None:
    """The walls round the window and the doors, and the ceiling."""
    model = Model(scene)
    model.box(size=(0.15, 7.8, 3), at=(2.575, 0, 1.5), material="Wallpaper")
    model.box(size=(5, 0.15, 3), at=(0, -3.825, 1.5), material="Wallpaper")
    model.box(size=(0.15, 7.8, 3), at=(-2.575, 0, 1.5), material="Plaster")
    model.box(
        size=(0.45, 0.15, 3), at=[(-2.275, 3.825, 1.5), (0.775, 3.825, 1.5)], material="Plaster"
    )
    model.box(size=(2.6, 0.15, 1), at=(-0.75, 3.825, 0.5), material="Plaster")
    model.box(size=(2.6, 0.15, 0.55), at=(-0.75, 3.825, 2.725), material="Plaster")
    model.box(size=(0.95, 0.15, 0.55), at=(1.475, 3.825, 2.725), material="Plaster")
    model.box(size=(0.55, 0.15, 3), at=(2.225, 3.825, 1.5), material="Plaster")
    model.box(size=(5.3, 7.8, 0.1), at=(0, 0, 3.051), material="Plaster")
    put(model.mesh(name="Walls"), where=standing())


def wall_lettering(scene: Scene) -> None:
    """The shop's services, over the mirrors."""
    lettering = Model(scene)
    lettering.word(
        letters="HAIRCUTS  ·  HOT TOWELS  ·  SHAVES", size=0.18, depth=0.018, material="Gilt"
    )
    put(lettering.mesh(name="Wall lettering"), where=hanging("left", away=0.01, z=2.545))


def grout(scene: Scene) -> None:
    """The bed of the left wall's tiles, with two black strips."""
    model = Model(scene)
    model.box(size=(7.5, 0.004, 2.3), at=(0, 0.002, 1.15), material="Grout")
    model.box(
        size=(7.5, 0.02, 0.022),
        bevel=0.008,
        segments=2,
        at=lattice(y=0.01, z=(1.1, 2.3)),
        material="Black tile",
    )
    put(model.mesh(name="Grout"), where=against("left"))


def beam(scene: Scene) -> None:
    """Five beams with small brackets."""
    model = Model(scene)
    model.box(size=(5, 0.15, 0.14), bevel=0.012, segments=2, material="Mahogany x")
    model.box(
        size=(0.12, 0.016, 0.05),
        bevel=0.005,
        at=lattice(x=evenly(-2.25, 2.25, 10), y=(-0.083, 0.083), z=0.04),
        material="Mahogany x",
    )
    put(model.mesh(name="Beam"), where=[standing(y=y, z=2.93) for y in evenly(-3, 3, 5)])


def picture_rail(scene: Scene) -> None:
    rail = Model(scene)
    rail.frame(
        size=(5, 7.5),
        profile=[(0, 0), (-0.03, 0), (-0.038, 0.012), (-0.03, 0.035), (0, 0.045)],
        material="Mahogany",
    )
    put(rail.mesh(name="Picture rail"), where=standing(z=2.675))


def palmette(scene: Scene) -> None:
    """A frieze of palmettes round the room."""
    model = Model(scene)
    model.lathe(
        profile=PETAL,
        at=(-0.0329, -0.018, 0),
        turned=(0, 0, 70),
        scaled=(0.37, 1, 1),
        material="Green",
    )
    model.lathe(
        profile=PETAL,
        at=(-0.0201, -0.0013, 0),
        turned=(0, 0, 35),
        scaled=(0.37, 1, 1),
        material="Red",
    )
    model.lathe(profile=PETAL, at=(0, 0.005, 0), scaled=(0.37, 1, 1), material="Green")
    model.lathe(
        profile=PETAL,
        at=(0.0201, -0.0013, 0),
        turned=(0, 0, -35),
        scaled=(0.37, 1, 1),
        material="Red",
    )
    model.lathe(
        profile=PETAL,
        at=(0.0329, -0.018, 0),
        turned=(0, 0, -70),
        scaled=(0.37, 1, 1),
        material="Green",
    )
    model.lathe(profile=[(0.012, 0), (0.012, 0.001)], at=(0, -0.03, 0), material="Ochre")
    model.bend(
        radius=0.003,
        path=[
            (0, -0.045, 0),
            (0.05, -0.055, 0),
            (0.085, -0.03, 0),
            (0.075, 0, 0),
            (0.055, -0.005, 0),
            (0.06, -0.022, 0),
        ],
        material="Ochre",
    )
    model.bend(
        radius=0.003,
        path=[
            (0, -0.045, 0),
            (-0.05, -0.055, 0),
            (-0.085, -0.03, 0),
            (-0.075, 0, 0),
            (-0.055, -0.005, 0),
            (-0.06, -0.022, 0),
        ],
        material="Ochre",
    )
    put(model.mesh(name="Palmette"), where=_frieze())


def _frieze() -> list[Matrix]:
    """Frames side by side below the ceiling, on all four walls."""
    height = 2.765
    away = 0.001
    sides = [
        hanging(wall, along=y, away=away, z=height)
        for wall in ("left", "right")
        for y in evenly(-3.646, 3.646, 36)
    ]
    ends = [
        hanging(wall, along=x, away=away, z=height)
        for wall in ("front", "back")
        for x in evenly(-2.396, 2.396, 24)
    ]
    return [*sides, *ends]


def entrance_mat(scene: Scene) -> None:
    """A mat that says welcome."""
    mat = Model(scene)
    mat.box(size=(0.9, 0.55, 0.014), bevel=0.005, at=(0, 0, 0.007), material="Bristle")
    mat.box(size=(0.84, 0.49, 0.004), bevel=0.001, at=(0, 0, 0.0145), material="Rug navy")
    mat.word(
        letters="WELCOME",
        size=0.17,
        depth=0.0005,
        at=(0, 0, 0.0168),
        turned=(0, 0, 180),
        material="Rug sand",
    )
    put(mat.mesh(name="Entrance mat"), where=against("front", along=1.475, away=0.42))


def floor_drain(scene: Scene) -> None:
    """A drain with holes."""
    drain = Model(scene)
    drain.lathe(profile=[(0.07, 0), (0.068, 0.003), (0, 0.003)], material="Brass")
    drain.lathe(
        profile=[(0.006, 0), (0.006, 0.0006)],
        at=[
            *mirrored(x=0.045, z=0.003),
            *lattice(x=(-0.039, 0.039), y=(-0.0225, 0.0225), z=0.003),
            *lattice(x=(-0.0225, 0.0225), y=(-0.039, 0.039), z=0.003),
            *lattice(y=(-0.045, 0.045), z=0.003),
        ],
        material="Black",
    )
    put(drain.mesh(name="Floor drain"), where=standing(x=-0.62, y=-2.5))


def tiles(scene: Scene) -> None:
    """Bevelled cream and black tiles over a bed of grout."""
    model = Model(scene)
    model.box(size=(5, 7.5, 0.05), at=(0, 0, -0.028), material="Grout")
    i, j = np.indices((round(ROOM[0] / TILE), round(ROOM[1] / TILE)))
    centers = xyz((i + 0.5) * TILE - HALF_X, (j + 0.5) * TILE - HALF_Y, -0.01)
    for k, material in enumerate(("Cream tile", "Black tile")):
        size = (TILE - 0.004, TILE - 0.004, 0.02)
        model.add(blocks(centers[(i + j) % 2 == k], size, 0.003), material)
    put(model.mesh("Floor"), where=standing())


def medallion(scene: Scene) -> None:
    """An inlaid mosaic in the middle of the floor: rings of stones, a star, and the shop's name."""
    random = scene.random("medallion")
    model = Model(scene)
    _mosaic_bed(model)
    _mosaic_stones(scene, model, random)
    text = "BARBER SHOP  ·  EST. 1927  ·  "
    for k, letter in enumerate(text):
        turn = -360 * k / len(text)
        if letter != " ":
            at = polar(0.595, np.radians(turn + 90), MOSAIC_HEIGHT + 0.0004)
            model.add(lettering(letter, 0.0005), "Brass", at, (0, 0, turn), (0.13, 0.13, 1))
    for k, (reach, top) in enumerate(((0.34, 0.0031), (0.24, 0.0023))):
        outwards = polar(1, (np.arange(8) + k / 2) * TAU / 8)
        for side, material in ((1, "Ochre"), (-1, "Navy")):
            ray = prism([(0, 0), (0.05 * side, 0.28 * reach), (0, reach)][::side], top)
            model.add(copies(ray, 0 * outwards, forward=outwards), material)
    put(model.mesh("Floor medallion"), where=standing())


def _mosaic_bed(model: Model) -> None:
    """The discs below and between the stones, and the brass boss with its letter."""
    model.lathe(profile=[(0.8, 0), (0.8, 0.0005)], material="Grout")
    model.pipe(profile=[(0.675, 0), (0.675, 0.0015), (0.52, 0.0015)], material="Black tile")
    model.lathe(profile=[(0.355, 0), (0.355, 0.0015)], material="Cream")
    model.lathe(profile=[(0.07, 0), (0.07, 0.0039)], material="Brass")
    model.word(letters="B", size=0.12, depth=0.0005, at=(0, 0, 0.0043), material="Black tile")


def _mosaic_stones(scene: Scene, model: Model, random: Generator) -> None:
    """Rings of stones, their glazes mixed."""
    for inner, outer, glazes in MOSAIC_RINGS:
        count = scene.segments(TAU * outer / 0.05, 12)
        arc = circle(1.0, 3, -0.93 * np.pi / count, 0.93 * np.pi / count)
        stone = prism(np.concatenate([arc * outer, arc[::-1] * inner]), MOSAIC_HEIGHT)
        glaze = random.integers(len(glazes), size=count)
        for i, material in enumerate(glazes):
            outwards = polar(1, np.flatnonzero(glaze == i) * TAU / count)
            model.add(copies(stone, 0 * outwards, forward=outwards), material)


def rug(scene: Scene) -> None:
    """A bordered rug with lozenges and a fringe, below the low table."""
    model = Model(scene)
    random = scene.random("rug")
    _rug_pattern(model)
    for end in lattice(x=evenly(-0.38, 0.38, scene.segments(60, 8)), y=(-0.975, 0.975), z=0.0025):
        model.add(box((0.006, 0.06, 0.003)), "Rug sand", end, (0, 0, random.uniform(-12, 12)))
    put(model.mesh("Rug"), where=standing(x=1.24, y=0.15))


def _rug_pattern(rug: Model) -> None:
    """Borders inside each other, and lozenges in a row."""
    rug.box(size=(0.78, 1.9, 0.004), bevel=0.001, at=(0, 0, 0.002), material="Rug red")
    rug.box(size=(0.7, 1.82, 0.004), bevel=0.001, at=(0, 0, 0.0032), material="Rug sand")
    rug.box(size=(0.64, 1.76, 0.004), bevel=0.001, at=(0, 0, 0.0044), material="Rug navy")
    rug.box(size=(0.5, 1.62, 0.004), bevel=0.001, at=(0, 0, 0.0056), material="Rug red")
    rug.box(
        size=(0.2, 0.2, 0.0015),
        at=lattice(y=evenly(-0.6, 0.6, 3), z=0.0078),
        turned=(0, 0, 45),
        material="Rug navy",
    )
    rug.box(
        size=(0.2, 0.2, 0.0015),
        at=lattice(y=(-0.3, 0.3), z=0.0078),
        turned=(0, 0, 45),
        material="Rug sand",
    )
    rug.box(
        size=(0.1, 0.1, 0.0015),
        at=lattice(y=evenly(-0.6, 0.6, 3), z=0.0088),
        turned=(0, 0, 45),
        material="Rug sand",
    )
    rug.box(
        size=(0.1, 0.1, 0.0015),
        at=lattice(y=(-0.3, 0.3), z=0.0088),
        turned=(0, 0, 45),
        material="Rug navy",
    )


def hair_clippings(scene: Scene) -> None:
    """Cut hair on the floor round the chairs, as small tufts that are placed many times."""
    random = scene.random("hair clippings")
    for hair, y in zip(HAIR, STATIONS, strict=True):
        model = Model(scene)
        for _ in range(scene.count(60, 6)):
            bow = random.uniform(0.004, 0.014)
            half = random.uniform(0.008, 0.022)
            curve = np.array([(-1, 0, 0), (-0.33, 0.7, 3), (0.5, 1, 3), (1, 0, 1)])
            path = curve * (half, bow, 0.0004)
            strand = tube(path, (0.0003, 0.0006, 0.0006, 0.0002), 3)
            at = (*random.normal(0, 0.05, 2), 0.0012)
            turn = (0, 0, random.uniform(0, 360))
            model.add(strand, hair, at, turn)
        tuft = model.mesh(f"Clippings {hair.lower()}")
        around = standing(x=-1.4, y=y, z=0.001)
        for _ in range(scene.count(26, 2)):
            at = polar(random.uniform(0.62, 0.85), random.uniform(0, TAU))
            turn = (0, 0, random.uniform(0, 360))
            size = random.uniform(0.7, 1.3)
            put(tuft, around, at, turn, size)


def metro_tiles(scene: Scene) -> None:
    """Glazed tiles in running bond over the left wall, green below and cream above."""
    random = scene.random("tiles")
    model = Model(scene)
    width = 0.2
    height = 0.1
    gap = 0.003
    green_rows = 11
    row, column = np.indices((23, int(ROOM[1] / width) + 2)).reshape(2, -1)
    left = (column - (row % 2) / 2) * width - HALF_Y
    x0, x1 = np.clip([left, left + width], -HALF_Y, HALF_Y)
    centers = xyz((x0 + x1) / 2, 0.006, (row + 0.5) * height)
    sizes = xyz(x1 - x0 - gap, 0.012, height - gap)
    glaze = random.integers(3, size=len(row))
    for k in range(6):
        is_green = k < 3
        of_glaze = (glaze == k % 3) & ((row < green_rows) == is_green) & (x1 - x0 > 0.02)
        material = f"{'Green' if is_green else 'Cream'} glaze {k % 3}"
        model.add(blocks(centers[of_glaze], sizes[of_glaze], 0.004), material)
    put(model.mesh(name="Metro tiles"), where=against("left"))


def _wainscot_panel(scene: Scene) -> bpy.types.Mesh:
    """One panel, 0.6 m wide, with its chair rail."""
    panel = Model(scene)
    panel.box(size=(0.6, 0.018, 1), at=(0, 0.009, 0.5), material="Mahogany")
    panel.box(size=(0.6, 0.035, 0.14), bevel=0.006, at=(0, 0.0175, 0.07), material="Mahogany")
    panel.box(
        size=(0.07, 0.03, 0.86),
        bevel=0.004,
        at=mirrored(x=0.265, y=0.015, z=0.5),
        material="Mahogany",
    )
    panel.box(size=(0.46, 0.028, 0.08), bevel=0.004, at=(0, 0.014, 0.18), material="Mahogany")
    panel.box(size=(0.46, 0.028, 0.09), bevel=0.004, at=(0, 0.014, 0.91), material="Mahogany")
    panel.box(size=(0.31, 0.018, 0.49), at=(0, 0.012, 0.543), material="Mahogany")
    panel.frame(
        size=(0.42, 0.6),
        profile=[(-0.06, 0.02), (-0.02, 0.032), (0, 0.034), (0.012, 0.026), (0.02, 0.018)],
        at=(0, 0, 0.543),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    panel.prism(
        height=0.6,
        outline=[(0, 0), (0.05, 0), (0.05, 0.02), (0.038, 0.032), (0.02, 0.045), (0, 0.05)],
        at=(-0.3, 0, 0.97),
        turned=(90, 0, 90),
        material="Mahogany",
    )
    return panel.mesh(name="Wainscot")


def wainscot(scene: Scene) -> None:
    """Raised mahogany panels below a chair rail, on three walls."""
    panel = _wainscot_panel(scene)
    size = 0.6
    for wall, start, stop in (
        ("right", -HALF_Y, HALF_Y),
        ("back", -HALF_X, -2.04),
        ("back", -1.01, HALF_X),
        ("front", -HALF_X, 0.91),
        ("front", 2.04, HALF_X),
    ):
        count = round((stop - start) / size)
        width = (stop - start) / count
        for i in range(count):
            put(panel, against(wall, along=start + (i + 0.5) * width), scale=(width / size, 1, 1))


def ceiling(scene: Scene) -> None:
    """Pressed tin tiles, and a cornice."""
    u = np.linspace(-1, 1, scene.segments(32, 6) + 1)
    v = u[:, None]
    square = np.maximum(np.abs(u), np.abs(v))
    r = np.hypot(u, v)
    petals = 0.5 + 0.5 * np.cos(8 * np.arctan2(v, u))
    relief = (
        0.020 * np.exp(-(((square - 0.92) / 0.05) ** 2))
        + 0.012 * np.exp(-(((square - 0.74) / 0.04) ** 2))
        + 0.022 * np.exp(-(((r - 0.42) / 0.14) ** 2)) * petals
        + 0.030 * np.exp(-((r / 0.13) ** 2))
    )
    tile = scene.mesh("Tin tile", grid(u / 4, u / 4, relief), "Tin")
    put(
        tile,
        [standing(x=x, y=y, z=3) for x in evenly(-2.25, 2.25, 10) for y in evenly(-3.5, 3.5, 15)],
        degrees=(180, 0, 0),
    )
    cornice = Model(scene)
    t = np.linspace(0, np.pi / 2, scene.segments(8))
    cove = np.column_stack([-0.13 + 0.09 * np.sin(t), 0.035 + 0.10 * (1 - np.cos(t))])
    profile = [(-0.15, 0), (-0.15, 0.03), *cove, (-0.03, 0.16), (0, 0.16)]
    cornice.add(frame(ROOM[0], ROOM[1], profile), "Cream", (0, 0, ROOM[2]), (180, 0, 0))
    put(cornice.mesh("Cornice"), where=standing())
