"""The sky at sunrise, the mountains at the horizon, and fog before them."""

import numpy as np

from scenes.garden.plan import TAU, GardenPlan
from scenes.library.lights import hdri_world, sun_light
from scenes.library.materials import SkyGraph
from scenes.library.points import noise, points, polar, smoothstep, xyz
from scenes.library.scene import Scene, place
from scenes.library.shapes import facets, join, sheet, transform

FOG_ARCS = 10


def sky(scene: Scene[GardenPlan]) -> None:
    """An environment that ships with bpy, or a physical sky. A sun lamp replaces its sun."""
    light = scene.plan.sky
    if light.environment:
        turn = light.sun_azimuth - light.environment_sun
        hdri_world(light.environment, light.strength, turn, brightest=8.0)
    else:
        graph = SkyGraph()
        look = {"sky_type": "MULTIPLE_SCATTERING", "sun_disc": False, "aerosol_density": 0.6}
        clockwise = np.pi / 2 - light.sun_azimuth  # from +Y
        above = max(light.sun_elevation, 0.0)
        blue = graph.add("TexSky", sun_elevation=above, sun_rotation=clockwise, **look)
        graph.finish(blue, light.strength)
    angle = np.radians(1.5)
    sun_light("Sun", light.sun_azimuth, light.sun_elevation, light.sun, light.sun_color, angle)


def mountains(scene: Scene[GardenPlan]) -> None:
    """Ridges all round the horizon, lower where the sun rises."""
    angle = np.linspace(0, TAU, scene.segments(540), endpoint=False)
    radius = np.linspace(520, 170, scene.segments(60))[:, None]
    flat = polar(radius, angle)
    hills = flat + scene.plan.ground_shift * 30.0
    ridge = 1 - np.abs(noise(hills / 150.0, 98, 1)) * 2.2
    sunward = 0.5 + 0.5 * np.cos(angle - scene.plan.sky.sun_azimuth)
    tall = (150 - 70 * sunward**2) * smoothstep(175, 400, radius)
    height = 2.0 + tall * (0.38 + 0.62 * ridge + 0.30 * noise(hills / 60.0, 99, 5))
    scene.add("Mountains", sheet(flat + xyz(0, 0, height), closed=True), "Mountain")


def fog(scene: Scene) -> None:
    """A ring of morning fog before the mountains.

    It consists of arcs, so that no bounding box holds the viewer. In the box of a full ring, Cycles
    would first test for each camera ray whether it starts in the fog.
    """
    arc = np.linspace(0, TAU / FOG_ARCS, scene.segments(12))[:, None]
    radius, height = points([(85, 17), (165, 21), (165, -2), (85, -2)]).T
    rows = polar(radius, arc, height)
    ends = (facets(rows[0], (3, 2, 1, 0)), facets(rows[-1], (0, 1, 2, 3)))
    bank = scene.mesh("Fog", join([sheet(rows, closed=True), *ends]), "Fog", smooth=False)
    for k in range(FOG_ARCS):
        bank_object = place(f"Fog.{k}", bank, transform(rotation=(0, 0, k * TAU / FOG_ARCS)))
        bank_object.visible_diffuse = False
        bank_object.visible_shadow = False
