"""Find the cameras of a dataset that stand inside geometry, before any of them is rendered."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.dataset.lightfield import LightField
from lightfield.geometry.rigs.sphere import icosphere
from lightfield.rendering import blender

# Geometry farther than this from a camera, in metres, is not looked for.
REACH = 0.5
# Nearer than this it counts as touching.
TOUCHING = 0.001


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    names = [view.name for view in lightfield.views]
    positions = np.array([view.position for view in lightfield.views])
    blender.open_scene(arguments.blend)
    bpy.context.scene.frame_set(lightfield.frame)
    distances = clearances(positions)
    inside = enclosing_objects(positions)
    views = {
        name: {
            "distance": None if np.isinf(distance) else round(float(distance), 6),
            "inside": enclosing is not None or bool(distance < TOUCHING),
        }
        for name, distance, enclosing in zip(names, distances, inside, strict=True)
    }
    bad = [name for name in names if views[name]["inside"]]
    if bad:
        where = sorted({enclosing for enclosing in inside if enclosing}) or ["a surface"]
        raise UserError(
            f"{arguments.lightfield}: {len(bad)} of {len(names)} cameras are inside "
            f"{', '.join(where)}: {', '.join(bad[:8])}{' …' if len(bad) > 8 else ''}; "
            "move the rig or make it smaller (center and size in the scene YAML)"
        )
    write_json(arguments.output, {"views": views})
    nearest = min(distances)
    told = f"{nearest:.3f} m" if nearest < REACH else f"more than {REACH} m"
    print(f"{len(names)} cameras, none inside geometry; the nearest surface is {told} away")


def clearances(positions: np.ndarray) -> np.ndarray:
    """Return each camera's distance in metres to the nearest surface, inf beyond `REACH`."""
    nearest = np.full(len(positions), np.inf)
    for mesh, matrix, low, high in instances():
        # Only cameras within reach of the instance's bounding box can be near its surface.
        outside = np.maximum(np.maximum(low - positions, positions - high), 0)
        near = np.flatnonzero(np.linalg.norm(outside, axis=1) < np.minimum(nearest, REACH))
        if not len(near) or not len(mesh.polygons):
            continue
        tree = BVHTree.FromPolygons(
            [matrix @ vertex.co for vertex in mesh.vertices],
            [tuple(polygon.vertices) for polygon in mesh.polygons],
        )
        for index in near:
            distance = tree.find_nearest(Vector(positions[index]), REACH)[3]
            if distance is not None:
                nearest[index] = min(nearest[index], distance)
    return nearest


def instances() -> Iterator[tuple[Any, Any, np.ndarray, np.ndarray]]:
    """Yield every rendered mesh: mesh, world matrix, and corners of its world bounding box."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for instance in depsgraph.object_instances:
        thing = instance.object
        if not instance.show_self or thing.type != "MESH" or thing.hide_render:
            continue
        matrix = instance.matrix_world.copy()
        corners = np.array([matrix @ Vector(corner) for corner in thing.bound_box])
        yield thing.data, matrix, corners.min(axis=0), corners.max(axis=0)


def enclosing_objects(positions: np.ndarray) -> Sequence[str | None]:
    """Return for each camera the name of the object that it is inside of, or None.

    A camera is inside an object if most rays from it first meet that object's back. What has the
    whole rig inside it is a room, not an obstacle.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    directions = [Vector(vertex).normalized() for vertex in icosphere(1)]
    found: list[str | None] = []
    for position in positions:
        backs: Counter[str] = Counter()
        for direction in directions:
            hit, _, normal, _, thing, _ = bpy.context.scene.ray_cast(
                depsgraph, Vector(position), direction
            )
            if hit and normal.dot(direction) > 0:
                backs[thing.name] += 1
        name, count = backs.most_common(1)[0] if backs else ("", 0)
        found.append(name if count > len(directions) / 2 else None)
    rooms = {name for name in found if name and found.count(name) == len(found)}
    return [None if name in rooms else name for name in found]


if __name__ == "__main__":
    run(main)
