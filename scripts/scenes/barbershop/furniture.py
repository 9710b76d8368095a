"""The low table with its magazines, and cabinets, cupboard and trolley full of goods."""

from numpy.random import Generator

from scenes.barbershop.cloth import folded_towel
from scenes.barbershop.goods import Goods, shelf, stock
from scenes.barbershop.plan import against, put, standing
from scenes.barbershop.prints import magazine
from scenes.barbershop.stations import PANEL
from scenes.library.points import evenly, lattice, mirrored
from scenes.library.scene import Model, Scene
from scenes.library.shapes import transform

LOW_TABLE = standing(x=1.24, y=0.15, z=0.008)
TROLLEY = standing(x=-1.55, y=-3.2, z=0.003, turned=-20)


def low_table(scene: Scene) -> None:
    """A table with a lower board, before the bench."""
    table = Model(scene)
    table.box(size=(0.42, 0.9, 0.03), bevel=0.01, segments=2, at=(0, 0, 0.415), material="Mahogany")
    table.box(size=(0.34, 0.82, 0.06), bevel=0.004, at=(0, 0, 0.37), material="Mahogany")
    table.box(size=(0.32, 0.78, 0.016), bevel=0.004, at=(0, 0, 0.13), material="Mahogany")
    table.lathe(
        profile=[
            (0.014, 0.004),
            (0.02, 0.03),
            (0.016, 0.1),
            (0.026, 0.13),
            (0.018, 0.2),
            (0.027, 0.3),
            (0.02, 0.35),
            (0.024, 0.4),
        ],
        at=lattice(x=(-0.16, 0.16), y=(-0.39, 0.39)),
        material="Mahogany",
    )
    put(table.mesh(name="Low table"), where=LOW_TABLE)


def ashtray(scene: Scene) -> None:
    model = Model(scene)
    model.lathe(
        profile=[
            (0.05, 0),
            (0.065, 0.004),
            (0.07, 0.035),
            (0.062, 0.04),
            (0.054, 0.034),
            (0.045, 0.012),
            (0, 0.01),
        ],
        material="Amber glass",
    )
    put(model.mesh(name="Ashtray"), where=standing(x=1.29, y=0.48, z=0.4385))


def trolley(scene: Scene) -> None:
    """Three trays on wheels."""
    model = Model(scene)
    model.tube(
        radius=0.009,
        path=[(0, 0, 0.06), (0, 0, 0.8)],
        at=lattice(x=(-0.23, 0.23), y=(-0.16, 0.16)),
        material="Chrome",
    )
    model.ball(
        radius=0.013, at=lattice(x=(-0.23, 0.23), y=(-0.16, 0.16), z=0.805), material="Chrome"
    )
    model.lathe(
        profile=[(0.028, -0.009), (0.03, 0), (0.028, 0.009)],
        at=lattice(x=(-0.23, 0.23), y=(-0.16, 0.16), z=0.03),
        turned=(90, 0, 30),
        material="Rubber",
    )
    model.box(
        size=(0.46, 0.32, 0.012),
        bevel=0.003,
        at=[(0, 0, 0.2), (0, 0, 0.48), (0, 0, 0.74)],
        material="Cream",
    )
    model.frame(
        size=(0.44, 0.3),
        profile=[(0, 0), (0, 0.035), (0.006, 0.035), (0.006, 0)],
        at=[(0, 0, 0.2), (0, 0, 0.48), (0, 0, 0.74)],
        material="Chrome",
    )
    put(model.mesh(name="Trolley"), where=TROLLEY)


def display_cabinet(scene: Scene) -> None:
    """A cupboard with glass doors above it."""
    cabinet = Model(scene)
    cabinet.box(size=(0.9, 0.36, 0.5), bevel=0.006, at=(0, 0.18, 0.25), material="Mahogany")
    cabinet.box(size=(0.9, 0.02, 1.5), at=(0, 0.01, 1.25), material="Mahogany")
    cabinet.box(size=(0.024, 0.36, 1.5), at=mirrored(x=0.438, y=0.18, z=1.25), material="Mahogany")
    cabinet.box(
        size=(0.96, 0.39, 0.05), bevel=0.015, segments=2, at=(0, 0.18, 2.025), material="Mahogany"
    )
    cabinet.box(size=(0.93, 0.38, 0.03), bevel=0.008, at=(0, 0.18, 0.5), material="Mahogany")
    cabinet.frame(
        size=(0.3, 0.32),
        profile=PANEL,
        at=mirrored(x=0.215, y=0.36, z=0.25),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    cabinet.frame(
        size=(0.35, 1.37),
        profile=[(0, -0.012), (0, 0.01), (0.04, 0.01), (0.04, -0.012)],
        at=mirrored(x=0.215, y=0.35, z=1.255),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    cabinet.plane(
        size=(0.35, 1.37),
        at=mirrored(x=0.215, y=0.35, z=1.255),
        turned=(90, 0, 180),
        material="Pane",
    )
    cabinet.ball(
        radius=0.012,
        at=[*mirrored(x=0.035, y=0.372, z=1.1), *mirrored(x=0.035, y=0.388, z=0.3)],
        material="Brass",
    )
    cabinet.box(
        size=(0.85, 0.31, 0.012),
        at=[(0, 0.17, 0.884), (0, 0.17, 1.254), (0, 0.17, 1.624)],
        material="Oak",
    )
    put(cabinet.mesh(name="Display cabinet"), where=against("right", along=-1.65, away=0.035))


def hat_box(scene: Scene) -> None:
    """Two hat boxes on the display cabinet."""
    model = Model(scene)
    model.lathe(profile=[(0.15, 0), (0.15, 0.14)], material="Teal")
    model.lathe(profile=[(0.155, 0.1), (0.155, 0.142), (0.15, 0.146)], material="Cream")
    model.box(size=(0.316, 0.02, 0.002), at=(0, 0, 0.147), material="Red")
    put(
        model.mesh(name="Hat box"),
        where=[
            against("right", along=-1.85, away=0.22, z=2.05),
            against("right", along=-1.85, away=0.22, z=2.196, turned=30),
        ],
    )


def back_cupboard(scene: Scene) -> None:
    """A low cupboard with four doors below the shelves."""
    cupboard = Model(scene)
    cupboard.box(size=(1.4, 0.3, 0.8), bevel=0.006, at=(0, 0.19, 0.42), material="Oak")
    cupboard.box(size=(1.44, 0.34, 0.03), bevel=0.008, at=(0, 0.2, 0.835), material="Mahogany")
    cupboard.frame(
        size=(0.25, 0.6),
        profile=PANEL,
        at=lattice(x=evenly(-0.525, 0.525, 4), y=0.34, z=0.42),
        turned=(90, 0, 180),
        material="Oak",
    )
    cupboard.ball(
        radius=0.013, at=lattice(x=evenly(-0.415, 0.635, 4), y=0.365, z=0.55), material="Brass"
    )
    put(cupboard.mesh(name="Back cupboard"), where=against("back", along=1.68))


def radio(scene: Scene) -> None:
    """A radio with a round top."""
    model = Model(scene)
    model.prism(
        height=0.16,
        outline=[
            (0.17, 0),
            (0.17, 0.14),
            (0.16, 0.184),
            (0.137, 0.215),
            (0.1, 0.243),
            (0.05, 0.262),
            (0, 0.2675),
            (-0.05, 0.262),
            (-0.1, 0.243),
            (-0.137, 0.215),
            (-0.16, 0.184),
            (-0.17, 0.14),
            (-0.17, 0),
        ],
        at=(0, 0.08, 0),
        turned=(90, 0, 0),
        material="Mahogany",
    )
    model.lathe(
        profile=[(0.1, 0), (0.1, 0.004)],
        at=(0, 0.0805, 0.155),
        turned=(-90, 0, 0),
        material="Bristle",
    )
    model.box(
        size=(0.008, 0.006, 0.12),
        bevel=0.002,
        at=mirrored(x=0.08, y=0.086, z=0.155),
        material="Mahogany",
    )
    model.box(
        size=(0.008, 0.006, 0.183),
        bevel=0.002,
        at=mirrored(x=0.04, y=0.086, z=0.155),
        material="Mahogany",
    )
    model.box(size=(0.008, 0.006, 0.2), bevel=0.002, at=(0, 0.086, 0.155), material="Mahogany")
    model.lathe(
        profile=[(0.018, 0), (0.016, 0.018), (0, 0.019)],
        at=lattice(x=evenly(-0.1, 0.1, 3), y=0.08, z=0.032),
        turned=(-90, 0, 0),
        material="Cream",
    )
    put(model.mesh(name="Radio"), where=against("back", along=2.08, away=0.19, z=0.85, turned=-8))


def towel_steamer(scene: Scene) -> None:
    """A box that keeps towels hot."""
    steamer = Model(scene)
    steamer.box(size=(0.38, 0.22, 0.3), bevel=0.025, segments=3, at=(0, 0, 0.16), material="Cream")
    steamer.box(size=(0.3, 0.01, 0.22), bevel=0.004, at=(0, 0.112, 0.17), material="Chrome")
    steamer.box(size=(0.26, 0.01, 0.18), bevel=0.004, at=(0, 0.116, 0.17), material="Cream")
    steamer.bend(
        radius=0.007,
        path=[(-0.11, 0.12, 0.11), (-0.11, 0.145, 0.12), (-0.11, 0.145, 0.22), (-0.11, 0.12, 0.23)],
        material="Chrome",
    )
    steamer.lathe(
        profile=[(0.026, 0), (0.026, 0.008), (0, 0.01)],
        at=(0.08, 0.12, 0.2),
        turned=(-90, 0, 0),
        material="White",
    )
    steamer.word(
        letters="HOT",
        size=0.05,
        depth=0.0005,
        at=(0.02, 0.1225, 0.12),
        turned=(90, 0, 180),
        material="Red",
    )
    steamer.lathe(
        profile=[(0.015, 0), (0.02, 0.015)],
        at=lattice(x=(-0.15, 0.15), y=(-0.05, 0.05)),
        material="Rubber",
    )
    put(steamer.mesh(name="Towel steamer"), where=against("back", along=1.33, away=0.19, z=0.85))


def magazines(scene: Scene) -> None:
    """Magazines fanned on the low table, and piles of them on its lower board."""
    random = scene.random("magazines")
    issues = [magazine(scene, i) for i in range(6)]
    for k in range(scene.segments(7, 2)):
        at = (-0.02 + 0.015 * k, -0.28 + 0.055 * k, 0.4255 + 0.0062 * k)
        put(issues[k % 6], LOW_TABLE, at, (0, 0, -100 + 13 * k))
    for k in range(scene.segments(12, 2)):
        at = (0, 0.18 * (k % 2 * 2 - 1), 0.1335 + 0.0062 * (k // 2))
        put(issues[(k * 5 + 1) % 6], LOW_TABLE, at, (0, 0, random.uniform(82, 98)))


def cabinet_goods(scene: Scene, random: Generator, bottles: Goods, pots: Goods) -> None:
    """Goods in the display cabinet."""
    wares = [*bottles, *pots]
    for z in (0.516, 0.89, 1.26, 1.63):
        stock(scene, random, wares, against("right", along=-1.65, away=0.065, z=z), 0.84, 0.27)


def desk_goods(scene: Scene, random: Generator, bottles: Goods, pots: Goods) -> None:
    """Goods on shelves behind the desk."""
    wares = [*bottles, *pots]
    board = shelf(scene, 1.4, 0.16)
    for z, goods in ((1.25, bottles), (1.6, wares), (1.95, wares), (2.3, wares)):
        away = 0.022 if z == 1.25 else 0  # the lowest clears the rail
        rack = against("back", along=1.68, away=away, z=z)
        put(board, rack)
        stock(scene, random, goods, rack, 1.36, 0.14)
    stock(scene, random, pots, against("back", along=1.7, away=0.1, z=0.85), 0.34, 0.18)


def trolley_goods(scene: Scene, random: Generator, bottles: Goods, pots: Goods) -> None:
    """Towels and pots on the trolley."""
    towel = folded_towel(scene, "Blue towel")
    for k in range(3):
        put(towel, TROLLEY, (-0.06, 0, 0.487 + 0.0455 * k), (0, 0, 2 * k))
        put(towel, TROLLEY, (0.03, 0, 0.207 + 0.0455 * k), (0, 0, -2 * k))
    stock(scene, random, pots, TROLLEY @ transform((0, -0.13, 0.747)), 0.42, 0.26)
