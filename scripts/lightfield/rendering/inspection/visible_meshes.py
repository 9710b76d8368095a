"""Reads the surface that cameras can see from the open scene, as a render has it.

A camera sees an object that a render evaluates if it and its instancer meet camera rays. Neither a
collection nor the object may make it a holdout, or leave it to indirect light. Modifiers have their
render settings. Source: sync_object in intern/cycles/blender/object.cpp.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.formats.inventory import read_inventory
from lightfield.geometry.mesh import Mesh, Placed, SceneSurface
from lightfield.rendering.scenes import blend_file, frames, ids, instances, volumes
from lightfield.rendering.scenes.ids import Numbers, has_no_surface
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.setup import pruning
from lightfield.stages.exports import WriteSurface

# Why an object of a type has no mesh.
_REASONS = {
    "VOLUME": "is a volume",
    "CURVES": "is hair or curves, which Cycles draws without a mesh",
    "POINTCLOUD": "is a point cloud, which Cycles draws without a mesh",
    "GREASEPENCIL": "is a Grease Pencil drawing",
}
# Blender shows the mesh of such an object as another entry.
_WITH_A_MESH_BESIDE = ("CURVE", "FONT", "META", "SURFACE")
_HAIR = "has hair, which Cycles draws without a mesh"
_ONLY_VOLUME = "has materials that are only volumes"


def surface_of(job: WriteSurface) -> tuple[SceneSurface, int]:
    """Open the .blend of a job. Return the surface that cameras can see, and its frame."""
    settings = job.settings
    path = job.inventory
    inventory = read_inventory(path, "left_out", "hidden") if path else None
    blend_file.open_scene(job.blend, settings.as_json(), inventory)
    if settings.numbered:
        # The numbers follow from the objects that a render keeps.
        hidden = inventory["hidden"] if inventory else pruning.removable_objects()
        pruning.remove_objects(hidden)
    if isinstance(settings.frame, int):
        frames.go_to(settings.frame)
    numbers = ids.assign(["object"])["object"] if settings.numbered else None
    return visible_surface(numbers), bpy.context.scene.frame_current


def visible_surface(numbers: Numbers | None) -> SceneSurface:
    """Return what cameras can see of the open scene at its frame.

    ``numbers`` are the objects' numbers in the id passes, from `ids.assign`. None for none.
    """
    return in_render(lambda depsgraph: _MeshReader(numbers).read(depsgraph))


class _MeshReader:
    """Collects the meshes of a dependency graph."""

    def __init__(self, numbers: Numbers | None) -> None:
        self.numbers = numbers
        self.meshes: list[Mesh] = []
        self.placed: list[Placed] = []
        self.left_out: dict[str, str] = {}
        # Blender shows a text or a curve as an instance of itself. Nodes may make many of these.
        self.parts_of_itself: dict[str, list[int]] = {}
        # The index of each mesh that was read, None if cameras see nothing of it.
        self.index_of: dict[tuple[Any, tuple[bool, ...]], int | None] = {}

    def read(self, depsgraph: Any) -> SceneSurface:
        for entry in depsgraph.object_instances:
            obj = entry.object
            if has_no_surface(obj) or not _is_visible(entry):
                continue
            if entry.show_particles and _has_hair(obj):
                self.left_out[str(obj.original.name_full)] = _HAIR
            if entry.show_self:
                self._add(entry)
        return self._in_order()

    def _add(self, entry: Any) -> None:
        original = str(entry.object.original.name_full)
        if entry.object.type in _WITH_A_MESH_BESIDE:
            return
        if entry.object.type != "MESH":
            self.left_out[original] = _REASONS.get(entry.object.type, "cannot become a mesh")
            return
        index = self._mesh(entry.object)
        if index is None:
            return
        of_passes = {}
        if self.numbers:
            _, number, object_number = instances.name_and_numbers(entry, self.numbers)
            of_passes = {"object": object_number, "instance": number}
        if entry.is_instance and entry.parent.original == entry.object.original:
            self.parts_of_itself.setdefault(original, []).append(len(self.placed))
        self.placed.append(
            Placed(
                instances.name_of(entry),
                original,
                index,
                np.array(entry.matrix_world, np.float64),
                of_passes,
            )
        )

    def _mesh(self, obj: Any) -> int | None:
        """Return the index of an object's mesh. None if it has no face that cameras see."""
        is_volume = tuple(_is_volume(material) for material in _materials(obj))
        key = (obj.data, is_volume)
        if key not in self.index_of:
            mesh = _triangulated(obj.data, is_volume)
            self.index_of[key] = len(self.meshes) if len(mesh.triangles) else None
            if len(mesh.triangles):
                self.meshes.append(mesh)
        if self.index_of[key] is None and any(is_volume):
            self.left_out[str(obj.original.name_full)] = _ONLY_VOLUME
        return self.index_of[key]

    def _in_order(self) -> SceneSurface:
        """Return the surface with objects in the order of their names, and meshes in theirs."""
        for original, places in self.parts_of_itself.items():
            if len(places) == 1:
                place = places[0]
                self.placed[place] = replace(self.placed[place], name=original)
        placed = sorted(self.placed, key=lambda each: each.name)
        order = list(dict.fromkeys(each.mesh for each in placed))
        new_index = {old: new for new, old in enumerate(order)}
        return SceneSurface(
            [self.meshes[index] for index in order],
            [replace(each, mesh=new_index[each.mesh]) for each in placed],
            dict(sorted(self.left_out.items())),
        )


def _is_visible(entry: Any) -> bool:
    """Return whether camera rays meet an entry of the dependency graph."""
    obj = entry.object
    holder = entry.parent if entry.is_instance else obj
    # A hidden object may still have visible instances.
    if obj.hide_render and not entry.is_instance:
        return False
    if not (obj.visible_camera and holder.visible_camera):
        return False
    layer = bpy.context.view_layer
    owner = holder.original
    return not (owner.holdout_get(view_layer=layer) or owner.indirect_only_get(view_layer=layer))


def _has_hair(obj: Any) -> bool:
    return any(
        modifier.type == "PARTICLE_SYSTEM"
        and modifier.show_render
        and modifier.particle_system.settings.type == "HAIR"
        and modifier.particle_system.settings.render_type == "PATH"
        for modifier in obj.modifiers
    )


def _materials(obj: Any) -> Iterator[Any]:
    """Yield the material of each slot. An object may replace its mesh's materials."""
    slots = obj.material_slots
    for place, material in enumerate(obj.data.materials):
        is_replaced = place < len(slots) and slots[place].link == "OBJECT"
        yield slots[place].material if is_replaced else material


def _is_volume(material: Any) -> bool:
    return bool(material and volumes.has_volume(material) and not volumes.has_surface(material))


def _triangulated(data: Any, is_volume: tuple[bool, ...]) -> Mesh:
    """Return a mesh as triangles, without the faces of materials that are volumes."""
    vertices = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", vertices)
    data.calc_loop_triangles()
    triangles = np.empty(3 * len(data.loop_triangles), np.int32)
    data.loop_triangles.foreach_get("vertices", triangles)
    corners = triangles.reshape(-1, 3)
    if any(is_volume):
        slots = np.empty(len(data.loop_triangles), np.int32)
        data.loop_triangles.foreach_get("material_index", slots)
        corners = corners[~np.array(is_volume)[slots.clip(0, len(is_volume) - 1)]]
    return _without_unused(vertices.reshape(-1, 3), corners)


def _without_unused(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> Mesh:
    """Return a mesh without the vertices that belong to no triangle."""
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    new_index = np.cumsum(used, dtype=np.int32) - 1
    return Mesh(vertices[used], new_index[triangles].reshape(-1, 3))
