"""Where things are in the garden: the court, the pond, the path, the ground's height, and spots.

The rigs stand in the middle of the court: no geometry comes near x, y in ±1 m, z in 0.5 … 1.5 m.
`GardenPlan` without arguments is the original garden. `scenes.garden.place` draws others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library.materials import Color
from scenes.library.points import Array, noise, polar, smoothstep, xyz
from scenes.library.shapes import towards, transform
from scenes.library.variation import Variation

TAU = 2 * np.pi

WATER_LEVEL = -0.07
CANDLE_COLOR: Color = (1.0, 0.55, 0.22)  # of the lamps in lanterns and beside candles
Spot = tuple[float, float]
# Flagstones: x, y, radius.
STEPS = (
    (-0.1, -0.05, 0.58),
    (0.66, -0.62, 0.38),
    (-0.72, 0.50, 0.40),
    (0.66, 0.42, 0.42),
    (-0.62, -0.66, 0.38),
    (0.15, 0.98, 0.45),
    (-0.05, 1.85, 0.42),
    (0.08, 2.62, 0.40),
    (0.05, -1.12, 0.44),
    (-0.12, -1.98, 0.42),
    (0.12, -2.80, 0.43),
    (0.0, -3.5, 0.38),
    (1.38, 0.10, 0.38),
    (1.32, 0.92, 0.33),
    (2.05, 0.52, 0.36),
    (-1.45, 0.10, 0.36),
    (-2.15, 0.35, 0.38),
    (0.85, -4.5, 0.3),
    (0.1, -4.35, 0.42),
    (0.3, -5.2, 0.44),
    (0.1, -6.05, 0.42),
    (0.35, -6.9, 0.46),
    (0.1, -7.75, 0.42),
    (1.0, 2.35, 0.34),
)
# Candles on gravel, plinth, gravel, and afloat.
CANDLES = (
    (-0.62, 2.82, 0),
    (-0.48, 2.9, 0),
    (-0.40, 2.73, 0),
    (0.47, 2.88, 0),
    (0.60, 2.76, 0),
    (0.70, 2.9, 0),
    (-0.28, 3.05, 0.14),
    (-0.12, 3.05, 0.14),
    (0.05, 3.05, 0.14),
    (0.3, 3.05, 0.14),
    (-1.30, 2.13, 0),
    (-1.17, 2.27, 0),
    (-1.43, 1.97, 0),
    (-3.95, 0.2, -0.08),
    (-4.3, 1.25, -0.08),
    (-4.75, -0.35, -0.08),
    (-5.2, 0.75, -0.08),
    (-5.9, 1.6, -0.08),
)
CANDLE_LIGHTS = ((-0.5, 2.8, 0.32), (0.58, 2.83, 0.32), (-1.3, 2.1, 0.3), (-4.6, 0.5, 0.12))
PINES = ((5.9, 0.2), (3.1, 6.3), (-7.6, -2.6), (-3.3, 5.6), (6.4, 5.4), (-5.8, -5.6), (9.5, 2.4))
KOI = (
    (-4.1, 0.75, 0.4),
    (-4.55, 0.35, 1.2),
    (-4.35, -0.3, 2.6),
    (-5.1, 1.5, 4.0),
    (-5.4, -0.2, 5.2),
    (-4.9, 0.95, 2.0),
)


@dataclass(frozen=True)
class Sky:
    """The light of a time of day.

    environment: a file that ships with bpy, or None for the physical sky of the sun's elevation.
    environment_sun: the azimuth of the sun in that file, to which the file is turned. Angles are in
    radians. strength: of the sky. sun: the strength of the sun lamp.
    """

    environment: str | None = "sunrise.exr"
    environment_sun: float = np.radians(-35.5)
    strength: float = 2.0
    sun_azimuth: float = np.radians(-174.0)
    sun_elevation: float = np.radians(35.0)
    sun: float = 5.5
    sun_color: Color = (1.0, 0.80, 0.58)


@dataclass(frozen=True)
class GardenPlan(Variation):
    """The measures of a garden, in metres."""

    court: tuple[float, float, float, float] = (-2.7, -3.8, 4.3, 4.9)  # of gravel: x0, y0, x1, y1
    pond_center: Spot = (-5.5, 0.6)
    pond_radius: float = 2.3
    pond_turned: float = 0.0  # of its wavy outline, in radians
    ground_shift: float = 0.0  # moves the mounds and the hills
    path_start: float = -3.5  # its y. From there it leads to the torii.
    statue: Spot = (0.0, 3.75)
    mirror: Spot = (1.75, 3.25)
    fire: Spot = (3.1, 1.1)
    torii: Spot = (0.2, -8.5)
    maple: Spot = (-2.05, -3.0)
    far_maples: tuple[Spot, ...] = ((5.5, -3.0), (-8.3, 5.6))
    pines: tuple[Spot, ...] = PINES
    rock_islands: tuple[tuple[float, float, float], ...] = ((2.75, -2.05, 0.75), (-1.85, 2.55, 0.5))
    # x, y, scale
    stone_lanterns: tuple[tuple[float, float, float], ...] = (
        (4.95, 3.1, 1.0),
        (-1.3, -5.2, 1.1),
        (-4.6, 4.2, 0.9),
    )
    floor_lanterns: tuple[Spot, ...] = ((-0.72, -3.25), (0.85, -3.3))
    globe_rope: tuple[tuple[float, float, float], ...] = ((-1.35, -4.35, 2.55), (2.3, -4.5, 2.6))
    steps: tuple[tuple[float, float, float], ...] = STEPS  # x, y, radius
    candles: tuple[tuple[float, float, float], ...] = CANDLES  # x, y, z
    candle_lights: tuple[tuple[float, float, float], ...] = CANDLE_LIGHTS
    # Rectangles of bamboo, x0, y0, x1, y1, and the culms in each.
    groves: tuple[tuple[tuple[float, float, float, float], int], ...] = (
        ((-5.5, 6.4, 6.5, 9.5), 44),
        ((2.2, -8.5, 9.0, -5.2), 32),
    )
    koi: tuple[tuple[float, float, float], ...] = KOI  # x, y, and turn
    sky: Sky = field(default_factory=Sky)

    @property
    def in_the_moss(self) -> list[Spot]:
        """What stands in the moss."""
        x, y = self.torii
        lanterns = [(x, y) for x, y, _ in self.stone_lanterns]
        return [*lanterns, self.maple, (x - 1.5, y), (x + 1.5, y)]

    def pond_distance(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Approximate distance in metres outside the pond's shore, negative within."""
        dx = x - self.pond_center[0]
        dy = (y - self.pond_center[1]) * 0.8
        angle = np.arctan2(dy, dx) + self.pond_turned
        shore = (
            1 + 0.13 * np.sin(2 * angle + 1.0) + 0.07 * np.sin(3 * angle) + 0.03 * np.sin(7 * angle)
        )
        return np.hypot(dx, dy) - self.pond_radius * shore

    def pond_shore(self, angle: Array) -> Array:
        """The pond's outline (n, 2) by angle. `pond_distance` is 0 on it."""
        reach = np.full(len(angle), self.pond_radius)
        for _ in range(30):
            points = np.array(self.pond_center) + polar(reach, angle)[:, :2]
            reach = reach - 0.7 * self.pond_distance(*points.T)
        return points

    def court_distance(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Distance outside the court's rectangle, negative within."""
        x0, y0, x1, y1 = self.court
        dx = np.maximum(x0 - x, x - x1)
        dy = np.maximum(y0 - y, y - y1)
        return np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) + np.minimum(np.maximum(dx, dy), 0)

    def path_distance(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Distance from the middle of the path that leads from the court to the torii."""
        middle = self.torii[0] * smoothstep(
            self.path_start - 0.5, self.path_start - 4.5, y
        ) + 0.15 * np.sin(y)
        return np.where(
            y < self.path_start, np.abs(x - middle), np.hypot(x - middle, y - self.path_start)
        )

    def ground_height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height of the terrain: flat by the court, mossy mounds around, hills far off."""
        flat = xyz(np.asarray(x) + self.ground_shift, np.asarray(y) + self.ground_shift)
        distance = np.hypot(x, y)
        away = np.minimum(self.court_distance(x, y), self.path_distance(x, y) - 0.6)
        mounds = 0.30 * (noise(flat / 3.1, 11, 2) + 0.45) * smoothstep(0.1, 2.2, away)
        hills = 2.5 * (noise(flat / 23.0, 12, 2) + 0.3) * smoothstep(9.0, 40.0, distance)
        height = mounds + hills + 7.0 * smoothstep(25.0, 170.0, distance)
        shore = self.pond_distance(x, y)
        height = WATER_LEVEL + 0.06 + (height - WATER_LEVEL - 0.06) * smoothstep(0.0, 1.3, shore)
        height -= 0.6 * smoothstep(0.05, -0.9, shore)
        return np.where(self.court_distance(x, y) < 0.02, -0.08, height)

    def spread(
        self,
        random: np.random.Generator,
        count: int,
        corners: Sequence[float],
        spacing: float,
        allowed: Callable[[Array, Array], Array] = lambda x, y: x == x,
        **off: float,
    ) -> Array:
        """Up to `count` points (n, 2) in a rectangle, at least `spacing` apart, where allowed.

        off: how far, at least, from court, pond and path.
        """
        distances = {
            "court": self.court_distance,
            "pond": self.pond_distance,
            "path": self.path_distance,
        }
        chosen = np.empty((0, 2))
        for _ in range(12):
            x, y = tries = random.uniform(corners[:2], corners[2:], (count, 2)).T
            away = [distances[name](x, y) > least for name, least in off.items()]
            for point in tries.T[np.all([allowed(x, y), *away], axis=0)]:
                if len(chosen) < count and (np.hypot(*(chosen - point).T) >= spacing).all():
                    chosen = np.vstack([chosen, point])
        return chosen

    def standing(
        self,
        random: np.random.Generator,
        spots: Array,
        scale: tuple[float, float],
        sink: float = 0.0,
        tilt: float = 0.0,
        sloping: bool = False,
    ) -> list[Matrix]:
        """Places on the ground at spots (n, 2), each turned and scaled at random.

        Each is upright with a random tilt in radians, or perpendicular to the slope. sink: metres
        at scale 1.
        """
        x, y = spots.T
        step = 0.25
        rise_x = self.ground_height(x + step, y) - self.ground_height(x - step, y)
        rise_y = self.ground_height(x, y + step) - self.ground_height(x, y - step)
        ups = xyz(-rise_x, -rise_y, 2 * step) if sloping else xyz(0 * x, 0, 1)
        matrices = []
        for at, up in zip(xyz(x, y, self.ground_height(x, y)), ups, strict=True):
            size = random.uniform(*scale)
            turn = transform(
                rotation=(*random.normal(0, tilt, 2), random.uniform(0, TAU)), scale=size
            )
            matrices.append(towards(at - (0, 0, sink * size), up, "Z") @ turn)
        return matrices


ORIGINAL = GardenPlan()
