"""Draws gardens: another court, pond, path and planting, other materials, another time of day."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from scenes.garden.plan import GardenPlan, Sky, Spot
from scenes.library.materials import Color
from scenes.library.variation import Draw, Factors

Ring = tuple[float, float, float]  # x, y, and radius or scale
RIGS = 1.6  # metres from the middle, within which nothing stands but low stones
AS_IT_IS: Factors = (1.0, 1.0, 1.0)

# Factors of the materials' colours. Materials with a comma share theirs.
TINTS = {
    "Maple leaves, Fallen maple leaves": (
        AS_IT_IS,
        (0.25, 3.2, 2.0),
        (1.3, 6.0, 2.0),
        (1.7, 18.0, 28.0),
    ),
    "Green leaves, Yellowing leaves": (AS_IT_IS, (3.2, 1.5, 0.8), (0.7, 0.9, 1.4), (5.0, 1.1, 0.7)),
    "Azalea flowers": (AS_IT_IS, (1.2, 6.0, 2.2), (1.1, 0.4, 0.15), (0.5, 0.9, 2.0)),
    "Grass, Bamboo leaves": (AS_IT_IS, (2.2, 1.5, 1.4), (0.7, 1.1, 1.0)),
    "Moss": (AS_IT_IS, (2.3, 1.4, 1.6), (0.6, 0.9, 0.9), (3.0, 1.7, 1.3)),
    "Gravel": (AS_IT_IS, (1.6, 1.6, 1.7), (1.2, 0.95, 0.65), (0.42, 0.45, 0.5)),
    "Wet stone": (AS_IT_IS, (2.6, 2.4, 2.0), (2.0, 1.0, 0.75), (0.9, 1.4, 1.5)),
    "Vermilion": (AS_IT_IS, (0.12, 0.6, 1.5), (0.55, 2.6, 5.0), (1.6, 8.0, 24.0), (0.15, 2.6, 6.0)),
    "Rough bronze": (AS_IT_IS, (1.7, 1.9, 1.6), (0.7, 1.1, 2.0), (0.35, 0.5, 0.9)),
    "Kerb granite, Plinth granite, Lantern granite, Rock": (
        AS_IT_IS,
        (1.5, 1.15, 0.8),
        (0.5, 0.52, 0.58),
        (1.6, 1.6, 1.65),
    ),
    "Red globe paper": (AS_IT_IS, (0.2, 3.0, 8.0), (1.0, 5.0, 2.0)),
    "Bamboo culm": (AS_IT_IS, (2.4, 2.0, 1.5), (0.4, 0.35, 0.5)),
    "Dark wood": (AS_IT_IS, (2.6, 2.8, 3.0), (2.2, 1.3, 0.8)),
}
# What may be left out, and how often it is there.
PROBABILITIES: Mapping[str, float] = {
    "statue": 0.75,
    "mirror": 0.7,
    "torii": 0.75,
    "paper_globes": 0.6,
    "fire": 0.7,
    "candles": 0.75,
    "fog": 0.7,
    "iris": 0.7,
    "water_lilies": 0.75,
    "carp": 0.8,
    "shrubs": 0.85,
    "fallen_leaves": 0.8,
}


@dataclass(frozen=True)
class Hour:
    """A time of day: the environment, the sky's strength, and the sun, in degrees."""

    environment: str | None
    environment_sun: float
    strength: float
    elevation: tuple[float, float]
    sun: tuple[float, float]
    color: Color
    fog: Factors


HOURS = (
    Hour("sunrise.exr", -35.5, 2.0, (25, 40), (4.5, 6.0), (1.0, 0.80, 0.58), AS_IT_IS),
    Hour(None, 0, 0.22, (45, 75), (3.5, 5.0), (1.0, 0.95, 0.88), (0.9, 0.95, 1.0)),
    Hour(None, 0, 0.25, (20, 40), (3.0, 4.5), (1.0, 0.86, 0.68), (0.8, 0.78, 0.75)),
    Hour(None, 0, 0.35, (8, 14), (2.0, 3.0), (1.0, 0.62, 0.32), (0.9, 0.6, 0.45)),
    Hour(None, 0, 0.5, (1, 4), (0.05, 0.2), (1.0, 0.4, 0.2), (0.3, 0.25, 0.35)),
    Hour("night.exr", 0, 1.0, (35, 65), (0.5, 0.9), (0.6, 0.75, 1.0), (0.08, 0.09, 0.12)),
    Hour("forest.exr", 0, 1.0, (60, 80), (0.3, 0.8), (1.0, 0.97, 0.92), (0.5, 0.55, 0.5)),
)


def drawn(place: int) -> GardenPlan:
    """The plan of a place. Its pond is in the west or in the east."""
    draw = Draw(place)
    hour = draw.choice("hour", HOURS)
    plan = GardenPlan(
        absent=frozenset(
            name
            for name, part in PROBABILITIES.items()
            if not draw.chance(f"{name} is there", part)
        ),
        tints=draw.tints(TINTS) | {"Fog": hour.fog},
        sky=_sky(draw, hour),
        ground_shift=draw.uniform("ground", 10, 500),
    )
    plan = _ground_plan(draw, plan)
    plan = _monuments(draw, plan)
    plan = _in_the_court(draw, plan)
    plan = replace(plan, steps=_steps(draw, plan))
    plan = _around(draw, plan)
    return replace(plan, **_small_lights(draw, plan))


def _sky(draw: Draw, hour: Hour) -> Sky:
    return Sky(
        environment=hour.environment,
        environment_sun=float(np.radians(hour.environment_sun)),
        strength=round(hour.strength * draw.uniform("sky", 0.8, 1.25), 4),
        sun_azimuth=draw.uniform("azimuth", -3.14, 3.14),
        sun_elevation=float(np.radians(draw.uniform("elevation", *hour.elevation))),
        sun=draw.uniform("sun", *hour.sun),
        sun_color=hour.color,
    )


def _ground_plan(draw: Draw, plan: GardenPlan) -> GardenPlan:
    """The court, the pond beside it, and the path from its southern edge."""
    x0 = draw.uniform("court x0", -3.5, -2.4)
    x1 = draw.uniform("court x1", 2.6, 4.8)
    y0 = draw.uniform("court y0", -4.6, -3.4)
    y1 = draw.uniform("court y1", 4.2, 5.7)
    radius = draw.uniform("pond radius", 1.6, 2.7)
    away = 1.12 * radius + draw.uniform("pond away", 0.0, 0.7)
    side = -1 if draw.chance("pond in the west", 0.5) else 1
    court = (x0, y0, x1, y1) if side < 0 else (-x1, y0, -x0, y1)
    pond_x = court[0] - away if side < 0 else court[2] + away
    return replace(
        plan,
        court=court,
        pond_center=(round(pond_x, 4), draw.uniform("pond y", -2.0, 2.4)),
        pond_radius=radius,
        pond_turned=draw.uniform("pond turned", 0, 6.28),
        path_start=round(y0 + 0.3, 4),
    )


def _monuments(draw: Draw, plan: GardenPlan) -> GardenPlan:
    """The statue at the court's northern edge, the mirror beside it, and the torii."""
    x0, _, x1, y1 = plan.court
    middle = (x0 + x1) / 2
    statue = (
        round(middle * 0.4 + draw.uniform("statue x", -0.7, 0.7), 4),
        round(y1 - draw.uniform("statue y", 1.0, 1.3), 4),
    )
    side = 1 if middle > statue[0] else -1
    mirror = (
        round(statue[0] + side * draw.uniform("mirror x", 1.6, 1.9), 4),
        round(statue[1] - draw.uniform("mirror y", 0.3, 0.8), 4),
    )
    torii = (draw.uniform("torii x", -1.4, 1.4), draw.uniform("torii y", -9.6, -7.4))
    return replace(plan, statue=statue, mirror=mirror, torii=torii)


def _free_spots(
    draw: Draw, name: str, count: int, reach: float, allowed: Callable[[float, float], bool]
) -> tuple[Spot, ...]:
    """Up to `count` spots within `reach` of the middle in x and y, where allowed."""
    random = draw.generator(name)
    spots: list[Spot] = []
    for _ in range(600):
        x, y = np.round(random.uniform(-reach, reach, 2), 3).tolist()
        if len(spots) < count and allowed(x, y):
            spots.append((x, y))
    return tuple(spots)


def _apart(spot: Spot, others: list[Spot], least: float) -> bool:
    return all(np.hypot(spot[0] - x, spot[1] - y) > least for x, y in others)


def _in_the_court(draw: Draw, plan: GardenPlan) -> GardenPlan:
    """The fire, the rock islands and the maple."""
    taken = [plan.statue, plan.mirror]

    def free(x: float, y: float) -> bool:
        inside = plan.court_distance(x, y) < -0.7
        beside_path = abs(x) > 0.9 or y > 0
        return bool(inside and beside_path and np.hypot(x, y) > 2.35 and _apart((x, y), taken, 1.4))

    fire = _free_spots(draw, "fire", 1, 5, free) or (plan.fire,)
    taken += fire

    def by_the_court(x: float, y: float) -> bool:
        near = -1.2 < plan.court_distance(x, y) < 0.8 and 3.3 < np.hypot(x, y) < 5
        off = plan.pond_distance(x, y) > 0.4 and plan.path_distance(x, y) > 1.2
        return bool(near and off and _apart((x, y), taken, 1.8))

    maple = _free_spots(draw, "maple", 1, 5, by_the_court) or (plan.maple,)
    taken += maple
    islands: list[Ring] = []
    for number in range(draw.count("islands", 0, 4)):
        radius = draw.uniform(f"island {number}", 0.35, 0.85)

        def clear(x: float, y: float, radius: float = radius) -> bool:
            inside = plan.court_distance(x, y) < -radius - 0.1
            off = np.hypot(x, y) > RIGS + 1.3 * radius and abs(x) > radius + 0.6
            return bool(inside and off and _apart((x, y), taken, 1.1 + radius))

        for x, y in _free_spots(draw, f"place of island {number}", 1, 5, clear):
            islands.append((x, y, radius))
            taken.append((x, y))
    return replace(plan, fire=fire[0], maple=maple[0], rock_islands=tuple(islands))


def _steps(draw: Draw, plan: GardenPlan) -> tuple[Ring, ...]:
    """Flagstones in the middle, and in rows to the statue, the fire, the pond and the torii."""
    random = draw.generator("steps")
    _, y0, _, _ = plan.court
    pond = np.array(plan.pond_center)
    ends: list[Spot] = [(plan.statue[0], plan.statue[1] - 1.0), (0.1, y0)]
    if draw.chance("steps to the fire", 0.6):
        ends.append((0.7 * plan.fire[0], 0.7 * plan.fire[1]))
    if draw.chance("steps to the pond", 0.6):
        ends.append(tuple((0.45 * pond).tolist()))
    rows = [np.linspace((0, 0), end, max(2, round(np.hypot(*end) / 0.78)))[1:] for end in ends]
    y = np.arange(y0 - 0.7, plan.torii[1] + 0.6, -0.85)
    along = plan.torii[0] * np.clip((plan.path_start - 0.5 - y) / 4, 0, 1)
    rows.append(np.column_stack([along + 0.15 * np.sin(y), y]))
    steps: list[Ring] = [(-0.1, -0.05, draw.uniform("middle step", 0.42, 0.6))]
    for x, y in np.concatenate(rows) + random.normal(0, 0.07, (sum(map(len, rows)), 2)):
        radius = random.uniform(0.33, 0.45)
        far = all(np.hypot(x - a, y - b) > 0.62 for a, b, _ in steps)
        off_rocks = all(np.hypot(x - a, y - b) > r * 1.2 + 0.3 for a, b, r in plan.rock_islands)
        off_trunk = np.hypot(x - plan.maple[0], y - plan.maple[1]) > 0.6
        if far and off_rocks and off_trunk and plan.pond_distance(x, y) > 0.6:
            steps.append((round(float(x), 3), round(float(y), 3), round(float(radius), 3)))
    return tuple(steps)


def _around(draw: Draw, plan: GardenPlan) -> GardenPlan:
    """What stands in the moss: lanterns, pines, more maples, and groves of bamboo."""
    taken: list[Spot] = [plan.maple]

    def spots(name: str, count: int, reach: float, off: float, apart: float, far: float) -> list:
        chosen: list[Spot] = []

        def free(x: float, y: float) -> bool:
            away = plan.court_distance(x, y) > off and plan.pond_distance(x, y) > 0.5
            away = away and plan.path_distance(x, y) > off + 0.7 and np.hypot(x, y) > far
            if away and _apart((x, y), [*taken, *chosen], apart):
                chosen.append((x, y))
                return True
            return False

        _free_spots(draw, name, count, reach, lambda x, y: len(chosen) < count and free(x, y))
        taken.extend(chosen)
        return chosen

    lanterns = spots("stone lanterns", draw.count("lanterns", 1, 5), 7, 0.55, 1.6, 0)
    scales = [draw.uniform(f"scale of lantern {i}", 0.85, 1.2) for i in range(len(lanterns))]
    maples = spots("far maples", 2, 11, 1.0, 2.5, 6.5)
    pines = spots("pines", draw.count("pine count", 2, 9), 10, 1.2, 2.2, 0)
    x0, _, x1, y1 = plan.court
    rectangles = (
        (-5.5, y1 + 1.5, 6.5, y1 + 4.6),
        (2.2, -8.5, 9.0, -5.2),
        (-9.0, -9.0, -2.2, -5.2),
        (x1 + 1.6, -3.5, x1 + 4.2, 4.5),
        (x0 - 4.2, -3.5, x0 - 1.6, 4.5),
    )
    groves = tuple(
        (rectangle, draw.count(f"culms {number}", 15, 55))
        for number, rectangle in enumerate(rectangles)
        if draw.chance(f"grove {number}", 0.4)
    )
    return replace(
        plan,
        stone_lanterns=tuple((x, y, size) for (x, y), size in zip(lanterns, scales, strict=True)),
        far_maples=tuple(maples),
        pines=tuple(pines),
        groves=groves,
    )


def _small_lights(draw: Draw, plan: GardenPlan) -> dict[str, tuple]:
    """Candles at the statue and on the pond, lanterns at the path, the rope of globes, and koi."""
    x, y = plan.statue
    pond_x, pond_y = plan.pond_center
    random = draw.generator("candles")
    feet = random.uniform((-0.75, -1.0, 0), (0.75, -0.8, 0), (draw.count("feet", 2, 8), 3))
    feet = np.add(feet, (x, y, 0))
    afloat = random.uniform(-0.6, 0.6, (draw.count("afloat", 0, 7), 2)) * plan.pond_radius
    water = np.column_stack([np.add(afloat, (pond_x, pond_y)), np.full(len(afloat), -0.08)])
    lights = [(x - 0.5, y - 0.95, 0.32), (x + 0.5, y - 0.95, 0.32)]
    lights += [(pond_x, pond_y, 0.12)] * bool(len(water))
    _, y0, _, _ = plan.court
    pairs = [y0 + 0.5 - 1.6 * k for k in range(draw.count("floor lanterns", 0, 3))]
    rope_y = y0 - draw.uniform("rope", 0.4, 0.9)
    koi = draw.generator("koi").uniform(
        (-0.5, -0.5, 0), (0.5, 0.5, 6.28), (draw.count("fish", 3, 14), 3)
    )
    koi = np.add(koi * (plan.pond_radius, plan.pond_radius, 1), (pond_x, pond_y, 0))
    return {
        "candles": _rounded([*feet, *water]),
        "candle_lights": _rounded(lights),
        "floor_lanterns": _rounded([(side * 0.85, y) for y in pairs for side in (-1, 1)]),
        "globe_rope": _rounded(
            [
                (-draw.uniform("west pole", 1.3, 2.2), rope_y, 2.55),
                (draw.uniform("east pole", 1.5, 2.6), rope_y - 0.15, 2.6),
            ]
        ),
        "koi": _rounded(koi),
    }


def _rounded(rows: list | np.ndarray) -> tuple:
    return tuple(tuple(round(float(value), 3) for value in row) for row in rows)
