"""Lone Monk: the courtyard of a cloister with a well, four vaulted walks, and one monk.

After the scene of that name by Carlo Bergonzini that SILVR used; every stone here is made by code.

The camera rigs stand round the world's origin, on the south-eastern lawn: a cuboid of 4 × 4 × 3 m
and a sphere of 4 m, both centred 2.2 m above the ground. Nothing but grass is in them. The court's
centre, with the well, is at `CENTER`; the four sides are built alike in a frame of their own, in
which the court's centre is the origin, x runs along the side, and y points out of the court.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, hypot, pi, radians, sin, sqrt, tan
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.random import Generator

from scenes.common import (
    Array,
    Color,
    Graph,
    Shape,
    add,
    box,
    finish,
    grid,
    icosphere,
    join,
    lathe,
    material,
    mesh,
    noise,
    place,
    plain,
    prism,
    sheet,
    steps,
    sun_light,
    transform,
    tube,
)

# Plan, in metres from the court's centre.
CENTER = (-1.2, 3.6)  # in the world, so that the rigs at the origin stand beside the well
BAY = 2.2  # from column to column
BAYS = 7  # of each arcade; the middle one is the gate to the garden
ARCADE = BAY * BAYS / 2  # axis of the arcade's wall
ARCADE_WALL = 0.5
WALK = 2.7  # clear width of the vaulted walks
BACK = ARCADE + ARCADE_WALL / 2 + WALK  # front of the buildings' walls
BACK_WALL = 0.5
PATH = 1.6  # width of the path along the arcades
CROSS_PATH = 0.95  # half width of the paths to the well
PLAZA = 2.3  # radius of the paving round the well
LAWN = ARCADE - 0.35 - PATH  # outer edge of the lawns

# Heights.
WALK_FLOOR = 0.14
STYLOBATE = 0.6  # the low wall that carries the columns
SPRINGING = 2.45  # of arches and vaults
ARCH_RADIUS = 0.92
VAULT_RISE = 0.95
ARCADE_TOP = 3.86
EAVE = 3.8  # of the lean-to roofs over the walks
EAVE_OUT = 0.42  # its overhang in front of the arcade's wall
ROOF_SLOPE = radians(24)
LEAN_TO_TOP = EAVE + (BACK - ARCADE + ARCADE_WALL / 2 + EAVE_OUT) * tan(ROOF_SLOPE)

# Sides are numbered as a quarter turn each from the north: 0 north, 1 west, 2 south, 3 east.
NORTH, WEST, SOUTH, EAST = range(4)
UPPER_TOP = {NORTH: 7.7, SOUTH: 7.2, EAST: 9.4}  # the west is low: the sun comes in there

# Roof tiles: half pipes, hollow side up and down in turn.
TILE_PITCH = 0.215  # from cover to cover
TILE_EXPOSED = 0.36
TILE_LENGTH = 0.43
TILE_THICK = 0.014

SUN_AZIMUTH = radians(204)
SUN_ELEVATION = radians(30)
SUN_STRENGTH = 16.0
SKY_STRENGTH = 0.34

SHARP = radians(35)


@dataclass(frozen=True)
class Site:
    """What every element needs: the seed, the level of detail, and the materials by name."""

    seed: int
    detail: float
    materials: Mapping[str, bpy.types.Material]

    def random(self, element: str) -> Generator:
        """Random numbers of an element's own, so that elements do not disturb each other."""
        return np.random.default_rng([self.seed, *element.encode()])

    def count(self, full: int) -> int:
        """How many of `full` small things (leaves, blades) to make at this detail."""
        return steps(full, self.detail, 1)

    def segments(self, full: int, least: int = 4) -> int:
        """How finely to divide a curve: a surface's triangles grow with its square."""
        return steps(full, sqrt(self.detail), least)

    def of(self, *names: str) -> list[bpy.types.Material]:
        return [self.materials[name] for name in names]


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int) and `detail` (1.0 is full)."""
    site = Site(parameters["seed"], parameters["detail"], make_materials())
    sky(site)
    ground(site)
    paving(site)
    lawns(site)
    well(site)
    arcades(site)
    vaults(site)
    back_walls(site)
    lean_to_roofs(site)
    upper_buildings(site)
    church_front(site)
    tower(site)
    gutters(site)
    walk_furniture(site)
    court_furniture(site)
    shrubs(site)
    olive_tree(site)
    cypresses(site)
    ivy(site)
    potted_plants(site)
    fallen_leaves(site)
    birds(site)
    monk(site)


def side(number: int) -> Matrix:
    """From a side's frame to the world."""
    return transform((*CENTER, 0)) @ transform(rotation=(0, 0, number * pi / 2))


# --- Shapes ---------------------------------------------------------------------------------------


def copies(shape: Shape, matrices: Array) -> Shape:
    """A shape repeated by matrices (n, 4, 4), in one mesh."""
    n, size = len(matrices), len(shape.vertices)
    vertices = np.einsum("nij,vj->nvi", matrices[:, :3, :3], shape.vertices)
    vertices += matrices[:, None, :3, 3]
    offset = (np.arange(n) * size)[:, None, None]
    slots, quads = shape.face_slots(), len(shape.quads)
    return Shape(
        vertices.reshape(-1, 3),
        (shape.quads + offset).reshape(-1, 4),
        (shape.triangles + offset).reshape(-1, 3),
        np.concatenate([np.tile(slots[:quads], n), np.tile(slots[quads:], n)]),
    )


def blocks(centers: Any, sizes: Any, bevel: Any = 0.012) -> Shape:
    """Boxes with chamfered edges: centers and sizes (n, 3), bevel a number or one per axis."""
    centers, sizes = np.broadcast_arrays(np.atleast_2d(centers), np.atleast_2d(sizes))
    unit = box((1, 1, 1), bevel=0.25, segments=1)
    inset = (np.abs(unit.vertices) < 0.4) * np.broadcast_to(bevel, 3)
    vertices = np.sign(unit.vertices) * (sizes[:, None] / 2 - inset) + centers[:, None]
    offset = (np.arange(len(centers)) * len(unit.vertices))[:, None, None]
    return Shape(
        vertices.reshape(-1, 3),
        (unit.quads + offset).reshape(-1, 4),
        (unit.triangles + offset).reshape(-1, 3),
    )


def bent(shape: Shape) -> Shape:
    """A shape bent round the Z axis: its x becomes the angle in radians, its y the radius."""
    angle, radius, z = shape.vertices.T
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return Shape(vertices, shape.quads, shape.triangles, shape.slots)


def ring_of_stones(
    count: int, radius: float, width: float, z: float, height: float, span: float = 2 * pi
) -> Shape:
    """Wedge-shaped stones side by side round the Z axis, from angle 0 to `span`."""
    step = span / count
    angles = (np.arange(count) + 0.5) * step
    centers = np.column_stack([angles, np.full(count, radius), np.full(count, z)])
    gap = 0.006 / radius
    bevel = (0.012 / radius, 0.012, 0.012)
    return bent(blocks(centers, (step - gap, width, height), bevel))


def upright(shape: Shape) -> Shape:
    """A shape drawn in the XY plane put up into the XZ plane; its +Z now faces the court, −Y."""
    return shape.transformed(transform(rotation=(pi / 2, 0, 0)))


def arch_outline(
    half_width: float, sill: float, springing: float, rise: float, segments: int
) -> Array:
    """An arched opening (n, 2), counter-clockwise from its lower right corner."""
    angle = np.linspace(0, pi, segments + 1)
    arc = np.column_stack([half_width * np.cos(angle), springing + rise * np.sin(angle)])
    if sill >= springing:
        return arc
    return np.concatenate([[[half_width, sill]], arc, [[-half_width, sill]]])


def circle_outline(radius: float, z: float, segments: int) -> Array:
    angle = np.arange(segments) * (2 * pi / segments)
    return np.column_stack([radius * np.cos(angle), z + radius * np.sin(angle)])


def panel(width: float, bottom: float, top: float, opening: Array, thickness: float) -> Shape:
    """A wall round an opening: width along x about 0, front at y = 0, back at y = thickness.

    opening: an outline (n, 2) in x and z, counter-clockwise, that every ray from its middle meets
    once. It may touch the panel's edge. Both faces and the reveal are made.
    """
    middle = np.array([0.0, (opening[:, 1].min() + opening[:, 1].max()) / 2])
    corners = np.array([[1, bottom], [1, top], [-1, top], [-1, bottom]]) * [width / 2, 1] - middle
    inner = opening - middle
    crossings = [_ray_meets(inner, corner) for corner in corners]
    inner = np.concatenate([inner, crossings])
    inner = inner[np.argsort(np.arctan2(inner[:, 1], inner[:, 0]), kind="stable")]
    across = np.abs(inner[:, 0]) / (width / 2)
    along = inner[:, 1] / (np.where(inner[:, 1] > 0, top, bottom) - middle[1])
    outer = inner / np.maximum(across, along)[:, None]
    rings = [_wall_points(ring + middle, y) for y in (0, thickness) for ring in (inner, outer)]
    faces = [
        sheet(np.stack([rings[a], rings[b]]), closed=True) for a, b in ((0, 1), (3, 2), (2, 0))
    ]
    on_edge = np.isclose(np.maximum(across, along), 1)
    walled = ~(on_edge & np.roll(on_edge, -1))  # where the opening runs along the panel's edge
    return join(Shape(face.vertices, face.quads[walled]) for face in faces)


def _ray_meets(outline: Array, direction: Array) -> Array:
    """Where the ray from the origin crosses an outline round it."""
    start, along = outline, np.roll(outline, -1, axis=0) - outline
    cross = direction[0] * along[:, 1] - direction[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        where = (start[:, 0] * direction[1] - start[:, 1] * direction[0]) / cross
    hit = (reach > 0) & (where >= -1e-9) & (where <= 1 + 1e-9)
    return direction * reach[hit][0]


def _wall_points(outline: Array, y: float) -> Array:
    return np.column_stack([outline[:, 0], np.full(len(outline), y), outline[:, 1]])


def filled(outline: Array, y: float, thickness: float = 0.02) -> Shape:
    """A board or pane of an outline in x and z, its back at y."""
    return upright(prism(outline, thickness)).moved(0, y, 0)


def arch_stones(radius: float, depth: float, count: int, width: float = 0.2) -> Shape:
    """The voussoirs of a round arch about the origin, y from −depth / 2 to depth / 2."""
    return upright(ring_of_stones(count, radius + width / 2, width, 0.0, depth, pi))


def leaves(
    base: Array, direction: Array, face: Array, length: Array | float, width: float
) -> Shape:
    """Folded leaves of two triangles: base, direction and rough facing (n, 3), metres."""
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.cross(direction, face)
    across /= np.linalg.norm(across, axis=1, keepdims=True) + 1e-9
    up = np.cross(across, direction)
    length = np.broadcast_to(length, len(base))[:, None]
    middle = base + direction * length * 0.45
    lift = up * length * width * 0.3
    half = across * length * width / 2
    corners = np.stack(
        [base, middle - half + lift, base + direction * length, middle + half + lift]
    )
    vertices = corners.transpose(1, 0, 2).reshape(-1, 3)
    first = (np.arange(len(base)) * 4)[:, None]
    triangles = np.concatenate([first + np.array(half) for half in ([0, 2, 1], [0, 3, 2])])
    return Shape(vertices, triangles=triangles.astype(np.int32))


def unit_vectors(rng: Generator, count: int) -> Array:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def turned(angle: Array, x: Array, y: Array, z: Array, scale: Array | float = 1.0) -> Array:
    """Matrices (n, 4, 4) of a turn about Z, a scale, and a place."""
    angle = np.asarray(angle, float)
    m = np.zeros((len(angle), 4, 4))
    m[:, 0, 0] = m[:, 1, 1] = np.cos(angle) * scale
    m[:, 1, 0] = np.sin(angle) * scale
    m[:, 0, 1] = -m[:, 1, 0]
    m[:, 2, 2] = scale
    m[:, 3, 3] = 1
    m[:, 0, 3], m[:, 1, 3], m[:, 2, 3] = x, y, z
    return m


# --- Materials ------------------------------------------------------------------------------------


def matte(
    name: str,
    dark: Color,
    light: Color,
    scale: float = 3.0,
    bump: float = 0.004,
    bump_scale: float = 30.0,
    variety: float = 0.35,
) -> bpy.types.Material:
    """A rough surface: blotches between two colours, grain, and a shade for every single piece.

    A diffuse BSDF, with textures in world space: cheap, and no two instances are alike.
    """
    made, graph = material(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    blotches = graph.span(graph.noise(position, scale, 2.0, 0.6), 0, 1, 0.3, 0.7)
    color = graph.mix(blotches, dark, light)
    color = piecewise(graph, color, variety)
    grain = graph.noise(position, bump_scale, 1.0)
    surface = graph.add(
        "ShaderNodeBsdfDiffuse", {"Color": color, "Normal": graph.bump(grain, bump)}
    )
    return finish(made, graph, surface)


def piecewise(graph: Graph, color: Any, variety: float) -> bpy.types.NodeSocket:
    """A colour made darker or lighter for each connected piece of each object."""
    total = graph.math("ADD", graph.island_random(), graph.object_random())
    shade = graph.span(graph.math("FRACT", total), 1 - variety, 1 + variety / 2)
    return graph.mix(1.0, color, shade, "MULTIPLY")


def masonry(
    name: str, dark: Color, light: Color, mortar: Color, brick: tuple[float, float], gap: float
) -> bpy.types.Material:
    """Courses of brick or stone on upright walls along the axes; brick is width and height."""
    made, graph = material(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    xyz = graph.xyz(position)
    along = graph.math("ADD", xyz["X"], xyz["Y"])
    flat = graph.add("ShaderNodeCombineXYZ", {"X": along, "Y": xyz["Z"]})
    stains = graph.noise(position, 0.9, 2.0, 0.65)
    shade = graph.span(stains, 0.7, 1.15, 0.3, 0.7)
    bricks = graph.add(
        "ShaderNodeTexBrick",
        {
            "Vector": flat,
            "Color1": dark,
            "Color2": light,
            "Mortar": mortar,
            "Scale": 1.0,
            "Mortar Size": gap,
            "Mortar Smooth": 0.3,
            "Brick Width": brick[0],
            "Row Height": brick[1],
        },
    )
    color = graph.mix(1.0, bricks.outputs["Color"], shade, "MULTIPLY")
    joints = graph.bump(bricks.outputs["Fac"], -0.012)
    surface = graph.add("ShaderNodeBsdfDiffuse", {"Color": color, "Normal": joints})
    return finish(made, graph, surface)


def plaster(name: str, color: Color, worn: Color) -> bpy.types.Material:
    """Old plaster: worn patches, and streaks that the rain drew downwards."""
    made, graph = material(name)
    position = graph.add("ShaderNodeNewGeometry").outputs["Position"]
    patches = graph.span(graph.noise(position, 0.7, 3.0, 0.65), 0, 1, 0.42, 0.62)
    stretched = graph.add(
        "ShaderNodeVectorMath", {0: position, 1: (5.0, 5.0, 0.35)}, operation="MULTIPLY"
    )
    streaks = graph.span(graph.noise(stretched, 1.0, 2.0), 0.7, 1.1, 0.3, 0.65)
    mixed = graph.mix(1.0, graph.mix(patches, color, worn), streaks, "MULTIPLY")
    grain = graph.noise(position, 14.0, 2.0)
    surface = graph.add(
        "ShaderNodeBsdfDiffuse", {"Color": mixed, "Normal": graph.bump(grain, 0.01)}
    )
    return finish(made, graph, surface)


def foliage(name: str, dark: Color, light: Color, shine_through: float = 0.35) -> Any:
    """Thin leaves: each its own green, partly lit from behind."""
    made, graph = material(name)
    total = graph.math("ADD", graph.island_random(), graph.object_random())
    color = graph.mix(graph.math("FRACT", total), dark, light)
    front = graph.add("ShaderNodeBsdfDiffuse", {"Color": color})
    back = graph.add("ShaderNodeBsdfTranslucent", {"Color": color})
    surface = graph.add("ShaderNodeMixShader", {0: shine_through, 1: front, 2: back})
    return finish(made, graph, surface)


def make_materials() -> dict[str, bpy.types.Material]:
    """The palette: warm limestone, ochre plaster, brick and terracotta, and greens."""
    made = [
        matte("Limestone", (0.40, 0.33, 0.24), (0.58, 0.50, 0.38), 4.0),
        matte("Carved stone", (0.42, 0.35, 0.26), (0.62, 0.54, 0.42), 5.0, variety=0.15),
        matte("Paving", (0.25, 0.21, 0.17), (0.44, 0.38, 0.31), 2.5, variety=0.45),
        matte("Terracotta floor", (0.27, 0.11, 0.06), (0.40, 0.19, 0.11), 3.0, variety=0.4),
        matte("Roof tile", (0.26, 0.10, 0.05), (0.50, 0.25, 0.14), 2.5, 0.003, 60.0, 0.55),
        matte("Pot", (0.38, 0.15, 0.08), (0.50, 0.23, 0.13), 6.0, 0.002),
        matte("Soil", (0.06, 0.04, 0.025), (0.13, 0.09, 0.055), 5.0, 0.03, 25.0),
        matte("Turf", (0.035, 0.055, 0.012), (0.09, 0.10, 0.03), 3.0, 0.03, 25.0),
        matte("Dry earth", (0.24, 0.19, 0.13), (0.34, 0.28, 0.20), 2.0, 0.015, 20.0),
        matte("Wood", (0.10, 0.055, 0.028), (0.20, 0.115, 0.06), 9.0, 0.004, 50.0, 0.4),
        matte("Bark", (0.09, 0.07, 0.05), (0.22, 0.18, 0.14), 9.0, 0.02, 22.0),
        matte("Iron", (0.02, 0.02, 0.02), (0.07, 0.05, 0.04), 20.0, 0.002),
        matte("Lead", (0.16, 0.15, 0.14), (0.26, 0.25, 0.24), 4.0, 0.002),
        matte("Rope", (0.30, 0.22, 0.12), (0.45, 0.35, 0.20), 40.0, 0.003),
        matte("Robe", (0.075, 0.042, 0.022), (0.115, 0.066, 0.036), 6.0, 0.0008, 150.0, 0.0),
        matte("Skin", (0.45, 0.25, 0.16), (0.50, 0.29, 0.19), 10.0, 0.0005, 60.0, 0.0),
        masonry(
            "Brick", (0.33, 0.14, 0.08), (0.50, 0.27, 0.16), (0.42, 0.36, 0.28), (0.30, 0.075), 0.01
        ),
        masonry(
            "Ashlar", (0.36, 0.29, 0.20), (0.52, 0.43, 0.31), (0.30, 0.25, 0.19), (0.60, 0.29), 0.01
        ),
        plaster("Plaster", (0.62, 0.47, 0.29), (0.44, 0.36, 0.26)),
        plaster("Whitewash", (0.70, 0.65, 0.56), (0.55, 0.47, 0.37)),
        foliage("Grass", (0.055, 0.10, 0.018), (0.15, 0.19, 0.045)),
        foliage("Olive leaf", (0.075, 0.10, 0.045), (0.21, 0.24, 0.14)),
        foliage("Box leaf", (0.03, 0.075, 0.016), (0.10, 0.17, 0.035), 0.15),
        foliage("Cypress leaf", (0.018, 0.045, 0.016), (0.055, 0.10, 0.032), 0.15),
        foliage("Ivy leaf", (0.02, 0.06, 0.014), (0.10, 0.17, 0.04)),
        foliage("Lavender", (0.14, 0.07, 0.30), (0.30, 0.17, 0.50)),
        foliage("Petal", (0.50, 0.015, 0.02), (0.75, 0.06, 0.07)),
        foliage("Daisy", (0.75, 0.72, 0.65), (0.85, 0.83, 0.78)),
        foliage("Dead leaf", (0.16, 0.08, 0.03), (0.35, 0.22, 0.08)),
        plain("Glass", (0.02, 0.025, 0.03), Roughness=0.08),
        plain("Water", (0.01, 0.015, 0.012), Roughness=0.02),
        plain("Bronze", (0.28, 0.17, 0.07), Metallic=1.0, Roughness=0.45),
    ]
    return {each.name: each for each in made}


# --- Sky and ground -------------------------------------------------------------------------------


def sky(site: Site) -> None:
    """A low sun in the west-south-west and the physical sky that belongs to it.

    The camera alone sees thin clouds: they cost the lighting nothing.
    """
    sun_light("Sun", SUN_AZIMUTH, SUN_ELEVATION, SUN_STRENGTH, (1.0, 0.80, 0.56), radians(0.6))
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    graph = Graph(world.node_tree)
    blue = graph.add(
        "ShaderNodeTexSky",
        sky_type="MULTIPLE_SCATTERING",
        sun_disc=False,
        sun_elevation=SUN_ELEVATION,
        sun_rotation=pi / 2 - SUN_AZIMUTH,  # counted from +Y, clockwise
        aerosol_density=0.6,
    )
    lighting = graph.add("ShaderNodeBackground", {"Color": blue, "Strength": SKY_STRENGTH})
    direction = graph.add("ShaderNodeTexCoord").outputs["Generated"]
    xyz = graph.xyz(direction)
    height = graph.math("MAXIMUM", xyz["Z"], 0.05)
    plane = graph.add("ShaderNodeVectorMath", {0: direction, 1: height}, operation="DIVIDE")
    drawn_out = graph.add(
        "ShaderNodeVectorMath", {0: plane, 1: (0.5, 1.3, 1.0)}, operation="MULTIPLY"
    )
    wisps = graph.noise(drawn_out, 1.1, 6.0, 0.62, 0.35)
    cover = graph.span(wisps, 0.0, 0.7, 0.50, 0.78)
    seen = graph.mix(cover, blue, (9.0, 8.6, 8.2))
    with_clouds = graph.add("ShaderNodeBackground", {"Color": seen, "Strength": SKY_STRENGTH})
    camera = graph.add("ShaderNodeLightPath").outputs["Is Camera Ray"]
    surface = graph.add("ShaderNodeMixShader", {0: camera, 1: lighting, 2: with_clouds})
    graph.add("ShaderNodeOutputWorld", {"Surface": surface})


def ground(site: Site) -> None:
    """The earth under the court, and the country round it."""
    add("Ground", grid([-120, 120], [-120, 120]).moved(0, 0, -0.03), *site.of("Dry earth"))


def slab_rows(
    rng: Generator, x: tuple[float, float], y: tuple[float, float], depth: float, length: float
) -> tuple[Array, Array]:
    """Slabs laid in rows over a rectangle: centers and sizes (n, 2), joints left open."""
    rows = max(1, round((y[1] - y[0]) / depth))
    edges = np.linspace(*y, rows + 1)
    centers, sizes = [], []
    for low, high in pairwise(edges):
        count = max(1, round((x[1] - x[0]) / length))
        cuts = np.linspace(*x, count + 1)
        cuts[1:-1] += rng.uniform(-0.22, 0.22, count - 1) * length
        for left, right in pairwise(cuts):
            centers.append(((left + right) / 2, (low + high) / 2))
            sizes.append((right - left - 0.014, high - low - 0.014))
    return np.array(centers), np.array(sizes)


def slabs(rng: Generator, centers: Array, sizes: Array, top: float, unevenness: float) -> Shape:
    """Paving stones 12 cm thick, each a little higher or lower than its neighbours."""
    n = len(centers)
    heights = top - 0.06 + rng.uniform(-unevenness, unevenness, n)
    return blocks(
        np.column_stack([centers, heights]), np.column_stack([sizes, np.full(n, 0.12)]), 0.012
    )


def paving(site: Site) -> None:
    """The paths along the arcades and to the well, its plaza, and the floors of the walks."""
    rng = site.random("paving")
    length = 0.52 / sqrt(min(1.0, site.detail))
    outer = ARCADE - 0.25
    stones = []
    for number in range(4):
        rim = slab_rows(rng, (-outer, LAWN), (LAWN, outer), 0.4, length)
        spoke = slab_rows(rng, (-CROSS_PATH, CROSS_PATH), (PLAZA - 0.1, LAWN), 0.42, length)
        outside = np.hypot(*spoke[0].T) > PLAZA + 0.16
        parts = [slabs(rng, *rim, 0.015, 0.006)]
        parts.append(slabs(rng, spoke[0][outside], spoke[1][outside], 0.015, 0.006))
        stones.append(join(parts).transformed(transform(rotation=(0, 0, number * pi / 2))))
    for radius in np.linspace(1.0, PLAZA - 0.145, 5):
        count = max(8, round(2 * pi * radius / length))
        ring = ring_of_stones(count, radius, 0.28, -0.045, 0.12)
        stones.append(ring.transformed(transform(rotation=(0, 0, rng.uniform(0, 1)))))
    add("Court paving", join(stones), *site.of("Paving"), matrix=side(NORTH), smooth=False)

    near, far = ARCADE - 0.25, BACK + 0.1
    tiles = []
    for number in range(4):
        floor = slab_rows(rng, (-far, near), (near, far), 0.3, 0.3 / sqrt(min(1, site.detail)))
        turn = transform(rotation=(0, 0, number * pi / 2))
        tiles.append(slabs(rng, *floor, WALK_FLOOR, 0.003).transformed(turn))
        doorstep = blocks((0, near - 0.15, 0.03), (1.75, 0.34, 0.1), 0.015)
        tiles.append(doorstep.painted(1).transformed(turn))
    add("Walk floors", join(tiles), *site.of("Terracotta floor", "Paving"), matrix=side(NORTH))


def lawns(site: Site) -> None:
    """Four lawns of turf and grass within kerbs; the corner next to the well is cut round."""
    rng = site.random("lawns")
    inner = CROSS_PATH
    cells = 16
    cell = (LAWN - inner) / cells
    patches = [grass_patch(site, rng, cell) for _ in range(6)]
    turf, kerbs = [], []
    along = np.linspace(inner, LAWN, 25)
    for number in range(4):
        turn = transform(rotation=(0, 0, number * pi / 2))
        gx, gy = np.meshgrid(along, along)
        bumps = -0.01 + 0.012 * noise(np.stack([gx, gy, gx * 0 + number], -1) * 1.5, site.seed)
        sunk = np.where(np.hypot(gx, gy) < PLAZA - 0.2, -0.1, bumps)
        turf.append(grid(along, along, sunk).transformed(turn))
        kerbs.append(lawn_kerb(inner).transformed(turn))
        for i, j in np.ndindex(cells, cells):
            x, y = inner + (i + 0.5) * cell, inner + (j + 0.5) * cell
            if hypot(x, y) < PLAZA + 0.3:
                continue
            stand = side(number) @ transform(
                (x, y, 0.0),
                (0, 0, int(rng.integers(4)) * pi / 2),
                (1, 1, float(rng.uniform(0.75, 1.15))),
            )
            place(f"Grass.{number}.{i}.{j}", patches[int(rng.integers(len(patches)))], stand)
    add("Turf", join(turf), *site.of("Turf"), matrix=side(NORTH))
    add("Kerbs", join(kerbs), *site.of("Limestone"), matrix=side(NORTH), smooth=False)


def lawn_kerb(inner: float) -> Shape:
    """Kerb stones round a lawn in the quadrant x, y > 0, and round its cut corner."""
    start = sqrt(PLAZA**2 - inner**2)
    count = 9
    step = (LAWN - start) / count
    run = start + (np.arange(count) + 0.5) * step
    line = np.full(count, inner)
    edge = inner + (np.arange(count) + 0.5) * (LAWN - inner) / count
    long, short = step - 0.01, 0.1
    size_x, size_y = (long, short, 0.14), (short, long, 0.14)
    full = (LAWN - inner) / count - 0.01
    parts = [
        blocks(np.column_stack([run, line, run * 0]), size_x),
        blocks(np.column_stack([line, run, run * 0]), size_y),
        blocks(np.column_stack([edge, edge * 0 + LAWN, edge * 0]), (full, short, 0.14)),
        blocks(np.column_stack([edge * 0 + LAWN, edge, edge * 0]), (short, full, 0.14)),
    ]
    first = np.arcsin(inner / PLAZA)
    arc = ring_of_stones(5, PLAZA + 0.05, 0.1, 0.0, 0.14, pi / 2 - 2 * first)
    parts.append(arc.transformed(transform(rotation=(0, 0, first))))
    return join(parts)


def grass_patch(site: Site, rng: Generator, cell: float) -> bpy.types.Mesh:
    """A square of grass blades, with a daisy here and there."""
    n = site.count(150)
    foot = np.column_stack([rng.uniform(-cell / 2, cell / 2, (n, 2)), np.full(n, -0.01)])
    lean = rng.normal(0, 0.35, (n, 2))
    height = rng.uniform(0.035, 0.085, n)
    width = rng.uniform(0.002, 0.0045, n)
    heading = rng.uniform(0, 2 * pi, n)
    across = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)]) * width[:, None]
    middle = foot + np.column_stack([lean * 0.35, np.ones(n)]) * height[:, None] * 0.6
    tip = foot + np.column_stack([lean, np.ones(n)]) * height[:, None]
    points = np.stack([foot - across, foot + across, middle + across * 0.8, middle - across * 0.8])
    points = np.concatenate([points, tip[None]]).transpose(1, 0, 2).reshape(-1, 3)
    first = (np.arange(n) * 5)[:, None]
    blades = Shape(points, first + np.array([[0, 1, 2, 3]]), first + np.array([[3, 2, 4]]))

    parts = [blades]
    for _ in range(int(rng.integers(0, 2))):
        x, y = rng.uniform(-cell / 2, cell / 2, 2)
        angle = np.arange(8) * pi / 4
        around = np.column_stack([np.cos(angle), np.sin(angle), np.full(8, 0.25)])
        center = np.tile([x, y, 0.07], (8, 1))
        petals = leaves(center, around, np.tile([0.0, 0.0, 1.0], (8, 1)), 0.013, 0.5)
        parts.append(petals.painted(1))
    return mesh("Grass", join(parts), *site.of("Grass", "Daisy"), smooth=False)


# --- The well -------------------------------------------------------------------------------------


def well(site: Site) -> None:
    """Steps, a ring of stones, and an iron arch that carries pulley, rope and bucket."""
    n = site.segments(24)
    stone = [
        ring_of_stones(20, 1.20, 0.62, 0.08, 0.16),
        ring_of_stones(16, 0.98, 0.42, 0.22, 0.16),
    ]
    for course, (z, height) in enumerate([(0.42, 0.24), (0.655, 0.22), (0.87, 0.2)]):
        turn = transform(rotation=(0, 0, 0.2 * course))
        stone.append(ring_of_stones(14, 0.68, 0.2, z, height).transformed(turn))
    stone.append(ring_of_stones(10, 0.69, 0.32, 1.035, 0.12))
    add("Well", join(stone), *site.of("Limestone"), matrix=side(NORTH), smooth=False)
    lining = lathe([(0.585, 0.0), (0.585, 0.96)], n, capped=False)
    add("Well lining", lining, *site.of("Limestone"), matrix=side(NORTH))
    water = lathe([(0.59, 0.30), (0.58, 0.31)], n)
    add("Well water", water, *site.of("Water"), matrix=side(NORTH))

    angle = np.linspace(0, pi, site.segments(24) + 1)
    arc = np.column_stack([0.68 * np.cos(angle), 0 * angle, 2.25 + 0.45 * np.sin(angle)])
    hoop = np.concatenate([[[0.68, 0, 1.08]], arc, [[-0.68, 0, 1.08]]])
    iron = [tube(hoop, 0.022, 8)]
    for x in (-0.68, 0.68):
        iron.append(lathe([(0.06, 1.09), (0.05, 1.12), (0.03, 1.14)], n).moved(x, 0, 0))
        curl = np.linspace(0, 1.6 * pi, site.segments(20))
        spiral = np.column_stack(
            [
                np.sign(-x) * (0.18 - 0.14 * curl / 5 * np.cos(curl)),
                0 * curl,
                2.2 + 0.14 * curl / 5 * np.sin(curl),
            ]
        )
        iron.append(tube(spiral, 0.01, 6).moved(x, 0, 0))
    iron.append(tube([(0, 0, 2.7), (0, 0, 2.85), (0, 0, 3.05)], 0.016, 6))
    iron.append(tube([(-0.1, 0, 2.95), (0.1, 0, 2.95)], 0.014, 6))
    iron.append(tube([(0, 0, 2.70), (0, 0, 2.52)], 0.012, 6))
    add("Well iron", join(iron), *site.of("Iron"), matrix=side(NORTH), smooth=SHARP)
    wheel = lathe([(0.02, -0.03), (0.12, -0.03), (0.09, 0), (0.12, 0.03), (0.02, 0.03)], n)
    pulley = upright(wheel).moved(0, 0, 2.42)
    add("Pulley", pulley, *site.of("Wood"), matrix=side(NORTH), smooth=SHARP)

    hanging = [(0.10, 0, 2.42), (0.10, 0, 2.0), (0.10, 0.01, 1.62)]
    over = [(0.1 * cos(a), 0, 2.42 + 0.1 * sin(a)) for a in np.linspace(pi, 0, 9)]
    slack = [(-0.3, 0.3, 1.13), (-0.22, 0.2, 1.3), (-0.12, 0.04, 1.9)]
    rope = tube([*slack, *over, *hanging], 0.013, 6)
    coil_angle = np.linspace(0, 8 * pi, site.segments(90))
    coil = np.column_stack(
        [0.13 * np.cos(coil_angle), 0.13 * np.sin(coil_angle), 0.0012 * coil_angle * 8 / pi]
    )
    ropes = [rope, tube(coil, 0.013, 6).moved(-0.43, 0.53, 1.11)]
    add("Well rope", join(ropes), *site.of("Rope"), matrix=side(NORTH))
    bucket(site, side(NORTH) @ transform((0.10, 0.01, 1.25)))
    bucket(site, side(NORTH) @ transform((1.02, -0.62, 0.305), (0, 0, 0.6)))


def bucket(site: Site, matrix: Matrix) -> None:
    """A wooden bucket of staves with iron hoops and a handle; stands on its origin."""
    staves = ring_of_stones(14, 0.12, 0.018, 0.13, 0.26)
    flare = 1 + 0.35 * staves.vertices[:, 2:] * np.array([1, 1, 0])
    wood = Shape(staves.vertices * flare, staves.quads, staves.triangles)
    bottom = lathe([(0.115, 0.02), (0.115, 0.03)], 14)
    hoops = [
        lathe([(r, z), (r + 0.004, z), (r + 0.004, z + 0.025), (r, z + 0.025)], 20, capped=False)
        for r, z in ((0.134, 0.05), (0.143, 0.19))
    ]
    angle = np.linspace(0, pi, 13)
    handle = tube(
        np.column_stack([0.14 * np.cos(angle), 0 * angle, 0.25 + 0.12 * np.sin(angle)]), 0.006, 6
    )
    shape = join([wood, bottom, *(part.painted(1) for part in (*hoops, handle))])
    add("Bucket", shape, *site.of("Wood", "Iron"), matrix=matrix, smooth=SHARP)


# --- Arcades and vaults ---------------------------------------------------------------------------


def arcades(site: Site) -> None:
    """Each side: a low wall, twin columns, round arches with voussoirs, and a cornice."""
    bay = mesh("Arcade bay", arcade_bay(site), *site.of("Plaster", "Limestone"), smooth=SHARP)
    column = mesh("Column", twin_column(site), *site.of("Carved stone"), smooth=SHARP)
    pier = mesh("Pier", corner_pier(), *site.of("Ashlar", "Carved stone"), smooth=SHARP)
    cornice = mesh("Cornice", arcade_cornice(), *site.of("Limestone"), smooth=SHARP)
    low_wall = mesh("Stylobate", stylobate(site), *site.of("Limestone"), smooth=False)
    for number in range(4):
        for i in range(BAYS):
            x = (i - (BAYS - 1) / 2) * BAY
            place(f"Arcade.{number}{i}", bay, side(number) @ transform((x, ARCADE, SPRINGING)))
        for i in range(1, BAYS):
            stand = (i * BAY - ARCADE, ARCADE, STYLOBATE)
            place(f"Column.{number}{i}", column, side(number) @ transform(stand))
        place(f"Pier.{number}", pier, side(number) @ transform((-ARCADE, ARCADE, 0)))
        place(f"Cornice.{number}", cornice, side(number))
        place(f"Stylobate.{number}", low_wall, side(number))


def arcade_bay(site: Site) -> Shape:
    """The wall over one arch, its origin at the springing in the wall's axis."""
    n = site.segments(24)
    opening = arch_outline(ARCH_RADIUS, 0.0, 0.0, ARCH_RADIUS, n)
    wall = panel(BAY, 0.0, ARCADE_TOP - SPRINGING, opening, ARCADE_WALL - 0.06)
    wall = wall.moved(0, -ARCADE_WALL / 2 + 0.03, 0)
    stones = arch_stones(ARCH_RADIUS - 0.015, ARCADE_WALL + 0.02, 15, 0.2).painted(1)
    angle = np.linspace(0, pi, n + 1)
    parts = [wall, stones]
    for y, radius in ((-ARCADE_WALL / 2 + 0.01, 0.035), (ARCADE_WALL / 2 - 0.01, 0.035)):
        r = ARCH_RADIUS + 0.205
        r = min(r, BAY / 2 - 0.001)
        hood = np.column_stack([r * np.cos(angle), 0 * angle + y, r * np.sin(angle)])
        parts.append(tube(hood, radius, site.segments(8)).painted(1))
    return join(parts)


def twin_column(site: Site) -> Shape:
    """Two slender columns, one behind the other, under one impost; stands on its origin."""
    n = site.segments(20, 6)
    one = join([column_shaft(n), capital(site)])
    slab = blocks((0, 0, 0.03), (0.32, 0.60, 0.06), 0.012)
    low, high = 1.70, SPRINGING - STYLOBATE
    impost = frustum_box((0.26, 0.50), (0.36, 0.58), low, low + 0.07)
    top = blocks((0, 0, (low + 0.07 + high) / 2), (0.37, 0.60, high - low - 0.07), 0.01)
    return join([one.moved(0, -0.15, 0), one.moved(0, 0.15, 0), slab, impost, top])


def frustum_box(
    lower: tuple[float, float], upper: tuple[float, float], z0: float, z1: float
) -> Shape:
    """A block with sloping sides: sizes (x, y) below at z0 and above at z1."""
    unit = box((1, 1, 1))
    size = np.where(unit.vertices[:, 2:] < 0, [lower], [upper])
    z = np.where(unit.vertices[:, 2] < 0, z0, z1)
    return Shape(np.column_stack([unit.vertices[:, :2] * size, z]), unit.quads)


def column_shaft(segments: int) -> Shape:
    """Plinth, Attic base, and a tapering shaft."""
    profile = [(0.125, 0.115)]
    profile += [(0.118 + 0.018 * cos(a), 0.14 + 0.024 * sin(a)) for a in np.linspace(-1.5, 1.5, 6)]
    profile += [(0.112, 0.17), (0.104, 0.185), (0.106, 0.2)]
    profile += [(0.104 + 0.012 * cos(a), 0.214 + 0.014 * sin(a)) for a in np.linspace(-1.5, 1.5, 5)]
    profile += [(0.098, 0.235)]
    profile += [(0.098 - 0.014 * t**1.6, 0.24 + 1.08 * t) for t in np.linspace(0, 1, 7)]
    profile += [(0.084 + 0.014 * cos(a), 1.335 + 0.014 * sin(a)) for a in np.linspace(-1.5, 1.5, 5)]
    plinth = blocks((0, 0, 0.088), (0.27, 0.27, 0.06), 0.008)
    return join([lathe(profile, segments), plinth])


def capital(site: Site) -> Shape:
    """A bell with two rows of leaves and four corner leaves, under a square abacus."""
    heights = np.linspace(0, 1, 6)
    bell = lathe([(0.085 + 0.055 * t**2.2, 1.34 + 0.29 * t) for t in heights], 16)
    count = site.segments(7, 3)
    parts = [bell, blocks((0, 0, 1.665), (0.285, 0.285, 0.07), 0.01)]
    for size, first, reach, total in ((0.15, 1.345, 0.035, 8), (0.2, 1.40, 0.05, 8)):
        for i in range(total):
            turn = (i + (0.5 if size > 0.18 else 0)) * 2 * pi / total
            corner = size > 0.18 and i % 2 == 0
            leaf = capital_leaf(count, first, size, reach * (1.6 if corner else 1.0))
            parts.append(leaf.transformed(transform(rotation=(0, 0, turn + pi / 8))))
    return join(parts)


def capital_leaf(count: int, foot: float, height: float, reach: float) -> Shape:
    """One carved leaf that leans out along +X and curls over at its tip."""
    t = np.linspace(0, 1, count + 1)[:, None]
    across = np.linspace(-1, 1, 5)[None, :]
    width = 0.034 * np.sin(pi * np.clip(0.25 + 0.75 * t, 0, 1)) ** 0.5 + 0.004
    rib = 0.006 * (1 - np.abs(across))
    out = 0.088 + 0.05 * t**2.2 + reach * t**3 + rib
    z = foot + height * (t - 0.42 * t**4) + 0 * across
    y = width * across
    return sheet(np.stack([out - 0.3 * np.abs(y), y + 0 * t, z], axis=-1))


def corner_pier() -> Shape:
    """The square pier where two arcades meet; stands on its origin."""
    size = 0.66
    shaft = box((size, size, SPRINGING - 0.5)).moved(0, 0, 0.35 + (SPRINGING - 0.5) / 2)
    base = [
        blocks((0, 0, 0.2), (0.80, 0.80, 0.46), 0.02),
        frustum_box((0.78, 0.78), (size, size), 0.43, 0.50),
    ]
    head = [
        frustum_box((size, size), (0.76, 0.76), SPRINGING - 0.22, SPRINGING - 0.12),
        blocks((0, 0, SPRINGING - 0.06), (0.78, 0.78, 0.12), 0.015),
    ]
    above = box((0.56, 0.56, ARCADE_TOP - SPRINGING)).moved(0, 0, (ARCADE_TOP + SPRINGING) / 2)
    return join([shaft, above, *(part.painted(1) for part in base + head)])


def stylobate(site: Site) -> Shape:
    """The low wall under a side's columns, in stones, open at the middle bay."""
    rng = site.random("stylobate")
    gate = BAY / 2 - 0.20
    ends = ARCADE - 0.38
    parts = []
    for sign in (-1, 1):
        for course, z in enumerate((0.13, 0.38)):
            edges = np.linspace(gate, ends, 11)
            edges[1:-1] += rng.uniform(-0.1, 0.1, 9) + (0.15 if course else -0.15)
            middle, length = (edges[1:] + edges[:-1]) / 2, np.diff(edges) - 0.008
            centers = np.column_stack([sign * middle, 0 * middle + ARCADE, 0 * middle + z])
            sizes = np.column_stack([length, 0 * length + 0.54, 0 * length + 0.246])
            parts.append(blocks(centers, sizes, 0.014))
        edges = np.linspace(gate - 0.03, ends, 7)
        middle = sign * (edges[1:] + edges[:-1]) / 2
        centers = np.column_stack([middle, 0 * middle + ARCADE, 0 * middle + 0.552])
        parts.append(blocks(centers, (edges[1] - edges[0] - 0.006, 0.66, 0.096), 0.02))
    return join(parts)


def arcade_cornice() -> Shape:
    """A row of stone dentils between two strings, under the eaves of one side."""
    front = ARCADE - ARCADE_WALL / 2
    strings = [
        blocks((0, front, ARCADE_TOP - 0.28), (2 * front + 0.1, 0.13, 0.06), 0.012),
        blocks((0, front, ARCADE_TOP - 0.10), (2 * front + 0.1, 0.20, 0.07), 0.015),
    ]
    x = np.arange(-front + 0.12, front - 0.05, 0.2)
    centers = np.column_stack([x, 0 * x + front - 0.03, 0 * x + ARCADE_TOP - 0.19])
    return join([*strings, blocks(centers, (0.09, 0.12, 0.11), 0.008)])


def vaults(site: Site) -> None:
    """Groin vaults with ribs and bosses over the walks, and an arch before each corner."""
    middle = (ARCADE + ARCADE_WALL / 2 + BACK) / 2
    bay = mesh("Vault", vault(site, BAY, WALK), *site.of("Whitewash", "Limestone"), smooth=SHARP)
    corner = mesh("Corner vault", vault(site, WALK, WALK), *site.of("Whitewash", "Limestone"))
    opening = arch_outline(WALK / 2 - 0.12, 0.0, 0.0, VAULT_RISE - 0.08, site.segments(20))
    arch = panel(WALK, 0.0, 1.2, opening, ARCADE_WALL)
    arch = arch.transformed(transform((-ARCADE_WALL / 2, 0, 0), (0, 0, -pi / 2)))
    across = mesh("Corner arch", arch, *site.of("Limestone"), smooth=SHARP)
    bracket = mesh("Corbel", corbel(site), *site.of("Carved stone"), smooth=SHARP)
    for number in range(4):
        for i in range(BAYS):
            x = (i - (BAYS - 1) / 2) * BAY
            place(f"Vault.{number}{i}", bay, side(number) @ transform((x, middle, SPRINGING)))
        for i in range(BAYS + 1):
            at = (i * BAY - ARCADE, BACK, SPRINGING)
            place(f"Corbel.{number}{i}", bracket, side(number) @ transform(at))
        at = (middle, middle, SPRINGING)
        place(f"Corner vault.{number}", corner, side(number) @ transform(at))
        for sign in (-1, 1):
            at = (sign * ARCADE, middle, SPRINGING)
            place(f"Corner arch.{number}{sign}", across, side(number) @ transform(at))


def vault(site: Site, length: float, width: float) -> Shape:
    """The higher of two crossing elliptic barrels over a bay, with ribs along its groins."""
    n = site.segments(20, 6) // 2 * 2
    a, b = length / 2, width / 2
    arc = np.sin(np.linspace(-pi / 2, pi / 2, n + 1))
    x, y = np.meshgrid(a * arc, b * arc)
    barrels = [np.sqrt(np.clip(1 - (x / a) ** 2, 0, 1)), np.sqrt(np.clip(1 - (y / b) ** 2, 0, 1))]
    parts = [grid(a * arc, b * arc, VAULT_RISE * np.maximum(*barrels))]
    t = np.linspace(-1, 1, 2 * n + 1)
    lift = VAULT_RISE * np.sqrt(1 - t**2)
    sides = site.segments(8)
    for sign in (-1, 1):
        groin = np.column_stack([a * t, sign * b * t, lift - 0.02])
        parts.append(tube(groin, 0.05, sides).painted(1))
        transverse = np.column_stack([0 * t + sign * a, b * t, lift - 0.02])
        parts.append(tube(transverse, 0.07, sides).painted(1))
    boss = lathe([(0.03, -0.1), (0.08, -0.09), (0.12, -0.05), (0.13, 0.0)], site.segments(16))
    parts.append(boss.moved(0, 0, VAULT_RISE - 0.02).painted(1))
    return join(parts)


def corbel(site: Site) -> Shape:
    """The bracket on the back wall from which the ribs spring, its top at the origin."""
    half = lathe([(0.02, -0.34), (0.05, -0.31), (0.07, -0.2), (0.13, -0.1), (0.14, -0.09)], 12)
    return join([half, blocks((0, 0, -0.045), (0.34, 0.34, 0.09), 0.012)])


# --- Walls, doors and windows ---------------------------------------------------------------------


def window(outline: Array, y: float, bars: int) -> Shape:
    """A pane (slot 0) with a lattice of lead bars (slot 1) in an opening, at depth y."""
    low, high = outline.min(0), outline.max(0)
    middle, size = (low + high) / 2, high - low
    vertical = np.linspace(low[0], high[0], bars + 2)[1:-1]
    horizontal = np.arange(low[1] + 0.25, high[1] - 0.1, 0.25)
    centers = [(x, y - 0.03, middle[1]) for x in vertical]
    centers += [(middle[0], y - 0.03, z) for z in horizontal]
    sizes = [(0.02, 0.025, size[1])] * len(vertical) + [(size[0], 0.025, 0.02)] * len(horizontal)
    return join([filled(outline, y), blocks(centers, sizes, 0.003).painted(1)])


def surround(opening: Array, width: float, proud: float) -> Shape:
    """A flat stone frame round an arched opening, standing out of the wall at y = 0."""
    middle = np.array([0.0, (opening[:, 1].min() + opening[:, 1].max()) / 2])
    size = np.ptp(opening, axis=0) / 2
    outer = middle + (opening - middle) * (1 + width / size)
    rings = [
        _wall_points(opening, 0.02),
        _wall_points(opening, -proud),
        _wall_points(outer, -proud),
        _wall_points(outer, 0.02),
    ]
    return sheet(np.stack(rings[::-1]), closed=True)


def door(outline: Array, y: float) -> Shape:
    """Planks (slot 0) with iron straps, nails and a ring (slot 1) filling an arched opening."""
    low, high = outline.min(0), outline.max(0)
    edges = np.linspace(low[0], high[0], 8)
    right = outline[outline[:, 0].argsort()]
    planks = [filled(outline, y + 0.03)]
    for left_x, right_x in pairwise(edges):
        tops = np.interp([left_x + 0.004, right_x - 0.004], right[:, 0], right[:, 1])
        tops = np.maximum(tops, low[1] + 1.7)
        board = [
            (left_x + 0.004, low[1]),
            (right_x - 0.004, low[1]),
            (right_x - 0.004, tops[1]),
            (left_x + 0.004, tops[0]),
        ]
        planks.append(filled(np.array(board), y, 0.05))
    height = high[1] - low[1]
    straps, nails = [], []
    for z in (low[1] + 0.2 * height, low[1] + 0.65 * height):
        straps.append(blocks((0, y - 0.055, z), (0.86 * (high[0] - low[0]), 0.012, 0.06), 0.004))
        nails += [(x, y - 0.064, z) for x in (edges[1:] + edges[:-1]) / 2]
    iron = [*straps, blocks(nails, (0.022, 0.014, 0.022), 0.006)]
    angle = np.linspace(0, 2 * pi, 17)
    ring = np.column_stack([0.05 * np.cos(angle), 0 * angle, 0.05 * np.sin(angle)])
    iron.append(tube(ring, 0.008, 6).moved(0.3, y - 0.075, low[1] + 0.95))
    return join([*planks, *(part.painted(1) for part in iron)])


def back_walls(site: Site) -> None:
    """The walls behind the walks: whitewashed, with doors, windows and niches by turns."""
    n = site.segments(16)
    doorway = arch_outline(0.56, WALK_FLOOR, 1.85, 0.42, n)
    window_hole = arch_outline(0.38, 1.15, 1.80, 0.38, n)
    door_parts = [
        panel(BAY, 0, LEAN_TO_TOP, doorway, BACK_WALL),
        surround(doorway, 0.16, 0.05).painted(1),
    ]
    window_parts = [
        panel(BAY, 0, LEAN_TO_TOP, window_hole, BACK_WALL),
        surround(window_hole, 0.1, 0.03).painted(1),
        blocks((0, -0.02, 1.11), (1.0, 0.16, 0.08), 0.012).painted(1),
    ]
    wall = ("Whitewash", "Limestone")
    with_door = mesh("Wall with door", join(door_parts), *site.of(*wall), smooth=SHARP)
    with_window = mesh("Wall with window", join(window_parts), *site.of(*wall), smooth=SHARP)
    leaf = mesh("Door", door(doorway, 0.22), *site.of("Wood", "Iron"), smooth=False)
    pane = mesh("Pane", window(window_hole, 0.3, 3), *site.of("Glass", "Lead"), smooth=False)
    width = BACK - ARCADE
    blank = box((width, BACK_WALL, LEAN_TO_TOP)).moved(0, BACK_WALL / 2, LEAN_TO_TOP / 2)
    corner = mesh("Wall corner", blank, *site.of("Whitewash"), smooth=False)
    skirting = mesh(
        "Skirting",
        blocks((0, BACK - 0.02, WALK_FLOOR + 0.1), (2 * BACK, 0.06, 0.2), 0.012),
        *site.of("Limestone"),
        smooth=False,
    )
    for number in range(4):
        for i in range(BAYS):
            at = side(number) @ transform(((i - (BAYS - 1) / 2) * BAY, BACK, 0))
            has_door = i == 3 or i == (number * 2) % 7
            place(f"Wall.{number}{i}", with_door if has_door else with_window, at)
            place(f"Filling.{number}{i}", leaf if has_door else pane, at)
        for sign in (-1, 1):
            at = side(number) @ transform((sign * (ARCADE + width / 2), BACK, 0))
            place(f"Wall corner.{number}{sign}", corner, at)
        place(f"Skirting.{number}", skirting, side(number))


def upper_buildings(site: Site) -> None:
    """The storeys above the walks in the north and south, and the low western wall's coping."""
    n = site.segments(16)
    bays = 8
    width = 2 * BACK / bays
    hole = arch_outline(0.42, 6.0, 6.62, 0.12, n)
    for number in (NORTH, SOUTH):
        top = UPPER_TOP[number]
        shape = [
            panel(width, LEAN_TO_TOP, top, hole, 0.4),
            surround(hole, 0.1, 0.03).painted(1),
            blocks((0, -0.03, 5.95), (1.1, 0.18, 0.1), 0.015).painted(1),
        ]
        wall = mesh("Upper wall", join(shape), *site.of("Plaster", "Limestone"), smooth=SHARP)
        pane = mesh("Upper pane", window(hole, 0.22, 1), *site.of("Glass", "Wood"), smooth=False)
        wing = mesh("Shutter", shutter(), *site.of("Wood"), smooth=False)
        for i in range(bays):
            at = side(number) @ transform(((i + 0.5) * width - BACK, BACK, 0))
            place(f"Upper wall.{number}{i}", wall, at)
            place(f"Upper pane.{number}{i}", pane, at)
            for sign in (-1, 1):
                swing = sign * (0.12 + 0.25 * ((i * 5 + number) % 4 == 0))
                turn = transform((sign * 0.53, -0.05, 6.36), (0, 0, swing))
                at_hinge = at @ turn @ transform((sign * 0.22, 0, 0))
                place(f"Shutter.{number}{i}{sign}", wing, at_hinge)
        ends = (-BACK - 0.5, BACK) if number == NORTH else (-BACK, BACK + 0.5)
        house(site, number, ends, top, 12, "Plaster")
    low_west_wall(site)


def shutter() -> Shape:
    """One wing of a louvred shutter, 0.42 by 0.72 m, about its middle."""
    frame = blocks(
        [(-0.19, 0, 0), (0.19, 0, 0), (0, 0, 0.34), (0, 0, -0.34), (0, 0, 0)],
        [(0.05, 0.035, 0.74), (0.05, 0.035, 0.74), *[(0.34, 0.035, 0.06)] * 3],
        0.006,
    )
    slat = box((0.34, 0.01, 0.05)).transformed(transform(rotation=(0.6, 0, 0)))
    heights = [z for z in np.arange(-0.28, 0.3, 0.045) if abs(z) > 0.04]
    return join([frame, *(slat.moved(0, 0, z) for z in heights)])


def house(
    site: Site, number: int, ends: tuple[float, float], top: float, rows: int, wall: str
) -> None:
    """What stands behind an upper wall: its body, gables, tiled slope and eaves."""
    depth = rows * TILE_EXPOSED * cos(ROOF_SLOPE)
    out = 0.4
    ridge_y, ridge_z = BACK - out + depth, top - 0.02 + depth * tan(ROOF_SLOPE)
    length, middle = ends[1] - ends[0], (ends[0] + ends[1]) / 2
    gable = [(BACK + 0.42, 0), (2 * ridge_y - BACK, 0), (2 * ridge_y - BACK, top - 0.1)]
    gable += [(ridge_y, ridge_z - 0.25), (BACK + 0.42, top - 0.1)]
    body = prism(gable, length).transformed(transform((ends[0], 0, 0), (pi / 2, 0, pi / 2)))
    add("House", body, *site.of(wall), matrix=side(number), smooth=False)
    eave = BACK - out
    slopes = []
    for far in (eave, 2 * ridge_y - eave):
        corners = [
            (ends[0] - 0.1, far, top - 0.02),
            (ends[1] + 0.1, far, top - 0.02),
            (ends[1] + 0.1, ridge_y, ridge_z),
            (ends[0] - 0.1, ridge_y, ridge_z),
        ]
        slopes.append(board(corners, 0.06))
    add("Roof deck", join(slopes), *site.of("Wood"), matrix=side(number), smooth=False)
    x = np.arange(ends[0] + 0.05, ends[1], TILE_PITCH)
    columns = [(each, 0, rows) for each in x]
    slope = side(number) @ transform((0, eave, top), (ROOF_SLOPE, 0, 0))
    lay_tiles(site, f"Roof {number}", slope, columns)
    rafters(site, number, ends, eave, top - 0.02, out)
    cover = half_pipe(0.13, 0.13, 0.42, 0.016, site.segments(10))
    spots = np.arange(ends[0], ends[1], 0.36)
    turns = turned(0 * spots - pi / 2, spots, 0 * spots + ridge_y, 0 * spots + ridge_z)
    add("Ridge", copies(cover, turns), *site.of("Roof tile"), matrix=side(number), smooth=SHARP)
    add(
        "Upper cornice",
        join(
            [
                blocks((middle, BACK - 0.04, top - 0.2), (length, 0.16, 0.12), 0.02),
                blocks((middle, BACK - 0.02, LEAN_TO_TOP + 0.16), (length, 0.10, 0.08), 0.02),
            ]
        ),
        *site.of("Limestone"),
        matrix=side(number),
        smooth=False,
    )


def low_west_wall(site: Site) -> None:
    """The western wall ends above the lean-to roof, under a row of ridge tiles."""
    z = LEAN_TO_TOP + 0.2
    wall = box((2 * BACK + 1, BACK_WALL, 0.4)).moved(0, BACK + BACK_WALL / 2, z - 0.1)
    add("West wall", wall, *site.of("Plaster"), matrix=side(WEST), smooth=False)
    cover = half_pipe(0.29, 0.27, 0.44, 0.02, site.segments(12))
    squat = Shape(cover.vertices * [1, 1, 0.55], cover.quads)
    x = np.arange(-BACK - 0.3, BACK + 0.3, 0.4)
    turns = turned(0 * x - pi / 2, x, 0 * x + BACK + BACK_WALL / 2, 0 * x + z + 0.1)
    add("Coping", copies(squat, turns), *site.of("Roof tile"), matrix=side(WEST), smooth=SHARP)


# --- Roofs ----------------------------------------------------------------------------------------


def half_pipe(low: float, high: float, length: float, thick: float, segments: int) -> Shape:
    """A roof tile along y, arched upwards: outer radius low at y = 0 and high at y = length."""
    angle = np.linspace(0.06, pi - 0.06, segments + 1)
    loops = []
    for radius, y in ((low, 0.0), (high, length)):
        arcs = [(radius, angle), (radius - thick, angle[::-1])]
        loop = [np.column_stack([r * np.cos(a), 0 * a + y, r * np.sin(a)]) for r, a in arcs]
        loops.append(np.concatenate(loop))
    body = sheet(np.stack(loops[::-1]), closed=True)
    size = 2 * (segments + 1)
    i = np.arange(segments)
    cap = np.stack([i, i + 1, size - 2 - i, size - 1 - i], axis=-1)
    return Shape(body.vertices, np.concatenate([body.quads, cap, cap[:, ::-1] + size]))


def tile_column(rng: Generator, segments: int, first: int, rows: int) -> Shape:
    """Covers and pans, rows first to rows − 1, in a roof's frame: y up the slope, z its normal."""
    cover = half_pipe(0.090, 0.072, TILE_LENGTH, TILE_THICK, segments)
    pan = half_pipe(0.074, 0.088, TILE_LENGTH, TILE_THICK, segments)
    pan = pan.transformed(transform(rotation=(0, pi, 0)))
    parts = []
    for row in range(first, rows):
        for tile, x, z, lift in ((pan, TILE_PITCH / 2, 0.10, 0.03), (cover, 0.0, 0.075, 0.035)):
            place_ = (x + rng.normal(0, 0.004), row * TILE_EXPOSED + rng.normal(0, 0.008), z + lift)
            turn = (-lift / TILE_EXPOSED, rng.normal(0, 0.02), rng.normal(0, 0.014))
            parts.append(tile.transformed(transform(place_, turn)))
    return join(parts)


def lay_tiles(
    site: Site, name: str, slope: Matrix, columns: Sequence[tuple[float, int, int]]
) -> None:
    """Columns of tiles (x, first row, rows) on a roof; those of equal rows share meshes."""
    rng = site.random(name)
    segments = site.segments(7, 2)
    made: dict[tuple[int, int, int], bpy.types.Mesh] = {}
    for i, (x, first, rows) in enumerate(columns):
        key = (first, rows, int(rng.integers(4)) if first == 0 else 0)
        if key not in made:
            column = tile_column(rng, segments, first, rows)
            made[key] = mesh(name, column, *site.of("Roof tile"), smooth=SHARP)
        place(f"{name}.{i:03d}", made[key], slope @ transform((x, 0, 0)))


def board(corners: Any, thickness: float) -> Shape:
    """A flat board under four corners, counter-clockwise from above."""
    top = np.array(corners, float)
    vertices = np.concatenate([top, top - [0, 0, thickness]])
    quads = [
        [0, 1, 2, 3],
        [7, 6, 5, 4],
        *([(i + 1) % 4, i, i + 4, (i + 1) % 4 + 4] for i in range(4)),
    ]
    return Shape(vertices, np.array(quads, dtype=np.int32))


def lean_to_roofs(site: Site) -> None:
    """The tiled roofs over the walks; they meet in valleys over the court's corners."""
    eave = ARCADE - ARCADE_WALL / 2 - EAVE_OUT
    run = TILE_EXPOSED * cos(ROOF_SLOPE)
    rows = round((BACK - eave) / run)
    columns = []
    for x in np.arange(-BACK + 0.1, BACK, TILE_PITCH):
        first = max(0, int(np.ceil((abs(x) - eave) / run)))
        if first < rows:
            columns.append((float(x), first, rows))
    corners = [
        (-eave, eave, EAVE),
        (eave, eave, EAVE),
        (BACK, BACK, LEAN_TO_TOP),
        (-BACK, BACK, LEAN_TO_TOP),
    ]
    deck = mesh("Lean-to deck", board(corners, 0.06), *site.of("Wood"), smooth=False)
    valley = [(-eave + 0.05, eave - 0.05, EAVE + 0.03), (-BACK, BACK, LEAN_TO_TOP + 0.05)]
    lead = mesh("Valley", tube(np.linspace(*valley, 3), 0.09, 8), *site.of("Lead"))
    flashing = mesh(
        "Flashing",
        blocks((0, BACK - 0.05, LEAN_TO_TOP + 0.07), (2 * BACK, 0.14, 0.14), 0.03),
        *site.of("Limestone"),
        smooth=False,
    )
    for number in range(4):
        slope = side(number) @ transform((0, eave, EAVE + 0.01), (ROOF_SLOPE, 0, 0))
        lay_tiles(site, f"Lean-to {number}", slope, columns)
        for name, data in (("Deck", deck), ("Valley", lead), ("Flashing", flashing)):
            place(f"{name}.{number}", data, side(number))
        rafters(site, number, (-eave + 0.2, eave - 0.2), eave, EAVE, EAVE_OUT)


def rafters(
    site: Site, number: int, ends: tuple[float, float], eave: float, z: float, out: float
) -> None:
    """The rafters' tails that carry the eaves."""
    x = np.arange(ends[0] + 0.2, ends[1], 0.46)
    length = (out + 0.1) / cos(ROOF_SLOPE)
    centers = np.column_stack([x, 0 * x + length / 2 + 0.03, 0 * x - 0.105])
    tails = blocks(centers, (0.08, length, 0.09), 0.01)
    tails = tails.transformed(transform((0, eave, z), (ROOF_SLOPE, 0, 0)))
    fascia = blocks((sum(ends) / 2, eave + 0.01, z - 0.04), (ends[1] - ends[0], 0.03, 0.12), 0.005)
    add(f"Rafters.{number}", join([tails, fascia]), *site.of("Wood"), matrix=side(number))


def gutters(site: Site) -> None:
    """Gutters under the eaves of the lean-to roofs, with brackets and a downpipe in each corner."""
    n = site.segments(10)
    y = ARCADE - ARCADE_WALL / 2 - EAVE_OUT - 0.06
    trough = half_pipe(0.065, 0.065, 2 * y, 0.006, n)
    trough = trough.transformed(transform((-y, y, EAVE - 0.02), (0, pi, -pi / 2)))
    parts = [trough]
    angle = np.linspace(pi, 2 * pi, 9)
    for x in np.arange(-y + 0.6, y, 1.1):
        hook = np.column_stack(
            [0 * angle + x, y + 0.072 * np.cos(angle), EAVE - 0.02 + 0.072 * np.sin(angle)]
        )
        parts.append(tube(np.concatenate([hook, [[x, y + 0.12, EAVE]]]), 0.007, 5))
    near = ARCADE - 0.44
    pipe = [(-y, y, EAVE - 0.05), (-y, y, EAVE - 0.16), (-near, near, EAVE - 0.5)]
    pipe += [(-near, near, z) for z in (3.0, 2.0, 1.0, 0.3)]
    pipe += [(-near + 0.06, near - 0.06, 0.17), (-near + 0.16, near - 0.16, 0.12)]
    parts.append(tube(pipe, 0.045, n))
    for z in (0.7, 1.9, 3.0):
        parts.append(lathe([(0.046, z), (0.056, z), (0.056, z + 0.05)], n).moved(-near, near, 0))
    data = mesh("Gutter", join(parts), *site.of("Lead"), smooth=SHARP)
    for number in range(4):
        place(f"Gutter.{number}", data, side(number))


# --- The church and its tower ---------------------------------------------------------------------


def church_front(site: Site) -> None:
    """The church's flank over the eastern walk: brick, lancets, a rose, and an arched frieze."""
    top, bays = UPPER_TOP[EAST], 7
    width = 2 * BACK / bays
    n = site.segments(20)
    lancet = arch_outline(0.42, 6.2, 7.75, 0.62, n)
    rose = circle_outline(1.15, 7.3, site.segments(40, 8))
    lancet_bay = join(
        [
            panel(width, LEAN_TO_TOP, top, lancet, 0.5),
            surround(lancet, 0.14, 0.04).painted(1),
            blocks((0, -0.04, 6.12), (1.2, 0.2, 0.1), 0.02).painted(1),
            window(lancet, 0.3, 2).painted(2),
        ]
    )
    rose_bay = join(
        [
            panel(width, LEAN_TO_TOP, top, rose, 0.5),
            surround(rose, 0.2, 0.06).painted(1),
            rose_tracery(site).moved(0, 0.16, 7.3).painted(1),
            filled(rose, 0.3).painted(2),
        ]
    )
    used = site.of("Brick", "Limestone", "Glass")
    meshes = [mesh("Lancet bay", lancet_bay, *used, smooth=SHARP)]
    meshes.append(mesh("Rose bay", rose_bay, *used, smooth=SHARP))
    small = arch_outline(0.17, top - 0.62, top - 0.45, 0.17, site.segments(10))
    frieze = panel(width / 7, top - 0.62, top - 0.1, small, 0.14)
    drop = blocks((-width / 14, 0.04, top - 0.67), (0.1, 0.14, 0.12), 0.02)
    frieze_mesh = mesh("Frieze", join([frieze, drop.painted(1)]), *used, smooth=SHARP)
    strip = box((0.42, 0.16, top - LEAN_TO_TOP - 0.1)).moved(0, 0, (top + LEAN_TO_TOP) / 2 - 0.05)
    strip_mesh = mesh("Pilaster strip", strip, *used, smooth=False)
    for i in range(bays):
        x = (i - (bays - 1) / 2) * width
        place(f"Church.{i}", meshes[i == bays // 2], side(EAST) @ transform((x, BACK, 0)))
        for k in range(7):
            at = (x + (k - 3) * width / 7, BACK - 0.13, 0)
            place(f"Frieze.{i}{k}", frieze_mesh, side(EAST) @ transform(at))
    for i in range(bays + 1):
        at = ((i - bays / 2) * width, BACK - 0.06, 0)
        place(f"Pilaster strip.{i}", strip_mesh, side(EAST) @ transform(at))
    house(site, EAST, (-BACK, BACK + 3.5), top, 14, "Brick")


def rose_tracery(site: Site) -> Shape:
    """The stone spokes and rings of the rose window, about its middle, facing −Y."""
    n = site.segments(24)
    sides = site.segments(8)
    angle = np.linspace(0, 2 * pi, n + 1)
    circle = np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)])
    parts = [tube(circle * 0.3, 0.045, sides), tube(circle * 1.12, 0.05, sides)]
    for i in range(8):
        a = i * pi / 4
        spoke = np.array([cos(a), 0, sin(a)])
        parts.append(tube(np.outer(np.linspace(0.3, 1.12, 3), spoke), 0.035, sides))
        middle = np.array([cos(a + pi / 8), 0, sin(a + pi / 8)]) * 0.84
        parts.append(tube(circle * 0.25 + middle, 0.03, sides))
    for i in range(8):
        a = np.linspace(0, 2 * pi, n // 2 + 1)
        middle = np.array([cos(i * pi / 4), 0, sin(i * pi / 4)]) * 0.14
        foil = np.column_stack([0.09 * np.cos(a), 0 * a, 0.09 * np.sin(a)])
        parts.append(tube(foil + middle, 0.015, sides))
    return join(parts)


def tower(site: Site) -> None:
    """The bell tower in the north-east corner: quoins, strings, a clock, belfry, and roof."""
    half, belfry, top = 2.3, 12.4, 15.6
    wall = 0.45
    at = side(NORTH) @ transform((BACK + half, BACK + half, 0))
    shaft = box((2 * half, 2 * half, belfry)).moved(0, 0, belfry / 2)
    used = site.of("Brick", "Limestone", "Iron")
    add("Tower shaft", shaft, *used, matrix=at, smooth=False)
    opening = arch_outline(0.62, belfry + 0.5, top - 1.3, 0.62, site.segments(20))
    bay = join(
        [
            panel(half, belfry, top, opening, wall),
            surround(opening, 0.14, 0.05).painted(1),
            blocks((0, 0.2, belfry + 0.47), (1.5, 0.62, 0.08), 0.015).painted(1),
        ]
    )
    bay_mesh = mesh("Belfry bay", bay, *used, smooth=SHARP)
    strings = [
        blocks((0, -half, z), (2 * half + 2 * out, 2 * out, h), 0.03).painted(1)
        for z, out, h in ((9.9, 0.07, 0.14), (belfry, 0.12, 0.2), (top - 0.1, 0.14, 0.16))
    ]
    height = np.arange(0.2, top - 0.5, 0.4)
    odd = np.arange(len(height)) % 2
    wide, narrow = 0.62 - 0.24 * odd, 0.38 + 0.24 * odd
    quoins = blocks(
        np.column_stack([wide / 2 - half - 0.025, narrow / 2 - half - 0.025, height]),
        np.column_stack([wide, narrow, 0 * height + 0.385]),
        0.015,
    ).painted(1)
    trim = join([*strings, quoins, clock(site).moved(0, -half, 11.1)])
    trim_mesh = mesh("Tower trim", trim, *used, smooth=SHARP)
    for number in range(4):
        turn = at @ transform(rotation=(0, 0, number * pi / 2))
        for x in (-half / 2, half / 2):
            place(f"Belfry.{number}{x}", bay_mesh, turn @ transform((x, -half, 0)))
        place(f"Tower trim.{number}", trim_mesh, turn)
    bell(site, at @ transform((0, 0, belfry + 2.3)))
    tower_roof(site, at @ transform((0, 0, top)), half + 0.4)


def clock(site: Site) -> Shape:
    """A clock's face (slot 1) with hours and hands (slot 2), facing −Y."""
    face = upright(lathe([(0.8, 0.0), (0.8, 0.05), (0.72, 0.06), (0.7, 0.03)], site.segments(40)))
    iron = []
    for hour in range(12):
        mark = box((0.05, 0.02, 0.14)).moved(0, -0.035, 0.58)
        iron.append(mark.transformed(transform(rotation=(0, hour * pi / 6, 0))))
    for length, turn in ((0.36, 1.0), (0.54, 3.4)):
        hand = box((0.035, 0.015, length)).moved(0, -0.05, length / 2 - 0.05)
        iron.append(hand.transformed(transform(rotation=(0, turn, 0))))
    return join([face.painted(1), *(part.painted(2) for part in iron)])


def bell(site: Site, matrix: Matrix) -> None:
    """A bronze bell under its wooden yoke; the origin is the yoke's axis."""
    profile = [(0.55, -1.15), (0.53, -1.12), (0.44, -0.95), (0.36, -0.7), (0.31, -0.4)]
    profile += [(0.26, -0.22), (0.12, -0.15), (0.05, -0.1)]
    body = lathe(profile, site.segments(28))
    yoke = blocks((0, 0, 0.02), (4.2, 0.22, 0.26), 0.03).painted(1)
    clapper = tube([(0, 0, -0.5), (0, 0, -0.9), (0, 0, -1.25)], [0.02, 0.03, 0.08], 8)
    used = site.of("Bronze", "Wood")
    add("Bell", join([body, yoke, clapper]), *used, matrix=matrix, smooth=SHARP)


def tower_roof(site: Site, matrix: Matrix, half: float) -> None:
    """A tiled pyramid on rafters, with hips, a ball and a cross."""
    slope = radians(33)
    height = half * tan(slope)
    run = TILE_EXPOSED * cos(slope)
    deck = lathe([(half * sqrt(2), 0.0), (0.0, height)], 4)
    deck = deck.transformed(transform(rotation=(0, 0, pi / 4)))
    add("Tower deck", deck, *site.of("Wood"), matrix=matrix, smooth=False)
    columns = []
    for x in np.arange(-half + TILE_PITCH / 2, half, TILE_PITCH):
        rows = round((half - abs(x)) / run)
        if rows:
            columns.append((float(x), 0, rows))
    for number in range(4):
        turn = matrix @ transform(rotation=(0, 0, number * pi / 2))
        face = turn @ transform((0, -half, 0.02), (slope, 0, 0))
        lay_tiles(site, f"Tower tiles {number}", face, columns)
        hip = np.linspace((half, half, 0.06), (0, 0, height + 0.1), 16)
        caps = tube(hip, 0.085 + 0.02 * (np.arange(16) % 2), 8)
        add(f"Hip.{number}", caps, *site.of("Roof tile"), matrix=turn)
    ball = lathe([(0.16, 0.0), (0.06, 0.2), (0.15, 0.32), (0.15, 0.42), (0.05, 0.55)], 16)
    staff = tube([(0, 0, 0.4), (0, 0, 1.0), (0, 0, 1.7)], 0.03, 6)
    arm = tube([(-0.35, 0, 1.3), (0, 0, 1.3), (0.35, 0, 1.3)], 0.03, 6)
    cross = join([ball, staff, arm]).moved(0, 0, height - 0.05)
    add("Tower cross", cross, *site.of("Iron"), matrix=matrix, smooth=SHARP)


# --- Furniture ------------------------------------------------------------------------------------


def bench() -> Shape:
    """A wooden bench 1.6 m long with a back, facing −Y, on its origin."""
    boards = blocks([(0, y, 0.45) for y in (-0.18, -0.03, 0.12)], [(1.6, 0.14, 0.035)] * 3, 0.006)
    back = blocks([(0, 0.215, z) for z in (0.62, 0.78)], [(1.6, 0.03, 0.12)] * 2, 0.006)
    legs = blocks(
        [(x, y, h / 2) for x in (-0.7, 0.7) for y, h in ((-0.2, 0.43), (0.19, 0.86))],
        [(0.06, 0.06, h) for _ in range(2) for h in (0.43, 0.86)],
        0.006,
    )
    rails = blocks([(x, 0, 0.4) for x in (-0.7, 0.7)], (0.045, 0.4, 0.06), 0.005)
    return join([boards, back, legs, rails])


def chair() -> Shape:
    """A ladder-back chair with a seat of boards, facing −Y, on its origin."""
    legs = [tube([(x, -0.19, 0), (x, -0.19, 0.22), (x, -0.19, 0.46)], 0.02) for x in (-0.2, 0.2)]
    posts = [
        tube([(x, 0.18, 0), (x, 0.18, 0.45), (x, 0.22, 0.75), (x, 0.27, 1.02)], 0.02)
        for x in (-0.19, 0.19)
    ]
    seat = blocks([(x, -0.01, 0.455) for x in np.linspace(-0.16, 0.16, 4)], (0.1, 0.44, 0.025))
    rungs = [tube([(-0.19, 0.2 + b, z), (0.19, 0.2 + b, z)], 0.014) for z, b in ((0.25, -0.02),)]
    rungs += [tube([(x, -0.19, 0.2), (x, 0.18, 0.2)], 0.013) for x in (-0.2, 0.2)]
    rungs += [tube([(-0.2, -0.19, 0.28), (0.2, -0.19, 0.28)], 0.013)]
    slats = [
        blocks((0, y, z), (0.38, 0.016, 0.07), 0.006)
        for y, z in ((0.2, 0.6), (0.225, 0.76), (0.255, 0.93))
    ]
    return join([*legs, *posts, seat, *rungs, *slats])


def lantern() -> Shape:
    """A hanging lantern of iron (slot 0) and glass (slot 1); the origin is its hook."""
    iron = [
        tube([(0, 0, 0), (0, 0, -0.35), (0, 0, -0.7)], 0.008, 5),
        lathe([(0.13, -0.82), (0.02, -0.7)], 6),
        lathe([(0.11, -1.14), (0.12, -1.12)], 6),
    ]
    iron += [
        tube([(0.11 * cos(a), 0.11 * sin(a), z) for z in (-1.12, -0.82)], 0.008, 4)
        for a in np.arange(6) * pi / 3
    ]
    candle = lathe([(0.03, -1.12), (0.03, -0.97)], 8).painted(2)
    return join([*iron, candle])


def jar(site: Site) -> Shape:
    """A tall oil jar with a lip."""
    profile = [(0.12, 0.0), (0.2, 0.12), (0.25, 0.3), (0.25, 0.42), (0.19, 0.6), (0.12, 0.68)]
    profile += [(0.12, 0.72), (0.145, 0.75), (0.14, 0.77), (0.1, 0.75), (0.1, 0.6)]
    return lathe(profile, site.segments(28), capped=False)


def walk_furniture(site: Site) -> None:
    """In the walks: benches along the walls, lanterns under the vaults, jars in the corners."""
    rng = site.random("walk furniture")
    middle = (ARCADE + ARCADE_WALL / 2 + BACK) / 2
    seat = mesh("Bench", bench(), *site.of("Wood"), smooth=False)
    lamp = mesh("Lantern", lantern(), *site.of("Iron", "Glass", "Daisy"), smooth=SHARP)
    pot = mesh("Jar", jar(site), *site.of("Pot"), smooth=SHARP)
    for number in range(4):
        for i in (1, 5):
            at = ((i - 3) * BAY, BACK - 0.32, WALK_FLOOR)
            place(f"Bench.{number}{i}", seat, side(number) @ transform(at))
        for i in (0, 2, 4, 6):
            at = ((i - 3) * BAY, middle, SPRINGING + VAULT_RISE - 0.1)
            place(f"Lantern.{number}{i}", lamp, side(number) @ transform(at))
        for i in range(3):
            at = (-BACK + 0.4 + 0.55 * i, BACK - 0.4 - 0.1 * (i % 2), WALK_FLOOR)
            size = float(rng.uniform(0.75, 1.15))
            turn = transform(at, (0, 0, float(rng.uniform(0, 6))), size)
            place(f"Jar.{number}{i}", pot, side(number) @ turn)


def court_furniture(site: Site) -> None:
    """In the court: a chair with a book on the lawn, a bench, a broom against a column."""
    at = side(NORTH) @ transform((4.5, -2.2, 0.0), (0, 0, -1.1))
    add("Chair", chair(), *site.of("Wood"), matrix=at, smooth=SHARP)
    book = join(
        [
            blocks((0, 0, 0.012), (0.16, 0.22, 0.024), 0.002),
            blocks((0.004, 0, 0.012), (0.155, 0.21, 0.02), 0.001).painted(1),
        ]
    )
    used = site.of("Robe", "Daisy")
    add("Book", book, *used, matrix=at @ transform((0.03, -0.03, 0.468), (0, 0, 0.4)), smooth=False)
    seat = mesh("Court bench", bench(), *site.of("Wood"), smooth=False)
    for number, x in ((EAST, 2.9), (NORTH, -3.3), (WEST, 2.7)):
        at = side(number) @ transform((x, ARCADE - 0.66, 0.015))
        place(f"Court bench.{number}", seat, at)
    rng = site.random("broom")
    lean = np.array([(0, 0, 0.32), (0, 0.16, 0.9), (0, 0.32, 1.5)])
    stick = tube(lean, 0.013, 6)
    foot = np.column_stack([rng.normal(0, 0.02, (90, 2)), np.full(90, 0.33)])
    twig = np.column_stack(
        [rng.normal(0, 0.22, 90), rng.normal(-0.25, 0.12, 90), np.full(90, -1.0)]
    )
    twigs = leaves(foot, twig, np.tile([0.0, 1.0, 0.2], (90, 1)), 0.33, 0.03)
    broom = join([stick, twigs.painted(1)])
    at = side(SOUTH) @ transform((-3.1, ARCADE - 0.62, 0.0), (0, 0, 0.2))
    add("Broom", broom, *site.of("Wood", "Rope"), matrix=at, smooth=SHARP)


# --- Plants ---------------------------------------------------------------------------------------


def leaf_cloud(
    rng: Generator, count: int, radii: Sequence[float], length: float, width: float
) -> Shape:
    """Leaves in the outer shell of an ellipsoid about the origin, turned outwards."""
    way = unit_vectors(rng, count)
    depth = 1 - 0.3 * rng.random((count, 1)) ** 2
    lumps = 1 + 0.10 * noise(way * 2.5, int(rng.integers(10**6)))[:, None]
    base = way * depth * lumps * np.array(radii)
    direction = way + rng.normal(0, 0.6, (count, 3))
    return leaves(base, direction, unit_vectors(rng, count), length, width)


def shrubs(site: Site) -> None:
    """Clipped box balls at the lawns' corners, and lavender along the sunny kerbs."""
    rng = site.random("shrubs")
    balls = [
        mesh("Box ball", leaf_cloud(rng, site.count(3000), (0.33,) * 3, 0.038, 0.65), leaf)
        for leaf in site.of("Box leaf") * 2
    ]
    core = mesh("Box core", icosphere(2, 0.27), *site.of("Turf"))
    for number in range(4):
        spots = [(LAWN - 0.45, LAWN - 0.45), (CROSS_PATH + 0.5, LAWN - 0.45)]
        spots += [
            (LAWN - 0.45, CROSS_PATH + 0.5),
            (CROSS_PATH + 0.5, 2.75),
            (2.75, CROSS_PATH + 0.5),
        ]
        for i, (x, y) in enumerate(spots):
            turn = transform((x, y, 0.3), (0, 0, rng.uniform(0, 6)), float(rng.uniform(0.85, 1.15)))
            at = side(number) @ turn
            if hypot(at.translation.x, at.translation.y) < 3.2:
                continue
            place(f"Box ball.{number}{i}", balls[i % 2], at)
            place(f"Box core.{number}{i}", core, at)
    bushes = [
        mesh("Lavender", lavender(site, rng), *site.of("Olive leaf", "Lavender")) for _ in "ab"
    ]
    for number in (NORTH, EAST, WEST):
        for i, x in enumerate(np.arange(1.95, LAWN - 0.85, 0.42)):
            turn = (0, 0, float(rng.uniform(0, 6)))
            at = side(number) @ transform((x, LAWN - 0.3, 0.0), turn, float(rng.uniform(0.8, 1.1)))
            place(f"Lavender.{number}{i}", bushes[i % 2], at)


def lavender(site: Site, rng: Generator) -> Shape:
    """A cushion of grey leaves with flower spikes on thin stalks."""
    n = site.count(350)
    way = unit_vectors(rng, n)
    way[:, 2] = np.abs(way[:, 2]) + 0.3
    green = leaves(way * [0.06, 0.06, 0.02], way, unit_vectors(rng, n), 0.26, 0.07)
    stalks = site.count(100)
    lean = np.column_stack([rng.normal(0, 0.33, (stalks, 2)), np.ones(stalks)])
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    tall = rng.uniform(0.33, 0.46, (stalks, 1))
    stem = leaves(lean * 0.05, lean, unit_vectors(rng, stalks), tall[:, 0], 0.012)
    spikes = []
    for k in range(5):
        spot = lean * (tall - 0.09 + 0.02 * k)
        out = unit_vectors(rng, stalks) + lean
        spikes.append(leaves(spot, out, unit_vectors(rng, stalks), 0.032, 0.7).painted(1))
    return join([green, stem, *spikes])


def branch_points(
    rng: Generator, start: Array, direction: Array, length: float, bend: float, rise: float
) -> Array:
    """A crooked branch: points (7, 3) from a start, drawn towards the light."""
    points, way = [start], direction
    for _ in range(6):
        way = way + rng.normal(0, bend, 3) + [0, 0, rise]
        way = way / np.linalg.norm(way)
        points.append(points[-1] + way * length / 6)
    return np.array(points)


def olive_tree(site: Site) -> None:
    """An old olive on the north-western lawn: a gnarled trunk, crooked limbs, silvery leaves."""
    rng = site.random("olive")
    trunk = np.array([(0, 0, -0.1), (0.04, 0.02, 0.3), (-0.06, 0.06, 0.7), (0.05, 0.02, 1.15)])
    wood = [tube(trunk, [0.30, 0.21, 0.19, 0.17], site.segments(14))]
    bases, ways = [], []
    for i in range(6):
        around = i * pi / 3 + rng.uniform(-0.3, 0.3)
        way = np.array([cos(around), sin(around), rng.uniform(0.5, 1.1)])
        limb = branch_points(rng, trunk[-1] - [0, 0, 0.12], way, rng.uniform(1.5, 2.1), 0.24, 0.06)
        wood.append(tube(limb, np.linspace(0.10, 0.03, 7), site.segments(8)))
        for _ in range(9):
            where = limb[int(rng.integers(2, 7))]
            out = unit_vectors(rng, 1)[0] + [0, 0, 0.3] + (limb[-1] - limb[0]) * 0.3
            twig = branch_points(rng, where, out, rng.uniform(0.6, 1.1), 0.3, 0.0)
            wood.append(tube(twig, np.linspace(0.018, 0.004, 7), 5))
            n = site.count(280)
            t = rng.uniform(0.25, 1.0, n)
            along = np.column_stack(
                [np.interp(t * 6, np.arange(7), twig[:, axis]) for axis in range(3)]
            )
            bases.append(along + rng.normal(0, 0.09, (n, 3)))
            ways.append(unit_vectors(rng, n) - np.array([0, 0, 0.1]))
    vertices = wood[0].vertices
    vertices[:, :2] *= 1 + 0.25 * noise(vertices * [5, 5, 1.6], site.seed)[:, None]
    base = np.concatenate(bases)
    green = leaves(base, np.concatenate(ways), unit_vectors(rng, len(base)), 0.062, 0.24)
    at = side(NORTH) @ transform((-3.5, 3.5, 0))
    add("Olive wood", join(wood), *site.of("Bark"), matrix=at)
    add("Olive leaves", green, *site.of("Olive leaf"), matrix=at, smooth=False)


def cypresses(site: Site) -> None:
    """A slim cypress on the north-eastern lawn, and tall ones beyond the western wall."""
    rng = site.random("cypresses")
    n = site.count(16000)
    t = rng.random(n) ** 1.25
    around = rng.uniform(0, 2 * pi, n)
    outline = 0.52 * np.sin(pi * np.clip(t * 0.93 + 0.05, 0, 1)) ** 0.6 * (1 - 0.45 * t)
    lumps = 1 + 0.25 * noise(
        np.column_stack([np.cos(around) * 1.3, np.sin(around) * 1.3, t * 9]), site.seed
    )
    radius = outline * lumps * (1 - 0.25 * rng.random(n) ** 2)
    base = np.column_stack([radius * np.cos(around), radius * np.sin(around), 0.35 + 5.2 * t])
    way = np.column_stack([np.cos(around) * 0.4, np.sin(around) * 0.4, np.ones(n)])
    way += rng.normal(0, 0.25, (n, 3))
    green = leaves(base, way, unit_vectors(rng, n), 0.15, 0.28)
    trunk = tube([(0, 0, -0.1), (0, 0, 2.5), (0, 0, 5.2)], [0.10, 0.08, 0.01], 8).painted(1)
    heights = np.linspace(0, 1, 9)
    core = 0.36 * np.sin(pi * np.clip(heights * 0.93 + 0.05, 0, 1)) ** 0.6 * (1 - 0.45 * heights)
    inside = lathe(np.column_stack([core, 0.45 + 4.9 * heights]), 10)
    tree = mesh(
        "Cypress", join([green, trunk, inside]), *site.of("Cypress leaf", "Bark"), smooth=False
    )
    place("Cypress", tree, side(NORTH) @ transform((3.6, 3.7, 0), (0, 0, 1.0), 0.95))
    for i, (x, y, size) in enumerate(
        [
            (-8.2, 14.5, 2.2),
            (-5.6, 15.8, 2.5),
            (2.8, 16.0, 2.3),
            (6.0, 15.0, 2.05),
            (8.9, 16.8, 2.4),
        ]
    ):
        turn = transform((x, y, 0), (0, 0, float(rng.uniform(0, 6))), size)
        place(f"Cypress.{i}", tree, side(WEST) @ turn)


def ivy(site: Site) -> None:
    """Ivy that climbs the south-western pier, spreads over two bays, and hangs from the eaves."""
    rng = site.random("ivy")
    front = ARCADE - ARCADE_WALL / 2 - 0.02
    n = site.count(26000)
    x = ARCADE - 4.6 * rng.random(n) ** 1.4
    z = rng.uniform(0.0, ARCADE_TOP - 0.1, n)
    reach = noise(np.column_stack([x * 0.9, 0 * x, z * 0.9]), site.seed + 5, 3)
    from_pier = (ARCADE - x) / 4.6
    bay = (x - ARCADE) / BAY
    from_axis = np.abs((bay % 1) - 0.5) * BAY
    in_arch = (from_axis < 0.97) & (np.hypot(from_axis, np.maximum(z - SPRINGING, 0)) < 0.95)
    grows = (reach * 0.9 + z * 0.13 - from_pier * 0.95 + 0.35 > 0.15) & ~(in_arch & (z > 0.62))
    x, z = x[grows], z[grows]
    on_pier = x > ARCADE - 0.42
    y = np.where(on_pier, ARCADE - 0.36, np.where(z < 0.62, ARCADE - 0.34, front))
    depth = rng.uniform(0.01, 0.10, len(x))
    base = np.column_stack([x, y - depth, z])
    down = np.column_stack([rng.normal(0, 0.7, len(x)), rng.normal(-0.4, 0.2, len(x)), -0 * x - 1])
    facing = np.column_stack([rng.normal(0, 0.3, len(x)), -1 + 0 * x, rng.normal(0.4, 0.3, len(x))])
    green = leaves(base, down, facing, rng.uniform(0.05, 0.085, len(x)), 0.9)
    add("Ivy", green, *site.of("Ivy leaf"), matrix=side(SOUTH), smooth=False)
    stems = []
    for _ in range(9):
        start = np.array([ARCADE - rng.uniform(0.05, 0.5), ARCADE - 0.37, 0.02])
        path = branch_points(rng, start, np.array([-0.3, 0.0, 1.0]), 3.4, 0.22, 0.05)
        path[:, 1] = np.where(path[:, 0] > ARCADE - 0.42, ARCADE - 0.36, front - 0.02)
        path[:, 2] = np.minimum(path[:, 2], ARCADE_TOP - 0.15)
        stems.append(tube(path, np.linspace(0.02, 0.006, 7), 6))
    add("Ivy stems", join(stems), *site.of("Bark"), matrix=side(SOUTH))


def geranium(site: Site, rng: Generator) -> Shape:
    """A terracotta pot (slot 0) of soil (1), leaves (2) and red flower heads (3)."""
    n = site.segments(24)
    profile = [(0.12, 0.0), (0.175, 0.27), (0.195, 0.27), (0.2, 0.33), (0.175, 0.33), (0.165, 0.27)]
    parts = [lathe(profile, n, capped=False), lathe([(0.17, 0.28), (0.02, 0.295)], n).painted(1)]
    green = leaf_cloud(rng, site.count(420), (0.25, 0.25, 0.2), 0.06, 0.95)
    parts.append(green.moved(0, 0, 0.46).painted(2))
    for _ in range(9):
        way = unit_vectors(rng, 1)[0]
        way[2] = abs(way[2]) * 0.7 + 0.35
        petals = leaf_cloud(rng, site.count(26), (0.035,) * 3, 0.028, 0.9)
        head = way * [0.25, 0.25, 0.24] + [0, 0, 0.47]
        parts.append(petals.moved(*head).painted(3))
        parts.append(tube([(0, 0, 0.3), head * [0.5, 0.5, 0.85], head], 0.003, 4).painted(2))
    return join(parts)


def potted_plants(site: Site) -> None:
    """Pots of geraniums beside the gates, and smaller ones on the low walls."""
    rng = site.random("pots")
    used = site.of("Pot", "Soil", "Box leaf", "Petal")
    pots = [mesh("Geranium", geranium(site, rng), *used, smooth=SHARP) for _ in range(3)]
    for number in range(4):
        spots = [(sign * 1.22, ARCADE - 0.62, 0.015, 1.15) for sign in (-1, 1)]
        for i in range(BAYS):
            if i != BAYS // 2 and rng.random() < 0.6:
                x = (i - (BAYS - 1) / 2) * BAY + rng.uniform(-0.4, 0.4)
                spots.append((x, ARCADE - 0.05, STYLOBATE, 0.72))
        for i, (x, y, z, size) in enumerate(spots):
            turn = transform((x, y, z), (0, 0, float(rng.uniform(0, 6))), size)
            place(f"Geranium.{number}{i}", pots[int(rng.integers(3))], side(number) @ turn)


def fallen_leaves(site: Site) -> None:
    """Dry leaves on the paths and lawns, thicker along the walls."""
    rng = site.random("fallen leaves")
    n = site.count(1500)
    reach = ARCADE - 0.4
    spread = reach * (1 - rng.random((n, 2)) ** 1.7) * rng.choice([-1, 1], (n, 2))
    off_well = np.hypot(*spread.T) > 1.6
    spread = spread[off_well]
    m = len(spread)
    base = np.column_stack([spread, rng.uniform(0.022, 0.03, m)])
    heading = rng.uniform(0, 2 * pi, m)
    way = np.column_stack([np.cos(heading), np.sin(heading), rng.uniform(0.0, 0.3, m)])
    facing = np.tile([0.0, 0.0, 1.0], (m, 1)) + rng.normal(0, 0.3, (m, 3))
    shape = leaves(base, way, facing, rng.uniform(0.04, 0.075, m), 0.55)
    add("Fallen leaves", shape, *site.of("Dead leaf"), matrix=side(NORTH), smooth=False)


def birds(site: Site) -> None:
    """Swallows over the court: what there is to see straight above."""
    rng = site.random("birds")
    body = lathe([(0.0, -0.09), (0.018, -0.04), (0.02, 0.02), (0.012, 0.07), (0.0, 0.09)], 8)
    body = body.transformed(transform(rotation=(0, pi / 2, 0)))
    right = [
        (0.05, 0.0, 0),
        (-0.01, 0.0, 0),
        (-0.03, -0.10, 0.03),
        (-0.11, -0.22, 0.01),
        (0.04, -0.10, 0.035),
    ]
    wing = Shape(np.array(right), np.array([[0, 1, 2, 4]]), np.array([[4, 2, 3]]))
    left = Shape(wing.vertices * [1, -1, 1], wing.quads, wing.triangles)
    tail = np.array([(-0.07, 0, 0), (-0.19, 0.05, 0), (-0.11, 0, 0), (-0.19, -0.05, 0)])
    fork = Shape(tail, triangles=np.array([[0, 1, 2], [0, 2, 3]]))
    swallow = mesh("Swallow", join([body, wing, left, fork]), *site.of("Iron"), smooth=False)
    for i in range(14):
        x, y = rng.uniform(-9, 9, 2)
        turn = (
            float(rng.uniform(-0.7, 0.7)),
            float(rng.uniform(-0.3, 0.3)),
            float(rng.uniform(0, 6)),
        )
        at = transform((x, y, float(rng.uniform(9, 19))), turn, 1.3)
        place(f"Swallow.{i}", swallow, side(NORTH) @ at)


# --- The monk -------------------------------------------------------------------------------------


def robe(site: Site) -> Shape:
    """A habit in folds, belted, from hem to neck; faces +X."""
    n = site.segments(72, 12)
    z = np.array([0.03, 0.1, 0.25, 0.45, 0.7, 0.9, 1.0, 1.03, 1.06, 1.15, 1.28, 1.38, 1.44, 1.47])
    r = np.array(
        [0.31, 0.3, 0.275, 0.25, 0.22, 0.2, 0.185, 0.175, 0.19, 0.205, 0.205, 0.17, 0.1, 0.07]
    )
    fold = np.interp(z, [0.0, 0.9, 1.03, 1.2, 1.4], [0.11, 0.04, 0.0, 0.025, 0.0])
    angle = (np.arange(n) * 2 * pi / n)[None, :]
    z, r, fold = z[:, None], r[:, None], fold[:, None]
    wave = np.sin(9 * angle + 1.3 * np.sin(2 * angle) + 0.8 * z) + 0.5 * np.sin(14 * angle + 2 * z)
    radius = r * (1 + fold * wave)
    points = [0.88 * radius * np.cos(angle), 1.12 * radius * np.sin(angle), z + 0 * angle]
    return sheet(np.stack(points, axis=-1), closed=True)


def cape(site: Site) -> Shape:
    """The hood's shoulder cape."""
    n = site.segments(48, 12)
    z = np.array([1.21, 1.22, 1.3, 1.38, 1.44, 1.49, 1.53])[:, None]
    r = np.array([0.245, 0.25, 0.245, 0.22, 0.17, 0.12, 0.1])[:, None]
    angle = (np.arange(n) * 2 * pi / n)[None, :]
    hem = np.interp(z, [1.2, 1.45], [0.05, 0.0]) * np.sin(7 * angle + 0.6)
    radius = r * (1 + hem)
    points = [0.82 * radius * np.cos(angle), 1.12 * radius * np.sin(angle), z + 0 * angle]
    return sheet(np.stack(points, axis=-1), closed=True)


def hood(site: Site) -> Shape:
    """A deep hood, open towards +X, that runs out into a point behind; with its rolled rim."""
    n = site.segments(28, 8)
    edge = radians(50)
    around = (np.arange(n) * 2 * pi / n)[None, :]
    back = np.linspace(edge, pi, 12)[:, None]
    pointed = np.clip((back - 2.2) / (pi - 2.2), 0, 1) ** 2
    x = 0.19 * np.cos(back) - 0.09 * pointed + 0 * around
    y = 0.14 * np.sin(back) * np.cos(around)
    z = 0.175 * np.sin(back) * np.sin(around) - 0.06 * pointed
    shell = sheet(np.stack([x, y, z], axis=-1), closed=True)
    rim_angle = np.linspace(0, 2 * pi, n + 1)
    rim = np.column_stack(
        [
            0 * rim_angle + 0.19 * cos(edge),
            0.14 * sin(edge) * np.cos(rim_angle),
            0.175 * sin(edge) * np.sin(rim_angle),
        ]
    )
    return join([shell, tube(rim, 0.014, 8)])


def head(site: Site) -> Shape:
    """Hood (slot 0), face (2) and white beard and brows (3) about the head's middle; faces +X."""
    rng = site.random("head")
    ball = icosphere(4)
    face = ball.vertices * [0.085, 0.075, 0.115]
    for y in (-0.03, 0.03):  # the eyes' hollows
        from_eye = np.linalg.norm(face - [0.078, y, 0.022], axis=1)
        face[:, 0] -= 0.018 * np.exp(-((from_eye / 0.02) ** 2))
    nose = tube([(0.073, 0, 0.035), (0.10, 0, -0.005), (0.08, 0, -0.02)], [0.008, 0.014, 0.013], 8)
    skin = [Shape(face, triangles=ball.triangles), nose]
    tufts = [((0.06, 0, -0.065), (0.03, 0.05, 0.045), 500, 0.09, (0.35, 0, -1))]
    tufts += [
        ((0.078, y, 0.04), (0.006, 0.02, 0.005), 60, 0.025, (0.4, y * 20, 0)) for y in (-0.03, 0.03)
    ]
    hair = []
    for middle, radii, count, length, way in tufts:
        n = site.count(count)
        root = unit_vectors(rng, n) * radii + middle
        hair.append(leaves(root, rng.normal(way, 0.25, (n, 3)), unit_vectors(rng, n), length, 0.12))
    parts = [hood(site), *(each.painted(2) for each in skin), *(each.painted(3) for each in hair)]
    return join(parts)


def monk(site: Site) -> None:
    """The monk, hooded, hands in his sleeves, on his way from the eastern walk to the well."""
    cloth = [robe(site), cape(site)]
    for sign in (-1, 1):
        t = np.linspace(0, 1, 9)[:, None]
        shoulder, elbow, hand = np.array(
            [(0, 0.18, 1.37), (-0.05, 0.40, 0.98), (0.235, 0.03, 1.09)]
        )
        path = (1 - t) ** 2 * shoulder + 2 * t * (1 - t) * elbow + t**2 * hand
        cloth.append(tube(path * [1, sign, 1], 0.065 + 0.035 * t[:, 0], site.segments(20)))
    n = site.segments(20)
    angle = np.linspace(0, 2 * pi, n + 1)
    belt = np.column_stack([0.165 * np.cos(angle), 0.21 * np.sin(angle), 1.03 + 0 * angle])
    cord = [tube(belt, 0.014, 6)]
    for y, low in ((0.05, 0.45), (0.08, 0.55)):
        drop = [(0.165, y, 1.03), (0.19, y, 0.9), (0.215, y + 0.01, 0.7), (0.245, y, low)]
        cord.append(tube(drop, 0.010, 6))
        cord.append(icosphere(1, 0.022).moved(0.245, y, low))
    feet = [
        blocks((x, y, 0.03), (0.24, 0.09, 0.06), 0.025) for x, y in ((0.2, 0.11), (0.13, -0.11))
    ]
    bowed = head(site).transformed(transform((0.02, 0, 1.59), (0, 0.28, 0)))
    parts = [(cloth, 0), (cord, 1), (feet, 4)]
    pieces = [piece.painted(slot) for some, slot in parts for piece in some]
    shape = join([*pieces, bowed])
    used = site.of("Robe", "Rope", "Skin", "Daisy", "Wood")
    at = side(NORTH) @ transform((4.35, -0.25, 0.015), (0, 0, pi - 0.05), 1.06)
    add("Monk", shape, *used, matrix=at, smooth=radians(50))
