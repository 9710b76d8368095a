"""The measures of the room, and how things are put into it.

A mesh that stands has z up and its front towards +Y. A flat one (a poster, a clock) lies in x and y
as the viewer sees it and faces +Z; on a wall it hangs upright.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import bpy
import numpy as np
from mathutils import Matrix

from scenes.library.materials import Color
from scenes.library.scene import place
from scenes.library.shapes import transform
from scenes.library.variation import Variation

TAU = 2 * np.pi
WARM: Color = (1.0, 0.80, 0.58)

ROOM = (5.0, 7.5, 3.0)  # metres in x, y, z
HALF_X, HALF_Y = ROOM[0] / 2, ROOM[1] / 2
COUNTER_TOP = 0.86
STATIONS = (-2.0, 0.0, 2.0)  # y of the barbers' stations
WINDOW_MIDDLE = (-0.75, 1.725)  # x and z; it is 2.6 m wide and 1.45 m high

TOWELS = ("White towel", "Red towel", "Blue towel", "Sand towel")
INKS = ("Red", "Navy", "Teal", "Ochre", "Black", "Green")
Wall = Literal["left", "right", "front", "back"]
HAIR = ("Brown hair", "Fair hair", "Black hair")


def standing(x: float = 0, y: float = 0, z: float = 0, turned: float = 0) -> Matrix:
    """A frame in the room, turned about Z by degrees."""
    return transform((x, y, z)) @ transform(rotation=(0, 0, np.radians(turned)))


def against(
    wall: Wall, along: float = 0, away: float = 0, z: float = 0, turned: float = 0
) -> Matrix:
    """A frame with its back to a wall, turned about Z by degrees.

    along: the room's y at the left and right wall, its x at the front and back. away: metres from
    the wall. The frame's y points into the room, its x to its own left.
    """
    return _at_wall(wall, along, away, z) @ transform(rotation=(0, 0, np.radians(turned)))


def hanging(wall: Wall, along: float = 0, away: float = 0, z: float = 0) -> Matrix:
    """A frame for flat objects on a wall: its z points into the room, its y upwards."""
    return _at_wall(wall, along, away, z) @ transform(rotation=(np.pi / 2, 0, np.pi))


def _at_wall(wall: Wall, along: float, away: float, z: float) -> Matrix:
    (x, y), degrees = {
        "left": ((away - HALF_X, along), -90),
        "right": ((HALF_X - away, along), 90),
        "front": ((along, HALF_Y - away), 180),
        "back": ((along, away - HALF_Y), 0),
    }[wall]
    return transform((x, y, z), (0, 0, np.radians(degrees)))


def put(
    data: bpy.types.Mesh,
    where: Matrix | Sequence[Matrix],
    at: Sequence[float] = (0, 0, 0),
    degrees: Sequence[float] = (0, 0, 0),
    scale: float | Sequence[float] = 1.0,
) -> None:
    """Instances of a mesh in one frame or in each of several, scaled, turned, and moved there.

    degrees: XYZ Euler angles.
    """
    for frame in [where] if isinstance(where, Matrix) else where:
        place(data.name, data, frame @ transform(at, np.radians(degrees), scale))


@dataclass(frozen=True)
class Light:
    """The light of a time of day. sun, daylight: watts. lamps: a factor of the lamps' watts."""

    sky: float = 1.6
    sky_color: Color = (0.72, 0.86, 1.0)
    sun: float = 260
    sun_color: Color = (1.0, 0.86, 0.66)
    sun_x: float = 0.9  # where the sun comes from, before the shop window
    daylight: float = 45
    daylight_color: Color = (0.80, 0.90, 1.0)
    lamps: float = 1.0
    lamp_color: Color = WARM


@dataclass(frozen=True)
class Barbershop(Variation):
    """chair_turns: of the barbers' chairs, in degrees."""

    light: Light = field(default_factory=Light)
    chair_turns: tuple[float, float, float] = (128, 104, 66)


ORIGINAL = Barbershop()
