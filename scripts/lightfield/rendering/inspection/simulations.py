"""Finds unbaked simulations. Blender does not run them up to the rendered frame."""

from collections.abc import Iterator, Sequence
from typing import Any

import bpy

from lightfield.rendering.inspection.point_caches import point_caches
from lightfield.rendering.scenes import animation, frames
from lightfield.rendering.scenes.render_graph import in_render


def unbaked_fluids() -> list[str]:
    """Return the names of the rendered objects with an unbaked fluid.

    Blender as a Python module has no working fluid solver: it aborts when it evaluates a fluid.
    """
    return sorted(
        str(obj.name_full)
        for obj in bpy.context.view_layer.objects
        for modifier in obj.modifiers
        if modifier.type == "FLUID"
        and modifier.fluid_type == "DOMAIN"
        and modifier.show_render
        and (not obj.hide_render or animation.is_animated(obj))
        and not _is_fluid_baked(modifier.domain_settings)
    )


def _is_fluid_baked(settings: Any) -> bool:
    if settings.domain_type == "LIQUID" and settings.use_mesh:
        return bool(settings.has_cache_baked_mesh)
    return bool(settings.has_cache_baked_data)


def warnings(rendered_frames: Sequence[float]) -> Iterator[str]:
    """Yield a line if rendered objects of the open scene have unbaked simulations.

    Blender goes to each of the ``rendered_frames`` directly. A simulation has no past there: its
    object stays in place, or falls in one step. A simulation's first frame is right.
    """
    last = max(rendered_frames)
    unbaked = {str(obj.name_full): kind for obj, kind, first in _unbaked(last) if last > first}
    if not unbaked:
        return
    frames.go_to(last)
    shown = sorted(in_render(_rendered_objects) & unbaked.keys())
    if not shown:
        return
    names = ", ".join(f"{name} ({unbaked[name]})" for name in shown[:8])
    yield (
        f"simulations are not baked: {names}{' …' if len(shown) > 8 else ''}: Blender does not run "
        f"them up to frame {last}, so shapes and places may be wrong; bake them in Blender and "
        "save the .blend"
    )


def _unbaked(frame: float) -> Iterator[tuple[Any, str, int]]:
    """Yield each object with an unbaked simulation, the simulation's kind, and its first frame."""
    world = bpy.context.scene.rigidbody_world
    if world and world.enabled and world.collection and not world.point_cache.is_baked:
        for obj in world.collection.objects:
            if obj.rigid_body and _is_moved(obj):
                yield obj, "rigid body", world.point_cache.frame_start
    for obj in bpy.data.objects:
        for modifier in obj.modifiers:
            if not modifier.show_render:
                continue
            for kind, cache in point_caches(modifier):
                if not cache.is_baked:
                    yield obj, kind, cache.frame_start
            if modifier.type == "NODES":
                first = _first_simulated_frame(modifier)
                if first is not None and _depends_on_history(obj, first, frame):
                    yield obj, "simulation nodes", first


def _is_moved(obj: Any) -> bool:
    """Return whether the rigid-body simulation moves an object at some frame."""
    body = obj.rigid_body
    return body.type == "ACTIVE" and (not body.kinematic or animation.is_animated(obj))


def _first_simulated_frame(modifier: Any) -> int | None:
    """Return the first frame of the simulation zones of geometry nodes, None without any."""
    zones = [bake for bake in modifier.bakes if _is_simulation(bake.node)]
    firsts = [
        bake.frame_start
        if bake.use_custom_simulation_frame_range
        else bpy.context.scene.frame_start
        for bake in zones
    ]
    return min(firsts, default=None)


def _is_simulation(node: Any) -> bool:
    return node is not None and node.bl_idname == "GeometryNodeSimulationOutput"


def _depends_on_history(obj: Any, first: int, frame: float) -> bool:
    """Return whether an object's extent at a frame depends on the frames before.

    Blender does not tell whether geometry nodes are baked. Baked nodes have one result per frame.
    """
    extents = []
    for history in ((first, frame), (first, frame - 1, frame)):
        for step in history:
            frames.go_to(step)
        extents.append(in_render(lambda depsgraph: _extents(depsgraph, obj.name_full)))
    return extents[0] != extents[1]


def _extents(depsgraph: Any, name: str) -> list[Any]:
    """Return the matrix and the bounding box of all that an object shows."""
    return [
        (tuple(map(tuple, entry.matrix_world)), tuple(map(tuple, entry.object.bound_box)))
        for entry in depsgraph.object_instances
        if (entry.parent or entry.object).original.name_full == name
    ]


def _rendered_objects(depsgraph: Any) -> set[str]:
    """Return the full names of the objects that a render shows, and of all that place them."""
    return {
        str(obj.original.name_full)
        for entry in depsgraph.object_instances
        for obj in (entry.object, entry.parent)
        if obj and not obj.hide_render
    }
