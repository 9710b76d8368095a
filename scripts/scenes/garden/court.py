"""The ground: mossy terrain, the court of raked gravel with flagstones and kerb, and boulders."""

from collections.abc import Sequence

import numpy as np

from scenes.garden.plan import TAU, GardenPlan
from scenes.library.points import Array, noise, points, polar, smoothstep, xyz
from scenes.library.scene import Scene, scatter
from scenes.library.shapes import Shape, box, grid, icosphere, sheet, transform

Flagstone = tuple[Array, float]  # a stone's outline (n, 2) and its height


def terrain(scene: Scene[GardenPlan]) -> None:
    """The ground around the court, out to the foot of the mountains."""
    near = np.linspace(1.5, 12.0, scene.segments(120))
    radii = np.concatenate([near, np.geomspace(12.0, 420.0, scene.segments(60))[1:]])
    ground = polar(radii[::-1, None], np.linspace(0, TAU, scene.segments(420), endpoint=False))
    ground[..., 2] = scene.plan.ground_height(ground[..., 0], ground[..., 1])
    scene.add("Terrain", sheet(ground, closed=True), "Moss")


def flagstone_layout(scene: Scene[GardenPlan]) -> list[Flagstone]:
    """Paths of flagstones, polygons of 5 to 7 wavy sides, to the statue, the fire, the torii."""
    random = scene.random("flagstones")
    steps = points(scene.plan.steps)
    middles = steps[:, :2]
    radii = steps[:, 2]
    apart = np.hypot(*(middles[:, None] - middles).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    part = radii[:, None] / (radii[:, None] + radii)
    fitting = ((apart - 0.04) * part).min(axis=1) / 1.14  # what keeps them from touching
    angles = np.linspace(0, TAU, scene.segments(48, 8), endpoint=False)
    stones = []
    for middle, radius in zip(middles, np.minimum(radii, fitting), strict=True):
        wave = random.uniform(0, TAU, 2)
        stretch = random.uniform(0.86, 1.1)
        sides = random.integers(5, 8)
        turn = random.uniform(0, TAU)
        nearest = (angles - turn + np.pi / sides) % (TAU / sides) - np.pi / sides
        polygon = np.cos(np.pi / sides) / np.cos(nearest)
        reach = radius * (0.35 + 0.65 * polygon + 0.03 * np.sin(3 * angles + wave[0]))
        reach *= 1 + 0.05 * np.sin(2 * angles + wave[1])
        outline = polar(reach, angles)[:, :2] * (stretch, 1)
        stones.append((outline + middle, 0.035 + random.uniform(0, 0.015)))
    return stones


def raked_height(plan: GardenPlan, x: Array, y: Array, stones: Sequence[Flagstone]) -> Array:
    """The gravel's relief: straight furrows, rings around the islands, smoothed by the stones."""
    period, depth, rings = 0.095, 0.015, 0.62
    islands = [*plan.rock_islands, (*plan.statue, 0.85), (*plan.fire, 0.5)]
    reach = np.min([np.hypot(x - ix, y - iy) - r for ix, iy, r in islands], axis=0)
    wavy = x + 0.02 * np.sin(2.1 * y)
    furrows = np.where(reach < rings, np.cos(TAU * reach / period), np.cos(TAU * wavy / period))
    calm = smoothstep(0.0, -0.15, plan.court_distance(x, y)) * smoothstep(
        0, 0.05, np.abs(reach - rings)
    )
    for outline, _ in stones:
        middle = outline.mean(0)
        away = np.hypot(x - middle[0], y - middle[1]) - np.hypot(*(outline - middle).T).mean()
        calm = np.minimum(calm, smoothstep(0.0, 0.22, away))
    return depth * furrows * calm + 0.004 * noise(xyz(x, y) * 9.0, 21, 2)


def gravel(scene: Scene[GardenPlan]) -> None:
    """The court's raked gravel, modelled furrow by furrow. The shader adds the grains."""
    x0, y0, x1, y1 = scene.plan.court
    x = np.linspace(x0, x1, scene.segments((x1 - x0) / 0.024))
    y = np.linspace(y0, y1, scene.segments((y1 - y0) / 0.020))
    heights = raked_height(scene.plan, *np.meshgrid(x, y), flagstone_layout(scene))
    scene.add("Gravel", grid(x, y, heights), "Gravel")


def flagstones(scene: Scene[GardenPlan]) -> None:
    """Dark polished stones, still wet in places: sharp and blurred reflections side by side."""
    for i, (outline, height) in enumerate(flagstone_layout(scene)):
        middle = outline.mean(0)
        base = (
            0.0
            if scene.plan.court_distance(*middle) < 0
            else float(scene.plan.ground_height(*middle))
        )
        stone = cushion(outline - middle, height + 0.1, 0.03, scene.segments(10, 2), i)
        spot = transform((*middle, base - 0.1))
        scene.add(f"Flagstone.{i:02d}", stone, "Wet stone", matrix=spot)


def cushion(outline: Array, height: float, rounding: float, rings: int, seed: int) -> Shape:
    """A flat stone: an outline (n, 2) around the origin, extruded, with a rounded rim."""
    turns = np.linspace(0, np.pi / 2, 5)
    reach = np.hypot(*outline.T).min()
    inset = [0, *rounding * (1 - np.cos(turns)), *np.linspace(rounding, reach, rings + 2)[1:-1]]
    level = np.array([0, *height - rounding * (1 - np.sin(turns)), *[height] * rings])[:, None]
    x, y = (1 - np.array(inset)[:, None] / reach) * outline.T[:, None]
    level = level + 0.004 * noise(xyz(x, y, seed * 3.7) * 5.0, 31, 3) * (level > 0)
    return sheet(xyz(x, y, level), closed=True, capped=True)


def kerb(scene: Scene[GardenPlan]) -> None:
    """Granite blocks that hold the gravel in, but for the pond's shore and the path."""
    random = scene.random("kerb")
    block = box((0.62, 0.15, 0.26), 0.02, 2)
    blocks = []
    for i in range(3):
        bumpy = block.vertices + 0.008 * noise(block.vertices * 6 + i * 9, 41, 2)[:, None]
        blocks.append(scene.mesh(f"Kerb.{i}", block.reshaped(bumpy), "Kerb granite"))
    x0, y0, x1, y1 = scene.plan.court
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    places = []
    for side, (start, end) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        count = round(np.hypot(*(end - start)) / 0.645)
        for x, y in start + (end - start) * (np.arange(count)[:, None] + 0.5) / count:
            if scene.plan.pond_distance(x, y) > 0.1 and (y > y0 + 0.1 or abs(x) > 0.55):
                dx, dy, dz = random.normal(0, 0.012, 3)
                turn = (0, 0, side * TAU / 4 + dx)
                places.append(transform((x + dx, y + dy, dz - 0.03), turn))
    scatter("Kerb", blocks, places)


def rocks(scene: Scene[GardenPlan]) -> None:
    """Rock islands in the gravel, stones along the shore, and boulders in the moss."""
    random = scene.random("rocks")
    places = []
    boulders = []
    for x, y, radius in scene.plan.rock_islands:
        for dx, dy, size in points(
            [(0, 0, 1.5), (0.62, 0.25, 0.85), (-0.35, 0.55, 0.6), (0.15, -0.6, 0.5)]
        ):
            spot = (x + dx * radius, y + dy * radius, 0.22 * size * radius)
            places.append(transform(spot, (0, 0, random.uniform(0, TAU)), size * radius))
    for angle in np.arange(0, TAU, 0.115):
        direction = np.array([np.cos(angle), np.sin(angle) / 0.8])
        reach = np.linspace(1.0, 4.0, 300)[:, None] * direction + np.array(scene.plan.pond_center)
        shore = reach[np.abs(scene.plan.pond_distance(*reach.T)).argmin()] + random.normal(
            0, 0.06, 2
        )
        size = random.uniform(0.34, 0.62) * (1.5 if random.random() < 0.12 else 1.0)
        turn = random.uniform((-0.2, -0.2, 0), (0.2, 0.2, TAU))
        places.append(transform((*shore, -0.02), turn, size))
    spots = scene.plan.spread(random, 26, (-13, -13, 13, 13), 1.2, court=0.7, pond=0.6, path=1.2)
    places += scene.plan.standing(random, spots, (0.4, 1.5), -0.05)
    ball = icosphere(scene.segments(5, 2))  # about 1 m across
    for i in range(6):
        v = ball.vertices
        shift = np.array([17.0 * i, 5.0, 3.0])
        ridges = 1 - 2 * np.abs(noise(v * 1.3 + shift, 62, 1))
        swell = 1 + 0.28 * noise(v * 0.9 + shift, 61, 2) + 0.16 * ridges
        swell += 0.05 * noise(v * 5 + shift, 63, 3)
        stretch = scene.random(f"rock{i}").uniform((0.4, 0.34, 0.3), (0.52, 0.48, 0.46))
        weathered = ball.reshaped(v * swell[:, None] * stretch)
        boulders.append(scene.mesh(f"Rock.{i}", weathered, "Rock"))
    scatter("Rock", boulders, places)
