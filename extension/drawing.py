"""Draws a rig: each camera as what its lens sees, and the volume that the cameras enclose.

The drawn objects are in world coordinates, cannot be selected, and are hidden in renders.
"""

import json
import time
from contextlib import chdir
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import bmesh
import bpy
import numpy as np
from mathutils.kdtree import KDTree
from numpy.typing import NDArray

from . import rig_objects
from .scripts.lightfield.core.errors import UserError
from .scripts.lightfield.geometry.lenses import Lens
from .scripts.lightfield.geometry.lenses.rectilinear import Rectilinear
from .scripts.lightfield.geometry.rigs import Rig, as_written, from_settings
from .scripts.lightfield.geometry.rotations import euler_to_matrix
from .scripts.lightfield.rendering.inspection import clearance

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Custom properties of drawn objects: the Empty of the rig, what is drawn, and which cameras are
# inside objects.
OF, PART, DRAWN, INSIDE = (
    "plenoforge_of",
    "plenoforge_part",
    "plenoforge_drawn",
    "plenoforge_inside",
)
# Custom property of an Empty: why its rig cannot be drawn.
PROBLEM = "plenoforge_problem"
COLOURS = {
    "cameras": (0.05, 0.35, 0.9, 1.0),
    "inside": (0.9, 0.02, 0.02, 1.0),
    "volume": (0.05, 0.35, 0.9, 0.12),
}
# The length of a drawn camera, as a part of the distance between cameras.
_LENGTH = 0.4
# Points on each side of the image's border, and rings of points within it.
_FINE = (4, 3)
# Rigs with more cameras are drawn with the corners of the image alone.
_COARSE = (1, 1)
_MOST_FINE = 3000
# The spacing is measured at this many cameras.
_MEASURED = 500


class Cameras(NamedTuple):
    """The cameras of a rig: ``world_from_cameras`` (n, 4, 4), and the distances in metres from a
    place to the nearest other one, the smallest and the largest. None with one place."""

    world_from_cameras: Floats
    spacing: tuple[float, float] | None


def cameras(scene: Any, rig: Rig) -> Cameras:
    """Return a rig's cameras. There are none if only a build knows where they are."""
    return cameras_at(json.dumps(as_written(rig)), rig_objects.folder(scene))


@lru_cache(maxsize=32)
def cameras_at(settings: str, folder: Path) -> Cameras:
    """Return the cameras of a rig, from its keys as JSON. Paths start from ``folder``."""
    try:
        with chdir(folder):
            poses = from_settings(json.loads(settings)).poses()
    except UserError:
        return Cameras(np.empty((0, 4, 4)), None)
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    matrices[:, :3, :3] = euler_to_matrix(np.array([pose.rotation for pose in poses]))
    matrices[:, :3, 3] = [pose.position for pose in poses]
    places = np.unique(np.round(matrices[:, :3, 3], 9), axis=0)
    if len(places) < 2:
        return Cameras(matrices, None)
    tree = KDTree(len(places))
    for number, place in enumerate(places):
        tree.insert(place, number)
    tree.balance()
    nearest = [tree.find_n(p, 2)[1][2] for p in places[:: -(-len(places) // _MEASURED)]]
    return Cameras(matrices, (min(nearest), max(nearest)))


def sync(scene: Any) -> None:
    """Draw each rig that has changed, and remove the drawing of each rig that is gone."""
    empties = rig_objects.empties(scene)
    for obj in [obj for obj in scene.objects if OF in obj]:
        if obj[OF] not in empties:
            _remove(obj)
    names: set[str] = set()
    drawn_empties = {obj[OF] for obj in scene.objects if OF in obj}
    # A copy of an Empty is not drawn yet. It gets the new name.
    for empty in sorted(empties, key=lambda empty: empty not in drawn_empties):
        name, settings = rig_objects.kept(empty)
        if name in names:
            name = next(n for i in range(2, 999) if (n := f"{name}_{i}") not in names)
            rig_objects.keep(empty, name, settings)
        names.add(name)
        try:
            rig, settings = rig_objects.rig_of(scene, empty)
        except UserError as error:
            empty[PROBLEM] = str(error)
            continue
        empty.pop(PROBLEM, None)
        parts = _parts(scene, empty)
        drawn = json.dumps(settings, sort_keys=True)
        if parts["cameras"].get(DRAWN) != drawn:
            _draw(parts, rig, cameras(scene, rig), None)
            parts["cameras"][DRAWN] = drawn
            is_fixed = not rig_objects.is_editable(rig)
            empty.lock_location = empty.lock_rotation = [is_fixed] * 3
            empty.lock_scale = [is_fixed or rig_objects.has_fixed_size(rig)] * 3
            if rig_objects.has_fixed_size(rig):
                empty.scale = rig.sides


def check(scene: Any) -> float:
    """Draw cameras that are inside objects in red. Returns the seconds that it took.

    Objects that renders hide do not count, and neither do objects that the viewport hides.
    """
    start = time.monotonic()
    sync(scene)
    rigs = []
    for empty in rig_objects.empties(scene):
        if PROBLEM not in empty:
            rig, _ = rig_objects.rig_of(scene, empty)
            rigs.append((_parts(scene, empty), rig))
    hidden = [obj for obj in scene.objects if obj.hide_render and not obj.hide_viewport]
    for obj in hidden:
        obj.hide_viewport = True
    bpy.context.view_layer.update()
    try:
        inside = [np.flatnonzero(_are_inside(cameras(scene, rig))).tolist() for _, rig in rigs]
    finally:
        for obj in hidden:
            obj.hide_viewport = False
    for (parts, rig), numbers in zip(rigs, inside, strict=True):
        placed = cameras(scene, rig)
        # Nobody knows yet whether cameras without a place are inside objects.
        _draw(parts, rig, placed, numbers if len(placed.world_from_cameras) else None)
    return time.monotonic() - start


def inside(empty: Any) -> int | None:
    """Return how many of a rig's cameras are inside objects. None if it has not been checked."""
    for obj in bpy.data.objects:
        if obj.get(OF) == empty and obj[PART] == "cameras":
            return len(obj[INSIDE]) if INSIDE in obj else None
    return None


def _are_inside(cameras: Cameras) -> Bools:
    """Return which cameras are inside objects, as the workflow finds them."""
    positions = cameras.world_from_cameras[:, :3, 3]
    distances, box = clearance.surroundings(positions)
    enclosing = clearance.enclosing_objects(clearance.enclosures(positions, box))
    return clearance.are_inside(enclosing, distances)


def _parts(scene: Any, empty: Any) -> dict[str, Any]:
    """Return the drawn objects of a rig."""
    parts = {obj[PART]: obj for obj in bpy.data.objects if obj.get(OF) == empty}
    for part in COLOURS.keys() - parts.keys():
        name = f"{empty.name} {part}"
        obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        obj[OF] = empty
        obj[PART] = part
        obj.hide_render = True
        obj.hide_select = True
        obj.color = COLOURS[part]
        obj.show_wire = part == "volume"
        obj.show_in_front = part == "inside"
        obj.data.materials.append(_material(part))
        rig_objects.collection(scene).objects.link(obj)
        parts[part] = obj
    return parts


def _material(part: str) -> Any:
    name = f"Plenoforge {part}"
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    material.diffuse_color = COLOURS[part]
    return material


def _remove(obj: Any) -> None:
    mesh = obj.data
    bpy.data.objects.remove(obj)
    bpy.data.meshes.remove(mesh)


def _draw(parts: dict[str, Any], rig: Rig, placed: Cameras, inside: Any) -> None:
    """Draw a rig's cameras. ``inside`` has the numbers of those in red, or is None."""
    matrices, spacing = placed
    if inside is None:
        parts["cameras"].pop(INSIDE, None)
    else:
        parts["cameras"][INSIDE] = inside
    is_red = np.isin(np.arange(len(matrices)), inside or [])
    length = _LENGTH * (spacing[0] if spacing else max(0.25, rig.sides.max()))
    detail = _FINE if len(matrices) <= _MOST_FINE else _COARSE
    _draw_cameras(parts["cameras"].data, rig.camera.make(), matrices[~is_red], length, detail)
    _draw_cameras(parts["inside"].data, rig.camera.make(), matrices[is_red], length, detail)
    _draw_hull(parts["volume"].data, matrices[:, :3, 3])


def _draw_cameras(
    mesh: Any, lens: Lens, matrices: Floats, length: float, detail: tuple[int, int]
) -> None:
    points, triangles = _shape(lens, *detail)
    world = (length * points) @ matrices[:, :3, :3].swapaxes(1, 2) + matrices[:, None, :3, 3]
    corners = triangles + len(points) * np.arange(len(matrices))[:, None, None]
    mesh.clear_geometry()
    mesh.vertices.add(world.size // 3)
    mesh.vertices.foreach_set("co", world.ravel())
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners.ravel())
    mesh.polygons.add(corners.size // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners.size, 3))
    mesh.update(calc_edges=True)


@lru_cache(maxsize=32)
def _shape(lens: Lens, points_a_side: int, rings: int) -> tuple[Floats, NDArray[np.int64]]:
    """Return what a camera sees up to a distance of 1: points (n, 3) and triangles (m, 3).

    The first point is the camera. The second is in the image's middle, and rings of points follow
    up to the image's border, or to the rim of a fisheye. A perspective camera gets a flat end.
    """
    along = np.arange(points_a_side) / points_a_side
    side = np.stack([along, np.zeros_like(along)], axis=-1)
    turns = [side, side[:, ::-1] * (1, 1) + (1, 0), 1 - side, side[:, ::-1] * (1, -1) + (0, 1)]
    border = np.concatenate(turns) * (lens.width, lens.height)
    middle = np.array([lens.width, lens.height]) / 2
    # Bisect where the lens has rays, from the middle to each point of the border.
    low, high = np.zeros(len(border)), np.ones(len(border))
    has_rays = np.isfinite(lens.rays(*border.T)).all(axis=-1)
    for _ in range(24):
        part = (low + high) / 2
        seen = np.isfinite(lens.rays(*(middle + part[:, None] * (border - middle)).T)).all(axis=-1)
        low, high = np.where(seen, part, low), np.where(seen, high, part)
    reach = np.where(has_rays, 1, low)[:, None] * (border - middle)
    pixels = middle + np.concatenate([k / rings * reach for k in range(1, rings + 1)])
    rays = np.nan_to_num(lens.rays(*np.vstack([middle, pixels]).T))
    if isinstance(lens, Rectilinear):
        rays = rays / -rays[:, 2:]
        rays /= np.linalg.norm(rays, axis=-1).max()
    count = len(border)
    this = np.arange(count)
    following = np.roll(this, -1)
    triangles = [np.stack([np.full(count, 1), 2 + following, 2 + this], axis=-1)]
    for ring in range(rings - 1):
        inner, outer = 2 + ring * count, 2 + (ring + 1) * count
        triangles.append(np.stack([inner + this, inner + following, outer + this], axis=-1))
        triangles.append(np.stack([inner + following, outer + following, outer + this], axis=-1))
    rim = 2 + (rings - 1) * count
    triangles.append(np.stack([np.zeros(count, int), rim + this, rim + following], axis=-1))
    return np.vstack([np.zeros(3), rays]), np.concatenate(triangles)


def _draw_hull(mesh: Any, positions: Floats) -> None:
    """Draw the convex hull of the cameras' places. It is flat if they are in one plane."""
    shape = bmesh.new()
    for place in np.unique(np.round(positions, 9), axis=0):
        shape.verts.new(place)
    if len(shape.verts) > 3:
        bmesh.ops.convex_hull(shape, input=shape.verts, use_existing_faces=False)
        within = [vertex for vertex in shape.verts if not vertex.link_faces]
        bmesh.ops.delete(shape, geom=within, context="VERTS")
    shape.to_mesh(mesh)
    shape.free()
