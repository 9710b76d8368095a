"""The plants on the ground: azaleas, grass, and the maple's fallen leaves."""

import numpy as np

from scenes.garden.court import flagstone_layout, raked_height
from scenes.garden.plan import TAU, GardenPlan
from scenes.garden.trees import maple_leaf
from scenes.library.plants import blade, oval_leaf, tuft
from scenes.library.points import Array, noise, polar, xyz
from scenes.library.scene import Scene, scatter
from scenes.library.shapes import copies, icosphere, join


def shrubs(scene: Scene[GardenPlan]) -> None:
    """Azaleas clipped into cushions 1 m across: a core, leaves, and flowers for a part of them."""
    random = scene.random("shrubs")
    leaf = oval_leaf()
    core = icosphere(scene.segments(3, 2))
    meshes = []
    count = scene.count(3600, 60)
    for shift, flowers in ((0.0, 0.0), (7.0, 0.12), (14.0, 0.3)):
        z = random.uniform(-0.1, 1.0, count)
        out = polar(np.sqrt(1 - z * z), random.uniform(0, TAU, count), z)
        lumps = 1 + 0.16 * noise(out * 1.6 + shift, 96, 2)[:, None]
        spots = out * 0.5 * lumps * random.uniform(0.9, 1.03, (count, 1)) * (1, 1, 0.85)
        forward = random.normal(0, 1, (count, 3))
        up = out + random.normal(0, 0.45, (count, 3))
        leaves = copies(leaf, spots, forward, up, random.uniform(0.035, 0.06, count))
        slots = np.where(random.random(count) < flowers, 2, 1)
        leaves = leaves._replace(slots=np.repeat(slots, len(leaf.triangles)).astype(np.int32))
        inner = 0.42 * (1 + 0.16 * noise(core.vertices * 1.6 + shift, 96, 2))[:, None]
        shape = join([core.reshaped(core.vertices * inner * (1, 1, 0.85)), leaves])
        meshes.append(scene.mesh("Shrub", shape, "Shrub core", "Azalea leaves", "Azalea flowers"))

    def allowed(x: Array, y: Array) -> Array:
        apart = [np.hypot(x - tx, y - ty) for tx, ty in scene.plan.in_the_moss]
        return (np.hypot(x, y) < 14) & (np.min(apart, axis=0) > 0.6)

    off = {"court": 0.75, "pond": 0.9, "path": 1.3}
    spots = scene.plan.spread(random, 56, (-14, -14, 14, 14), 1.15, allowed, **off)
    scatter("Shrub", meshes, scene.plan.standing(random, spots, (0.8, 1.9)))


def grass(scene: Scene[GardenPlan]) -> None:
    """Grass in the moss around the court, taller towards the woods."""
    random = scene.random("grass")
    count = scene.count(760, 30)
    leaf = blade(0.04, 3, 0.5)
    tufts = [tuft(random, leaf, count, 0.6, (0.05, 0.15)) for _ in range(4)]
    meshes = [scene.mesh("Grass", each, "Grass") for each in tufts]

    def patch(x: Array, y: Array) -> Array:
        return noise(xyz(x, y) / 2.2, 97, 2) > -0.12

    def farther(x: Array, y: Array) -> Array:
        return patch(x, y) & (np.hypot(x, y) > 9.5)

    off = {"court": 0.5, "pond": 0.25, "path": 0.95}
    count = scene.count(330, 40)
    near = scene.plan.spread(random, count, (-9.5, -9.5, 9.5, 9.5), 0.66, patch, **off)
    far = scene.plan.spread(random, scene.count(190, 40), (-22, -22, 22, 22), 1.55, farther, **off)
    places = scene.plan.standing(random, near, (0.8, 1.25), sloping=True)
    scatter("Grass", meshes, places + scene.plan.standing(random, far, (1.8, 2.8), sloping=True))


def fallen_leaves(scene: Scene[GardenPlan]) -> None:
    """Maple leaves on the gravel and the flagstones, thickest under the crown."""
    random = scene.random("fallen leaves")
    count = scene.count(420, 20)
    under_crown = random.normal((-1.2, -2.0), 1.3, (count, 2))
    spots = np.vstack(
        [under_crown, random.uniform(scene.plan.court[:2], scene.plan.court[2:], (count // 3, 2))]
    )
    spots = spots[scene.plan.court_distance(*spots.T) < -0.2]
    stones = flagstone_layout(scene)
    heights = raked_height(scene.plan, *spots.T, stones) + 0.012
    is_kept = np.ones(len(spots), dtype=bool)
    for outline, height in stones:
        reach = np.hypot(*(spots - outline.mean(0)).T)
        radius = np.hypot(*(outline - outline.mean(0)).T)
        on_stone = reach < 0.72 * radius.min()
        heights[on_stone] = height + 0.008
        is_kept &= on_stone | (reach > radius.max() + 0.04)  # none across a stone's rim
    at = xyz(*spots[is_kept].T, heights[is_kept])
    count = len(at)
    forward = polar(1, random.uniform(0, TAU, count), random.normal(0, 0.05, count))
    up = random.normal((0, 0, 1), (0.12, 0.12, 0.0), (count, 3))
    leaves = copies(maple_leaf(), at, forward, up, random.uniform(0.05, 0.085, count))
    scene.add("Fallen leaves", leaves, "Fallen maple leaves")
