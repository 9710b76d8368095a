"""The light of the day through the windows, and of the lamps."""

import numpy as np

from scenes.library.lights import area_light, hdri_world
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform
from scenes.rooms.plan import Room


def daylight(scene: Scene[Room]) -> None:
    """The surroundings, and a lamp in each window instead of their light."""
    light = scene.plan.light
    hdri_world(light.environment, light.strength, np.radians(light.turned), brightest=12.0)
    for number, window in enumerate(scene.plan.windows):
        middle = window.sill + window.height / 2
        matrix = scene.plan.at_wall(window.wall, window.along, 0.01, middle)
        size = (0.9 * window.width, 0.9 * window.height)
        watts = light.daylight * window.width * window.height
        turn = transform(rotation=(-np.pi / 2 + np.pi, 0, 0))
        lamp = area_light(f"Daylight.{number}", matrix @ turn, size, watts, light.daylight_color)
        lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False


def ceiling_lamps(scene: Scene[Room]) -> None:
    """Opal globes under the ceiling. Lamps below them give their light."""
    height = scene.plan.size[2]
    model = Model(scene)
    model.ball(radius=0.14, at=(0, 0, -0.24), material="Opal globe")
    model.lathe(profile=[(0.06, -0.03), (0.06, 0)], material="Brass")
    model.tube(radius=0.01, path=[(0, 0, -0.1), (0, 0, 0)], material="Brass")
    mesh = model.mesh("Ceiling lamp")
    light = scene.plan.light
    for number, (x, y) in enumerate(scene.plan.ceiling_lamps):
        place(f"Ceiling lamp.{number}", mesh, transform((x, y, height)))
        below = transform((x, y, height - 0.42))
        watts = light.lamps / len(scene.plan.ceiling_lamps)
        lamp = area_light(f"Lamp light.{number}", below, (0.5, 0.5), watts, light.lamp_color)
        up = area_light(
            f"Lamp light up.{number}",
            transform((x, y, height - 0.38), (np.pi, 0, 0)),
            (0.5, 0.5),
            watts / 3,
            light.lamp_color,
        )
        for each in (lamp, up):
            each.visible_camera = each.visible_glossy = each.visible_transmission = False
