"""The measures of the room, and how things are put into it.

A mesh that stands has z up and its front towards +Y. A flat one (a poster, a clock) lies in x and y
as the viewer sees it and faces +Z; on a wall it hangs upright.
"""

import re
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix

from scenes.library.points import points
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform

TAU = 2 * np.pi

ROOM = (5.0, 7.5, 3.0)  # metres in x, y, z
HALF_X, HALF_Y = ROOM[0] / 2, ROOM[1] / 2
COUNTER_TOP = 0.86
STATIONS = (-2.0, 0.0, 2.0)  # y of the barbers' stations
WINDOW_MIDDLE = (-0.75, 1.725)  # x and z; it is 2.6 m wide and 1.45 m high

TOWELS = ("White towel", "Red towel", "Blue towel", "Sand towel")
INKS = ("Red", "Navy", "Teal", "Ochre", "Black", "Green")
HAIR = ("Brown hair", "Fair hair", "Black hair")


def wall(side: str, along: float, out: float = 0.0, z: float = 0.0) -> Matrix:
    """The frame of something with its back to a wall: y into the room, z up, x to its own left.

    side: left (−X), right, front (+Y) or back. along: the world's y (left, right) or x (front,
    back). out: the distance from the wall.
    """
    location, degrees = {
        "left": ((out - HALF_X, along, z), -90),
        "right": ((HALF_X - out, along, z), 90),
        "front": ((along, HALF_Y - out, z), 180),
        "back": ((along, out - HALF_Y, z), 0),
    }[side]
    return transform(location, (0, 0, np.radians(degrees)))


def spots(text: str) -> list[Matrix]:
    """Frames of text, a comma after each; numbers that are 0 may be left out at its end.

    "room 1 2 0 90" is at (1, 2, 0) turned by 90°. "left 2 0.1 1.5" is before the left wall: along,
    out and z of `wall`, and degrees. "on left 2 0.1 1.5" is for what hangs there. A number may
    stand for several (see `points`).
    """
    frames = []
    for row in text.split(","):
        side, numbers = re.fullmatch(r"((?:on )?\w+)(.*)", row.strip()).groups()
        for given in points(numbers or "0"):
            a, b, c, turn = (*given, *(0,) * (4 - len(given)))
            where = transform((a, b, c)) if side == "room" else wall(side.split()[-1], a, b, c)
            degrees = (90, 0, 180) if side.startswith("on ") else (0, 0, turn)
            frames.append(where @ transform(rotation=np.radians(degrees)))
    return frames


def spot(text: str) -> Matrix:
    """The one frame of a text."""
    return spots(text)[0]


def drawings(text: str) -> list[tuple[str, str, str]]:
    """What a text draws under lines "name | looks": the name, looks and parts of each."""
    rows = re.split(r"^(.+) \|(.*)\n", text, flags=re.MULTILINE)[1:]
    return list(zip(rows[::3], rows[1::3], rows[2::3], strict=True))


def furnish(scene: Scene, text: str) -> None:
    """Make each model of a text and put it at its spots.

    A line "name | spot, spot, …" begins a model (see `spots`); its parts follow (`Model.draw`).
    """
    for name, where, parts in drawings(text):
        data = Model(scene, parts).mesh(name)
        for frame in spots(where):
            put(data, frame)


def put(
    data: bpy.types.Mesh,
    where: Matrix,
    at: Sequence[float] = (0, 0, 0),
    degrees: Sequence[float] = (0, 0, 0),
    scale: float | Sequence[float] = 1.0,
) -> None:
    """An instance of a mesh in a frame, scaled turned by XYZ Euler angles, and moved."""
    place(data.name, data, where @ transform(at, np.radians(degrees), scale))
