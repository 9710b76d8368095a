"""Trees: bamboo groves, the red maple over the viewer, pruned pines, and the woods around."""

import numpy as np

from scenes.garden.plan import TAU, GardenPlan
from scenes.library.plants import Growth, branches, leaves_on, oval_leaf
from scenes.library.points import Array, noise, points, polar, smoothstep, xyz
from scenes.library.scene import Scene, place, scatter
from scenes.library.shapes import Shape, copies, facets, join, sheet, transform, tube

MAPLE_GROWTH = Growth(
    (2.9, 3.5, 1.5, 0.65), (9, 6, 4), (1.0, 0.8, 0.7), (0.05, 0.055, 0.0, -0.02), 0.17, 0.13, 0.62
)
WOOD_GROWTH = Growth(
    (4.2, 2.6, 1.5, 0.7), (9, 6, 4), (0.95, 0.8, 0.7), (0.03, 0.07, 0.04, 0.0), 0.2, 0.14, 0.35
)


def bamboo(scene: Scene[GardenPlan]) -> None:
    """Groves of bamboo behind the statue and beside the path."""
    random = scene.random("bamboo")
    used = ("Bamboo culm", "Bamboo leaves")
    meshes = [scene.mesh(f"Bamboo.{i}", bamboo_culm(scene, i), *used) for i in range(5)]
    places = []
    for corners, count in scene.plan.groves:
        spots = scene.plan.spread(random, count, corners, 0.34, pond=0.5, path=1.6)
        places += scene.plan.standing(random, spots, (0.75, 1.1), 0.05, 0.03)
    scatter("Bamboo", meshes, places)


def bamboo_culm(scene: Scene, number: int) -> Shape:
    """A culm with its rings, side twigs and leaves (slot 1), 6 to 7.5 m high."""
    random = scene.random(f"bamboo{number}")
    height = random.uniform(6.0, 7.5)
    lean = random.normal(0, 0.05, 2)
    joints = np.cumsum(np.linspace(0.16, 0.36, 24))
    joints = np.concatenate([[0.0], joints[joints < height * 0.96]])

    def middle(z: Array) -> Array:
        bow = z + 9 * np.maximum(z / height, 0.0) ** 2.5
        return xyz(lean[0] * bow, lean[1] * bow, z)

    levels = (joints[:, None] + (-0.012, 0, 0.012, 0.05)).ravel()
    levels[0] = -0.2
    thick = 0.042 * (1 - 0.75 * (joints[:, None] / height) ** 1.5) * (1, 1.14, 0.98, 1)
    parts = [scene.tube(middle(levels), thick.ravel(), 10)]
    spots = []
    forward = []
    for z in joints[joints > 1.7]:
        for _ in range(random.integers(1, 4)):
            length = random.uniform(0.35, 0.8) * (1.1 - 0.5 * z / height)
            out = polar(1, random.uniform(0, TAU), random.uniform(0.3, 0.9))
            count = scene.count(7, 2)
            t = np.concatenate([np.linspace(0, 1, 5), random.uniform(0.25, 1.0, count)])[:, None]
            along = middle(z) + length * (t * out - t**2 * (0, 0, 0.45))
            parts.append(tube(along[:5], np.linspace(0.005, 0.001, 5), 3, capped=False))
            spots.append(along[5:])
            forward.append(out * 0.6 + random.normal(0, 0.55, (count, 3)) - (0, 0, 0.35))
    at = np.concatenate(spots)
    up = random.normal((0, 0, 1), 0.5, at.shape)
    size = random.uniform(0.15, 0.27, len(at))
    half, y = points([(0, 0), (0.055, 0.25), (0.05, 0.6), (0, 1)]).T[:, :, None]
    x = half * (-1, 0, 1)
    leaf = sheet(xyz(x, y, 0.03 * (x != 0) - 0.25 * y * y))  # folded along its rib
    leaves = copies(leaf, at, np.concatenate(forward), up, size)
    return join([*parts, leaves.painted(1)])


def maple_leaf() -> Shape:
    """A leaf of five pointed lobes, 1 long along +Y, as a fan of triangles round its middle."""
    tips = points([(-0.55, 0.12), (-0.5, 0.6), (0, 1), (0.5, 0.6), (0.55, 0.12)])
    notches = 0.21 * (tips[:-1] + tips[1:]) + (0, 0.12)
    rim = np.zeros((10, 3))  # the stalk, then tips and notches in turn
    rim[1::2, :2] = tips
    rim[2::2, :2] = notches
    rim[1::2, 2] = -0.10 * (np.abs(tips[:, 0]) + tips[:, 1])
    rim[2::2, 2] = 0.02
    fan = [(10, (i + 1) % 10, i) for i in range(10)]
    return facets([*rim, (0.0, 0.25, 0.03)], *fan)


def maple(scene: Scene[GardenPlan]) -> None:
    """A red maple whose crown reaches over the viewer, high enough to leave the rigs clear."""
    random = scene.random("maple")
    wood, twigs = branches(scene, random, MAPLE_GROWTH)
    count = scene.count(28, 3)
    leaves = leaves_on(random, twigs, maple_leaf(), count, (0.065, 0.115), 0.35, 0.08)
    z = float(scene.plan.ground_height(*scene.plan.maple))
    spot = transform(
        (*scene.plan.maple, z), (0.0, 0.14, np.arctan2(-scene.plan.maple[1], -scene.plan.maple[0]))
    )
    shape = join([wood, leaves.painted(1)]).transformed(spot)
    # Lift the parts of the crown over the rigs above 2.2 m.
    x, y, height = shape.vertices.T
    over = smoothstep(2.9, 1.9, np.hypot(x, y))
    raised = np.where(height < 3.2, 2.2 + np.maximum(height, 0.0) / 3.2, height)
    shape = shape.reshaped(xyz(x, y, height + over * (raised - height)))
    tree = scene.mesh("Maple", shape.transformed(spot.inverted()), "Maple bark", "Maple leaves")
    place("Maple", tree, spot)
    for name, (x, y), turn, size in zip(
        ("Maple far", "Maple farther"), scene.plan.far_maples, (2.5, 4.5), (1.05, 1.1), strict=False
    ):
        place(name, tree, transform((x, y, 0.1), (0, 0, turn), size))


def pines(scene: Scene[GardenPlan]) -> None:
    """Cloud-pruned pines, 3 m high: swaying stems, limbs, and a dome of brushes on each."""
    random = scene.random("pines")
    meshes = []
    needle = sheet(xyz([[-0.045, 0.045], [-0.04, 0.04], [-0.004, 0.004]], [[0], [0.5], [1]]))
    for number in range(2):
        out = random.normal((0, 0, 0.7), 0.6, (9, 3))
        up = random.normal(0, 1, (9, 3))
        brush = copies(needle, np.zeros((9, 3)), out, up, 0.11)
        t = np.linspace(0, 1, 14)
        turn = random.uniform(0, TAU)
        stem = polar(0.42 * np.sin(t * 6.0 + number) * t, turn, 3.1 * t - 0.2)
        parts = [scene.tube(stem, np.linspace(0.15, 0.04, 14), 12)]
        pads = []
        for k, at in enumerate((4, 6, 7, 9, 10, 11, 13)):
            reach = 0.0 if at == 13 else 1.35 - 0.075 * at
            size = 0.75 - 0.022 * at
            tip = stem[at] + polar(reach, turn + 2.2 * k, 0.12)
            if reach:
                bow = np.linspace(0, 1, 6)[:, None]
                path = stem[at] + bow * (tip - stem[at]) - (0, 0, 0.12) * np.sin(np.pi * bow)
                parts.append(scene.tube(path, np.linspace(0.05, 0.02, 6)))
            count = scene.count(520 * size, 12)
            radius = np.sqrt(random.random(count))
            dome = (1 - radius**2) * 0.45 * random.uniform(0.2, 1.0, count)
            spots = size * polar(radius, random.uniform(0, TAU, count), dome)
            forward = random.normal(0, 1, (count, 3)) * (1, 1, 0.1)
            upwards = spots * (1.2, 1.2, 0.4) + (0, 0, 0.6)
            sizes = random.uniform(0.8, 1.25, count)
            pads.append(copies(brush, spots + tip, forward, upwards, sizes))
        tree = join([*parts, join(pads).painted(1)])
        meshes.append(scene.mesh("Pine", tree, "Pine bark", "Pine needles"))
    scatter("Pine", meshes, scene.plan.standing(random, points(scene.plan.pines), (0.85, 1.3)))


def woods(scene: Scene[GardenPlan]) -> None:
    """Broad-leaved trees around the garden, thinning out towards the hills."""
    random = scene.random("woods")
    simpler = Scene(scene.seed, 0.3 * scene.detail, scene.plan)
    meshes = []
    for colour in ("Green", "Yellowing", "Autumn"):
        wood, twigs = branches(simpler, random, WOOD_GROWTH)
        count = scene.count(20, 2)
        leaves = leaves_on(random, twigs, oval_leaf(), count, (0.2, 0.34), 0.2, 0.14)
        shape = join([wood, leaves.painted(1)])
        meshes.append(scene.mesh(f"{colour} tree", shape, "Bark", f"{colour} leaves"))

    def allowed(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        open_to_sun = np.cos(np.arctan2(y, x) - scene.plan.sky.sun_azimuth) >= 0.93
        thicket = noise(xyz(x, y) / 16.0, 95) > -0.05 - 0.1 * (r < 25)
        return (r > 11.5) & (r < 75) & (~open_to_sun | (r > 30)) & thicket

    near = scene.plan.spread(random, 40, (-26, -26, 26, 26), 3.4, allowed, path=3)
    far = scene.plan.spread(random, 90, (-75, -75, 75, 75), 4.5, allowed, path=3)
    places = scene.plan.standing(random, np.vstack([near, far]), (0.75, 1.35), 0.1, 0.03)
    scatter("Tree", [meshes[k] for k in (0, 1, 0, 1, 0, 2, 0, 1)], places)
