"""Fittings on the walls, the clock, the pole, the radiator, and objects in corners."""

import numpy as np

from scenes.barbershop.plan import TAU, Barbershop, put, standing
from scenes.library.points import evenly, lattice, mirrored, polar
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, box, lettering, sheet, tube

NUMERALS = ("XII", "I", "II", "III", "IIII", "V", "VI", "VII", "VIII", "IX", "X", "XI")
POLE_CAP = [
    (0, -0.1),
    (0.03, -0.095),
    (0.045, -0.06),
    (0.09, -0.045),
    (0.095, -0.01),
    (0.085, 0),
    (0.085, 0.012),
    (0, 0.012),
]


def radiator_section(scene: Scene[Barbershop]) -> None:
    """The radiators below the windows, of many alike sections."""
    section = Model(scene)
    section.bend(
        radius=0.022,
        path=[(0, 0, 0.09), (0, 0, 0.2), (0, 0, 0.5), (0, 0, 0.62)],
        at=lattice(y=(-0.05, 0.05)),
        material="Cream",
    )
    section.box(
        size=(0.05, 0.16, 0.05),
        bevel=0.02,
        segments=3,
        at=[(0, 0, 0.09), (0, 0, 0.36), (0, 0, 0.63)],
        material="Cream",
    )
    where = [
        scene.plan.at_front(x, away=0.14, z=0.03)
        for along, _ in scene.plan.windows
        for x in evenly(along - 0.551, along + 0.551, 20)
    ]
    put(section.mesh(name="Radiator section"), where)


def radiator_pipes(scene: Scene[Barbershop]) -> None:
    """The radiators' pipes, feet and valves."""
    pipes = Model(scene)
    pipes.bend(
        radius=0.012,
        path=[(0.58, 0, 0.12), (0.66, 0, 0.12), (0.68, 0, 0.09), (0.68, 0, 0)],
        material="Brass",
    )
    pipes.bend(
        radius=0.012,
        path=[(-0.58, 0, 0.12), (-0.66, 0, 0.12), (-0.68, 0, 0.09), (-0.68, 0, 0)],
        material="Brass",
    )
    pipes.box(size=(0.05, 0.1, 0.09), bevel=0.01, at=mirrored(x=0.52, z=0.045), material="Cream")
    pipes.lathe(
        profile=[(0.012, 0), (0.03, 0.008), (0.032, 0.03), (0.022, 0.045), (0, 0.048)],
        at=(0.67, 0, 0.135),
        material="Brass",
    )
    where = [scene.plan.at_front(along, away=0.14) for along, _ in scene.plan.windows]
    put(pipes.mesh(name="Radiator pipes"), where)


def switch(scene: Scene[Barbershop]) -> None:
    """Light switches and sockets with two levers."""
    model = Model(scene)
    model.box(size=(0.08, 0.12, 0.008), bevel=0.003, at=(0, 0, 0.004), material="Brass")
    model.lathe(
        profile=[(0.009, 0), (0.006, 0.006), (0.004, 0.022), (0, 0.024)],
        at=mirrored(x=0.018, z=0.007),
        turned=(20, 0, 0),
        material="Brass",
    )
    where = [scene.plan.fitted(spot) for spot in scene.plan.switches]
    put(model.mesh(name="Switch"), where)


def vent(scene: Scene[Barbershop]) -> None:
    """Grilles of the ventilation."""
    model = Model(scene)
    model.frame(
        size=(0.36, 0.16), profile=[(0, 0), (0, 0.012), (0.02, 0.012), (0.025, 0)], material="Gilt"
    )
    model.box(size=(0.36, 0.16, 0.002), at=(0, 0, 0.001), material="Black")
    model.box(
        size=(0.36, 0.014, 0.003),
        at=lattice(y=evenly(-0.065, 0.065, 7), z=0.007),
        turned=(35, 0, 0),
        material="Gilt",
    )
    put(model.mesh(name="Vent"), where=[scene.plan.fitted(spot) for spot in scene.plan.vents])


def dustpan(scene: Scene) -> None:
    """A dustpan in the corner by the counter."""
    model = Model(scene)
    model.box(size=(0.26, 0.22, 0.006), at=(0, 0, 0.004), turned=(-3, 0, 0), material="Red")
    model.box(size=(0.005, 0.22, 0.05), at=mirrored(x=0.13, z=0.027), material="Red")
    model.box(size=(0.26, 0.005, 0.07), at=(0, -0.11, 0.04), material="Red")
    model.tube(radius=0.012, path=[(0, -0.11, 0.05), (0, -0.26, 0.07)], material="Black")
    put(model.mesh(name="Dustpan"), where=standing(x=-1.98, y=-3.05, z=0.002, turned=100))


def clock(scene: Scene[Barbershop]) -> None:
    """A railway clock, at ten past ten."""
    model = Model(scene)
    _dial_and_hands(model)
    for k in range(60):
        size = (0.0025, 0.010, 0.001) if k % 5 else (0.006, 0.022, 0.001)
        at = polar(0.166, np.radians(90 - 6 * k), 0.0226)
        model.add(box(size), "Black", at, (0, 0, -6 * k))
    for k, numeral in enumerate(NUMERALS):
        at = polar(0.132, np.radians(90 - 30 * k), 0.0226)
        model.add(lettering(numeral, 0.0005), "Black", at, scale=(0.034, 0.042, 1))
    put(model.mesh("Clock"), where=scene.plan.fitted(scene.plan.clock))


def _dial_and_hands(clock: Model) -> None:
    """The case, the white dial, and the three hands."""
    clock.lathe(
        profile=[(0.22, 0), (0.22, 0.03), (0.205, 0.05), (0.185, 0.045), (0.18, 0.02), (0, 0.02)],
        material="Mahogany",
    )
    clock.lathe(profile=[(0.181, 0), (0.181, 0.022), (0, 0.022)], material="White")
    clock.ring(radius=0.183, thickness=0.006, at=(0, 0, 0.044), material="Brass")
    clock.prism(
        height=0.0012,
        outline=[(-0.006, -0.02), (0.006, -0.02), (0.006, 0.068), (0, 0.085), (-0.006, 0.068)],
        at=(0, 0, 0.026),
        turned=(0, 0, 55),
        material="Black",
    )
    clock.prism(
        height=0.0012,
        outline=[(-0.004, -0.02), (0.004, -0.02), (0.004, 0.104), (0, 0.13), (-0.004, 0.104)],
        at=(0, 0, 0.028),
        turned=(0, 0, -60),
        material="Black",
    )
    clock.prism(
        height=0.0012,
        outline=[(-0.0015, -0.02), (0.0015, -0.02), (0.0015, 0.112), (0, 0.14), (-0.0015, 0.112)],
        at=(0, 0, 0.03),
        turned=(0, 0, 160),
        material="Red",
    )
    clock.lathe(profile=[(0.01, 0.022), (0.01, 0.034), (0, 0.036)], material="Brass")


def barber_pole(scene: Scene[Barbershop]) -> None:
    """The turning pole, its helix real geometry, between the window and the door."""
    model = Model(scene)
    model.lathe(profile=POLE_CAP, material="Chrome")
    model.lathe(profile=POLE_CAP, at=(0, 0, 0.62), turned=(180, 0, 0), material="Chrome")
    model.ball(radius=0.1, at=(0, 0, 0.78), material="Opal globe")
    model.pipe(profile=[(0.083, 0), (0.083, 0.62)], material="Pane")
    model.tube(
        radius=0.016,
        path=[(0, 0.06, 0), (0, 0.15, 0)],
        at=lattice(z=(-0.03, 0.65)),
        material="Chrome",
    )
    model.box(
        size=(0.09, 0.015, 0.12),
        bevel=0.006,
        at=lattice(y=0.15, z=(-0.03, 0.65)),
        material="Chrome",
    )
    sides = scene.segments(48, 16) // 8 * 8
    t = np.linspace(0, 1, scene.segments(64, 8))[:, None]
    angle = np.arange(sides) * TAU / sides + 1.25 * TAU * t
    column = sheet(polar(0.07, angle, 0.62 * t), closed=True)
    stripe = np.arange(len(column.quads)) % sides * 8 // sides % 4
    for kind, material in enumerate(("Red", "White", "Blue", "White")):
        model.add(Shape(column.vertices, column.quads[stripe == kind]), material)
    put(
        model.mesh("Barber pole"),
        where=scene.plan.at_front(scene.plan.pole, away=0.158, z=1.38, turned=180),
    )


def broom(scene: Scene) -> None:
    """A broom that leans in the corner by the counter."""
    model = Model(scene)
    model.tube(radius=0.012, path=[(0, 0, 0.1), (0, 0, 1.35)], material="Oak")
    model.box(size=(0.3, 0.05, 0.04), bevel=0.01, at=(0, 0, 0.1), material="Oak")
    roots = lattice(x=evenly(-0.14, 0.14, scene.count(34, 6)), y=evenly(-0.018, 0.018, 3))
    for x, y, _ in roots:
        hair = tube([(x, y, 0.085), (x * 1.1, y * 1.4, 0)], 0.0035, 5)
        model.add(hair, "Bristle")
    put(model.mesh(name="Broom"), where=standing(x=-2.02, y=-3.5, z=0.004), degrees=(7, -4, 35))


def waste_bins(scene: Scene[Barbershop]) -> None:
    """Bins of crumpled paper."""
    waste = Model(scene)
    random = scene.random("waste")
    waste.lathe(
        profile=[
            (0.13, 0),
            (0.14, 0.01),
            (0.16, 0.38),
            (0.166, 0.385),
            (0.158, 0.385),
            (0.13, 0.02),
            (0, 0.015),
        ],
        material="Steel",
    )
    waste.ring(radius=0.148, thickness=0.005, at=(0, 0, 0.1), material="Steel")
    waste.ring(radius=0.157, thickness=0.005, at=(0, 0, 0.28), material="Steel")
    crumpled = box((0.07, 0.05, 0.04), 0.015)
    for k in range(scene.count(14, 3)):
        at = (*random.uniform(-0.08, 0.08, 2), 0.33 + 0.02 * (k % 3))
        waste.add(crumpled, ("Paper", "White")[k % 2], at, random.uniform(0, 360, 3))
    put(
        waste.mesh(name="Waste bin"),
        where=[standing(x, y, turned=turn) for x, y, turn in scene.plan.bins],
    )
