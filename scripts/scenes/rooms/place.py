"""Draws furnished rooms: size, windows, floor and walls, furniture without overlap, and light."""

from dataclasses import dataclass, replace

import numpy as np

from scenes.library.materials import Color
from scenes.library.variation import Draw, Factors
from scenes.rooms.plan import DOOR, WALLS, Furnishing, Light, Picture, Room, Window

AS_IT_IS: Factors = (1.0, 1.0, 1.0)
Rectangle = tuple[float, float, float, float]  # x0, y0, x1, y1
RIGS: Rectangle = (-0.7, -0.7, 0.7, 0.7)  # is kept free
GAP = 0.06  # metres between pieces

# Factors of the materials' colours. Materials with a comma share theirs.
TINTS = {
    "Paint": (
        AS_IT_IS,
        (0.5, 0.75, 0.9),
        (0.9, 0.55, 0.4),
        (0.35, 0.55, 0.42),
        (1.1, 0.95, 0.6),
        (0.2, 0.25, 0.35),
        (1.1, 0.75, 0.75),
    ),
    "Wallpaper": (AS_IT_IS, (7.0, 0.9, 0.8), (9.0, 5.0, 3.5), (1.2, 1.4, 4.0), (5.0, 4.5, 5.0)),
    "Brick": (AS_IT_IS, (1.8, 2.6, 3.2), (2.2, 4.5, 6.0)),
    "Floor boards": (AS_IT_IS, (0.35, 0.35, 0.4), (1.7, 2.2, 3.2), (1.0, 0.7, 0.5)),
    "Checks": (AS_IT_IS, (1.2, 0.5, 0.4), (0.6, 0.9, 0.8), (1.3, 1.3, 1.3)),
    "Carpet": (AS_IT_IS, (1.6, 0.4, 0.4), (0.4, 0.7, 1.6), (0.8, 1.2, 0.6), (2.4, 2.5, 2.5)),
    "Joinery": (AS_IT_IS, (0.35, 0.2, 0.1), (0.2, 0.3, 0.25), (0.08, 0.08, 0.09)),
    "Room wood, Mahogany, Mahogany x, Oak, Wood": (
        AS_IT_IS,
        (0.35, 0.3, 0.35),
        (1.8, 2.2, 2.8),
        (1.4, 0.9, 0.6),
    ),
    "Fabric": (AS_IT_IS, (0.3, 0.5, 0.9), (1.2, 0.4, 0.3), (0.4, 0.7, 0.4), (1.6, 1.6, 1.6)),
    "Cushion": (AS_IT_IS, (1.4, 0.7, 0.2), (0.2, 0.25, 0.4), (0.9, 0.3, 0.5), (0.3, 0.6, 0.6)),
    "Bedding": (AS_IT_IS, (1.7, 1.7, 1.8), (0.3, 0.45, 0.8), (1.0, 0.5, 0.5), (0.7, 0.9, 0.6)),
    "Oxblood": (AS_IT_IS, (0.25, 2.0, 3.0), (0.2, 0.7, 6.0), (3.2, 22.0, 18.0)),
}  # fmt: skip
FLOORS = ("Floor boards", "Floor boards", "Checks", "Checks", "Carpet", "Terracotta floor")
WALL_MATERIALS = ("Paint", "Paint", "Paint", "Wallpaper", "Brick")
# What pieces take, before them in y and beside them in x, and their height.
Size = tuple[float, float, float, float, float]  # x0, y0, x1, y1, height
AT_WALLS: dict[str, Size] = {
    "bed": (-0.86, 0.0, 0.86, 2.12, 1.05),
    "sofa": (-0.99, 0.0, 0.99, 0.9, 0.85),
    "bench": (-1.12, 0.0, 1.12, 0.76, 0.9),
    "bookshelf": (-0.56, 0.0, 0.56, 0.33, 2.0),
    "display cabinet": (-0.5, -0.03, 0.5, 0.46, 2.35),
    "cupboard": (-0.74, 0.0, 0.74, 0.4, 1.16),
    "coats": (-0.82, 0.0, 0.82, 0.32, 2.15),
    "armchair": (-0.43, 0.0, 0.43, 0.82, 0.9),
    "umbrellas": (-0.14, 0.0, 0.15, 0.36, 0.86),
    "trolley": (-0.28, -0.2, 0.28, 0.2, 0.83),
    "stool": (-0.24, -0.24, 0.24, 0.24, 0.75),
    "floor lamp": (-0.17, -0.17, 0.17, 0.17, 1.7),
    "rubber tree": (-0.4, -0.4, 0.4, 0.4, 1.3),
    "snake plant": (-0.25, -0.25, 0.25, 0.25, 1.0),
}
# From large to small, and how many of each are tried.
ORDER = (
    ("bed", 1, 0.35),
    ("sofa", 1, 0.6),
    ("bench", 1, 0.3),
    ("bookshelf", 3, 0.6),
    ("display cabinet", 1, 0.5),
    ("cupboard", 1, 0.5),
    ("coats", 1, 0.4),
    ("armchair", 2, 0.5),
    ("trolley", 1, 0.3),
    ("rubber tree", 2, 0.5),
    ("floor lamp", 2, 0.6),
    ("snake plant", 2, 0.5),
    ("umbrellas", 1, 0.5),
    ("stool", 2, 0.4),
)


@dataclass(frozen=True)
class Group:
    """Pieces in the middle of a room: what they take, and their probability."""

    size: Rectangle
    pieces: tuple[Furnishing, ...]
    probability: float


GROUPS = (
    Group(
        (-1.05, -0.95, 1.05, 0.95),
        (
            Furnishing("set table", 0, 0, 0),
            Furnishing("table", 0, 0, 0),
            Furnishing("chair", -0.4, -0.5, 180),
            Furnishing("chair", 0.4, -0.5, 180),
            Furnishing("chair", -0.4, 0.5, 0),
            Furnishing("chair", 0.35, 0.52, 8),
        ),
        0.65,
    ),
    Group(
        (-0.5, -1.6, 0.5, 1.6),
        (
            Furnishing("low table", 0, 0, 0),
            Furnishing("armchair", 0.03, 1.5, 180),
            Furnishing("barber chair", 0, -1.05, 0),
        ),
        0.5,
    ),
    Group(
        (-0.85, -0.95, 0.85, 0.45),
        (Furnishing("desk", 0, 0, 0), Furnishing("stool", 0.1, -0.65, 0)),
        0.35,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Hour:
    """A time of day: the sky's strength, watts a square metre of window, and watts of the lamps."""

    environments: tuple[str, ...]
    strength: float
    daylight: float
    color: Color
    lamps: tuple[float, float]


DAY = ("forest.exr", "courtyard.exr", "city.exr")
HOURS = (
    Hour(DAY, 1.2, 32, (0.9, 0.95, 1.0), (0, 20)),
    Hour(DAY, 0.9, 18, (1.0, 0.9, 0.75), (20, 70)),
    Hour(("sunset.exr", "sunrise.exr"), 0.8, 12, (1.0, 0.68, 0.42), (30, 90)),
    Hour(("night.exr",), 0.5, 0.6, (0.5, 0.65, 1.0), (70, 160)),
)
LAMP_COLORS: tuple[Color, ...] = ((1.0, 0.72, 0.45), (1.0, 0.80, 0.58), (1.0, 0.93, 0.85))


def drawn(place: int) -> Room:
    """The plan of a place."""
    draw = Draw(place)
    width = draw.uniform("width", 3.4, 7.5)
    length = draw.uniform("length", 3.4, 8.0)
    size = (width, length, draw.uniform("height", 2.55, 3.6))
    center = tuple(
        draw.uniform(f"center {axis}", -0.8, 0.8) * (side / 2 - 1.3)
        for axis, side in (("x", width), ("y", length))
    )
    door_wall = draw.count("door wall", 0, 3)
    reach = size[door_wall % 2] / 2 - DOOR[0] / 2 - 0.25
    door_along = draw.uniform("door along", -1, 1) * reach
    room = Room(
        tints=draw.tints(TINTS),
        size=size,
        center=(round(center[0], 4), round(center[1], 4)),
        windows=(),
        door_wall=door_wall,
        door_along=round(door_along, 4),
        floor=draw.choice("floor", FLOORS),
        wall=draw.choice("wall", WALL_MATERIALS),
        furniture=(),
        pictures=(),
        ceiling_lamps=(),
        light=_light(draw),
    )
    room = replace(room, windows=_windows(draw, room))
    room = replace(room, furniture=_furniture(draw, room), ceiling_lamps=_ceiling_lamps(draw, room))
    return replace(room, pictures=_pictures(draw, room))


def _light(draw: Draw) -> Light:
    hour = draw.choice("hour", HOURS)
    return Light(
        environment=draw.choice("environment", hour.environments),
        strength=hour.strength,
        turned=draw.uniform("turned", -180, 180),
        daylight=round(hour.daylight * draw.uniform("daylight", 0.7, 1.4), 4),
        daylight_color=hour.color,
        lamps=draw.uniform("lamps", *hour.lamps),
        lamp_color=draw.choice("lamp color", LAMP_COLORS),
    )


def _windows(draw: Draw, room: Room) -> tuple[Window, ...]:
    """One to three windows, in walls without the door, first in the wall opposite to it."""
    windows = []
    for number in range(draw.count("windows", 1, 3)):
        wall = (room.door_wall + (2, 1, 3)[number]) % 4
        width = draw.uniform(f"width of window {number}", 0.9, min(2.6, room.wall_length(wall) - 1))
        sill = draw.choice(f"sill {number}", (0.12, 0.5, 0.85, 0.95))
        most = room.size[2] - 0.35 - sill
        height = draw.uniform(f"height of window {number}", min(1.2, most), min(2.2, most))
        reach = room.wall_length(wall) / 2 - width / 2 - 0.3
        along = round(draw.uniform(f"window {number} along", -1, 1) * reach, 4)
        windows.append(Window(wall, along, width, sill, height))
    return tuple(windows)


def turned_rectangle(size: Rectangle, x: float, y: float, quarters: int) -> Rectangle:
    """A rectangle about the origin, turned by quarter turns and moved to x and y."""
    x0, y0, x1, y1 = size
    for _ in range(quarters % 4):
        x0, y0, x1, y1 = -y1, x0, -y0, x1
    return (x0 + x, y0 + y, x1 + x, y1 + y)


def apart(first: Rectangle, second: Rectangle) -> bool:
    """Whether two rectangles have a gap between them."""
    return (
        first[0] > second[2] + GAP
        or second[0] > first[2] + GAP
        or first[1] > second[3] + GAP
        or second[1] > first[3] + GAP
    )


def _door_zone(room: Room) -> Rectangle:
    """The floor before the door."""
    spot = _wall_spot(room, room.door_wall, room.door_along, 0.0)
    half = DOOR[0] / 2 + 0.1
    return turned_rectangle((-half, 0.0, half, 1.0), *spot, room.door_wall)


def _wall_spot(room: Room, wall: int, along: float, away: float) -> tuple[float, float]:
    """The x and y of a place before a wall."""
    width, length, _ = room.size
    x, y = room.center
    return [
        (x + along, y - length / 2 + away),
        (x + width / 2 - away, y + along),
        (x - along, y + length / 2 - away),
        (x - width / 2 + away, y - along),
    ][wall]


def _furniture(draw: Draw, room: Room) -> tuple[Furnishing, ...]:
    """Groups in the room's middle, then pieces along the walls, each where the floor is free."""
    taken = [RIGS, _door_zone(room)]
    furniture: list[Furnishing] = []
    for number, group in enumerate(GROUPS):
        if not draw.chance(f"group {number}", group.probability):
            continue
        random = draw.generator(f"place of group {number}")
        for _ in range(200):
            quarters = int(random.integers(4))
            spot = random.uniform(-0.5, 0.5, 2) * room.size[:2] + room.center
            rectangle = turned_rectangle(group.size, *spot, quarters)
            if _is_free(room, rectangle, taken, 0.35):
                taken.append(rectangle)
                furniture += [_with_group(each, spot, quarters) for each in group.pieces]
                break
    for name, most, probability in ORDER:
        for number in range(most):
            if draw.chance(f"{name} {number}", probability):
                random = draw.generator(f"place of {name} {number}")
                found = _along_a_wall(room, random, AT_WALLS[name], taken)
                if found:
                    wall, (x, y), rectangle = found
                    taken.append(rectangle)
                    furniture.append(Furnishing(name, round(x, 4), round(y, 4), 90.0 * wall))
    return tuple(furniture)


def _with_group(piece: Furnishing, spot: np.ndarray, quarters: int) -> Furnishing:
    """A piece of a group, where its group is."""
    x, y = piece.x, piece.y
    for _ in range(quarters):
        x, y = -y, x
    return Furnishing(
        piece.name,
        round(float(x + spot[0]), 4),
        round(float(y + spot[1]), 4),
        piece.turned + 90.0 * quarters,
    )


def _along_a_wall(
    room: Room, random: np.random.Generator, size: Size, taken: list[Rectangle]
) -> tuple[int, tuple[float, float], Rectangle] | None:
    """A free place with the back to a wall, not before a window lower than the piece."""
    x0, y0, x1, y1, height = size
    for _ in range(80):
        wall = int(random.integers(4))
        along = float(random.uniform(-0.5, 0.5)) * room.wall_length(wall)
        hides = any(
            window.wall == wall
            and window.sill < height
            and abs(window.along - along) < window.width / 2 + x1
            for window in room.windows
        )
        spot = _wall_spot(room, wall, along, 0.04 - y0)
        rectangle = turned_rectangle((x0, y0, x1, y1), *spot, wall)
        if not hides and _is_free(room, rectangle, taken, 0.0):
            return wall, spot, rectangle
    return None


def _is_free(room: Room, rectangle: Rectangle, taken: list[Rectangle], from_walls: float) -> bool:
    width, length, _ = room.size
    x, y = room.center
    inside = (
        rectangle[0] > x - width / 2 + from_walls
        and rectangle[2] < x + width / 2 - from_walls
        and rectangle[1] > y - length / 2 + from_walls
        and rectangle[3] < y + length / 2 - from_walls
    )
    return bool(inside and all(apart(rectangle, other) for other in taken))


def _ceiling_lamps(draw: Draw, room: Room) -> tuple[tuple[float, float], ...]:
    """Lamps in a row or in two along the room."""
    width, length, _ = room.size
    rows = 1 + (width > 5)
    count = 1 + (length > 4.5) * draw.count("lamps in a row", 0, 1)
    x = (np.arange(rows) + 0.5) / rows * width - width / 2 + room.center[0]
    y = (np.arange(count) + 0.5) / count * length - length / 2 + room.center[1]
    return tuple((round(float(a), 3), round(float(b), 3)) for a in x for b in y)


def _pictures(draw: Draw, room: Room) -> tuple[Picture, ...]:
    """Prints at eye level, beside windows and doors, and over low furniture."""
    random = draw.generator("pictures")
    pictures: list[Picture] = []
    for number in range(draw.count("pictures", 0, 8)):
        for _ in range(40):
            wall = int(random.choice(WALLS))
            along = round(float(random.uniform(-0.5, 0.5)) * (room.wall_length(wall) - 1.0), 3)
            holes = [(each.along, each.width) for each in room.windows if each.wall == wall]
            holes += [(room.door_along, DOOR[0])] * (wall == room.door_wall)
            holes += [(each.along, 0.5) for each in pictures if each.wall == wall]
            holes += [
                (_along(room, each, wall), 1.2) for each in room.furniture if _tall(each, wall)
            ]
            if all(abs(along - middle) > wide / 2 + 0.5 for middle, wide in holes):
                z = round(float(random.uniform(1.5, 1.75)), 3)
                pictures.append(Picture(number, wall, along, z))
                break
    return tuple(pictures)


def _tall(piece: Furnishing, wall: int) -> bool:
    """Whether a piece at a wall reaches the pictures' height."""
    size = AT_WALLS.get(piece.name)
    return size is not None and size[4] > 1.1 and piece.turned == 90.0 * wall


def _along(room: Room, piece: Furnishing, wall: int) -> float:
    """Where a piece stands along a wall."""
    x = piece.x - room.center[0]
    y = piece.y - room.center[1]
    return (x, y, -x, -y)[wall]
