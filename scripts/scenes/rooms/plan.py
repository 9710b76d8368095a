"""What a furnished room consists of, in metres."""

from dataclasses import dataclass

import numpy as np
from mathutils import Matrix

from scenes.library.materials import Color
from scenes.library.shapes import transform
from scenes.library.variation import Variation

WALLS = BACK, RIGHT, FRONT, LEFT = range(4)
THICK = 0.2  # of the walls
DOOR = (0.95, 2.1)  # width and height


@dataclass(frozen=True)
class Window:
    """A window: its wall, its middle along the wall's x, its width, sill and height."""

    wall: int
    along: float
    width: float
    sill: float
    height: float


@dataclass(frozen=True)
class Furnishing:
    """A piece of furniture by the name of its maker, its place, and its turn in degrees."""

    name: str
    x: float
    y: float
    turned: float


@dataclass(frozen=True)
class Picture:
    """A picture on a wall: which print, and its place along the wall and above the floor."""

    number: int
    wall: int
    along: float
    z: float


@dataclass(frozen=True)
class Light:
    """environment: ships with bpy. daylight: watts a square metre of window. lamps: watts."""

    environment: str
    strength: float
    turned: float
    daylight: float
    daylight_color: Color
    lamps: float
    lamp_color: Color


@dataclass(frozen=True, kw_only=True)
class Room(Variation):
    """A room. size: inner width, length and height. center: of its floor, x and y.

    A wall's frame has its origin on the floor in the wall's middle. Its y points into the room.
    """

    size: tuple[float, float, float]
    center: tuple[float, float]
    windows: tuple[Window, ...]
    door_wall: int
    door_along: float
    floor: str
    wall: str
    furniture: tuple[Furnishing, ...]
    pictures: tuple[Picture, ...]
    ceiling_lamps: tuple[tuple[float, float], ...]
    light: Light

    def wall_length(self, wall: int) -> float:
        return self.size[wall % 2]

    def at_wall(self, wall: int, along: float = 0.0, away: float = 0.0, z: float = 0.0) -> Matrix:
        """The frame of a wall, moved along it, into the room, and upwards."""
        width, length, _ = self.size
        x, y = [(0, -length / 2), (width / 2, 0), (0, length / 2), (-width / 2, 0)][wall]
        origin = transform((self.center[0] + x, self.center[1] + y, 0), (0, 0, wall * np.pi / 2))
        return origin @ transform((along, away, z))
