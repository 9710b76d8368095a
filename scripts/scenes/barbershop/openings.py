"""The shop window, the doors, and the street outside."""

import numpy as np

from scenes.barbershop.plan import (
    ROOM,
    TAU,
    WINDOW_HEIGHT,
    WINDOW_MIDDLE,
    Barbershop,
    against,
    hanging,
    put,
    standing,
)
from scenes.library.points import evenly, lattice, mirrored, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, lettering, sheet

HOUSES = evenly(-10.5, 10.5, 13)  # the x of each
TRADES = ("BAKER", "TAILOR", "BOOKS", "HATS", "SHOES", "TEA")
# Profiles of frames, outwards and towards the viewer: round an opening, in it, and of a panel.
CASING = [
    (0, -0.05),
    (0, 0.03),
    (0.015, 0.04),
    (0.07, 0.034),
    (0.075, 0.045),
    (0.09, 0.045),
    (0.09, 0),
]
REVEAL = [(-0.001, -0.15), (-0.001, 0)]
PANEL = [(-0.06, 0.022), (-0.04, 0.036), (0.02, 0.036), (0.025, 0.02)]


def window_frame(scene: Scene[Barbershop]) -> None:
    """The shop windows' frames with their bars and sills."""
    for along, width in scene.plan.windows:
        model = Model(scene)
        size = (width, WINDOW_HEIGHT)
        bars = mirrored(x=round(width / 6, 3), z=-0.07)
        model.frame(size=size, profile=CASING, material="Mahogany")
        model.frame(size=size, profile=REVEAL, material="Mahogany")
        model.box(size=(0.05, WINDOW_HEIGHT, 0.06), bevel=0.008, at=bars, material="Mahogany")
        model.box(size=(width, 0.05, 0.06), bevel=0.008, at=(0, 0.35, -0.07), material="Mahogany")
        model.box(
            size=(width + 0.3, 0.035, 0.26),
            bevel=0.012,
            segments=2,
            at=(0, -0.7425, 0.06),
            material="Mahogany x",
        )
        put(model.mesh(name="Window frame"), where=scene.plan.on_front(along, z=WINDOW_MIDDLE))


def window_pane(scene: Scene[Barbershop]) -> None:
    for along, width in scene.plan.windows:
        pane = Model(scene)
        pane.plane(size=(width, WINDOW_HEIGHT), material="Pane")
        where = scene.plan.on_front(along, away=-0.075, z=WINDOW_MIDDLE)
        put(pane.mesh(name="Window pane"), where)


def window_letters(scene: Scene[Barbershop]) -> None:
    """The shop's name on each window, to be read from outside."""
    letters = Model(scene)
    letters.word(
        letters="BARBER SHOP",
        size=0.34,
        depth=0.004,
        at=(0, 0, 0.02),
        turned=(90, 0, 0),
        material="Gilt",
    )
    letters.word(
        letters="EST. 1927",
        size=0.15,
        depth=0.004,
        at=(0, 0, -0.3),
        turned=(90, 0, 0),
        material="Gilt",
    )
    name = letters.mesh(name="Window letters")
    for along, width in scene.plan.windows:
        where = scene.plan.at_front(along, away=-0.078, z=WINDOW_MIDDLE)
        put(name, where, scale=min(1.0, width / 2.6))


def door_frame(scene: Scene[Barbershop]) -> None:
    model = Model(scene)
    model.frame(size=(0.95, 2.45), profile=CASING, material="Mahogany")
    model.frame(size=(0.95, 2.45), profile=REVEAL, material="Mahogany")
    model.box(size=(0.95, 0.06, 0.07), bevel=0.008, at=(0, 0.905, -0.06), material="Mahogany")
    put(model.mesh(name="Door frame"), where=scene.plan.on_front(scene.plan.door, z=1.225))


def door(scene: Scene[Barbershop]) -> None:
    """A panelled door with a pane, a kick plate, a letter slot and a handle."""
    model = Model(scene)
    model.box(
        size=(0.12, 0.045, 2.09), bevel=0.006, at=mirrored(x=0.415, z=1.055), material="Mahogany"
    )
    model.box(size=(0.71, 0.043, 0.24), bevel=0.005, at=(0, 0, 0.13), material="Mahogany")
    model.box(size=(0.71, 0.043, 0.16), bevel=0.005, at=(0, 0, 0.82), material="Mahogany")
    model.box(size=(0.71, 0.043, 0.14), bevel=0.005, at=(0, 0, 2.03), material="Mahogany")
    model.box(size=(0.71, 0.02, 0.5), at=(0, 0, 0.5), material="Mahogany")
    model.frame(
        size=(0.71, 0.49),
        profile=[(-0.05, 0.012), (-0.03, 0.02), (0, 0.022)],
        at=(0, 0, 0.495),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    _door_brass(model)
    put(model.mesh(name="Door"), where=scene.plan.at_front(scene.plan.door, away=-0.06))


def _door_brass(model: Model) -> None:
    """The kick plate, the push plate, the letter slot, and the handle."""
    model.box(size=(0.85, 0.003, 0.2), at=(0, 0.024, 0.12), material="Brass")
    model.box(size=(0.05, 0.006, 0.4), bevel=0.002, at=(-0.415, 0.025, 1.05), material="Brass")
    model.box(size=(0.22, 0.008, 0.05), bevel=0.003, at=(0, 0.026, 0.82), material="Brass")
    model.bend(
        radius=0.011,
        path=[(0, 0.02, -0.15), (0, 0.07, -0.1), (0, 0.075, 0), (0, 0.07, 0.1), (0, 0.02, 0.15)],
        at=(-0.415, 0, 1.05),
        material="Brass",
    )


def door_pane(scene: Scene[Barbershop]) -> None:
    pane = Model(scene)
    pane.plane(size=(0.95, 1.06), material="Pane")
    where = scene.plan.on_front(scene.plan.door, away=-0.062, z=1.43)
    put(pane.mesh(name="Door pane"), where)


def transom_pane(scene: Scene[Barbershop]) -> None:
    """The pane above the door."""
    pane = Model(scene)
    pane.plane(size=(0.95, 0.29), material="Pane")
    where = scene.plan.on_front(scene.plan.door, away=-0.062, z=2.305)
    put(pane.mesh(name="Transom pane"), where)


def door_sign(scene: Scene[Barbershop]) -> None:
    """A sign that hangs on a cord: closed inside, open outside."""
    sign = Model(scene)
    sign.box(size=(0.3, 0.16, 0.006), bevel=0.002, material="Cream")
    sign.word(letters="CLOSED", size=0.065, depth=0.0005, at=(0, 0, 0.0033), material="Red")
    sign.word(
        letters="OPEN",
        size=0.09,
        depth=0.0005,
        at=(0, 0, -0.0033),
        turned=(0, 180, 0),
        material="Green",
    )
    sign.tube(radius=0.0015, path=[(-0.13, 0.075, 0), (0, 0.28, -0.01)], material="Iron")
    sign.tube(radius=0.0015, path=[(0.13, 0.075, 0), (0, 0.28, -0.01)], material="Iron")
    put(sign.mesh(name="Door sign"), where=scene.plan.on_front(scene.plan.door, away=-0.04, z=1.5))


def door_bell(scene: Scene[Barbershop]) -> None:
    """The bell that the door rings."""
    bell = Model(scene)
    bell.lathe(
        profile=[(0.045, 0), (0.034, 0.02), (0.026, 0.05), (0.012, 0.065), (0, 0.068)],
        at=(0, 0.12, 0),
        material="Brass",
    )
    bell.bend(
        radius=0.005,
        path=[(0, 0, 0.02), (0, 0.03, 0.12), (0, 0.1, 0.12), (0, 0.12, 0.06)],
        material="Brass",
    )
    put(bell.mesh(name="Door bell"), where=scene.plan.at_front(scene.plan.door + 0.2, z=2.2))


def house_number(scene: Scene[Barbershop]) -> None:
    """The number on the transom, to be read from outside."""
    number = Model(scene)
    number.word(letters="27", size=0.2, depth=0.01, turned=(0, 180, 0), material="Gilt")
    where = scene.plan.on_front(scene.plan.door, away=-0.07, z=2.305)
    put(number.mesh(name="House number"), where)


def staff_door_frame(scene: Scene) -> None:
    model = Model(scene)
    model.frame(size=(0.85, 2.05), profile=CASING, material="Mahogany")
    put(model.mesh(name="Staff door frame"), where=hanging("back", along=-1.525, z=1.025))


def staff_door(scene: Scene) -> None:
    """A panelled door with a knob."""
    door = Model(scene)
    door.box(size=(0.85, 0.02, 2.05), at=(0, 0.01, 1.025), material="Mahogany")
    door.frame(
        size=(0.28, 0.6),
        profile=PANEL,
        at=mirrored(x=0.2, z=0.5),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    door.frame(
        size=(0.28, 0.3),
        profile=PANEL,
        at=mirrored(x=0.2, z=1.05),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    door.frame(
        size=(0.62, 0.55), profile=PANEL, at=(0, 0, 1.62), turned=(90, 0, 180), material="Mahogany"
    )
    door.box(size=(0.6, 0.012, 0.53), at=(0, 0.021, 1.62), material="Cream")
    _staff_door_sign(door)
    put(door.mesh(name="Staff door"), where=against("back", along=-1.525))


def _staff_door_sign(door: Model) -> None:
    """The lettering, and the knob on its plate."""
    door.word(
        letters="STAFF",
        size=0.15,
        depth=0.0005,
        at=(0, 0.0275, 1.64),
        turned=(90, 0, 180),
        material="Black",
    )
    door.word(
        letters="private",
        size=0.07,
        depth=0.0005,
        at=(0, 0.0275, 1.52),
        turned=(90, 0, 180),
        material="Black",
    )
    door.lathe(
        profile=[
            (0.026, 0),
            (0.012, 0.01),
            (0.012, 0.035),
            (0.03, 0.045),
            (0.026, 0.065),
            (0, 0.07),
        ],
        at=(-0.37, 0.02, 1),
        turned=(-90, 0, 0),
        material="Brass",
    )
    door.box(size=(0.05, 0.006, 0.2), bevel=0.002, at=(-0.37, 0.022, 0.98), material="Brass")


def street_lamp(scene: Scene[Barbershop]) -> None:
    """A lamp on the pavement."""
    lamp = Model(scene)
    lamp.lathe(
        profile=[(0.16, -0.1), (0.16, 0.2), (0.07, 0.35), (0.05, 2.9), (0.09, 3.0)], material="Iron"
    )
    lamp.lathe(
        profile=[(0.08, 3.0), (0.17, 3.4), (0.19, 3.42), (0.03, 3.6), (0, 3.66)], material="Cream"
    )
    put(lamp.mesh(name="Street lamp"), where=standing(x=-2.6, y=scene.plan.half_y + 2.45))


def valance(scene: Scene[Barbershop]) -> None:
    """A scalloped curtain on a brass rod above each window."""
    for along, width in scene.plan.windows:
        where = scene.plan.on_front(along, away=0.09, z=2.51)
        put(_curtain(scene, width / 2 + 0.1).mesh("Valance"), where)


def _curtain(scene: Scene, half: float) -> Model:
    """A valance: half of its width."""
    x = np.linspace(-half, half, scene.segments(160, 24))
    drop = np.linspace(-1, 0, scene.segments(10))[:, None]
    scallops = drop * (0.26 + 0.05 * np.cos(x * TAU / 0.35))
    model = Model(scene)
    model.tube(radius=0.014, path=[(-half - 0.04, 0, 0), (half + 0.04, 0, 0)], material="Brass")
    model.ball(radius=0.028, at=mirrored(x=half + 0.04), material="Brass")
    holders = mirrored(x=half + 0.02)
    model.tube(radius=0.008, path=[(0, 0, 0), (0, 0, -0.09)], at=holders, material="Brass")
    folds = 0.025 * np.sin(x * 40) * (0.4 - 0.6 * drop)
    model.add(sheet(xyz(x, scallops, folds)), "Red towel")
    return model


def street(scene: Scene[Barbershop]) -> None:
    """The view through the window: pavement, road, a row of brick houses with shops."""
    model = Model(scene)
    _houses(model)
    for i, x in enumerate(HOUSES):
        model.add(box((1.6, 0.1, 2.2)), ("Teal", "Ochre", "Green")[i // 2 % 3], (x, 13.04, 1.2))
        model.add(box((0.05, 0.16, 1.5)), "White", (x + 0.3 * (-1) ** i, 13.01, 1.35))
        trade = lettering(TRADES[i % 6], 0.02)
        model.add(trade, "Gilt", (x, 12.88, 2.75), (90, 0, 0), (0.24, 0.24, 1))
        for k, color in enumerate((("Green", "Red")[i // 2 % 2], "White")):  # the awning's stripes
            stripes = xyz(x + np.arange(k - 3, 4, 2) * 0.25, 12.6, 2.55)
            model.add(box((0.25, 1.0, 0.02)), color, stripes, (25, 0, 0))
    put(model.mesh("Street"), where=standing(y=scene.plan.half_y - ROOM[1] / 2))


def _houses(street: Model) -> None:
    """Pavements, the road, and a wall of bricks with windows, shop windows and sign boards."""
    street.box(size=(24, 2.6, 0.1), at=[(0, 5.3, -0.15), (0, 12.3, -0.15)], material="Street stone")
    street.box(size=(24, 5, 0.1), at=(0, 9.1, -0.25), material="Iron")
    street.box(size=(24, 0.3, 9), at=(0, 13.2, 4.4), material="Brick")
    street.box(size=(1, 0.12, 1.5), at=lattice(x=HOUSES, y=13.05, z=(4.2, 7)), material="White")
    street.box(size=(0.04, 0.16, 1.34), at=lattice(x=HOUSES, y=13.02, z=(4.2, 7)), material="White")
    street.box(
        size=(0.84, 0.16, 0.04), at=lattice(x=HOUSES, y=13.02, z=(4.3, 7.1)), material="White"
    )
    street.box(size=(1.5, 0.16, 0.05), at=lattice(x=HOUSES, y=13.01, z=1.75), material="White")
    street.box(
        size=(0.84, 0.14, 1.34), at=lattice(x=HOUSES, y=13.03, z=(4.2, 7)), material="Dark glass"
    )
    street.box(size=(1.35, 0.14, 1.5), at=lattice(x=HOUSES, y=13.02, z=1.35), material="Dark glass")
    street.box(
        size=(1.2, 0.3, 0.1), at=lattice(x=HOUSES, y=12.98, z=(3.4, 6.2)), material="Street stone"
    )
    street.box(size=(1.5, 0.2, 0.28), at=lattice(x=HOUSES, y=13, z=2.75), material="Mahogany")
