"""The sky at sunrise, and what stands at the horizon: mountains, and fog before them."""

import numpy as np

from scenes.garden.plan import SUN_AZIMUTH, TAU
from scenes.library.lights import hdri_world, sun_light
from scenes.library.points import noise, points, polar, smoothstep, xyz
from scenes.library.scene import Scene, place
from scenes.library.shapes import facets, join, sheet, transform

# Where the sun stands in sunrise.exr: the sky is turned so that it stands where ours does.
SKY_SUN_AZIMUTH = np.radians(-35.5)
FOG_ARCS = 10


def sky(scene: Scene) -> None:
    """The sunrise that ships with bpy; a sun lamp, higher up, takes the place of its sun."""
    hdri_world("sunrise.exr", 2.0, SUN_AZIMUTH - SKY_SUN_AZIMUTH, brightest=8.0)
    sun_light("Sun", SUN_AZIMUTH, np.radians(35.0), 5.5, (1.0, 0.80, 0.58), np.radians(1.5))


def mountains(scene: Scene) -> None:
    """Ridges all round the horizon, lower where the sun rises."""
    angle = np.linspace(0, TAU, scene.segments(540), endpoint=False)
    radius = np.linspace(520, 170, scene.segments(60))[:, None]
    flat = polar(radius, angle)
    ridge = 1 - np.abs(noise(flat / 150.0, 98, 1)) * 2.2
    sunward = 0.5 + 0.5 * np.cos(angle - SUN_AZIMUTH)
    tall = (150 - 70 * sunward**2) * smoothstep(175, 400, radius)
    height = 2.0 + tall * (0.38 + 0.62 * ridge + 0.30 * noise(flat / 60.0, 99, 5))
    scene.add("Mountains", sheet(flat + xyz(0, 0, height), closed=True), "Mountain")


def fog(scene: Scene) -> None:
    """A ring of morning fog before the mountains.

    It is made of arcs, none of whose bounding boxes holds the viewer: in the box of a whole ring,
    each camera ray would first be asked whether it starts in the fog.
    """
    arc = np.linspace(0, TAU / FOG_ARCS, scene.segments(12))[:, None]
    radius, height = points([(85, 17), (165, 21), (165, -2), (85, -2)]).T
    rows = polar(radius, arc, height)
    ends = (facets(rows[0], (3, 2, 1, 0)), facets(rows[-1], (0, 1, 2, 3)))
    bank = scene.mesh("Fog", join([sheet(rows, closed=True), *ends]), "Fog", smooth=False)
    for k in range(FOG_ARCS):
        thing = place(f"Fog.{k}", bank, transform(rotation=(0, 0, k * TAU / FOG_ARCS)))
        thing.visible_diffuse = thing.visible_shadow = False
