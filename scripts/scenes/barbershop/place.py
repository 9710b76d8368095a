"""Draws barbershops: another layout, other colours and woods, another hour, other furniture."""

from collections.abc import Mapping

from scenes.barbershop.layout import drawn_layout
from scenes.barbershop.plan import WARM, Barbershop, Light, Room, Wall
from scenes.library.materials import Color
from scenes.library.variation import Draw, Factors, Move

AS_IT_IS: Factors = (1.0, 1.0, 1.0)

# Factors of the materials' colours. Materials with a comma share theirs.
TINTS = {
    "Wallpaper": (
        AS_IT_IS,
        (7.0, 0.9, 0.8),
        (1.2, 1.4, 4.0),
        (9.0, 5.0, 3.5),
        (4.0, 1.8, 3.0),
        (0.6, 0.35, 0.5),
    ),
    "Plaster": (AS_IT_IS, (0.55, 0.85, 1.4), (1.1, 0.7, 0.75), (0.6, 0.95, 0.95), (1.3, 1.45, 1.9)),
    "Mahogany, Mahogany x": (
        AS_IT_IS,
        (3.0, 5.0, 5.5),
        (0.35, 0.6, 0.8),
        (4.5, 12.0, 22.0),
        (0.5, 2.2, 3.2),
    ),
    "Cream tile": (AS_IT_IS, (1.05, 0.6, 0.45), (0.6, 0.85, 1.15), (0.3, 0.33, 0.4)),
    "Black tile": (AS_IT_IS, (9.0, 1.5, 1.0), (1.5, 5.0, 9.0), (3.0, 8.0, 5.0), (14.0, 13.0, 12.0)),
    "Green glaze 0, Green glaze 1, Green glaze 2": (
        AS_IT_IS,
        (14.0, 0.5, 0.5),
        (1.2, 0.9, 5.0),
        (25.0, 4.2, 0.8),
        (1.0, 0.25, 0.4),
        (32.0, 7.0, 9.0),
    ),
    "Cream glaze 0, Cream glaze 1, Cream glaze 2": (
        AS_IT_IS,
        (0.7, 0.95, 1.3),
        (1.1, 0.8, 0.75),
        (0.7, 0.9, 0.75),
        (1.15, 1.2, 1.35),
    ),
    "Oxblood, Tan": (
        AS_IT_IS,
        (0.25, 2.0, 3.0),
        (0.2, 0.7, 6.0),
        (3.2, 22.0, 18.0),
        (0.1, 0.8, 0.9),
    ),
    "Tin": (AS_IT_IS, (0.9, 0.6, 0.4), (0.5, 0.6, 0.75), (1.3, 1.4, 1.7)),
    "Marble": (AS_IT_IS, (0.15, 0.16, 0.18), (0.9, 0.65, 0.55), (0.45, 0.65, 0.5)),
    "Rug red": (AS_IT_IS, (0.15, 3.0, 5.0), (1.2, 6.0, 1.5), (0.5, 2.5, 1.5)),
    "Rug navy": (AS_IT_IS, (8.0, 2.0, 0.5), (1.0, 1.5, 0.5)),
    "Brick": (AS_IT_IS, (1.8, 2.6, 3.2), (0.6, 0.9, 1.1)),
    "Brass, Gilt": (AS_IT_IS, (1.1, 1.7, 4.5), (1.1, 0.8, 1.3)),
    "White towel": (AS_IT_IS, (0.2, 0.5, 0.6), (1.0, 0.7, 0.5)),
    "Iron": (AS_IT_IS, (15.0, 14.0, 12.0), (2.0, 8.0, 6.0)),
}
# What may be left out, and how often it is there.
PROBABILITIES: Mapping[str, float] = {
    "wall_lettering": 0.6,
    "beam": 0.6,
    "palmette": 0.6,
    "rug": 0.6,
    "hair_clippings": 0.6,
    "fan_blade": 0.8,
    "wall_lamp": 0.7,
    "floor_drain": 0.6,
    "entrance_mat": 0.7,
    "window_letters": 0.7,
    "door_sign": 0.7,
    "valance": 0.6,
    "street_lamp": 0.7,
    "ashtray": 0.6,
    "magazines": 0.7,
    "hat_box": 0.6,
    "radio": 0.7,
    "towel_steamer": 0.7,
    "coats": 0.6,
    "umbrella_stand": 0.7,
    "fedora": 0.6,
    "bowler_hat": 0.6,
    "pictures": 0.75,
    "clock": 0.8,
    "barber_pole": 0.7,
    "broom": 0.7,
    "dustpan": 0.6,
    "waste_bins": 0.7,
    "telephone": 0.7,
    "card_box": 0.6,
    "desk_bell": 0.6,
    "till": 0.8,
    "stool": 0.7,
}
# These are nothing without what they belong to.
TOGETHER = {
    "umbrella_stand": ("umbrellas",),
    "fan_blade": ("fan_motor",),
}
# Sky, its colour, sun and daylight in watts, the colour of both, and the lamps' factor.
Hour = tuple[float, Color, float, float, Color, float]
HOURS: tuple[Hour, ...] = (
    (1.6, (0.72, 0.86, 1.0), 260, 45, (1.0, 0.86, 0.66), 1.0),
    (1.8, (0.80, 0.90, 1.0), 420, 80, (1.0, 0.95, 0.86), 0.45),
    (1.1, (0.85, 0.90, 0.95), 0, 70, (0.9, 0.95, 1.0), 0.8),
    (0.9, (1.0, 0.62, 0.40), 300, 30, (1.0, 0.55, 0.28), 0.7),
    (0.06, (0.25, 0.38, 0.8), 0, 3, (0.5, 0.65, 1.0), 1.1),
    (0.015, (0.3, 0.4, 0.7), 0, 1, (1.0, 0.7, 0.4), 0.6),
)
LAMP_COLORS: tuple[Color, ...] = (WARM, (1.0, 0.68, 0.40), (1.0, 0.92, 0.82), (0.85, 0.95, 1.0))


PAPERED: tuple[tuple[Wall, ...], ...] = (
    ("right", "back"),
    ("left", "back"),
    ("left", "right", "back", "front"),
    ("front", "back"),
    (),
)
BOARDS = ("Oak", "Cream", "Mahogany")  # materials of ceilings
FLOORS = ("checker", "checker", "large checker", "stripes", "diagonal", "dots", "rings")


def drawn(place: int) -> Barbershop:
    """The plan of a place. Its rooms are never narrower than the rigs need."""
    draw = Draw(place)
    layout = drawn_layout(draw)
    absent = draw.absent(PROBABILITIES) | layout.missing
    absent |= {name for owner in absent for name in TOGETHER.get(owner, ())}
    sky, sky_color, sun, daylight, color, lamps = draw.choice("hour", HOURS)
    window = layout.windows[0].along
    stations = layout.stations
    return Barbershop(
        absent=absent,
        moves=layout.moves | {"medallion": _medallion(draw)},
        tints=draw.tints(TINTS),
        room=layout.room,
        counter_wall=layout.counter_wall,
        stations=stations,
        pitch=layout.pitch,
        chair_turns=tuple(draw.uniform(f"chair {i}", 30, 150) for i in range(len(stations))),
        windows=layout.windows,
        door=layout.door,
        staff_door=layout.staff_door,
        pole=layout.pole,
        papered=frozenset(draw.choice("papered", PAPERED)) - {layout.counter_wall},
        paper=draw.choice("paper", ("Wallpaper", "Wallpaper", "Brick")),
        floor=draw.choice("floor", FLOORS),
        green_rows=draw.choice("green rows", (0, 4, 7, 11, 11, 16, 23)),
        ceiling="tin" if draw.chance("tin ceiling", 0.6) else draw.choice("boards", BOARDS),
        pendants=_pendants(draw, layout.room),
        lamp_shade=draw.choice("lamp shade", ("globe", "enamel")),
        prints=layout.prints,
        wall_lamps=layout.wall_lamps,
        switches=layout.switches,
        vents=layout.vents,
        clock=layout.clock,
        bins=layout.bins,
        hanging_corner=layout.corners.get("hanging"),
        tree_corner=layout.corners.get("tree"),
        light=Light(
            sky=round(sky * draw.uniform("sky", 0.8, 1.2), 4),
            sky_color=sky_color,
            sun=round(sun * draw.uniform("sun", 0.7, 1.3), 4),
            sun_color=color,
            sun_x=round(window + draw.uniform("sun x", -2.8, 2.8), 4),
            daylight=daylight,
            daylight_color=color if sun else sky_color,
            lamps=round(lamps * draw.uniform("lamps", 0.75, 1.3), 4),
            lamp_color=draw.choice("lamp color", LAMP_COLORS),
        ),
    )


def _medallion(draw: Draw) -> Move:
    """The mosaic in the middle of the floor, larger or smaller."""
    return Move(
        turned=draw.uniform("medallion turn", 0, 360), scale=draw.uniform("medallion", 0.7, 1.5)
    )


def _pendants(draw: Draw, room: Room) -> tuple[tuple[float, float], ...]:
    """Lamps in one row or in two, away from the ceiling fan."""
    columns = draw.choice("pendant columns", ((0.0,), (-0.23, 0.23), (-0.23, 0.23), (-0.32, 0.32)))
    rows = draw.choice("pendant rows", ((-0.2, 0.2), (-0.2, 0.2), (-0.36, -0.15, 0.15, 0.36)))
    return tuple((round(x * room[0], 3), round(y * room[1], 3)) for x in columns for y in rows)
