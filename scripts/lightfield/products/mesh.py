"""Writes the surface that cameras can see as meshes, and where its objects are.

- ``scene.glb``: a node for each object, with its name and its pose. Instances share a mesh.
- ``scene.ply``: all triangles in the world. Each face has ``object``, an index in objects.json.
- ``objects.json``: the pose and the box of each object, and what is left out and why.

Lengths are in metres. The PLY and objects.json have the axes of lightfield.json, with Z up. A GLB
has Y up by its specification: its root node turns the world.

Meshes are written one after the other. trimesh writes the same content, but holds all instances in
memory: 1392 MB against 138 MB for ten million triangles, in 5.4 s against 1.5 s. Its bytes also
change with its version. Source: glTF 2.0 specification, 3.5 to
3.7 and 4.4; Turk, "The PLY Polygon File Format".
"""

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, write_text
from lightfield.core.names import MESH
from lightfield.geometry.mesh import (
    Floats,
    Mesh,
    OrientedBox,
    Placed,
    SceneSurface,
    box_around,
    to_world,
)
from lightfield.products.exports import is_of_dataset, replace_folder
from lightfield.rendering.inspection.visible_meshes import surface_of
from lightfield.stages.exports import WriteSurface

GLB = "scene.glb"
PLY = "scene.ply"
_OBJECTS = "objects.json"

# Numbers in objects.json have this many digits after the point: the last is a nanometre.
_DIGITS = 9
# Axes whose cosine is smaller are perpendicular.
_PERPENDICULAR = 1e-6
# A GLB gives its length in 32 bits, and a PLY of the common types an index in 31.
_MOST_GLB_BYTES = 2**32 - 1
_MOST_PLY_VERTICES = 2**31 - 1

# glTF's numbers for types and uses.
_FLOAT = 5126
_UNSIGNED_INT = 5125
_ARRAY_BUFFER = 34962
_ELEMENT_ARRAY_BUFFER = 34963
# The quaternion (x, y, z, w) that turns Z up to Y up.
_Z_UP_TO_Y_UP = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]


def write(job: WriteSurface) -> None:
    """Write what cameras can see of a scene, and list the files in export.json."""
    surface, frame = surface_of(job)
    formats = job.settings.formats
    files = replace_folder(
        MESH,
        {"formats": formats},
        job.output,
        lambda folder: _write_files(surface, formats, frame, folder),
        is_own=is_of_dataset(job.output, MESH),
    )
    for name, reason in surface.left_out.items():
        print(f"left out: {name}: {reason}")
    triangles = sum(len(surface.meshes[placed.mesh].triangles) for placed in surface.placed)
    print(
        f"{job.output}: {len(surface.placed)} objects and instances of "
        f"{len(surface.meshes)} meshes, {triangles} triangles, in {len(files)} files"
    )


def _write_files(surface: SceneSurface, formats: Sequence[str], frame: int, folder: Path) -> None:
    """Write a scene's surface at a ``frame`` into ``folder``, in ``formats`` of "glb" and "ply".

    Raises `UserError` if cameras can see no mesh, or if a format cannot hold so many triangles.
    """
    if not surface.placed:
        raise UserError(f"mesh: cameras can see no mesh at frame {frame}")
    if "glb" in formats:
        _write_glb(folder / GLB, surface)
    if "ply" in formats:
        _write_ply(folder / PLY, surface)
    objects = [_object(placed, surface.meshes[placed.mesh]) for placed in surface.placed]
    # A line for each object. A scene may have thousands.
    lines = ",\n".join(json.dumps(each, allow_nan=False) for each in objects)
    left_out = json.dumps(surface.left_out)
    write_text(
        folder / _OBJECTS,
        f'{{"frame": {frame},\n"left_out": {left_out},\n"objects": [\n{lines}\n]}}\n',
    )


def _object(placed: Placed, mesh: Mesh) -> dict[str, Any]:
    """Return an object's entry in objects.json."""
    box: OrientedBox = box_around(mesh, placed.world_from_object)
    parts = {"center": box.center, "size": box.size, "rotation": box.rotation}
    return {
        "name": placed.name,
        "original": placed.original,
        **placed.numbers,
        "matrix": placed.world_from_object.tolist(),
        # Adding 0 makes 0 of -0.
        "box": {key: (values.round(_DIGITS) + 0.0).tolist() for key, values in parts.items()},
    }


# ---- GLB ------------------------------------------------------------------------------------


def _write_glb(path: Path, surface: SceneSurface) -> None:
    placed, meshes = _without_shear(surface)
    names = ["" for _ in meshes]
    for each in reversed(placed):
        names[each.mesh] = each.original
    content, length = _glb_content(placed, meshes, names)
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + length
    if size > _MOST_GLB_BYTES:
        raise UserError(
            f"mesh.formats: a GLB can hold at most {units.size(_MOST_GLB_BYTES)}, and "
            f"the scene needs {units.size(size)}; write ply only, or lower the scene's detail"
        )
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, size))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", length, b"BIN\0"))
        for mesh in meshes:
            file.write(mesh.vertices.astype("<f4").tobytes())
            file.write(mesh.triangles.astype("<u4").tobytes())


def _without_shear(surface: SceneSurface) -> tuple[list[Placed], list[Mesh]]:
    """Return placed meshes whose matrices glTF allows: a rotation, a scale and a translation.

    A mesh that its matrix shears becomes a mesh of its own in the world.
    """
    meshes = list(surface.meshes)
    placed = []
    for each in surface.placed:
        if _is_sheared(each.world_from_object):
            world = to_world(meshes[each.mesh], each.world_from_object).astype(np.float32)
            is_mirrored = np.linalg.det(each.world_from_object[:3, :3]) < 0
            triangles = meshes[each.mesh].triangles
            meshes.append(Mesh(world, triangles[:, ::-1] if is_mirrored else triangles))
            each = replace(each, mesh=len(meshes) - 1, world_from_object=np.eye(4))
        placed.append(each)
    used = sorted({each.mesh for each in placed})
    index_of = {old: new for new, old in enumerate(used)}
    return (
        [replace(each, mesh=index_of[each.mesh]) for each in placed],
        [meshes[index] for index in used],
    )


def _is_sheared(world_from_object: Floats) -> bool:
    """Return whether a matrix (4, 4) shears or flattens, so that it is no rotation and scale."""
    lengths = np.linalg.norm(world_from_object[:3, :3], axis=0)
    if (lengths == 0).any():
        return True
    axes = world_from_object[:3, :3] / lengths
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() > _PERPENDICULAR)


def _glb_content(
    placed: Sequence[Placed], meshes: Sequence[Mesh], names: Sequence[str]
) -> tuple[dict[str, Any], int]:
    """Return the JSON of a GLB, and the length of its binary part in bytes."""
    views = []
    accessors: list[dict[str, Any]] = []
    entries = []
    length = 0
    for mesh, name in zip(meshes, names, strict=True):
        for values, target in (
            (mesh.vertices, _ARRAY_BUFFER),
            (mesh.triangles, _ELEMENT_ARRAY_BUFFER),
        ):
            size = 4 * values.size
            views.append({"buffer": 0, "byteOffset": length, "byteLength": size, "target": target})
            length += size
        first = len(accessors)
        accessors += [_positions(mesh.vertices, first), _indices(mesh.triangles, first + 1)]
        primitive = {"attributes": {"POSITION": first}, "indices": first + 1}
        entries.append({"name": name, "primitives": [primitive]})
    nodes: list[dict[str, Any]] = [
        {
            "name": "world",
            "rotation": _Z_UP_TO_Y_UP,
            "children": list(range(1, len(placed) + 1)),
        }
    ]
    for each in placed:
        # glTF's matrices go column by column.
        nodes.append(
            {
                "name": each.name,
                "mesh": each.mesh,
                "matrix": each.world_from_object.T.ravel().tolist(),
            }
        )
    content = {
        "asset": {"version": "2.0", "generator": "Plenoforge"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": entries,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": length}],
    }
    return content, length


def _positions(vertices: NDArray[np.float32], view: int) -> dict[str, Any]:
    return {
        "bufferView": view,
        "componentType": _FLOAT,
        "count": len(vertices),
        "type": "VEC3",
        "min": vertices.min(axis=0).tolist(),
        "max": vertices.max(axis=0).tolist(),
    }


def _indices(triangles: NDArray[np.int32], view: int) -> dict[str, Any]:
    return {
        "bufferView": view,
        "componentType": _UNSIGNED_INT,
        "count": triangles.size,
        "type": "SCALAR",
    }


# ---- PLY ------------------------------------------------------------------------------------


def _write_ply(path: Path, surface: SceneSurface) -> None:
    """Write all triangles in the world. Instances are written one by one."""
    vertex_counts = [len(surface.meshes[placed.mesh].vertices) for placed in surface.placed]
    face_count = sum(len(surface.meshes[placed.mesh].triangles) for placed in surface.placed)
    if sum(vertex_counts) > _MOST_PLY_VERTICES:
        raise UserError(
            f"mesh.formats: a PLY can hold at most {_MOST_PLY_VERTICES:,} vertices, and the scene "
            f"with all instances has {sum(vertex_counts):,}; write glb only, where "
            "instances share a mesh"
        )
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        "comment metres, Z up; object is an index in objects.json\n"
        f"element vertex {sum(vertex_counts)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {face_count}\n"
        "property list uchar int vertex_indices\nproperty int object\nend_header\n"
    )
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(header.encode())
        for _, vertices, _ in surface.in_world():
            file.write(vertices.astype("<f4").tobytes())
        first = 0
        for number, (_, vertices, triangles) in enumerate(surface.in_world()):
            faces = np.empty(
                len(triangles), [("count", "u1"), ("corners", "<i4", 3), ("object", "<i4")]
            )
            faces["count"] = 3
            faces["corners"] = triangles + first
            faces["object"] = number
            file.write(faces.tobytes())
            first += len(vertices)
