"""The light of the day and of the lamps, and the visible lamps."""

import bpy
import numpy as np

from scenes.barbershop.plan import WINDOW_MIDDLE, Barbershop, against, put, standing
from scenes.library.lights import area_light
from scenes.library.materials import SkyGraph
from scenes.library.points import evenly, mirrored
from scenes.library.scene import Model, Scene
from scenes.library.shapes import towards, transform


def pendant_lamp(scene: Scene[Barbershop]) -> None:
    """Globes, or shades of enamel, that hang from the ceiling."""
    lamp = Model(scene)
    if scene.plan.lamp_shade == "globe":
        _globe(lamp)
    else:
        _enamel_shade(lamp)
    z = 2.25 + scene.plan.raised
    put(
        lamp.mesh(name="Pendant lamp"),
        where=[standing(x=x, y=y, z=z) for x, y in scene.plan.pendants],
    )


def _enamel_shade(lamp: Model) -> None:
    """A wide green shade over a bulb."""
    lamp.lathe(profile=[(0.06, 0.75), (0.06, 0.73), (0.02, 0.7)], material="Iron")
    lamp.tube(radius=0.006, path=[(0, 0, 0.14), (0, 0, 0.74)], material="Iron")
    shade = [(0.24, -0.06), (0.2, 0.02), (0.08, 0.08), (0.05, 0.16), (0.012, 0.18)]
    lamp.pipe(profile=shade, material="Green")
    lamp.pipe(profile=[(radius - 0.004, z) for radius, z in shade[::-1]][1:], material="White")
    lamp.ball(radius=0.07, at=(0, 0, -0.01), material="Opal globe")


def _globe(lamp: Model) -> None:
    """A globe of opal glass on a brass rod."""
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


def fan_motor(scene: Scene[Barbershop]) -> None:
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
    put(motor.mesh(name="Fan motor"), where=standing(z=2.51 + scene.plan.raised))


def fan_blade(scene: Scene[Barbershop]) -> None:
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
    z = 2.57 + scene.plan.raised
    put(
        blade.mesh(name="Fan blade"),
        where=[standing(z=z, turned=turn) for turn in evenly(20, 308, 5)],
    )


def wall_lamp(scene: Scene[Barbershop]) -> None:
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
            against(spot.wall, spot.along, z=spot.z, room=scene.plan.room)
            for spot in scene.plan.wall_lamps
        ],
    )


def lights(scene: Scene[Barbershop]) -> None:
    """A few large lights, which converge soon: daylight, a low sun, and the lamps' own light.

    No camera or mirror sees them; what seems to shine is a glowing mesh. A plain bright sky lights
    the street, but is not sampled from inside the room.
    """
    plan = scene.plan
    light = plan.light
    lamps = light.lamps
    color = light.lamp_color
    width, length, _ = plan.room
    graph = SkyGraph()
    graph.finish(light.sky_color, light.sky)
    graph.world.cycles.sampling_method = "NONE"
    above = transform((0, 0, 2.05 + plan.raised), (np.pi, 0, 0))
    # the back has no daylight
    back = transform((0, -length / 5, 2.03 + plan.raised))
    front = transform((0, length / 5, 2.03 + plan.raised))
    pendants = (width - 2.2, 0.6)
    created = [
        *_daylight(plan),
        area_light("Ceiling fill", above, (width - 1.4, length - 1.5), 48 * lamps, color),
        area_light("Back pendants' light", back, pendants, 125 * lamps, color),
        area_light("Front pendants' light", front, pendants, 80 * lamps, color),
        _mirror_light(plan),
    ]
    for lamp in created:
        lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False


def _daylight(plan: Barbershop) -> list[bpy.types.Object]:
    """The sun, aimed through the first window, and the sky's light behind each window."""
    light = plan.light
    aim = plan.windows[0].along + 0.65
    rays = towards((light.sun_x, plan.half_y + 4.75, 4.9), (aim - light.sun_x, -6.3, -4.9))
    sun = area_light("Sun", rays, (4.2, 2.2), light.sun, light.sun_color)
    sun.data.spread = np.radians(2.5)
    created = [sun]
    glass = sum(window.width for window in plan.windows)
    for along, width in plan.windows:
        at = transform((along, plan.half_y - 0.16, WINDOW_MIDDLE), (-np.pi / 2, 0, 0))
        watts = light.daylight * width / glass
        created.append(area_light("Daylight", at, (width - 0.2, 1.3), watts, light.daylight_color))
    return created


def _mirror_light(plan: Barbershop) -> bpy.types.Object:
    """The light of the tubes over the mirrors."""
    turn = transform(rotation=(np.radians(35), 0, 0))
    tubes = plan.at_counter(plan.counter_middle, away=0.16, z=2.36) @ turn
    length = plan.pitch * (len(plan.stations) - 1) + 1.2
    watts = 56 * plan.light.lamps * len(plan.stations) / 3
    return area_light("Mirror light", tubes, (length, 0.14), watts, (1.0, 0.9, 0.76))
