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
    prism,
    random_stream,
    scatter,
    sheet,
    steps,
    sun_light,
    transform,
    tube,
)

TAU = 2 * np.pi

# The court of raked gravel: a rectangle x0, y0, x1, y1.
COURT = (-2.7, -3.8, 4.3, 4.9)
POND_CENTER, POND_RADIUS, WATER_LEVEL = np.array([-5.5, 0.6]), 2.3, -0.07
STATUE = (0.0, 3.75)
MIRROR = (1.75, 3.25)
FIRE = (3.1, 1.1)
TORII = (0.2, -8.5)
MAPLE = (-2.35, -3.35)
ROCK_ISLANDS = ((2.75, -2.05, 0.75), (-1.85, 2.55, 0.5))  # x, y, radius
STONE_LANTERNS = ((4.95, 3.1, 1.0), (-1.3, -5.2, 1.1), (-4.6, 4.2, 0.9))  # x, y, scale
GROVES = ((-5.5, 6.4, 6.5, 9.5), (2.2, -8.5, 9.0, -5.2))  # of bamboo: rectangles x0, y0, x1, y1

SUN_AZIMUTH, SUN_ELEVATION = np.radians(-128.0), np.radians(27.0)
# Where the sun stands in sunrise.exr: the sky is turned so that it stands where ours does.
SKY_SUN_AZIMUTH = np.radians(-35.5)

FLAME_COLOR: Color = (1.0, 0.42, 0.12)
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
    sky()
    stones = flagstone_layout(recipe)
    terrain(recipe)
    gravel(recipe, stones)
    flagstones(recipe, stones)
    kerb(recipe)
    statue(recipe)
    mirror(recipe)
    rocks(recipe)
    stone_lanterns(recipe)
    bamboo(recipe)


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
        turn = (*random.normal(0, tilt, 2), random.uniform(0, TAU)) if tilt else None
        rotation = turn or (0.0, 0.0, random.uniform(0, TAU))
        matrices.append(transform((x, y, z - sink * size), rotation, size))
    return matrices


# --- Sky and ground -------------------------------------------------------------------------------


def sky() -> None:
    """The sunrise that ships with bpy; a sun lamp, higher up, takes the place of its sun."""
    hdri_world("sunrise.exr", 1.5, SUN_AZIMUTH - SKY_SUN_AZIMUTH, brightest=8.0)
    sun_light("Sun", SUN_AZIMUTH, SUN_ELEVATION, 4.2, (1.0, 0.80, 0.58), np.radians(1.5))


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
    return finish(made, graph, surface)


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
    middles = [(-0.1, -0.05, 0.62), (0.62, -0.55, 0.36), (-0.72, 0.50, 0.40), (0.66, 0.42, 0.42)]
    middles += [(-0.62, -0.66, 0.38), (0.15, 0.98, 0.45), (-0.05, 1.85, 0.42), (0.08, 2.62, 0.40)]
    middles += [(0.05, -1.12, 0.44), (-0.12, -1.98, 0.42), (0.12, -2.80, 0.43), (0.0, -3.5, 0.38)]
    middles += [(1.38, 0.10, 0.38), (1.32, 0.92, 0.33), (2.05, 0.52, 0.36), (-1.45, 0.10, 0.36)]
    middles += [(-2.15, 0.35, 0.38), (0.85, -4.5, 0.3), (0.1, -4.35, 0.42), (0.3, -5.2, 0.44)]
    middles += [(0.1, -6.05, 0.42), (0.35, -6.9, 0.46), (0.1, -7.75, 0.42), (1.0, 2.35, 0.34)]
    stones = []
    for x, y, radius in middles:
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
        stones.append((outline + np.array([x, y]), 0.045 + random.uniform(0, 0.02)))
    return stones


def raked_height(x: Array, y: Array, stones: Sequence[tuple[Array, float]]) -> Array:
    """The gravel's relief: straight furrows, rings around the islands, smoothed by the stones."""
    period, depth, rings = 0.095, 0.012, 0.62
    islands = [*ROCK_ISLANDS, (*STATUE, 0.85), (*FIRE, 0.5)]
    reach = np.min([np.hypot(x - ix, y - iy) - r for ix, iy, r in islands], axis=0)
    wavy = y + 0.02 * np.sin(2.1 * x)
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
    add("Gravel", grid(x, y, raked_height(gx, gy, stones)), finish(made, graph, surface))


def flagstones(recipe: Recipe, stones: Sequence[tuple[Array, float]]) -> None:
    """Dark polished stones, still wet in places: sharp and blurred reflections side by side."""
    made, graph = material("Wet stone")
    where = graph.coordinates()
    grain = graph.noise(where, 55.0, 5.0, 0.65)
    veins = graph.noise(where, 3.2, 6.0, 0.6, 1.2)
    wet = graph.span(graph.noise(where, 2.1, 3.0), 0.0, 1.0, 0.44, 0.56)
    dry_tint = graph.ramp(
        veins, [(0.3, (0.075, 0.08, 0.085)), (0.52, (0.13, 0.13, 0.125)), (0.6, (0.2, 0.19, 0.17))]
    )
    tint = graph.mix(wet, dry_tint, graph.mix(1.0, dry_tint, (0.42, 0.42, 0.45), "MULTIPLY"))
    roughness = graph.math("ADD", graph.span(wet, 0.34, 0.07), graph.math("MULTIPLY", grain, 0.12))
    relief = graph.math("ADD", veins, graph.math("MULTIPLY", grain, 0.25))
    surface = graph.principled(
        Base_Color=tint, Roughness=roughness, IOR=1.6, Normal=graph.bump(relief, 0.004)
    )
    finish(made, graph, surface)
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
    relief = graph.math("ADD", broad, graph.math("MULTIPLY", speckle, 0.12))
    surface = graph.principled(
        Base_Color=graph.mix(cover, stone, green),
        Roughness=graph.span(cover, 0.62, 0.95),
        Normal=graph.bump(relief, 0.02),
    )
    return finish(made, graph, surface)


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


def paper_material(name: str, tint: Color) -> bpy.types.Material:
    """Washi paper: half of the light that falls on it comes out at the other side."""
    made, graph = material(name)
    fibres = graph.noise(graph.coordinates(), 45.0, 4.0, 0.7, 1.0)
    color = graph.mix(graph.span(fibres, 0.0, 0.35, 0.4, 0.7), tint, tuple(0.72 * c for c in tint))
    front = graph.add("ShaderNodeBsdfDiffuse", {"Color": color})
    through = graph.add("ShaderNodeBsdfTranslucent", {"Color": color})
    return finish(made, graph, graph.add("ShaderNodeMixShader", {0: 0.55, 1: front, 2: through}))


def hexagon(radius: float) -> Array:
    angle = np.arange(6) * TAU / 6
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def stone_lantern_parts(recipe: Recipe) -> tuple[Shape, Shape]:
    """A Kasuga lantern, 1.75 m high: its stone, and the six paper panes of its fire box."""
    stack = [
        prism(hexagon(0.36), 0.12),
        lathe([(0.27, 0.12), (0.27, 0.17), (0.18, 0.24), (0.14, 0.27)], 6),
        lathe(
            [(0.12, 0.26), (0.115, 0.5), (0.14, 0.53), (0.14, 0.57), (0.115, 0.6), (0.12, 0.86)],
            recipe.steps(32, 8),
        ),
        lathe([(0.13, 0.85), (0.19, 0.9), (0.31, 0.97), (0.31, 1.04), (0.27, 1.05)], 6),
    ]
    for x, y in hexagon(0.215):
        stack.append(box((0.05, 0.05, 0.34), 0.008, 1).moved(x, y, 1.21))
    stack.append(prism(hexagon(0.25), 0.04).moved(0, 0, 1.36))
    u = np.linspace(0, 1, recipe.steps(14, 4))
    angle = np.arange(6 * 8) * TAU / 48
    side = np.cos(TAU / 12) / np.cos((angle % (TAU / 6)) - TAU / 12)
    corner = np.clip((side - 0.866) / 0.134, 0, 1) ** 3
    reach = 0.45 - 0.36 * u**0.72
    roof = np.empty((len(u), len(angle), 3))
    roof[..., :2] = reach[:, None, None] * (
        side[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    )
    roof[..., 2] = 1.42 + 0.22 * u[:, None] ** 1.3 + 0.09 * corner * (1 - u[:, None]) ** 2
    under = roof[:1] * (0.45, 0.45, 1) + (0, 0, -0.03)
    lip = roof[:1] - np.array([0, 0, 0.045])
    stack.append(sheet(np.concatenate([under, lip, roof]), closed=True))
    knob = [(0.09, 1.63), (0.12, 1.66), (0.05, 1.69), (0.085, 1.75), (0.075, 1.8), (0.0, 1.88)]
    stack.append(lathe(knob, recipe.steps(24, 8)))
    corners = hexagon(0.205)
    panes = [
        sheet(np.array([[(*a, 1.05), (*b, 1.05)], [(*a, 1.37), (*b, 1.37)]]))
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    return join(stack), join(panes)


def stone_lanterns(recipe: Recipe) -> None:
    """Stone lanterns with paper panes, a light in each."""
    stone, panes = stone_lantern_parts(recipe)
    granite = granite_material("Lantern granite", (0.25, 0.24, 0.225), 0.55)
    stone_mesh = mesh("Lantern stone", stone, granite, smooth=0.6)
    pane_mesh = mesh(
        "Lantern panes", panes, paper_material("Pane paper", (0.86, 0.80, 0.66)), smooth=False
    )
    for i, (x, y, size) in enumerate(STONE_LANTERNS):
        z = float(ground_height(np.array(x), np.array(y))) - 0.03
        spot = transform((x, y, z), (0, 0, 0.4 * i), size)
        place(f"Lantern stone.{i}", stone_mesh, spot)
        place(f"Lantern panes.{i}", pane_mesh, spot)
        point_light(f"Lantern light.{i}", (x, y, z + 1.2 * size), 14.0, CANDLE_COLOR, 0.06)


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
            for _ in range(recipe.copies(9, 2)):
                where = random.uniform(0.25, 1.0)
                spot = middle(z) + length * (where * out - where**2 * np.array([0, 0, 0.45]))
                leaf_at.append(spot)
                leaf_to.append(out * 0.6 + random.normal(0, 0.55, 3) - (0, 0, 0.35))
    facing = frames(np.array(leaf_to), random.normal((0, 0, 1), 0.5, (len(leaf_to), 3)))
    size = random.uniform(0.13, 0.24, (len(leaf_to), 1, 1))
    return join([*parts, copies(bamboo_leaf(), facing * size, np.array(leaf_at)).painted(1)])


def bamboo(recipe: Recipe) -> None:
    """Groves of bamboo behind the statue and beside the path."""
    random = recipe.random("bamboo")
    meshes = bamboo_meshes(recipe, 5)
    places = []
    for corners, count in zip(GROVES, (60, 42), strict=True):
        spots = spread(
            random,
            count,
            corners,
            0.34,
            lambda x, y: (path_distance(x, y) > 1.6) & (pond_distance(x, y) > 0.5),
        )
        places += standing(random, spots, (0.75, 1.1), 0.05, 0.03)
    scatter("Bamboo", meshes, places)
