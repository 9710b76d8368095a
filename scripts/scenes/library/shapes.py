"""Meshes as numpy arrays: primitives, sheets, sweeps, letters, and copies of one shape."""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from mathutils.geometry import tessellate_polygon
from numpy.typing import ArrayLike

from scenes.library.points import Array, Points, points, polar, unit, xyz


def transform(
    location: Sequence[float] = (0, 0, 0), rotation: Sequence[float] = (0, 0, 0), scale: Any = 1.0
) -> Matrix:
    """The matrix of a location, XYZ Euler rotation in radians, and scale (one, or three)."""
    size = (scale,) * 3 if isinstance(scale, int | float) else scale
    return Matrix.LocRotScale(Vector(location), Euler(rotation), Vector(size))


def towards(location: ArrayLike, direction: ArrayLike, axis: str = "-Z") -> Matrix:
    """The matrix that moves the origin to a location and turns an axis to a direction.

    The Y axis points upwards.
    """
    turn = Vector(direction).to_track_quat(axis, "Y").to_matrix().to_4x4()
    return Matrix.Translation(location) @ turn


class Shape(NamedTuple):
    """A mesh as arrays: vertices (n, 3), quads (m, 4), triangles (k, 3), and the material of each.

    `slots` (m + k) holds each face's material slot, quads first; empty means slot 0 for all.
    """

    vertices: Array
    quads: Array = np.empty((0, 4), np.int32)
    triangles: Array = np.empty((0, 3), np.int32)
    slots: Array = np.empty(0, np.int32)

    def face_slots(self) -> Array:
        count = len(self.quads) + len(self.triangles)
        return self.slots if len(self.slots) else np.zeros(count, np.int32)

    def painted(self, slot: int) -> "Shape":
        """The same shape with every face in material slot `slot`."""
        return self._replace(slots=np.full_like(self.face_slots(), slot))

    def reshaped(self, vertices: Array) -> "Shape":
        """The same faces over other vertices (n, 3)."""
        return self._replace(vertices=vertices)

    def scaled(self, *size: float) -> "Shape":
        return self.reshaped(self.vertices * size)

    def transformed(self, matrix: Matrix) -> "Shape":
        """The shape moved by a 4 × 4 matrix (see `transform`)."""
        m = np.array(matrix)
        return self.reshaped(self.vertices @ m[:3, :3].T + m[:3, 3])

    def moved(self, x: float, y: float, z: float) -> "Shape":
        return self.reshaped(self.vertices + np.array([x, y, z]))


def join(shapes: Iterable[Shape]) -> Shape:
    """One shape of many. Keeps the material slots."""
    parts = list(shapes)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    quad_slots = [part.face_slots()[: len(part.quads)] for part in parts]
    triangle_slots = [part.face_slots()[len(part.quads) :] for part in parts]
    return Shape(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.quads + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([*quad_slots, *triangle_slots]),
    )


def facets(vertices: Points, *faces: Sequence[int]) -> Shape:
    """A shape of few faces, each given by the numbers of its three or four vertices."""
    quads = np.reshape([face for face in faces if len(face) == 4], (-1, 4))
    triangles = np.reshape([face for face in faces if len(face) == 3], (-1, 3))
    return Shape(points(vertices), quads.astype(np.int32), triangles.astype(np.int32))


def copies(
    shape: Shape,
    at: ArrayLike,
    forward: ArrayLike = (0, 1, 0),
    up: ArrayLike = (0, 0, 1),
    size: ArrayLike = 1.0,
) -> Shape:
    """One shape with a copy at each place (n, 3). For many small objects, such as leaves or tiles.

    forward, up: one direction for all, or (n, 3). The +Y axis of a copy points forward, and its +Z
    axis as near to up as possible.

    size: one number, one for each copy (n,), or one for each of its axes (n, 3).
    """
    places = np.asarray(at, float)
    scale = np.asarray(size, float)
    scale = np.broadcast_to(scale[:, None] if scale.ndim == 1 else scale, places.shape)
    turns = frames(forward, np.broadcast_to(up, places.shape)) * scale[:, None, :]
    vertices = np.einsum("nij,vj->nvi", turns, shape.vertices) + places[:, None]
    count = len(places)
    starts = (np.arange(count, dtype=np.int32) * len(shape.vertices))[:, None, None]
    slots = np.split(shape.face_slots(), [len(shape.quads)])
    return Shape(
        vertices.reshape(-1, 3),
        (shape.quads + starts).reshape(-1, 4),
        (shape.triangles + starts).reshape(-1, 3),
        np.concatenate([np.tile(each, count) for each in slots]),
    )


def frames(forward: ArrayLike, up: ArrayLike) -> Array:
    """Rotations (n, 3, 3) that take +Y to `forward` (n, 3), and +Z as near to `up` as possible."""
    y, upwards = np.broadcast_arrays(unit(forward), np.asarray(up, float))
    x = unit(np.cross(y, upwards))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _from_bmesh(bm: bmesh.types.BMesh) -> Shape:
    bm.verts.index_update()
    faces = [[v.index for v in f.verts] for f in bm.faces]
    faces.sort(key=lambda f: len(f) > 4)  # these become fans of triangles
    fans = [[f[0], *f[i : i + 2]] for f in faces if len(f) != 4 for i in range(1, len(f) - 1)]
    vertices = np.array([v.co for v in bm.verts], dtype=float)
    vertices.flags.writeable = False  # cached shapes are shared
    bm.free()
    return facets(vertices, *(f for f in faces if len(f) == 4), *fans)


@cache  # props are made of many alike
def box(size: tuple[float, ...], bevel: float = 0.0, segments: int = 2) -> Shape:
    """A box centred at the origin, its edges rounded by `bevel` metres."""
    bm = bmesh.new()
    bmesh.ops.create_cube(bm, size=1.0, matrix=Matrix.Diagonal((*size, 1.0)))
    if bevel:
        rounded = {"offset": min(bevel, 0.49 * min(size)), "segments": segments, "profile": 0.5}
        bmesh.ops.bevel(bm, geom=bm.edges[:], affect="EDGES", **rounded)
    return _from_bmesh(bm)


def icosphere(subdivisions: int, radius: float = 1.0) -> Shape:
    bm = bmesh.new()
    bmesh.ops.create_icosphere(bm, subdivisions=subdivisions, radius=radius)
    return _from_bmesh(bm)


def mesh_shape(data: bpy.types.Mesh) -> Shape:
    """The shape of a mesh whose faces are quads and triangles."""
    vertices = np.empty(len(data.vertices) * 3, dtype=np.float32)
    data.vertices.foreach_get("co", vertices)
    corners = np.empty(len(data.loops), dtype=np.int32)
    data.loops.foreach_get("vertex_index", corners)
    sizes = np.empty(len(data.polygons), dtype=np.int32)
    data.polygons.foreach_get("loop_total", sizes)
    starts = np.cumsum(sizes) - sizes
    quads, triangles = (corners[starts[sizes == n, None] + np.arange(n)] for n in (4, 3))
    return Shape(vertices.reshape(-1, 3).astype(float), quads, triangles)


@cache
def lettering(text: str, depth: float) -> Shape:
    """Flat letters, 1 m high and centred, in Blender's own font, `depth` metres thick."""
    curve = bpy.data.curves.new("lettering", "FONT")
    curve.body = text
    curve.align_x = "CENTER"
    curve.align_y = "CENTER"
    curve.resolution_u = 3
    curve.extrude = depth / 2
    obj = bpy.data.objects.new("lettering", curve)
    data = bpy.data.meshes.new_from_object(obj)
    shape = mesh_shape(data)
    bpy.data.batch_remove([obj, curve, data])
    return shape


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Shape:
    """A sheet facing +Z over the coordinates x (nx) and y (ny), with heights z (ny, nx)."""
    return sheet(xyz(x, np.asarray(y)[:, None], z))


def sheet(grid_of_points: ArrayLike, closed: bool = False, capped: bool = False) -> Shape:
    """Quads over an array of points (rows, columns, 3); `closed` joins last and first column.

    The front is where columns run rightwards and rows upwards. `capped` fills the first and the
    last row of a closed sheet.
    """
    places = np.asarray(grid_of_points, float)
    rows, columns = places.shape[:2]
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    left = index[:, :-1]
    right = index[:, 1:]
    quads = np.stack([left[:-1], right[:-1], right[1:], left[1:]], axis=-1).reshape(-1, 4)
    if not capped:
        return Shape(places.reshape(-1, 3), quads)
    ends = np.concatenate([places.reshape(-1, 3), places[[0, -1]].mean(axis=1)])
    below, above = np.full((2, columns), [[rows * columns], [rows * columns + 1]], dtype=np.int32)
    fans = np.stack([right[0], left[0], below], -1), np.stack([left[-1], right[-1], above], -1)
    return Shape(ends, quads, np.concatenate(fans))


def lathe(profile: Points, segments: int, capped: bool = True) -> Shape:
    """A surface of revolution about Z of profile (n, 2) = radius and height, from bottom to top."""
    radius, height = points(profile).T[:, :, None]
    angle = np.arange(segments) * (2 * np.pi / segments)
    return sheet(polar(np.maximum(radius, 1e-6), angle, height), closed=True, capped=capped)


def tube(path: Points, radius: ArrayLike, sides: int = 8, capped: bool = True) -> Shape:
    """A tube along path (n, 3) with a radius for all or one (n) for each point."""
    places = points(path)
    radii = np.broadcast_to(np.asarray(radius, float), len(places))
    tangents = unit(np.gradient(places, axis=0))
    side = np.cross(tangents[0], np.eye(3)[np.abs(tangents[0]).argmin()])
    angle = np.arange(sides) * (2 * np.pi / sides)
    rings = []
    for place, r, tangent in zip(places, radii, tangents, strict=True):
        side = unit(side - tangent * (side @ tangent))  # parallel transport: no twist on the way
        up = np.cross(tangent, side)
        rings.append(place + r * (np.outer(np.cos(angle), side) + np.outer(np.sin(angle), up)))
    return sheet(rings, closed=True, capped=capped)


def prism(outline: Points, height: float) -> Shape:
    """A plane outline (n, 2), counter-clockwise and not crossing itself, extruded from z = 0."""
    flat = points(outline)
    sides = sheet(xyz(*flat.T, [[0], [height]]), closed=True)
    cap = np.array(tessellate_polygon([sides.vertices[: len(flat)].tolist()]), dtype=np.int32)
    ab, ac = (flat[cap[:, i]] - flat[cap[:, 0]] for i in (1, 2))
    turned = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] < 0
    cap[turned] = cap[turned][:, ::-1]
    return sides._replace(triangles=np.concatenate([cap[:, ::-1], cap + len(flat)]))
