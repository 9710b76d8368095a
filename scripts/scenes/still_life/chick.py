"""A chick, of balls and some thousand hairs of down."""

import bpy
import numpy as np

from scenes.library.points import mirrored, points, unit
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform

# Middle, half axes, hairs and their length; the chick looks along −Y.
PARTS = (
    ((0, 0.004, 0.044), (0.036, 0.041, 0.033), 9000, 0.0125),
    ((0, -0.022, 0.092), (0.0245, 0.0245, 0.0235), 5200, 0.0085),
    ((0.031, 0.008, 0.047), (0.010, 0.025, 0.019), 1800, 0.0105),
    ((-0.031, 0.008, 0.047), (0.010, 0.025, 0.019), 1800, 0.0105),
    ((0, 0.043, 0.055), (0.012, 0.014, 0.011), 900, 0.0125),
)
# Of the right foot: leg and middle toe, and the toes beside it; with their radii.
FOOT = (
    (
        [
            (0.014, -0.004, 0.014),
            (0.015, -0.008, 0.005),
            (0.0155, -0.018, 0.0018),
            (0.016, -0.028, 0.0015),
        ],
        0.0019,
    ),
    ([(0.0155, -0.01, 0.003), (0.021, -0.018, 0.0018), (0.025, -0.025, 0.0015)], 0.0017),
    ([(0.0155, -0.01, 0.003), (0.010, -0.018, 0.0018), (0.007, -0.025, 0.0015)], 0.0017),
)
# without down
EYES_AND_BEAK = [
    (0.0128, -0.0455, 0.0975),
    (-0.0128, -0.0455, 0.0975),
    (0, -0.049, 0.089),
]
STEPS = 6


def chick(scene: Scene) -> None:
    """Its hairs point outwards, backwards and down, each a little curled."""
    matrix = transform((-0.105, -0.145, 0), (0, 0, np.radians(-22)))
    model = Model(scene)
    found = []
    t = np.linspace(0, 1, STEPS)[:, None]
    model.lathe(
        profile=[(0.0052, 0), (0.0044, 0.005), (0.0018, 0.0105), (0.0003, 0.0135)],
        at=(0, -0.0452, 0.089),
        turned=(98, 0, 0),
        scaled=(1, 0.75, 1),
        material="Beak",
    )
    model.ball(radius=0.0037, at=mirrored(x=0.0128, y=-0.0415, z=0.0975), material="Eye")
    for path, radius in FOOT:
        for side in (-1, 1):
            model.add(scene.bend(points(path) * (side, 1, 1), radius, 14, 10), "Beak")
    for middle, axes, full, length in PARTS:
        model.add(scene.ball(1.0, 32), "Skin", middle, scale=axes)
        random = scene.random(f"down {middle}")
        count = scene.count(full, 60)
        outward = unit(random.normal(size=(count, 3)))
        normal = unit(outward / axes)
        lean = unit(normal + (0, 0.55, -0.45) + 0.28 * random.normal(size=(count, 3)))
        curl = 0.35 * random.normal(size=(count, 3)) + (0, 0.1, -0.35)
        reach = length * random.uniform(0.65, 1.15, count)[:, None, None]
        roots = (middle + outward * axes)[:, None]
        found.append(roots + reach * (t * lean[:, None] + 0.5 * t**2 * curl[:, None]))
    place("Chick", model.mesh("Chick", True), matrix)
    hairs = np.concatenate(found)
    hairs[..., 2] = np.maximum(hairs[..., 2], 0.002)
    away = np.linalg.norm(hairs[:, 0, None] - points(EYES_AND_BEAK), axis=-1)
    hairs = hairs[(away > (0.0062, 0.0062, 0.0075)).all(axis=1)]
    down = bpy.data.hair_curves.new("Down")
    down.add_curves([STEPS] * len(hairs))
    down.points.foreach_set("position", hairs.astype(np.float32).ravel())
    radii = np.tile(np.linspace(0.00011, 0.00002, STEPS, dtype=np.float32), len(hairs))
    down.points.foreach_set("radius", radii)
    down.materials.append(bpy.data.materials["Down"])
    place("Down", down, matrix)
