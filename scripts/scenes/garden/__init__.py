"""A Zen garden at sunrise: the elements that light-field methods find hard, all round the viewer.

The rigs stand in the middle of a raked gravel court: no geometry comes near x, y in ±1 m, z in
0.5 … 1.5 m. The fire and the pond's ripples move with the frame number, all else is still.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from scenes.common import (
    Array,
    Color,
    Shape,
    add,
    animate,
    box,
    copies,
    finish,
    frames,
    grid,
    hdri_world,
    icosphere,
    join,
    lathe,
    material,
    mesh,
    noise,
    place,
    plain,
    point_light,
    random_stream,
    scatter,
    sheet,
    steps,
    sun_light,
    transform,
    tube,
)
from scenes.garden.lanterns import floor_lanterns, paper_globes, stone_lanterns
from scenes.garden.materials import palette
from scenes.library.scene import Scene

TAU = 2 * np.pi

# The court of raked gravel: a rectangle x0, y0, x1, y1.
COURT = (-2.7, -3.8, 4.3, 4.9)
POND_CENTER, POND_RADIUS, WATER_LEVEL = np.array([-5.5, 0.6]), 2.3, -0.07
STATUE = (0.0, 3.75)
MIRROR = (1.75, 3.25)
FIRE = (3.1, 1.1)
TORII = (0.2, -8.5)
MAPLE = (-2.05, -3.0)
CANDLES = (  # on the gravel, the plinth's step, beside the rocks, afloat
    *((-0.62, 2.82, 0.0), (-0.48, 2.9, 0.0), (-0.40, 2.73, 0.0)),
    *((0.47, 2.88, 0.0), (0.60, 2.76, 0.0), (0.70, 2.9, 0.0)),
    *((-0.28, 3.05, 0.14), (-0.12, 3.05, 0.14), (0.05, 3.05, 0.14), (0.3, 3.05, 0.14)),
    *((-1.30, 2.13, 0.0), (-1.17, 2.27, 0.0), (-1.43, 1.97, 0.0)),
    *((-3.95, 0.2, -0.08), (-4.3, 1.25, -0.08), (-4.75, -0.35, -0.08), (-5.2, 0.75, -0.08)),
    (-5.9, 1.6, -0.08),
)
CANDLE_LIGHTS = ((-0.5, 2.8, 0.32), (0.58, 2.83, 0.32), (-1.3, 2.1, 0.3), (-4.6, 0.5, 0.12))
ROCK_ISLANDS = ((2.75, -2.05, 0.75), (-1.85, 2.55, 0.5))  # x, y, radius
FLOOR_LANTERNS = ((-0.72, -3.25), (0.85, -3.3))
STONE_LANTERNS = ((4.95, 3.1, 1.0), (-1.3, -5.2, 1.1), (-4.6, 4.2, 0.9))  # x, y, scale
GROVES = ((-5.5, 6.4, 6.5, 9.5), (2.2, -8.5, 9.0, -5.2))  # of bamboo: rectangles x0, y0, x1, y1

SUN_AZIMUTH, SUN_ELEVATION = np.radians(-174.0), np.radians(35.0)
# Where the sun stands in sunrise.exr: the sky is turned so that it stands where ours does.
SKY_SUN_AZIMUTH = np.radians(-35.5)

FLAME_COLOR: Color = (1.0, 0.42, 0.12)
FLAME_HEIGHT, FLAME_TONGUES = 1.0, 6
# Shells of a flame: size, colour, radiance a metre.
FLAME_SHELLS: tuple[tuple[float, Color, float], ...] = (
    (1.0, (1.0, 0.20, 0.025), 6.0),
    (0.78, (1.0, 0.34, 0.05), 7.0),
    (0.5, (1.0, 0.52, 0.14), 12.0),
)
FOG_COLOR: Color = (0.62, 0.60, 0.62)  # radiance
FOG_DENSITY = 0.012  # share of the light lost a metre
FOG_ARCS = 10
CANDLE_COLOR: Color = (1.0, 0.55, 0.22)


@dataclass(frozen=True)
class Recipe:
    """What every element needs to know: the seed, and the share of the full number of triangles."""

    seed: int
    detail: float

    def random(self, name: str) -> np.random.Generator:
        return random_stream(self.seed, name)

    def steps(self, full: float, least: int = 3) -> int:
        """Segments along a curve: a surface's triangles grow with their square."""
        return steps(full, min(1.0, self.detail) ** 0.5, least)

    def copies(self, full: float, least: int = 1) -> int:
        return steps(full, self.detail, least)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int), `detail` (1.0 is the full garden)."""
    recipe = Recipe(int(parameters["seed"]), float(parameters["detail"]))
    scene = Scene(recipe.seed, recipe.detail, palette())
    sky()
    stones = flagstone_layout(recipe)
    terrain(recipe)
    gravel(recipe, stones)
    flagstones(recipe, stones)
    kerb(recipe)
    statue(recipe)
    mirror(recipe)
    rocks(recipe)
    stone_lanterns(scene)
    paper_globes(scene)
    floor_lanterns(scene)
    fire(recipe)
    candles(recipe)
    pond(recipe)
    torii(recipe)
    bamboo(recipe)
    maple(recipe)
    pines(recipe)
    woods(recipe)
    shrubs(recipe)
    grass(recipe)
    fallen_leaves(recipe, stones)
    mountains(recipe)
    fog(recipe)


# --- Where things are -----------------------------------------------------------------------------


def smoothstep(low: float, high: float, value: Array) -> Array:
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def pond_distance(x: Array, y: Array) -> Array:
    """Distance outside the pond's shore, negative within (about, in metres)."""
    dx, dy = x - POND_CENTER[0], (y - POND_CENTER[1]) * 0.8
    angle = np.arctan2(dy, dx)
    shore = 1 + 0.13 * np.sin(2 * angle + 1.0) + 0.07 * np.sin(3 * angle) + 0.03 * np.sin(7 * angle)
    return np.hypot(dx, dy) - POND_RADIUS * shore


def court_distance(x: Array, y: Array) -> Array:
    """Distance outside the court's rectangle, negative within."""
    x0, y0, x1, y1 = COURT
    dx, dy = np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1)
    return np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) + np.minimum(np.maximum(dx, dy), 0)


def path_distance(x: Array, y: Array) -> Array:
    """Distance from the middle of the path that leads from the court to the torii and beyond."""
    middle = TORII[0] * smoothstep(-4.0, -8.0, y) + 0.15 * np.sin(y)
    return np.where(y < -3.5, np.abs(x - middle), np.hypot(x - middle, y + 3.5))


def ground_height(x: Array, y: Array) -> Array:
    """Height of the terrain: flat by the court, mossy mounds around, hills far off."""
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1)
    distance = np.hypot(x, y)
    away = np.minimum(court_distance(x, y), path_distance(x, y) - 0.6)
    mounds = 0.30 * (noise(flat / 3.1, 11, 2) + 0.45) * smoothstep(0.1, 2.2, away)
    hills = 2.5 * (noise(flat / 23.0, 12, 2) + 0.3) * smoothstep(9.0, 40.0, distance)
    rise = 7.0 * smoothstep(25.0, 170.0, distance)
    height = mounds + hills + rise
    shore = pond_distance(x, y)
    height = WATER_LEVEL + 0.06 + (height - WATER_LEVEL - 0.06) * smoothstep(0.0, 1.3, shore)
    height -= 0.6 * smoothstep(0.05, -0.9, shore)
    return np.where(court_distance(x, y) < 0.02, -0.08, height)


def spread(
    random: np.random.Generator,
    count: int,
    corners: tuple[float, float, float, float],
    spacing: float,
    allowed: Callable[[Array, Array], Array],
) -> Array:
    """Up to `count` points (n, 2) in a rectangle, at least `spacing` apart, where allowed."""
    x0, y0, x1, y1 = corners
    chosen = np.empty((0, 2))
    for _ in range(12):
        tries = random.uniform((x0, y0), (x1, y1), (count, 2))
        for point in tries[allowed(tries[:, 0], tries[:, 1])]:
            if len(chosen) < count and (
                not len(chosen) or np.hypot(*(chosen - point).T).min() >= spacing
            ):
                chosen = np.vstack([chosen, point])
    return chosen


def standing(
    random: np.random.Generator,
    points: Array,
    scale: tuple[float, float],
    sink: float = 0.0,
    tilt: float = 0.0,
) -> list[Matrix]:
    """Upright places on the ground at points (n, 2), each turned and scaled at random."""
    heights = ground_height(points[:, 0], points[:, 1])
    matrices = []
    for (x, y), z in zip(points, heights, strict=True):
        size = random.uniform(*scale)
        rotation = (*random.normal(0, tilt, 2), random.uniform(0, TAU))
        matrices.append(transform((x, y, z - sink * size), rotation, size))
    return matrices


def lying(random: np.random.Generator, points: Array, scale: tuple[float, float]) -> list[Matrix]:
    """Places on the ground at points (n, 2) that follow its slope, turned and scaled at random."""
    x, y = points.T
    step = 0.25
    slope_x = (ground_height(x + step, y) - ground_height(x - step, y)) / (2 * step)
    slope_y = (ground_height(x, y + step) - ground_height(x, y - step)) / (2 * step)
    up = np.stack([-slope_x, -slope_y, np.ones_like(x)], axis=-1)
    angle = random.uniform(0, TAU, len(points))
    forward = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(x)], axis=-1)
    forward[:, 2] = slope_x * forward[:, 0] + slope_y * forward[:, 1]
    matrices = []
    for turn, px, py, pz in zip(frames(forward, up), x, y, ground_height(x, y), strict=True):
        size = Matrix.Scale(random.uniform(*scale), 4)
        matrices.append(Matrix.Translation((px, py, pz)) @ Matrix(turn.tolist()).to_4x4() @ size)
    return matrices


# --- Sky and ground -------------------------------------------------------------------------------


def sky() -> None:
    """The sunrise that ships with bpy; a sun lamp, higher up, takes the place of its sun."""
    hdri_world("sunrise.exr", 2.0, SUN_AZIMUTH - SKY_SUN_AZIMUTH, brightest=8.0)
    sun_light("Sun", SUN_AZIMUTH, SUN_ELEVATION, 5.5, (1.0, 0.80, 0.58), np.radians(1.5))


def moss_material() -> bpy.types.Material:
    made, graph = material("Moss")
    where = graph.coordinates()
    broad = graph.noise(where, 0.35, 3.0)
    fine = graph.noise(where, 28.0, 3.0, 0.7)
    tint = graph.ramp(
        graph.math("ADD", graph.math("MULTIPLY", broad, 0.6), graph.math("MULTIPLY", fine, 0.4)),
        [
            (0.30, (0.016, 0.032, 0.006)),
            (0.48, (0.045, 0.085, 0.013)),
            (0.62, (0.095, 0.120, 0.022)),
            (0.75, (0.110, 0.085, 0.036)),
        ],
    )
    surface = graph.add("ShaderNodeBsdfDiffuse", {"Color": tint, "Normal": graph.bump(fine, 0.03)})
    return finish(made, graph, graph.plain_when_diffuse(surface, (0.065, 0.085, 0.018)))


def terrain(recipe: Recipe) -> None:
    """The ground around the court, out to the foot of the mountains."""
    near = np.linspace(1.5, 12.0, recipe.steps(120))
    radii = np.concatenate([near, np.geomspace(12.0, 420.0, recipe.steps(60))[1:]])
    angles = np.linspace(0, TAU, recipe.steps(420), endpoint=False)
    x, y = np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))
    points = np.stack([x, y, ground_height(x, y)], axis=-1)
    add("Terrain", sheet(points[::-1], closed=True), moss_material())


def flagstone_layout(recipe: Recipe) -> list[tuple[Array, float]]:
    """The flagstones as outlines (n, 2) with a height: a path to the statue, one to the fire."""
    random = recipe.random("flagstones")
    middles = [(-0.1, -0.05, 0.58), (0.66, -0.62, 0.38), (-0.72, 0.50, 0.40), (0.66, 0.42, 0.42)]
    middles += [(-0.62, -0.66, 0.38), (0.15, 0.98, 0.45), (-0.05, 1.85, 0.42), (0.08, 2.62, 0.40)]
    middles += [(0.05, -1.12, 0.44), (-0.12, -1.98, 0.42), (0.12, -2.80, 0.43), (0.0, -3.5, 0.38)]
    middles += [(1.38, 0.10, 0.38), (1.32, 0.92, 0.33), (2.05, 0.52, 0.36), (-1.45, 0.10, 0.36)]
    middles += [(-2.15, 0.35, 0.38), (0.85, -4.5, 0.3), (0.1, -4.35, 0.42), (0.3, -5.2, 0.44)]
    middles += [(0.1, -6.05, 0.42), (0.35, -6.9, 0.46), (0.1, -7.75, 0.42), (1.0, 2.35, 0.34)]
    layout = np.array(middles)
    apart = np.hypot(*(layout[:, None, :2] - layout[:, :2]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    shares = layout[:, 2, None] / (layout[:, 2, None] + layout[:, 2])
    fitting = ((apart - 0.04) * shares).min(axis=1) / 1.14  # what keeps them from touching
    stones = []
    for x, y, radius in zip(*layout[:, :2].T, np.minimum(layout[:, 2], fitting), strict=True):
        angles = np.linspace(0, TAU, recipe.steps(48, 8), endpoint=False)
        wave = random.uniform(0, TAU, 4)
        stretch = random.uniform(0.86, 1.1)
        # A polygon of 5 to 7 sides with rounded corners, its sides a little wavy.
        sides, turn = random.integers(5, 8), random.uniform(0, TAU)
        nearest = (angles - turn + np.pi / sides) % (TAU / sides) - np.pi / sides
        polygon = np.cos(np.pi / sides) / np.cos(nearest)
        reach = radius * (0.35 + 0.65 * polygon + 0.03 * np.sin(3 * angles + wave[0]))
        reach *= 1 + 0.05 * np.sin(2 * angles + wave[1])
        outline = np.stack([reach * np.cos(angles) * stretch, reach * np.sin(angles)], axis=-1)
        stones.append((outline + np.array([x, y]), 0.035 + random.uniform(0, 0.015)))
    return stones


def raked_height(x: Array, y: Array, stones: Sequence[tuple[Array, float]]) -> Array:
    """The gravel's relief: straight furrows, rings around the islands, smoothed by the stones."""
    period, depth, rings = 0.095, 0.015, 0.62
    islands = [*ROCK_ISLANDS, (*STATUE, 0.85), (*FIRE, 0.5)]
    reach = np.min([np.hypot(x - ix, y - iy) - r for ix, iy, r in islands], axis=0)
    wavy = x + 0.02 * np.sin(2.1 * y)
    furrows = np.where(reach < rings, np.cos(TAU * reach / period), np.cos(TAU * wavy / period))
    seam = smoothstep(0.0, 0.05, np.abs(reach - rings))
    calm = np.ones_like(x)
    for outline, _ in stones:
        middle = outline.mean(0)
        radius = np.hypot(*(outline - middle).T).mean()
        calm = np.minimum(
            calm, smoothstep(0.0, 0.22, np.hypot(x - middle[0], y - middle[1]) - radius)
        )
    calm *= smoothstep(0.0, -0.15, court_distance(x, y))
    rough = 0.004 * noise(np.stack([x, y, np.zeros_like(x)], axis=-1) * 9.0, 21, 2)
    return depth * furrows * seam * calm + rough


def gravel(recipe: Recipe, stones: Sequence[tuple[Array, float]]) -> None:
    """The court's raked gravel, modelled furrow by furrow; its grains are in the shader."""
    x0, y0, x1, y1 = COURT
    x = np.linspace(x0, x1, recipe.steps((x1 - x0) / 0.024))
    y = np.linspace(y0, y1, recipe.steps((y1 - y0) / 0.020))
    gx, gy = np.meshgrid(x, y)
    made, graph = material("Gravel")
    where = graph.coordinates()
    grains = graph.voronoi(where, 130.0)
    tint = graph.ramp(
        graph.xyz(grains.outputs["Color"])[0],
        [
            (0.0, (0.20, 0.185, 0.165)),
            (0.4, (0.36, 0.345, 0.315)),
            (0.8, (0.47, 0.45, 0.41)),
            (1.0, (0.62, 0.60, 0.56)),
        ],
    )
    shade = graph.span(grains.outputs["Distance"], 1.0, 0.45, 0.25, 0.75)
    tint = graph.mix(
        1.0, tint, graph.add("ShaderNodeCombineXYZ", {0: shade, 1: shade, 2: shade}), "MULTIPLY"
    )
    height = graph.math("SUBTRACT", 1.0, grains.outputs["Distance"])
    surface = graph.add(
        "ShaderNodeBsdfDiffuse", {"Color": tint, "Normal": graph.bump(height, 0.006)}
    )
    finish(made, graph, graph.plain_when_diffuse(surface, (0.36, 0.34, 0.31)))
    add("Gravel", grid(x, y, raked_height(gx, gy, stones)), made)


def flagstones(recipe: Recipe, stones: Sequence[tuple[Array, float]]) -> None:
    """Dark polished stones, still wet in places: sharp and blurred reflections side by side."""
    made, graph = material("Wet stone")
    where = graph.coordinates()
    grain = graph.noise(where, 60.0, 2.0, 0.7)
    veins = graph.noise(where, 3.2, 5.0, 0.65, 0.8)
    wet = graph.span(graph.noise(where, 2.1, 2.0), 0.0, 1.0, 0.44, 0.56)
    dry_tint = graph.ramp(
        veins, [(0.3, (0.075, 0.08, 0.085)), (0.52, (0.13, 0.13, 0.125)), (0.6, (0.2, 0.19, 0.17))]
    )
    tint = graph.mix(wet, dry_tint, graph.mix(1.0, dry_tint, (0.42, 0.42, 0.45), "MULTIPLY"))
    roughness = graph.math("ADD", graph.span(wet, 0.34, 0.07), graph.math("MULTIPLY", grain, 0.12))
    surface = graph.principled(
        Base_Color=tint, Roughness=roughness, IOR=1.6, Normal=graph.bump(grain, 0.0012)
    )
    finish(made, graph, graph.plain_when_diffuse(surface, (0.09, 0.09, 0.09)))
    for i, (outline, height) in enumerate(stones):
        middle = outline.mean(0)
        shape = cushion(outline - middle, height + 0.1, 0.03, recipe.steps(10, 2), i)
        base = float(ground_height(np.array(middle[0]), np.array(middle[1])))
        base = 0.0 if court_distance(*middle) < 0 else base
        add(f"Flagstone.{i:02d}", shape, made, matrix=transform((*middle, base - 0.1)))


def cushion(outline: Array, height: float, rounding: float, rings: int, seed: int) -> Shape:
    """A flat stone: an outline (n, 2) around the origin, extruded, with a rounded rim."""
    turns = np.linspace(0, np.pi / 2, 5)
    reach = np.hypot(*outline.T).min()
    inset = [*(rounding * (1 - np.cos(turns))), *np.linspace(rounding, reach, rings + 2)[1:-1]]
    level = [*(height - rounding * (1 - np.sin(turns))), *[height] * rings]
    shrink = 1 - np.array([0.0, *inset]) / reach
    rows = np.empty((len(shrink), len(outline), 3))
    rows[..., :2] = shrink[:, None, None] * outline
    rows[..., 2] = np.array([0.0, *level])[:, None]
    rows[1:, :, 2] += 0.004 * noise(
        np.stack(
            [*rows[1:, :, :2].transpose(2, 0, 1), np.full(rows[1:, :, 0].shape, seed * 3.7)],
            axis=-1,
        )
        * 5.0,
        31,
        3,
    )
    body = sheet(rows, closed=True)
    n, last = len(outline), len(rows) * len(outline)
    ring = np.arange(last - n, last, dtype=np.int32)
    middle = rows[-1].mean(0)
    cap = np.stack([ring, np.roll(ring, -1), np.full_like(ring, last)], axis=-1)
    return Shape(np.vstack([body.vertices, middle]), body.quads, cap)


def granite_material(name: str, tint: Color, moss: float) -> bpy.types.Material:
    """Speckled granite; `moss` 0 … 1 is how far moss has come on what faces upwards."""
    made, graph = material(name)
    where = graph.coordinates()
    speckle = graph.noise(where, 90.0, 2.0, 0.8)
    broad = graph.noise(where, 3.0, 4.0, 0.6)
    dark = tuple(0.45 * c for c in tint)
    stone = graph.ramp(speckle, [(0.36, dark), (0.5, tint), (0.66, tuple(1.5 * c for c in tint))])
    stone = graph.mix(graph.span(broad, 0.0, 0.5, 0.35, 0.75), stone, (0.10, 0.095, 0.08))
    normal = graph.add("ShaderNodeNewGeometry").outputs["Normal"]
    upwards = graph.math("ADD", graph.xyz(normal)["Z"], graph.math("MULTIPLY", broad, 1.6))
    cover = graph.span(upwards, 0.0, 1.0, 2.05 - moss, 2.25 - moss)
    green = graph.ramp(speckle, [(0.3, (0.03, 0.05, 0.008)), (0.7, (0.10, 0.13, 0.025))])
    surface = graph.principled(
        Base_Color=graph.mix(cover, stone, green),
        Roughness=graph.span(cover, 0.62, 0.95),
        Normal=graph.bump(speckle, 0.003),
    )
    return finish(made, graph, graph.plain_when_diffuse(surface, tint))


def kerb(recipe: Recipe) -> None:
    """Granite blocks that hold the gravel in."""
    random = recipe.random("kerb")
    stone = granite_material("Kerb granite", (0.23, 0.22, 0.20), 0.35)
    blocks = []
    for i in range(3):
        shape = box((0.62, 0.15, 0.26), 0.02, 2)
        shape.vertices = shape.vertices + 0.008 * noise(shape.vertices * 6 + i * 9, 41, 2)[:, None]
        blocks.append(mesh(f"Kerb.{i}", shape, stone))
    x0, y0, x1, y1 = COURT
    sides = (((x0, y0), (x1, y0), 0.0), ((x1, y0), (x1, y1), 0.25 * TAU))
    sides += (((x1, y1), (x0, y1), 0.5 * TAU), ((x0, y1), (x0, y0), 0.75 * TAU))
    places = []
    for start, end, angle in sides:
        count = round(float(np.hypot(end[0] - start[0], end[1] - start[1])) / 0.645)
        for k in range(count):
            x, y = np.array(start) + (np.array(end) - start) * (k + 0.5) / count
            if pond_distance(x, y) < 0.1 or (y < y0 + 0.1 and abs(x) < 0.55):
                continue
            wobble = random.normal(0, 0.012, 3)
            places.append(
                transform(
                    (x + wobble[0], y + wobble[1], -0.03 + wobble[2]), (0, 0, angle + wobble[0])
                )
            )
    scatter("Kerb", blocks, places)


# --- The statue and its mirror --------------------------------------------------------------------


def bronze_material() -> bpy.types.Material:
    """Rough metal: worn bronze with patina, brushed in changing directions."""
    made, graph = material("Rough bronze")
    where = graph.coordinates()
    broad = graph.noise(where, 2.6, 5.0, 0.6)
    fine = graph.noise(where, 26.0, 5.0, 0.7)
    brushed = graph.noise(graph.coordinates("Object", (4.0, 4.0, 160.0)), 1.0, 2.0)
    patina = graph.span(
        graph.math("ADD", broad, graph.math("MULTIPLY", fine, 0.5)), 0.0, 1.0, 0.72, 0.95
    )
    metal = graph.ramp(fine, [(0.3, (0.36, 0.20, 0.09)), (0.7, (0.62, 0.40, 0.19))])
    roughness = graph.math(
        "ADD", graph.span(broad, 0.16, 0.46, 0.3, 0.7), graph.math("MULTIPLY", fine, 0.16)
    )
    relief = graph.math("ADD", graph.math("MULTIPLY", brushed, 0.25), fine)
    surface = graph.principled(
        Base_Color=graph.mix(patina, metal, (0.10, 0.19, 0.16)),
        Metallic=graph.span(patina, 1.0, 0.15),
        Roughness=graph.math("ADD", roughness, graph.math("MULTIPLY", patina, 0.3)),
        Anisotropic=0.6,
        Anisotropic_Rotation=graph.noise(where, 1.3, 2.0),
        Normal=graph.bump(relief, 0.003),
    )
    return finish(made, graph, surface)


def ellipsoid(center: Sequence[float], radii: Sequence[float]) -> Shape:
    return icosphere(4).transformed(transform(center, scale=radii))


def limb(points: Sequence[Sequence[float]], radii: Sequence[float]) -> Shape:
    """A limb: a tube along the points with round ends."""
    t = np.linspace(0, len(points) - 1, 24)
    knots = np.arange(len(points))
    path = np.stack([np.interp(t, knots, axis) for axis in np.array(points).T], axis=-1)
    radius = np.interp(t, knots, radii)
    ends = [ellipsoid(points[i], (radii[i],) * 3) for i in (0, -1)]
    return join([tube(path, radius, 20), *ends])


def figure(recipe: Recipe) -> Shape:
    """The seated figure, 1.7 m high, facing −Y: parts melted into one skin, with a folded robe."""
    parts = [
        ellipsoid((0, 0.06, 0.20), (0.38, 0.28, 0.21)),
        ellipsoid((0, 0.06, 0.50), (0.26, 0.20, 0.36)),
        ellipsoid((0, 0.03, 0.80), (0.30, 0.20, 0.23)),
        limb([(0, 0.04, 0.95), (0, 0.02, 1.2)], [0.13, 0.095]),
        ellipsoid((0, -0.01, 1.36), (0.160, 0.180, 0.205)),
        ellipsoid((0, -0.10, 1.24), (0.085, 0.075, 0.06)),
        ellipsoid((0, -0.188, 1.345), (0.024, 0.035, 0.055)),
        ellipsoid((0, -0.160, 1.275), (0.055, 0.035, 0.016)),
        ellipsoid((0, 0.02, 1.42), (0.172, 0.180, 0.180)),
        ellipsoid((0, 0.03, 1.60), (0.085, 0.085, 0.075)),
    ]
    for side in (-1, 1):
        parts += [
            limb(
                [(side * 0.2, 0.06, 0.17), (side * 0.55, -0.18, 0.13), (-side * 0.10, -0.40, 0.13)],
                [0.17, 0.135, 0.09],
            ),
            limb(
                [(side * 0.32, 0.03, 0.93), (side * 0.43, 0.0, 0.56), (side * 0.09, -0.34, 0.34)],
                [0.115, 0.092, 0.055],
            ),
            ellipsoid((side * 0.06, -0.35, 0.32), (0.13, 0.075, 0.05)),
            ellipsoid((side * 0.165, 0.0, 1.31), (0.022, 0.042, 0.11)),
            ellipsoid((side * 0.065, -0.158, 1.385), (0.045, 0.028, 0.018)),
        ]
    whole = add("Statue parts", join(parts))
    remesh = whole.modifiers.new("Melt", "REMESH")
    remesh.mode, remesh.voxel_size = "VOXEL", 0.011 / recipe.detail**0.5
    smooth = whole.modifiers.new("Smooth", "SMOOTH")
    smooth.factor, smooth.iterations = 0.5, 4
    skin = evaluated_shape(whole)
    source = whole.data
    bpy.data.objects.remove(whole)
    bpy.data.meshes.remove(source)
    return folded(skin)


def evaluated_shape(thing: bpy.types.Object) -> Shape:
    """The shape of an object after its modifiers; its faces are quads and triangles."""
    data = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    vertices = np.empty(len(data.vertices) * 3, dtype=np.float32)
    data.vertices.foreach_get("co", vertices)
    corners = np.empty(len(data.loops), dtype=np.int32)
    data.loops.foreach_get("vertex_index", corners)
    sizes = np.empty(len(data.polygons), dtype=np.int32)
    data.polygons.foreach_get("loop_total", sizes)
    starts = np.cumsum(sizes) - sizes
    quads, triangles = (corners[starts[sizes == n, None] + np.arange(n)] for n in (4, 3))
    return Shape(vertices.reshape(-1, 3).astype(float), quads, triangles)


def folded(skin: Shape) -> Shape:
    """Folds of cloth pressed into the robe: over the left shoulder, and around arms and legs."""
    x, y, z = skin.vertices.T
    outward = skin.vertices - np.stack(
        [0.5 * x, np.full_like(x, 0.05), np.clip(z, 0.2, 0.8)], axis=-1
    )
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    bend = 0.05 * noise(skin.vertices * 3.0, 51, 2)
    across = z - 0.55 * x + 1.2 * y * y + bend
    robe = smoothstep(-0.02, 0.02, x + 0.34 * (z - 0.45) + 0.1) * smoothstep(1.02, 0.95, z)
    robe = np.maximum(robe, smoothstep(0.42, 0.36, z))
    hands = smoothstep(0.17, 0.13, np.hypot(x, (z - 0.33) * 1.4)) * smoothstep(-0.22, -0.27, y)
    folds = 0.010 * np.abs(np.sin(across * 34)) ** 0.7 * robe * (1 - hands) + 0.008 * robe * (
        1 - hands
    )
    return Shape(skin.vertices + outward * folds[:, None], skin.quads, skin.triangles)


def curls(recipe: Recipe) -> Shape:
    """The figure's hair: small snail curls on the skull and its knot."""
    made = []
    for center, radii, count, lowest in (
        ((0, 0.02, 1.42), (0.172, 0.180, 0.180), 260, -0.35),
        ((0, 0.03, 1.60), (0.085, 0.085, 0.075), 70, -0.2),
    ):
        k = np.arange(count) + 0.5
        z = 1 - 2 * k / count
        angle = k * TAU * 0.6180339887
        unit = np.stack(
            [np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=-1
        )
        hairline = lowest + 0.75 * smoothstep(0.1, -0.7, unit[:, 1])
        unit = unit[unit[:, 2] > hairline]
        scale = np.broadcast_to(0.021 * np.eye(3), (len(unit), 3, 3))
        made.append(copies(icosphere(recipe.steps(2, 1)), scale, center + unit * radii))
    return join(made)


def lotus(recipe: Recipe) -> Shape:
    """The seat: a drum with two crowns of petals."""
    drum = lathe(
        [(0.0, 0.0), (0.52, 0.0), (0.60, 0.05), (0.56, 0.12), (0.60, 0.2), (0.0, 0.21)],
        recipe.steps(64, 8),
    )
    u = np.linspace(0, 1, recipe.steps(10, 4))
    v = np.linspace(-1, 1, recipe.steps(9, 3))
    width = 0.115 * np.sin(np.pi * np.clip(0.15 + 0.85 * u, 0, 1)) ** 0.6
    gu, gv = np.meshgrid(u, v, indexing="ij")
    petal = np.stack(
        [
            width[:, None] * gv,
            0.10 * np.sin(np.pi * 0.55 * gu) + 0.03 * gv**2 * -1 + 0.05 * gu**4,
            0.2 * gu,
        ],
        axis=-1,
    )
    parts = [drum]
    for row, (count, radius, base) in enumerate(((18, 0.57, 0.015), (18, 0.53, 0.06))):
        angle = (np.arange(count) + 0.5 * row) * TAU / count
        out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        turn = frames(out, np.broadcast_to((0.0, 0.0, 1.0), out.shape))
        parts.append(copies(sheet(petal), turn, out * radius + (0, 0, base)))
    return join(parts)


def statue(recipe: Recipe) -> None:
    """A seated bronze figure on a lotus seat and a granite plinth, with a polished halo."""
    bronze = bronze_material()
    granite = granite_material("Plinth granite", (0.30, 0.29, 0.275), 0.15)
    x, y = STATUE
    for i, (width, low, high) in enumerate(
        ((1.55, -0.1, 0.14), (1.32, 0.14, 0.5), (1.45, 0.5, 0.58))
    ):
        block = box((width, width, high - low), 0.02, 3)
        add(f"Plinth.{i}", block, granite, matrix=transform((x, y, (low + high) / 2)))
    place("Lotus", mesh("Lotus", lotus(recipe), bronze), transform((x, y, 0.58), scale=1.05))
    body = join([figure(recipe), curls(recipe)])
    place("Statue", mesh("Statue", body, bronze), transform((x, y, 0.78), scale=0.92))
    brass = plain("Polished brass", (0.75, 0.53, 0.22), Metallic=1.0, Roughness=0.16)
    ring = np.linspace(0, TAU, recipe.steps(96, 12))
    circle = np.stack([np.cos(ring), 0 * ring, np.sin(ring)], axis=-1)
    rays = [
        tube(
            [0.26 * d, (0.30 + 0.07 * (k % 2)) * d, (0.36 + 0.06 * (k % 2)) * d],
            [0.006, 0.009, 0.002],
            6,
        )
        for k, d in enumerate(circle[np.linspace(0, len(circle) - 1, 49).astype(int)[:-1]])
    ]
    halo = join(
        [
            tube(circle * 0.26, 0.014, 12, capped=False),
            tube(circle * 0.34, 0.007, 8, capped=False),
            *rays,
        ]
    )
    add("Halo", halo, brass, matrix=transform((x, y + 0.2, 2.05), scale=1.15))
    add(
        "Halo stem",
        tube([(0, 0, 0), (0, 0.02, 0.6), (0, 0, 1.35)], 0.018, 10),
        brass,
        matrix=transform((x, y + 0.22, 0.75)),
    )


def mirror(recipe: Recipe) -> None:
    """A standing mirror in a dark wooden frame beside the statue, turned towards the viewer."""
    wood = wood_material()
    glass = plain("Mirror", (0.93, 0.94, 0.93), Metallic=1.0, Roughness=0.0)
    width, height = 0.82, 1.45
    parts = [box((width + 0.14, 0.05, 0.07), 0.012).moved(0, 0, z) for z in (0.0, height)]
    parts += [
        box((0.07, 0.05, height), 0.012).moved(s * (width / 2 + 0.035), 0, height / 2)
        for s in (-1, 1)
    ]
    parts += [box((width + 0.02, 0.012, height)).moved(0, 0.02, height / 2)]
    for s in (-1, 1):
        parts += [
            box((0.07, 0.07, 1.3), 0.012).moved(s * (width / 2 + 0.12), 0.02, 0.43),
            box((0.09, 0.55, 0.07), 0.015).moved(s * (width / 2 + 0.12), 0.02, -0.2),
        ]
    towards_viewer = -float(np.arctan2(*MIRROR))
    spot = transform((*MIRROR, 0.24), (np.radians(-3.0), 0, towards_viewer + np.radians(6.0)))
    add("Mirror frame", join(parts), wood, matrix=spot, smooth=0.7)
    pane = sheet(
        np.array([[(-1, 0, 0), (1, 0, 0)], [(-1, 0, 1), (1, 0, 1)]]) * (width / 2, 1, height)
    )
    add("Mirror", pane.moved(0, 0.005, 0), glass, matrix=spot, smooth=False)


def wood_material() -> bpy.types.Material:
    made, graph = material("Dark wood")
    grain = graph.noise(graph.coordinates("Object", (14.0, 14.0, 1.4)), 2.0, 5.0, 0.6, 0.8)
    tint = graph.ramp(
        grain,
        [(0.3, (0.022, 0.012, 0.007)), (0.55, (0.085, 0.042, 0.020)), (0.7, (0.14, 0.075, 0.038))],
    )
    surface = graph.principled(Base_Color=tint, Roughness=0.42, Normal=graph.bump(grain, 0.003))
    return finish(made, graph, surface)


# --- Stones and lanterns --------------------------------------------------------------------------


def rock_meshes(recipe: Recipe, count: int) -> list[bpy.types.Mesh]:
    """Boulders about 1 m across, weathered and mossy on top."""
    stone = granite_material("Rock", (0.17, 0.165, 0.155), 0.75)
    meshes = []
    for i in range(count):
        ball = icosphere(recipe.steps(5, 2))
        shift = np.array([17.0 * i, 5.0, 3.0])
        v = ball.vertices
        ridges = 1 - 2 * np.abs(noise(v * 1.3 + shift, 62, 1))
        swell = (
            1
            + 0.28 * noise(v * 0.9 + shift, 61, 2)
            + 0.16 * ridges
            + 0.05 * noise(v * 5 + shift, 63, 3)
        )
        stretch = random_stream(recipe.seed, f"rock{i}").uniform(
            (0.4, 0.34, 0.3), (0.52, 0.48, 0.46)
        )
        meshes.append(
            mesh(f"Rock.{i}", Shape(v * swell[:, None] * stretch, triangles=ball.triangles), stone)
        )
    return meshes


def rocks(recipe: Recipe) -> None:
    """Rock islands in the gravel, stones along the shore, and boulders in the moss."""
    random = recipe.random("rocks")
    meshes = rock_meshes(recipe, 6)
    places = []
    for x, y, radius in ROCK_ISLANDS:
        for dx, dy, size in (
            (0.0, 0.0, 1.5),
            (0.62, 0.25, 0.85),
            (-0.35, 0.55, 0.6),
            (0.15, -0.6, 0.5),
        ):
            z = 0.22 * size * radius
            places.append(
                transform(
                    (x + dx * radius, y + dy * radius, z),
                    (0, 0, random.uniform(0, TAU)),
                    size * radius,
                )
            )
    for angle in np.arange(0, TAU, 0.115):
        direction = np.array([np.cos(angle), np.sin(angle) / 0.8])
        reach = np.linspace(1.0, 4.0, 300)[:, None] * direction + POND_CENTER
        shore = reach[np.abs(pond_distance(*reach.T)).argmin()] + random.normal(0, 0.06, 2)
        size = random.uniform(0.34, 0.62) * (1.5 if random.random() < 0.12 else 1.0)
        places.append(
            transform((*shore, -0.02), random.uniform((-0.2, -0.2, 0), (0.2, 0.2, TAU)), size)
        )
    spots = spread(
        random,
        26,
        (-13, -13, 13, 13),
        1.2,
        lambda x, y: (
            (court_distance(x, y) > 0.7) & (pond_distance(x, y) > 0.6) & (path_distance(x, y) > 1.2)
        ),
    )
    places += standing(random, spots, (0.4, 1.5), -0.05)
    scatter("Rock", meshes, places)


# --- Fire and candles -----------------------------------------------------------------------------


def flames(recipe: Recipe, x: float, y: float, z: float) -> None:
    """Tongues of glowing gas, each a few nested shells, bent by noise that rises with the frames.

    The gas glows evenly within a shell, which Cycles integrates exactly: a flame of procedural
    density would need a grid of it made anew for each view.
    """
    random = recipe.random("flames")
    noises = []
    for axis in "XY":
        noise_texture = bpy.data.textures.new(f"Flame noise {axis}", "CLOUDS")
        noise_texture.noise_scale, noise_texture.noise_depth = 0.3, 1
        carrier = place(f"Flame carrier {axis}", None, transform((x, y + ord(axis), z)))
        animate(carrier, "location", 0.05, 2)
        noises.append((axis, noise_texture, carrier))
    t = np.linspace(0, 1, recipe.steps(40, 8))
    body = np.sin(np.pi * t**0.55) * (1 - 0.45 * t) + 0.002
    for k in range(FLAME_TONGUES):
        angle, reach = 2.4 * k, 0.0 if k == 0 else random.uniform(0.09, 0.17)
        height = FLAME_HEIGHT * (1.0 if k == 0 else random.uniform(0.45, 0.8))
        width = 0.15 if k == 0 else random.uniform(0.07, 0.11)
        spot = transform((x + reach * np.cos(angle), y + reach * np.sin(angle), z), (0, 0, angle))
        for shell, (share, color, glow) in enumerate(FLAME_SHELLS):
            made, graph = material(f"Flame.{k}.{shell}")
            gas = graph.add("ShaderNodeEmission", {"Color": color, "Strength": glow})
            finish(made, graph, volume=gas)
            profile = np.column_stack([width * share**1.3 * body, height * share * t])
            tongue = add(
                f"Flame.{k}.{shell}", lathe(profile, recipe.steps(28, 8)), made, matrix=spot
            )
            tongue.visible_diffuse = tongue.visible_shadow = False
            higher = tongue.vertex_groups.new(name="Height")
            for vertex in tongue.data.vertices:
                higher.add([vertex.index], min(1.0, vertex.co.z / FLAME_HEIGHT + 0.1), "REPLACE")
            for axis, noise_texture, carrier in noises:
                bend = tongue.modifiers.new(f"Lick {axis}", "DISPLACE")
                bend.texture, bend.vertex_group = noise_texture, higher.name
                bend.direction, bend.space, bend.strength = axis, "GLOBAL", 0.6
                bend.texture_coords, bend.texture_coords_object = "OBJECT", carrier


def fire(recipe: Recipe) -> None:
    """An iron bowl with burning logs. The flames light by a lamp, which keeps the noise down."""
    x, y = FIRE
    iron = plain("Iron", (0.03, 0.028, 0.026), Metallic=0.8, Roughness=0.55)
    n = recipe.steps(48, 8)
    bowl = lathe(
        [
            (0.05, 0.30),
            (0.24, 0.34),
            (0.36, 0.46),
            (0.40, 0.60),
            (0.43, 0.60),
            (0.43, 0.58),
            (0.41, 0.575),
        ][::-1],
        n,
        capped=False,
    )
    inner = lathe([(0.0, 0.36), (0.22, 0.38), (0.34, 0.48), (0.40, 0.60)], n, capped=False)
    legs = [
        tube(
            [(0.30 * c, 0.30 * s, 0.42), (0.36 * c, 0.36 * s, 0.2), (0.44 * c, 0.44 * s, -0.05)],
            0.022,
            8,
        )
        for c, s in ((np.cos(a), np.sin(a)) for a in (0.4, 0.4 + TAU / 3, 0.4 + 2 * TAU / 3))
    ]
    add("Fire bowl", join([bowl, inner, *legs]), iron, matrix=transform((x, y, 0)))
    embers, graph = material("Embers")
    glow = graph.noise(graph.coordinates(), 14.0, 4.0, 0.7)
    heat = graph.span(glow, 0.0, 1.0, 0.48, 0.66)
    surface = graph.principled(
        Base_Color=graph.mix(heat, (0.015, 0.013, 0.012), (0.10, 0.09, 0.085)),
        Roughness=0.9,
        Emission_Color=(1.0, 0.16, 0.02),
        Emission_Strength=graph.math("MULTIPLY", heat, 5.0),
    )
    finish(embers, graph, surface)
    embers.cycles.emission_sampling = "NONE"
    random = recipe.random("fire")
    logs = []
    for k in range(9):
        angle, tip = k * 2.4 + random.normal(0, 0.2), random.uniform(0.05, 0.14)
        foot = 0.27 * np.array([np.cos(angle), np.sin(angle)])
        ends = np.array([(*foot, 0.44), (*(-tip * foot), 0.58 + 0.2 * random.random())])
        path = ends[0] + np.linspace(0, 1, 6)[:, None] * (ends[1] - ends[0])
        logs.append(tube(path, 0.045 * random.uniform(0.7, 1.1, 6), recipe.steps(12, 5)))
    bed = icosphere(recipe.steps(4, 2))
    lumps = 1 + 0.25 * noise(bed.vertices * 4, 71, 2)
    logs.append(
        Shape(
            bed.vertices * (0.3, 0.3, 0.06) * lumps[:, None] + (0, 0, 0.47), triangles=bed.triangles
        )
    )
    add("Logs", join(logs), embers, matrix=transform((x, y, 0)))
    flames(recipe, x, y, 0.48)
    point_light("Fire light", (x, y, 0.95), 90.0, FLAME_COLOR, 0.16)


def candle_parts(recipe: Recipe) -> tuple[Shape, Shape]:
    """A candle 0.2 m high (wax, and wick as slot 1), and its flame."""
    n = recipe.steps(28, 8)
    wax = lathe(
        [(0.036, 0.0), (0.033, 0.01), (0.032, 0.19), (0.029, 0.20), (0.024, 0.193), (0.0, 0.185)], n
    )
    drips = 1 + 0.06 * noise(wax.vertices * (40, 40, 9), 81, 2)[:, None] * (1, 1, 0)
    wax = Shape(wax.vertices * drips, wax.quads, wax.triangles)
    wick = tube([(0, 0, 0.18), (0, 0.001, 0.2), (0.003, 0.002, 0.212)], 0.0017, 5).painted(1)
    t = np.linspace(0, 1, recipe.steps(14, 6))
    flame = lathe(
        np.column_stack([0.0105 * np.sin(np.pi * t**0.62) * (1 - 0.3 * t), 0.2 + 0.052 * t]),
        recipe.steps(14, 6),
    )
    return join([wax, wick]), flame


def wax_material() -> bpy.types.Material:
    """Wax that glows faintly where the flame shines into it."""
    made, graph = material("Wax")
    z = graph.xyz(graph.coordinates())["Z"]
    warm = graph.span(z, 0.0, 0.9, 0.06, 0.2)
    surface = graph.principled(
        Base_Color=(0.82, 0.72, 0.55),
        Roughness=0.45,
        Emission_Color=(1.0, 0.36, 0.10),
        Emission_Strength=graph.math("MULTIPLY", warm, warm),
    )
    made.cycles.emission_sampling = "NONE"
    return finish(made, graph, surface)


def candle_flame_material() -> bpy.types.Material:
    """A flame, blue at its foot; the lamps beside the candles give its light."""
    made, graph = material("Candle flame")
    height = graph.span(graph.xyz(graph.coordinates())["Z"], 0.0, 1.0, 0.2, 0.252)
    blue, orange, yellow, red = (
        (0.15, 0.2, 0.8),
        (1.0, 0.45, 0.12),
        (1.0, 0.72, 0.32),
        (1, 0.4, 0.08),
    )
    tint = graph.ramp(height, [(0.0, blue), (0.2, orange), (0.6, yellow), (1.0, red)])
    made.cycles.emission_sampling = "NONE"
    return finish(made, graph, graph.add("ShaderNodeEmission", {"Color": tint, "Strength": 9.0}))


def candles(recipe: Recipe) -> None:
    """Candles at the statue's feet, by the rocks, and afloat on the pond."""
    random = recipe.random("candles")
    wax, flame = candle_parts(recipe)
    wick = plain("Wick", (0.01, 0.01, 0.01))
    wax_mesh = mesh("Candle", wax, wax_material(), wick, smooth=0.7)
    flame_mesh = mesh("Candle flame", flame, candle_flame_material())
    rim = [(0.03, -0.015), (0.075, 0.0), (0.095, 0.035), (0.09, 0.035), (0.07, 0.012), (0.0, 0.01)]
    lacquer = plain("Candle cup", (0.10, 0.03, 0.02), Roughness=0.35)
    cup_mesh = mesh("Candle cup", lathe(rim, recipe.steps(28, 8)), lacquer)
    for i, (x, y, base) in enumerate(CANDLES):
        on_water = base < 0
        size = random.uniform(0.8, 1.15)
        tall = size * (0.35 if on_water else random.uniform(0.5, 1.3))
        turn = (0, 0, random.uniform(0, TAU))
        place(f"Candle.{i:02d}", wax_mesh, transform((x, y, base), turn, (size, size, tall)))
        foot = base + 0.2 * (tall - 1.0)
        burning = place(f"Candle flame.{i:02d}", flame_mesh, transform((x, y, foot)))
        burning.visible_diffuse = burning.visible_shadow = False
        if on_water:
            place(f"Candle cup.{i:02d}", cup_mesh, transform((x, y, base)))
    for i, spot in enumerate(CANDLE_LIGHTS):
        point_light(f"Candle light.{i}", spot, 3.0, CANDLE_COLOR, 0.03)


# --- Water ----------------------------------------------------------------------------------------


def water_material() -> bpy.types.Material:
    """Clear water, whose ripples run on with the frames; light passes straight into it."""
    made, graph = material("Water")
    drift = graph.add(
        "ShaderNodeMapping",
        {"Vector": graph.add("ShaderNodeTexCoord").outputs["Object"], "Scale": (1.0, 1.6, 1.0)},
    )
    animate(drift.inputs["Location"], "default_value", 0.012, 0)
    ripples = graph.noise(drift, 5.0, 3.0, 0.55, 0.0, 0.0)
    animate(ripples.node.inputs["W"], "default_value", 0.04)
    normal = graph.bump(ripples, 0.045)
    reflected = graph.add("ShaderNodeFresnel", {"IOR": 1.33, "Normal": normal})
    clear = graph.add("ShaderNodeBsdfTransparent", {"Color": (0.62, 0.74, 0.66)})
    shine = graph.add(
        "ShaderNodeBsdfAnisotropic", {"Color": (1.0, 1.0, 1.0), "Roughness": 0.02, "Normal": normal}
    )
    return finish(made, graph, graph.add("ShaderNodeMixShader", {0: reflected, 1: clear, 2: shine}))


def pond(recipe: Recipe) -> None:
    """Water over a dark bed, with lily pads, carp, and iris on its shore."""
    angle = np.linspace(0, TAU, recipe.steps(120, 16), endpoint=False)
    inwards = np.linspace(1.0, 0.02, recipe.steps(12, 3))[:, None, None]
    rings = POND_CENTER + inwards * (pond_shore(angle) - POND_CENTER)
    surface = np.dstack([rings, np.full(rings.shape[:2], WATER_LEVEL)])
    add("Water", sheet(surface, closed=True), water_material())
    water_lilies(recipe)
    carp(recipe)
    iris(recipe)


def water_lilies(recipe: Recipe) -> None:
    """Drifts of lily pads, some in flower."""
    random = recipe.random("pond")
    angle = np.linspace(0.16, TAU - 0.16, recipe.steps(40, 8))
    reach, rise = np.array([(1.0, 0.03), (0.97, 0.006), (0.6, 0.002), (0.05, 0.0)]).T[:, :, None]
    disc = np.dstack([reach * np.cos(angle), reach * np.sin(angle), rise + 0 * angle])
    green = leaf_material("Lily pad", (0.035, 0.09, 0.02), (0.09, 0.17, 0.035), 0.1)
    pink = leaf_material("Lily petal", (0.72, 0.30, 0.42), (0.85, 0.62, 0.68), 0.3)

    def allowed(x: Array, y: Array) -> Array:
        drifts = noise(np.stack([x, y, 0 * x], axis=-1) / 1.3, 91) > 0.02
        return drifts & (pond_distance(x, y) < -0.45)

    def afloat(x: float, y: float, scale: tuple[float, float]) -> Matrix:
        turn = (0, 0, random.uniform(0, TAU))
        return transform((x, y, WATER_LEVEL + 0.008), turn, random.uniform(*scale))

    spots = spread(random, 34, (*(POND_CENTER - 3.2), *(POND_CENTER + 3.2)), 0.30, allowed)
    pads = [afloat(x, y, (0.10, 0.19)) for x, y in spots]
    blooms = [afloat(x + 0.1, y, (0.8, 1.2)) for x, y in spots[::6]]
    scatter("Lily pad", [mesh("Lily pad", sheet(disc), green)], pads)
    scatter("Water lily", [mesh("Water lily", lily(recipe), pink)], blooms)


def pond_shore(angle: Array) -> Array:
    """The pond's outline (n, 2) where `pond_distance` is 0, by angle."""
    reach = -(
        pond_distance(np.full_like(angle, POND_CENTER[0]), np.full_like(angle, POND_CENTER[1]))
    )
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    for _ in range(30):
        points = POND_CENTER + reach[:, None] * direction
        reach = reach - 0.7 * pond_distance(*points.T)
    return POND_CENTER + reach[:, None] * direction


def lily(recipe: Recipe) -> Shape:
    u, v = np.meshgrid(np.linspace(0, 1, recipe.steps(7, 3)), np.linspace(-1, 1, 5), indexing="ij")
    petal = np.stack(
        [0.022 * np.sin(np.pi * (0.1 + 0.9 * u)) * v, 0.085 * u, 0.03 * u**2 + 0.006 * v * v],
        axis=-1,
    )
    rings = []
    for count, lift, size in ((9, 0.1, 1.0), (8, 0.6, 0.9), (6, 1.3, 0.75)):
        angle = (np.arange(count) + 0.3 * size) * TAU / count
        out = np.stack([np.cos(angle), np.sin(angle), np.full(count, lift)], axis=-1)
        turn = frames(out, np.broadcast_to((0.0, 0.0, 1.0), out.shape))
        rings.append(copies(sheet(petal), turn * size, np.full((count, 3), (0, 0, 0.01))))
    return join(rings)


def carp(recipe: Recipe) -> None:
    """Koi under the surface."""
    made, graph = material("Koi")
    patches = graph.noise(graph.coordinates(), 5.0, 2.0)
    patches = graph.math("ADD", patches, graph.math("MULTIPLY", graph.object_random(), 0.22))
    tint = graph.ramp(
        patches,
        [
            (0.50, (0.85, 0.80, 0.72)),
            (0.56, (0.90, 0.22, 0.03)),
            (0.72, (0.80, 0.10, 0.02)),
            (0.76, (0.03, 0.03, 0.03)),
        ],
    )
    finish(made, graph, graph.principled(Base_Color=tint, Roughness=0.3))
    t = np.linspace(0, 1, recipe.steps(28, 8))
    meshes = []
    for i, bend in enumerate((0.35, -0.3, 0.1)):
        radius = 0.062 * np.sin(np.pi * t**0.6) ** 0.8 * (1 - 0.35 * t) + 0.004
        spine = np.stack(
            [0.09 * np.sin(TAU * 0.7 * t + i) * bend * (t + 0.3), 0.25 - 0.46 * t, 0 * t], axis=-1
        )
        body = tube(spine, radius, recipe.steps(16, 6))
        tail = spine[-1]
        fins = [
            tail + np.array([(0, 0, 0), (0.03, -0.14, 0.06), (0, -0.09, 0), (0.03, -0.14, -0.06)])
        ]
        fins += [
            [
                (s * 0.05, 0.12, -0.02),
                (s * 0.14, 0.05, -0.03),
                (s * 0.12, 0.01, -0.03),
                (s * 0.05, 0.07, -0.02),
            ]
            for s in (-1, 1)
        ]
        fins += [
            [
                spine[9 * len(t) // 28] + (0, 0.02, 0.04),
                spine[len(t) // 2] + (0, 0, 0.085),
                spine[2 * len(t) // 3] + (0, 0, 0.06),
                spine[2 * len(t) // 3] + (0, 0, 0.03),
            ]
        ]
        fin = [Shape(np.array(f, float), np.array([[0, 1, 2, 3]], dtype=np.int32)) for f in fins]
        meshes.append(mesh(f"Koi.{i}", join([body, *fin]), made))
    at = (
        (-4.1, 0.75, 0.4),
        (-4.55, 0.35, 1.2),
        (-4.35, -0.3, 2.6),
        (-5.1, 1.5, 4.0),
        (-5.4, -0.2, 5.2),
        (-4.9, 0.95, 2.0),
    )
    scatter(
        "Koi", meshes, [transform((x, y, WATER_LEVEL - 0.13), (0, 0, a), 0.9) for x, y, a in at]
    )


def blade(width: float, rows: int, bow: float) -> Shape:
    """A blade of grass, 1 long, rising along +Z and bowing towards +Y."""
    t = np.linspace(0, 1, rows)
    half = width * (1 - t**1.6) + 0.0004
    spine = np.stack([0 * t, bow * t**2, t * (1 - 0.25 * bow * t)], axis=-1)
    return sheet(
        np.stack([spine - half[:, None] * (1, 0, 0), spine + half[:, None] * (1, 0, 0)], axis=1)
    )


def tuft(
    random: np.random.Generator,
    count: int,
    radius: float,
    lengths: tuple[float, float],
    width: float,
    rows: int,
    bow: float,
) -> Shape:
    """Blades of grass that stand within a disc."""
    angle, reach = random.uniform(0, TAU, count), radius * np.sqrt(random.random(count))
    turn = random.uniform(0, TAU, count)
    forward = np.stack([np.cos(turn), np.sin(turn), random.normal(0, 0.25, count)], axis=-1)
    up = np.stack([*random.normal(0, 0.22, (2, count)), np.ones(count)], axis=-1)
    length = random.uniform(*lengths, count)
    sizes = length[:, None, None] * np.ones((1, 3, 3))
    roots = np.stack([reach * np.cos(angle), reach * np.sin(angle), np.full(count, -0.03)], axis=-1)
    return copies(blade(width, rows, bow), frames(forward, up) * sizes, roots)


def iris(recipe: Recipe) -> None:
    """Sheaves of sword-like leaves along the far shore."""
    random = recipe.random("iris")
    green = leaf_material("Iris leaves", (0.04, 0.09, 0.02), (0.13, 0.20, 0.05), 0.3)
    sheaf = [
        mesh(
            f"Iris.{i}",
            tuft(random, recipe.copies(46, 8), 0.15, (0.35, 0.8), 0.018, 6, 0.35),
            green,
        )
        for i in range(2)
    ]
    angle = np.concatenate([random.uniform(1.2, 5.2, 20), random.uniform(-0.9, 0.9, 3)])
    shore = POND_CENTER + (pond_shore(angle) - POND_CENTER) * 1.06
    scatter("Iris", sheaf, standing(random, shore, (0.8, 1.2)))


# --- The torii ------------------------------------------------------------------------------------


def torii(recipe: Recipe) -> None:
    """A vermilion gate over the path."""
    made, graph = material("Vermilion")
    worn = graph.noise(graph.coordinates("Object", (3.0, 3.0, 0.6)), 2.0, 5.0, 0.7)
    tint = graph.ramp(
        worn,
        [(0.35, (0.20, 0.028, 0.010)), (0.6, (0.46, 0.060, 0.018)), (0.75, (0.52, 0.10, 0.04))],
    )
    finish(
        made,
        graph,
        graph.principled(Base_Color=tint, Roughness=0.45, Normal=graph.bump(worn, 0.004)),
    )
    black = plain("Black lacquer", (0.015, 0.014, 0.013), Roughness=0.35)
    n = recipe.steps(32, 8)
    x = np.linspace(-1, 1, recipe.steps(24, 6))

    def lintel(half: float, low: float, high: float, depth: float, rise: float) -> Shape:
        lift = rise * np.abs(x) ** 2.4
        ring = [
            np.stack(
                [
                    half * x * (1 + 0.03 * up),
                    0 * x + side * depth * (1 + 0.15 * up),
                    lift + (high if up else low),
                ],
                axis=-1,
            )
            for side, up in ((-1, 0), (1, 0), (1, 1), (-1, 1))
        ]
        body = sheet(np.stack(ring, axis=1)[::-1], closed=True)
        last = len(body.vertices)
        ends = np.array([[0, 1, 2, 3], [last - 1, last - 2, last - 3, last - 4]], dtype=np.int32)
        return Shape(body.vertices, np.concatenate([body.quads, ends]))

    red, dark = [], []
    for side in (-1, 1):
        foot, head = np.array([side * 1.5, 0, -0.2]), np.array([side * 1.36, 0, 3.2])
        t = np.linspace(0, 1, 9)[:, None]
        red.append(tube(foot + t * (head - foot), np.linspace(0.15, 0.125, 9), n))
        dark.append(tube(foot + np.array([[0.0], [0.08], [0.16]]) * (head - foot), 0.18, n))
    red += [lintel(1.95, 3.17, 3.36, 0.12, 0.14), box((3.4, 0.12, 0.2), 0.01).moved(0, 0, 2.6)]
    red.append(box((0.22, 0.1, 0.4), 0.01).moved(0, 0, 2.9))
    dark.append(lintel(2.2, 3.36, 3.46, 0.17, 0.2))
    z = float(ground_height(np.array(TORII[0]), np.array(TORII[1])))
    spot = transform((*TORII, z))
    add("Torii", join([*red, join(dark).painted(1)]), made, black, matrix=spot, smooth=0.6)


# --- Plants ---------------------------------------------------------------------------------------


def leaf_material(name: str, dark: Color, light: Color, through: float = 0.4) -> bpy.types.Material:
    """Thin leaves, each of its own tint, that let some light through."""
    made, graph = material(name)
    tint = graph.ramp(graph.island_random(), [(0.0, dark), (1.0, light)])
    front = graph.add("ShaderNodeBsdfDiffuse", {"Color": tint})
    back = graph.add("ShaderNodeBsdfTranslucent", {"Color": tint})
    return finish(made, graph, graph.add("ShaderNodeMixShader", {0: through, 1: front, 2: back}))


def bamboo_leaf() -> Shape:
    """A narrow leaf, 1 long along +Y, folded along its rib."""
    side = [(0.0, 0.0), (0.055, 0.25), (0.05, 0.6), (0.0, 1.0)]
    points = [
        [
            (-w, y, 0.03 * (w > 0) - 0.25 * y * y),
            (0, y, -0.25 * y * y),
            (w, y, 0.03 * (w > 0) - 0.25 * y * y),
        ]
        for w, y in side
    ]
    return sheet(np.array(points))


def bamboo_meshes(recipe: Recipe, count: int) -> list[bpy.types.Mesh]:
    """Culms with their rings, side twigs and leaves, 6 to 7.5 m high."""
    skin, graph = material("Bamboo culm")
    along = graph.noise(graph.coordinates("Object", (6.0, 6.0, 0.8)), 1.0, 4.0)
    tint = graph.mix(graph.object_random(), (0.10, 0.16, 0.035), (0.24, 0.23, 0.06))
    tint = graph.mix(graph.span(along, 0.0, 0.6, 0.4, 0.7), tint, (0.26, 0.22, 0.10))
    finish(skin, graph, graph.principled(Base_Color=tint, Roughness=0.35))
    foliage = leaf_material("Bamboo leaves", (0.05, 0.11, 0.018), (0.16, 0.22, 0.04))
    return [mesh(f"Bamboo.{i}", bamboo_culm(recipe, i), skin, foliage) for i in range(count)]


def bamboo_culm(recipe: Recipe, number: int) -> Shape:
    random = recipe.random(f"bamboo{number}")
    height = random.uniform(6.0, 7.5)
    lean = random.normal(0, 0.05, 2)
    nodes = np.cumsum(np.linspace(0.16, 0.36, 24))
    nodes = np.concatenate([[0.0], nodes[nodes < height * 0.96]])
    levels, radii = [], []
    for z in nodes:
        thick = 0.042 * (1 - 0.75 * (z / height) ** 1.5)
        levels += [z - 0.012, z, z + 0.012, z + 0.05]
        radii += [thick, thick * 1.14, thick * 0.98, thick]
    levels[0] = -0.2

    def middle(z: Array | float) -> Array:
        bow = np.maximum(np.asarray(z) / height, 0.0) ** 2.5
        return np.stack(
            [
                lean[0] * np.asarray(z) + 9 * lean[0] * bow,
                lean[1] * np.asarray(z) + 9 * lean[1] * bow,
                np.asarray(z) * 1.0,
            ],
            axis=-1,
        )

    parts = [tube(middle(np.array(levels)), radii, recipe.steps(10, 4))]
    leaf_at, leaf_to = [], []
    for z in nodes[nodes > 1.7]:
        for _ in range(random.integers(1, 4)):
            angle, length = (
                random.uniform(0, TAU),
                random.uniform(0.35, 0.8) * (1.1 - 0.5 * z / height),
            )
            out = np.array([np.cos(angle), np.sin(angle), random.uniform(0.3, 0.9)])
            t = np.linspace(0, 1, 5)[:, None]
            twig = middle(z) + length * (t * out - t**2 * (0, 0, 0.45))
            parts.append(tube(twig, np.linspace(0.005, 0.001, 5), 3, capped=False))
            for _ in range(recipe.copies(7, 2)):
                where = random.uniform(0.25, 1.0)
                spot = middle(z) + length * (where * out - where**2 * np.array([0, 0, 0.45]))
                leaf_at.append(spot)
                leaf_to.append(out * 0.6 + random.normal(0, 0.55, 3) - (0, 0, 0.35))
    facing = frames(np.array(leaf_to), random.normal((0, 0, 1), 0.5, (len(leaf_to), 3)))
    size = random.uniform(0.15, 0.27, (len(leaf_to), 1, 1))
    return join([*parts, copies(bamboo_leaf(), facing * size, np.array(leaf_at)).painted(1)])


def bamboo(recipe: Recipe) -> None:
    """Groves of bamboo behind the statue and beside the path."""
    random = recipe.random("bamboo")
    meshes = bamboo_meshes(recipe, 5)
    places = []
    for corners, count in zip(GROVES, (44, 32), strict=True):
        spots = spread(
            random,
            count,
            corners,
            0.34,
            lambda x, y: (path_distance(x, y) > 1.6) & (pond_distance(x, y) > 0.5),
        )
        places += standing(random, spots, (0.75, 1.1), 0.05, 0.03)
    scatter("Bamboo", meshes, places)


def bark_material(name: str, tint: Color) -> bpy.types.Material:
    made, graph = material(name)
    cracks = graph.noise(graph.coordinates("Object", (7.0, 7.0, 1.6)), 3.0, 5.0, 0.7, 0.6)
    dark = tuple(0.3 * c for c in tint)
    color = graph.ramp(cracks, [(0.35, dark), (0.6, tint), (0.75, (0.09, 0.11, 0.06))])
    surface = graph.add(
        "ShaderNodeBsdfDiffuse", {"Color": color, "Normal": graph.bump(cracks, 0.03)}
    )
    return finish(made, graph, surface)


@dataclass
class Growth:
    """How a tree grows. Each list has one entry a generation of branches, the trunk first."""

    lengths: Sequence[float]  # metres
    children: Sequence[int]  # side branches of each branch; the last generation bears the leaves
    angles: Sequence[float]  # radians between a branch and its parent
    upward: Sequence[float]  # how strongly a branch turns up (down where negative)
    radius: float  # of the trunk's foot, metres
    wander: float = 0.16  # how crooked the branches are
    bare: float = 0.4  # share of a branch before its first side branch


def branches(
    random: np.random.Generator, growth: Growth, detail: float
) -> tuple[Shape, Array, Array]:
    """A tree's wood, and its twigs' points (n, k, 3) with the direction of each (n, 3)."""
    parts: list[Shape] = []
    twigs: list[Array] = []

    def grow(start: Array, direction: Array, length: float, radius: float, level: int) -> None:
        count = 9 if level == 0 else 6
        path, heading = [start], direction
        for _ in range(count - 1):
            heading = heading + random.normal(0, growth.wander, 3) + (0, 0, growth.upward[level])
            heading = heading / np.linalg.norm(heading)
            path.append(path[-1] + heading * length / (count - 1))
        points = np.array(path)
        tip = 0.5 if level == 0 else 0.3
        sides = steps((12, 7, 5, 3, 3)[level], min(1.0, detail) ** 0.5, 3)
        parts.append(tube(points, radius * np.linspace(1, tip, count), sides, capped=False))
        if level == len(growth.lengths) - 1:
            twigs.append(points)
            return
        azimuth = random.uniform(0, TAU)
        for t in np.linspace(growth.bare if level == 0 else 0.3, 1.0, growth.children[level]):
            azimuth += 2.4
            at = t * (count - 1)
            low = min(int(at), count - 2)
            along = points[low + 1] - points[low]
            spot = points[low] + (at - low) * along
            along = along / np.linalg.norm(along)
            side = np.cross(along, (np.cos(azimuth), np.sin(azimuth), 0.3))
            side /= np.linalg.norm(side)
            angle = growth.angles[level] * random.uniform(0.75, 1.2) * (1.0 if t < 0.99 else 0.4)
            out = np.cos(angle) * along + np.sin(angle) * side
            size = growth.lengths[level + 1] * random.uniform(0.75, 1.15) * (1.15 - 0.4 * t)
            thick = radius * (1 - (1 - tip) * t) * 0.62
            grow(spot, out, size, thick, level + 1)

    grow(np.array([0.0, 0.0, -0.2]), np.array([0.0, 0.0, 1.0]), growth.lengths[0], growth.radius, 0)
    ends = np.array(twigs)
    return join(parts), ends, ends[:, -1] - ends[:, 0]


def leaves_on(
    random: np.random.Generator,
    twigs: Array,
    directions: Array,
    leaf: Shape,
    count: int,
    size: tuple[float, float],
    droop: float,
    scatter_by: float,
) -> Shape:
    """`count` leaves on each twig, flat side up, their stalks near the twig."""
    number = len(twigs) * count
    which = np.repeat(np.arange(len(twigs)), count)
    at = random.uniform(0.15, 1.0, number) * (twigs.shape[1] - 1)
    low = np.minimum(at.astype(int), twigs.shape[1] - 2)
    share = (at - low)[:, None]
    spots = twigs[which, low] * (1 - share) + twigs[which, low + 1] * share
    spots = spots + random.normal(0, scatter_by, (number, 3))
    away = directions[which] / np.linalg.norm(directions[which], axis=1, keepdims=True)
    forward = away + random.normal(0, 0.6, (number, 3)) - (0, 0, droop)
    up = random.normal((0, 0, 1), 0.45, (number, 3))
    sizes = random.uniform(*size, (number, 1, 1))
    return copies(leaf, frames(forward, up) * sizes, spots)


def maple_leaf() -> Shape:
    """A leaf of five pointed lobes, 1 long along +Y, as a fan of triangles."""
    tips = [
        (-0.55, 0.12, 0.75),
        (-0.5, 0.6, 0.8),
        (0.0, 1.0, 1.0),
        (0.5, 0.6, 0.8),
        (0.55, 0.12, 0.75),
    ]
    rim: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)]
    for i, (x, y, _) in enumerate(tips):
        rim.append((x, y, -0.10 * (abs(x) + y)))
        if i < 4:
            notch = 0.42 * (np.array(tips[i][:2]) + np.array(tips[i + 1][:2])) / 2
            rim.append((notch[0], notch[1] + 0.12, 0.02))
    n = len(rim)
    center = (0.0, 0.25, 0.03)
    triangles = [(n, (i + 1) % n, i) for i in range(n)]
    return Shape(np.array([*rim, center]), triangles=np.array(triangles, dtype=np.int32))


def oval_leaf() -> Shape:
    points = [(0, 0, 0), (0.3, 0.4, 0.06), (0, 1, -0.06), (-0.3, 0.4, 0.06), (0, 0.42, 0)]
    return Shape(
        np.array(points, float),
        triangles=np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], dtype=np.int32),
    )


def maple(recipe: Recipe) -> None:
    """A red maple whose crown reaches over the viewer, high enough to leave the rigs clear."""
    random = recipe.random("maple")
    growth = Growth(
        (2.9, 3.5, 1.5, 0.65),
        (9, 6, 4),
        (1.0, 0.8, 0.7),
        (0.05, 0.055, 0.0, -0.02),
        0.17,
        0.13,
        0.62,
    )
    wood, twigs, directions = branches(random, growth, recipe.detail)
    leaf = leaves_on(
        random, twigs, directions, maple_leaf(), recipe.copies(28, 3), (0.065, 0.115), 0.35, 0.08
    )
    red = leaf_material("Maple leaves", (0.30, 0.018, 0.010), (0.62, 0.13, 0.02), 0.5)
    bark = bark_material("Maple bark", (0.16, 0.13, 0.11))
    z = float(ground_height(*map(np.array, MAPLE)))
    spot = transform((*MAPLE, z), (0.0, 0.14, np.arctan2(-MAPLE[1], -MAPLE[0])))
    shape = join([wood, leaf.painted(1)]).transformed(spot)
    # Where the crown hangs over the rigs, what would be below 2.2 m is lifted to above it.
    x, y, height = shape.vertices.T
    over = smoothstep(2.9, 1.9, np.hypot(x, y))
    raised = np.where(height < 3.2, 2.2 + np.maximum(height, 0.0) / 3.2, height)
    shape.vertices[:, 2] += over * (raised - height)
    tree = mesh("Maple", shape.transformed(spot.inverted()), bark, red)
    place("Maple", tree, spot)
    place("Maple far", tree, transform((5.5, -3.0, 0.1), (0, 0, 2.5), 1.05))
    place("Maple farther", tree, transform((-8.3, 5.6, 0.1), (0, 0, 4.5), 1.1))


def pines(recipe: Recipe) -> None:
    """Cloud-pruned pines: crooked stems with pads of needles."""
    random = recipe.random("pines")
    needle = [(0.045, 0.0), (0.04, 0.5), (0.004, 1.0)]
    n = 9
    out = random.normal((0, 0, 0.7), 0.6, (n, 3))
    strip = sheet(np.array([[(-w, y, 0), (w, y, 0)] for w, y in needle]))
    brush = copies(strip, frames(out, random.normal(0, 1, (n, 3))) * 0.11, np.zeros((n, 3)))
    needles = leaf_material("Pine needles", (0.012, 0.045, 0.016), (0.045, 0.095, 0.026), 0.15)
    bark = bark_material("Pine bark", (0.20, 0.13, 0.09))
    meshes = []
    for i in range(2):
        t = np.linspace(0, 1, 14)
        turn = random.uniform(0, TAU)
        sway = 0.42 * np.sin(t * 6.0 + i) * t
        stem = np.stack([sway * np.cos(turn), sway * np.sin(turn), 3.1 * t - 0.2], axis=-1)
        parts, tufts = [tube(stem, np.linspace(0.15, 0.04, 14), recipe.steps(12, 4))], []
        for k, at in enumerate((4, 6, 7, 9, 10, 11, 13)):
            angle, reach = turn + 2.2 * k, (0.0 if at == 13 else 1.35 - 0.075 * at)
            tip = stem[at] + (reach * np.cos(angle), reach * np.sin(angle), 0.12)
            bow = np.linspace(0, 1, 6)[:, None]
            limb_path = stem[at] + bow * (tip - stem[at]) - (0, 0, 0.12) * np.sin(np.pi * bow)
            if reach:
                parts.append(tube(limb_path, np.linspace(0.05, 0.02, 6), recipe.steps(8, 3)))
            size = 0.75 - 0.022 * at
            count = recipe.copies(520 * size, 12)
            spin, radius = random.uniform(0, TAU, count), np.sqrt(random.random(count))
            dome = (1 - radius**2) * 0.45 * random.uniform(0.2, 1.0, count)
            spots = np.stack([radius * np.cos(spin), radius * np.sin(spin), dome], axis=-1) * size
            tilt = frames(
                random.normal(0, 1, (count, 3)) * (1, 1, 0.1), spots * (1.2, 1.2, 0.4) + (0, 0, 0.6)
            )
            tufts.append(
                copies(brush, tilt * random.uniform(0.8, 1.25, (count, 1, 1)), spots + tip)
            )
        meshes.append(mesh(f"Pine.{i}", join([*parts, join(tufts).painted(1)]), bark, needles))
    spots = np.array(
        [(5.9, 0.2), (3.1, 6.3), (-7.6, -2.6), (-3.3, 5.6), (6.4, 5.4), (-5.8, -5.6), (9.5, 2.4)]
    )
    scatter("Pine", meshes, standing(random, spots, (0.85, 1.3)))


def woods(recipe: Recipe) -> None:
    """Broad-leaved trees around the garden, thinning out towards the hills."""
    random = recipe.random("woods")
    growth = Growth(
        (4.2, 2.6, 1.5, 0.7), (9, 6, 4), (0.95, 0.8, 0.7), (0.03, 0.07, 0.04, 0.0), 0.2, 0.14, 0.35
    )
    bark = bark_material("Bark", (0.15, 0.12, 0.09))
    tints = (
        ((0.03, 0.075, 0.014), (0.10, 0.17, 0.03)),
        ((0.07, 0.10, 0.015), (0.22, 0.22, 0.035)),
        ((0.22, 0.09, 0.015), (0.40, 0.22, 0.03)),
    )
    meshes = []
    for i, (dark, light) in enumerate(tints):
        wood, twigs, directions = branches(random, growth, 0.3 * recipe.detail)
        leaf = leaves_on(
            random, twigs, directions, oval_leaf(), recipe.copies(20, 2), (0.2, 0.34), 0.2, 0.14
        )
        foliage = leaf_material(f"Leaves.{i}", dark, light)
        meshes.append(mesh(f"Tree.{i}", join([wood, leaf.painted(1)]), bark, foliage))

    def allowed(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        gap = np.cos(np.arctan2(y, x) - SUN_AZIMUTH) < 0.93  # let the sun in
        return (
            (r > 11.5)
            & (r < 75)
            & (path_distance(x, y) > 3)
            & (gap | (r > 30))
            & (noise(np.stack([x, y, 0 * x], axis=-1) / 16.0, 95) > -0.05 - 0.1 * (r < 25))
        )

    near = spread(random, 40, (-26, -26, 26, 26), 3.4, allowed)
    far = spread(random, 90, (-75, -75, 75, 75), 4.5, allowed)
    order = [0, 1, 0, 1, 0, 2, 0, 1]
    places = standing(random, np.vstack([near, far]), (0.75, 1.35), 0.1, 0.03)
    scatter("Tree", [meshes[k] for k in order], places)


def shrubs(recipe: Recipe) -> None:
    """Azaleas clipped into cushions, some in flower."""
    random = recipe.random("shrubs")
    green = leaf_material("Azalea leaves", (0.02, 0.055, 0.012), (0.07, 0.13, 0.025), 0.2)
    pink = leaf_material("Azalea flowers", (0.55, 0.06, 0.20), (0.80, 0.30, 0.45), 0.3)
    core = plain("Shrub core", (0.012, 0.02, 0.006), Roughness=1.0)
    meshes = []
    for i in range(3):
        count = recipe.copies(3600, 60)
        z = random.uniform(-0.1, 1.0, count)
        angle = random.uniform(0, TAU, count)
        flat = np.sqrt(np.maximum(1 - z * z, 0))
        unit = np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1)
        swell = (
            0.5 * (1 + 0.16 * noise(unit * 1.6 + 7.0 * i, 96, 2)) * random.uniform(0.9, 1.03, count)
        )
        spots = unit * swell[:, None] * (1, 1, 0.85)
        turn = frames(random.normal(0, 1, (count, 3)), unit + random.normal(0, 0.45, (count, 3)))
        slots = np.where(random.random(count) < (0.0, 0.12, 0.3)[i], 2, 1)
        foliage = copies(oval_leaf(), turn * random.uniform(0.035, 0.06, (count, 1, 1)), spots)
        foliage.slots = np.repeat(slots, len(oval_leaf().triangles)).astype(np.int32)
        ball = icosphere(recipe.steps(3, 2))
        inner = 0.42 * (1 + 0.16 * noise(ball.vertices * 1.6 + 7.0 * i, 96, 2))
        ball = Shape(ball.vertices * inner[:, None] * (1, 1, 0.85), triangles=ball.triangles)
        meshes.append(mesh(f"Shrub.{i}", join([ball, foliage]), core, green, pink))

    def allowed(x: Array, y: Array) -> Array:
        away = (court_distance(x, y) > 0.75) & (pond_distance(x, y) > 0.9)
        return (
            away & (path_distance(x, y) > 1.3) & (np.hypot(x, y) < 14) & clear_of_things(x, y, 0.6)
        )

    spots = spread(random, 56, (-14, -14, 14, 14), 1.15, allowed)
    scatter("Shrub", meshes, standing(random, spots, (0.8, 1.9)))


def clear_of_things(x: Array, y: Array, margin: float) -> Array:
    """Whether points keep away from what stands in the moss: lanterns, maple, torii's posts."""
    things = [(lx, ly) for lx, ly, _ in STONE_LANTERNS]
    things += [MAPLE, (TORII[0] - 1.5, TORII[1]), (TORII[0] + 1.5, TORII[1])]
    return np.min([np.hypot(x - tx, y - ty) for tx, ty in things], axis=0) > margin


def grass(recipe: Recipe) -> None:
    """Grass in the moss around the court, taller towards the woods."""
    random = recipe.random("grass")
    green = leaf_material("Grass", (0.028, 0.062, 0.010), (0.125, 0.17, 0.032), 0.35)
    meshes = [
        mesh(
            f"Grass.{i}",
            tuft(random, recipe.copies(760, 30), 0.6, (0.05, 0.15), 0.04, 3, 0.5),
            green,
        )
        for i in range(4)
    ]

    def allowed(x: Array, y: Array) -> Array:
        patch = noise(np.stack([x, y, 0 * x], axis=-1) / 2.2, 97, 2) > -0.12
        return (
            patch
            & (court_distance(x, y) > 0.5)
            & (pond_distance(x, y) > 0.25)
            & (path_distance(x, y) > 0.95)
        )

    near = spread(random, recipe.copies(330, 40), (-9.5, -9.5, 9.5, 9.5), 0.66, allowed)
    far = spread(
        random,
        recipe.copies(190, 40),
        (-22, -22, 22, 22),
        1.55,
        lambda x, y: allowed(x, y) & (np.hypot(x, y) > 9.5),
    )
    scatter("Grass", meshes, lying(random, near, (0.8, 1.25)) + lying(random, far, (1.8, 2.8)))


def fallen_leaves(recipe: Recipe, stones: Sequence[tuple[Array, float]]) -> None:
    """Maple leaves on the gravel and the flagstones, thickest under the crown."""
    random = recipe.random("fallen leaves")
    count = recipe.copies(420, 20)
    spots = np.vstack(
        [
            random.normal((-1.2, -2.0), 1.3, (count, 2)),
            random.uniform(COURT[:2], COURT[2:], (count // 3, 2)),
        ]
    )
    spots = spots[court_distance(*spots.T) < -0.2]
    heights = raked_height(*spots.T, stones) + 0.012
    kept = np.ones(len(spots), dtype=bool)
    for outline, height in stones:
        middle = outline.mean(0)
        reach = np.hypot(*(spots - middle).T)
        radius = np.hypot(*(outline - middle).T)
        heights[reach < 0.72 * radius.min()] = height + 0.008
        kept &= (reach < 0.72 * radius.min()) | (reach > radius.max() + 0.04)
    spots, heights = spots[kept], heights[kept]
    turn = random.uniform(0, TAU, len(spots))
    forward = np.stack([np.cos(turn), np.sin(turn), random.normal(0, 0.05, len(spots))], axis=-1)
    up = random.normal((0, 0, 1), (0.12, 0.12, 0.0), (len(spots), 3))
    shape = copies(
        maple_leaf(),
        frames(forward, up) * random.uniform(0.05, 0.085, (len(spots), 1, 1)),
        np.column_stack([spots, heights]),
    )
    add(
        "Fallen leaves",
        shape,
        leaf_material("Fallen maple leaves", (0.26, 0.02, 0.012), (0.55, 0.17, 0.04), 0.2),
    )


# --- The distance ---------------------------------------------------------------------------------


def mountains(recipe: Recipe) -> None:
    """Ridges all round the horizon, lower where the sun rises."""
    angles = np.linspace(0, TAU, recipe.steps(540), endpoint=False)
    radii = np.linspace(170, 520, recipe.steps(60))
    r, a = np.meshgrid(radii, angles, indexing="ij")
    x, y = r * np.cos(a), r * np.sin(a)
    flat = np.stack([x, y, 0 * x], axis=-1)
    ridge = 1 - np.abs(noise(flat / 150.0, 98, 1)) * 2.2
    detail = noise(flat / 60.0, 99, 5)
    sunward = 0.5 + 0.5 * np.cos(a - SUN_AZIMUTH)
    tall = (150 - 70 * sunward**2) * smoothstep(175, 400, r)
    height = 2.0 + tall * (0.38 + 0.62 * ridge + 0.30 * detail)
    made, graph = material("Mountain")
    where = graph.coordinates()
    forest = graph.noise(where, 0.16, 6.0, 0.75)
    normal = graph.add("ShaderNodeNewGeometry").outputs["Normal"]
    steep = graph.math("ADD", graph.xyz(normal)["Z"], graph.math("MULTIPLY", forest, 0.5))
    wood = graph.ramp(
        forest,
        [(0.35, (0.020, 0.045, 0.026)), (0.52, (0.045, 0.075, 0.030)), (0.68, (0.12, 0.10, 0.04))],
    )
    color = graph.mix(graph.span(steep, 0.0, 1.0, 0.75, 1.0), (0.16, 0.16, 0.17), wood)
    high = graph.math("ADD", graph.xyz(where)["Z"], graph.math("MULTIPLY", forest, 30.0))
    color = graph.mix(graph.span(high, 0.0, 1.0, 132.0, 146.0), color, (0.75, 0.78, 0.82))
    finish(made, graph, graph.add("ShaderNodeBsdfDiffuse", {"Color": color}))
    add("Mountains", sheet(np.stack([x, y, height], axis=-1)[::-1], closed=True), made)


def fog(recipe: Recipe) -> None:
    """A ring of morning fog before the mountains.

    It glows with the light that it would scatter towards the viewer: no noise, hardly any cost.
    """
    made, graph = material("Fog")
    veil = graph.add(
        "ShaderNodeVolumeAbsorption", {"Color": (0.0, 0.0, 0.0), "Density": FOG_DENSITY}
    )
    glow = graph.add("ShaderNodeEmission", {"Color": FOG_COLOR, "Strength": FOG_DENSITY})
    finish(made, graph, volume=graph.add("ShaderNodeAddShader", {0: veil, 1: glow}))
    # Arcs, none of whose bounding boxes holds the viewer: in the box of a whole ring, each camera
    # ray would first be asked whether it starts in the fog.
    arc = np.linspace(0, TAU / FOG_ARCS, recipe.steps(12))
    corners = np.array([(85.0, 17.0), (165.0, 21.0), (165.0, -2.0), (85.0, -2.0)])
    rows = np.empty((len(arc), 4, 3))
    rows[..., :2] = np.stack([np.cos(arc), np.sin(arc)], axis=-1)[:, None] * corners[:, :1]
    rows[..., 2] = corners[:, 1]
    body = sheet(rows, closed=True)
    last = len(body.vertices)
    ends = np.array([(3, 2, 1, 0), (last - 4, last - 3, last - 2, last - 1)], dtype=np.int32)
    data = mesh("Fog", Shape(body.vertices, np.concatenate([body.quads, ends])), made, smooth=False)
    for k in range(FOG_ARCS):
        bank = place(f"Fog.{k}", data, transform(rotation=(0, 0, k * TAU / FOG_ARCS)))
        bank.visible_diffuse = bank.visible_shadow = False
