"""How near each camera is to geometry, and which objects it stands inside of."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from lightfield.geometry.rigs.sphere import icosphere

Floats = NDArray[np.float64]

# Geometry farther than this from a camera, in metres, is not looked for.
REACH = 0.5
# Nearer than this it counts as touching.
TOUCHING = 0.001


def clearances(positions: Floats) -> Floats:
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


def instances() -> Iterator[tuple[Any, Any, Floats, Floats]]:
    """Yield every rendered mesh: mesh, world matrix, and corners of its world bounding box."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for instance in depsgraph.object_instances:
        thing = instance.object
        if not instance.show_self or thing.type != "MESH" or thing.hide_render:
            continue
        matrix = instance.matrix_world.copy()
        corners = np.array([matrix @ Vector(corner) for corner in thing.bound_box])
        yield thing.data, matrix, corners.min(axis=0), corners.max(axis=0)


def enclosing_objects(positions: Floats) -> Sequence[str | None]:
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
