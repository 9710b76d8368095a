"""A window's light from the left, a cool rim from behind, a low fill, and a dim room around."""

import numpy as np
from mathutils import Matrix, Vector

from scenes.library.lights import area_light, hdri_world
from scenes.library.points import points
from scenes.library.scene import Scene

# Place, width and height in metres, watts, and colour.
LAMPS = """-1.7 -1.1 1.9 1.0 1.3 56 1.0 0.90 0.76
    1.6 1.5 1.3 0.7 1.1 32 0.72 0.85 1.0
    1.5 -1.9 0.9 1.2 0.8 12 1.0 0.95 0.90
    0.0 0.2 2.4 0.9 0.9 14 1.0 0.97 0.93"""


def lamps(scene: Scene) -> None:
    """Area lamps that look at the board's middle."""
    hdri_world("interior.exr", 0.45, np.radians(-40))
    for number, (*at, width, height, watts, red, green, blue) in enumerate(points(LAMPS)):
        turn = (-Vector(at)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
        matrix = Matrix.Translation(at) @ turn
        lamp = area_light(f"Lamp {number}", matrix, (width, height), watts, (red, green, blue))
        lamp.visible_camera = False
