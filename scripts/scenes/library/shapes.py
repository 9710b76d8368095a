"""Meshes as numpy arrays: primitives, sheets, sweeps, and copies of one shape."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import bmesh
import numpy as np
from mathutils import Matrix, Vector
from mathutils.geometry import tessellate_polygon
from numpy.typing import ArrayLike

from scenes.library.points import Array, Points, points, polar, unit


def _no_faces(corners: int) -> Array:
    return np.empty((0, corners), dtype=np.int32)


@dataclass(frozen=True)
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
        return replace(self, slots=np.full_like(self.face_slots(), slot))

    def reshaped(self, vertices: Array) -> "Shape":
        """The same faces over other vertices (n, 3)."""
        return replace(self, vertices=vertices)

    def transformed(self, matrix: Matrix) -> "Shape":
        """The shape moved by a 4 × 4 matrix (see `objects.transform`)."""
        m = np.array(matrix)
        return self.reshaped(self.vertices @ m[:3, :3].T + m[:3, 3])

    def moved(self, x: float, y: float, z: float) -> "Shape":
        return self.reshaped(self.vertices + np.array([x, y, z]))


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


def facets(vertices: Points, *faces: Sequence[int]) -> Shape:
    """A shape of few faces, each given by the numbers of its three or four vertices."""
    triangles, quads = ([face for face in faces if len(face) == n] for n in (3, 4))
    corners = (np.array(f, np.int32).reshape(-1, n) for f, n in ((quads, 4), (triangles, 3)))
    return Shape(points(vertices), *corners)


def copies(
    shape: Shape,
    at: ArrayLike,
    forward: ArrayLike = (0, 1, 0),
    up: ArrayLike = (0, 0, 1),
    size: ArrayLike = 1.0,
) -> Shape:
    """One shape that holds a copy at each place (n, 3). For what is many and small: leaves, tiles.

    forward, up: one direction for all or (n, 3); +Y of the copy points forward, +Z as near to up
    as can be. size: a number, one for each (n), or one for each axis of each (n, 3).
    """
    places = np.asarray(at, float)
    count = len(places)
    scale = np.asarray(size, float)
    scale = np.broadcast_to(scale[:, None] if scale.ndim == 1 else scale, places.shape)
    turns = frames(forward, np.broadcast_to(up, places.shape)) * scale[:, None, :]
    vertices = np.einsum("nij,vj->nvi", turns, shape.vertices) + places[:, None]
    starts = (np.arange(count, dtype=np.int32) * len(shape.vertices))[:, None, None]
    slots, quads = shape.face_slots(), len(shape.quads)
    return Shape(
        vertices.reshape(-1, 3),
        (shape.quads + starts).reshape(-1, 4),
        (shape.triangles + starts).reshape(-1, 3),
        np.concatenate([np.tile(slots[:quads], count), np.tile(slots[quads:], count)]),
    )


def frames(forward: ArrayLike, up: ArrayLike) -> Array:
    """Rotations (n, 3, 3) that take +Y to `forward` (n, 3), and +Z as near `up` as can be."""
    y, upwards = np.broadcast_arrays(unit(forward), np.asarray(up, float))
    x = unit(np.cross(y, upwards))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _from_bmesh(bm: bmesh.types.BMesh) -> Shape:
    bm.verts.index_update()
    faces = [[v.index for v in f.verts] for f in bm.faces]
    for f in [f for f in faces if len(f) > 4]:
        faces.remove(f)
        faces.extend([f[0], f[i], f[i + 1]] for i in range(1, len(f) - 1))
    vertices = np.array([v.co for v in bm.verts], dtype=float)
    vertices.flags.writeable = False  # cached shapes are shared
    bm.free()
    return Shape(
        vertices,
        np.array([f for f in faces if len(f) == 4], dtype=np.int32).reshape(-1, 4),
        np.array([f for f in faces if len(f) == 3], dtype=np.int32).reshape(-1, 3),
    )


def box(size: Sequence[float], bevel: float = 0.0, segments: int = 2) -> Shape:
    """A box centred at the origin, its edges rounded by `bevel` metres."""
    return _box(tuple(map(float, size)), bevel, segments)


@cache  # props are made of many alike
def _box(size: tuple[float, ...], bevel: float, segments: int) -> Shape:
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
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    body = Shape(places.reshape(-1, 3), np.stack(corners, axis=-1).reshape(-1, 4))
    return _capped(body, rows, columns) if capped else body


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
