"""The surface as meshes: scene.glb and scene.ply, and the objects of objects.json.

Source: glTF 2.0 specification, 4.4; Turk, "The PLY Polygon File Format".
"""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from lightfield.core.files import read_json, reading
from oracles.readers.contents import Exported, Floats, numbers

# A box's edge is within this of the outermost vertex, as a part of the scene's extent.
_PRECISION = 1e-5


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the meshes that an export.json lists. They must have the objects of objects.json."""
    exported = Exported()
    folder = listing.parent
    path = folder / "objects.json"
    with reading(path, "list of objects"):
        objects = [
            (str(entry["name"]), numbers(entry["matrix"], (4, 4)), _corners(entry["box"]))
            for entry in read_json(path)["objects"]
        ]
    matrices = {name: matrix for name, matrix, _ in objects}
    corners = np.array([corners for _, _, corners in objects]).reshape(-1, 3)
    if "glb" in options["formats"]:
        _expect_nodes(exported, folder / "scene.glb", matrices)
    if "ply" in options["formats"]:
        _expect_extent(exported, folder / "scene.ply", corners)
    return exported


def _corners(box: dict[str, Any]) -> Floats:
    """Return the corners (8, 3) of a box in the world."""
    center = numbers(box["center"], (3,))
    half = numbers(box["size"], (3,)) / 2
    rotation = numbers(box["rotation"], (3, 3))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(center + (signs * half) @ rotation.T)


def _expect_nodes(exported: Exported, path: Path, matrices: dict[str, Floats]) -> None:
    """Note a fault if a GLB's nodes are not the objects, each at its place."""
    with reading(path, "GLB"):
        graph = trimesh.load_scene(path, process=False).graph
        root = graph.transforms.children[graph.base_frame]
        z_up = np.linalg.inv(graph.get(root[0])[0]) if len(root) == 1 else np.eye(4)
        places = {name: z_up @ graph.get(name)[0] for name in graph.nodes_geometry}
    for name in sorted(matrices.keys() ^ places.keys()):
        is_there = "has a node" if name in places else "lacks the node"
        exported.faults.append(f"{path}: {is_there} {name}, which is not as objects.json has it")
    for name in sorted(matrices.keys() & places.keys()):
        # The vertices of a sheared object are in the world.
        if not np.array_equal(places[name], np.eye(4)):
            exported.expect(f"{path}: {name}: matrix", places[name], matrices[name])


def _expect_extent(exported: Exported, path: Path, corners: Floats) -> None:
    """Note a fault if a PLY's vertices are not within the objects' boxes."""
    with reading(path, "PLY of triangles"):
        vertices = trimesh.load_mesh(path, process=False).vertices
        if not len(vertices) or not np.isfinite(vertices).all():
            raise ValueError("its vertices are not finite numbers")
    margin = _PRECISION * (1 + np.abs(corners).max())
    low = corners.min(axis=0) - margin
    high = corners.max(axis=0) + margin
    is_within = (low <= vertices.min(axis=0)) & (vertices.max(axis=0) <= high)
    for axis, name in enumerate("xyz"):
        if not is_within[axis]:
            exported.faults.append(f"{path}: {name}: is not within the boxes of objects.json")
