"""Finds what may change in a .blend from one frame to the next, or within a frame.

Nothing here depends on the frame that the .blend was saved at. Keyframes and drivers may give a
property any value.
"""

import re
from collections.abc import Iterable, Iterator
from typing import Any

import bpy

# Modifiers that do not change with time by themselves. Any other may, such as a simulation.
_STEADY_MODIFIERS = {
    "ARMATURE",
    "ARRAY",
    "BEVEL",
    "BOOLEAN",
    "CAST",
    "COLLISION",
    "CORRECTIVE_SMOOTH",
    "CURVE",
    "DATA_TRANSFER",
    "DECIMATE",
    "DISPLACE",
    "EDGE_SPLIT",
    "HOOK",
    "LAPLACIANDEFORM",
    "LAPLACIANSMOOTH",
    "LATTICE",
    "MASK",
    "MESH_DEFORM",
    "MESH_TO_VOLUME",
    "MIRROR",
    "MULTIRES",
    "NODES",
    "NORMAL_EDIT",
    "REMESH",
    "SCREW",
    "SHRINKWRAP",
    "SIMPLE_DEFORM",
    "SKIN",
    "SMOOTH",
    "SOLIDIFY",
    "SUBSURF",
    "SURFACE",
    "SURFACE_DEFORM",
    "TRIANGULATE",
    "UV_PROJECT",
    "UV_WARP",
    "VERTEX_WEIGHT_EDIT",
    "VERTEX_WEIGHT_MIX",
    "VERTEX_WEIGHT_PROXIMITY",
    "VOLUME_DISPLACE",
    "VOLUME_TO_MESH",
    "WARP",
    "WEIGHTED_NORMAL",
    "WELD",
    "WIREFRAME",
}
# Geometry nodes that read the time, keep a state, or import files that may do either.
_TIMED_NODES = re.compile(r"GeometryNode(InputSceneTime|Simulation|Bake|Import)")
# Cycles blurs geometry that has an attribute of this name, even if nothing moves.
_VELOCITY = "velocity"
_STORING_NODES = (
    "GeometryNodeStoreNamedAttribute",
    "GeometryNodeStoreNamedGrid",
    "GeometryNodeRenameAttribute",
)


def animated() -> Iterator[tuple[Any, Any]]:
    """Yield every data-block with keyframes or drivers, and their owner: it, or its node tree."""
    for name, collection in bpy.data.bl_rna.properties.items():
        # Blender 5.2 repeats everything in `all_ids`.
        if collection.type != "COLLECTION" or name == "all_ids":
            continue
        for owner in getattr(bpy.data, name):
            for block in (owner, getattr(owner, "node_tree", None)):
                if block and is_animated(block):
                    yield owner, block


def is_animated(block: Any) -> bool:
    """Return whether a data-block has keyframes or drivers of its own."""
    data = getattr(block, "animation_data", None)
    return bool(data and (data.action or data.drivers or data.nla_tracks))


def curves(block: Any) -> Iterator[Any]:
    """Yield the curves that set properties of a data-block: drivers and keyframes, NLA included."""
    data = getattr(block, "animation_data", None)
    if not data:
        return
    yield from data.drivers
    yield from _keyframes(data)
    for track in data.nla_tracks:
        for strip in _all_strips(track.strips):
            yield from _keyframes(strip)


def paths(block: Any) -> set[str]:
    """Return the paths of the properties of a data-block that its animation sets."""
    return {str(curve.data_path) for curve in curves(block)}


def mute(block: Any, prefixes: tuple[str, ...]) -> None:
    """Stop a data-block's animation from setting properties whose paths begin with a prefix."""
    for curve in curves(block):
        if curve.data_path.startswith(prefixes):
            curve.mute = True


def driver_targets(block: Any) -> Iterator[Any]:
    """Yield the targets that the drivers of a data-block read."""
    data = getattr(block, "animation_data", None)
    for curve in data.drivers if data else ():
        for variable in curve.driver.variables:
            yield from variable.targets


def uses_visibility() -> list[str]:
    """Return the names of the data-blocks that depend on which objects the viewport shows.

    They have drivers that read it, or curves that set the visibility of other blocks. Blender
    notices such curves only when the viewport changes.
    """
    names = set()
    for owner, block in animated():
        reads_it = any(path.endswith("hide_viewport") for _, path in _driver_inputs(block))
        if reads_it or any(re.search(r"\.hide_(viewport|render)$", path) for path in paths(block)):
            names.add(str(owner.name_full))
    return sorted(names)


def reached() -> set[Any]:
    """Return the objects that an animation sets or reads through a property path.

    Such a path may begin at a scene. Blender counts the scene as a user of all its objects. So its
    list of users does not tell which objects the animation needs.
    """
    objects: set[Any] = set()
    for _, block in animated():
        outputs = [(block, path) for path in paths(block)]
        for start, path in (*outputs, *_driver_inputs(block)):
            objects.update(_objects_on(start, path))
    return objects


def simulated() -> list[str]:
    """Return the data-blocks that may change or be blurred without keyframes or drivers, by name.

    These are simulations, drawings, sequences of files, caches, and geometry with velocities.
    """
    blocks = [obj for obj in bpy.data.objects if is_simulated(obj)]
    blocks += [*bpy.data.cache_files, *bpy.data.movieclips, *bpy.data.volumes]
    blocks += [image for image in bpy.data.images if image.source in ("SEQUENCE", "MOVIE")]
    for group in (bpy.data.meshes, bpy.data.hair_curves, bpy.data.pointclouds):
        blocks += [block for block in group if _VELOCITY in block.attributes]
    blocks += [tree for tree in bpy.data.node_groups if _is_timed(tree)]
    return sorted({str(block.name_full) for block in blocks})


def is_simulated(obj: Any) -> bool:
    """Return whether an object may change with time without keyframes or drivers."""
    return (
        # Drawings have frames of their own.
        obj.type == "GREASEPENCIL"
        or bool(obj.rigid_body or obj.rigid_body_constraint)
        or any(modifier.type not in _STEADY_MODIFIERS for modifier in obj.modifiers)
    )


def _keyframes(source: Any) -> Iterator[Any]:
    """Yield the curves for a block in its action, or in an NLA strip's action."""
    for layer in source.action.layers if source.action else ():
        for strip in layer.strips:
            for bag in strip.channelbags:
                if bag.slot_handle == source.action_slot_handle:
                    yield from bag.fcurves


def _all_strips(strips: Iterable[Any]) -> Iterator[Any]:
    """Yield NLA strips, and the strips inside them."""
    for strip in strips:
        yield strip
        yield from _all_strips(strip.strips)


def _driver_inputs(block: Any) -> Iterator[tuple[Any, str]]:
    """Yield the inputs of a data-block's drivers: where a path begins, and the path."""
    for target in driver_targets(block):
        # A target without a block reads the current scene.
        yield target.id or bpy.context.scene, str(target.data_path)


def _objects_on(start: Any, path: str) -> Iterator[Any]:
    """Yield each object that the path of a property leads through, as in objects["Cube"].scale."""
    for step in re.finditer(r"[.\[]", path):
        try:
            place = start.path_resolve(path[: step.start()])
        except ValueError:
            # The path leads nowhere, or the string is cut inside a step.
            continue
        if isinstance(place, bpy.types.Object):
            yield place


def _is_timed(tree: Any) -> bool:
    """Return whether geometry nodes may depend on time, or store velocities."""
    if tree.bl_idname != "GeometryNodeTree":
        return False
    sockets = [item for item in tree.interface.items_tree if item.item_type == "SOCKET"]
    # Any output besides the geometry becomes an attribute, whose name may be "velocity".
    returns_attributes = sum(socket.in_out == "OUTPUT" for socket in sockets) > 1
    return returns_attributes or any(
        _TIMED_NODES.match(node.bl_idname) or _may_store_velocity(node) for node in tree.nodes
    )


def _may_store_velocity(node: Any) -> bool:
    if node.bl_idname not in _STORING_NODES:
        return False
    name = node.inputs.get("Name")
    return name is None or bool(name.is_linked or name.default_value == _VELOCITY)
