"""The pond: clear water over a dark bed, lily pads, carp, and iris on its shore."""

import numpy as np
from mathutils import Matrix

from scenes.garden.plan import TAU, WATER_LEVEL, GardenPlan
from scenes.library.plants import blade, tuft
from scenes.library.points import Array, noise, points, polar, xyz
from scenes.library.scene import Scene, scatter
from scenes.library.shapes import copies, facets, join, sheet, transform


def water(scene: Scene[GardenPlan]) -> None:
    """The pond's surface."""
    shore = scene.plan.pond_shore(np.linspace(0, TAU, scene.segments(120, 16), endpoint=False))
    inwards = np.linspace(1.0, 0.02, scene.segments(12, 3))[:, None, None]
    x, y = np.moveaxis(
        np.array(scene.plan.pond_center) + inwards * (shore - np.array(scene.plan.pond_center)),
        -1,
        0,
    )
    scene.add("Water", sheet(xyz(x, y, WATER_LEVEL), closed=True), "Water")


def water_lilies(scene: Scene[GardenPlan]) -> None:
    """Drifts of lily pads, some with a flower of three rings of petals."""
    random = scene.random("pond")
    angle = np.linspace(0.16, TAU - 0.16, scene.segments(40, 8))
    reach, rise = points([(1, 0.03), (0.97, 0.006), (0.6, 0.002), (0.05, 0)]).T[:, :, None]
    pad = scene.mesh("Lily pad", sheet(polar(reach, angle, rise)), "Lily pad")
    u = np.linspace(0, 1, scene.segments(7, 3))[:, None]
    v = np.linspace(-1, 1, 5)
    width = 0.022 * np.sin(np.pi * (0.1 + 0.9 * u))
    petal = sheet(xyz(width * v, 0.085 * u, 0.03 * u**2 + 0.006 * v * v))
    rings = []
    for count, lift, size in ((9, 0.1, 1.0), (8, 0.6, 0.9), (6, 1.3, 0.75)):
        out = polar(1, (np.arange(count) + 0.3 * size) * TAU / count, lift)
        rings.append(copies(petal, np.full((count, 3), (0, 0, 0.01)), out, size=size))
    lily = scene.mesh("Water lily", join(rings), "Lily petal")

    def allowed(x: Array, y: Array) -> Array:
        return (noise(xyz(x, y) / 1.3, 91) > 0.02) & (scene.plan.pond_distance(x, y) < -0.45)

    def afloat(x: float, y: float, low: float, high: float) -> Matrix:
        turn = (0, 0, random.uniform(0, TAU))
        return transform((x, y, WATER_LEVEL + 0.008), turn, random.uniform(low, high))

    spots = scene.plan.spread(
        random,
        34,
        (*(np.array(scene.plan.pond_center) - 3.2), *(np.array(scene.plan.pond_center) + 3.2)),
        0.30,
        allowed,
    )
    scatter("Lily pad", [pad], [afloat(x, y, 0.10, 0.19) for x, y in spots])
    scatter("Water lily", [lily], [afloat(x + 0.1, y, 0.8, 1.2) for x, y in spots[::6]])


def carp(scene: Scene[GardenPlan]) -> None:
    """Koi under the surface."""
    t = np.linspace(0, 1, scene.segments(28, 8))
    radius = 0.062 * np.sin(np.pi * t**0.6) ** 0.8 * (1 - 0.35 * t) + 0.004
    kinds = []
    for i, bend in enumerate((0.35, -0.3, 0.1)):
        sway = 0.09 * np.sin(TAU * 0.7 * t + i) * bend * (t + 0.3)
        spine = xyz(sway, 0.25 - 0.46 * t, 0)
        tail = points([(0, 0, 0), (0.03, -0.14, 0.06), (0, -0.09, 0), (0.03, -0.14, -0.06)])
        tail = tail + spine[-1]
        side = points(
            [(0.05, 0.12, -0.02), (0.14, 0.05, -0.03), (0.12, 0.01, -0.03), (0.05, 0.07, -0.02)]
        )
        ridge = spine[[9 * len(t) // 28, len(t) // 2, 2 * len(t) // 3, 2 * len(t) // 3]]
        ridge = ridge + points([(0, 0.02, 0.04), (0, 0, 0.085), (0, 0, 0.06), (0, 0, 0.03)])
        fins = [facets(fin, (0, 1, 2, 3)) for fin in (tail, side, side * (-1, 1, 1), ridge)]
        kinds.append(scene.mesh(f"Koi.{i}", join([scene.tube(spine, radius, 16), *fins]), "Koi"))
    places = [transform((x, y, WATER_LEVEL - 0.13), (0, 0, a), 0.9) for x, y, a in scene.plan.koi]
    scatter("Koi", kinds, places)


def iris(scene: Scene[GardenPlan]) -> None:
    """Sheaves of sword-like leaves along the far shore."""
    random = scene.random("iris")
    count = scene.count(46, 8)
    leaf = blade(0.018, 6, 0.35)
    sheaves = [tuft(random, leaf, count, 0.15, (0.35, 0.8)) for _ in range(2)]
    angle = np.concatenate([random.uniform(1.2, 5.2, 20), random.uniform(-0.9, 0.9, 3)])
    shore = (
        np.array(scene.plan.pond_center)
        + (scene.plan.pond_shore(angle) - np.array(scene.plan.pond_center)) * 1.06
    )
    meshes = [scene.mesh("Iris", sheaf, "Iris leaves") for sheaf in sheaves]
    scatter("Iris", meshes, scene.plan.standing(random, shore, (0.8, 1.2)))
