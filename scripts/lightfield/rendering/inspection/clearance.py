"""Measures how near each camera is to geometry, and which objects enclose it.

The functions find geometry in the viewport. `viewport.show_what_is_rendered` makes it show all that
is rendered.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.geometry import framing
from lightfield.geometry.rigs.random import Random
from lightfield.geometry.rigs.sphere import icosphere

Floats = NDArray[np.float64]

# Geometry farther than this from a camera is ignored, in metres.
REACH = 0.5
# Geometry nearer than this touches the camera.
TOUCHING = 0.001
# Each camera of a random rig tries at most this many places.
_TRIES = 100
# This many samples in the rig's box find the objects that enclose most of it.
_SAMPLES = 64
# Subdivisions of an icosphere: its 162 vertices are directions in which a scene ends.
_DIRECTIONS = 3
# The number of rays from a camera that find the object around it.
_RAYS = len(icosphere(1))
# Types of objects that views show without depth, and types that views do not show.
_WITHOUT_DEPTH = {"GREASEPENCIL", "VOLUME"}
# Types of objects beside meshes that have a surface or a volume.
_OTHER_SOLIDS = {"CURVE", "CURVES", "FONT", "META", "POINTCLOUD", "SURFACE", "VOLUME"}
_SHOW_NOTHING = {"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT_PROBE", "SPEAKER"}


class Surroundings(NamedTuple):
    """The surroundings of cameras.

    - ``distances`` (n,): of each camera to the nearest surface in metres, inf beyond the reach.
    - ``box`` (2, 3): around all rendered meshes.
    """

    distances: Floats
    box: Floats


def surroundings(positions: Floats, reach: float = REACH) -> Surroundings:
    """Measure the surroundings of each camera, as far as ``reach``."""
    nearest = np.full(len(positions), np.inf)
    lowest = np.full(3, np.inf)
    highest = np.full(3, -np.inf)
    for mesh, world_from_object, low, high in instances():
        lowest = np.minimum(lowest, low)
        highest = np.maximum(highest, high)
        # Only cameras within reach of the instance's bounding box can be near its surface.
        outside = np.maximum(np.maximum(low - positions, positions - high), 0)
        near = np.flatnonzero(np.linalg.norm(outside, axis=1) < np.minimum(nearest, reach))
        if not len(near) or not len(mesh.polygons):
            continue
        tree = BVHTree.FromPolygons(
            [world_from_object @ vertex.co for vertex in mesh.vertices],
            [tuple(polygon.vertices) for polygon in mesh.polygons],
        )
        for index in near:
            distance = tree.find_nearest(Vector(positions[index]), reach)[3]
            if distance is not None:
                nearest[index] = min(nearest[index], distance)
    return Surroundings(nearest, np.array([lowest, highest]))


def instances() -> Iterator[tuple[Any, Any, Floats, Floats]]:
    """Yield every rendered mesh: mesh, world matrix, and corners of its world bounding box."""
    for obj, world_from_object in _rendered():
        if obj.type == "MESH":
            yield obj.data, world_from_object, *_box(world_from_object, obj.bound_box)


def _rendered(depsgraph: Any = None) -> Iterator[tuple[Any, Any]]:
    """Yield every rendered object and instance, and its world matrix.

    Without a ``depsgraph``, the viewport's counts.
    """
    for instance in (depsgraph or bpy.context.evaluated_depsgraph_get()).object_instances:
        obj = instance.object
        # Particles may show copies of an object that is hidden itself.
        if instance.show_self and (instance.is_instance or not obj.hide_render):
            yield obj, instance.matrix_world.copy()


def _box(world_from_object: Any, corners: Iterable[Any]) -> Floats:
    """Return the box (2, 3) in the world around an object's own ``corners``."""
    places = np.array([world_from_object @ Vector(corner) for corner in corners])
    return np.array([places.min(axis=0), places.max(axis=0)])


def surface_box(depsgraph: Any = None) -> Floats | None:
    """Return the box (2, 3) around all that has a surface or a volume. None without any.

    Shadow catchers do not count: they are floors for shadows. Without a ``depsgraph``, what the
    viewport shows counts. Coordinates may be NaN.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for obj, world_from_object in _rendered(depsgraph):
        is_mesh = obj.type == "MESH"
        if not (is_mesh and obj.data.polygons) and obj.type not in _OTHER_SOLIDS:
            continue
        box = _box(world_from_object, obj.bound_box)
        if obj.is_shadow_catcher or ((box >= low) & (box <= high)).all():
            continue
        # The bounding box of a turned object is larger than the object.
        if is_mesh:
            matrix = np.array(world_from_object)
            points = _corners(obj.data) @ matrix[:3, :3].T + matrix[:3, 3]
            box = np.array([points.min(axis=0), points.max(axis=0)])
        low, high = np.minimum(low, box[0]), np.maximum(high, box[1])
    return None if np.isinf(low).all() else np.array([low, high])


def _corners(mesh: Any) -> NDArray[np.float32]:
    """Return the vertices (n, 3) of a mesh that are corners of faces."""
    coordinates = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", coordinates)
    numbers = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", numbers)
    is_corner = np.zeros(len(mesh.vertices), np.bool_)
    is_corner[numbers] = True
    return coordinates.reshape(-1, 3)[is_corner]


def outermost_points() -> Floats:
    """Return points (n, 3) of the open scene's meshes, without shadow catchers.

    Each is the farthest in a direction, in metres. So about all of the scene is between them.
    """
    directions = icosphere(_DIRECTIONS)
    farthest = np.full(len(directions), -np.inf)
    points = np.zeros(directions.shape)
    for obj, world_from_object in _rendered():
        if obj.type != "MESH" or obj.is_shadow_catcher or not obj.data.polygons:
            continue
        matrix = np.array(world_from_object)
        corners = np.array(obj.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
        is_farther = (corners @ directions.T).max(axis=0) > farthest
        if not is_farther.any():
            continue
        places = _corners(obj.data) @ matrix[:3, :3].T + matrix[:3, 3]
        for index in np.flatnonzero(is_farther):
            along = places @ directions[index]
            nearest = int(along.argmax())
            if along[nearest] > farthest[index]:
                farthest[index], points[index] = along[nearest], places[nearest]
    outermost: Floats = np.unique(points[np.isfinite(farthest)], axis=0)
    return outermost


class Contents(NamedTuple):
    """What views may show.

    - ``box`` (2, 3): around all that has depth. None without any.
    - ``without_depth``: boxes (2, 3) around lamps, drawings and volumes, by name.
    """

    box: Floats | None
    without_depth: dict[str, Floats]


def contents() -> Contents:
    """Return what the views of the open scene may show, wherever their cameras are."""
    boxes = []
    without_depth = {}
    for obj, world_from_object in _rendered():
        if obj.type == "LIGHT":
            # A sun is at no place, and a lamp without a size is too small to be seen.
            if obj.visible_camera and (size := _lamp_size(obj.data)):
                corners = list(itertools.product((-size, size), repeat=3))
                without_depth[str(obj.name_full)] = _box(world_from_object, corners)
        elif obj.type in _WITHOUT_DEPTH:
            without_depth[str(obj.name_full)] = _box(world_from_object, obj.bound_box)
        elif obj.type not in _SHOW_NOTHING:
            boxes.append(_box(world_from_object, obj.bound_box))
    if not boxes:
        return Contents(None, without_depth)
    low, high = np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]
    return Contents(np.array([low, high]), without_depth)


def _lamp_size(lamp: Any) -> float:
    """Return a size that a lamp's surface does not exceed, in each direction from its middle."""
    if lamp.type == "AREA":
        return float(max(lamp.size, lamp.size_y))
    return 0.0 if lamp.type == "SUN" else float(lamp.shadow_soft_size)


class Enclosure(NamedTuple):
    """An object around a camera: the camera sees the backs of its faces.

    ``share`` is the part of all directions in which the camera sees such a back first. An open mesh
    may be a room without a wall, a dome, a backdrop, or an obstacle.
    """

    name: str
    share: float
    is_open: bool


def enclosing_objects(enclosures: Sequence[Enclosure | None]) -> Sequence[str | None]:
    """Return for each camera the name of the closed object that encloses it, or None.

    An object that encloses the whole rig is a room, not an obstacle.
    """
    names = _objects_around(enclosures)
    rooms = {name for name in names if name and names.count(name) == len(names)}
    rooms.update(enclosure.name for enclosure in enclosures if enclosure and enclosure.is_open)
    return [None if name in rooms else name for name in names]


def are_inside(enclosing: Sequence[str | None], distances: Floats) -> NDArray[np.bool_]:
    """Return which cameras are inside geometry: an object encloses them, or a surface touches them.

    ``enclosing`` comes from `enclosing_objects`, and ``distances`` (n,) from `surroundings`.
    """
    are_enclosed = np.array([name is not None for name in enclosing], np.bool_)
    return np.asarray(are_enclosed | (distances < TOUCHING))


def open_mesh_warnings(enclosures: Sequence[Enclosure | None]) -> Iterator[str]:
    """Yield a line if cameras are inside open meshes."""
    meshes = [enclosure.name for enclosure in enclosures if enclosure and enclosure.is_open]
    if not meshes:
        return
    names = sorted(set(meshes))
    yield (
        f"{len(meshes)} of {len(enclosures)} cameras are inside an open mesh: "
        f"{', '.join(names[:8])}{' …' if len(names) > 8 else ''}: they see the backs of its faces, "
        "which may be a room or an obstacle; if it is a room, turn its normals inwards, and if "
        "not, move the rig"
    )


def dark_room_warnings(
    enclosures: Sequence[Enclosure | None], emitters: Callable[[], Sequence[str]]
) -> Iterator[str]:
    """Yield a line if one closed object is around all cameras, and no light is in its box.

    ``emitters`` returns the full names of all objects that may emit light.
    """
    names = {enclosure.name if enclosure else None for enclosure in enclosures}
    if len(names) > 1 or any(each is None or each.is_open for each in enclosures):
        return
    (name,) = names
    sources = {*emitters()}
    boxes: dict[str, list[Floats]] = {}
    for obj, world_from_object in _rendered():
        full_name = str(obj.name_full)
        # A sun is at no place. Other lamps are at a point, and have no box.
        if full_name == name or (full_name in sources and not _is_sun(obj)):
            is_lamp = obj.type == "LIGHT"
            corners = [(0, 0, 0)] if is_lamp else obj.bound_box
            boxes.setdefault(full_name, []).append(_box(world_from_object, corners))
    room = np.array(boxes[str(name)])
    low, high = room[:, 0].min(axis=0), room[:, 1].max(axis=0)
    lit_boxes = [box for each in sources & boxes.keys() for box in boxes[each]]
    if any(((box[0] <= high) & (box[1] >= low)).all() for box in lit_boxes):
        return
    count = len(enclosures)
    yield (
        f"{count} of {count} cameras are inside {name}, a closed object that "
        f"{framing.reach(np.array([low, high]))}: no lamp and no glowing surface is in it, so all "
        "views may be black; move the rig or change its size, or put a lamp inside"
    )


def _is_sun(obj: Any) -> bool:
    return bool(obj.type == "LIGHT" and obj.data.type == "SUN")


def _objects_around(enclosures: Sequence[Enclosure | None]) -> list[str | None]:
    """Return for each camera the name of the object whose back most of its rays meet, or None."""
    return [
        enclosure.name if enclosure and enclosure.share > 1 / 2 else None
        for enclosure in enclosures
    ]


def free_places(rig: Random) -> Floats:
    """Return each camera's first free place (n, 3) in the rig's unit box.

    An object that encloses most of the box is a room, not an obstacle. Raises `UserError` if a
    camera finds no free place.
    """
    box = rig.to_world(np.random.default_rng(rig.seed).random((_SAMPLES, 3)) - 0.5)
    around = Counter(_objects_around(enclosures(box)))
    rooms = {name for name, count in around.items() if count > _SAMPLES / 2}
    places = np.full((rig.count, 3), np.nan)
    progress = Progress(rig.count, "places", "cameras")
    for number in range(_TRIES):
        unplaced = np.flatnonzero(np.isnan(places[:, 0]))
        candidates = np.array([rig.candidate(int(view), number) for view in unplaced])
        world = rig.to_world(candidates)
        free = surroundings(world, rig.clearance).distances >= rig.clearance
        inside = [name not in {None, *rooms} for name in _objects_around(enclosures(world))]
        free &= ~np.array(inside)
        places[unplaced[free]] = candidates[free]
        progress.done(int(free.sum()))
        if free.all():
            return places
    raise UserError(
        f"{(~free).sum()} of {rig.count} cameras found no place with {rig.clearance:g} m of free "
        f"space in {_TRIES} tries; make clearance smaller, or size larger, in the scene YAML"
    )


def enclosures(positions: Floats, box: Floats | None = None) -> list[Enclosure | None]:
    """Return the object, or room, around each camera, or None.

    ``box`` comes from `surroundings`. Cameras outside the box need no rays.

    An object encloses a camera if most rays from the camera meet the object's back first. For an
    open mesh a third of the rays suffices, if few others meet its fronts: leaves show both. The
    camera must then lie in the mesh's bounding box, which is flat for a plane. Some ray must miss
    the mesh.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    around_each: list[Enclosure | None] = []
    for position in positions:
        # From outside, at most half the rays can meet the box. So nothing is around the camera.
        if box is not None and not np.all((position >= box[0]) & (position <= box[1])):
            around_each.append(None)
            continue
        hits = _first_hits(position, depsgraph)
        backs = Counter(str(hit.obj.name_full) for hit in hits if hit.is_back)
        name, count = backs.most_common(1)[0] if backs else ("", 0)
        of_object = [hit for hit in hits if hit.obj.name_full == name]
        share = count / _RAYS
        sees_backs = share >= 1 / 3 and count >= 0.75 * len(of_object)
        is_open = sees_backs and _is_within_open(position, of_object[0], depsgraph)
        is_inside = is_open or share > 1 / 2
        around_each.append(Enclosure(name, share, is_open) if is_inside else None)
    return around_each


class _Hit(NamedTuple):
    """The first hit of a ray: an object, or an instance of it, with its world matrix."""

    obj: Any
    world_from_object: Any
    is_back: bool


def _first_hits(position: Floats, depsgraph: Any) -> list[_Hit]:
    """Return the first hits of `_RAYS` rays from a camera in all directions."""
    hits = []
    for vertex in icosphere(1):
        direction = Vector(vertex).normalized()
        hit, _, normal, _, obj, world_from_object = bpy.context.scene.ray_cast(
            depsgraph, Vector(position), direction
        )
        if hit:
            hits.append(_Hit(obj, world_from_object, normal.dot(direction) > 0))
    return hits


def _is_within_open(position: Floats, hit: _Hit, depsgraph: Any) -> bool:
    """Return whether a camera is in an object's bounding box, and some ray does not meet it."""
    obj = hit.obj.evaluated_get(depsgraph)
    inverse = hit.world_from_object.inverted_safe()
    local = inverse @ Vector(position)
    corners = np.array(obj.bound_box)
    if not np.all(np.abs(np.array(local) - corners.mean(axis=0)) < np.ptp(corners, axis=0) / 2):
        return False
    directions = (inverse.to_3x3() @ Vector(vertex) for vertex in icosphere(2))
    return any(not obj.ray_cast(local, direction)[0] for direction in directions)
