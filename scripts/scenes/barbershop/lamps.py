"""The light: daylight and the lamps' own, and the lamps that are seen."""

import numpy as np

from scenes.barbershop.materials import WARM
from scenes.barbershop.plan import HALF_Y, WINDOW_MIDDLE, spots
from scenes.library.lights import area_light
from scenes.library.materials import SkyGraph
from scenes.library.scene import Scene
from scenes.library.shapes import towards, transform

LAMPS = """
Pendant lamp | room ±1.15 ±1.5 2.25
    Brass: lathe 0.07 0.62, 0.07 0.6, 0.045 0.57, 0.02 0.555; tube 0.009, 0 0 0.14, 0 0 0.58;
        lathe 0 0.11, 0.08 0.11, 0.075 0.13, 0.06 0.17, 0.03 0.19; ring 0.151 0.006;
        lathe 0 -0.19, 0.012 -0.18, 0.012 -0.16, 0.03 -0.145; Opal globe: ball 0.15
Fan motor | room 0 0 2.51
    Brass: lathe 0 -0.02, 0.09 -0.01, 0.14 0.03, 0.15 0.09, 0.11 0.13, 0.04 0.15, 0.018 0.16
        0.018 0.3, 0.07 0.33, 0.075 0.35; ring 0.13 0.008 at 0 0 -0.03
    Opal globe: lathe 0 -0.15, 0.06 -0.14, 0.11 -0.1, 0.13 -0.04, 0.12 -0.01
    Brass: tube 0.0025, 0 0 -0.02, 0 0 -0.25 at ±0.09 0.1 0; Ebony: ball 0.012 at ±0.09 0.1 -0.26
Fan blade | room 0 0 2.57 20..308*5
    Mahogany x: prism 0.008, 0.2 -0.045, 0.3 -0.06, 0.66 -0.075, 0.7 -0.05, 0.715 0, 0.7 0.05
        0.66 0.075, 0.3 0.06, 0.2 0.045 turned 12 0 0
    Brass: box 0.14 0.035 0.006 0.002 at 0.2 0 -0.006 turned 12 0 0
Wall lamp | right -1.05 0 2.12, right 1.35 0 2.12, back ±0.82 0 2.12, front 0.77 0 2.3
    Brass: lathe 0.055 0, 0.05 0.012, 0.02 0.02, 0 0.022 turned -90 0 0;
        bend 0.008, 0 0.015 0, 0 0.08 -0.05, 0 0.15 -0.03, 0 0.16 0.04;
        lathe 0.012 0, 0.035 0.01, 0.038 0.03 at 0 0.16 0.03
    Opal globe: lathe 0.03 0, 0.055 0.03, 0.06 0.08, 0.05 0.12, 0.07 0.15, 0.066 0.15, 0.045 0.12
        0 0.05 at 0 0.16 0.055
"""


def lights(scene: Scene) -> None:
    """A few large lights, which converge soon: daylight, a low sun, and the lamps' own light.

    No camera or mirror sees them; what seems to shine is a glowing mesh. A plain bright sky lights
    the street, but is not sampled from inside the room.
    """
    graph = SkyGraph()
    graph.finish((0.72, 0.86, 1.0), 1.6)
    graph.world.cycles.sampling_method = "NONE"
    x, z = WINDOW_MIDDLE
    window = transform((x, HALF_Y - 0.16, z), (-np.pi / 2, 0, 0))
    above = transform((0, 0, 2.05), (np.pi, 0, 0))
    tubes = spots("left 0 0.16 2.36")[0] @ transform(rotation=(np.radians(35), 0, 0))
    back, front = transform((0, -1.5, 2.03)), transform((0, 1.5, 2.03))  # the back has no daylight
    rays = towards((0.9, 8.5, 4.9), (-1.0, -6.3, -4.9))
    sun = area_light("Sun", rays, (4.2, 2.2), 260, (1.0, 0.86, 0.66))
    sun.data.spread = np.radians(2.5)
    for lamp in (
        sun,
        area_light("Daylight", window, (2.4, 1.3), 45, (0.80, 0.90, 1.0)),
        area_light("Ceiling fill", above, (3.6, 6.0), 48, WARM),
        area_light("Back pendants' light", back, (2.8, 0.6), 125, WARM),
        area_light("Front pendants' light", front, (2.8, 0.6), 80, WARM),
        area_light("Mirror light", tubes, (5.2, 0.14), 56, (1.0, 0.9, 0.76)),
    ):
        lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False
