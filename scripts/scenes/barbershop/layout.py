"""Lays out a barbershop: stations, openings, furniture, and what hangs on the walls.

The stations take one wall, windows and door the front. Furniture then takes free floor along the
other walls, one piece after the other. No rectangle covers a part of another one, or of the rigs'.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenes.barbershop.plan import (
    DOOR_WIDTH,
    HEADINGS,
    SIZES,
    TILE,
    WALLS,
    Fitting,
    Print,
    Room,
    Wall,
    Window,
    position,
    wall_length,
)
from scenes.library.variation import Draw, Move

RIGS = (-0.76, -1.56, 0.76, 1.56)
CORNER = 0.5  # what a plant takes of a corner, in metres
TRIES = 200

Rectangle = tuple[float, float, float, float]  # x0, y0, x1, y1


@dataclass(frozen=True)
class Piece:
    """Furniture that stands together at a wall, and where the original has it.

    x: its reach along the wall in the wall's frame. depth: from the wall, with free floor before
    it. height: pictures hang beside it if it is tall. away: of its origin from the wall.
    """

    elements: tuple[str, ...]
    wall: Wall
    along: float
    x: tuple[float, float]
    depth: float
    height: float
    away: float = 0.0


PIECES: Mapping[str, Piece] = {
    "staff door": Piece(
        ("staff_door_frame", "staff_door"), "back", -1.525, (-0.56, 0.56), 0.9, 2.2
    ),
    "desk": Piece(
        (
            "back_cupboard",
            "radio",
            "towel_steamer",
            "reception_desk",
            "till",
            "desk_bell",
            "telephone",
            "card_box",
            "desk_things",
            "stool",
        ),
        "back",
        1.68,
        (-0.9, 0.82),
        1.95,
        2.5,
    ),
    "waiting": Piece(
        ("waiting_bench", "low_table", "ashtray", "magazines", "rug"),
        "right",
        0.15,
        (-1.12, 1.12),
        1.72,
        0.9,
    ),
    "cabinet": Piece(("display_cabinet", "hat_box"), "right", -1.65, (-0.52, 0.52), 0.75, 2.4),
    "coats": Piece(
        ("coat_rack", "coats", "fedora", "bowler_hat", "umbrella_stand", "umbrellas"),
        "right",
        2.35,
        (-1.02, 0.72),
        0.5,
        2.2,
    ),
    "towels": Piece(("towel_shelves",), "back", -0.42, (-0.45, 0.45), 0.7, 2.1),
    "trolley": Piece(("trolley",), "back", -1.55, (-0.33, 0.33), 0.6, 0.9, away=0.3),
}
LARGE_PIECES = ("staff door", "desk", "waiting")
SMALL_PIECES = ("cabinet", "coats", "towels", "trolley")
CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
# Columns of prints from below, and how high the middle of the lowest is.
COLUMNS: tuple[tuple[float, tuple[str, ...]], ...] = (
    (1.68, ("masters",)),
    (1.65, ("moustaches", "landscape")),
    (1.62, ("deco", "portrait")),
    (1.72, ("prices",)),
    (1.6, ("haircuts", "certificate")),
    (1.75, ("pole",)),
    (1.5, ("landscape", "certificate")),
    (1.45, ("portrait", "portrait", "certificate")),
    (1.62, ("haircuts", "landscape")),
)


@dataclass(frozen=True)
class Layout:
    """Where everything is (see `plan.Barbershop`). missing: elements that found no free floor."""

    room: Room
    counter_wall: Wall
    stations: tuple[float, ...]
    pitch: float
    windows: tuple[Window, ...]
    door: float
    pole: float
    staff_door: tuple[Wall, float] | None
    spots: Mapping[str, tuple[Wall, float]]  # of the pieces
    corners: Mapping[str, tuple[int, int]]
    taken: tuple[Rectangle, ...]
    prints: tuple[Print, ...]
    wall_lamps: tuple[Fitting, ...]
    clock: Fitting
    bins: tuple[tuple[float, float, float], ...]

    @property
    def missing(self) -> frozenset[str]:
        missing = {
            element
            for name, piece in PIECES.items()
            if name not in self.spots
            for element in piece.elements
        }
        if "cleaning" not in self.corners:
            missing |= {"broom", "dustpan"}
        if "hanging" not in self.corners:
            missing |= {"plant_cord", "plant_hook"}
        return frozenset(missing)

    @property
    def moves(self) -> dict[str, Move]:
        """From where the original has each element to where it is."""
        moves = {}
        for name, (wall, along) in self.spots.items():
            piece = PIECES[name]
            how = Move(
                start=position(piece.wall, piece.along, piece.away),
                end=_rounded(position(wall, along, piece.away, room=self.room)),
                turned=HEADINGS[wall] - HEADINGS[piece.wall],
            )
            moves |= dict.fromkeys(piece.elements, how)
        if "cleaning" in self.corners:
            corner = self.corners["cleaning"]
            end = (corner[0] * self.room[0] / 2, corner[1] * self.room[1] / 2)
            how = Move(start=(-2.5, -3.75), end=end, turned=90.0 * CORNERS.index(corner))
            moves |= {"broom": how, "dustpan": how}
        return moves

    @property
    def switches(self) -> tuple[Fitting, ...]:
        """One inside each door, and one beside each mirror."""
        side = 1 if self.door > 0 else -1  # towards the nearer corner
        switches = [Fitting("front", round(self.door + side * 0.645, 4), 1.22)]
        if self.staff_door:
            wall, along = self.staff_door
            switches.append(Fitting(wall, round(along + 0.605, 4), 1.25))
        for along in self.stations:
            switches.append(Fitting(self.counter_wall, round(along + 0.55, 4), 1.03, 0.01))
        return tuple(switches)

    @property
    def vents(self) -> tuple[Fitting, ...]:
        end = wall_length(self.room, self.counter_wall) / 2 - 0.23
        return tuple(Fitting(self.counter_wall, along, 2.46) for along in (-end, end))


def _rounded(spot: tuple[float, float]) -> tuple[float, float]:
    return round(spot[0], 4), round(spot[1], 4)


def drawn_layout(draw: Draw) -> Layout:
    """Draw the room, then what stands in it, then what hangs on its walls."""
    counter_wall = draw.choice("counter wall", ("left", "left", "right", "right", "back"))
    room = _room(draw, counter_wall)
    stations, pitch = _stations(draw, room, counter_wall)
    taken = [RIGS, *_station_floor(room, counter_wall, stations, pitch)]
    windows, door, pole = _front(draw, room, taken)
    taken += _front_floor(room, windows, door)
    spots = _furnish(draw, LARGE_PIECES, room, counter_wall, taken)
    corners = _corners(draw, room, taken)
    taken += [_corner_floor(room, corner) for corner in corners.values()]
    spots |= _furnish(draw, SMALL_PIECES, room, counter_wall, taken)
    openings = [(window.along, window.width) for window in windows] + [(door, DOOR_WIDTH)]
    columns = _columns(draw, room, counter_wall, openings, spots)
    clock, prints, lamps = _hung(columns)
    return Layout(
        room=room,
        counter_wall=counter_wall,
        stations=stations,
        pitch=pitch,
        windows=windows,
        door=door,
        pole=pole,
        staff_door=spots.get("staff door"),
        spots=spots,
        corners=corners,
        taken=tuple(taken),
        prints=prints,
        wall_lamps=lamps,
        clock=clock,
        bins=_bins(room, spots, corners),
    )


def _room(draw: Draw, counter_wall: Wall) -> Room:
    """Width, length and height. The counter's wall is long enough for two stations."""
    if counter_wall == "back":
        columns = draw.count("columns of tiles", 18, 23)
        rows = draw.count("rows of tiles", 24, 28)
    else:
        columns = draw.count("columns of tiles", 16, 21)
        rows = draw.count("rows of tiles", 21, 28)
    return columns * TILE, rows * TILE, draw.choice("height", (3.0, 3.0, 3.3, 3.7))


def _stations(draw: Draw, room: Room, counter_wall: Wall) -> tuple[tuple[float, ...], float]:
    """Two to four stations side by side on their wall, and their distance."""
    length = wall_length(room, counter_wall)
    pitch = draw.uniform("pitch", 1.9, 2.3)
    most = int((length - 0.7) / pitch)
    most = max(2, min(4, most))
    count = draw.choice("stations", (most, most, most, max(2, most - 1)))
    slack = max(0.0, (length - 0.7 - pitch * count) / 2)
    middle = draw.uniform("counter middle", -slack, slack)
    first = middle - pitch * (count - 1) / 2
    return tuple(round(first + pitch * number, 4) for number in range(count)), pitch


def _station_floor(
    room: Room, wall: Wall, stations: Sequence[float], pitch: float
) -> list[Rectangle]:
    """The floor of the counter with its racks, and of the chairs on their mats."""
    middle = (stations[0] + stations[-1]) / 2
    half = pitch * len(stations) / 2 + 0.29
    chairs = (stations[-1] - stations[0]) / 2 + 0.65
    return [
        on_floor(room, wall, middle, (-half, half), 0.52),
        on_floor(room, wall, middle, (-chairs, chairs), 1.72),
    ]


def _front(
    draw: Draw, room: Room, taken: Sequence[Rectangle]
) -> tuple[tuple[Window, ...], float, float]:
    """Windows and door side by side, the floor inside the door free; and the pole between them."""
    random = draw.generator("front")
    while True:
        order = ("dw", "wd", "wdw", "wwd", "dww")[int(random.integers(5))]
        gaps = 0.55 * (len(order) - 1) + 2 * 0.55
        glass = room[0] - gaps - DOOR_WIDTH
        panes = order.count("w")
        width = round(min(3.2, glass / panes * float(random.uniform(0.75, 1.0))), 2)
        rest = glass - panes * width
        x = -room[0] / 2 + 0.55 + rest * float(random.uniform(0, 1))
        middles = []
        for opening in order:
            size = width if opening == "w" else DOOR_WIDTH
            middles.append(round(x + size / 2, 3))
            x += size + 0.55
        door = middles[order.index("d")]
        windows = tuple(
            Window(middle, width)
            for opening, middle in zip(order, middles, strict=True)
            if opening == "w"
        )
        floors = _front_floor(room, windows, door)
        if width > 1.1 and all(apart(floor, other) for floor in floors for other in taken):
            to_right = order.index("d") < len(order) - 1
            pole = door + (1 if to_right else -1) * (DOOR_WIDTH / 2 + 0.27)
            return windows, door, round(pole, 3)


def _front_floor(room: Room, windows: Sequence[Window], door: float) -> list[Rectangle]:
    """The floor inside the door, and below the windows with their radiators."""
    floors = [on_floor(room, "front", door, (-0.56, 0.56), 1.1)]
    for window in windows:
        half = window.width / 2 + 0.16
        floors.append(on_floor(room, "front", window.along, (-half, half), 0.45))
    return floors


def on_floor(
    room: Room, wall: Wall, along: float, x: tuple[float, float], depth: float
) -> Rectangle:
    """The floor that something at a wall takes: x is its reach in the wall's frame."""
    near = position(wall, along, 0.0, x[0], room)
    far = position(wall, along, depth, x[1], room)
    return (
        round(min(near[0], far[0]), 4),
        round(min(near[1], far[1]), 4),
        round(max(near[0], far[0]), 4),
        round(max(near[1], far[1]), 4),
    )


def apart(first: Rectangle, second: Rectangle) -> bool:
    """Whether two rectangles share no area."""
    return bool(
        first[0] >= second[2]
        or second[0] >= first[2]
        or first[1] >= second[3]
        or second[1] >= first[3]
    )


def _furnish(
    draw: Draw,
    names: Sequence[str],
    room: Room,
    counter_wall: Wall,
    taken: list[Rectangle],
) -> dict[str, tuple[Wall, float]]:
    """Spots for some pieces, one after the other. Adds their floor to `taken`."""
    spots = {}
    for name in names:
        piece = PIECES[name]
        spot = _free_spot(draw.generator(f"spot of {name}"), room, piece, counter_wall, taken)
        if spot:
            spots[name] = spot
            taken.append(on_floor(room, *spot, piece.x, piece.depth))
    return spots


def _free_spot(
    random: np.random.Generator,
    room: Room,
    piece: Piece,
    counter_wall: Wall,
    taken: Sequence[Rectangle],
) -> tuple[Wall, float] | None:
    """A wall and a place along it whose floor is free. The staff door is not in the front wall."""
    walls = [wall for wall in WALLS if wall != counter_wall]
    if "staff_door" in piece.elements:
        walls.remove("front")
    for _ in range(TRIES):
        wall = walls[int(random.integers(len(walls)))]
        half = wall_length(room, wall) / 2
        reach = max(-piece.x[0], piece.x[1]) + 0.02
        along = round(float(random.uniform(reach - half, half - reach)), 3)
        if all(apart(on_floor(room, wall, along, piece.x, piece.depth), each) for each in taken):
            return wall, along
    return None


def _corners(draw: Draw, room: Room, taken: Sequence[Rectangle]) -> dict[str, tuple[int, int]]:
    """A corner for broom and dustpan, one for the hanging plant, one for the tree, if free."""
    order = draw.generator("corners").permutation(4)
    free = []
    for number in order:
        corner = CORNERS[int(number)]
        floor = _corner_floor(room, corner)
        if all(apart(floor, other) for other in taken):
            free.append(corner)
    return dict(zip(("tree", "hanging", "cleaning"), free, strict=False))


def _corner_floor(room: Room, corner: tuple[int, int]) -> Rectangle:
    """The floor of a corner, which is given by its signs."""
    x = sorted((corner[0] * room[0] / 2, corner[0] * (room[0] / 2 - CORNER)))
    y = sorted((corner[1] * room[1] / 2, corner[1] * (room[1] / 2 - CORNER)))
    return x[0], y[0], x[1], y[1]


def _bins(
    room: Room, spots: Mapping[str, tuple[Wall, float]], corners: Mapping[str, tuple[int, int]]
) -> tuple[tuple[float, float, float], ...]:
    """A bin beside the broom, and one beside the desk's end."""
    bins = []
    if "cleaning" in corners:
        x, y = corners["cleaning"]
        bins.append((round(x * (room[0] / 2 - 0.22), 4), round(y * (room[1] / 2 - 0.22), 4), 0.0))
    if "desk" in spots:
        wall, along = spots["desk"]
        x, y = _rounded(position(wall, along, 0.75, 0.6, room))
        bins.append((x, y, 70.0))
    return tuple(bins)


Column = tuple[str | tuple[float, tuple[str, ...]], Wall, float]  # what, on which wall, and where


def _columns(
    draw: Draw,
    room: Room,
    counter_wall: Wall,
    openings: Sequence[tuple[float, float]],
    spots: Mapping[str, tuple[Wall, float]],
) -> list[Column]:
    """What hangs side by side on the walls without the counter, beside tall pieces."""
    columns: list[Column] = []
    random = draw.generator("wall decoration")
    for wall in WALLS:
        if wall == counter_wall:
            continue
        half = wall_length(room, wall) / 2
        blocked = _blocked(wall, openings, spots)
        start = -half + 0.12
        for left, right in [*sorted(blocked), (half, half)]:
            failures = 0
            while failures < 6:
                what, width = _next_column(random, columns)
                if start + width > left - 0.06:
                    failures += 1
                    continue
                columns.append((what, wall, round(start + width / 2, 3)))
                start += width + float(random.uniform(0.06, 0.3))
            start = max(start, right + 0.1)
    return columns


def _blocked(
    wall: Wall,
    openings: Sequence[tuple[float, float]],
    spots: Mapping[str, tuple[Wall, float]],
) -> list[tuple[float, float]]:
    """The parts of a wall where openings or tall pieces are: from where to where along it."""
    blocked = []
    if wall == "front":
        blocked += [(middle - size / 2 - 0.2, middle + size / 2 + 0.2) for middle, size in openings]
    for name, (piece_wall, along) in spots.items():
        piece = PIECES[name]
        if piece_wall == wall and piece.height > 1.1:
            low, high = piece.x if wall in ("right", "back") else (-piece.x[1], -piece.x[0])
            blocked.append((along + low, along + high))
    return blocked


def _next_column(
    random: np.random.Generator, columns: Sequence[Column]
) -> tuple[str | tuple[float, tuple[str, ...]], float]:
    """A lamp, the clock once, or a column of prints; and its width in metres."""
    if columns and all(what != "clock" for what, *_ in columns):
        return "clock", 0.5
    if random.random() < 0.25:
        return "lamp", 0.25
    column = COLUMNS[int(random.integers(len(COLUMNS)))]
    return column, max(SIZES[name][0] for name in column[1]) + 0.08


def _hung(
    columns: Sequence[Column],
) -> tuple[Fitting, tuple[Print, ...], tuple[Fitting, ...]]:
    """The clock, the prints and the lamps of the columns."""
    clock = Fitting("front", 0.0, 2.75, 0.001)  # over the window, if no other place is free
    prints = []
    lamps = []
    for what, wall, along in columns:
        if what == "clock":
            clock = Fitting(wall, along, 2.3, 0.001)
        elif what == "lamp":
            lamps.append(Fitting(wall, along, 2.12))
        elif isinstance(what, tuple):
            z, names = what
            for number, name in enumerate(names):
                if number:
                    z += (SIZES[names[number - 1]][1] + SIZES[name][1]) / 2 + 0.09
                prints.append(Print(name, wall, along, round(z, 3)))
    return clock, tuple(prints), tuple(lamps)
