"""The sky over the court: a low sun, thin clouds, and swallows."""

import numpy as np

from scenes.library.lights import sun_light
from scenes.library.materials import SkyGraph
from scenes.library.scene import Scene, scatter
from scenes.library.shapes import facets, join, transform
from scenes.lone_monk.plan import NORTH, Cloister


def sky(scene: Scene[Cloister]) -> None:
    """The sun in the west-south-west, and the physical sky that belongs to it.

    The camera alone sees the clouds: they cost the lighting nothing.
    """
    plan = scene.plan
    angle = np.radians(0.6)
    sun_light("Sun", plan.sun_azimuth, plan.sun_elevation, plan.sun, plan.sun_color, angle)
    graph = SkyGraph()
    look = {"sky_type": "MULTIPLE_SCATTERING", "sun_disc": False, "aerosol_density": 0.6}
    clockwise = np.pi / 2 - plan.sun_azimuth  # from +Y
    blue = graph.add("TexSky", sun_elevation=plan.sun_elevation, sun_rotation=clockwise, **look)
    direction = graph.add("TexCoord").outputs["Generated"]
    height = graph.math("MAXIMUM", graph.xyz(direction)["Z"], 0.05)
    plane = graph.vector_math("DIVIDE", direction, height)[0]
    drawn_out = graph.vector_math("MULTIPLY", plane, (0.5, 1.3, 1.0))[0]
    cover = graph.span(graph.noise(drawn_out, 1.1, 6.0, 0.62, 0.35), 0.0, 0.7, *plan.clouds)
    clouded = graph.mix(cover, blue, plan.cloud_color)
    camera = graph.add("LightPath").outputs["Is Camera Ray"]
    graph.finish(graph.mix(camera, blue, clouded), plan.sky)


def swallows(scene: Scene[Cloister]) -> None:
    """Swallows over the court, so that the view straight up is not empty."""
    body = scene.lathe([(0, -0.09), (0.018, -0.04), (0.02, 0.02), (0.012, 0.07), (0, 0.09)], 8)
    body = body.transformed(transform(rotation=(0, np.pi / 2, 0)))
    right = [
        (0.05, 0, 0),
        (-0.01, 0, 0),
        (-0.03, -0.1, 0.03),
        (-0.11, -0.22, 0.01),
        (0.04, -0.1, 0.035),
    ]
    wing = facets(right, (0, 1, 2, 4), (4, 2, 3))
    tail = facets(
        [(-0.07, 0, 0), (-0.19, 0.05, 0), (-0.11, 0, 0), (-0.19, -0.05, 0)], (0, 1, 2), (0, 2, 3)
    )
    bird = join([body, wing, wing.scaled(1, -1, 1), tail])
    swallow = scene.mesh("Swallow", bird, "Iron", smooth=False)
    random = scene.random("swallows")
    places = random.uniform((-9, -9, 9, -0.7, -0.3, 0), (9, 9, 19, 0.7, 0.3, 6.0), (14, 6))
    scatter(
        "Swallow",
        [swallow],
        (scene.plan.side(NORTH) @ transform(p[:3], p[3:], 1.3) for p in places),
    )
