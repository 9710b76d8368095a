"""Draws cloisters: another court, other buildings round it, other stone, planting and sun."""

from collections.abc import Mapping

import numpy as np

from scenes.library.materials import Color
from scenes.library.variation import Draw, Factors
from scenes.lone_monk.plan import SIDES, Cloister, House

AS_IT_IS: Factors = (1.0, 1.0, 1.0)
RIG = 2.0  # half of what the rigs take, in metres about the origin

# Factors of the materials' colours. Materials with a comma share theirs.
TINTS = {
    "Plaster": (
        AS_IT_IS,
        (1.05, 0.62, 0.5),
        (0.75, 0.95, 1.35),
        (1.15, 1.35, 1.9),
        (0.75, 0.95, 0.9),
    ),
    "Whitewash": (AS_IT_IS, (0.95, 0.72, 0.45), (0.55, 0.6, 0.65), (0.85, 0.55, 0.45)),
    "Limestone, Carved stone, Ashlar": (
        AS_IT_IS,
        (0.62, 0.72, 0.95),
        (1.05, 0.75, 0.6),
        (1.35, 1.5, 1.75),
    ),
    "Brick": (AS_IT_IS, (1.3, 1.7, 1.9), (0.6, 0.8, 1.0), (1.5, 2.2, 2.0)),
    "Roof tile": (AS_IT_IS, (0.4, 0.8, 1.6), (1.2, 1.5, 1.5), (0.55, 0.6, 0.6)),
    "Paving": (AS_IT_IS, (1.3, 1.1, 0.8), (0.65, 0.75, 0.9), (1.5, 1.6, 1.7)),
    "Terracotta floor": (AS_IT_IS, (0.7, 1.2, 1.9), (1.5, 2.4, 2.8), (0.4, 0.7, 0.9)),
    "Wood": (AS_IT_IS, (2.0, 2.4, 2.8), (0.5, 1.5, 2.4), (0.4, 1.3, 1.0), (0.5, 0.5, 0.5)),
    "Robe": (AS_IT_IS, (7.0, 10.0, 16.0), (0.25, 0.4, 0.7), (1.5, 2.4, 4.0)),
    "Turf, Grass": (AS_IT_IS, (2.2, 1.5, 1.5), (0.6, 0.9, 0.9)),
    "Petal": (AS_IT_IS, (1.3, 12.0, 9.0), (1.2, 7.0, 1.5), (0.7, 3.0, 9.0)),
    "Lavender": (AS_IT_IS, (3.0, 5.0, 2.2), (3.0, 1.2, 0.6)),
    "Bronze, Iron": (AS_IT_IS, (0.6, 1.4, 2.0)),
}
# What may be left out, and how often it is there.
PROBABILITIES: Mapping[str, float] = {
    "church": 0.7,
    "tower": 0.65,
    "olive_tree": 0.75,
    "cypresses": 0.7,
    "ivy": 0.6,
    "geraniums": 0.7,
    "shrubs": 0.8,
    "monk": 0.75,
    "benches": 0.8,
    "lanterns": 0.7,
    "jars": 0.7,
    "chair": 0.7,
    "broom": 0.0,  # It leans on a column of the original.
    "swallows": 0.6,
    "fallen_leaves": 0.7,
}
DAY_CLOUDS: Color = (9.0, 8.6, 8.2)
# The sun's elevation in degrees, its strength and colour, the sky's strength, the clouds' colour.
# Clouds light nothing, so their brightness has to suit the sky's.
Hour = tuple[tuple[float, float], tuple[float, float], Color, float, Color]
HOURS: tuple[Hour, ...] = (
    ((8, 14), (7.0, 12.0), (1.0, 0.62, 0.34), 0.8, (5.0, 4.0, 3.2)),
    ((22, 38), (12.0, 17.0), (1.0, 0.80, 0.56), 0.34, DAY_CLOUDS),
    ((45, 70), (14.0, 20.0), (1.0, 0.94, 0.85), 0.32, DAY_CLOUDS),
    ((30, 60), (0.5, 2.0), (0.9, 0.95, 1.0), 1.5, (3.6, 3.7, 3.8)),
    ((1, 3), (0.05, 0.2), (1.0, 0.5, 0.3), 3.0, (1.2, 0.75, 0.6)),
)
CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
LEAST_COURT = 14.4  # metres between the axes of opposite arcades
WIDEST_COURT = 19.6
MIDDLE_REACH = 1.3  # of what stands in the middle, with free space round it
# Materials of walls, and how often they are there.
WALLS = ("Plaster", "Plaster", "Whitewash", "Brick", "Ashlar")
GROUNDS = ("lawn", "lawn", "lawn", "gravel", "paved")
# Tops of the houses' storeys: one storey or two.
STOREYS = ((7.2,), (7.7,), (8.2,), (7.4, 9.9), (7.5, 10.2))


def drawn(place: int) -> Cloister:
    """The plan of a place. The rigs stand on one of the four quarters of the court."""
    draw = Draw(place)
    absent = draw.absent(PROBABILITIES)
    bay, bays = _bays(draw)
    front = bay * bays / 2 - 0.25
    corner = draw.count("corner", 0, 3)
    rig = _rig(draw, corner, front)
    elevation, sun, color, sky, cloud_color = draw.choice("hour", HOURS)
    clouds = draw.uniform("clouds", 0.3, 0.62)
    church_side = draw.count("church side", 0, 3)
    houses = _houses(draw, None if "church" in absent else church_side)
    if "church" in absent:
        absent |= {"tower"}
    return Cloister(
        absent=absent,
        tints=draw.tints(TINTS),
        center=(round(-rig[0], 4), round(-rig[1], 4)),
        bay=bay,
        bays=bays,
        walk=draw.uniform("walk", 2.3, 3.4),
        church_side=church_side,
        houses=houses,
        middle=draw.choice("middle", ("well", "fountain", "cross", "statue", "tree")),
        ground=draw.choice("ground", GROUNDS),
        has_hedges=draw.chance("hedges", 0.4),
        arcade_stuff=draw.choice("arcade stuff", WALLS),
        walk_stuff=draw.choice("walk stuff", ("Whitewash", "Whitewash", "Plaster", "Brick")),
        house_stuff=draw.choice("house stuff", WALLS),
        ivy_side=draw.count("ivy side", 0, 3),
        **_trees(draw, rig, front),
        chair=_free_spot(draw, "chair", rig, front, 1.0),
        monk=_monk(draw, rig, front),
        sun_azimuth=draw.uniform("azimuth", 0, 6.28),
        sun_elevation=round(float(np.radians(draw.uniform("elevation", *elevation))), 4),
        sun=draw.uniform("sun", *sun),
        sun_color=color,
        sky=round(sky * draw.uniform("sky", 0.85, 1.2), 4),
        cloud_color=cloud_color,
        clouds=(clouds, round(clouds + 0.28, 4)),
    )


def _bays(draw: Draw) -> tuple[float, int]:
    """The width of the arcades' bays, and their number: an odd one, so that a gate is between."""
    bay = draw.uniform("bay", 1.7, 2.6)
    counts = [count for count in (7, 9, 11) if LEAST_COURT <= bay * count <= WIDEST_COURT]
    return bay, draw.choice("bays", counts)


def _rig(draw: Draw, corner: int, front: float) -> tuple[float, float]:
    """Where the rigs stand in the court's frame, away from the arcades and from the middle."""
    most = front - RIG - 1.2
    across = draw.uniform("rig across", RIG + MIDDLE_REACH, min(4.4, most))
    along = draw.uniform("rig along", 0.8, min(4.4, most))
    rig = (across, along) if draw.chance("rig beside the path", 0.5) else (along, across)
    signs = CORNERS[corner]
    return rig[0] * signs[0], rig[1] * signs[1]


def _houses(draw: Draw, church_side: int | None) -> tuple[House, ...]:
    """Storeys over one to three of the sides without the church. The others have low walls."""
    free = [side for side in SIDES if side != church_side]
    sides = draw.generator("houses").permutation(free)[: draw.count("houses", 1, 3)]
    return tuple(
        House(int(side), draw.choice(f"storeys {side}", STOREYS)) for side in sorted(sides)
    )


def _trees(
    draw: Draw, rig: tuple[float, float], front: float
) -> dict[str, tuple[tuple[float, float], ...]]:
    """Olives and cypresses in the court, away from the rigs, the paths, and each other."""
    olives: list[tuple[float, float]] = []
    cypresses: list[tuple[float, float]] = []
    for name, trees, most, reach in (("olive", olives, 3, 2.1), ("cypress", cypresses, 4, 0.7)):
        for number in range(draw.count(f"{name}s", 1, most)):
            spot = _free_spot(draw, f"{name} {number}", rig, front, reach)
            others = [*olives, *cypresses]
            if all(np.hypot(spot[0] - x, spot[1] - y) > reach + 0.8 for x, y in others):
                trees.append(spot)
    return {"olives": tuple(olives), "cypresses": tuple(cypresses)}


def _free_spot(
    draw: Draw, name: str, rig: tuple[float, float], front: float, reach: float
) -> tuple[float, float]:
    """A spot in one of the quarters of the court. `reach`: how far it keeps from the rigs."""
    random = draw.generator(name)
    while True:
        x, y = random.uniform(2.6, front - 2.2, 2) * CORNERS[int(random.integers(4))]
        if max(abs(x - rig[0]), abs(y - rig[1])) > RIG + reach:
            return round(float(x), 3), round(float(y), 3)


def _monk(draw: Draw, rig: tuple[float, float], front: float) -> tuple[float, float, float]:
    """The monk on one of the paths to the well, away from the rigs."""
    random = draw.generator("monk")
    for _ in range(50):
        far = round(float(random.uniform(2.7, front - 1.5)), 3)
        aside = round(float(random.uniform(-0.5, 0.5)), 3)
        quarter = int(random.integers(4))
        x, y = [(far, aside), (-aside, far), (-far, -aside), (aside, -far)][quarter]
        if max(abs(x - rig[0]), abs(y - rig[1])) > RIG + 0.5:
            break
    return (x, y, round(90.0 * quarter + 180.0 * int(random.integers(2)), 1))
