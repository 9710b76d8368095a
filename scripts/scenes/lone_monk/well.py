"""The well in the middle of the court."""

import numpy as np

from scenes.library.architecture import arch_outline, ring_of_stones, upright
from scenes.library.model import Model
from scenes.library.objects import place
from scenes.library.points import points, polar, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import join
from scenes.lone_monk.plan import NORTH, side

# Rings of stones: how many, the radius of their middle, their width, middle height, and height.
COURSES = """20 1.20 0.62 0.08 0.16, 16 0.98 0.42 0.22 0.16, 14 0.68 0.2 0.42 0.24
    14 0.68 0.2 0.655 0.22, 14 0.68 0.2 0.87 0.2, 10 0.69 0.32 1.035 0.12"""
SLACK = "-0.3 0.3 1.13, -0.22 0.2 1.3, -0.12 0.04 1.9, -0.1 0 2.42"  # rope


def well(scene: Scene) -> None:
    """Steps, a ring of stones, and an iron arch that carries pulley, rope and two buckets."""
    model = Model(scene)
    for count, radius, width, z, height in points(COURSES):
        ring = ring_of_stones(int(count), radius, width, z, height)
        model.add(ring, "Limestone", degrees=(0, 0, 50 * z))
    model.add(scene.lathe("0.585 0, 0.585 0.96", capped=False), "Limestone")
    model.add(scene.lathe("0.59 0.30, 0.58 0.31"), "Water")

    x, z = arch_outline(0.68, 1.08, 2.25, 0.45, scene.segments(24)).T
    curl = np.linspace(0, 1.6 * np.pi, scene.segments(20))
    spiral = upright(scene.tube(polar(0.028 * curl, curl) - (0.18, 0, 0), 0.01, 6))
    foot = join([scene.lathe("0.06 1.09, 0.05 1.12, 0.03 1.14"), spiral.moved(0, 0, 2.2)])
    cross = scene.tube("0 0 2.52, 0 0 3.05", 0.015), scene.tube("-0.1 0 2.95, 0.1 0 2.95", 0.014)
    model.add(join([scene.tube(xyz(x, 0, z), 0.022), *cross]), "Iron")
    for x, turn in ((0.68, 0), (-0.68, 180)):
        model.add(foot, "Iron", (x, 0, 0), (0, 0, turn))

    pulley = (0, 0, 2.42)
    wheel = scene.lathe("0.02 -0.03, 0.12 -0.03, 0.09 0, 0.12 0.03, 0.02 0.03")
    model.add(upright(wheel), "Wood", pulley)
    over, coil = np.linspace(np.pi, 0, 9), np.linspace(0, 8 * np.pi, scene.segments(90))
    model.add(upright(scene.tube(polar(0.1, over), 0.013, 6)), "Rope", pulley)
    for path in ("0.1 0 2.42, 0.1 0 2, 0.1 0.01 1.62", SLACK):
        model.add(scene.bend(path, 0.013, 12, 6), "Rope")
    model.add(scene.tube(polar(0.13, coil, 0.003 * coil), 0.013, 6), "Rope", (-0.43, 0.53, 1.11))
    place("Well", model.mesh("Well"), side(NORTH))
    pail = bucket(scene).mesh("Bucket")
    place("Bucket.0", pail, side(NORTH, (0.10, 0.01, 1.25)))
    place("Bucket.1", pail, side(NORTH, (1.02, -0.62, 0.305), 34))


def bucket(scene: Scene) -> Model:
    """A wooden bucket of staves with iron hoops and a handle; stands on its origin."""
    model = Model(scene)
    staves = ring_of_stones(14, 0.12, 0.018, 0.13, 0.26)
    flare = 1 + 0.35 * staves.vertices[:, 2:] * (1, 1, 0)
    model.add(staves.reshaped(staves.vertices * flare), "Wood")
    model.add(scene.lathe("0.115 0.02, 0.115 0.03", 14), "Wood")
    for corner in points("0.134 0.05, 0.143 0.19"):
        band = points("0 0, 0.004 0, 0.004 0.025, 0 0.025") + corner
        model.add(scene.lathe(band, 20, capped=False), "Iron")
    handle = scene.tube(polar(1, np.linspace(0, np.pi, 13)) * (0.14, 0.12, 1), 0.006, 6)
    model.add(upright(handle), "Iron", (0, 0, 0.25))
    return model
