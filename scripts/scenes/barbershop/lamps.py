"""The light of the day and of the lamps, and the visible lamps."""

import numpy as np

from scenes.barbershop.plan import HALF_Y, WINDOW_MIDDLE, Barbershop, against, put, standing
from scenes.library.lights import area_light
from scenes.library.materials import SkyGraph
from scenes.library.points import evenly, mirrored
from scenes.library.scene import Model, Scene
from scenes.library.shapes import towards, transform


def pendant_lamp(scene: Scene) -> None:
    """Four globes that hang from the ceiling."""
    lamp = Model(scene)
    lamp.lathe(profile=[(0.07, 0.62), (0.07, 0.6), (0.045, 0.57), (0.02, 0.555)], material="Brass")
    lamp.tube(radius=0.009, path=[(0, 0, 0.14), (0, 0, 0.58)], material="Brass")
    lamp.lathe(
        profile=[(0, 0.11), (0.08, 0.11), (0.075, 0.13), (0.06, 0.17), (0.03, 0.19)],
        material="Brass",
    )
    lamp.ring(radius=0.151, thickness=0.006, material="Brass")
    lamp.lathe(
        profile=[(0, -0.19), (0.012, -0.18), (0.012, -0.16), (0.03, -0.145)], material="Brass"
    )
    lamp.ball(radius=0.15, material="Opal globe")
    put(
        lamp.mesh(name="Pendant lamp"),
        where=[standing(x=x, y=y, z=2.25) for x in (-1.15, 1.15) for y in (-1.5, 1.5)],
    )


def fan_motor(scene: Scene) -> None:
    """The ceiling fan's motor, with a globe and two chains below it."""
    motor = Model(scene)
    motor.lathe(
        profile=[
            (0, -0.02),
            (0.09, -0.01),
            (0.14, 0.03),
            (0.15, 0.09),
            (0.11, 0.13),
            (0.04, 0.15),
            (0.018, 0.16),
            (0.018, 0.3),
            (0.07, 0.33),
            (0.075, 0.35),
        ],
        material="Brass",
    )
    motor.ring(radius=0.13, thickness=0.008, at=(0, 0, -0.03), material="Brass")
    motor.lathe(
        profile=[(0, -0.15), (0.06, -0.14), (0.11, -0.1), (0.13, -0.04), (0.12, -0.01)],
        material="Opal globe",
    )
    motor.tube(
        radius=0.0025,
        path=[(0, 0, -0.02), (0, 0, -0.25)],
        at=mirrored(x=0.09, y=0.1),
        material="Brass",
    )
    motor.ball(radius=0.012, at=mirrored(x=0.09, y=0.1, z=-0.26), material="Ebony")
    put(motor.mesh(name="Fan motor"), where=standing(z=2.51))


def fan_blade(scene: Scene) -> None:
    """Five blades."""
    blade = Model(scene)
    blade.prism(
        height=0.008,
        outline=[
            (0.2, -0.045),
            (0.3, -0.06),
            (0.66, -0.075),
            (0.7, -0.05),
            (0.715, 0),
            (0.7, 0.05),
            (0.66, 0.075),
            (0.3, 0.06),
            (0.2, 0.045),
        ],
        turned=(12, 0, 0),
        material="Mahogany x",
    )
    blade.box(
        size=(0.14, 0.035, 0.006),
        bevel=0.002,
        at=(0.2, 0, -0.006),
        turned=(12, 0, 0),
        material="Brass",
    )
    put(
        blade.mesh(name="Fan blade"),
        where=[standing(z=2.57, turned=turn) for turn in evenly(20, 308, 5)],
    )


def wall_lamp(scene: Scene) -> None:
    """Lamps with open shades."""
    lamp = Model(scene)
    lamp.lathe(
        profile=[(0.055, 0), (0.05, 0.012), (0.02, 0.02), (0, 0.022)],
        turned=(-90, 0, 0),
        material="Brass",
    )
    lamp.bend(
        radius=0.008,
        path=[(0, 0.015, 0), (0, 0.08, -0.05), (0, 0.15, -0.03), (0, 0.16, 0.04)],
        material="Brass",
    )
    lamp.lathe(
        profile=[(0.012, 0), (0.035, 0.01), (0.038, 0.03)], at=(0, 0.16, 0.03), material="Brass"
    )
    lamp.lathe(
        profile=[
            (0.03, 0),
            (0.055, 0.03),
            (0.06, 0.08),
            (0.05, 0.12),
            (0.07, 0.15),
            (0.066, 0.15),
            (0.045, 0.12),
            (0, 0.05),
        ],
        at=(0, 0.16, 0.055),
        material="Opal globe",
    )
    put(
        lamp.mesh(name="Wall lamp"),
        where=[
            against("right", along=-1.05, z=2.12),
            against("right", along=1.35, z=2.12),
            *[against("back", along=x, z=2.12) for x in (-0.82, 0.82)],
            against("front", along=0.77, z=2.3),
        ],
    )


def lights(scene: Scene[Barbershop]) -> None:
    """A few large lights, which converge soon: daylight, a low sun, and the lamps' own light.

    No camera or mirror sees them; what seems to shine is a glowing mesh. A plain bright sky lights
    the street, but is not sampled from inside the room.
    """
    light = scene.plan.light
    lamps = light.lamps
    color = light.lamp_color
    graph = SkyGraph()
    graph.finish(light.sky_color, light.sky)
    graph.world.cycles.sampling_method = "NONE"
    x, z = WINDOW_MIDDLE
    window = transform((x, HALF_Y - 0.16, z), (-np.pi / 2, 0, 0))
    above = transform((0, 0, 2.05), (np.pi, 0, 0))
    tubes = against("left", away=0.16, z=2.36) @ transform(rotation=(np.radians(35), 0, 0))
    # the back has no daylight
    back = transform((0, -1.5, 2.03))
    front = transform((0, 1.5, 2.03))
    rays = towards((light.sun_x, 8.5, 4.9), (-0.1 - light.sun_x, -6.3, -4.9))
    sun = area_light("Sun", rays, (4.2, 2.2), light.sun, light.sun_color)
    sun.data.spread = np.radians(2.5)
    for lamp in (
        sun,
        area_light("Daylight", window, (2.4, 1.3), light.daylight, light.daylight_color),
        area_light("Ceiling fill", above, (3.6, 6.0), 48 * lamps, color),
        area_light("Back pendants' light", back, (2.8, 0.6), 125 * lamps, color),
        area_light("Front pendants' light", front, (2.8, 0.6), 80 * lamps, color),
        area_light("Mirror light", tubes, (5.2, 0.14), 56 * lamps, (1.0, 0.9, 0.76)),
    ):
        lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False
