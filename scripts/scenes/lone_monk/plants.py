"""The plants in and over the court, and fallen leaves."""

import bpy
import numpy as np

from scenes.library.plants import Growth, branches, folded_leaf, leaf_cloud, leaves_at, leaves_on
from scenes.library.points import (
    Array,
    directions,
    noise,
    points,
    polar,
    smoothstep,
    unit,
    xyz,
)
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import copies, icosphere
from scenes.lone_monk import plan
from scenes.lone_monk.plan import ARCADE_TOP, CROSS_PATH, EAST, NORTH, PLAZA, WEST, Cloister

OLIVE = Growth((1.35, 2.0, 0.95), (6, 9), (0.9, 0.9), (0.1, 0.12, 0.02), 0.27, 0.22, bare=0.75)
# x, y, size
BEYOND = [
    (-8.2, 14.5, 2.2),
    (-5.6, 15.8, 2.5),
    (2.8, 16.0, 2.3),
    (6.0, 15.0, 2.05),
    (8.9, 16.8, 2.4),
]
BOX_BALLS = [(5.3, 5.3), (1.45, 5.3), (5.3, 1.45), (1.45, 2.75), (2.75, 1.45)]  # x, y
POT = [(0.12, 0), (0.175, 0.27), (0.195, 0.27), (0.2, 0.33), (0.175, 0.33), (0.165, 0.27)]


def olive_tree(scene: Scene[Cloister]) -> None:
    """An old olive on a lawn: a gnarled trunk, crooked limbs, silvery leaves."""
    random = scene.random("olive")
    tree = Model(scene)
    wood, twigs = branches(scene, random, OLIVE)
    at = wood.vertices
    gnarls = 0.25 * noise(at * (5, 5, 1.6), 1) * smoothstep(1.3, 0.9, at[:, 2])
    tree.add(wood.reshaped(at * (1 + xyz(gnarls, gnarls, 0))), "Bark")
    leaf = folded_leaf(0.24)
    count = scene.count(320)
    tree.add(leaves_on(random, twigs, leaf, count, (0.05, 0.07), 0.1, 0.09), "Olive leaf")
    mesh = tree.mesh("Olive")
    for number, spot in enumerate(scene.plan.olives):
        place("Olive", mesh, scene.plan.side(NORTH, (*spot, 0), 77 * number))


def flame(t: Array) -> Array:
    """The outline of a cypress: its radius by height, 0..1."""
    return np.sin(np.pi * (t * 0.93 + 0.05)) ** 0.6 * (1 - 0.45 * t)


def cypress(scene: Scene[Cloister]) -> bpy.types.Mesh:
    """A slim cypress, 5.6 m tall. It is made once."""
    if "Cypress" in bpy.data.meshes:
        return bpy.data.meshes["Cypress"]
    random = scene.random("cypresses")
    count = scene.count(16000)
    tree = Model(scene)
    t = random.random(count) ** 1.25
    around = random.uniform(0, 2 * np.pi, count)
    lumps = 1 + 0.25 * noise(polar(1.3, around, 9 * t), scene.seed)
    radius = 0.52 * flame(t) * lumps * (1 - 0.25 * random.random(count) ** 2)
    forward = polar(0.4, around, 1) + random.normal(0, 0.25, (count, 3))
    leaves = leaves_at(random, polar(radius, around, 0.35 + 5.2 * t), forward, 0.15, 0.28)
    tree.add(leaves, "Cypress leaf")
    t = np.linspace(0, 1, 9)
    tree.add(scene.lathe(np.column_stack([0.36 * flame(t), 0.45 + 4.9 * t]), 10), "Cypress leaf")
    tree.add(scene.tube([(0, 0, -0.1), (0, 0, 2.5), (0, 0, 5.2)], [0.10, 0.08, 0.01]), "Bark")
    return tree.mesh("Cypress")


def cypresses(scene: Scene[Cloister]) -> None:
    """Slim cypresses in the court, and tall ones beyond the low walls."""
    mesh = cypress(scene)
    for spot in scene.plan.cypresses:
        place("Cypress", mesh, scene.plan.side(NORTH, (*spot, 0), 57, 0.95))
    x, y, size = points(BEYOND).T
    scene.plan.on_sides("Cypress", [mesh], x, y, 0, 70 * x, size, sides=scene.plan.low_sides)


def ivy(scene: Scene[Cloister]) -> None:
    """Ivy that climbs a pier, spreads over two bays, and hangs from the eaves."""
    random = scene.random("ivy")
    count = scene.count(26000)
    model = Model(scene)
    from_pier = random.random(count) ** 1.4
    x = scene.plan.arcade - 4.6 * from_pier
    z = random.uniform(0.0, ARCADE_TOP - 0.1, count)
    from_axis = np.abs((x - scene.plan.arcade) / scene.plan.bay % 1 - 0.5) * scene.plan.bay
    in_arch = (z > 0.62) & (np.hypot(from_axis, np.maximum(z - plan.SPRINGING, 0)) < 0.95)
    thick = 0.9 * noise(xyz(x, 0, z) * 0.9, scene.seed + 5, 3) + 0.13 * z - 0.95 * from_pier
    grows = (thick > -0.2) & ~in_arch
    x = x[grows]
    z = z[grows]
    count = int(grows.sum())
    spots = xyz(x, ivy_face(scene.plan, x, z) - random.uniform(0.01, 0.10, count), z)
    forward = random.normal((0, -0.4, -1), (0.7, 0.2, 0), (count, 3))
    up = random.normal((0, -1, 0.4), (0.3, 0, 0.3), (count, 3))
    leaves = copies(folded_leaf(0.9), spots, forward, up, random.uniform(0.05, 0.085, count))
    model.add(leaves, "Ivy leaf")
    z = np.linspace(0.0, ARCADE_TOP - 0.4, 7)
    for _ in range(9):
        x = scene.plan.arcade - np.cumsum(random.uniform(0.0, 0.5, 7))
        model.add(scene.bend(xyz(x, ivy_face(scene.plan, x, z + 1), z), 0.012, 20, 6), "Bark")
    place("Ivy", model.mesh("Ivy"), scene.plan.side(scene.plan.ivy_side))


def ivy_face(plan: Cloister, x: Array, z: Array) -> Array:
    """How far out the face of pier, low wall or arcade is that ivy clings to."""
    on_wall = np.where(z < 0.62, plan.arcade - 0.34, plan.front - 0.02)
    return np.where(x > plan.arcade - 0.42, plan.arcade - 0.36, on_wall)


def geraniums(scene: Scene[Cloister]) -> None:
    """Pots of geraniums beside the gates, and smaller ones on the low walls."""
    random = scene.random("geraniums")
    pots = []
    for _ in range(3):
        model = Model(scene)
        model.add(scene.lathe(POT, capped=False), "Pot")
        model.add(scene.lathe([(0.17, 0.28), (0.02, 0.295)]), "Soil")
        bush = leaf_cloud(random, scene.count(420), (0.25, 0.25, 0.2), 0.06, 0.95)
        model.add(bush, "Box leaf", (0, 0, 0.46))
        for out in directions(random, 9):
            head = (*out[:2] * 0.25, 0.55 + 0.17 * abs(out[2]))
            model.add(leaf_cloud(random, scene.count(26), 0.035, 0.028, 0.9), "Petal", head)
            stalk = scene.tube([(0, 0, 0.3), np.multiply(head, (0.5, 0.5, 0.85)), head], 0.003, 4)
            model.add(stalk, "Box leaf")
        pots.append(model.mesh("Geranium"))
    for number in plan.SIDES:
        x = np.delete(scene.plan.bay_axes, scene.plan.bays // 2)
        x = x[random.random(len(x)) < 0.6]
        x = x + random.uniform(-0.4, 0.4, len(x))
        place_on = (x, scene.plan.arcade - 0.05, plan.STYLOBATE, 300 * x, 0.72)
        scene.plan.on_sides("Small geranium", pots, *place_on, sides=[number])
    scene.plan.on_sides(
        "Geranium", pots, (-1.22, 1.22), scene.plan.arcade - 0.62, 0.015, (0, 130), 1.15
    )


def shrubs(scene: Scene[Cloister]) -> None:
    """Clipped box balls at the lawns' corners, and lavender along the sunny kerbs."""
    random = scene.random("shrubs")
    balls = [Model(scene), Model(scene)]
    spots = points(BOX_BALLS)
    for ball in balls:
        ball.add(leaf_cloud(random, scene.count(3000), 0.33, 0.038, 0.65), "Box leaf")
        ball.add(icosphere(2, 0.27), "Turf")
    meshes = [ball.mesh("Box ball") for ball in balls]
    for number in plan.SIDES:
        away = [scene.plan.side(number, (*spot, 0)).translation.length > 3.2 for spot in spots]
        x, y = spots[away].T  # where no rig is near
        size = random.uniform(0.85, 1.15, len(x))
        scene.plan.on_sides("Box ball", meshes, x, y, 0.3, 50 * size, size, sides=[number])
    bushes = []
    for _ in range(2):
        model = Model(scene)
        count = scene.count(100)
        out = directions(random, scene.count(350))
        out[:, 2] = np.abs(out[:, 2]) + 0.3
        model.add(leaves_at(random, out * (0.06, 0.06, 0.02), out, 0.26, 0.07), "Olive leaf")
        lean = unit(random.normal((0, 0, 1), (0.33, 0.33, 0), (count, 3)))
        tall = random.uniform(0.33, 0.46, (count, 1))
        model.add(leaves_at(random, lean * 0.05, lean, tall[:, 0], 0.012), "Olive leaf")
        for below in np.arange(5) * 0.02 - 0.09:
            forward = directions(random, count) + lean
            model.add(leaves_at(random, lean * (tall + below), forward, 0.032, 0.7), "Lavender")
        bushes.append(model.mesh("Lavender"))
    x = np.arange(1.95, scene.plan.lawn - 0.85, 0.42)
    size = random.uniform(0.8, 1.1, len(x))
    sunny = (NORTH, EAST, WEST)
    scene.plan.on_sides("Lavender", bushes, x, scene.plan.lawn - 0.3, 0, 200 * x, size, sides=sunny)


def hedges(scene: Scene[Cloister]) -> None:
    """Low hedges of box along the paths, where no rig is near."""
    if not scene.plan.has_hedges:
        return
    random = scene.random("hedges")
    model = Model(scene)
    model.add(leaf_cloud(random, scene.count(2000), (0.42, 0.24, 0.28), 0.038, 0.65), "Box leaf")
    model.add(icosphere(2, 1.0).scaled(0.38, 0.2, 0.24), "Turf")
    mesh = model.mesh("Hedge")
    along = np.arange(PLAZA + 0.6, scene.plan.lawn - 0.3, 0.62)
    path = np.full_like(along, CROSS_PATH + 0.3)
    edge = np.full_like(along, scene.plan.lawn - 0.3)
    x = np.concatenate([path, along, edge, along])
    y = np.concatenate([along, path, along, edge])
    turn = np.where(np.arange(len(x)) // len(along) % 2, 0, 90)
    for number in plan.SIDES:
        spots = [scene.plan.side(number, (*spot, 0)).translation for spot in zip(x, y, strict=True)]
        away = np.array([max(abs(spot.x), abs(spot.y)) > 2.6 for spot in spots])
        scene.plan.on_sides("Hedge", [mesh], x[away], y[away], 0.2, turn[away], sides=[number])


def fallen_leaves(scene: Scene[Cloister]) -> None:
    """Dry leaves on the paths and lawns, thicker along the walls."""
    random = scene.random("fallen leaves")
    count = scene.count(1500)
    inwards = random.random((2, count)) ** 1.7
    x, y = (scene.plan.arcade - 0.4) * (1 - inwards) * random.choice([-1, 1], (2, count))
    at = xyz(x, y, random.uniform(0.022, 0.03, count))[np.hypot(x, y) > 1.6]
    forward = random.normal((0, 0, 0.2), (1, 1, 0.1), at.shape)
    up = random.normal((0, 0, 1), 0.3, at.shape)
    size = random.uniform(0.04, 0.075, len(at))
    shape = copies(folded_leaf(0.55), at, forward, up, size)
    scene.add("Fallen leaves", shape, "Dead leaf", matrix=scene.plan.side(NORTH), smooth=False)
