"""The measures of the room, and how things are put into it.

A mesh that stands has z up and its front towards +Y. A flat one (a poster, a clock) lies in x and y
as the viewer sees it and faces +Z; on a wall it hangs upright.

Walls, openings, stations, lamps and pictures follow the plan of a place. Furniture is put where the
original has it. `Barbershop.moves` then brings it to its spot in the place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from scenes.library.materials import Color
from scenes.library.scene import place
from scenes.library.shapes import transform
from scenes.library.variation import Variation

TAU = 2 * np.pi
WARM: Color = (1.0, 0.80, 0.58)

Wall = Literal["left", "right", "front", "back"]
WALLS: tuple[Wall, ...] = ("left", "right", "front", "back")
Room = tuple[float, float, float]  # metres in x, y, z
ROOM: Room = (5.0, 7.5, 3.0)  # of the original
HEADINGS = {"left": -90, "right": 90, "front": 180, "back": 0}  # degrees of the walls' frames
TILE = 0.3125  # of the floor; a room has a whole number of them
COUNTER_TOP = 0.86
WINDOW_HEIGHT = 1.45
WINDOW_MIDDLE = 1.725  # z
DOOR_WIDTH = 0.95

TOWELS = ("White towel", "Red towel", "Blue towel", "Sand towel")
INKS = ("Red", "Navy", "Teal", "Ochre", "Black", "Green")
HAIR = ("Brown hair", "Fair hair", "Black hair")


def standing(x: float = 0, y: float = 0, z: float = 0, turned: float = 0) -> Matrix:
    """A frame in the room, turned about Z by degrees."""
    return transform((x, y, z)) @ transform(rotation=(0, 0, np.radians(turned)))


def against(
    wall: Wall,
    along: float = 0,
    away: float = 0,
    z: float = 0,
    turned: float = 0,
    x: float = 0,
    room: Room = ROOM,
) -> Matrix:
    """A frame with its back to a wall, turned about Z by degrees.

    along: the room's y at the left and right wall, its x at the front and back. away: metres from
    the wall. x: metres along the frame's own x, which points to its left. The frame's y points into
    the room.
    """
    frame = _at_wall(wall, along, away, z, x, room)
    return frame @ transform(rotation=(0, 0, np.radians(turned)))


def hanging(
    wall: Wall, along: float = 0, away: float = 0, z: float = 0, x: float = 0, room: Room = ROOM
) -> Matrix:
    """A frame for flat objects on a wall: its z points into the room, its y upwards."""
    return _at_wall(wall, along, away, z, x, room) @ transform(rotation=(np.pi / 2, 0, np.pi))


def _at_wall(wall: Wall, along: float, away: float, z: float, x: float, room: Room) -> Matrix:
    spot = position(wall, along, away, x, room)
    return transform((*spot, z), (0, 0, np.radians(HEADINGS[wall])))


def position(
    wall: Wall, along: float = 0, away: float = 0, x: float = 0, room: Room = ROOM
) -> tuple[float, float]:
    """The room's x and y of a place at a wall (see `against`)."""
    half_x = room[0] / 2
    half_y = room[1] / 2
    return {
        "left": (away - half_x, along - x),
        "right": (half_x - away, along + x),
        "front": (along - x, half_y - away),
        "back": (along + x, away - half_y),
    }[wall]


def wall_length(room: Room, wall: Wall) -> float:
    return room[1] if wall in ("left", "right") else room[0]


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


class Window(NamedTuple):
    """A shop window in the front wall: the x of its middle, and its width."""

    along: float
    width: float


class Print(NamedTuple):
    """A framed print on a wall: its name in SIZES, and where its middle hangs."""

    name: str
    wall: Wall
    along: float
    z: float


class Fitting(NamedTuple):
    """A lamp, switch or grille on a wall."""

    wall: Wall
    along: float
    z: float
    away: float = 0.0


SIZES = {  # of the prints, in metres
    "masters": (0.6, 0.8),
    "moustaches": (0.5, 0.7),
    "prices": (0.7, 1.0),
    "haircuts": (0.7, 0.5),
    "pole": (0.4, 0.7),
    "deco": (0.5, 0.7),
    "landscape": (0.62, 0.42),
    "certificate": (0.44, 0.32),
    "portrait": (0.26, 0.34),
}
PRINTS = (
    Print("masters", "right", -0.45, 1.68),
    Print("moustaches", "right", 0.25, 1.62),
    Print("landscape", "right", 0.25, 2.24),
    Print("deco", "right", 0.88, 1.66),
    Print("certificate", "right", -0.45, 2.36),
    Print("portrait", "right", 0.88, 2.28),
    Print("pole", "right", 1.72, 2.18),
    Print("portrait", "right", 1.35, 1.5),
    Print("certificate", "right", 2.25, 2.45),
    Print("haircuts", "right", -1.65, 2.45),
    Print("pole", "right", -3.35, 1.75),
    Print("portrait", "right", -2.75, 1.5),
    Print("landscape", "right", -2.8, 1.98),
    Print("certificate", "right", -2.75, 2.42),
    Print("deco", "right", 3.2, 1.9),
    Print("prices", "back", 0.45, 1.68),
    Print("haircuts", "back", 0.45, 2.55),
    Print("moustaches", "back", -2.27, 1.7),
    Print("landscape", "back", -1.52, 2.48),
    Print("certificate", "back", -2.25, 2.35),
    Print("portrait", "back", -0.35, 2.55),
    Print("certificate", "front", 2.25, 1.55),
    Print("portrait", "front", 2.25, 1.95),
    Print("portrait", "front", -2.3, 1.5),
    Print("pole", "front", -2.28, 2.15),
    Print("certificate", "front", 2.25, 2.35),
)
WALL_LAMPS = (
    Fitting("right", -1.05, 2.12),
    Fitting("right", 1.35, 2.12),
    Fitting("back", -0.82, 2.12),
    Fitting("back", 0.82, 2.12),
    Fitting("front", 0.77, 2.3),
)
SWITCHES = (
    Fitting("front", 2.12, 1.22),
    Fitting("back", -0.92, 1.25),
    Fitting("left", -1.45, 1.03, 0.01),
    Fitting("left", 1.45, 1.03, 0.01),
    Fitting("left", 0.55, 1.03, 0.01),
)
VENTS = (Fitting("right", 2.9, 2.46), Fitting("left", -3.52, 2.46), Fitting("left", 3.52, 2.46))

CLOCK = Fitting("back", -0.88, 2.5, 0.001)


@dataclass(frozen=True)
class Barbershop(Variation):
    """The plan of a shop. Without arguments it is the original's.

    stations: where the barbers' stations are along the counter's wall. chair_turns: of their
    chairs, in degrees. staff_door: its wall, and where it is along it. papered: the walls in
    wallpaper, or in what `paper` names. ceiling: "tin", or the material of its boards. green_rows:
    rows of tiles in the lower colour. bins: x, y and turn of the waste bins. hanging_corner,
    tree_corner: signs of x and y of the corners with the hanging plant and the rubber tree.
    """

    light: Light = field(default_factory=Light)
    room: Room = ROOM
    counter_wall: Wall = "left"
    stations: tuple[float, ...] = (-2.0, 0.0, 2.0)
    pitch: float = 2.0  # from station to station, in metres
    chair_turns: tuple[float, ...] = (128, 104, 66)
    windows: tuple[Window, ...] = (Window(-0.75, 2.6),)
    door: float = 1.475  # x of its middle
    staff_door: tuple[Wall, float] | None = ("back", -1.525)
    pole: float = 0.78  # x
    papered: frozenset[Wall] = frozenset(("right", "back"))
    paper: str = "Wallpaper"
    floor: str = "checker"
    green_rows: int = 11
    ceiling: str = "tin"
    pendants: tuple[tuple[float, float], ...] = (
        (-1.15, -1.5),
        (-1.15, 1.5),
        (1.15, -1.5),
        (1.15, 1.5),
    )
    lamp_shade: str = "globe"
    prints: tuple[Print, ...] = PRINTS
    wall_lamps: tuple[Fitting, ...] = WALL_LAMPS
    switches: tuple[Fitting, ...] = SWITCHES
    vents: tuple[Fitting, ...] = VENTS
    clock: Fitting = CLOCK
    bins: tuple[tuple[float, float, float], ...] = ((-2.28, -3.45, 0), (0.72, -2.55, 70))
    hanging_corner: tuple[int, int] | None = (-1, 1)
    tree_corner: tuple[int, int] | None = (1, 1)

    @property
    def half_x(self) -> float:
        return self.room[0] / 2

    @property
    def half_y(self) -> float:
        return self.room[1] / 2

    @property
    def raised(self) -> float:
        """How much higher the ceiling is than the original's."""
        return self.room[2] - ROOM[2]

    @property
    def counter_middle(self) -> float:
        return (self.stations[0] + self.stations[-1]) / 2

    @property
    def beside_stations(self) -> tuple[float, ...]:
        """The middles between the stations, and one beyond each end."""
        return (self.stations[0] - self.pitch / 2, *(y + self.pitch / 2 for y in self.stations))

    def wall_length(self, wall: Wall) -> float:
        return wall_length(self.room, wall)

    def at_counter(
        self, along: float, away: float = 0, z: float = 0, turned: float = 0, x: float = 0
    ) -> Matrix:
        """`against` the counter's wall."""
        return against(self.counter_wall, along, away, z, turned, x, self.room)

    def over_counter(self, along: float, away: float = 0, z: float = 0, x: float = 0) -> Matrix:
        """`hanging` on the counter's wall."""
        return hanging(self.counter_wall, along, away, z, x, self.room)

    def at_front(
        self, along: float, away: float = 0, z: float = 0, turned: float = 0, x: float = 0
    ) -> Matrix:
        """`against` the front wall."""
        return against("front", along, away, z, turned, x, self.room)

    def on_front(self, along: float, away: float = 0, z: float = 0) -> Matrix:
        """`hanging` on the front wall."""
        return hanging("front", along, away, z, room=self.room)

    def fitted(self, spot: Fitting) -> Matrix:
        """`hanging` at the place of a fitting."""
        return hanging(spot.wall, spot.along, spot.away, spot.z, room=self.room)


ORIGINAL = Barbershop()
