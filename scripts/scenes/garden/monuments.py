"""The statue, a seated bronze figure with a halo; the mirror beside it; the torii over the path."""

from collections.abc import Sequence

import bpy
import numpy as np

from scenes.garden.plan import TAU, GardenPlan
from scenes.library import shapes
from scenes.library.architecture import upright
from scenes.library.points import Points, noise, points, polar, smoothstep, xyz
from scenes.library.scene import Scene, place
from scenes.library.shapes import Shape, box, copies, icosphere, join, sheet, transform


def statue(scene: Scene[GardenPlan]) -> None:
    """The figure on a lotus seat and a granite plinth, with a halo of polished brass."""
    x, y = scene.plan.statue
    for i, (width, low, high) in enumerate(
        points([(1.55, -0.1, 0.14), (1.32, 0.14, 0.5), (1.45, 0.5, 0.58)])
    ):
        block = box((width, width, high - low), 0.02, 3)
        spot = (x, y, (low + high) / 2)
        scene.add(f"Plinth.{i}", block, "Plinth granite", matrix=transform(spot))
    seat = transform((x, y, 0.58), scale=1.05)
    spot = transform((x, y, 0.78), scale=0.92)
    scene.add("Lotus", lotus(scene), "Rough bronze", matrix=seat)
    scene.add("Statue", join([figure(scene), curls(scene)]), "Rough bronze", matrix=spot)
    halo = [scene.ring(0.30, 0.016, 96, 12), scene.ring(0.39, 0.008, 96)]
    for k, angle in enumerate(np.arange(48) * TAU / 48):  # rays, in turn short and long
        reach = np.array([0.30, 0.345, 0.414]) + (k % 2) * np.array([0, 0.08, 0.07])
        halo.append(shapes.tube(polar(reach, angle), [0.007, 0.010, 0.0023], 6))
    spot = transform((x, y + 0.2, 2.05))
    scene.add("Halo", upright(join(halo)), "Polished brass", matrix=spot)
    stem = scene.tube([(0, 0, 0), (0, 0.02, 0.6), (0, 0, 1.35)], 0.018, 10)
    scene.add("Halo stem", stem, "Polished brass", matrix=transform((x, y + 0.22, 0.75)))


def ellipsoid(center: Sequence[float], radii: Sequence[float]) -> Shape:
    return icosphere(4).transformed(transform(center, scale=radii))


def limb(path: Points, radii: Sequence[float]) -> Shape:
    """A limb: a tube along the points with round ends."""
    knots = points(path)
    t = np.linspace(0, len(knots) - 1, 24)
    middle = np.stack([np.interp(t, np.arange(len(knots)), axis) for axis in knots.T], axis=-1)
    radius = np.interp(t, np.arange(len(knots)), radii)
    ends = [ellipsoid(knots[i], (radii[i],) * 3) for i in (0, -1)]
    return join([shapes.tube(middle, radius, 20), *ends])


# The parts of the body that are ellipsoids: centre and radii.
BODY = [
    (0, 0.06, 0.20, 0.38, 0.28, 0.21),
    (0, 0.06, 0.50, 0.26, 0.20, 0.36),
    (0, 0.03, 0.80, 0.30, 0.20, 0.23),
    (0, -0.01, 1.36, 0.160, 0.180, 0.205),
    (0, -0.10, 1.24, 0.085, 0.075, 0.06),
    (0, -0.188, 1.345, 0.024, 0.035, 0.055),
    (0, -0.160, 1.275, 0.055, 0.035, 0.016),
    (0, 0.02, 1.42, 0.172, 0.180, 0.180),
    (0, 0.03, 1.60, 0.085, 0.085, 0.075),
]
# Hand, ear and brow on the left. The right side mirrors these, and the arm and the leg.
LEFT = [
    (0.06, -0.35, 0.32, 0.13, 0.075, 0.05),
    (0.165, 0, 1.31, 0.022, 0.042, 0.11),
    (0.065, -0.158, 1.385, 0.045, 0.028, 0.018),
]
ARM = [(0.32, 0.03, 0.93), (0.43, 0, 0.56), (0.09, -0.34, 0.34)]
ARM_RADII = (0.115, 0.092, 0.055)
LEG = [(0.2, 0.06, 0.17), (0.55, -0.18, 0.13), (-0.10, -0.40, 0.13)]
LEG_RADII = (0.17, 0.135, 0.09)


def figure(scene: Scene) -> Shape:
    """The seated figure, 1.7 m high, facing −Y: parts melted into one skin, with a folded robe."""
    parts = [limb([(0, 0.04, 0.95), (0, 0.02, 1.2)], (0.13, 0.095))]
    parts += [ellipsoid(part[:3], part[3:]) for part in points(BODY)]
    for mirror in ((-1, 1, 1), (1, 1, 1)):
        parts += [ellipsoid(part[:3] * mirror, part[3:]) for part in points(LEFT)]
        parts += [limb(points(ARM) * mirror, ARM_RADII), limb(points(LEG) * mirror, LEG_RADII)]
    body = scene.add("Statue parts", join(parts))
    remesh = body.modifiers.new("Melt", "REMESH")
    remesh.mode = "VOXEL"
    remesh.voxel_size = 0.011 / scene.detail**0.5
    smooth = body.modifiers.new("Smooth", "SMOOTH")
    smooth.factor = 0.5
    smooth.iterations = 4
    melted = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    skin = shapes.mesh_shape(melted.data)
    bpy.data.batch_remove([body, body.data])
    # Folds of cloth pressed into the robe: over the left shoulder, and around arms and legs.
    x, y, z = skin.vertices.T
    outward = skin.vertices - xyz(0.5 * x, 0.05, np.clip(z, 0.2, 0.8))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    across = z - 0.55 * x + 1.2 * y * y + 0.05 * noise(skin.vertices * 3.0, 51, 2)
    robe = smoothstep(-0.02, 0.02, x + 0.34 * (z - 0.45) + 0.1) * smoothstep(1.02, 0.95, z)
    robe = np.maximum(robe, smoothstep(0.42, 0.36, z))
    hands = smoothstep(0.17, 0.13, np.hypot(x, (z - 0.33) * 1.4)) * smoothstep(-0.22, -0.27, y)
    folds = (0.010 * np.abs(np.sin(across * 34)) ** 0.7 + 0.008) * robe * (1 - hands)
    return skin.reshaped(skin.vertices + outward * folds[:, None])


def curls(scene: Scene) -> Shape:
    """The figure's hair: small snail curls on the skull and its knot."""
    curl = icosphere(scene.segments(2, 1))
    places = []
    for center, radii, count, lowest in (
        ((0, 0.02, 1.42), (0.172, 0.180, 0.180), 260, -0.35),
        ((0, 0.03, 1.60), (0.085, 0.085, 0.075), 70, -0.2),
    ):
        k = np.arange(count) + 0.5
        z = 1 - 2 * k / count
        spiral = polar(np.sqrt(1 - z * z), k * TAU * 0.6180339887, z)
        hairline = lowest + 0.75 * smoothstep(0.1, -0.7, spiral[:, 1])
        places.append(center + spiral[z > hairline] * radii)
    return copies(curl, np.concatenate(places), size=0.021)


def lotus(scene: Scene) -> Shape:
    """The seat: a drum with two crowns of petals."""
    drum = scene.lathe([(0, 0), (0.52, 0), (0.60, 0.05), (0.56, 0.12), (0.60, 0.2), (0, 0.21)], 64)
    u = np.linspace(0, 1, scene.segments(10, 4))[:, None]
    v = np.linspace(-1, 1, scene.segments(9, 3))
    width = 0.115 * np.sin(np.pi * (0.15 + 0.85 * u)) ** 0.6
    bulge = 0.10 * np.sin(np.pi * 0.55 * u) - 0.03 * v**2 + 0.05 * u**4
    petal = sheet(xyz(width * v, bulge, 0.2 * u))
    parts = [drum]
    for start, radius, base in ((0.0, 0.57, 0.015), (0.5, 0.53, 0.06)):
        angle = (np.arange(18) + start) * TAU / 18
        parts.append(copies(petal, polar(radius, angle, base), forward=polar(1, angle)))
    return join(parts)


def mirror(scene: Scene[GardenPlan]) -> None:
    """A standing mirror in a dark wooden frame beside the statue, turned towards the viewer."""
    width, height = 0.82, 1.45
    parts = [box((width + 0.14, 0.05, 0.07), 0.012).moved(0, 0, z) for z in (0.0, height)]
    parts.append(box((width + 0.02, 0.012, height)).moved(0, 0.02, height / 2))
    for side in (-1, 1):
        inner, outer = side * (width / 2 + 0.035), side * (width / 2 + 0.12)
        parts.append(box((0.07, 0.05, height), 0.012).moved(inner, 0, height / 2))
        parts.append(box((0.07, 0.07, 1.3), 0.012).moved(outer, 0.02, 0.43))
        parts.append(box((0.09, 0.55, 0.07), 0.015).moved(outer, 0.02, -0.2))
    turn = np.radians(6.0) - np.arctan2(*scene.plan.mirror)  # towards the viewer
    spot = transform((*scene.plan.mirror, 0.24), (np.radians(-3.0), 0, turn))
    scene.add("Mirror frame", join(parts), "Dark wood", matrix=spot, smooth=0.7)
    pane = sheet(xyz([-width / 2, width / 2], 0.005, [[0], [height]]))
    place("Mirror", scene.mesh("Mirror", pane, "Mirror", smooth=False), spot)


def torii(scene: Scene[GardenPlan]) -> None:
    """Two leaning posts with black feet, a tie beam, and two lintels that rise at their ends."""
    beams = box((3.4, 0.12, 0.2), 0.01).moved(0, 0, 2.6), box((0.22, 0.1, 0.4), 0.01)
    red = [lintel(scene, 1.95, 3.17, 3.36, 0.12, 0.14), beams[0], beams[1].moved(0, 0, 2.9)]
    black = [lintel(scene, 2.2, 3.36, 3.46, 0.17, 0.2)]
    for side in (-1, 1):
        foot = np.array([side * 1.5, 0, -0.2])
        head = np.array([side * 1.36, 0, 3.2])
        red.append(scene.tube(np.linspace(foot, head, 9), np.linspace(0.15, 0.125, 9), 32))
        black.append(scene.tube(np.linspace(foot, foot + 0.16 * (head - foot), 3), 0.18, 32))
    spot = transform((*scene.plan.torii, float(scene.plan.ground_height(*scene.plan.torii))))
    shape = join([*red, join(black).painted(1)])
    scene.add("Torii", shape, "Vermilion", "Black lacquer", matrix=spot, smooth=0.6)


def lintel(scene: Scene, half: float, low: float, high: float, depth: float, rise: float) -> Shape:
    """A beam along x that is wider above than below and curves upwards to its ends."""
    x = np.linspace(1, -1, scene.segments(24, 6))[:, None]
    y, top = points([(-1, 0), (1, 0), (1, 1), (-1, 1)]).T  # around its section
    z = rise * np.abs(x) ** 2.4 + np.where(top == 1, high, low)
    rows = xyz(half * x * (1 + 0.03 * top), depth * y * (1 + 0.15 * top), z)
    return sheet(rows, closed=True, capped=True)
