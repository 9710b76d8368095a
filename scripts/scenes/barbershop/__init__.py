"""A barbershop: a closed room in which no patch is bare, whatever way a camera looks.

The middle of the room is the world's origin and the floor z = 0. An aisle is kept free for the
camera rigs. The left wall (−X) has the barbers' stations, the right wall (+X) the waiting bench,
the front wall (+Y) the shop window and the door, the back wall (−Y) the reception desk.

Frames: a *standing* mesh has z up and its front towards +Y; a *flat* mesh (a poster, a clock) lies
in x and y as the viewer sees them and faces +Z. `wall` gives the frame of a standing thing with its
back to a wall, and `hang` puts a flat one on it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from scipy.interpolate import CubicSpline

from scenes import common
from scenes.common import Array, Color, Shape

ROOM = (5.0, 7.5, 3.0)  # metres in x, y, z
HALF_X, HALF_Y, HEIGHT = ROOM[0] / 2, ROOM[1] / 2, ROOM[2]
WALL_THICKNESS = 0.15
SHARP_EDGE = np.radians(35)
PRINT_LAYER = 0.0005  # metres between the inks of a poster, so that no two faces coincide
FLOOR_TILE = 0.3125
MEDALLION_RADIUS = 0.8
CEILING_TILE = 0.5
WAINSCOT_HEIGHT = 1.0
FRIEZE_HEIGHT = 2.765
COUNTER_TOP, COUNTER_DEPTH = 0.86, 0.44
STATIONS = (-2.0, 0.0, 2.0)  # y of the barbers' stations
WINDOW_X, WINDOW_Z = (-2.05, 0.55), (1.0, 2.45)
DOOR_X, DOOR_HEIGHT, TRANSOM_TOP = (1.0, 1.95), 2.1, 2.45
BACK_DOOR_X = (-1.95, -1.1)
BEAMS = (-3.0, -1.5, 0.0, 1.5, 3.0)  # y of the ceiling beams
BEAM_SIZE = (0.15, 0.14)
WARM: Color = (1.0, 0.80, 0.58)
DAYLIGHT: Color = (0.80, 0.90, 1.0)
FLAT_TO_STANDING = (90, 0, 180)

Vector3 = Sequence[float]


# --- Building blocks ------------------------------------------------------------------------------


class Model:
    """Shapes with materials, gathered into one mesh."""

    def __init__(self) -> None:
        self.parts: list[Shape] = []
        self.materials: list[bpy.types.Material] = []

    def add(
        self,
        shape: Shape,
        material: bpy.types.Material,
        at: Vector3 = (0, 0, 0),
        turn: Vector3 = (0, 0, 0),
        scale: float | Vector3 = 1.0,
    ) -> None:
        """Add a shape, scaled, turned by XYZ Euler degrees, and moved."""
        if material not in self.materials:
            self.materials.append(material)
        slot = self.materials.index(material)
        matrix = common.transform(at, np.radians(turn), scale)
        self.parts.append(shape.painted(slot).transformed(matrix))

    def box(
        self,
        size: Vector3,
        material: bpy.types.Material,
        at: Vector3 = (0, 0, 0),
        turn: Vector3 = (0, 0, 0),
        bevel: float = 0.0,
        segments: int = 1,
    ) -> None:
        """Add a box given by its size and its centre."""
        self.add(rounded_box(tuple(size), bevel, segments), material, at, turn)

    def mesh(self, name: str) -> bpy.types.Mesh:
        return common.mesh(name, common.join(self.parts), *self.materials, smooth=SHARP_EDGE)


@dataclass
class Shop:
    """What every element needs: the random numbers, the detail and the materials."""

    rng: np.random.Generator
    detail: float
    m: SimpleNamespace

    def n(self, full: int, least: int = 3) -> int:
        """Segments of a curve that has `full` at detail 1; triangles go with its square."""
        return common.steps(full, self.detail**0.5, least)

    def copies(self, full: int, least: int = 1) -> int:
        """Number of props, `full` at detail 1."""
        return common.steps(full, self.detail**0.5, least)

    def lathe(self, profile: Sequence[Vector3], segments: int = 24) -> Shape:
        return common.lathe(profile, self.n(segments, 6))

    def tube(self, points: Sequence[Vector3], radius: Any, sides: int = 8) -> Shape:
        return common.tube(points, radius, self.n(sides, 4))

    def bend(self, points: Sequence[Vector3], radius: float, steps: int = 24) -> Shape:
        """A tube along a smooth curve through the points."""
        return self.tube(smooth_path(points, self.n(steps, 5)), radius)

    def ball(self, radius: float, segments: int = 16) -> Shape:
        angle = np.linspace(-np.pi / 2, np.pi / 2, self.n(segments // 2, 4) + 1)
        return self.lathe(np.column_stack([np.cos(angle), np.sin(angle)]) * radius, segments)

    def ring(self, radius: float, thickness: float, segments: int = 24, sides: int = 8) -> Shape:
        """A torus about Z."""
        a = np.linspace(0, 2 * np.pi, self.n(sides, 4) + 1)[:, None]
        x, y = circle(1.0, self.n(segments, 8)).T
        r = radius + thickness * np.cos(a)
        z = np.broadcast_to(thickness * np.sin(a), (len(a), len(x)))
        return common.sheet(np.stack([r * x, r * y, z], -1), closed=True)


@cache
def rounded_box(size: tuple[float, ...], bevel: float, segments: int) -> Shape:
    return common.box(size, bevel, segments)


@cache
def lettering(text: str, depth: float = PRINT_LAYER) -> Shape:
    """Flat letters, 1 m high and centred, in Blender's own font; `depth` is of their thickness."""
    curve = bpy.data.curves.new("lettering", "FONT")
    curve.body, curve.align_x, curve.align_y = text, "CENTER", "CENTER"
    curve.resolution_u, curve.extrude = 3, depth / 2
    thing = bpy.data.objects.new("lettering", curve)
    data = bpy.data.meshes.new_from_object(thing)
    data.calc_loop_triangles()
    vertices = np.empty(3 * len(data.vertices))
    triangles = np.empty(3 * len(data.loop_triangles), dtype=np.int32)
    data.vertices.foreach_get("co", vertices)
    data.loop_triangles.foreach_get("vertices", triangles)
    bpy.data.objects.remove(thing)
    bpy.data.curves.remove(curve)
    bpy.data.meshes.remove(data)
    return Shape(vertices.reshape(-1, 3), triangles=triangles.reshape(-1, 3))


def smooth_path(points: Sequence[Vector3], steps: int) -> Array:
    """A cubic spline through the points, evenly spaced in chord length."""
    p = np.asarray(points, float)
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    return np.asarray(CubicSpline(s, p)(np.linspace(0, s[-1], steps + 1)))


def circle(radius: float, segments: int, start: float = 0.0, stop: float = 360.0) -> Array:
    """Points (n, 2) of a circle or, with its angles in degrees, of an arc."""
    full = stop - start == 360
    angle = np.radians(np.linspace(start, stop, segments, endpoint=not full))
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def rectangle(width: float, height: float) -> Array:
    x, y = width / 2, height / 2
    return np.array([(-x, -y), (x, -y), (x, y), (-x, y)])


def frame(width: float, height: float, profile: Sequence[Vector3]) -> Shape:
    """A mitred frame round an opening, flat, of a profile of (outwards, towards the viewer)."""
    out, up = np.asarray(profile, float).T
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    half = np.array([width / 2, height / 2])
    points = np.empty((len(out), 4, 3))
    points[..., :2] = corners * (half + out[:, None, None])
    points[..., 2] = up[:, None]
    return common.sheet(points[::-1], closed=True)


def cushion(width: float, height: float, thickness: float, tufts: Sequence[int], n: int) -> Shape:
    """A padded panel, flat, front at +Z, with deep diamond tufts (columns, rows)."""
    u, v = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    edge = np.sqrt((1 - u**8) * (1 - v**8))
    a, b = u * tufts[0], v * tufts[1]
    puff = np.abs(np.sin(np.pi * (a + b) / 2) * np.sin(np.pi * (a - b) / 2)) ** 0.4
    z = thickness * edge * (0.6 + 0.4 * puff)
    front = common.sheet(np.stack([u * width / 2, v * height / 2, z], -1))
    back = common.prism(rectangle(width, height), 1e-4).moved(0, 0, -1e-4)
    return common.join([front, back])


def buttons(width: float, height: float, thickness: float, tufts: Sequence[int]) -> list[Vector3]:
    """Where the buttons of a `cushion` sit."""
    return [
        (a * width / 2 / tufts[0], b * height / 2 / tufts[1], 0.6 * thickness)
        for a in range(1 - tufts[0], tufts[0])
        for b in range(1 - tufts[1], tufts[1])
        if (a + b) % 2 == 0
    ]


def wall(side: str, along: float) -> Matrix:
    """The frame of something with its back to a wall: y into the room, z up, x to its own left.

    side: left, right, front or back; along: the world's y (left, right) or x (front, back).
    """
    location, degrees = {
        "left": ((-HALF_X, along, 0), -90),
        "right": ((HALF_X, along, 0), 90),
        "front": ((along, HALF_Y, 0), 180),
        "back": ((along, -HALF_Y, 0), 0),
    }[side]
    return common.transform(location, (0, 0, np.radians(degrees)))


def put(
    data: bpy.types.Mesh,
    where: Matrix,
    at: Vector3 = (0, 0, 0),
    turn: Vector3 = (0, 0, 0),
    scale: float | Vector3 = 1.0,
) -> None:
    """An instance of a mesh in a frame, turned by XYZ Euler degrees."""
    common.place(data.name, data, where @ common.transform(at, np.radians(turn), scale))


def hang(data: bpy.types.Mesh, where: Matrix, right: float, z: float, out: float = 0.0) -> None:
    """A flat mesh upright on a wall: `right` as the viewer sees it, z its centre's height."""
    put(data, where, (-right, out, z), FLAT_TO_STANDING)


# --- Materials ------------------------------------------------------------------------------------


def emissive(name: str, color: Color, strength: float) -> bpy.types.Material:
    """A glowing surface that lights nothing by itself: lamps do, and converge much sooner."""
    made = common.plain(
        name, color, Roughness=0.3, Emission_Color=(*color, 1.0), Emission_Strength=strength
    )
    made.cycles.emission_sampling = "NONE"
    return made


def glass(name: str, color: Color, clear: float = 1.0) -> bpy.types.Material:
    """Glass; `clear` below 1 is the glass of a bottle with cloudy lotion in it."""
    return common.plain(name, color, Roughness=0.0, Transmission_Weight=clear, IOR=1.45)


def pane(name: str, reflection: float) -> bpy.types.Material:
    """Thin glass that light passes straight through, as it does through two parallel faces."""
    made, graph = common.material(name)
    facing = graph.add("ShaderNodeLayerWeight", {"Blend": reflection}).outputs["Fresnel"]
    clear = graph.add("ShaderNodeBsdfTransparent", {"Color": (0.96, 0.98, 0.97)})
    mirror = graph.add("ShaderNodeBsdfGlossy", {"Color": (1.0, 1.0, 1.0), "Roughness": 0.0})
    return common.finish(
        made, graph, graph.add("ShaderNodeMixShader", {0: facing, 1: clear, 2: mirror})
    )


def wood(
    name: str, dark: Color, light: Color, roughness: float = 0.3, along: str = "Z"
) -> bpy.types.Material:
    """Grain along one of the object's axes, different in each piece of a mesh."""
    made, graph = common.material(name)
    shift = graph.math("MULTIPLY", graph.island_random(), 50.0)
    stretch = tuple(0.06 if axis == along else 1.0 for axis in "XYZ")
    place = graph.add("ShaderNodeVectorMath", {0: graph.coordinates(scale=stretch), 1: shift})
    grain = graph.noise(place, 24.0, detail=1.0)
    color = graph.ramp(grain, [(0.3, dark), (0.7, light)])
    shader = graph.principled(Base_Color=color, Roughness=roughness)
    return common.finish(made, graph, shader)


def speckled(name: str, stops: Any, scale: float, roughness: float) -> bpy.types.Material:
    """Stone or plaster: a colour ramp of noise."""
    made, graph = common.material(name)
    shift = graph.math("MULTIPLY", graph.island_random(), 50.0)
    place = graph.add("ShaderNodeVectorMath", {0: graph.coordinates(), 1: shift})
    color = graph.ramp(graph.noise(place, scale, detail=2.0), stops)
    return common.finish(made, graph, graph.principled(Base_Color=color, Roughness=roughness))


def wallpaper(ground: Color, ink: Color) -> bpy.types.Material:
    """An ogee damask of sine waves along the wall and up it."""
    made, graph = common.material("Wallpaper")
    xyz = graph.xyz(graph.coordinates(scale=2 * np.pi / 0.24))
    a = graph.math("COSINE", graph.math("ADD", xyz["X"], xyz["Y"]))
    b = graph.math("COSINE", graph.math("MULTIPLY", xyz["Z"], 0.5))
    leaf = graph.math("COSINE", graph.math("MULTIPLY", graph.math("MULTIPLY", a, b), 9.0))
    ogee = graph.math("ABSOLUTE", graph.math("ADD", a, graph.math("MULTIPLY", b, 1.4)))
    shown = graph.math(
        "MAXIMUM", graph.span(leaf, 0, 1, 0.3, 0.5), graph.span(ogee, 1, 0, 0.1, 0.2)
    )
    color = graph.mix(shown, (*ground, 1.0), (*ink, 1.0))
    return common.finish(made, graph, graph.principled(Base_Color=color, Roughness=0.6))


def cloth(name: str, color: Color) -> bpy.types.Material:
    return common.plain(name, color, Roughness=0.9, Sheen_Weight=0.3, Specular_IOR_Level=0.2)


def paint(name: str, color: Color, roughness: float = 0.35) -> bpy.types.Material:
    return common.plain(name, color, Roughness=roughness)


def metal(name: str, color: Color, roughness: float) -> bpy.types.Material:
    return common.plain(name, color, Roughness=roughness, Metallic=1.0)


def materials() -> SimpleNamespace:
    """Every material of the shop; colours are linear."""
    m = SimpleNamespace()
    reddish = (0.045, 0.013, 0.006), (0.16, 0.05, 0.02)
    m.mahogany = wood("Mahogany", *reddish)
    m.mahogany_along_x = wood("Mahogany along x", *reddish, along="X")
    m.oak = wood("Oak", (0.22, 0.11, 0.045), (0.42, 0.24, 0.11), 0.45)
    m.ebony = wood("Ebony", (0.012, 0.009, 0.007), (0.04, 0.028, 0.02))
    m.leather = paint("Oxblood leather", (0.19, 0.016, 0.013), 0.36)
    m.tan = paint("Tan leather", (0.26, 0.10, 0.03), 0.4)
    m.chrome = metal("Chrome", (0.80, 0.80, 0.82), 0.08)
    m.steel = metal("Steel", (0.56, 0.56, 0.58), 0.25)
    m.brass = metal("Brass", (0.72, 0.47, 0.17), 0.2)
    m.gold = metal("Gilt", (0.75, 0.52, 0.20), 0.34)
    m.iron = paint("Cast iron", (0.02, 0.021, 0.022), 0.5)
    m.mirror = metal("Mirror", (0.90, 0.92, 0.91), 0.0)
    m.marble = speckled(
        "Marble",
        [(0.3, (0.76, 0.74, 0.70)), (0.5, (0.70, 0.68, 0.64)), (0.56, (0.30, 0.29, 0.28))],
        3.0,
        0.12,
    )
    m.floor_light = speckled(
        "Cream tile", [(0.3, (0.62, 0.56, 0.45)), (0.7, (0.74, 0.69, 0.59))], 5.0, 0.16
    )
    m.floor_dark = speckled(
        "Black tile", [(0.35, (0.012, 0.012, 0.013)), (0.75, (0.05, 0.046, 0.042))], 5.0, 0.14
    )
    m.plaster = speckled(
        "Plaster", [(0.3, (0.60, 0.50, 0.35)), (0.7, (0.70, 0.60, 0.44))], 4.0, 0.8
    )
    m.wallpaper = wallpaper((0.030, 0.085, 0.065), (0.15, 0.19, 0.10))
    m.tin = paint("Tin ceiling", (0.66, 0.60, 0.48), 0.38)
    m.cream = paint("Cream enamel", (0.74, 0.66, 0.50), 0.25)
    m.cream_tiles = [
        paint(f"Cream glaze {i}", c, 0.13)
        for i, c in enumerate([(0.74, 0.68, 0.55), (0.68, 0.61, 0.47), (0.77, 0.72, 0.61)])
    ]
    m.green_tiles = [
        paint(f"Green glaze {i}", c, 0.12)
        for i, c in enumerate([(0.018, 0.085, 0.055), (0.013, 0.065, 0.045), (0.026, 0.11, 0.068)])
    ]
    m.grout = paint("Grout", (0.30, 0.27, 0.22), 0.9)
    m.porcelain = common.plain("Porcelain", (0.82, 0.80, 0.76), Roughness=0.08, Coat_Weight=0.3)
    m.pane = pane("Window pane", 0.12)
    m.bottles = [
        glass(f"Bottle glass {i}", c, clear=0.65)
        for i, c in enumerate(
            [
                (0.95, 0.96, 0.93),
                (0.90, 0.52, 0.16),
                (0.30, 0.66, 0.38),
                (0.25, 0.45, 0.90),
                (0.86, 0.80, 0.55),
                (0.80, 0.25, 0.22),
            ]
        )
    ]
    m.barbicide = glass("Disinfectant", (0.05, 0.35, 0.85))
    m.paper = paint("Paper", (0.78, 0.72, 0.58), 0.8)
    m.white = paint("White ink", (0.80, 0.79, 0.75), 0.5)
    m.black = paint("Black", (0.012, 0.012, 0.013), 0.35)
    m.rubber = paint("Rubber", (0.018, 0.018, 0.018), 0.8)
    m.red = paint("Red", (0.50, 0.028, 0.022), 0.35)
    m.blue = paint("Blue", (0.022, 0.065, 0.30), 0.35)
    m.navy = paint("Navy", (0.012, 0.024, 0.075), 0.5)
    m.teal = paint("Teal", (0.02, 0.22, 0.22), 0.4)
    m.green = paint("Green", (0.02, 0.12, 0.06), 0.4)
    m.ochre = paint("Ochre", (0.60, 0.29, 0.04), 0.45)
    m.skin = paint("Skin ink", (0.62, 0.36, 0.22), 0.6)
    m.inks = [m.red, m.navy, m.teal, m.ochre, m.black, m.green]
    m.towels = [
        cloth("White towel", (0.76, 0.74, 0.70)),
        cloth("Red towel", (0.42, 0.035, 0.03)),
        cloth("Blue towel", (0.05, 0.13, 0.28)),
        cloth("Sand towel", (0.55, 0.42, 0.27)),
    ]
    m.wool = [
        cloth("Grey wool", (0.055, 0.05, 0.048)),
        cloth("Camel wool", (0.30, 0.17, 0.07)),
        cloth("Green wool", (0.03, 0.06, 0.035)),
    ]
    m.rug = [
        cloth("Rug red", (0.24, 0.022, 0.018)),
        cloth("Rug navy", (0.018, 0.026, 0.07)),
        cloth("Rug sand", (0.46, 0.33, 0.17)),
    ]
    m.leaves = [
        paint(f"Leaf {i}", c, 0.42)
        for i, c in enumerate([(0.035, 0.13, 0.025), (0.06, 0.19, 0.035), (0.10, 0.22, 0.06)])
    ]
    m.terracotta = paint("Terracotta", (0.42, 0.14, 0.06), 0.75)
    m.soil = paint("Soil", (0.035, 0.022, 0.014), 0.95)
    m.bristle = paint("Bristle", (0.42, 0.28, 0.13), 0.8)
    m.hair = [
        paint("Brown hair", (0.045, 0.02, 0.009), 0.45),
        paint("Fair hair", (0.22, 0.11, 0.04), 0.45),
        paint("Black hair", (0.01, 0.008, 0.007), 0.4),
    ]
    m.soap = common.plain(
        "Soap",
        (0.80, 0.62, 0.42),
        Roughness=0.3,
        Subsurface_Weight=1.0,
        Subsurface_Radius=(1.0, 0.6, 0.35),
        Subsurface_Scale=0.015,
    )
    m.globe = emissive("Opal globe", WARM, 3.0)
    m.tube = emissive("Lamp tube", (1.0, 0.88, 0.72), 5.0)
    m.bulb = emissive("Bulb", WARM, 5.0)
    m.dark_glass = paint("Dark glass", (0.012, 0.018, 0.024), 0.03)
    m.brick = speckled("Brick", [(0.3, (0.26, 0.09, 0.05)), (0.7, (0.40, 0.17, 0.10))], 3.0, 0.9)
    m.stone = speckled(
        "Street stone", [(0.3, (0.22, 0.21, 0.20)), (0.7, (0.34, 0.33, 0.31))], 2.0, 0.9
    )
    return m


# --- The room -------------------------------------------------------------------------------------


def floor(shop: Shop) -> None:
    """Bevelled cream and black tiles over a bed of grout."""
    m, model = shop.m, Model()
    model.box((*ROOM[:2], 0.05), m.grout, (0, 0, -0.028))
    size = FLOOR_TILE - 0.004
    for i, j in np.ndindex(round(ROOM[0] / FLOOR_TILE), round(ROOM[1] / FLOOR_TILE)):
        at = ((i + 0.5) * FLOOR_TILE - HALF_X, (j + 0.5) * FLOOR_TILE - HALF_Y, -0.01)
        material = (m.floor_light, m.floor_dark)[(i + j) % 2]
        model.box((size, size, 0.02), material, at, bevel=0.003)
    put(model.mesh("Floor"), Matrix())


def medallion(shop: Shop) -> None:
    """An inlaid mosaic in the middle of the floor: rings of stones, a star, and the shop's name."""
    m, model = shop.m, Model()
    height = 0.0015
    model.add(common.prism(circle(MEDALLION_RADIUS, shop.n(96, 16)), 0.0005), m.grout)
    colours = [m.green_tiles, m.cream_tiles, m.cream_tiles, m.green_tiles, [m.red, m.ochre]]
    edges = [(0.74, 0.79), (0.68, 0.735), (0.47, 0.515), (0.42, 0.465), (0.36, 0.415)]
    for (inner, outer), shades in zip(edges, colours, strict=True):
        count = shop.n(round(2 * np.pi * outer / 0.05), 12)
        half = 180 / count * 0.93
        for k in range(count):
            arc = circle(1.0, 3, 360 * k / count - half, 360 * k / count + half)
            stone = np.concatenate([arc * outer, arc[::-1] * inner])
            model.add(common.prism(stone, height), shades[shop.rng.integers(len(shades))])
    band = common.prism(
        np.concatenate([circle(0.675, 97, 0, 359.9), circle(0.52, 97, 0, 359.9)[::-1]]), height
    )
    model.add(band, m.floor_dark)
    words = "BARBER SHOP  ·  EST. 1927  ·  "
    for k, letter in enumerate(words):
        angle = -360 * k / len(words) + 90
        if letter != " ":
            at = (*circle(0.595, 1, angle, angle + 1)[0], height + 0.0004)
            model.add(lettering(letter), m.brass, at, (0, 0, angle - 90), (0.13, 0.13, 1))
    model.add(common.prism(circle(0.355, shop.n(72, 12)), height), m.cream)
    for k in range(16):
        long, turn = (0.34, 0.24)[k % 2], 22.5 * k
        for side, shade in ((1, m.navy), (-1, m.ochre)):
            ray = [(0, 0), (long, 0), (long * 0.28, 0.05 * side)]
            lifted = height + (0.0016 if k % 2 == 0 else 0.0008)
            model.add(common.prism(ray[::side], lifted), shade, turn=(0, 0, turn))
    model.add(common.prism(circle(0.07, shop.n(40, 8)), height + 0.0024), m.brass)
    model.add(lettering("B"), m.floor_dark, (0, 0, height + 0.0028), scale=(0.12, 0.12, 1))
    put(model.mesh("Floor medallion"), Matrix())


def walls(shop: Shop) -> None:
    """Four walls; the front one is open for the window and the door."""
    m, t = shop.m, WALL_THICKNESS
    papered, plastered = Model(), Model()
    side = (t, ROOM[1] + 2 * t, HEIGHT)
    papered.box(side, m.wallpaper, (HALF_X + t / 2, 0, HEIGHT / 2))
    papered.box((ROOM[0], t, HEIGHT), m.wallpaper, (0, -HALF_Y - t / 2, HEIGHT / 2))
    plastered.box(side, m.plaster, (-HALF_X - t / 2, 0, HEIGHT / 2))
    front = [  # x from, x to, z from, z to
        (-HALF_X, WINDOW_X[0], 0, HEIGHT),
        (*WINDOW_X, 0, WINDOW_Z[0]),
        (*WINDOW_X, WINDOW_Z[1], HEIGHT),
        (WINDOW_X[1], DOOR_X[0], 0, HEIGHT),
        (*DOOR_X, TRANSOM_TOP, HEIGHT),
        (DOOR_X[1], HALF_X, 0, HEIGHT),
    ]
    for x0, x1, z0, z1 in front:
        at = ((x0 + x1) / 2, HALF_Y + t / 2, (z0 + z1) / 2)
        plastered.box((x1 - x0, t, z1 - z0), m.plaster, at)
    put(papered.mesh("Papered walls"), Matrix())
    put(plastered.mesh("Plastered walls"), Matrix())


def metro_tiles(shop: Shop) -> None:
    """Glazed tiles in running bond over the left wall, green below and cream above."""
    m, model = shop.m, Model()
    width, height, gap, rows, green_rows = 0.2, 0.1, 0.003, 23, 11
    model.box((ROOM[1], 0.004, rows * height), m.grout, (0, 0.002, rows * height / 2))
    for row in range(rows):
        glazes = m.green_tiles if row < green_rows else m.cream_tiles
        edges = np.arange(-HALF_Y - (row % 2) * width / 2, HALF_Y, width)
        for x0, x1 in zip(
            np.maximum(edges, -HALF_Y), np.minimum(edges + width, HALF_Y), strict=True
        ):
            if x1 - x0 > 0.02:
                size = (round(x1 - x0 - gap, 4), 0.012, height - gap)
                at = ((x0 + x1) / 2, 0.006, (row + 0.5) * height)
                model.box(size, glazes[shop.rng.integers(len(glazes))], at, bevel=0.004)
    for z in (green_rows * height, rows * height):
        model.box((ROOM[1], 0.02, 0.022), m.floor_dark, (0, 0.01, z), bevel=0.008, segments=2)
    put(model.mesh("Metro tiles"), wall("left", 0))
    sign = Model()
    words = lettering("HAIRCUTS  ·  HOT TOWELS  ·  SHAVES", 0.1)
    sign.add(words, m.gold, scale=(0.18, 0.18, 0.18))
    hang(sign.mesh("Wall lettering"), wall("left", 0), 0, 2.545, 0.01)


def wainscot(shop: Shop) -> None:
    """Raised mahogany panels below a chair rail, on three walls."""
    m, module, size = shop.m, Model(), 0.6
    module.box((size, 0.018, WAINSCOT_HEIGHT), m.mahogany, (0, 0.009, WAINSCOT_HEIGHT / 2))
    module.box((size, 0.035, 0.14), m.mahogany, (0, 0.0175, 0.07), bevel=0.006)
    for x in (-0.265, 0.265):
        module.box((0.07, 0.03, 0.86), m.mahogany, (x, 0.015, 0.5), bevel=0.004)
    for z, height in ((0.18, 0.08), (0.91, 0.09)):
        module.box((0.46, 0.028, height), m.mahogany, (0, 0.014, z), bevel=0.004)
    profile = [(-0.06, 0.02), (-0.02, 0.032), (0, 0.034), (0.012, 0.026), (0.02, 0.018)]
    panel = frame(0.42, 0.60, profile)
    module.add(panel, m.mahogany, (0, 0, 0.543), FLAT_TO_STANDING)
    module.box((0.31, 0.018, 0.49), m.mahogany, (0, 0.012, 0.543))
    rail = [(0.0, 0.0), (0.05, 0.0), (0.05, 0.02), (0.038, 0.032), (0.02, 0.045), (0.0, 0.05)]
    module.add(
        common.prism(rail, size), m.mahogany, (-size / 2, 0, WAINSCOT_HEIGHT - 0.03), (90, 0, 90)
    )
    data = module.mesh("Wainscot")
    runs = [
        ("right", -HALF_Y, HALF_Y),
        ("back", -HALF_X, BACK_DOOR_X[0] - 0.09),
        ("back", BACK_DOOR_X[1] + 0.09, HALF_X),
        ("front", -HALF_X, DOOR_X[0] - 0.09),
        ("front", DOOR_X[1] + 0.09, HALF_X),
    ]
    for side, start, stop in runs:
        count = round((stop - start) / size)
        width = (stop - start) / count
        for i in range(count):
            put(data, wall(side, start + (i + 0.5) * width), scale=(width / size, 1, 1))


def ceiling(shop: Shop) -> None:
    """Pressed tin tiles, dark beams and a cornice."""
    m, n = shop.m, shop.n(32, 6)
    u, v = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    square, r = np.maximum(np.abs(u), np.abs(v)), np.hypot(u, v)
    petals = 0.5 + 0.5 * np.cos(8 * np.arctan2(v, u))
    relief = (
        0.020 * np.exp(-(((square - 0.92) / 0.05) ** 2))
        + 0.012 * np.exp(-(((square - 0.74) / 0.04) ** 2))
        + 0.022 * np.exp(-(((r - 0.42) / 0.14) ** 2)) * petals
        + 0.030 * np.exp(-((r / 0.13) ** 2))
    )
    side = CEILING_TILE / 2
    tile = common.mesh("Tin tile", common.grid(u[0] * side, v[:, 0] * side, relief), m.tin)
    for i, j in np.ndindex(round(ROOM[0] / CEILING_TILE), round(ROOM[1] / CEILING_TILE)):
        x, y = (i + 0.5) * CEILING_TILE - HALF_X, (j + 0.5) * CEILING_TILE - HALF_Y
        put(tile, Matrix(), (x, y, HEIGHT), (180, 0, 0))
    slab = Model()
    slab.box((ROOM[0] + 0.3, ROOM[1] + 0.3, 0.1), m.plaster, (0, 0, HEIGHT + 0.051))
    put(slab.mesh("Ceiling slab"), Matrix())
    beam = Model()
    width, height = BEAM_SIZE
    beam.add(rounded_box((height, width, ROOM[0]), 0.012, 2), m.mahogany_along_x, turn=(0, 90, 0))
    for x in np.arange(-2.25, 2.3, 0.5):  # dentils under the beam's edge
        for y in (-width / 2 - 0.008, width / 2 + 0.008):
            beam.box(
                (0.12, 0.016, 0.05), m.mahogany_along_x, (x, y, height / 2 - 0.03), bevel=0.005
            )
    data = beam.mesh("Beam")
    for y in BEAMS:
        put(data, Matrix(), (0, y, HEIGHT - height / 2))
    steps = np.linspace(0, np.pi / 2, shop.n(8, 3))
    cove = np.column_stack([-0.13 + 0.09 * np.sin(steps), 0.035 + 0.10 * (1 - np.cos(steps))])
    profile = [(-0.15, 0.0), (-0.15, 0.03), *cove, (-0.03, 0.16), (0, 0.16)]
    cornice = Model()
    cornice.add(frame(ROOM[0], ROOM[1], profile), m.cream)
    put(cornice.mesh("Cornice"), Matrix(), (0, 0, HEIGHT), (180, 0, 0))


def frieze(shop: Shop) -> None:
    """A picture rail round the room and a stencilled row of palmettes above it."""
    m, rail, n = shop.m, Model(), shop.n(16, 5)
    rail.add(
        frame(ROOM[0], ROOM[1], [(-0.03, 0.0), (-0.038, 0.012), (-0.03, 0.035), (0, 0.045)]),
        m.mahogany,
    )
    rail.add(frame(ROOM[0], ROOM[1], [(0, 0.0), (-0.03, 0.0)][::-1]), m.mahogany)
    put(rail.mesh("Picture rail"), Matrix(), (0, 0, FRIEZE_HEIGHT - 0.09))
    motif = Model()
    petal = common.prism(circle(0.5, n) * (0.022, 0.06) + (0, 0.035), PRINT_LAYER)
    for k in range(5):
        motif.add(petal, (m.green, m.red)[k % 2], (0, -0.03, 0), (0, 0, 35 * (k - 2)))
    motif.add(common.prism(circle(0.012, n), 2 * PRINT_LAYER), m.ochre, (0, -0.03, 0))
    for sign in (-1, 1):
        scroll = [(0, -0.045, 0), (sign * 0.05, -0.055, 0), (sign * 0.085, -0.03, 0)]
        curl = [(sign * 0.075, 0.0, 0), (sign * 0.055, -0.005, 0), (sign * 0.06, -0.022, 0)]
        motif.add(shop.bend([*scroll, *curl], 0.003, 16), m.ochre)
    data = motif.mesh("Frieze palmette")
    for side, length in (
        ("left", ROOM[1]),
        ("right", ROOM[1]),
        ("front", ROOM[0]),
        ("back", ROOM[0]),
    ):
        count = round(length / 0.208)
        for i in range(count):
            along = (i + 0.5) * length / count - length / 2
            hang(data, wall(side, along), 0, FRIEZE_HEIGHT, 0.0008)


def casing(shop: Shop, width: float, height: float) -> Model:
    """A moulded wooden frame round an opening, flat."""
    profile = [(0, -0.05), (0, 0.03), (0.015, 0.04), (0.07, 0.034), (0.075, 0.045), (0.09, 0.045)]
    model = Model()
    model.add(frame(width, height, [*profile, (0.09, 0.0)]), shop.m.mahogany)
    return model


def shop_window(shop: Shop) -> None:
    """The window with mullions, a sill, gilt letters for those outside, and a valance."""
    m = shop.m
    width, height = WINDOW_X[1] - WINDOW_X[0], WINDOW_Z[1] - WINDOW_Z[0]
    where = wall("front", sum(WINDOW_X) / 2)
    z = sum(WINDOW_Z) / 2
    model = casing(shop, width, height)
    reveal = frame(width, height, [(-0.001, -WALL_THICKNESS), (-0.001, 0.0)])
    model.add(reveal, m.mahogany)
    for x in (-width / 6, width / 6):
        model.box((0.05, height, 0.06), m.mahogany, (x, 0, -0.07), bevel=0.008)
    model.box((width, 0.05, 0.06), m.mahogany, (0, 0.35, -0.07), bevel=0.008)
    hang(model.mesh("Window frame"), where, 0, z)
    sheet = Model()
    sheet.add(common.grid([-width / 2, width / 2], [-height / 2, height / 2]), m.pane)
    hang(sheet.mesh("Window pane"), where, 0, z, -0.075)
    sill = Model()
    sill.box((width + 0.3, 0.26, 0.035), m.mahogany_along_x, (0, 0.06, 0), bevel=0.012, segments=2)
    put(sill.mesh("Window sill"), where, (0, 0, WINDOW_Z[0] - 0.0175))
    letters = Model()
    for text, up, size in (("BARBER SHOP", 0.02, 0.34), ("EST. 1927", -0.3, 0.15)):
        letters.add(lettering(text, 0.004), m.gold, (0, up, 0), scale=(size, size, 1))
    put(letters.mesh("Window letters"), where, (0, -0.078, z), (90, 0, 0))
    x = np.linspace(-width / 2 - 0.1, width / 2 + 0.1, shop.n(160, 24))
    drop = np.linspace(-1, 0, shop.n(10, 3))[:, None]
    folds = 0.025 * np.sin(x * 40) * (0.4 - 0.6 * drop)
    y = drop * (0.26 + 0.05 * np.cos(x * 2 * np.pi / 0.35))
    valance = Model()
    points = np.stack([np.broadcast_to(x, y.shape), y, np.broadcast_to(folds, y.shape)], -1)
    valance.add(common.sheet(points), m.towels[1])
    valance.add(shop.tube([(x[0] - 0.04, 0, 0), (x[-1] + 0.04, 0, 0)], 0.014), m.brass)
    for end in (x[0] - 0.04, x[-1] + 0.04):
        valance.add(shop.ball(0.028), m.brass, (end, 0, 0))
        valance.add(shop.tube([(0, 0, 0), (0, 0, -0.09)], 0.008), m.brass, (end * 0.985, 0, 0))
    hang(valance.mesh("Valance"), where, 0, WINDOW_Z[1] + 0.06, 0.09)


def shop_door(shop: Shop) -> None:
    """A glazed door with a transom light, handle, kick plate, bell and an OPEN sign."""
    m = shop.m
    width = DOOR_X[1] - DOOR_X[0]
    where = wall("front", sum(DOOR_X) / 2)
    around = casing(shop, width, TRANSOM_TOP)
    around.add(frame(width, TRANSOM_TOP, [(-0.001, -WALL_THICKNESS), (-0.001, 0)]), m.mahogany)
    around.box(
        (width, 0.06, 0.07),
        m.mahogany,
        (0, DOOR_HEIGHT - TRANSOM_TOP / 2 + 0.03, -0.06),
        bevel=0.008,
    )
    hang(around.mesh("Door frame"), where, 0, TRANSOM_TOP / 2)
    door = Model()
    for x in (-width / 2 + 0.06, width / 2 - 0.06):
        door.box(
            (0.12, 0.045, DOOR_HEIGHT - 0.01),
            m.mahogany,
            (x, 0, DOOR_HEIGHT / 2 + 0.005),
            bevel=0.006,
        )
    for z, height in ((0.13, 0.24), (0.82, 0.16), (DOOR_HEIGHT - 0.07, 0.14)):
        door.box((width - 0.24, 0.043, height), m.mahogany, (0, 0, z), bevel=0.005)
    door.box((width - 0.24, 0.02, 0.5), m.mahogany, (0, 0, 0.5))
    profile = [(-0.05, 0.012), (-0.03, 0.02), (0, 0.022)]
    door.add(frame(width - 0.24, 0.49, profile), m.mahogany, (0, 0, 0.495), FLAT_TO_STANDING)
    door.box((width - 0.1, 0.003, 0.2), m.brass, (0, 0.024, 0.12))
    door.add(
        shop.bend(
            [(0, 0.02, -0.15), (0, 0.07, -0.1), (0, 0.075, 0.0), (0, 0.07, 0.1), (0, 0.02, 0.15)],
            0.011,
        ),
        m.brass,
        (-width / 2 + 0.06, 0, 1.05),
    )
    door.box((0.05, 0.006, 0.4), m.brass, (-width / 2 + 0.06, 0.025, 1.05), bevel=0.002)
    door.box((0.22, 0.008, 0.05), m.brass, (0, 0.026, 0.82), bevel=0.003)
    put(door.mesh("Door"), where, (0, -0.06, 0))
    for name, low, high in (
        ("Door pane", 0.90, DOOR_HEIGHT - 0.14),
        ("Transom pane", DOOR_HEIGHT + 0.06, TRANSOM_TOP),
    ):
        sheet = Model()
        sheet.add(common.grid([-width / 2, width / 2], [low, high]), m.pane)
        hang(sheet.mesh(name), where, 0, 0, -0.062)
    sign = Model()
    sign.box((0.3, 0.16, 0.006), m.cream, bevel=0.002)
    sign.add(lettering("CLOSED"), m.red, (0, 0, 0.0033), scale=(0.065, 0.065, 1))
    sign.add(lettering("OPEN"), m.green, (0, 0, -0.0033), (0, 180, 0), scale=(0.09, 0.09, 1))
    for x in (-0.13, 0.13):
        sign.add(shop.tube([(x, 0.075, 0), (0, 0.28, -0.01)], 0.0015, 5), m.iron)
    hang(sign.mesh("Door sign"), where, 0, 1.5, -0.04)
    bell = Model()
    bell.add(
        shop.lathe([(0.045, 0), (0.034, 0.02), (0.026, 0.05), (0.012, 0.065), (0.0, 0.068)]),
        m.brass,
        (0, 0.12, 0),
    )
    bell.add(
        shop.bend([(0, 0, 0.02), (0, 0.03, 0.12), (0, 0.1, 0.12), (0, 0.12, 0.06)], 0.005), m.brass
    )
    put(bell.mesh("Door bell"), where, (-0.2, 0, 2.2))
    number = Model()
    number.add(lettering("27", 0.01), m.gold, (0, 0, 0), (0, 180, 0), (0.2, 0.2, 1))
    hang(number.mesh("House number"), where, 0, (DOOR_HEIGHT + TRANSOM_TOP) / 2 + 0.03, -0.07)


def back_door(shop: Shop) -> None:
    """The panelled door of the staff room, with a frosted light."""
    m = shop.m
    width, height = BACK_DOOR_X[1] - BACK_DOOR_X[0], 2.05
    where = wall("back", sum(BACK_DOOR_X) / 2)
    hang(casing(shop, width, height).mesh("Staff door frame"), where, 0, height / 2)
    door = Model()
    door.box((width, 0.02, height), m.mahogany, (0, 0.01, height / 2))
    raised = [(-0.06, 0.022), (-0.04, 0.036), (0, 0.036), (0.02, 0.036), (0.025, 0.02)]
    for x in (-0.2, 0.2):
        for z, tall in ((0.5, 0.6), (1.05, 0.3)):
            door.add(frame(0.28, tall, raised), m.mahogany, (x, 0, z), FLAT_TO_STANDING)
    door.add(frame(0.62, 0.55, raised), m.mahogany, (0, 0, 1.62), FLAT_TO_STANDING)
    door.box((0.6, 0.012, 0.53), m.cream, (0, 0.021, 1.62))
    door.add(lettering("STAFF"), m.black, (0, 0.0275, 1.64), FLAT_TO_STANDING, (0.15, 0.15, 1))
    door.add(lettering("private"), m.black, (0, 0.0275, 1.52), FLAT_TO_STANDING, (0.07, 0.07, 1))
    door.add(
        shop.lathe(
            [(0.026, 0), (0.012, 0.01), (0.012, 0.035), (0.03, 0.045), (0.026, 0.065), (0, 0.07)]
        ),
        m.brass,
        (-0.37, 0.02, 1.0),
        (-90, 0, 0),
    )
    door.box((0.05, 0.006, 0.2), m.brass, (-0.37, 0.022, 0.98), bevel=0.002)
    put(door.mesh("Staff door"), where)


def street(shop: Shop) -> None:
    """What the window shows: pavement, road, brick houses with windows and awnings, a lamp."""
    m, model = shop.m, Model()
    model.box((24, 2.6, 0.1), m.stone, (0, 5.3, -0.15))
    model.box((24, 5.0, 0.1), m.iron, (0, 9.1, -0.25))
    model.box((24, 1.6, 0.1), m.stone, (0, 12.3, -0.15))
    model.box((24, 0.3, 9), m.brick, (0, 13.2, 4.4))
    for i, x in enumerate(np.arange(-10.5, 11, 1.75)):
        for z in (4.2, 7.0):
            model.box((1.0, 0.12, 1.5), m.white, (x, 13.05, z), bevel=0.02)
            model.box((0.84, 0.14, 1.34), m.dark_glass, (x, 13.03, z))
            model.box((0.04, 0.16, 1.34), m.white, (x, 13.02, z))
            model.box((0.84, 0.16, 0.04), m.white, (x, 13.02, z + 0.1))
            model.box((1.2, 0.3, 0.1), m.stone, (x, 12.98, z - 0.8))
        model.box((1.6, 0.1, 2.2), (m.teal, m.ochre, m.green)[i // 2 % 3], (x, 13.04, 1.2))
        model.box((1.35, 0.14, 1.5), m.dark_glass, (x, 13.02, 1.35))
        model.box((0.05, 0.16, 1.5), m.white, (x + 0.3 * (-1) ** i, 13.01, 1.35))
        model.box((1.5, 0.16, 0.05), m.white, (x, 13.01, 1.75))
        model.box((1.5, 0.2, 0.28), m.mahogany, (x, 13.0, 2.75))
        trade = lettering(("BAKER", "TAILOR", "BOOKS", "HATS", "SHOES", "TEA")[i % 6], 0.02)
        model.add(trade, m.gold, (x, 12.88, 2.75), (90, 0, 0), (0.24, 0.24, 1))
        for k in range(7):
            stripe = (m.red, m.white)[k % 2] if i // 2 % 2 else (m.green, m.white)[k % 2]
            model.box((0.25, 1.0, 0.02), stripe, (x + (k - 3) * 0.25, 12.6, 2.55), (25, 0, 0))
    put(model.mesh("Street"), Matrix())
    lamp = Model()
    lamp.add(
        shop.lathe([(0.16, -0.1), (0.16, 0.2), (0.07, 0.35), (0.05, 2.9), (0.09, 3.0)]), m.iron
    )
    lamp.add(
        shop.lathe([(0.08, 3.0), (0.17, 3.4), (0.19, 3.42), (0.03, 3.6), (0.0, 3.66)]), m.cream
    )
    put(lamp.mesh("Street lamp"), Matrix(), (-2.6, 6.2, 0))


# --- Lamps and lights -----------------------------------------------------------------------------


def hidden_area(
    name: str,
    matrix: Matrix,
    size: tuple[float, float],
    watts: float,
    color: Color,
    spread: float = 180.0,
) -> None:
    """An area light that no camera or mirror sees; what seems to shine is a glowing mesh."""
    lamp = common.area_light(name, matrix, size, watts, color)
    lamp.data.spread = np.radians(spread)
    lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False


def lights(shop: Shop) -> None:
    """A few large lights, which converge soon: daylight, a low sun, and the lamps' own light."""
    window = common.transform(
        (sum(WINDOW_X) / 2, HALF_Y - 0.16, sum(WINDOW_Z) / 2), (-np.pi / 2, 0, 0)
    )
    hidden_area("Daylight", window, (2.4, 1.3), 45, DAYLIGHT)
    place, aim = Vector((0.9, 8.5, 4.9)), Vector((-0.1, 2.2, 0.0))
    sun = Matrix.Translation(place) @ (aim - place).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    hidden_area("Sun", sun, (4.2, 2.2), 260, (1.0, 0.86, 0.66), spread=2.5)
    fill = common.transform((0, 0, 2.05), (np.pi, 0, 0))
    hidden_area("Ceiling fill", fill, (3.6, 6.0), 48, WARM)
    for y, watts in ((BEAMS[1], 125), (BEAMS[3], 80)):  # the back has no daylight
        pair = common.transform((0, y, 2.03))
        hidden_area("Pendant light", pair, (2.8, 0.6), watts, WARM)
    tubes = wall("left", 0) @ common.transform((0, 0.16, 2.36), np.radians((35, 0, 0)))
    hidden_area("Mirror light", tubes, (5.2, 0.14), 56, (1.0, 0.9, 0.76))


def sky(strength: float = 1.6) -> None:
    """A plain bright sky, which lights the street but is not sampled from inside the room."""
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    graph = common.Graph(world.node_tree)
    background = graph.add(
        "ShaderNodeBackground", {"Color": (0.72, 0.86, 1.0), "Strength": strength}
    )
    graph.add("ShaderNodeOutputWorld", {"Surface": background})
    world.cycles.sampling_method = "NONE"


def pendant_lamps(shop: Shop) -> None:
    """Four opal globes on brass rods."""
    m, model = shop.m, Model()
    model.add(shop.lathe([(0.07, 0.62), (0.07, 0.6), (0.045, 0.57), (0.02, 0.555)]), m.brass)
    model.add(shop.tube([(0, 0, 0.14), (0, 0, 0.58)], 0.009), m.brass)
    model.add(
        shop.lathe([(0.03, 0.19), (0.06, 0.17), (0.075, 0.13), (0.08, 0.11), (0.0, 0.11)][::-1]),
        m.brass,
    )
    model.add(shop.ball(0.15, 32), m.globe)
    model.add(shop.ring(0.151, 0.006, 40), m.brass)
    model.add(shop.lathe([(0.0, -0.19), (0.012, -0.18), (0.012, -0.16), (0.03, -0.145)]), m.brass)
    data = model.mesh("Pendant lamp")
    for x in (-1.15, 1.15):
        for y in (BEAMS[1], BEAMS[3]):
            put(data, Matrix(), (x, y, 2.25))


def ceiling_fan(shop: Shop) -> None:
    """A brass motor with five wooden blades and a light bowl."""
    m, motor = shop.m, Model()
    motor.add(
        shop.lathe(
            [
                (0.0, -0.02),
                (0.09, -0.01),
                (0.14, 0.03),
                (0.15, 0.09),
                (0.11, 0.13),
                (0.04, 0.15),
                (0.018, 0.16),
                (0.018, 0.3),
                (0.07, 0.33),
                (0.075, 0.35),
            ],
            32,
        ),
        m.brass,
    )
    motor.add(
        shop.lathe([(0.0, -0.15), (0.06, -0.14), (0.11, -0.1), (0.13, -0.04), (0.12, -0.01)], 32),
        m.globe,
    )
    motor.add(shop.ring(0.13, 0.008, 32), m.brass, (0, 0, -0.03))
    for x in (-0.09, 0.09):
        motor.add(shop.tube([(x, 0.1, -0.02), (x, 0.1, -0.25)], 0.0025, 5), m.brass)
        motor.add(shop.ball(0.012), m.ebony, (x, 0.1, -0.26))
    where = common.transform((0, 0, 2.51))
    put(motor.mesh("Fan motor"), where)
    blade = Model()
    outline = [
        (0.2, -0.045),
        (0.3, -0.06),
        (0.66, -0.075),
        (0.7, -0.05),
        (0.715, 0.0),
        (0.7, 0.05),
        (0.66, 0.075),
        (0.3, 0.06),
        (0.2, 0.045),
    ]
    blade.add(common.prism(outline, 0.008), m.mahogany_along_x, turn=(12, 0, 0))
    blade.box((0.14, 0.035, 0.006), m.brass, (0.2, 0, -0.006), (12, 0, 0), bevel=0.002)
    data = blade.mesh("Fan blade")
    for i in range(5):
        put(data, where, (0, 0, 0.06), (0, 0, 72 * i + 20))


def sconces(shop: Shop) -> None:
    """Brass arms with opal tulips along the right and the back wall."""
    m, model = shop.m, Model()
    model.add(
        shop.lathe([(0.055, 0), (0.05, 0.012), (0.02, 0.02), (0.0, 0.022)]),
        m.brass,
        turn=(-90, 0, 0),
    )
    model.add(
        shop.bend([(0, 0.015, 0), (0, 0.08, -0.05), (0, 0.15, -0.03), (0, 0.16, 0.04)], 0.008),
        m.brass,
    )
    model.add(shop.lathe([(0.012, 0), (0.035, 0.01), (0.038, 0.03)]), m.brass, (0, 0.16, 0.03))
    model.add(
        shop.lathe(
            [
                (0.03, 0),
                (0.055, 0.03),
                (0.06, 0.08),
                (0.05, 0.12),
                (0.07, 0.15),
                (0.066, 0.15),
                (0.045, 0.12),
                (0.0, 0.05),
            ],
            28,
        ),
        m.globe,
        (0, 0.16, 0.055),
    )
    data = model.mesh("Wall lamp")
    for side, along in (
        ("right", -1.05),
        ("right", 1.35),
        ("back", -0.82),
        ("back", 0.82),
        ("front", 0.77),
    ):
        put(data, wall(side, along), (0, 0, 2.12 if side != "front" else 2.3))


# --- Furniture ------------------------------------------------------------------------------------


def tufted(
    model: Model,
    shop: Shop,
    size: Vector3,
    tufts: Sequence[int],
    leather: bpy.types.Material,
    at: Vector3,
    turn: Vector3,
) -> None:
    """Add a buttoned cushion of (width, height, thickness) to a model, flat before it is turned."""
    width, height, thickness = size
    matrix = common.transform(at, np.radians(turn))
    model.add(
        cushion(width, height, thickness, tufts, shop.n(12 * max(tufts), 8)), leather, at, turn
    )
    button = shop.ball(0.009, 8)
    for spot in buttons(width, height, thickness, tufts):
        model.add(button, leather, matrix @ Vector(spot), turn, (1, 1, 0.6))


def barber_chairs(shop: Shop) -> None:
    """Three hydraulic chairs of chrome, enamel and buttoned leather, turned to their mirrors."""
    m, model = shop.m, Model()
    model.add(
        shop.lathe(
            [
                (0.33, 0),
                (0.33, 0.02),
                (0.30, 0.05),
                (0.14, 0.075),
                (0.10, 0.10),
                (0.085, 0.2),
                (0.085, 0.28),
            ],
            40,
        ),
        m.chrome,
    )
    model.add(shop.lathe([(0.06, 0.24), (0.06, 0.36), (0.15, 0.38), (0.16, 0.40)], 32), m.steel)
    model.add(shop.ring(0.33, 0.012, 40), m.rubber, (0, 0, 0.014))
    model.box((0.50, 0.50, 0.07), m.cream, (0, 0.02, 0.435), bevel=0.02, segments=3)
    model.box((0.52, 0.52, 0.10), m.leather, (0, 0.03, 0.515), bevel=0.035, segments=3)
    tufted(model, shop, (0.50, 0.50, 0.05), (4, 4), m.leather, (0, 0.03, 0.56), (0, 0, 0))
    back = common.transform((0, -0.25, 0.58), (np.radians(14), 0, 0))
    model.add(
        rounded_box((0.48, 0.07, 0.56), 0.03, 3).transformed(back),
        m.cream,
        back @ Vector((0, 0, 0.27)) - back.translation,
    )
    trim = [(-0.012, 0.0), (-0.012, 0.006), (0.0, 0.01), (0.012, 0.006), (0.012, 0.0)]
    behind = back @ Vector((0, -0.036, 0.28))
    model.add(frame(0.36, 0.42, trim), m.chrome, behind, (90 + 14, 0, 0))
    model.add(
        common.prism(circle(0.5, shop.n(40, 8)), 0.004),
        m.brass,
        behind,
        (104, 0, 0),
        (0.2, 0.13, 1),
    )
    plate = back @ Vector((0, -0.0405, 0.28))
    model.add(lettering("FINEST"), m.black, plate, (104, 0, 0), (0.045, 0.05, 1))
    for x in (-0.165, 0.165):
        for z in (-0.195, 0.195):
            stud = back @ Vector((x, -0.036, 0.28 + z))
            model.add(shop.ball(0.012, 12), m.brass, stud)
    tufted(
        model,
        shop,
        (0.46, 0.54, 0.07),
        (4, 4),
        m.leather,
        back @ Vector((0, 0.03, 0.28)),
        (90 - 14, 0, 180),
    )
    for x in (-0.09, 0.09):
        model.add(
            shop.tube([back @ Vector((x, 0, 0.5)), back @ Vector((x, 0.01, 0.68))], 0.009),
            m.chrome,
        )
    model.add(
        rounded_box((0.27, 0.09, 0.13), 0.04, 3),
        m.leather,
        back @ Vector((0, 0.02, 0.72)),
        (14, 0, 0),
    )
    for x in (-0.31, 0.31):
        model.add(
            shop.bend(
                [
                    (x, 0.24, 0.42),
                    (x, 0.30, 0.55),
                    (x, 0.27, 0.71),
                    (x, 0.0, 0.735),
                    (x, -0.24, 0.72),
                    (x, -0.26, 0.6),
                    (x, -0.2, 0.44),
                ],
                0.017,
                40,
            ),
            m.chrome,
        )
        model.box((0.04, 0.34, 0.05), m.cream, (x, 0.02, 0.44), bevel=0.012, segments=2)
        model.box((0.075, 0.40, 0.05), m.leather, (x, 0.02, 0.765), bevel=0.022, segments=3)
        model.add(
            shop.bend(
                [
                    (x * 0.7, 0.22, 0.40),
                    (x * 0.72, 0.36, 0.34),
                    (x * 0.7, 0.45, 0.18),
                    (x * 0.66, 0.52, 0.13),
                ],
                0.014,
            ),
            m.chrome,
        )
    model.add(rounded_box((0.34, 0.05, 0.20), 0.02, 3), m.leather, (0, 0.345, 0.29), (-38, 0, 0))
    model.box((0.44, 0.20, 0.018), m.iron, (0, 0.54, 0.125), (18, 0, 0), bevel=0.006)
    for k in range(6):
        model.box(
            (0.40, 0.012, 0.01),
            m.chrome,
            (0, 0.46 + 0.032 * k, 0.112 + 0.0104 * k),
            (18, 0, 0),
            bevel=0.003,
        )
    model.add(
        shop.bend(
            [(0.12, 0.0, 0.30), (0.30, -0.04, 0.30), (0.38, -0.05, 0.36), (0.40, -0.05, 0.47)],
            0.011,
        ),
        m.chrome,
    )
    model.add(shop.ball(0.024), m.ebony, (0.40, -0.05, 0.48))
    data = model.mesh("Barber chair")
    mat = Model()
    mat.add(
        shop.lathe([(0.60, 0.001), (0.60, 0.007), (0.575, 0.012), (0.56, 0.009), (0.0, 0.009)], 56),
        m.rubber,
    )
    for k in range(7):
        mat.add(shop.ring(0.14 + 0.06 * k, 0.003, 48, 6), m.rubber, (0, 0, 0.009))
    rubber = mat.mesh("Chair mat")
    for y, turn in zip(STATIONS, (38, 14, -24), strict=True):
        put(data, Matrix(), (-1.38, y, 0.009), (0, 0, 90 + turn))
        put(rubber, Matrix(), (-1.40, y, 0))


def counter(shop: Shop) -> None:
    """The cabinets along the left wall: doors and drawers in turn under one marble slab."""
    m, width, length = shop.m, 0.64, 6.4
    raised = [(-0.05, 0.004), (-0.03, 0.018), (0, 0.02), (0.015, 0.006), (0.02, 0.0)]
    knob = shop.lathe([(0.008, 0), (0.008, 0.014), (0.017, 0.02), (0.014, 0.03), (0, 0.032)], 16)
    front, top = COUNTER_DEPTH - 0.03, COUNTER_TOP - 0.04
    drawers, doors = Model(), Model()
    for model in (drawers, doors):
        model.box((width, front, top - 0.09), m.mahogany, (0, front / 2, 0.09 + (top - 0.09) / 2))
        model.box((width, front - 0.06, 0.09), m.ebony, (0, (front - 0.06) / 2, 0.045))
        for x in (-width / 2, width / 2):
            model.box(
                (0.05, 0.02, top - 0.09),
                m.mahogany,
                (x, front, 0.09 + (top - 0.09) / 2),
                bevel=0.006,
            )
    for k in range(4):
        z = 0.18 + 0.175 * k
        drawers.add(frame(0.50, 0.11, raised), m.mahogany, (0, front, z), FLAT_TO_STANDING)
        for x in (-0.15, 0.15):
            drawers.add(knob, m.brass, (x, front + 0.002, z), (-90, 0, 0))
    for x in (-0.15, 0.15):
        doors.add(frame(0.23, 0.60, raised), m.mahogany, (x, front, 0.45), FLAT_TO_STANDING)
        doors.add(knob, m.brass, (x * 0.25, front + 0.002, 0.55), (-90, 0, 0))
    kinds = (drawers.mesh("Counter drawers"), doors.mesh("Counter doors"))
    for i in range(10):
        put(kinds[i % 2], wall("left", (i - 4.5) * width))
    slab = Model()
    slab.box(
        (length + 0.04, COUNTER_DEPTH, 0.04),
        m.marble,
        (0, COUNTER_DEPTH / 2, COUNTER_TOP - 0.02),
        bevel=0.012,
        segments=3,
    )
    slab.box((length + 0.04, 0.022, 0.09), m.marble, (0, 0.023, COUNTER_TOP + 0.045), bevel=0.006)
    put(slab.mesh("Counter top"), wall("left", 0))


def mirrors(shop: Shop) -> None:
    """A gilt mirror at each station with a beaded frame, bulbs on both sides and a tube above."""
    m, width, height, z = shop.m, 0.92, 1.1, 1.62
    model = Model()
    model.add(
        common.grid([-width / 2, width / 2], [-height / 2, height / 2]), m.mirror, (0, 0, 0.026)
    )
    profile = [
        (-0.006, 0.02),
        (-0.006, 0.034),
        (0.008, 0.04),
        (0.03, 0.03),
        (0.06, 0.05),
        (0.085, 0.05),
        (0.095, 0.03),
        (0.095, 0.0),
    ]
    model.add(frame(width, height, profile), m.gold)
    bead = shop.ball(0.008, 8)
    for sign in (-1, 1):
        for t in np.linspace(-0.5, 0.5, shop.n(44)):
            model.add(bead, m.gold, (t * width, sign * (height / 2 + 0.03), 0.034))
            model.add(bead, m.gold, (sign * (width / 2 + 0.03), t * height, 0.034))
    crest = circle(0.2, shop.n(24, 8), 20, 160) * (1.6, 0.6)
    model.add(common.prism(crest, 0.03), m.gold, (0, height / 2 + 0.045, 0.012))
    model.add(shop.ball(0.04, 20), m.gold, (0, height / 2 + 0.125, 0.04), scale=(1, 1, 0.5))
    for sign in (-1, 1):
        spiral = [
            (
                sign * (0.10 + (0.055 - 0.004 * k) * np.cos(0.7 * k)),
                height / 2 + 0.12 + (0.04 - 0.003 * k) * np.sin(0.7 * k),
                0.045,
            )
            for k in range(12)
        ]
        model.add(shop.bend(spiral, 0.008, 30), m.gold)
    data = model.mesh("Station mirror")
    strip = Model()
    strip.box((0.07, 1.1, 0.03), m.brass, (0, 0, 0.015), bevel=0.008, segments=2)
    for k in range(4):
        strip.add(
            shop.lathe([(0.028, 0), (0.024, 0.016), (0.018, 0.02)], 20),
            m.brass,
            (0, -0.42 + 0.28 * k, 0.03),
        )
        strip.add(shop.ball(0.036, 20), m.bulb, (0, -0.42 + 0.28 * k, 0.075))
    bulbs = strip.mesh("Bulb strip")
    lamp = Model()
    lamp.box((0.98, 0.07, 0.05), m.chrome, (0, 0, 0.025), bevel=0.012, segments=2)
    lamp.add(shop.tube([(-0.46, 0, 0.075), (0.46, 0, 0.075)], 0.019, 16), m.tube)
    for x in (-0.47, 0.47):
        lamp.add(shop.tube([(x - 0.02, 0, 0.075), (x + 0.02, 0, 0.075)], 0.026, 16), m.chrome)
        lamp.box((0.03, 0.04, 0.06), m.chrome, (x, 0, 0.05))
    tube = lamp.mesh("Mirror tube")
    for y in STATIONS:
        where = wall("left", y)
        hang(data, where, 0, z, 0.012)
        for x in (-0.625, 0.625):
            hang(bulbs, where, x, z, 0.012)
        hang(tube, where, 0, 2.41, 0.0)


def basins(shop: Shop) -> None:
    """A porcelain bowl with a swan-neck tap at each station."""
    m, bowl, tap = shop.m, Model(), Model()
    outer = [(0.09, 0), (0.14, 0.02), (0.185, 0.08), (0.20, 0.13)]
    inner = [(0.205, 0.14), (0.19, 0.135), (0.17, 0.08), (0.12, 0.03), (0.02, 0.02), (0.0, 0.02)]
    bowl.add(shop.lathe([*outer, *inner], 40), m.porcelain, scale=(1.15, 0.85, 1))
    bowl.add(shop.lathe([(0.026, 0.021), (0.026, 0.026), (0.0, 0.026)], 20), m.chrome)
    tap.add(shop.lathe([(0.028, 0), (0.028, 0.012), (0.014, 0.03)], 20), m.chrome)
    tap.add(
        shop.bend(
            [(0, 0, 0.02), (0, 0, 0.2), (0, 0.03, 0.26), (0, 0.09, 0.27), (0, 0.13, 0.22)],
            0.011,
            30,
        ),
        m.chrome,
    )
    for x in (-0.07, 0.07):
        tap.add(
            shop.lathe([(0.018, 0), (0.01, 0.02), (0.01, 0.05), (0.0, 0.052)], 16),
            m.chrome,
            (x, 0, 0),
        )
        for turn in (0, 90):
            tap.add(
                shop.tube([(-0.026, 0, 0.045), (0.026, 0, 0.045)], 0.006),
                m.chrome,
                (x, 0, 0),
                (0, 0, turn),
            )
    basin, faucet = bowl.mesh("Basin"), tap.mesh("Tap")
    for y in STATIONS:
        put(basin, wall("left", y), (0, 0.24, COUNTER_TOP))
        put(faucet, wall("left", y), (0, 0.06, COUNTER_TOP))


def waiting_bench(shop: Shop) -> None:
    """A buttoned leather bench with rolled arms and turned feet."""
    m, model = shop.m, Model()
    length, depth = 2.0, 0.72
    model.box((length, depth - 0.08, 0.16), m.leather, (0, depth / 2, 0.21), bevel=0.02, segments=2)
    for x in (-0.49, 0.49):
        model.box((0.95, 0.54, 0.10), m.leather, (x, 0.42, 0.34), bevel=0.04, segments=3)
        tufted(model, shop, (0.92, 0.50, 0.05), (6, 3), m.leather, (x, 0.42, 0.385), (0, 0, 0))
    model.add(
        rounded_box((length - 0.1, 0.12, 0.52), 0.05, 3), m.leather, (0, 0.12, 0.56), (10, 0, 0)
    )
    tufted(
        model,
        shop,
        (length - 0.14, 0.42, 0.09),
        (12, 3),
        m.leather,
        (0, 0.175, 0.60),
        (80, 0, 180),
    )
    model.add(
        shop.tube([(-length / 2 + 0.02, 0.06, 0.82), (length / 2 - 0.02, 0.06, 0.82)], 0.07, 20),
        m.leather,
    )
    arm = shop.lathe(
        [
            (0.0, 0),
            (0.05, 0.004),
            (0.085, 0.01),
            (0.09, 0.03),
            (0.09, 0.63),
            (0.085, 0.65),
            (0.05, 0.655),
            (0.0, 0.658),
        ],
        24,
    )
    for sign in (-1, 1):
        x = sign * (length / 2 + 0.02)
        model.box((0.15, 0.64, 0.40), m.leather, (x, 0.38, 0.33), bevel=0.03, segments=2)
        model.add(arm, m.leather, (x, 0.06, 0.55), (-90, 0, 0))
        model.add(shop.ball(0.014, 10), m.brass, (x, 0.72, 0.55), scale=(1, 0.5, 1))
        for t in np.linspace(0.16, 0.48, shop.n(12)):
            model.add(shop.ball(0.006, 6), m.brass, (x + sign * 0.055, 0.703, t))
            model.add(shop.ball(0.006, 6), m.brass, (x - sign * 0.055, 0.703, t))
        for y in (0.1, 0.62):
            model.add(
                shop.lathe(
                    [(0.025, 0), (0.03, 0.03), (0.045, 0.07), (0.03, 0.1), (0.04, 0.14)], 20
                ),
                m.ebony,
                (x, y, 0),
            )
    put(model.mesh("Waiting bench"), wall("right", 0.15))


def low_table(shop: Shop) -> None:
    """A low table with turned legs, magazines fanned on it, and a rug below."""
    m, model = shop.m, Model()
    model.box((0.42, 0.9, 0.03), m.mahogany, (0, 0, 0.415), bevel=0.01, segments=2)
    model.box((0.34, 0.82, 0.06), m.mahogany, (0, 0, 0.37), bevel=0.004)
    model.box((0.32, 0.78, 0.016), m.mahogany, (0, 0, 0.13), bevel=0.004)
    leg = shop.lathe(
        [
            (0.014, 0.004),
            (0.02, 0.03),
            (0.016, 0.1),
            (0.026, 0.13),
            (0.018, 0.2),
            (0.027, 0.3),
            (0.02, 0.35),
            (0.024, 0.4),
        ],
        20,
    )
    for x in (-0.16, 0.16):
        for y in (-0.39, 0.39):
            model.add(leg, m.mahogany, (x, y, 0))
    where = common.transform((1.24, 0.15, 0.008))
    put(model.mesh("Low table"), where)
    issues = [magazine(shop, i) for i in range(6)]
    for k in range(shop.copies(7, 2)):
        put(
            issues[k % 6],
            where,
            (-0.02 + 0.015 * k, -0.28 + 0.055 * k, 0.4305 + 0.0062 * k),
            (0, 0, -100 + 13 * k),
        )
    for k in range(shop.copies(12, 2)):
        turn = shop.rng.uniform(-8, 8) + 90
        put(
            issues[(k * 5 + 1) % 6],
            where,
            (0, 0.18 * (k % 2 * 2 - 1), 0.1385 + 0.0062 * (k // 2)),
            (0, 0, turn),
        )
    put(ashtray(shop), where, (0.05, 0.33, 0.4305))
    rug = Model()
    for i, (width, length) in enumerate([(0.78, 1.9), (0.70, 1.82), (0.64, 1.76), (0.5, 1.62)]):
        rug.box(
            (width, length, 0.004), m.rug[(0, 2, 1, 0)[i]], (0, 0, 0.002 + 0.0012 * i), bevel=0.001
        )
    for k in range(5):
        rug.add(
            common.prism(rectangle(0.2, 0.2), 0.0015),
            m.rug[k % 2 + 1],
            (0, (k - 2) * 0.3, 0.007),
            (0, 0, 45),
        )
        rug.add(
            common.prism(rectangle(0.1, 0.1), 0.0015),
            m.rug[2 - k % 2],
            (0, (k - 2) * 0.3, 0.008),
            (0, 0, 45),
        )
    for x in np.linspace(-0.38, 0.38, shop.n(60, 8)):
        for sign in (-1, 1):
            rug.box(
                (0.006, 0.06, 0.003),
                m.rug[2],
                (x, sign * 0.975, 0.0025),
                (0, 0, shop.rng.uniform(-12, 12)),
            )
    put(rug.mesh("Rug"), common.transform((1.24, 0.15, 0.0)))


def magazine(shop: Shop, number: int) -> bpy.types.Mesh:
    """A magazine whose cover is a composition of its own."""
    m, model = shop.m, Model()
    title = ("SHAVE", "GENT", "SPORT", "MOTOR", "JAZZ", "RADIO")[number]
    ink, other = m.inks[number], m.inks[(number + 2) % 6]
    model.box((0.20, 0.27, 0.006), m.paper, (0, 0, 0.003), bevel=0.0012)
    model.add(
        common.prism(rectangle(0.199, 0.269), 0.0002),
        (m.ochre, m.paper, m.cream)[number % 3],
        (0, 0, 0.006),
    )
    model.add(common.prism(rectangle(0.199, 0.06), 0.0002), ink, (0, 0.1, 0.0062))
    model.add(lettering(title), m.white, (0, 0.1, 0.0067), scale=(0.06, 0.06, 0.5))
    model.add(common.prism(circle(0.065, shop.n(28, 8)), 0.0002), other, (0, -0.02, 0.0062))
    model.add(common.prism(circle(0.04, shop.n(24, 6), 0, 180), 0.0002), m.skin, (0, -0.03, 0.0064))
    for k in range(4):
        model.add(
            common.prism(rectangle(0.07 - 0.01 * k, 0.006), 0.0002),
            m.black,
            (-0.05, -0.09 - 0.01 * k, 0.0062),
        )
    return model.mesh(f"Magazine {title.lower()}")


def ashtray(shop: Shop) -> bpy.types.Mesh:
    """A heavy dish of amber glass."""
    model = Model()
    profile = [
        (0.05, 0),
        (0.065, 0.004),
        (0.07, 0.035),
        (0.062, 0.04),
        (0.054, 0.034),
        (0.045, 0.012),
        (0, 0.01),
    ]
    model.add(shop.lathe(profile, 28), shop.m.bottles[1])
    return model.mesh("Ashtray")


def radiator(shop: Shop) -> None:
    """A cast-iron radiator below the window, with a valve and pipes."""
    m, section = shop.m, Model()
    for y in (-0.05, 0.05):
        section.add(
            shop.bend([(0, y, 0.09), (0, y, 0.2), (0, y, 0.5), (0, y, 0.62)], 0.022, 12), m.cream
        )
    for z in (0.09, 0.36, 0.63):
        section.add(rounded_box((0.05, 0.16, 0.05), 0.02, 3), m.cream, (0, 0, z))
    data = section.mesh("Radiator section")
    where = wall("front", -0.75)
    count = 20
    for i in range(count):
        put(data, where, ((i - (count - 1) / 2) * 0.058, 0.14, 0.03))
    pipes = Model()
    end = count * 0.029
    for sign in (-1, 1):
        pipes.add(
            shop.bend(
                [
                    (sign * end, 0, 0.12),
                    (sign * (end + 0.08), 0, 0.12),
                    (sign * (end + 0.1), 0, 0.09),
                    (sign * (end + 0.1), 0, 0.0),
                ],
                0.012,
            ),
            m.brass,
        )
        pipes.box((0.05, 0.10, 0.09), m.cream, (sign * (end - 0.06), 0, 0.045), bevel=0.01)
    pipes.add(
        shop.lathe([(0.012, 0), (0.03, 0.008), (0.032, 0.03), (0.022, 0.045), (0, 0.048)], 16),
        m.brass,
        (end + 0.09, 0, 0.135),
    )
    put(pipes.mesh("Radiator pipes"), where, (0, 0.14, 0))


def reception(shop: Shop) -> None:
    """The desk with the till in front of the back wall, and its stool."""
    m, model = shop.m, Model()
    width, depth, height = 1.5, 0.5, 1.0
    model.box((width, depth, height - 0.12), m.mahogany, (0, 0, (height - 0.12) / 2 + 0.08))
    model.box((width - 0.08, depth - 0.08, 0.08), m.ebony, (0, 0, 0.04))
    model.box(
        (width + 0.08, depth + 0.08, 0.04), m.marble, (0, 0, height - 0.02), bevel=0.012, segments=3
    )
    raised = [(-0.06, 0.006), (-0.04, 0.022), (0, 0.024), (0.02, 0.008), (0.025, 0.0)]
    for x in (-0.49, 0.0, 0.49):
        model.add(frame(0.34, 0.56, raised), m.mahogany, (x, depth / 2, 0.5), FLAT_TO_STANDING)
        model.add(shop.ring(0.09, 0.008, 32), m.brass, (x, depth / 2 + 0.006, 0.5), (90, 0, 0))
        model.add(
            lettering("B", 0.01),
            m.brass,
            (x, depth / 2 + 0.008, 0.5),
            FLAT_TO_STANDING,
            (0.13, 0.13, 1),
        )
    for x in (-0.735, -0.245, 0.245, 0.735):
        model.add(
            shop.lathe(
                [
                    (0.03, 0.1),
                    (0.035, 0.14),
                    (0.022, 0.18),
                    (0.026, 0.5),
                    (0.022, 0.82),
                    (0.035, 0.86),
                    (0.03, 0.9),
                ],
                20,
            ),
            m.mahogany,
            (x, depth / 2, 0),
        )
    model.add(frame(0.34, 0.56, raised), m.mahogany, (-width / 2, 0, 0.5), (90, 0, -90))
    model.add(
        shop.tube([(-0.7, depth / 2 + 0.09, 0.16), (0.7, depth / 2 + 0.09, 0.16)], 0.017, 16),
        m.brass,
    )
    for x in (-0.65, 0, 0.65):
        model.add(shop.tube([(x, depth / 2, 0.12), (x, depth / 2 + 0.09, 0.16)], 0.009), m.brass)
    where = common.transform((1.68, -2.45, 0))
    put(model.mesh("Reception desk"), where)
    put(till(shop), where, (0.42, -0.02, height))
    put(desk_bell(shop), where, (-0.1, 0.12, height))
    put(telephone(shop), where, (0.02, -0.1, height), (0, 0, 160))
    put(lolly_jar(shop), where, (-0.58, 0.06, height))
    put(card_box(shop), where, (-0.36, 0.12, height), (0, 0, 12))
    put(ledger(shop), where, (-0.33, -0.08, height), (0, 0, -8))
    stool = Model()
    stool.add(
        shop.lathe([(0.16, 0.66), (0.18, 0.67), (0.185, 0.70), (0.15, 0.73), (0.0, 0.735)], 32),
        m.tan,
    )
    stool.add(shop.tube([(0, 0, 0.2), (0, 0, 0.67)], 0.02, 12), m.chrome)
    for k in range(4):
        x, y = circle(0.22, 4)[k]
        stool.add(
            shop.bend([(0, 0, 0.24), (x * 0.5, y * 0.5, 0.2), (x, y, 0.0)], 0.012, 10), m.chrome
        )
    stool.add(shop.ring(0.13, 0.008, 32), m.chrome, (0, 0, 0.28))
    put(stool.mesh("Stool"), common.transform((1.45, -3.05, 0)))


def till(shop: Shop) -> bpy.types.Mesh:
    """An old cash register: drawer, keys, price flags and a crank."""
    m, model = shop.m, Model()
    model.box((0.42, 0.40, 0.12), m.mahogany, (0, 0, 0.06), bevel=0.008, segments=2)
    model.box((0.36, 0.006, 0.08), m.brass, (0, 0.203, 0.06), bevel=0.002)
    model.add(
        shop.lathe([(0.008, 0), (0.016, 0.014), (0, 0.022)], 16),
        m.brass,
        (0, 0.205, 0.06),
        (-90, 0, 0),
    )
    side = [
        (-0.18, 0),
        (0.19, 0),
        (0.19, 0.05),
        (0.06, 0.16),
        (-0.02, 0.28),
        (-0.14, 0.30),
        (-0.18, 0.26),
    ]
    model.add(common.prism(side, 0.38), m.gold, (-0.19, 0, 0.12), (90, 0, 90))
    key = shop.lathe([(0.004, 0), (0.004, 0.02), (0.012, 0.021), (0.012, 0.027), (0, 0.028)], 12)
    for row in range(4):
        for column in range(8):
            at = (-0.14 + 0.04 * column, 0.17 - 0.03 * row, 0.186 + 0.0254 * row)
            model.add(key, (m.porcelain, m.red)[column == 7], at, (-40, 0, 0))
    model.box((0.32, 0.10, 0.12), m.gold, (0, -0.09, 0.46), bevel=0.012, segments=2)
    model.box((0.28, 0.11, 0.07), m.black, (0, -0.09, 0.465))
    for x, digit in ((-0.09, "5"), (-0.03, "2"), (0.03, "."), (0.09, "1")):
        model.box((0.05, 0.004, 0.055), m.white, (x, -0.033, 0.465))
        model.add(lettering(digit), m.black, (x, -0.0305, 0.465), FLAT_TO_STANDING, (0.05, 0.05, 1))
    model.add(
        shop.bend(
            [(-0.19, 0, 0.25), (-0.225, 0, 0.25), (-0.225, 0.05, 0.30), (-0.225, 0.10, 0.33)], 0.006
        ),
        m.chrome,
    )
    model.add(shop.ball(0.016), m.ebony, (-0.24, 0.10, 0.33), scale=(1.6, 1, 1))
    for x in (-0.19, 0.19):
        model.add(shop.ring(0.05, 0.006, 24), m.brass, (x, -0.05, 0.27), (0, 90, 0))
    return model.mesh("Till")


def desk_bell(shop: Shop) -> bpy.types.Mesh:
    model = Model()
    model.add(shop.lathe([(0.042, 0), (0.042, 0.008), (0.03, 0.012)], 28), shop.m.ebony)
    model.add(
        shop.lathe(
            [
                (0.04, 0.014),
                (0.038, 0.03),
                (0.025, 0.043),
                (0.006, 0.048),
                (0.004, 0.056),
                (0.0, 0.058),
            ],
            28,
        ),
        shop.m.brass,
    )
    return model.mesh("Desk bell")


def telephone(shop: Shop) -> bpy.types.Mesh:
    """A black rotary telephone."""
    m, model = shop.m, Model()
    body = [(-0.1, 0), (0.1, 0), (0.1, 0.03), (0.03, 0.1), (-0.06, 0.11), (-0.1, 0.05)]
    model.add(common.prism(body, 0.18), m.black, (-0.09, 0, 0), (90, 0, 90))
    model.add(
        shop.lathe([(0.055, 0), (0.052, 0.01), (0.02, 0.014), (0, 0.014)], 28),
        m.steel,
        (0, 0.066, 0.066),
        (-45, 0, 0),
    )
    for x, y in circle(0.037, 10):
        spot = common.transform((0, 0.066, 0.066), (np.radians(-45), 0, 0)) @ Vector((x, y, 0.009))
        model.add(shop.ball(0.008, 8), m.white, spot, scale=(1, 1, 0.7))
    model.add(
        shop.bend(
            [
                (-0.12, -0.03, 0.14),
                (-0.08, -0.03, 0.155),
                (0.08, -0.03, 0.155),
                (0.12, -0.03, 0.14),
            ],
            0.014,
        ),
        m.black,
    )
    for x in (-0.115, 0.115):
        model.add(
            shop.lathe([(0.03, 0), (0.032, 0.02), (0.015, 0.04)], 20), m.black, (x, -0.03, 0.105)
        )
    model.box((0.1, 0.03, 0.03), m.black, (0, -0.03, 0.12), bevel=0.008)
    return model.mesh("Telephone")


def lolly_jar(shop: Shop) -> bpy.types.Mesh:
    """A jar of lollies; its glass is one thin surface, seen through without refraction."""
    m, model = shop.m, Model()
    wall_profile = [(0.06, 0.004), (0.07, 0.02), (0.07, 0.14), (0.05, 0.17)]
    model.add(common.lathe(wall_profile, shop.n(28, 8), capped=False), m.pane)
    model.add(shop.lathe([(0.064, 0), (0.064, 0.004)], 28), m.steel)
    for k in range(shop.copies(40, 6)):
        r, angle = 0.055 * np.sqrt(shop.rng.uniform()), shop.rng.uniform(0, 2 * np.pi)
        at = (r * np.cos(angle), r * np.sin(angle), shop.rng.uniform(0.02, 0.13))
        model.add(shop.ball(0.013, 10), m.inks[k % 6], at)
        model.add(
            shop.tube([(0, 0, 0), (0, 0, 0.07)], 0.0015, 5),
            m.white,
            at,
            shop.rng.uniform(-25, 25, 3),
        )
    return model.mesh("Lolly jar")


def card_box(shop: Shop) -> bpy.types.Mesh:
    m, model = shop.m, Model()
    model.box((0.10, 0.06, 0.025), m.oak, (0, 0, 0.0125), bevel=0.003)
    for k in range(6):
        model.box(
            (0.085, 0.001, 0.05),
            (m.white, m.paper)[k % 2],
            (0, -0.02 + 0.006 * k, 0.045),
            (12, 0, 0),
        )
    return model.mesh("Card box")


def ledger(shop: Shop) -> bpy.types.Mesh:
    """An open appointment book with ruled and written lines, and a pen."""
    m, model = shop.m, Model()
    model.box((0.36, 0.25, 0.006), m.leather, (0, 0, 0.003), bevel=0.002)
    for sign in (-1, 1):
        model.box(
            (0.17, 0.235, 0.012), m.paper, (sign * 0.087, 0, 0.012), (0, sign * 2, 0), bevel=0.003
        )
        for k in range(14):
            width = 0.13 if k == 0 else shop.rng.uniform(0.05, 0.14)
            model.box(
                (width, 0.003, 0.0006),
                (m.navy, m.red)[k == 0],
                (sign * 0.085 - (0.14 - width) / 2, 0.1 - 0.015 * k, 0.0195),
                (0, sign * 2, 0),
            )
    model.add(shop.tube([(0.02, -0.06, 0.026), (0.13, 0.03, 0.024)], 0.004, 10), m.black)
    return model.mesh("Appointment book")


# --- Bottles, jars and tools ----------------------------------------------------------------------

BOTTLE_OUTLINES = {  # radius and height in units of 0.1 m
    "tonic": [
        (0.30, 0),
        (0.34, 0.04),
        (0.34, 1.2),
        (0.28, 1.4),
        (0.11, 1.55),
        (0.11, 1.8),
        (0.13, 1.85),
    ],
    "cologne": [
        (0.36, 0),
        (0.40, 0.05),
        (0.40, 0.8),
        (0.30, 1.0),
        (0.10, 1.05),
        (0.10, 1.25),
        (0.12, 1.3),
    ],
    "bay rum": [
        (0.26, 0),
        (0.30, 0.05),
        (0.27, 0.6),
        (0.32, 1.3),
        (0.22, 1.6),
        (0.09, 1.75),
        (0.09, 2.1),
        (0.11, 2.15),
    ],
    "witch hazel": [
        (0.38, 0),
        (0.42, 0.06),
        (0.42, 1.5),
        (0.36, 1.65),
        (0.15, 1.75),
        (0.14, 1.95),
        (0.17, 2.0),
    ],
    "oil": [(0.20, 0), (0.24, 0.04), (0.24, 0.9), (0.12, 1.05), (0.08, 1.4), (0.10, 1.45)],
    "flask": [
        (0.22, 0),
        (0.44, 0.1),
        (0.48, 0.45),
        (0.36, 0.8),
        (0.12, 1.0),
        (0.09, 1.5),
        (0.13, 1.55),
    ],
}


def bottles(shop: Shop) -> list[bpy.types.Mesh]:
    """Glass bottles of six outlines in several colours, with printed labels and stoppers."""
    m, made = shop.m, []
    for i, (name, outline) in enumerate(BOTTLE_OUTLINES.items()):
        profile = np.array(outline) * 0.1
        body = shop.lathe(profile, 28)
        neck_r, top = profile[-1]
        straight = profile[2]
        for variant in range(3):
            model = Model()
            model.add(body, m.bottles[(i + 2 * variant) % len(m.bottles)])
            ink = m.inks[(i + variant) % len(m.inks)]
            low, high = 0.25 * straight[1], 0.85 * straight[1]
            r = max(straight[0], profile[1][0]) + 0.0008
            if name != "flask":
                for r_band, z0, z1, paper in (
                    (r, low, high, m.paper),
                    (r + 0.0004, low + 0.008, low + 0.016, ink),
                    (r + 0.0004, 0.55 * high + 0.45 * low, high - 0.008, ink),
                ):
                    model.add(
                        common.lathe([(r_band, z0), (r_band, z1)], shop.n(28, 6), capped=False),
                        paper,
                    )
            stopper = (m.brass, m.black, m.oak)[(i + variant) % 3]
            model.add(
                shop.lathe(
                    [
                        (neck_r * 0.9, 0.0005),
                        (neck_r * 1.1, 0.006),
                        (neck_r * 1.1, 0.018),
                        (neck_r * 0.7, 0.024),
                    ],
                    20,
                ),
                stopper,
                (0, 0, top),
            )
            if variant == 1:
                model.add(shop.ball(neck_r * 1.3, 14), stopper, (0, 0, top + 0.03))
            made.append(model.mesh(f"Bottle {name} {variant}"))
    return made


def jars(shop: Shop) -> list[bpy.types.Mesh]:
    """Tins, pomade jars, a talc shaker, cotton wool, disinfectant with combs, soap and candles."""
    m, made = shop.m, []
    for i in range(4):
        tin = Model()
        r, h = 0.034 + 0.006 * (i % 2), 0.03 + 0.012 * i
        tin.add(shop.lathe([(r, 0), (r, h * 0.6)], 28), m.inks[i])
        tin.add(
            shop.lathe([(r + 0.001, h * 0.6), (r + 0.001, h - 0.003), (r - 0.003, h), (0, h)], 28),
            (m.gold, m.steel)[i % 2],
        )
        tin.add(
            lettering(("WAX", "CLAY", "BALM", "SOAP")[i]),
            m.black,
            (0, 0, h),
            scale=(0.016, 0.016, 1),
        )
        made.append(tin.mesh(f"Pomade tin {i}"))
    for i in range(2):
        talc = Model()
        talc.add(
            shop.lathe([(0.03, 0), (0.034, 0.006), (0.034, 0.13), (0.02, 0.155)], 24),
            (m.cream, m.teal)[i],
            scale=(1, 0.65, 1),
        )
        talc.add(
            common.lathe([(0.0345, 0.04), (0.0345, 0.1)], shop.n(24, 6), capped=False),
            (m.red, m.paper)[i],
            scale=(1, 0.65, 1),
        )
        talc.add(shop.lathe([(0.02, 0), (0.022, 0.014), (0.012, 0.02)], 20), m.brass, (0, 0, 0.153))
        made.append(talc.mesh(f"Talc {i}"))
    cotton = Model()
    cotton.add(
        common.lathe(
            [(0.045, 0.002), (0.05, 0.008), (0.05, 0.11), (0.044, 0.12)],
            shop.n(28, 8),
            capped=False,
        ),
        m.pane,
    )
    cotton.add(shop.lathe([(0.046, 0), (0.046, 0.003)], 28), m.steel)
    for _ in range(shop.copies(34, 5)):
        r, angle = 0.034 * np.sqrt(shop.rng.uniform()), shop.rng.uniform(0, 2 * np.pi)
        cotton.add(
            shop.ball(0.015, 10),
            m.white,
            (r * np.cos(angle), r * np.sin(angle), shop.rng.uniform(0.018, 0.10)),
        )
    cotton.add(
        shop.lathe([(0.047, 0), (0.047, 0.01), (0.012, 0.02), (0.014, 0.03), (0, 0.035)], 28),
        m.chrome,
        (0, 0, 0.12),
    )
    made.append(cotton.mesh("Cotton jar"))
    combs = Model()
    combs.add(shop.lathe([(0.042, 0), (0.046, 0.005), (0.046, 0.16)], 28), m.barbicide)
    combs.add(shop.lathe([(0.048, 0.1602), (0.048, 0.172), (0.03, 0.176)], 28), m.chrome)
    for k in range(3):
        combs.box(
            (0.022, 0.004, 0.09),
            (m.black, m.oak, m.red)[k],
            (-0.015 + 0.015 * k, 0, 0.205),
            (6 * k - 6, 8 * k - 8, 20 * k),
            bevel=0.0015,
        )
    made.append(combs.mesh("Disinfectant jar"))
    spray = Model()
    spray.add(
        shop.lathe([(0.034, 0), (0.038, 0.006), (0.038, 0.10), (0.015, 0.135), (0.015, 0.15)], 24),
        m.bottles[3],
    )
    spray.add(rounded_box((0.022, 0.07, 0.024), 0.006, 2), m.black, (0, 0.016, 0.165))
    spray.add(shop.bend([(0, 0.02, 0.155), (0, 0.04, 0.14), (0, 0.038, 0.115)], 0.004, 8), m.red)
    made.append(spray.mesh("Spray bottle"))
    soap = Model()
    soap.add(
        shop.lathe([(0.03, 0), (0.06, 0.008), (0.064, 0.014), (0.055, 0.012), (0, 0.008)], 28),
        m.porcelain,
        scale=(1, 0.75, 1),
    )
    soap.box((0.075, 0.05, 0.026), m.soap, (0, 0, 0.026), (0, 0, 12), bevel=0.011, segments=3)
    made.append(soap.mesh("Soap dish"))
    candle = Model()
    candle.add(
        shop.lathe([(0.03, 0), (0.03, 0.075), (0.022, 0.078), (0.018, 0.072), (0, 0.07)], 24),
        m.soap,
    )
    candle.add(shop.tube([(0, 0, 0.068), (0.001, 0, 0.084)], 0.0012, 5), m.black)
    candle.add(shop.lathe([(0.05, 0), (0.054, 0.004), (0.04, 0.006)], 24), m.brass)
    made.append(candle.mesh("Candle"))
    mug = Model()
    mug.add(
        shop.lathe(
            [(0.03, 0), (0.04, 0.01), (0.045, 0.075), (0.041, 0.075), (0.036, 0.02), (0, 0.015)], 28
        ),
        m.porcelain,
    )
    mug.add(common.lathe([(0.0435, 0.035), (0.0446, 0.055)], shop.n(28, 6), capped=False), m.navy)
    mug.add(
        shop.bend([(0.042, 0, 0.06), (0.07, 0, 0.06), (0.068, 0, 0.025), (0.038, 0, 0.018)], 0.005),
        m.porcelain,
    )
    mug.add(
        shop.lathe([(0.009, 0), (0.013, 0.02), (0.009, 0.05), (0.013, 0.055)], 16),
        m.ebony,
        (0.01, 0, 0.035),
        (0, 24, 0),
    )
    mug.add(
        shop.lathe([(0.011, 0), (0.02, 0.035), (0.012, 0.05), (0, 0.052)], 20),
        m.bristle,
        (0.033, 0, 0.087),
        (0, 24, 0),
    )
    made.append(mug.mesh("Shaving mug"))
    return made


def scissors(shop: Shop) -> bpy.types.Mesh:
    """Barber's scissors, lying open on z = 0."""
    model = Model()
    blade = [(-0.005, -0.01), (0.006, -0.01), (0.007, 0.02), (0.001, 0.10), (-0.002, 0.10)]
    for sign in (-1, 1):
        model.add(
            common.prism(blade, 0.0018),
            shop.m.steel,
            (0, 0, 0.003 + sign * 0.001),
            (0, 0, sign * 11),
        )
        model.add(
            shop.tube([(0, -0.008, 0.004), (-sign * 0.016, -0.05, 0.004)], 0.003, 6), shop.m.steel
        )
        model.add(shop.ring(0.014, 0.003, 20), shop.m.steel, (-sign * 0.02, -0.064, 0.004))
    model.add(shop.lathe([(0.004, 0), (0.004, 0.007), (0, 0.0075)], 12), shop.m.brass)
    return model.mesh("Scissors")


def comb(shop: Shop, material: bpy.types.Material) -> bpy.types.Mesh:
    """A comb with coarse and fine teeth, lying on z = 0."""
    model = Model()
    model.box((0.17, 0.01, 0.004), material, (0, 0.012, 0.002), bevel=0.0015)
    teeth = shop.copies(46, 8)
    for k, x in enumerate(np.linspace(-0.083, 0.083, teeth)):
        if k < teeth / 2 or k % 2 == 0:
            model.box((0.0018, 0.024, 0.0026), material, (x, -0.004, 0.002))
    return model.mesh(f"Comb {material.name.lower()}")


def brush(shop: Shop) -> bpy.types.Mesh:
    """A round-backed hair brush, lying on z = 0 with the bristles up."""
    m, model = shop.m, Model()
    model.add(rounded_box((0.055, 0.10, 0.014), 0.006, 3), m.oak, (0, 0.05, 0.007))
    model.add(
        shop.tube(
            [(0, 0.0, 0.007), (0, -0.04, 0.007), (0, -0.10, 0.007)], [0.007, 0.010, 0.007], 12
        ),
        m.oak,
    )
    for i, j in np.ndindex(shop.copies(6, 2), shop.copies(11, 3)):
        x, y = (
            np.linspace(-0.02, 0.02, shop.copies(6, 2))[i],
            np.linspace(0.01, 0.09, shop.copies(11, 3))[j],
        )
        model.add(common.tube([(x, y, 0.013), (x * 1.1, y, 0.028)], 0.0016, 4), m.bristle)
    return model.mesh("Hair brush")


def razor(shop: Shop) -> bpy.types.Mesh:
    """A cut-throat razor, half open, lying on z = 0."""
    m, model = shop.m, Model()
    model.box((0.014, 0.14, 0.008), m.ebony, (0, 0, 0.004), bevel=0.003)
    model.add(
        common.prism([(0, 0), (0.02, 0.004), (0.02, 0.075), (0.004, 0.08), (0, 0.07)], 0.0025),
        m.chrome,
        (0.003, 0.068, 0.003),
        (0, 0, -55),
    )
    model.add(shop.lathe([(0.004, 0), (0.004, 0.010), (0, 0.011)], 12), m.brass, (0, 0.062, 0))
    return model.mesh("Razor")


def clippers(shop: Shop) -> bpy.types.Mesh:
    """Electric clippers with a coiled cord, lying on z = 0."""
    m, model = shop.m, Model()
    model.add(rounded_box((0.048, 0.14, 0.036), 0.014, 3), m.black, (0, 0, 0.019))
    model.box((0.044, 0.03, 0.006), m.steel, (0, 0.082, 0.026), (20, 0, 0))
    for x in np.linspace(-0.02, 0.02, shop.copies(14, 4)):
        model.box((0.0015, 0.012, 0.003), m.steel, (x, 0.101, 0.032), (20, 0, 0))
    model.box((0.03, 0.06, 0.003), m.gold, (0, -0.005, 0.037), bevel=0.001)
    s = np.linspace(0, 1, shop.n(140, 16))
    coil = np.column_stack(
        [0.012 * np.cos(70 * s) + 0.10 * s, -0.08 - 0.13 * s, 0.014 + 0.010 * np.sin(70 * s)]
    )
    model.add(shop.tube(coil, 0.0022, 5), m.black)
    return model.mesh("Clippers")


def hair_dryer(shop: Shop) -> bpy.types.Mesh:
    """A chrome hair dryer, lying on its side on z = 0."""
    m, model = shop.m, Model()
    model.add(
        shop.lathe(
            [
                (0.02, -0.07),
                (0.038, -0.05),
                (0.04, 0.02),
                (0.026, 0.05),
                (0.024, 0.13),
                (0.028, 0.135),
            ],
            28,
        ),
        m.chrome,
        (0, 0, 0.041),
        (90, 0, 0),
    )
    model.add(
        rounded_box((0.12, 0.034, 0.03), 0.012, 3), m.black, (0.085, 0.02, 0.036), (0, 4, -10)
    )
    model.add(shop.ring(0.03, 0.003, 24), m.red, (0, -0.02, 0.041), (90, 0, 0))
    return model.mesh("Hair dryer")


def folded_towel(shop: Shop, material: bpy.types.Material) -> bpy.types.Mesh:
    """A towel folded twice, with a stripe, lying on z = 0."""
    model = Model()
    for k in range(3):
        model.box((0.26, 0.17, 0.016), material, (0, 0, 0.008 + 0.014 * k), bevel=0.007, segments=3)
    model.add(shop.tube([(-0.13, 0.078, 0.022), (0.13, 0.078, 0.022)], 0.022, 14), material)
    stripe = shop.m.towels[1] if material is not shop.m.towels[1] else shop.m.towels[0]
    model.box((0.02, 0.171, 0.002), stripe, (-0.09, 0, 0.0445))
    return model.mesh(f"Folded {material.name.lower()}")


def rolled_towel(shop: Shop, material: bpy.types.Material) -> bpy.types.Mesh:
    """A rolled towel, lying along y on z = 0, its end a spiral."""
    s = np.linspace(0, 1, shop.n(72, 12))
    angle, r = 2 * np.pi * 3.2 * s, 0.012 + 0.030 * s
    outline = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    rows = np.array([-0.11, -0.104, 0.104, 0.11])
    shrink = np.array([0.93, 1.0, 1.0, 0.93])
    points = np.empty((4, len(s), 3))
    points[..., 0] = outline[:, 0] * shrink[:, None]
    points[..., 1] = rows[:, None]
    points[..., 2] = outline[:, 1] * shrink[:, None] + 0.042
    model = Model()
    model.add(common.sheet(points[:, ::-1]), material)
    for end in (-0.106, 0.106):
        model.add(
            shop.lathe([(0.039, -0.0005), (0.039, 0.0005)], 24),
            material,
            (0, end, 0.042),
            (90, 0, 0),
        )
    return model.mesh(f"Rolled {material.name.lower()}")


def draped_towel(shop: Shop, material: bpy.types.Material) -> bpy.types.Mesh:
    """A towel over a rail along x at the origin, hanging down on both sides."""
    x = np.linspace(-0.16, 0.16, shop.n(28, 6))
    s = np.linspace(-0.36, 0.46, shop.n(48, 10))[:, None]
    bow = np.clip(s / 0.022, -np.pi / 2, np.pi / 2)
    y = 0.022 * np.sin(bow) + 0.016 * np.sin(38 * x + 2) * np.abs(s) / 0.4
    z = 0.022 * np.cos(bow) - np.maximum(np.abs(s) - 0.0345, 0)
    points = np.stack([np.broadcast_to(x, y.shape), y, np.broadcast_to(z, y.shape)], -1)
    model = Model()
    model.add(common.sheet(points[::-1]), material)
    return model.mesh(f"Draped {material.name.lower()}")


def shelf(shop: Shop, width: float, depth: float) -> bpy.types.Mesh:
    """A wooden board on two brass brackets, its top at z = 0, back at y = 0."""
    m, model = shop.m, Model()
    model.box((width, depth, 0.02), m.mahogany_along_x, (0, depth / 2, -0.01), bevel=0.005)
    for x in (-width / 2 + 0.08, width / 2 - 0.08):
        model.add(
            shop.bend(
                [
                    (x, 0.008, -0.12),
                    (x, 0.05, -0.09),
                    (x, depth * 0.5, -0.035),
                    (x, depth * 0.85, -0.024),
                ],
                0.006,
                14,
            ),
            m.brass,
        )
        model.box((0.02, 0.008, 0.13), m.brass, (x, 0.004, -0.08))
    rail = depth - 0.008
    model.add(
        shop.tube([(-width / 2 + 0.01, rail, 0.035), (width / 2 - 0.01, rail, 0.035)], 0.004),
        m.brass,
    )
    for x in np.linspace(-width / 2 + 0.01, width / 2 - 0.01, 4):
        model.add(shop.tube([(x, rail, 0), (x, rail, 0.035)], 0.003, 6), m.brass)
    return model.mesh("Shelf board")


def stock(
    shop: Shop, goods: Sequence[bpy.types.Mesh], where: Matrix, width: float, depth: float
) -> None:
    """Stand goods side by side along x on z = 0 of a frame, in two rows where it is deep enough."""
    radii = [footprint(item) for item in goods]
    for y in (depth * 0.72, depth * 0.28) if depth > 0.24 else (depth * 0.5,):
        x = -width / 2 + 0.02
        while True:
            pick = shop.rng.integers(len(goods))
            if x + 2 * radii[pick] > width / 2 - 0.02:
                break
            put(goods[pick], where, (x + radii[pick], y, 0), (0, 0, shop.rng.uniform(-25, 25)))
            gap = 2 * radii[pick] + shop.rng.uniform(0.006, 0.03)
            x += gap / min(1.0, shop.detail**0.5)


def footprint(data: bpy.types.Mesh) -> float:
    """The radius about its origin that a mesh covers when it stands."""
    vertices = np.empty(3 * len(data.vertices))
    data.vertices.foreach_get("co", vertices)
    return float(np.linalg.norm(vertices.reshape(-1, 3)[:, :2], axis=1).max())


def station_goods(
    shop: Shop, glassware: Sequence[bpy.types.Mesh], pots: Sequence[bpy.types.Mesh]
) -> None:
    """The bottles, tools and towels of the three stations and the shelves between them."""
    m = shop.m
    tools = [
        scissors(shop),
        comb(shop, m.black),
        comb(shop, m.oak),
        brush(shop),
        razor(shop),
        scissors(shop),
    ]
    machines = [clippers(shop), hair_dryer(shop)]
    board = shelf(shop, 0.56, 0.14)
    folded = [folded_towel(shop, towel) for towel in m.towels]
    rolled = [rolled_towel(shop, towel) for towel in m.towels[:2]]
    draped = [draped_towel(shop, towel) for towel in m.towels[1:3]]
    for y in (-3.0, -1.0, 1.0, 3.0):
        where = wall("left", y)
        for k, z in enumerate((1.24, 1.58, 1.92, 2.26)):
            rack = where @ common.transform((0, 0.012, z))
            put(board, rack)
            stock(shop, [*glassware, *pots] if k < 3 else glassware, rack, 0.54, 0.125)
        side = where @ common.transform((0, 0.04, COUNTER_TOP))
        stock(shop, pots, side, 0.72, 0.14)
        for k in range(3):
            put(
                folded[(k + int(y)) % 4],
                side,
                (-0.22, 0.26, 0.045 * k),
                (0, 0, shop.rng.uniform(-4, 4)),
            )
        for k, x in enumerate((0.10, 0.195, 0.1475)):
            put(rolled[k % 2], side, (x + 0.03, 0.26, 0.076 * (k // 2)))
    for y in STATIONS:
        where = wall("left", y) @ common.transform((0, 0, COUNTER_TOP))
        mat = Model()
        mat.box((0.30, 0.20, 0.006), m.towels[0], (0, 0, 0.003), bevel=0.002)
        put(mat.mesh("Tool mat"), where, (0.44, 0.26, 0))
        for k, tool in enumerate(tools):
            put(tool, where, (0.33 + 0.045 * k, 0.26, 0.0065), (0, 0, shop.rng.uniform(-7, 7)))
        put(machines[0], where, (-0.36, 0.27, 0), (0, 0, shop.rng.uniform(-15, 15)))
        put(machines[1], where, (-0.52, 0.28, 0), (0, 0, shop.rng.uniform(60, 85)))
        stock(shop, [*pots, *glassware[:9]], where @ common.transform((-0.42, 0.04, 0)), 0.42, 0.14)
        stock(shop, [*pots, *glassware[9:]], where @ common.transform((0.42, 0.04, 0)), 0.42, 0.14)
    for y in (-1.0, 1.0):
        rail = Model()
        rail.add(
            shop.bend(
                [
                    (-0.18, 0, 0),
                    (-0.18, 0.06, 0),
                    (-0.16, 0.07, 0),
                    (0, 0.07, 0),
                    (0.16, 0.07, 0),
                    (0.18, 0.06, 0),
                    (0.18, 0, 0),
                ],
                0.007,
                40,
            ),
            m.brass,
        )
        where = wall("left", y) @ common.transform((0, COUNTER_DEPTH - 0.01, 0.72))
        put(rail.mesh("Towel rail"), where)
        put(draped[int(y > 0)], where, (0, 0.07, -0.014))


# --- On the walls ---------------------------------------------------------------------------------


def framed(
    shop: Shop,
    name: str,
    width: float,
    height: float,
    print_on: Callable[[Model], None],
    border: bpy.types.Material,
) -> bpy.types.Mesh:
    """A framed picture, flat, whose paper's surface is at z = 0.011."""
    model = Model()
    model.box((width, height, 0.01), shop.m.paper, (0, 0, 0.006))
    rim = [
        (-0.006, 0.011),
        (-0.006, 0.018),
        (0.006, 0.024),
        (0.022, 0.026),
        (0.03, 0.018),
        (0.03, 0),
    ]
    model.add(frame(width, height, rim), border)
    print_on(model)
    return model.mesh(name)


def ink(
    model: Model,
    outline: Array,
    material: bpy.types.Material,
    layer: int,
    at: Sequence[float] = (0, 0),
    turn: float = 0.0,
    scale: Sequence[float] = (1, 1),
) -> None:
    """Print a filled outline on a picture; higher layers cover lower ones."""
    z = 0.011 + PRINT_LAYER * layer
    model.add(
        common.prism(outline, PRINT_LAYER * 0.6), material, (*at, z), (0, 0, turn), (*scale, 1)
    )


def words(
    model: Model,
    text: str,
    material: bpy.types.Material,
    layer: int,
    at: Sequence[float],
    size: float,
) -> None:
    """Print words on a picture."""
    z = 0.011 + PRINT_LAYER * (layer + 0.5)
    model.add(lettering(text), material, (*at, z), scale=(size, size, 1))


def moustache(kind: int, n: int) -> Array:
    """The outline of a moustache, about 1 wide: handlebar, walrus, pencil, chevron, …"""
    droop, curl, thick = [
        (0.10, 0.30, 0.16),
        (0.34, -0.18, 0.26),
        (0.06, 0.02, 0.06),
        (0.20, -0.05, 0.2),
        (0.02, 0.42, 0.12),
        (0.28, 0.1, 0.2),
    ][kind % 6]
    x = np.linspace(-0.5, 0.5, 2 * n + 1)
    t = np.abs(x) * 2
    middle = -droop * t**1.3 + curl * np.maximum(t - 0.55, 0) ** 1.4 * 2
    half = thick * np.sqrt(np.maximum(1 - t**2.2, 0.002)) * (0.55 + 0.45 * np.minimum(t * 4, 1))
    lower, upper = middle - half / 2, middle + half / 2
    return np.column_stack([np.concatenate([x, x[::-1]]), np.concatenate([lower, upper[::-1]])])


def print_scissors(
    model: Model,
    shop: Shop,
    material: bpy.types.Material,
    layer: int,
    at: Sequence[float],
    size: float,
) -> None:
    """Open scissors as a print."""
    blade = (
        np.array([(-0.05, -0.06), (0.05, -0.06), (0.06, 0.1), (0.0, 0.62), (-0.03, 0.62)]) * size
    )
    for sign in (-1, 1):
        angle = np.radians(-sign * 22)
        ink(model, blade, material, layer + (sign > 0), at, sign * 22)
        grip = np.array([np.sin(angle), -np.cos(angle)]) * size * 0.30 + at
        loop = np.concatenate(
            [
                circle(0.13 * size, shop.n(28, 8), 0, 359),
                circle(0.085 * size, shop.n(28, 8), 0, 359)[::-1],
            ]
        )
        ink(model, loop, material, layer + (sign > 0), grip)
        ink(
            model,
            rectangle(0.05 * size, 0.18 * size),
            material,
            layer + (sign > 0),
            (grip + at) / 2,
            sign * 22,
        )


def posters(shop: Shop) -> None:
    """Prints and certificates of our own design, hung where the walls were bare."""
    m, n = shop.m, shop.n(48, 10)

    def master_barber(p: Model) -> None:
        ink(p, rectangle(0.56, 0.76), m.navy, 0)
        for k in range(24):
            ray = np.array([(0, 0), *(circle(0.26, 2, 15 * k, 15 * k + 7.5))])
            ink(p, ray, m.ochre, 1, (0, 0.05))
        ink(p, circle(0.165, n), m.cream, 2, (0, 0.05))
        print_scissors(p, shop, m.red, 3, (0, 0.0), 0.22)
        words(p, "MASTER BARBERS", m.cream, 1, (0, -0.27), 0.068)
        words(p, "since 1927", m.ochre, 1, (0, -0.335), 0.045)

    def moustaches(p: Model) -> None:
        ink(p, rectangle(0.46, 0.66), m.cream, 0)
        for k in range(12):
            ink(
                p,
                moustache(k, n // 2),
                (m.black, m.hair[0])[k % 2],
                1,
                (-0.13 + 0.13 * (k % 3), 0.19 - 0.125 * (k // 3)),
                scale=(0.105, 0.13),
            )
        words(p, "THE GENTLEMEN'S CHOICE", m.red, 1, (0, 0.29), 0.036)

    def price_list(p: Model) -> None:
        ink(p, rectangle(0.66, 0.96), m.black, 0)
        words(p, "PRICES", m.cream, 1, (0, 0.39), 0.12)
        ink(p, rectangle(0.5, 0.006), m.gold, 1, (0, 0.32))
        rows = [
            "Haircut|1.50",
            "Shave|1.00",
            "Beard trim|0.75",
            "Hot towel|0.50",
            "Moustache|0.40",
            "Shampoo|0.60",
            "Children|0.90",
            "The works|3.50",
        ]
        for k, row in enumerate(rows):
            service, price = row.split("|")
            words(p, service, m.cream, 1, (-0.14, 0.25 - 0.087 * k), 0.06)
            words(p, price, m.ochre, 1, (0.23, 0.25 - 0.087 * k), 0.06)
            for x in np.linspace(0.03, 0.14, 6):
                ink(p, rectangle(0.006, 0.006), m.gold, 1, (x, 0.235 - 0.087 * k))
        words(p, "no appointment needed", m.red, 1, (0, -0.43), 0.045)

    def haircuts(p: Model) -> None:
        ink(p, rectangle(0.66, 0.46), m.teal, 0)
        for k in range(6):
            x, y = -0.2 + 0.2 * (k % 3), 0.06 - 0.2 * (k // 3)
            hair = m.hair[k % 3]
            ink(p, circle(0.078, n), m.cream, 1, (x, y))
            ink(p, circle(0.04, n), m.skin, 2, (x, y - 0.008), scale=(0.85, 1.2))
            ink(
                p,
                circle(0.046, n, 10 - 10 * (k % 2), 170 + 6 * k),
                hair,
                3,
                (x, y + 0.008),
                scale=(0.95, 1.1 + 0.12 * (k % 3)),
            )
            ink(p, moustache(k, 12), hair, 3, (x, y - 0.022), scale=(0.036, 0.05))
            for side in (-1, 1):
                ink(p, circle(0.004, 10), m.black, 3, (x + side * 0.013, y + 0.0))
        words(p, "STYLES OF THE SEASON", m.cream, 1, (0, 0.185), 0.045)

    def pole(p: Model) -> None:
        ink(p, rectangle(0.36, 0.66), m.ochre, 0)
        ink(p, rectangle(0.12, 0.4), m.white, 1)
        for k in range(7):
            stripe = np.array([(-0.06, -0.03), (0.06, 0.03), (0.06, 0.055), (-0.06, -0.005)])
            ink(p, stripe, (m.red, m.blue)[k % 2], 2, (0, -0.165 + 0.05 * k))
        for sign in (-1, 1):
            ink(p, rectangle(0.15, 0.03), m.black, 3, (0, sign * 0.205))
            ink(p, circle(0.045, n), m.black, 2, (0, sign * 0.235))
        words(p, "SHAVE", m.black, 1, (-0.125, 0.29), 0.042)
        words(p, "25 cents", m.red, 1, (0.105, -0.30), 0.036)

    def deco(p: Model) -> None:
        ink(p, rectangle(0.46, 0.66), m.red, 0)
        for k in range(6):
            ink(p, circle(0.22 - 0.034 * k, n, 0, 180), (m.ochre, m.navy)[k % 2], k + 1, (0, -0.12))
        for k in range(9):
            ink(
                p,
                np.array([(-0.004, 0.1), (0.004, 0.1), (0.012, 0.3), (-0.012, 0.3)]),
                m.cream,
                1,
                (0, -0.12),
                20 * k - 80,
            )
        words(p, "Brilliantine", m.cream, 1, (0, -0.22), 0.075)
        words(p, "keeps every hair in its place", m.cream, 1, (0, -0.28), 0.026)

    def landscape(p: Model) -> None:
        ink(p, rectangle(0.58, 0.38), m.cream, 0)
        ink(p, circle(0.07, n), m.red, 1, (0.12, 0.07))
        x = np.linspace(-0.29, 0.29, n)
        for k, colour in enumerate((m.teal, m.green, m.navy)):
            ridge = 0.02 - 0.07 * k + 0.045 * np.sin(9 * x + 2 * k) + 0.02 * np.sin(23 * x + k)
            hills = np.concatenate(
                [[(0.29, -0.19)], np.column_stack([x, ridge])[::-1], [(-0.29, -0.19)]]
            )
            ink(p, hills, colour, 2 + k)

    def certificate(p: Model) -> None:
        for k in range(3):
            ink(p, rectangle(0.40 - 0.02 * k, 0.28 - 0.02 * k), (m.cream, m.gold, m.cream)[k], k)
        words(p, "Certificate", m.black, 3, (0, 0.075), 0.06)
        for k in range(4):
            ink(p, rectangle(0.26 - 0.05 * (k % 2), 0.004), m.black, 3, (0, 0.02 - 0.022 * k))
        ink(p, circle(0.028, n), m.red, 3, (0.12, -0.09))
        ink(p, moustache(4, 12), m.navy, 3, (-0.1, -0.09), scale=(0.1, 0.05))

    def portrait(p: Model) -> None:
        ink(p, circle(0.5, n), m.rug[2], 0, scale=(0.24, 0.32))
        ink(p, circle(0.1, n, 0, 180), m.black, 1, (0, -0.15), scale=(1.0, 0.9))
        ink(p, circle(0.05, n), m.skin, 2, (0, 0.0), scale=(0.85, 1.15))
        ink(p, circle(0.05, n, 0, 180), m.hair[0], 3, (0, 0.03), scale=(0.95, 0.9))
        ink(p, moustache(0, 16), m.hair[0], 4, (0, -0.018), scale=(0.07, 0.07))

    prints = {
        "masters": framed(shop, "Poster masters", 0.6, 0.8, master_barber, m.ebony),
        "moustaches": framed(shop, "Poster moustaches", 0.5, 0.7, moustaches, m.gold),
        "prices": framed(shop, "Price list", 0.7, 1.0, price_list, m.oak),
        "haircuts": framed(shop, "Poster haircuts", 0.7, 0.5, haircuts, m.ebony),
        "pole": framed(shop, "Poster pole", 0.4, 0.7, pole, m.mahogany),
        "deco": framed(shop, "Poster brilliantine", 0.5, 0.7, deco, m.gold),
        "landscape": framed(shop, "Landscape", 0.62, 0.42, landscape, m.gold),
        "certificate": framed(shop, "Certificate", 0.44, 0.32, certificate, m.ebony),
        "portrait": framed(shop, "Portrait", 0.26, 0.34, portrait, m.gold),
    }
    hung = [  # print, wall, along, height
        ("masters", "right", -0.45, 1.68),
        ("moustaches", "right", 0.25, 1.62),
        ("landscape", "right", 0.25, 2.24),
        ("deco", "right", 0.88, 1.66),
        ("certificate", "right", -0.45, 2.36),
        ("portrait", "right", 0.88, 2.28),
        ("pole", "right", 1.72, 2.18),
        ("portrait", "right", 1.35, 1.50),
        ("certificate", "right", 2.25, 2.45),
        ("haircuts", "right", -1.65, 2.45),
        ("pole", "right", -3.35, 1.75),
        ("portrait", "right", -2.75, 1.5),
        ("landscape", "right", -2.8, 1.98),
        ("certificate", "right", -2.75, 2.42),
        ("deco", "right", 3.2, 1.9),
        ("prices", "back", 0.45, 1.68),
        ("haircuts", "back", 0.45, 2.55),
        ("moustaches", "back", -2.27, 1.7),
        ("landscape", "back", -1.52, 2.48),
        ("certificate", "back", -2.25, 2.35),
        ("portrait", "back", -0.35, 2.55),
        ("certificate", "front", 2.25, 1.55),
        ("portrait", "front", 2.25, 1.95),
        ("portrait", "front", -2.3, 1.5),
        ("pole", "front", -2.28, 2.15),
        ("certificate", "front", 2.25, 2.35),
    ]
    for name, side, along, z in hung:
        hang(prints[name], wall(side, along), 0, z, 0.001)


def clock(shop: Shop) -> None:
    """A railway clock above the staff door's side, at ten past ten."""
    m, model = shop.m, Model()
    model.add(
        shop.lathe(
            [(0.22, 0), (0.22, 0.03), (0.205, 0.05), (0.185, 0.045), (0.18, 0.02), (0, 0.02)], 56
        ),
        m.mahogany,
    )
    model.add(shop.lathe([(0.181, 0.0), (0.181, 0.022), (0, 0.022)], 56), m.white)
    model.add(shop.ring(0.183, 0.006, 56), m.brass, (0, 0, 0.044))
    for k in range(60):
        angle = np.radians(6 * k)
        size = (0.006, 0.022, 0.001) if k % 5 == 0 else (0.0025, 0.010, 0.001)
        model.box(
            size, m.black, (0.166 * np.sin(angle), 0.166 * np.cos(angle), 0.0226), (0, 0, -6 * k)
        )
    for k, numeral in enumerate(
        ("XII", "I", "II", "III", "IIII", "V", "VI", "VII", "VIII", "IX", "X", "XI")
    ):
        angle = np.radians(30 * k)
        model.add(
            lettering(numeral),
            m.black,
            (0.132 * np.sin(angle), 0.132 * np.cos(angle), 0.0226),
            scale=(0.034, 0.042, 1),
        )
    for turn, length, width, z in (
        (-305, 0.085, 0.012, 0.026),
        (-60, 0.13, 0.008, 0.028),
        (-200, 0.14, 0.003, 0.030),
    ):
        hand = [
            (-width / 2, -0.02),
            (width / 2, -0.02),
            (width / 2, length * 0.8),
            (0, length),
            (-width / 2, length * 0.8),
        ]
        model.add(
            common.prism(hand, 0.0012),
            (m.red if width < 0.005 else m.black),
            (0, 0, z),
            (0, 0, turn),
        )
    model.add(shop.lathe([(0.01, 0.022), (0.01, 0.034), (0, 0.036)], 16), m.brass)
    hang(model.mesh("Clock"), wall("back", -0.88), 0, 2.5, 0.001)


def barber_pole(shop: Shop) -> None:
    """The turning pole, its helix real geometry, between the window and the door."""
    m, model = shop.m, Model()
    n, rows, r, length = shop.n(48, 16) // 8 * 8, shop.n(64, 8), 0.07, 0.62
    angle = np.arange(n) * 2 * np.pi / n
    z = np.linspace(0, 1, rows)[:, None]
    twisted = angle + 2 * np.pi * 1.25 * z
    height = np.broadcast_to(z * length, twisted.shape)
    column = common.sheet(
        np.stack([r * np.cos(twisted), r * np.sin(twisted), height], -1), closed=True
    )
    stripe = np.arange(len(column.quads)) % n * 8 // n
    for kind, material in enumerate((m.red, m.white, m.blue, m.white)):
        quads = column.quads[stripe % 4 == kind]
        model.add(Shape(column.vertices, quads), material)
    cap = shop.lathe(
        [
            (0.0, -0.10),
            (0.03, -0.095),
            (0.045, -0.06),
            (0.09, -0.045),
            (0.095, -0.01),
            (0.085, 0.0),
            (0.085, 0.012),
            (0.0, 0.012),
        ],
        40,
    )
    model.add(cap, m.chrome)
    model.add(cap, m.chrome, (0, 0, length), (180, 0, 0))
    model.add(shop.ball(0.10, 32), m.globe, (0, 0, length + 0.16))
    model.add(common.lathe([(0.083, 0.0), (0.083, length)], shop.n(48, 12), capped=False), m.pane)
    for z_arm in (-0.03, length + 0.03):
        model.add(shop.tube([(0, 0.06, z_arm), (0, 0.15, z_arm)], 0.016, 14), m.chrome)
        model.box((0.09, 0.015, 0.12), m.chrome, (0, 0.15, z_arm), bevel=0.006)
    put(model.mesh("Barber pole"), wall("front", 0.78), (0, 0.158, 1.38), (0, 0, 180))


def coat_rack(shop: Shop) -> None:
    """Hooks with coats and hats, and the umbrella stand below."""
    m, rack = shop.m, Model()
    where = wall("right", 2.35)
    rack.box((1.3, 0.025, 0.12), m.mahogany, (0, 0.0125, 1.86), bevel=0.008)
    hooks = (-0.54, -0.27, 0.0, 0.27, 0.54)
    for x in hooks:
        rack.add(shop.bend([(x, 0.02, 1.90), (x, 0.09, 1.92), (x, 0.11, 1.97)], 0.007, 12), m.brass)
        rack.add(shop.ball(0.014), m.brass, (x, 0.112, 1.975))
        rack.add(
            shop.bend(
                [(x, 0.02, 1.85), (x, 0.05, 1.81), (x, 0.075, 1.83), (x, 0.08, 1.86)], 0.006, 12
            ),
            m.brass,
        )
    put(rack.mesh("Coat rack"), where)
    n, rows = shop.n(72, 16), shop.n(32, 6)
    angle = np.arange(n) * 2 * np.pi / n
    t = np.linspace(0, 1, rows)[:, None]
    for k, (x, wool) in enumerate(((-0.54, m.wool[0]), (-0.02, m.wool[1]), (0.54, m.wool[2]))):
        width = 0.03 + 0.15 * np.minimum(t * 6, 1) ** 0.6 + 0.05 * t
        folds = 1 + (0.10 * np.sin(7 * angle + 2 * k) + 0.06 * np.sin(11 * angle + k)) * np.minimum(
            t * 2, 1
        )
        points = np.stack(
            [
                width * folds * np.cos(angle),
                0.5 * (0.2 + 0.8 * t) * width * folds * np.sin(angle),
                np.broadcast_to(1.85 - (0.95 - 0.12 * k) * t, folds.shape),
            ],
            -1,
        )
        coat = Model()
        coat.add(common.sheet(points[::-1], closed=True), wool, (0, 0.135, 0))
        for side in (-1, 1):
            sleeve = [
                (side * 0.14, 0.14, 1.74),
                (side * 0.20, 0.17, 1.5),
                (side * 0.19, 0.19, 1.22),
                (side * 0.18, 0.20, 1.12),
            ]
            path = smooth_path(sleeve, shop.n(20, 5))
            coat.add(shop.tube(path, np.linspace(0.062, 0.048, len(path)), 18), wool, (0, 0.01, 0))
            lapel = [(0, 0), (0.06, 0.02), (0.075, -0.10), (0.0, -0.34)]
            coat.add(
                common.prism(lapel, 0.008),
                wool,
                (side * 0.005, 0.222, 1.74),
                (90, 0, 180 if side > 0 else 0),
                (1, 1, side),
            )
        for z in (1.36, 1.24, 1.12):
            coat.add(
                shop.lathe([(0.012, 0), (0.012, 0.004), (0.008, 0.005)], 14),
                m.ebony,
                (0.02, 0.245, z),
                (-90, 0, 0),
            )
        put(coat.mesh(f"Coat {wool.name.lower()}"), where, (x, 0, 0))
    fedora = Model()
    crown = [
        (0.175, 0.006),
        (0.17, 0.0),
        (0.10, 0.012),
        (0.095, 0.05),
        (0.088, 0.105),
        (0.06, 0.125),
        (0.0, 0.115),
    ]
    fedora.add(shop.lathe(crown, 48), m.wool[1], scale=(1, 1.15, 1))
    fedora.add(
        common.lathe([(0.1005, 0.014), (0.0975, 0.042)], shop.n(48, 8), capped=False),
        m.rug[0],
        scale=(1, 1.15, 1),
    )
    bowler = Model()
    dome = np.radians(np.linspace(5, 90, shop.n(10, 4)))
    bowler.add(
        shop.lathe(
            [
                (0.15, 0.025),
                (0.152, 0.02),
                (0.105, 0.0),
                *np.column_stack([0.10 * np.cos(dome), 0.125 * np.sin(dome)]),
            ],
            48,
        ),
        m.black,
        scale=(1, 1.15, 1),
    )
    put(fedora.mesh("Fedora"), where, (0.27, 0.14, 1.94), (-62, 0, 0))
    put(bowler.mesh("Bowler hat"), where, (-0.27, 0.14, 1.95), (-68, 0, 0))
    stand = Model()
    stand.add(
        common.lathe(
            [
                (0.10, 0.01),
                (0.11, 0.02),
                (0.12, 0.5),
                (0.13, 0.52),
                (0.12, 0.52),
                (0.105, 0.03),
                (0.0, 0.02),
            ],
            shop.n(36, 10),
        ),
        m.brass,
    )
    for z in (0.12, 0.4):
        stand.add(shop.ring(0.116 + 0.012 * z, 0.006, 40), m.brass, (0, 0, z))
    put(stand.mesh("Umbrella stand"), where, (-0.86, 0.2, 0))
    umbrella = Model()
    fold = 1 + 0.22 * np.cos(8 * angle)
    r = fold * np.interp(t, [0, 0.12, 0.75, 1], [0.006, 0.02, 0.045, 0.018])
    z = np.broadcast_to(0.06 + 0.58 * t, r.shape)
    points = np.stack([r * np.cos(angle + t), r * np.sin(angle + t), z], -1)
    umbrella.add(common.sheet(points, closed=True), m.black)
    umbrella.add(
        shop.bend(
            [
                (0, 0, 0.02),
                (0, 0, 0.4),
                (0, 0, 0.78),
                (0.03, 0, 0.85),
                (0.075, 0, 0.83),
                (0.08, 0, 0.79),
            ],
            0.009,
            36,
        ),
        m.oak,
    )
    data = umbrella.mesh("Umbrella")
    put(data, where, (-0.89, 0.19, 0.01), (4, -4, 30))
    put(data, where, (-0.82, 0.22, 0.01), (-3, 5, 160))


# --- Round the room -------------------------------------------------------------------------------


def display_cabinet(
    shop: Shop, glassware: Sequence[bpy.types.Mesh], pots: Sequence[bpy.types.Mesh]
) -> None:
    """A mahogany cabinet with glass doors, full of bottles for sale."""
    m, model = shop.m, Model()
    width, depth, height, base = 0.9, 0.36, 1.5, 0.5
    model.box((width, depth, base), m.mahogany, (0, depth / 2, base / 2), bevel=0.006)
    model.box((width, 0.02, height), m.mahogany, (0, 0.01, base + height / 2))
    for x in (-width / 2 + 0.012, width / 2 - 0.012):
        model.box((0.024, depth, height), m.mahogany, (x, depth / 2, base + height / 2))
    model.box(
        (width + 0.06, depth + 0.03, 0.05),
        m.mahogany,
        (0, depth / 2, base + height + 0.025),
        bevel=0.015,
        segments=2,
    )
    model.box((width + 0.03, depth + 0.02, 0.03), m.mahogany, (0, depth / 2, base), bevel=0.008)
    raised = [(-0.05, 0.004), (-0.03, 0.018), (0, 0.02), (0.015, 0.006), (0.02, 0.0)]
    for x in (-0.215, 0.215):
        model.add(frame(0.30, 0.32, raised), m.mahogany, (x, depth, 0.25), FLAT_TO_STANDING)
        model.add(
            frame(0.35, height - 0.13, [(0, -0.012), (0, 0.01), (0.04, 0.01), (0.04, -0.012)]),
            m.mahogany,
            (x, depth - 0.01, base + height / 2 + 0.005),
            FLAT_TO_STANDING,
        )
        model.add(shop.ball(0.012), m.brass, (x * 0.16, depth + 0.012, base + 0.6))
        model.add(shop.ball(0.012), m.brass, (x * 0.16, depth + 0.028, 0.3))
        sheet = common.grid([-0.175, 0.175], [-(height - 0.13) / 2, (height - 0.13) / 2])
        model.add(sheet, m.pane, (x, depth - 0.01, base + height / 2 + 0.005), FLAT_TO_STANDING)
    where = wall("right", -1.65)
    levels = [base + 0.016, base + 0.39, base + 0.76, base + 1.13]
    for z in levels[1:]:
        model.box((width - 0.05, depth - 0.05, 0.012), m.oak, (0, depth / 2 - 0.01, z - 0.006))
    put(model.mesh("Display cabinet"), where @ common.transform((0, 0.035, 0)))
    for z in levels:
        stock(
            shop, [*glassware, *pots], where @ common.transform((0, 0.065, z)), width - 0.06, 0.27
        )
    stack = hat_box(shop)
    put(stack, where, (-0.2, 0.22, base + height + 0.05))
    put(stack, where, (-0.2, 0.22, base + height + 0.19), (0, 0, 30), 0.8)


def hat_box(shop: Shop) -> bpy.types.Mesh:
    model = Model()
    model.add(shop.lathe([(0.15, 0), (0.15, 0.14)], 40), shop.m.teal)
    model.add(shop.lathe([(0.155, 0.1), (0.155, 0.142), (0.15, 0.146)], 40), shop.m.cream)
    model.box((0.316, 0.02, 0.002), shop.m.red, (0, 0, 0.147))
    return model.mesh("Hat box")


def back_shelves(
    shop: Shop, glassware: Sequence[bpy.types.Mesh], pots: Sequence[bpy.types.Mesh]
) -> None:
    """Shelves of bottles behind the desk and a low cupboard under them."""
    where = wall("back", 1.68)
    board = shelf(shop, 1.4, 0.16)
    for k, z in enumerate((1.25, 1.6, 1.95, 2.3)):
        rack = where @ common.transform((0, 0.022 if k == 0 else 0.0, z))
        put(board, rack)
        stock(shop, [*glassware, *pots] if k else glassware, rack, 1.36, 0.14)
    m, model = shop.m, Model()
    model.box((1.4, 0.3, 0.8), m.oak, (0, 0.19, 0.42), bevel=0.006)
    model.box((1.44, 0.34, 0.03), m.mahogany, (0, 0.20, 0.835), bevel=0.008)
    raised = [(-0.05, 0.004), (-0.03, 0.018), (0, 0.02), (0.015, 0.006), (0.02, 0.0)]
    for x in (-0.525, -0.175, 0.175, 0.525):
        model.add(frame(0.25, 0.6, raised), m.oak, (x, 0.34, 0.42), FLAT_TO_STANDING)
        model.add(shop.ball(0.013), m.brass, (x + 0.11, 0.365, 0.55))
    put(model.mesh("Back cupboard"), where)
    top = where @ common.transform((0, 0.10, 0.85))
    put(radio(shop), top, (0.4, 0.09, 0), (0, 0, -8))
    put(steriliser(shop), top, (-0.35, 0.09, 0))
    stock(shop, pots, top @ common.transform((0.02, 0.0, 0)), 0.34, 0.18)


def radio(shop: Shop) -> bpy.types.Mesh:
    """A wooden valve radio."""
    m, model = shop.m, Model()
    arch = np.concatenate(
        [[(0.17, 0)], circle(0.17, shop.n(24, 6), 0, 180) * (1, 0.75) + (0, 0.14), [(-0.17, 0)]]
    )
    model.add(common.prism(arch, 0.16), m.mahogany, (0, 0.08, 0), (90, 0, 0))
    model.add(
        common.prism(circle(0.10, shop.n(32, 8)), 0.004), m.bristle, (0, 0.0805, 0.155), (-90, 0, 0)
    )
    for x in np.linspace(-0.08, 0.08, 5):
        model.box(
            (0.008, 0.006, 2 * np.sqrt(0.01 - x * x)), m.mahogany, (x, 0.086, 0.155), bevel=0.002
        )
    for x in (-0.1, 0.0, 0.1):
        model.add(
            shop.lathe([(0.018, 0), (0.016, 0.018), (0, 0.019)], 18),
            m.cream,
            (x, 0.08, 0.032),
            (-90, 0, 0),
        )
    return model.mesh("Radio")


def steriliser(shop: Shop) -> bpy.types.Mesh:
    """An enamelled towel steamer with a dial."""
    m, model = shop.m, Model()
    model.box((0.38, 0.22, 0.30), m.cream, (0, 0, 0.16), bevel=0.025, segments=3)
    model.box((0.30, 0.01, 0.22), m.chrome, (0, 0.112, 0.17), bevel=0.004)
    model.box((0.26, 0.01, 0.18), m.cream, (0, 0.116, 0.17), bevel=0.004)
    model.add(
        shop.bend(
            [(-0.11, 0.12, 0.11), (-0.11, 0.145, 0.12), (-0.11, 0.145, 0.22), (-0.11, 0.12, 0.23)],
            0.007,
        ),
        m.chrome,
    )
    model.add(
        shop.lathe([(0.026, 0), (0.026, 0.008), (0.0, 0.01)], 24),
        m.white,
        (0.08, 0.12, 0.2),
        (-90, 0, 0),
    )
    model.add(lettering("HOT"), m.red, (0.02, 0.1225, 0.12), FLAT_TO_STANDING, (0.05, 0.05, 1))
    for x in (-0.15, 0.15):
        model.add(shop.lathe([(0.015, 0), (0.02, 0.015)], 16), m.rubber, (x, 0.05, 0))
        model.add(shop.lathe([(0.015, 0), (0.02, 0.015)], 16), m.rubber, (x, -0.05, 0))
    return model.mesh("Towel steamer")


def towel_tower(shop: Shop) -> None:
    """Open shelves of folded and rolled towels between the staff door and the price list."""
    m, model = shop.m, Model()
    width, depth, height = 0.78, 0.32, 1.75
    for x in (-width / 2, width / 2):
        model.box((0.03, depth, height), m.oak, (x, depth / 2, height / 2), bevel=0.004)
    levels = np.linspace(0.08, height - 0.02, 6)
    for z in levels:
        model.box((width, depth, 0.024), m.oak, (0, depth / 2, z - 0.012), bevel=0.003)
    model.box((width, 0.012, height), m.mahogany, (0, 0.006, height / 2))
    where = wall("back", -0.42) @ common.transform((0, 0.036, 0))
    put(model.mesh("Towel shelves"), where)
    folded = [folded_towel(shop, towel) for towel in m.towels]
    rolled = [rolled_towel(shop, towel) for towel in m.towels]
    for level, z in enumerate(levels[:-1]):
        for k, x in enumerate((-0.235, 0.05) if level % 2 else (0.235, -0.05)):
            for pile in range(int(shop.rng.integers(2, 6))):
                put(
                    folded[(level + k) % 4],
                    where,
                    (x, 0.17, z + 0.0455 * pile),
                    (0, 0, shop.rng.uniform(-2, 2)),
                )
        for k, (x, up) in enumerate(((0.25, 0), (0.335, 0), (0.2925, 0.074))):
            sign = 1 if level % 2 else -1
            put(rolled[(level + k + 1) % 4], where, (sign * x, 0.17, z + up))
    basket = Model()
    for k in range(9):
        basket.add(shop.ring(0.13 + 0.004 * k, 0.011, 40, 6), m.bristle, (0, 0, 0.011 + 0.02 * k))
    basket.add(shop.lathe([(0.12, 0.004), (0.12, 0.01)], 28), m.bristle)
    put(basket.mesh("Basket"), where, (0, 0.16, height - 0.02))
    for k in range(5):
        x, y = circle(0.07, 5)[k]
        put(rolled[k % 4], where, (x, 0.16 + y, height + 0.12), (78, 0, 72 * k))


def trolley(shop: Shop, pots: Sequence[bpy.types.Mesh]) -> None:
    """A three-tray enamel trolley beside the first chair."""
    m, model = shop.m, Model()
    width, depth = 0.46, 0.32
    for x in (-width / 2, width / 2):
        for y in (-depth / 2, depth / 2):
            model.add(shop.tube([(x, y, 0.06), (x, y, 0.8)], 0.009), m.chrome)
            model.add(
                shop.lathe([(0.028, -0.009), (0.03, 0.0), (0.028, 0.009)], 16),
                m.rubber,
                (x, y, 0.03),
                (90, 0, 30),
            )
            model.add(shop.ball(0.013), m.chrome, (x, y, 0.805))
    trays = (0.2, 0.48, 0.74)
    for z in trays:
        model.box((width, depth, 0.012), m.cream, (0, 0, z), bevel=0.003)
        model.add(
            frame(width - 0.02, depth - 0.02, [(0, 0), (0, 0.035), (0.006, 0.035), (0.006, 0)]),
            m.chrome,
            (0, 0, z),
        )
    where = common.transform((-1.55, -3.2, 0.003), (0, 0, np.radians(-20)))
    put(model.mesh("Trolley"), where)
    towel = folded_towel(shop, m.towels[2])
    for k in range(3):
        put(towel, where, (-0.06, 0, trays[1] + 0.007 + 0.0455 * k), (0, 0, 2 * k))
        put(towel, where, (0.03, 0, trays[0] + 0.007 + 0.0455 * k), (0, 0, -2 * k))
    stock(shop, pots, where @ common.transform((0, -0.13, trays[2] + 0.007)), 0.42, 0.26)


def leaf(length: float, width: float, droop: float, n: int) -> Shape:
    """A leaf that grows along x from the origin, arching down, with a folded midrib."""
    t = np.linspace(0, 1, n + 1)
    across = np.array([-1.0, 0.0, 1.0])
    half = width / 2 * np.sin(np.pi * t**0.8) ** 0.8
    angle = np.cumsum(np.full(n + 1, droop / n)) - droop / n
    x = np.concatenate([[0], np.cumsum(np.cos(angle[:-1]))]) * length / n
    z = np.concatenate([[0], np.cumsum(-np.sin(angle[:-1]))]) * length / n
    points = np.empty((n + 1, 3, 3))
    points[..., 0] = x[:, None]
    points[..., 1] = half[:, None] * across
    points[..., 2] = z[:, None] + 0.25 * half[:, None] * np.abs(across)
    return common.sheet(points.transpose(1, 0, 2)[::1])


def plant(shop: Shop, kind: str) -> bpy.types.Mesh:
    """A potted plant: a fern, a snake plant or a rubber tree; about 0.6 m tall with its pot."""
    m, model = shop.m, Model()
    pot = [
        (0.09, 0),
        (0.10, 0.01),
        (0.125, 0.17),
        (0.14, 0.17),
        (0.14, 0.21),
        (0.125, 0.21),
        (0.118, 0.18),
    ]
    model.add(
        shop.lathe([*pot, (0.0, 0.18)], 36),
        {"fern": m.terracotta, "snake": m.navy, "rubber": m.brass}[kind],
    )
    model.add(shop.lathe([(0.117, 0.18), (0.117, 0.186), (0.0, 0.19)], 24), m.soil)
    n = shop.n(10, 4)
    count = {"fern": 44, "snake": 16, "rubber": 26}[kind]
    for k in range(shop.copies(count, 6)):
        turn, green = k * 137.508 + shop.rng.uniform(-15, 15), m.leaves[k % 3]
        if kind == "fern":
            length, rise = shop.rng.uniform(0.24, 0.42), shop.rng.uniform(40, 80)
            frond = leaf(length, 0.035, np.radians(rise + 35), n)
            model.add(frond, green, (0, 0, 0.185), (0, -rise, turn))
        elif kind == "snake":
            x, y = circle(0.07 * np.sqrt((k % 8) / 8), 1, turn, turn + 1)[0]
            blade = leaf(shop.rng.uniform(0.3, 0.55), 0.06, 0.15, n)
            model.add(blade, green, (x, y, 0.18), (0, -shop.rng.uniform(76, 88), turn))
        else:
            z = 0.24 + 0.5 * k / count
            model.add(
                leaf(shop.rng.uniform(0.16, 0.24), 0.10, 0.9, n),
                green,
                (0, 0, z),
                (0, -shop.rng.uniform(15, 55), turn),
            )
    if kind == "rubber":
        model.add(shop.bend([(0, 0, 0.18), (0.01, 0, 0.4), (0, 0.01, 0.75)], 0.009, 10), m.soil)
    return model.mesh(f"Plant {kind}")


def plants(shop: Shop, glassware: Sequence[bpy.types.Mesh]) -> None:
    """Plants on the sill and in the corners, one hanging; bottles between those on the sill."""
    fern, snake, rubber = (plant(shop, kind) for kind in ("fern", "snake", "rubber"))
    sill = wall("front", sum(WINDOW_X) / 2) @ common.transform((0, 0.08, WINDOW_Z[0]))
    for x, data, scale in (
        (1.05, fern, 0.6),
        (0.2, snake, 0.55),
        (-0.45, fern, 0.5),
        (-1.1, rubber, 0.6),
    ):
        put(data, sill, (x, 0, 0), (0, 0, shop.rng.uniform(0, 360)), scale)
    for x in (0.65, -0.12, -0.78):
        stock(shop, glassware, sill @ common.transform((x, -0.03, 0)), 0.34, 0.12)
    put(rubber, Matrix(), (2.18, 3.38, 0), (0, 0, 40), 1.5)
    put(snake, Matrix(), (-2.22, 3.46, 0), (0, 0, 10), 1.3)
    put(fern, Matrix(), (-2.24, 3.42, 1.62), (0, 0, 200), 0.8)
    hanger = Model()
    for k in range(3):
        x, y = circle(0.105, 3)[k]
        hanger.add(shop.tube([(x, y, 0.165), (0, 0, 0.78)], 0.003, 6), shop.m.brass)
        hanger.add(
            shop.bend([(x, y, 0.165), (x * 0.8, y * 0.8, 0.0), (0, 0, -0.01)], 0.003, 8),
            shop.m.brass,
        )
    hanger.add(shop.tube([(0, 0, 0.77), (0, 0, 1.38)], 0.003, 6), shop.m.brass)
    put(hanger.mesh("Plant hanger"), Matrix(), (-2.24, 3.42, 1.62))


def hair_clippings(shop: Shop) -> None:
    """Cut hair on the floor round the chairs, as small tufts instanced many times."""
    m = shop.m
    tufts = []
    for hair in m.hair:
        model = Model()
        for _ in range(shop.copies(60, 6)):
            x, y = shop.rng.normal(0, 0.05, 2)
            bow, length = shop.rng.uniform(0.004, 0.014), shop.rng.uniform(0.015, 0.045)
            path = [
                (-length / 2, 0, 0),
                (-length / 6, bow * 0.7, 0.0012),
                (length / 4, bow, 0.0012),
                (length / 2, 0, 0.0004),
            ]
            strand = common.tube(path, [0.0003, 0.0006, 0.0006, 0.0002], 3)
            model.add(strand, hair, (x, y, 0.0012), (0, 0, shop.rng.uniform(0, 360)))
        tufts.append(model.mesh(f"Clippings {hair.name.lower()}"))
    for i, y in enumerate(STATIONS):
        for _ in range(shop.copies(26, 2)):
            angle, r = shop.rng.uniform(0, 2 * np.pi), shop.rng.uniform(0.62, 0.85)
            at = (-1.40 + r * np.cos(angle), y + r * np.sin(angle), 0.001)
            put(
                tufts[i], Matrix(), at, (0, 0, shop.rng.uniform(0, 360)), shop.rng.uniform(0.7, 1.3)
            )


def broom(shop: Shop) -> None:
    """A broom and a dustpan, leaning in the corner by the counter."""
    m, model = shop.m, Model()
    model.add(shop.tube([(0, 0, 0.10), (0, 0, 1.35)], 0.012, 12), m.oak)
    model.box((0.30, 0.05, 0.04), m.oak, (0, 0, 0.10), bevel=0.01)
    for x in np.linspace(-0.14, 0.14, shop.copies(34, 6)):
        for y in (-0.018, 0.0, 0.018):
            model.add(common.tube([(x, y, 0.085), (x * 1.1, y * 1.4, 0.0)], 0.0035, 5), m.bristle)
    put(model.mesh("Broom"), Matrix(), (-2.02, -3.50, 0.004), (7, -4, 35))
    pan = Model()
    pan.box((0.26, 0.22, 0.006), m.red, (0, 0, 0.004), (-3, 0, 0))
    for x in (-0.13, 0.13):
        pan.box((0.005, 0.22, 0.05), m.red, (x, 0, 0.027))
    pan.box((0.26, 0.005, 0.07), m.red, (0, -0.11, 0.04))
    pan.add(shop.tube([(0, -0.11, 0.05), (0, -0.26, 0.07)], 0.012, 12), m.black)
    put(pan.mesh("Dustpan"), Matrix(), (-1.98, -3.05, 0.002), (0, 0, 100))
    bin_model = Model()
    bin_model.add(
        common.lathe(
            [
                (0.13, 0),
                (0.14, 0.01),
                (0.16, 0.38),
                (0.166, 0.385),
                (0.158, 0.385),
                (0.13, 0.02),
                (0, 0.015),
            ],
            shop.n(36, 10),
        ),
        m.steel,
    )
    for z in (0.10, 0.28):
        bin_model.add(shop.ring(0.1425 + 0.053 * z, 0.005, 40), m.steel, (0, 0, z))
    for k in range(shop.copies(14, 3)):
        x, y = shop.rng.uniform(-0.08, 0.08, 2)
        bin_model.add(
            rounded_box((0.07, 0.05, 0.04), 0.015, 2),
            (m.paper, m.white)[k % 2],
            (x, y, 0.33 + 0.02 * (k % 3)),
            shop.rng.uniform(0, 360, 3),
        )
    data = bin_model.mesh("Waste bin")
    put(data, Matrix(), (-2.28, -3.45, 0))
    put(data, Matrix(), (0.72, -2.55, 0), (0, 0, 70))


def small_fittings(shop: Shop) -> None:
    """Switches, sockets, a thermometer, an entrance mat, a floor drain and wall vents."""
    m, switch, vent, mat = shop.m, Model(), Model(), Model()
    switch.box((0.08, 0.12, 0.008), m.brass, (0, 0, 0.004), bevel=0.003)
    for x in (-0.018, 0.018):
        switch.add(
            shop.lathe([(0.009, 0), (0.006, 0.006), (0.004, 0.022), (0, 0.024)], 14),
            m.brass,
            (x, 0, 0.007),
            (20, 0, 0),
        )
    plate = switch.mesh("Light switch")
    hang(plate, wall("front", 2.12), 0, 1.22, 0.0)
    hang(plate, wall("back", -0.92), 0, 1.25, 0.0)
    for y in (-1.45, 0.55, 1.45):
        hang(plate, wall("left", y), 0, 1.03, 0.012)
    vent.add(frame(0.36, 0.16, [(0, 0), (0, 0.012), (0.02, 0.012), (0.025, 0)]), m.gold)
    vent.box((0.36, 0.16, 0.002), m.black, (0, 0, 0.001))
    for y in np.linspace(-0.065, 0.065, 7):
        vent.box((0.36, 0.014, 0.003), m.gold, (0, y, 0.007), (35, 0, 0))
    grille = vent.mesh("Vent")
    for side, along in (("right", 2.9), ("left", -3.52), ("left", 3.52)):
        hang(grille, wall(side, along), 0, 2.46, 0.0)
    mat.box((0.9, 0.55, 0.014), m.bristle, (0, 0, 0.007), bevel=0.005)
    mat.box((0.84, 0.49, 0.004), m.rug[1], (0, 0, 0.0145), bevel=0.001)
    mat.add(lettering("WELCOME"), m.rug[2], (0, 0, 0.0168), (0, 0, 180), (0.17, 0.17, 1))
    put(mat.mesh("Entrance mat"), wall("front", sum(DOOR_X) / 2), (0, 0.42, 0))
    drain = Model()
    drain.add(shop.lathe([(0.07, 0), (0.068, 0.003), (0.0, 0.003)], 36), m.brass)
    for k in range(12):
        x, y = circle(0.045, 12)[k]
        drain.add(shop.lathe([(0.006, 0), (0.006, 0.0006)], 10), m.black, (x, y, 0.003))
    put(drain.mesh("Floor drain"), Matrix(), (-0.62, -2.5, 0.0))


# --- The whole ------------------------------------------------------------------------------------


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the current, empty scene. parameters: `seed` (int) and `detail` (1.0 = full)."""
    detail = float(parameters["detail"])
    shop = Shop(np.random.default_rng(int(parameters["seed"])), detail, materials())
    elements = (
        floor,
        medallion,
        walls,
        metro_tiles,
        wainscot,
        ceiling,
        frieze,
        shop_window,
        shop_door,
        back_door,
        street,
    )
    furniture = (
        barber_chairs,
        counter,
        mirrors,
        basins,
        waiting_bench,
        low_table,
        radiator,
        reception,
    )
    fittings = (
        posters,
        clock,
        barber_pole,
        coat_rack,
        towel_tower,
        hair_clippings,
        broom,
        small_fittings,
    )
    lamps = (lights, pendant_lamps, ceiling_fan, sconces)
    for element in (*elements, *furniture, *fittings, *lamps):
        element(shop)
    sky()
    glassware, pots = bottles(shop), jars(shop)
    station_goods(shop, glassware, pots)
    display_cabinet(shop, glassware, pots)
    back_shelves(shop, glassware, pots)
    trolley(shop, pots)
    plants(shop, glassware)
