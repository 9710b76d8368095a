"""Volumes such as fog and smoke: which objects of a scene have no surface."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import bpy

from lightfield.rendering.render_graph import in_render


@cache
def alone() -> frozenset[str]:
    """Return the full names of the open scene's objects that are only volumes at its frame."""
    by_nodes = [t for t in bpy.data.objects if any(m.type == "NODES" for m in t.modifiers)]

    def made(depsgraph: Any) -> dict[Any, bool]:
        evaluated = {thing: thing.evaluated_get(depsgraph) for thing in by_nodes}
        return {
            thing: all(map(_is_volume, _parts(now.evaluated_geometry())))
            for thing, now in evaluated.items()
            if now.is_evaluated
        }

    is_volume = {thing: _is_volume(thing) for thing in bpy.data.objects}
    if by_nodes:
        is_volume |= in_render(made)
    return frozenset(str(thing.name_full) for thing in is_volume if is_volume[thing])


def _parts(geometry: Any) -> Iterator[Any]:
    """Yield the parts that nodes made, such as meshes, and the objects that they place."""
    # Replacing a mesh leaves an empty one behind.
    if geometry.mesh and geometry.mesh.polygons:
        yield geometry.mesh
    others = (geometry.curves, geometry.pointcloud, geometry.grease_pencil, geometry.volume)
    yield from filter(None, others)
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
    return output is not None and output.inputs[name].is_linked
