"""What every scene builder needs: shapes from numpy, objects, shader nodes, sky and animation.

Units are metres and radians, Z is up, the ground is z = 0. Everything is deterministic: random
numbers come from a `numpy.random.Generator` that the builder seeds.
"""

import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from mathutils.geometry import tessellate_polygon
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]
Color = tuple[float, float, float]


def steps(full: float, detail: float, least: int = 3) -> int:
    """A number of segments or copies, `full` at detail 1 and scaled by it, at least `least`."""
    return max(least, round(full * detail))


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Random numbers of one element's own, so that a change to it leaves the others as they are."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


# --- Shapes ---------------------------------------------------------------------------------------


def _no_faces(corners: int) -> Array:
    return np.empty((0, corners), dtype=np.int32)


@dataclass
class Shape:
    """A mesh as arrays: vertices (n, 3), quads (m, 4), triangles (k, 3), and the material of each.

    `slots` (m + k) holds each face's material slot, quads first; empty means slot 0 for all.
    """

    vertices: Array
    quads: Array = field(default_factory=lambda: _no_faces(4))
    triangles: Array = field(default_factory=lambda: _no_faces(3))
    slots: Array = field(default_factory=lambda: np.empty(0, dtype=np.int32))

    def face_slots(self) -> Array:
        if len(self.slots):
            return self.slots
        return np.zeros(len(self.quads) + len(self.triangles), dtype=np.int32)

    def painted(self, slot: int) -> "Shape":
        """The same shape with every face in material slot `slot`."""
        return Shape(
            self.vertices, self.quads, self.triangles, np.full_like(self.face_slots(), slot)
        )

    def transformed(self, matrix: Matrix) -> "Shape":
        """The shape moved by a 4 × 4 matrix (see `transform`)."""
        m = np.array(matrix)
        return Shape(self.vertices @ m[:3, :3].T + m[:3, 3], self.quads, self.triangles, self.slots)

    def moved(self, x: float, y: float, z: float) -> "Shape":
        return Shape(self.vertices + np.array([x, y, z]), self.quads, self.triangles, self.slots)


def join(shapes: Iterable[Shape]) -> Shape:
    """One shape of many; material slots are kept."""
    parts = list(shapes)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    pairs = list(zip(parts, starts, strict=False))
    slots = [part.face_slots() for part in parts]
    return Shape(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.quads + start for part, start in pairs]),
        np.concatenate([part.triangles + start for part, start in pairs]),
        np.concatenate(
            [s[: len(p.quads)] for p, s in zip(parts, slots, strict=True)]
            + [s[len(p.quads) :] for p, s in zip(parts, slots, strict=True)]
        ),
    )


def copies(shape: Shape, rotations: Array, positions: Array) -> Shape:
    """One shape that holds a copy at each position (n, 3), turned by its 3 × 3 matrix (n, 3, 3).

    The matrices may scale too. For what is many and small: leaves, blades of grass, pebbles.
    """
    count, size = len(positions), len(shape.vertices)
    vertices = np.einsum("nij,vj->nvi", rotations, shape.vertices) + positions[:, None]
    starts = (np.arange(count, dtype=np.int32) * size)[:, None, None]
    quads, triangles = (
        shape.face_slots()[: len(shape.quads)],
        shape.face_slots()[len(shape.quads) :],
    )
    return Shape(
        vertices.reshape(-1, 3),
        (shape.quads + starts).reshape(-1, 4),
        (shape.triangles + starts).reshape(-1, 3),
        np.concatenate([np.tile(quads, count), np.tile(triangles, count)]),
    )


def frames(forward: Array, up: Array) -> Array:
    """Rotations (n, 3, 3) that take +Y to `forward` (n, 3), and +Z as near `up` as can be."""
    y = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
    x = np.cross(y, up)
    x /= np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def transform(
    location: Sequence[float] = (0, 0, 0),
    rotation: Sequence[float] = (0, 0, 0),
    scale: float | Sequence[float] = 1.0,
) -> Matrix:
    """The matrix of a location, XYZ Euler rotation in radians, and scale."""
    size = (scale,) * 3 if isinstance(scale, int | float) else scale
    return Matrix.LocRotScale(Vector(location), Euler(rotation), Vector(size))


def _from_bmesh(bm: bmesh.types.BMesh) -> Shape:
    bm.verts.index_update()
    faces = [[v.index for v in f.verts] for f in bm.faces]
    for f in [f for f in faces if len(f) > 4]:
        faces.remove(f)
        faces.extend([f[0], f[i], f[i + 1]] for i in range(1, len(f) - 1))
    vertices = np.array([v.co for v in bm.verts], dtype=float)
    bm.free()
    return Shape(
        vertices,
        np.array([f for f in faces if len(f) == 4], dtype=np.int32).reshape(-1, 4),
        np.array([f for f in faces if len(f) == 3], dtype=np.int32).reshape(-1, 3),
    )


def box(size: Sequence[float], bevel: float = 0.0, segments: int = 2) -> Shape:
    """A box centred at the origin, its edges rounded by `bevel` metres."""
    bm = bmesh.new()
    bmesh.ops.create_cube(bm, size=1.0, matrix=Matrix.Diagonal((*size, 1.0)))
    if bevel:
        bmesh.ops.bevel(
            bm,
            geom=bm.edges[:],
            offset=min(bevel, 0.49 * min(size)),
            segments=segments,
            affect="EDGES",
            profile=0.5,
        )
    return _from_bmesh(bm)


def icosphere(subdivisions: int, radius: float = 1.0) -> Shape:
    bm = bmesh.new()
    bmesh.ops.create_icosphere(bm, subdivisions=subdivisions, radius=radius)
    return _from_bmesh(bm)


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Shape:
    """A sheet facing +Z over the coordinates x (nx) and y (ny), with heights z (ny, nx)."""
    gx, gy = np.meshgrid(np.asarray(x, float), np.asarray(y, float))
    gz = np.broadcast_to(np.asarray(z, float), gx.shape)
    return sheet(np.stack([gx, gy, gz], axis=-1))


def sheet(points: Array, closed: bool = False) -> Shape:
    """Quads over an array of points (rows, columns, 3); `closed` joins last and first column.

    The front is where columns run rightwards and rows upwards.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    quads = np.stack(corners, axis=-1).reshape(-1, 4)
    return Shape(points.reshape(-1, 3).astype(float), quads)


def _fan(ring: Array, center: int, upwards: bool) -> Array:
    following = np.roll(ring, -1)
    pair = (ring, following) if upwards else (following, ring)
    return np.stack([*pair, np.full_like(ring, center)], axis=-1)


def _capped(body: Shape, rows: int, columns: int) -> Shape:
    """A closed sheet with its first and last row filled."""
    first, last = np.arange(columns), np.arange((rows - 1) * columns, rows * columns)
    centers = [body.vertices[first].mean(0), body.vertices[last].mean(0)]
    n = len(body.vertices)
    triangles = np.concatenate([_fan(first, n, False), _fan(last, n + 1, True)])
    return Shape(np.concatenate([body.vertices, centers]), body.quads, triangles.astype(np.int32))


def lathe(profile: ArrayLike, segments: int, capped: bool = True) -> Shape:
    """A surface of revolution about Z of profile (n, 2) = radius and height, from bottom to top."""
    radius, height = np.asarray(profile, float).T
    angle = np.arange(segments) * (2 * np.pi / segments)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.empty((len(radius), segments, 3))
    points[..., :2] = np.maximum(radius, 1e-6)[:, None, None] * ring
    points[..., 2] = height[:, None]
    body = sheet(points, closed=True)
    return _capped(body, len(radius), segments) if capped else body


def tube(path: ArrayLike, radius: ArrayLike, sides: int = 8, capped: bool = True) -> Shape:
    """A tube along path (n, 3) with a radius for all or one (n) for each point."""
    points = np.asarray(path, float)
    radii = np.broadcast_to(np.asarray(radius, float), len(points))
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], np.eye(3)[np.abs(tangents[0]).argmin()])
    angle = np.arange(sides) * (2 * np.pi / sides)
    rings = []
    for point, r, tangent in zip(points, radii, tangents, strict=True):
        side = side - tangent * (side @ tangent)  # parallel transport: no twist along the path
        side /= np.linalg.norm(side)
        up = np.cross(tangent, side)
        rings.append(point + r * (np.outer(np.cos(angle), side) + np.outer(np.sin(angle), up)))
    body = sheet(np.array(rings), closed=True)
    return _capped(body, len(points), sides) if capped else body


def prism(outline: ArrayLike, height: float) -> Shape:
    """A plane outline (n, 2), counter-clockwise and not crossing itself, extruded from z = 0."""
    flat = np.asarray(outline, float)
    n = len(flat)
    bottom = np.column_stack([flat, np.zeros(n)])
    top = bottom + np.array([0, 0, height])
    cap = np.array(tessellate_polygon([[Vector(p) for p in bottom]]), dtype=np.int32)
    a, b, c = (flat[cap[:, i]] for i in range(3))
    ab, ac = b - a, c - a
    turned = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] < 0
    cap[turned] = cap[turned][:, ::-1]
    sides = sheet(np.stack([bottom, top]), closed=True)
    return Shape(sides.vertices, sides.quads, np.concatenate([cap[:, ::-1], cap + n]))


def noise(points: ArrayLike, seed: int, octaves: int = 1) -> Array:
    """Perlin's gradient noise at points (..., 3), about −1..1; further octaves halve in size.

    Ken Perlin, "Improving Noise", SIGGRAPH 2002, with an integer hash in place of the table.
    """
    shape = np.shape(points)[:-1]
    p = np.asarray(points, float).reshape(-1, 3)
    total = np.zeros(len(p))
    for octave in range(octaves):
        total += _perlin(p * 2.0**octave, seed + 101 * octave) / 2.0**octave
    return total.reshape(shape)


def _perlin(p: Array, seed: int) -> Array:
    cell = np.floor(p)
    f = p - cell
    lattice = cell.astype(np.int64).astype(np.uint32)  # wraps round: only hashed
    blend = f * f * f * (f * (f * 6 - 15) + 10)
    result = np.zeros(p.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        h = np.full(p.shape[:-1], seed * 2654435761 % 2**32, dtype=np.uint32)
        for axis in range(3):
            h = (h ^ (lattice[..., axis] + np.uint32(corner[axis]))) * np.uint32(0x85EBCA6B)
            h ^= h >> np.uint32(15)
        h = h * np.uint32(0xC2B2AE35)
        h ^= h >> np.uint32(16)
        d = f - np.array(corner)
        weight = np.prod(np.where(np.array(corner) == 1, blend, 1 - blend), axis=-1)
        first = (h >> np.uint32(4)) % np.uint32(3)  # the axis a gradient lacks: 12 edges of a cube
        u = np.where(first == 0, d[..., 1], d[..., 0])
        v = np.where(first == 2, d[..., 1], d[..., 2])
        dot = np.where(h & 1, u, -u) + np.where(h & 2, v, -v)
        result += weight * dot
    return result


# --- Objects --------------------------------------------------------------------------------------


def mesh(
    name: str,
    shape: Shape,
    *materials: bpy.types.Material,
    smooth: bool | float = True,
) -> bpy.types.Mesh:
    """A bpy mesh of a shape with its materials.

    `smooth` may be an angle in radians, above which edges stay sharp.
    """
    data = bpy.data.meshes.new(name)
    nq, nt = len(shape.quads), len(shape.triangles)
    corners = np.concatenate([shape.quads.ravel(), shape.triangles.ravel()]).astype(np.int32)
    starts = np.concatenate([np.arange(nq) * 4, nq * 4 + np.arange(nt) * 3]).astype(np.int32)
    data.vertices.add(len(shape.vertices))
    data.vertices.foreach_set("co", shape.vertices.astype(np.float32).ravel())
    data.loops.add(len(corners))
    data.loops.foreach_set("vertex_index", corners)
    data.polygons.add(nq + nt)
    data.polygons.foreach_set("loop_start", starts)
    for material in materials:
        data.materials.append(material)
    data.polygons.foreach_set("material_index", shape.face_slots().astype(np.int32))
    data.update(calc_edges=True)
    if smooth is False:
        data.shade_flat()
    else:
        data.shade_smooth()
        if smooth is not True:
            data.set_sharp_from_angle(angle=float(smooth))
    return data


def place(
    name: str,
    data: bpy.types.ID | None,
    matrix: Matrix | None = None,
    parent: bpy.types.Object | None = None,
) -> bpy.types.Object:
    """An object of a mesh, light or curve in the scene.

    Objects that share one mesh are instances: Cycles keeps it in memory once.
    """
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    if matrix is not None:
        thing.matrix_world = matrix
    if parent is not None:
        thing.parent = parent
    return thing


def add(
    name: str,
    shape: Shape,
    *materials: bpy.types.Material,
    matrix: Matrix | None = None,
    smooth: bool | float = True,
) -> bpy.types.Object:
    """One object of its own mesh: `mesh` and `place` in one."""
    return place(name, mesh(name, shape, *materials, smooth=smooth), matrix)


def scatter(
    name: str, meshes: Sequence[bpy.types.Mesh], matrices: Iterable[Matrix]
) -> list[bpy.types.Object]:
    """Instances of the meshes, taken in turn, one at each matrix."""
    return [
        place(f"{name}.{i:04d}", meshes[i % len(meshes)], matrix)
        for i, matrix in enumerate(matrices)
    ]


# --- Lights and sky -------------------------------------------------------------------------------


def point_light(
    name: str, location: Sequence[float], watts: float, color: Color, radius: float
) -> bpy.types.Object:
    """A spherical lamp that lights but is not itself seen: give it a flame or bulb to be seen.

    A radius of 0.02 m or more keeps the noise down.
    """
    light = bpy.data.lights.new(name, "POINT")
    light.energy, light.color, light.shadow_soft_size = watts, color, radius
    lamp = place(name, light, transform(location))
    lamp.visible_camera = lamp.visible_glossy = lamp.visible_transmission = False
    return lamp


def area_light(
    name: str, matrix: Matrix, size: tuple[float, float], watts: float, color: Color
) -> bpy.types.Object:
    """A rectangular lamp that shines along its −Z."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape, light.size, light.size_y = "RECTANGLE", *size
    light.energy, light.color = watts, color
    return place(name, light, matrix)


def sun_light(
    name: str, azimuth: float, elevation: float, strength: float, color: Color, angle: float
) -> bpy.types.Object:
    """A sun: azimuth from +X towards +Y, elevation above the horizon, angular diameter; radians."""
    light = bpy.data.lights.new(name, "SUN")
    light.energy, light.color, light.angle = strength, color, angle
    return place(name, light, transform(rotation=(np.pi / 2 - elevation, 0, azimuth + np.pi / 2)))


def hdri_world(
    filename: str, strength: float = 1.0, rotation: float = 0.0, brightest: float | None = None
) -> bpy.types.World:
    """The scene's world: an environment that ships with bpy, packed into the .blend.

    filename: one of datafiles/studiolights/world, "sunrise.exr" for example. rotation: radians
    about Z. brightest: the radiance to cut the sun's disc to, so its reflections make no fireflies.
    """
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    image = bpy.data.images.load(str(folder / filename))
    image.pack()
    image.filepath = f"//{filename}"  # the path on the building machine is nobody's business
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    graph = Graph(world.node_tree)
    coordinates = graph.add("ShaderNodeTexCoord").outputs["Generated"]
    turned = graph.add(
        "ShaderNodeMapping", {"Vector": coordinates, "Rotation": (0.0, 0.0, -rotation)}
    )
    color = graph.add("ShaderNodeTexEnvironment", {"Vector": turned}, image=image).outputs["Color"]
    if brightest is not None:
        color = graph.add(
            "ShaderNodeVectorMath", {0: color, 1: (brightest,) * 3}, operation="MINIMUM"
        ).outputs[0]
    background = graph.add("ShaderNodeBackground", {"Color": color, "Strength": strength})
    graph.add("ShaderNodeOutputWorld", {"Surface": background})
    return world


# --- Materials ------------------------------------------------------------------------------------


class Graph:
    """A shader node tree that is built by expressions.

    Wherever a method takes an input it may be a value, a socket, or a node (its first output).
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        tree.nodes.clear()

    def add(
        self, kind: str, inputs: Mapping[str | int, Any] | None = None, **properties: Any
    ) -> bpy.types.Node:
        """A node of type `kind`, its properties set, its inputs (by name or number) given."""
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        for key, value in (inputs or {}).items():
            socket = node.inputs[key]
            if isinstance(value, bpy.types.Node):
                value = value.outputs[0]
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            elif socket.type == "RGBA" and len(value) == 3:
                socket.default_value = (*value, 1.0)
            else:
                socket.default_value = value
        return node

    def coordinates(self, kind: str = "Object", scale: Any = 1.0) -> bpy.types.NodeSocket:
        """Texture coordinates: Object, Generated, Normal, UV, Window or Reflection."""
        socket = self.add("ShaderNodeTexCoord").outputs[kind]
        size = (scale,) * 3 if isinstance(scale, int | float) else scale
        return self.add("ShaderNodeMapping", {"Vector": socket, "Scale": size}).outputs[0]

    def noise(
        self,
        vector: Any,
        scale: float,
        detail: float = 4.0,
        roughness: float = 0.5,
        distortion: float = 0.0,
        w: float | None = None,
    ) -> bpy.types.NodeSocket:
        """Noise in 0..1, around 0.5. With `w` it is four-dimensional (see `animate`)."""
        inputs: dict[str | int, Any] = {
            "Vector": vector,
            "Scale": scale,
            "Detail": detail,
            "Roughness": roughness,
            "Distortion": distortion,
        }
        if w is None:
            return self.add("ShaderNodeTexNoise", inputs).outputs[0]
        inputs["W"] = w
        return self.add("ShaderNodeTexNoise", inputs, noise_dimensions="4D").outputs[0]

    def voronoi(self, vector: Any, scale: float, feature: str = "F1") -> bpy.types.Node:
        """Voronoi cells: outputs Distance and, but for DISTANCE_TO_EDGE, Color and Position."""
        inputs = {"Vector": vector, "Scale": scale}
        return self.add("ShaderNodeTexVoronoi", inputs, feature=feature)

    def ramp(self, factor: Any, stops: Sequence[tuple[float, Color]]) -> bpy.types.NodeSocket:
        """Colours by position: stops are (position 0..1, linear colour)."""
        node = self.add("ShaderNodeValToRGB", {0: factor})
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(1.0)
        for element, (position, color) in zip(elements, stops, strict=True):
            element.position, element.color = position, (*color, 1.0)
        return node.outputs[0]

    def span(
        self, value: Any, to_min: float, to_max: float, from_min: float = 0.0, from_max: float = 1.0
    ) -> bpy.types.NodeSocket:
        """A value mapped linearly from one range to another, clamped."""
        inputs = {0: value, 1: from_min, 2: from_max, 3: to_min, 4: to_max}
        return self.add("ShaderNodeMapRange", inputs).outputs[0]

    def math(self, operation: str, a: Any, b: Any = 0.0) -> bpy.types.NodeSocket:
        return self.add("ShaderNodeMath", {0: a, 1: b}, operation=operation).outputs[0]

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> bpy.types.NodeSocket:
        """Two colours mixed: a at factor 0, b at factor 1."""
        node = self.add(
            "ShaderNodeMix", {0: factor, 6: a, 7: b}, data_type="RGBA", blend_type=blend
        )
        return node.outputs[2]

    def xyz(self, vector: Any) -> bpy.types.NodeOutputs:
        """The components of a vector: outputs "X", "Y", "Z"."""
        return self.add("ShaderNodeSeparateXYZ", {0: vector}).outputs

    def bump(self, height: Any, distance: float, strength: float = 1.0) -> bpy.types.NodeSocket:
        """A normal bent by heights in units of `distance` metres."""
        return self.add(
            "ShaderNodeBump", {"Height": height, "Distance": distance, "Strength": strength}
        ).outputs[0]

    def object_random(self) -> bpy.types.NodeSocket:
        """A number in 0..1 that each object (instance) has of its own."""
        return self.add("ShaderNodeObjectInfo").outputs["Random"]

    def island_random(self) -> bpy.types.NodeSocket:
        """A number in 0..1 that each connected piece of a mesh has of its own."""
        return self.add("ShaderNodeNewGeometry").outputs["Random Per Island"]

    def principled(self, **inputs: Any) -> bpy.types.Node:
        """A Principled BSDF; inputs by name with underscores: Base_Color, Roughness, IOR, …"""
        named = {name.replace("_", " "): value for name, value in inputs.items()}
        return self.add("ShaderNodeBsdfPrincipled", named)

    def plain_when_diffuse(self, surface: Any, color: Color) -> bpy.types.Node:
        """A shader that is a flat diffuse `color` to rays that come from a diffuse surface.

        Cycles then skips the textures wherever light has been blurred already: give it the
        surface's mean colour.
        """
        blurred = self.add("ShaderNodeLightPath").outputs["Is Diffuse Ray"]
        flat = self.add("ShaderNodeBsdfDiffuse", {"Color": color})
        return self.add("ShaderNodeMixShader", {0: blurred, 1: surface, 2: flat})


def material(name: str) -> tuple[bpy.types.Material, Graph]:
    """An empty material and its graph; finish it with `finish`."""
    made = bpy.data.materials.new(name)
    return made, Graph(made.node_tree)


def finish(
    made: bpy.types.Material, graph: Graph, surface: Any = None, volume: Any = None
) -> bpy.types.Material:
    """Connect a graph's surface and volume shaders to the material's output."""
    inputs = {"Surface": surface, "Volume": volume}
    graph.add("ShaderNodeOutputMaterial", {k: v for k, v in inputs.items() if v is not None})
    return made


def plain(name: str, color: Color, **inputs: Any) -> bpy.types.Material:
    """A material of one Principled BSDF: plain("Brass", (0.6, 0.4, 0.1), Metallic=1.0)."""
    made, graph = material(name)
    return finish(made, graph, graph.principled(Base_Color=color, **inputs))


# --- Animation ------------------------------------------------------------------------------------


def animate(owner: bpy.types.bpy_struct, path: str, per_frame: float, index: int = -1) -> None:
    """Let a property grow by `per_frame` each frame for ever, from its present value at frame 1.

    owner is the struct that holds it (a node's input socket with path "default_value", an object
    with "location" and an index). Keyframes, not a driver: drivers need scripts enabled.
    """
    start = getattr(owner, path) if index < 0 else getattr(owner, path)[index]
    for frame, value in ((1, start), (2, start + per_frame)):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)
    action = owner.id_data.animation_data.action
    for curve in action.layers[0].strips[0].channelbags[0].fcurves:
        curve.extrapolation = "LINEAR"
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    if index < 0:
        setattr(owner, path, start)
    else:
        getattr(owner, path)[index] = start
