"""Meshes, objects and their placement in Blender."""

from collections.abc import Iterable, Sequence

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from scenes.library.shapes import Shape


def transform(
    location: Sequence[float] = (0, 0, 0),
    rotation: Sequence[float] = (0, 0, 0),
    scale: float | Sequence[float] = 1.0,
) -> Matrix:
    """The matrix of a location, XYZ Euler rotation in radians, and scale."""
    size = (scale,) * 3 if isinstance(scale, int | float) else scale
    return Matrix.LocRotScale(Vector(location), Euler(rotation), Vector(size))


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


def place(name: str, data: bpy.types.ID | None, matrix: Matrix | None = None) -> bpy.types.Object:
    """An object of a mesh, light or curve in the scene, by default at its origin.

    Objects that share one mesh are instances: Cycles keeps it in memory once.
    """
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    if matrix is not None:
        thing.matrix_world = matrix
    return thing


def scatter(
    name: str, meshes: Sequence[bpy.types.Mesh], matrices: Iterable[Matrix]
) -> list[bpy.types.Object]:
    """Instances of the meshes, taken in turn, one at each matrix."""
    return [
        place(f"{name}.{i:04d}", meshes[i % len(meshes)], matrix)
        for i, matrix in enumerate(matrices)
    ]


def evaluated_shape(thing: bpy.types.Object) -> Shape:
    """The shape of an object after its modifiers."""
    return mesh_shape(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)


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
