"""Coats and hats on the rack, umbrellas, towels, and their shelves."""

import bpy
import numpy as np

from scenes.barbershop.plan import TAU, TOWELS, against, put
from scenes.library.points import evenly, lattice, mirrored, polar, smooth_path, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import prism, sheet


def coat_rack(scene: Scene) -> None:
    """A board with hooks."""
    rack = Model(scene)
    rack.box(size=(1.3, 0.025, 0.12), bevel=0.008, at=(0, 0.0125, 1.86), material="Mahogany")
    rack.bend(
        radius=0.007,
        path=[(0, 0.02, 1.9), (0, 0.09, 1.92), (0, 0.11, 1.97)],
        at=lattice(x=evenly(-0.54, 0.54, 5)),
        material="Brass",
    )
    rack.ball(
        radius=0.014, at=lattice(x=evenly(-0.54, 0.54, 5), y=0.112, z=1.975), material="Brass"
    )
    rack.bend(
        radius=0.006,
        path=[(0, 0.02, 1.85), (0, 0.05, 1.81), (0, 0.075, 1.83), (0, 0.08, 1.86)],
        at=lattice(x=evenly(-0.54, 0.54, 5)),
        material="Brass",
    )
    put(rack.mesh(name="Coat rack"), where=against("right", along=2.35))


def umbrella_stand(scene: Scene) -> None:
    """A brass stand below the rack."""
    stand = Model(scene)
    stand.lathe(
        profile=[
            (0.1, 0.01),
            (0.11, 0.02),
            (0.12, 0.5),
            (0.13, 0.52),
            (0.12, 0.52),
            (0.105, 0.03),
            (0, 0.02),
        ],
        material="Brass",
    )
    stand.ring(radius=0.1174, thickness=0.006, at=(0, 0, 0.12), material="Brass")
    stand.ring(radius=0.1208, thickness=0.006, at=(0, 0, 0.4), material="Brass")
    put(stand.mesh(name="Umbrella stand"), where=against("right", along=1.49, away=0.2))


def fedora(scene: Scene) -> None:
    """A felt hat on a hook."""
    model = Model(scene)
    model.lathe(
        profile=[
            (0.175, 0.006),
            (0.17, 0),
            (0.1, 0.012),
            (0.095, 0.05),
            (0.088, 0.105),
            (0.06, 0.125),
            (0, 0.115),
        ],
        turned=(-62, 0, 0),
        scaled=(1, 1.15, 1),
        material="Camel wool",
    )
    model.pipe(
        profile=[(0.1005, 0.014), (0.0975, 0.042)],
        turned=(-62, 0, 0),
        scaled=(1, 1.15, 1),
        material="Rug red",
    )
    put(model.mesh(name="Fedora"), where=against("right", along=2.62, away=0.14, z=1.94))


def bowler_hat(scene: Scene) -> None:
    """A stiff black hat on a hook."""
    hat = Model(scene)
    hat.lathe(
        profile=[
            (0.15, 0.025),
            (0.152, 0.02),
            (0.105, 0),
            (0.0996, 0.011),
            (0.095, 0.039),
            (0.085, 0.066),
            (0.071, 0.088),
            (0.053, 0.106),
            (0.032, 0.1185),
            (0.01, 0.1244),
            (0, 0.125),
        ],
        turned=(-68, 0, 0),
        scaled=(1, 1.15, 1),
        material="Black",
    )
    put(hat.mesh(name="Bowler hat"), where=against("right", along=2.08, away=0.14, z=1.95))


def coats(scene: Scene) -> None:
    """Three coats in folds from 1.85 m down, each shorter than the last."""
    angle = np.arange(scene.segments(72, 16)) * TAU / scene.segments(72, 16)
    t = np.linspace(0, 1, scene.segments(32, 6))[:, None]
    steps = scene.segments(20, 5)
    width = 0.03 + 0.15 * np.minimum(t * 6, 1) ** 0.6 + 0.05 * t
    sleeve = np.array(
        [(0.14, 0.15, 1.74), (0.20, 0.18, 1.5), (0.19, 0.20, 1.22), (0.18, 0.21, 1.12)]
    )
    lapel = prism([(0, 0), (0.06, 0.02), (0.075, -0.10), (0, -0.34)], 0.008)
    for k, (y, color) in enumerate(((1.81, "Grey"), (2.33, "Camel"), (2.89, "Green"))):
        model = Model(scene)
        wool = f"{color} wool"
        model.lathe(
            profile=[(0.012, 0), (0.012, 0.004), (0.008, 0.005)],
            at=lattice(x=0.02, y=0.245, z=evenly(1.12, 1.36, 3)),
            turned=(-90, 0, 0),
            material="Ebony",
        )
        waves = 0.10 * np.sin(7 * angle + 2 * k) + 0.06 * np.sin(11 * angle + k)
        radius = width * (1 + waves * np.minimum(t * 2, 1))
        z = 1.85 - (0.95 - 0.12 * k) * t
        body = polar(radius, angle, z)
        body[..., 1] *= 0.5 * (0.2 + 0.8 * t)
        model.add(sheet(body[::-1], closed=True), wool, (0, 0.135, 0))
        for side, turn in ((-1, 0), (1, 180)):
            path = smooth_path(sleeve * (side, 1, 1), steps)
            model.add(scene.tube(path, np.linspace(0.062, 0.048, len(path)), 18), wool)
            model.add(lapel, wool, (side * 0.005, 0.222, 1.74), (90, 0, turn), (1, 1, side))
        put(model.mesh(f"Coat of {wool.lower()}"), where=against("right", along=y))


def umbrellas(scene: Scene) -> None:
    """Two rolled umbrellas in the stand."""
    umbrella = Model(scene)
    umbrella.bend(
        radius=0.009,
        path=[
            (0, 0, 0.02),
            (0, 0, 0.4),
            (0, 0, 0.78),
            (0.03, 0, 0.85),
            (0.075, 0, 0.83),
            (0.08, 0, 0.79),
        ],
        material="Oak",
    )
    sides = scene.segments(72, 16)
    t = np.linspace(0, 1, scene.segments(32, 6))[:, None]
    angle = np.arange(sides) * TAU / sides
    folds = 1 + 0.22 * np.cos(8 * angle)
    radius = folds * np.interp(t, (0, 0.12, 0.75, 1), (0.006, 0.02, 0.045, 0.018))
    umbrella.add(sheet(polar(radius, angle + t, 0.06 + 0.58 * t), closed=True), "Black")
    data = umbrella.mesh("Umbrella")
    put(data, against("right", along=1.46, away=0.19, z=0.01), degrees=(4, -4, 30))
    put(data, against("right", along=1.53, away=0.22, z=0.01), degrees=(-3, 5, 160))


def folded_towel(scene: Scene, towel: str) -> bpy.types.Mesh:
    """A towel folded twice, with a stripe."""
    stripe = "White towel" if towel == "Red towel" else "Red towel"
    model = Model(scene)
    model.box(
        size=(0.26, 0.17, 0.016),
        bevel=0.007,
        segments=3,
        at=lattice(z=evenly(0.008, 0.036, 3)),
        material=towel,
    )
    model.tube(radius=0.022, path=[(-0.13, 0.078, 0.022), (0.13, 0.078, 0.022)], material=towel)
    model.box(size=(0.02, 0.171, 0.002), at=(-0.09, 0, 0.0445), material=stripe)
    return model.mesh(f"Folded {towel.lower()}")


def rolled_towel(scene: Scene, towel: str) -> bpy.types.Mesh:
    """A rolled towel, lying along y, its end a spiral."""
    model = Model(scene)
    s = np.linspace(1, 0, scene.segments(72, 12))
    model.lathe(
        profile=[(0.039, -0.0005), (0.039, 0.0005)],
        at=lattice(y=(-0.106, 0.106), z=0.042),
        turned=(90, 0, 0),
        material=towel,
    )
    x, z, _ = polar(0.012 + 0.030 * s, TAU * 3.2 * s).T
    shrink, y = np.array([(0.93, -0.11), (1, -0.104), (1, 0.104), (0.93, 0.11)]).T[:, :, None]
    model.add(sheet(xyz(x * shrink, y, z * shrink + 0.042)), towel)
    return model.mesh(f"Rolled {towel.lower()}")


def towel_shelves(scene: Scene) -> None:
    """Open shelves of towels beside the staff door, with a basket on top."""
    basket = Model(scene)
    random = scene.random("towel shelves")
    where = against("back", along=-0.42, away=0.036)
    shelves = Model(scene)
    shelves.box(
        size=(0.03, 0.32, 1.75), bevel=0.004, at=mirrored(x=0.39, y=0.16, z=0.875), material="Oak"
    )
    shelves.box(
        size=(0.78, 0.32, 0.024),
        bevel=0.003,
        at=lattice(y=0.16, z=evenly(0.068, 1.718, 6)),
        material="Oak",
    )
    shelves.box(size=(0.78, 0.012, 1.75), at=(0, 0.006, 0.875), material="Mahogany")
    put(shelves.mesh(name="Towel shelves"), where)
    folded = [folded_towel(scene, towel) for towel in TOWELS]
    rolled = [rolled_towel(scene, towel) for towel in TOWELS]
    for level, z in enumerate(np.linspace(0.08, 1.73, 6)[:-1]):
        side = 1 if level % 2 else -1
        for k, x in enumerate((-0.235 * side, 0.05 * side)):
            for pile in range(random.integers(2, 6)):
                turn = (0, 0, random.uniform(-2, 2))
                put(folded[(level + k) % 4], where, (x, 0.17, z + 0.0455 * pile), turn)
        for k, (x, up) in enumerate(((0.25, 0), (0.335, 0), (0.2925, 0.074))):
            put(rolled[(level + k + 1) % 4], where, (side * x, 0.17, z + up))
    basket.lathe(profile=[(0.12, 0.004), (0.12, 0.01)], material="Bristle")
    for k in range(9):
        basket.add(scene.ring(0.13 + 0.004 * k, 0.011, 40, 6), "Bristle", (0, 0, 0.011 + 0.02 * k))
    put(basket.mesh("Basket"), where, (0, 0.16, 1.73))
    for k in range(5):
        x, y, z = polar(0.07, k * TAU / 5, 1.87)
        put(rolled[k % 4], where, (x, 0.16 + y, z), (78, 0, 72 * k))
