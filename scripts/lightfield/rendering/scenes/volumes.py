"""Finds the objects of a scene that are only volumes, such as fog and smoke."""

from collections.abc import Iterator
from typing import Any

import bpy

from lightfield.rendering.scenes.render_graph import in_render


def alone() -> frozenset[str]:
    """Return the full names of the open scene's objects that are only volumes at its frame."""
    objects = bpy.data.objects
    with_nodes = [obj for obj in objects if any(m.type == "NODES" for m in obj.modifiers)]

    def evaluated_volumes(depsgraph: Any) -> dict[Any, bool]:
        are_volumes = {}
        for obj in with_nodes:
            evaluated = obj.evaluated_get(depsgraph)
            if evaluated.is_evaluated:
                parts = _parts(evaluated.evaluated_geometry())
                are_volumes[obj] = all(_is_volume(part) for part in parts)
        return are_volumes

    is_volume = {obj: _is_volume(obj) for obj in objects}
    if with_nodes:
        is_volume |= in_render(evaluated_volumes)
    return frozenset(str(obj.name_full) for obj in is_volume if is_volume[obj])


def _parts(geometry: Any) -> Iterator[Any]:
    """Yield the parts that nodes made, such as meshes, and the objects that they place."""
    # Replacing a mesh leaves an empty one behind.
    if geometry.mesh and geometry.mesh.polygons:
        yield geometry.mesh
    for part in (geometry.curves, geometry.pointcloud, geometry.grease_pencil, geometry.volume):
        if part:
            yield part
    for placed in geometry.instance_references():
        yield from _parts(placed) if isinstance(placed, bpy.types.GeometrySet) else (placed,)


def _is_volume(part: Any) -> bool:
    if isinstance(part, bpy.types.Volume) or getattr(part, "type", None) == "VOLUME":
        return True
    slots = getattr(part, "material_slots", [])
    materials = [slot.material for slot in slots] or getattr(part, "materials", [])
    used = [material for material in materials if material]
    return bool(used) and all(has_volume(m) and not has_surface(m) for m in used)


def has_volume(shader: Any) -> bool:
    """Return whether a material or world has a volume shader."""
    return _is_linked(shader, "Volume")


def has_surface(shader: Any) -> bool:
    """Return whether the material has a surface shader. Worlds always count as having one."""
    return _is_linked(shader, "Surface") or isinstance(shader, bpy.types.World)


def _is_linked(shader: Any, name: str) -> bool:
    output = shader.node_tree.get_output_node("CYCLES") if shader.node_tree else None
    return output is not None and any(not link.is_muted for link in output.inputs[name].links)
