"""Draws cloisters: another size, another spot in the court, other stone, planting and sun."""

from collections.abc import Mapping

import numpy as np

from scenes.library.variation import Draw, Factors
from scenes.lone_monk.plan import Cloister

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
    "well": 0.8,
    "tower": 0.65,
    "olive_tree": 0.75,
    "cypresses": 0.75,
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
# The sun's elevation in degrees, its strength and colour, and the sky's strength.
HOURS = (
    ((8, 14), (5.0, 9.0), (1.0, 0.62, 0.34), 0.45),
    ((22, 38), (12.0, 17.0), (1.0, 0.80, 0.56), 0.34),
    ((45, 70), (14.0, 20.0), (1.0, 0.94, 0.85), 0.32),
    ((30, 60), (0.5, 2.0), (0.9, 0.95, 1.0), 0.75),
    ((1, 3), (0.05, 0.2), (1.0, 0.5, 0.3), 1.0),
)
CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def drawn(place: int) -> Cloister:
    """The plan of a place. The rigs stand on one of the four lawns."""
    draw = Draw(place)
    bay = draw.uniform("bay", 2.0, 2.4)
    bays = draw.choice("bays", (7, 7, 9))
    front = bay * bays / 2 - 0.25
    most = front - RIG - 1.2
    corner = draw.count("corner", 0, 3)
    across = draw.uniform("rig across", min(3.3, most), min(4.4, most))
    along = draw.uniform("rig along", 0.8, min(4.4, most))
    rig = (across, along) if draw.chance("rig beside the path", 0.5) else (along, across)
    signs = CORNERS[corner]
    rig = (rig[0] * signs[0], rig[1] * signs[1])
    elevation, sun, color, sky = draw.choice("hour", HOURS)
    clouds = draw.uniform("clouds", 0.3, 0.62)
    return Cloister(
        absent=frozenset(
            name
            for name, part in PROBABILITIES.items()
            if not draw.chance(f"{name} is there", part)
        ),
        tints=draw.tints(TINTS),
        center=(round(-rig[0], 4), round(-rig[1], 4)),
        bay=bay,
        bays=bays,
        walk=draw.uniform("walk", 2.3, 3.4),
        **_lawns(draw, corner, front),
        monk=_monk(draw, rig, front),
        sun_azimuth=draw.uniform("azimuth", 0, 6.28),
        sun_elevation=float(np.radians(draw.uniform("elevation", *elevation))),
        sun=draw.uniform("sun", *sun),
        sun_color=color,
        sky=round(sky * draw.uniform("sky", 0.85, 1.2), 4),
        clouds=(clouds, round(clouds + 0.28, 4)),
    )


def _lawns(draw: Draw, corner: int, front: float) -> dict[str, tuple[float, float]]:
    """The olive, the cypress and the chair, each on a lawn of its own, away from the rigs."""
    first = draw.count("first lawn", 1, 3)
    spots = {}
    for number, name in enumerate(("olive", "cypress", "chair")):
        x, y = CORNERS[(corner + 1 + (first + number) % 3) % 4]
        reach = front - 2.4
        spots[name] = (
            round(x * draw.uniform(f"{name} x", 2.9, reach), 3),
            round(y * draw.uniform(f"{name} y", 2.9, reach), 3),
        )
    return spots


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
