"""The barbers' chairs, the waiting bench, and the stool at the desk."""

from collections.abc import Sequence

import bpy
import numpy as np

from scenes.barbershop.plan import HEADINGS, Barbershop, against, position, put, standing
from scenes.library.points import evenly, lattice, mirrored, rectangle, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, copies, join, prism, sheet


def cushion(scene: Scene, size: Sequence[float], tufts: Sequence[int]) -> Shape:
    """A padded panel, flat, its front at +Z, with buttons deep in diamond tufts.

    size: width, height, thickness. tufts: columns, rows.
    """
    (width, height, thickness), (columns, rows) = size, tufts
    u = np.linspace(-1, 1, scene.segments(12 * max(tufts), 8) + 1)
    v = u[:, None]
    edge = np.sqrt((1 - u**8) * (1 - v**8))
    a, b = u * columns, v * rows
    puff = np.abs(np.sin(np.pi * (a + b) / 2) * np.sin(np.pi * (a - b) / 2)) ** 0.4
    front = sheet(xyz(u * width / 2, v * height / 2, thickness * edge * (0.6 + 0.4 * puff)))
    back = prism(rectangle(width, height), 1e-4).moved(0, 0, -1e-4)
    a, b = np.meshgrid(np.arange(1 - columns, columns), np.arange(1 - rows, rows))
    places = xyz(a * width / 2 / columns, b * height / 2 / rows, 0.6 * thickness)
    button = scene.ball(0.009, 8).scaled(1, 1, 0.6)
    return join([front, back, copies(button, places[(a + b) % 2 == 0])])


def barber_chairs(scene: Scene[Barbershop]) -> None:
    """Hydraulic chairs, turned to their mirrors, on mats of ribbed rubber."""
    plan = scene.plan
    seat = chair_seat(scene)
    back = chair_back(scene)
    heading = HEADINGS[plan.counter_wall] - HEADINGS["left"]
    for along, turn in zip(plan.stations, plan.chair_turns, strict=True):
        x, y = position(plan.counter_wall, along, away=1.12, room=plan.room)
        where = standing(x, y, z=0.009, turned=heading + turn)
        put(seat, where)
        put(back, where, (0, -0.25, 0.58), (14, 0, 0))
    spots = [position(plan.counter_wall, y, away=1.1, room=plan.room) for y in plan.stations]
    put(chair_mat(scene), where=[standing(x, y) for x, y in spots])


def chair_seat(scene: Scene) -> bpy.types.Mesh:
    """The chair below its back: the pedestal, the seat, the arms, and the rest for the feet."""
    chair = Model(scene)
    _pedestal(chair)
    _arms(chair)
    _footrest(chair)
    chair.bend(
        radius=0.011,
        path=[(0.12, 0, 0.3), (0.3, -0.04, 0.3), (0.38, -0.05, 0.36), (0.4, -0.05, 0.47)],
        material="Chrome",
    )
    chair.ball(radius=0.024, at=(0.4, -0.05, 0.48), material="Ebony")
    padding = cushion(scene, (0.50, 0.50, 0.05), (4, 4))
    chair.add(padding, "Oxblood", (0, 0.03, 0.56))
    return chair.mesh(name="Barber chair")


def _pedestal(chair: Model) -> None:
    """The foot, the piston, and the seat on it."""
    chair.lathe(
        profile=[
            (0.33, 0),
            (0.33, 0.02),
            (0.3, 0.05),
            (0.14, 0.075),
            (0.1, 0.1),
            (0.085, 0.2),
            (0.085, 0.28),
        ],
        material="Chrome",
    )
    chair.lathe(profile=[(0.06, 0.24), (0.06, 0.36), (0.15, 0.38), (0.16, 0.4)], material="Steel")
    chair.ring(radius=0.33, thickness=0.012, at=(0, 0, 0.014), material="Rubber")
    chair.box(size=(0.5, 0.5, 0.07), bevel=0.02, segments=3, at=(0, 0.02, 0.435), material="Cream")
    chair.box(
        size=(0.52, 0.52, 0.1), bevel=0.035, segments=3, at=(0, 0.03, 0.515), material="Oxblood"
    )


def _arms(chair: Model) -> None:
    """Padded arms on bent tubes."""
    chair.bend(
        radius=0.017,
        path=[
            (0, 0.24, 0.42),
            (0, 0.3, 0.55),
            (0, 0.27, 0.71),
            (0, 0, 0.735),
            (0, -0.24, 0.72),
            (0, -0.26, 0.6),
            (0, -0.2, 0.44),
        ],
        at=mirrored(x=0.31),
        material="Chrome",
    )
    chair.box(
        size=(0.04, 0.34, 0.05),
        bevel=0.012,
        segments=2,
        at=mirrored(x=0.31, y=0.02, z=0.44),
        material="Cream",
    )
    chair.box(
        size=(0.075, 0.4, 0.05),
        bevel=0.022,
        segments=3,
        at=mirrored(x=0.31, y=0.02, z=0.765),
        material="Oxblood",
    )


def _footrest(chair: Model) -> None:
    """A padded rest for the calves, and a ribbed iron plate for the feet."""
    chair.bend(
        radius=0.014,
        path=[(0, 0.22, 0.4), (0, 0.36, 0.34), (0, 0.45, 0.18), (0, 0.52, 0.13)],
        at=mirrored(x=0.215),
        material="Chrome",
    )
    chair.box(
        size=(0.34, 0.05, 0.2),
        bevel=0.02,
        segments=3,
        at=(0, 0.345, 0.29),
        turned=(-38, 0, 0),
        material="Oxblood",
    )
    chair.box(
        size=(0.44, 0.2, 0.018),
        bevel=0.006,
        at=(0, 0.54, 0.125),
        turned=(18, 0, 0),
        material="Iron",
    )
    chair.box(
        size=(0.4, 0.012, 0.01),
        bevel=0.003,
        at=[
            (0, 0.46, 0.112),
            (0, 0.492, 0.1224),
            (0, 0.524, 0.1328),
            (0, 0.556, 0.1432),
            (0, 0.588, 0.1536),
            (0, 0.62, 0.164),
        ],
        turned=(18, 0, 0),
        material="Chrome",
    )


def chair_back(scene: Scene) -> bpy.types.Mesh:
    """The back, with its badge on the rear, and the headrest; the hinge is at the origin."""
    back = Model(scene)
    back.box(size=(0.48, 0.07, 0.56), bevel=0.03, segments=3, at=(0, 0, 0.27), material="Cream")
    back.frame(
        size=(0.36, 0.42),
        profile=[(-0.012, 0), (-0.012, 0.006), (0, 0.01), (0.012, 0.006), (0.012, 0)],
        at=(0, -0.036, 0.28),
        turned=(90, 0, 0),
        material="Chrome",
    )
    back.lathe(
        profile=[(0.5, 0), (0.5, 0.004)],
        at=(0, -0.036, 0.28),
        turned=(90, 0, 0),
        scaled=(0.2, 0.13, 1),
        material="Brass",
    )
    back.word(
        letters="FINEST",
        size=0.045,
        depth=0.0005,
        at=(0, -0.0405, 0.28),
        turned=(90, 0, 0),
        material="Black",
    )
    back.ball(
        radius=0.012, at=lattice(x=(-0.165, 0.165), y=-0.036, z=(0.085, 0.475)), material="Brass"
    )
    back.tube(
        radius=0.009, path=[(0, 0, 0.5), (0, 0.01, 0.68)], at=mirrored(x=0.09), material="Chrome"
    )
    back.box(
        size=(0.27, 0.09, 0.13), bevel=0.04, segments=3, at=(0, 0.02, 0.72), material="Oxblood"
    )
    padding = cushion(scene, (0.46, 0.54, 0.07), (4, 4))
    back.add(padding, "Oxblood", (0, 0.03, 0.28), (90, 0, 180))
    return back.mesh(name="Barber chair back")


def chair_mat(scene: Scene) -> bpy.types.Mesh:
    """A round mat with ribs."""
    mat = Model(scene)
    mat.lathe(
        profile=[(0.6, 0.001), (0.6, 0.007), (0.575, 0.012), (0.56, 0.009), (0, 0.009)],
        material="Rubber",
    )
    for k in range(7):
        mat.add(scene.ring(0.14 + 0.06 * k, 0.003, 48, 6), "Rubber", (0, 0, 0.009))
    return mat.mesh(name="Chair mat")


def waiting_bench(scene: Scene) -> None:
    """A buttoned leather bench with rolled arms and turned feet."""
    bench = Model(scene)
    _bench_body(bench)
    seat = cushion(scene, (0.92, 0.50, 0.05), (6, 3))
    bench.add(seat, "Oxblood", mirrored(x=0.49, y=0.42, z=0.385))
    back = cushion(scene, (1.86, 0.42, 0.09), (12, 3))
    bench.add(back, "Oxblood", (0, 0.175, 0.60), (80, 0, 180))
    nails = lattice(x=(-0.055, 0.055), y=0.703, z=evenly(0.16, 0.48, scene.segments(12)))
    for x in (-1.02, 1.02):
        bench.add(scene.ball(0.006, 6).moved(x, 0, 0), "Brass", nails)
    put(bench.mesh(name="Waiting bench"), where=against("right", along=0.15))


def _bench_body(bench: Model) -> None:
    """The bench without its buttoned cushions."""
    bench.box(size=(2, 0.64, 0.16), bevel=0.02, segments=2, at=(0, 0.36, 0.21), material="Oxblood")
    bench.box(
        size=(0.95, 0.54, 0.1),
        bevel=0.04,
        segments=3,
        at=mirrored(x=0.49, y=0.42, z=0.34),
        material="Oxblood",
    )
    bench.box(
        size=(1.9, 0.12, 0.52),
        bevel=0.05,
        segments=3,
        at=(0, 0.12, 0.56),
        turned=(10, 0, 0),
        material="Oxblood",
    )
    bench.tube(radius=0.07, path=[(-0.98, 0.06, 0.82), (0.98, 0.06, 0.82)], material="Oxblood")
    bench.lathe(
        profile=[
            (0, 0),
            (0.05, 0.004),
            (0.085, 0.01),
            (0.09, 0.03),
            (0.09, 0.63),
            (0.085, 0.65),
            (0.05, 0.655),
            (0, 0.658),
        ],
        at=mirrored(x=1.02, y=0.06, z=0.55),
        turned=(-90, 0, 0),
        material="Oxblood",
    )
    bench.box(
        size=(0.15, 0.64, 0.4),
        bevel=0.03,
        segments=2,
        at=mirrored(x=1.02, y=0.38, z=0.33),
        material="Oxblood",
    )
    bench.ball(
        radius=0.014, at=mirrored(x=1.02, y=0.72, z=0.55), scaled=(1, 0.5, 1), material="Brass"
    )
    bench.lathe(
        profile=[(0.025, 0), (0.03, 0.03), (0.045, 0.07), (0.03, 0.1), (0.04, 0.14)],
        at=lattice(x=(-1.02, 1.02), y=(0.1, 0.62)),
        material="Ebony",
    )


def stool(scene: Scene) -> None:
    """The stool behind the desk."""
    model = Model(scene)
    model.lathe(
        profile=[(0.16, 0.66), (0.18, 0.67), (0.185, 0.7), (0.15, 0.73), (0, 0.735)], material="Tan"
    )
    model.tube(radius=0.02, path=[(0, 0, 0.2), (0, 0, 0.67)], material="Chrome")
    model.bend(
        radius=0.012,
        path=[(-0.22, 0, 0), (-0.11, 0, 0.2), (0, 0, 0.24), (0.11, 0, 0.2), (0.22, 0, 0)],
        material="Chrome",
    )
    model.bend(
        radius=0.012,
        path=[(0, -0.22, 0), (0, -0.11, 0.2), (0, 0, 0.24), (0, 0.11, 0.2), (0, 0.22, 0)],
        material="Chrome",
    )
    model.ring(radius=0.13, thickness=0.008, at=(0, 0, 0.28), material="Chrome")
    put(model.mesh(name="Stool"), where=standing(x=1.45, y=-3.05))
