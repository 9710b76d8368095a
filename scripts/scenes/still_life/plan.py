"""What varies on the board: the pieces and their places, their materials, and the lamps."""

from dataclasses import dataclass

import numpy as np

from scenes.library.variation import Disc, Draw, Move, Variation, discs_apart, turned_discs

RADIUS = 0.3  # of the board
# The string of pearls: from the kettle round the chick, over itself, to the rim.
STRING = [
    (-0.215, -0.035),
    (-0.2, -0.09),
    (-0.17, -0.135),
    (-0.19, -0.185),
    (-0.145, -0.215),
    (-0.095, -0.23),
    (-0.05, -0.205),
    (-0.045, -0.16),
]
# A window on the left, a cool rim behind, a low fill, and one above: place, width and height in
# metres, watts, and colour.
Lamp = tuple[float, float, float, float, float, float, float, float, float]
LAMPS: tuple[Lamp, ...] = (
    (-1.7, -1.1, 1.9, 1.0, 1.3, 56, 1.0, 0.90, 0.76),
    (1.6, 1.5, 1.3, 0.7, 1.1, 32, 0.72, 0.85, 1.0),
    (1.5, -1.9, 0.9, 1.2, 0.8, 12, 1.0, 0.95, 0.90),
    (0.0, 0.2, 2.4, 0.9, 0.9, 14, 1.0, 0.97, 0.93),
)


@dataclass(frozen=True)
class StillLife(Variation):
    """room: an environment that ships with bpy; its strength, and its turn in degrees."""

    lamps: tuple[Lamp, ...] = LAMPS
    room: str = "interior.exr"
    room_strength: float = 0.45
    room_turned: float = -40.0


ORIGINAL = StillLife()


@dataclass(frozen=True)
class Piece:
    """Elements that move together. `discs` cover what they stand on, about `start`."""

    elements: tuple[str, ...]
    start: tuple[float, float]
    discs: tuple[Disc, ...]
    probability: float
    scales: tuple[float, float] = (0.85, 1.07)


BOWL = Piece(("bowl", "pears", "grapes"), (0.045, -0.035), ((0, 0, 0.1), (-0.1, -0.07, 0.05)), 0.85)
# The cloth hangs over the round edge, so that it only turns about the board's middle. The bowl on
# it turns with it.
CLOTH = tuple((0.05 + 0.42 * s, 0.02 - 0.9 * s, 0.11) for s in (0.0, 0.1, 0.2, 0.3))
# From large to small. A piece that finds no room is left out.
PIECES = (
    Piece(("kettle",), (-0.115, 0.075), ((0, 0, 0.095), (-0.113, -0.053, 0.04)), 0.85),
    Piece(
        ("chick", "pearls"),
        (-0.13, -0.13),
        ((0.025, -0.015, 0.065), *((x + 0.13, y + 0.13, 0.012) for x, y in STRING)),
        0.8,
        (1.0, 1.0),
    ),
    Piece(("candle",), (0.005, 0.2), ((0, 0, 0.078),), 0.7),
    Piece(
        ("lemons",),
        (0.155, -0.125),
        ((0.035, 0, 0.05), (-0.05, -0.06, 0.04), (0.01, 0.065, 0.035)),
        0.8,
    ),
    Piece(("carafe",), (0.135, 0.125), ((0, 0, 0.06),), 0.8),
    Piece(("wineglass",), (0.215, 0.02), ((0, 0, 0.04),), 0.85),
    Piece(
        ("knife",),
        (0.015, -0.2),
        tuple((x, 0.21 * x, 0.016) for x in np.arange(-0.09, 0.15, 0.03)),
        0.75,
    ),
)
METALS = ((1.0, 1.0, 1.0), (0.85, 1.3, 0.8), (0.95, 2.1, 3.4), (0.25, 0.55, 0.95), (0.5, 0.85, 1.1))
TINTS = {
    "Walnut": (
        (1.0, 1.0, 1.0),
        (3.2, 4.6, 6.5),
        (2.3, 1.8, 1.4),
        (0.35, 0.4, 0.55),
        (4.2, 8.5, 15.0),
        (0.7, 1.7, 4.2),
    ),
    "Copper": METALS,
    "Brass": ((1.0, 1.0, 1.0), (1.1, 1.6, 4.0), (1.1, 0.85, 1.2)),
    "Linen": (
        (1.0, 1.0, 1.0), (0.25, 0.4, 0.7), (1.1, 0.45, 0.35), (0.5, 0.75, 0.45), (0.2, 0.2, 0.22),
    ),
    "Blue linen": (
        (1.0, 1.0, 1.0), (14.0, 0.6, 0.25), (2.0, 3.0, 0.5), (18.0, 6.5, 0.7), (0.4, 0.3, 0.1),
    ),
    "Wine": ((1.0, 1.0, 1.0), (2.3, 60.0, 12.0), (2.2, 30.0, 14.0), (1.9, 32.0, 2.0)),
    "Glass": ((1.0, 1.0, 1.0), (0.55, 0.85, 0.65), (0.95, 0.72, 0.42), (0.5, 0.68, 0.95)),
    "Pear": ((1.0, 1.0, 1.0), (1.5, 0.45, 0.8), (1.45, 1.35, 1.5), (0.6, 1.2, 1.5)),
    "Grape": ((1.0, 1.0, 1.0), (3.2, 26.0, 3.0), (0.5, 3.0, 4.5), (4.5, 2.0, 0.8)),
    "Lemon": ((1.0, 1.0, 1.0), (1.05, 0.5, 0.6), (0.4, 0.85, 1.6)),
    "Lemon flesh": ((1.0, 1.0, 1.0), (1.0, 0.55, 0.3), (0.75, 1.1, 1.0), (0.95, 0.3, 0.8)),
    "Porcelain": (
        (1.0, 1.0, 1.0), (0.25, 0.45, 0.5), (0.75, 0.4, 0.3), (0.15, 0.15, 0.17), (0.8, 0.9, 0.7),
    ),
    "Cobalt": ((1.0, 1.0, 1.0), (30.0, 1.2, 0.1), (55.0, 15.0, 0.6), (1.5, 6.0, 0.5)),
    "Wax": ((1.0, 1.0, 1.0), (0.7, 0.12, 0.12), (0.35, 0.6, 0.5), (1.05, 1.15, 1.35)),
    "Pearl": ((1.0, 1.0, 1.0), (0.12, 0.13, 0.16), (1.1, 0.8, 0.85)),
    "Down": ((1.0, 1.0, 1.0), (0.45, 0.4, 0.8), (1.1, 1.5, 4.0), (0.3, 0.35, 0.9)),
}  # fmt: skip
ROOMS = ("interior.exr", "courtyard.exr", "studio.exr", "forest.exr", "city.exr")
LIGHTS = (
    (1.0, 1.0, 1.0),
    (1.05, 0.92, 0.72),
    (0.8, 0.95, 1.15),
    (1.1, 0.75, 0.5),
    (0.95, 1.0, 1.05),
)


def drawn(place: int) -> StillLife:
    """The plan of a place."""
    draw = Draw(place)
    moves, absent = _arranged(draw)
    strength = draw.uniform("room strength", 0.15, 0.9)
    return StillLife(
        absent=absent,
        moves=moves,
        tints=draw.tints(TINTS),
        lamps=_lamps(draw),
        room=draw.choice("room", ROOMS),
        room_strength=strength,
        room_turned=draw.uniform("room turned", -180, 180),
    )


def _arranged(draw: Draw) -> tuple[dict[str, Move], frozenset[str]]:
    """The pieces' moves, none on another, and the names of the elements for which is no room."""
    moves: dict[str, Move] = {}
    absent: set[str] = set()
    taken: list[Disc] = []
    with_cloth = draw.chance("cloth", 0.6)
    pieces = PIECES if with_cloth else (BOWL, *PIECES)
    if with_cloth:
        turn = Move(turned=draw.uniform("cloth turned", 0, 360))
        moves |= dict.fromkeys(("cloth", *BOWL.elements), turn)
        about_middle = [(x + BOWL.start[0], y + BOWL.start[1], r) for x, y, r in BOWL.discs]
        taken += turned_discs([*CLOTH, *about_middle], turn)
    else:
        absent.add("cloth")
    for piece in pieces:
        name = piece.elements[0]
        found = None
        if draw.chance(f"{name} is there", piece.probability):
            found = _free_move(draw, piece, taken)
        if found is None:
            absent.update(piece.elements)
            continue
        taken += turned_discs(piece.discs, found)
        moves |= dict.fromkeys(piece.elements, found)
    return moves, frozenset(absent)


def _free_move(draw: Draw, piece: Piece, taken: list[Disc]) -> Move | None:
    """A random move to where the board is free, or None."""
    random = draw.generator(f"place of {piece.elements[0]}")
    scale = round(float(random.uniform(*piece.scales)), 3)
    for _ in range(300):
        x, y = np.round(random.uniform(-0.27, 0.27, 2), 4).tolist()
        turned = round(float(random.uniform(0, 360)), 2)
        tried = Move(piece.start, (x, y), turned, scale)
        discs = turned_discs(piece.discs, tried)
        on_board = all(np.hypot(x, y) + r < RADIUS - 0.012 for x, y, r in discs)
        if on_board and discs_apart(discs, taken):
            return tried
    return None


def _lamps(draw: Draw) -> tuple[Lamp, ...]:
    """The lamps turned about the board, each of its own power, all in one light's colours."""
    turn = np.radians(draw.uniform("lamps turned", 0, 360))
    light = draw.choice("light", LIGHTS)
    power = draw.uniform("power", 0.6, 1.3)
    lamps = []
    for number, (x, y, z, width, height, watts, *color) in enumerate(LAMPS):
        part = draw.uniform(f"power of lamp {number}", 0.2, 1.4)
        row = (
            np.cos(turn) * x - np.sin(turn) * y,
            np.sin(turn) * x + np.cos(turn) * y,
            z * draw.uniform(f"height of lamp {number}", 0.75, 1.1),
            width,
            height,
            watts * power * part,
            *(np.array(color) * light).tolist(),
        )
        lamps.append(tuple(round(float(value), 4) for value in row))
    return tuple(lamps)  # type: ignore[arg-type]
