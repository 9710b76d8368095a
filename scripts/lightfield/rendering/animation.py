"""What of a .blend may change from one frame to the next, or within a frame.

Nothing here depends on the frame that the .blend was saved at. Keyframes and drivers may give a
property any value.
"""

import re
from collections.abc import Iterable, Iterator
from typing import Any

import bpy

# Modifiers that do not change with time by themselves. Any other one may, such as a simulation.
_STEADY_MODIFIERS = {
    *("ARMATURE", "ARRAY", "BEVEL", "BOOLEAN", "CAST", "COLLISION", "CORRECTIVE_SMOOTH", "CURVE"),
    *("DATA_TRANSFER", "DECIMATE", "DISPLACE", "EDGE_SPLIT", "HOOK", "LAPLACIANDEFORM"),
    *("LAPLACIANSMOOTH", "LATTICE", "MASK", "MESH_DEFORM", "MESH_TO_VOLUME", "MIRROR", "MULTIRES"),
    *("NODES", "NORMAL_EDIT", "REMESH", "SCREW", "SHRINKWRAP", "SIMPLE_DEFORM", "SKIN", "SMOOTH"),
    *("SOLIDIFY", "SUBSURF", "SURFACE", "SURFACE_DEFORM", "TRIANGULATE", "UV_PROJECT", "UV_WARP"),
    *("VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "VOLUME_DISPLACE"),
    *("VOLUME_TO_MESH", "WARP", "WEIGHTED_NORMAL", "WELD", "WIREFRAME"),
}
# Geometry nodes that know the time, keep a state, or read files that may.
_TIMED_NODES = re.compile(r"GeometryNode(InputSceneTime|Simulation|Bake|Import)")
# Cycles blurs what has an attribute of this name, even where nothing moves.
_VELOCITY = "velocity"
_STORING_NODES = (
    *("GeometryNodeStoreNamedAttribute", "GeometryNodeStoreNamedGrid"),
    "GeometryNodeRenameAttribute",
)


def animated() -> Iterator[tuple[Any, Any]]:
    """Yield every data-block with keyframes or drivers, and what has them: it, or its node tree."""
    for name, collection in bpy.data.bl_rna.properties.items():
        # Blender 5.2 lists everything once more in `all_ids`.
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
    """Let a data-block's animation no longer set the properties whose paths begin like these."""
    for curve in curves(block):
        if curve.data_path.startswith(prefixes):
            curve.mute = True


def uses_visibility() -> list[str]:
    """Return the names of what depends on which objects the viewport shows.

    These have drivers that ask for it, or curves that set the visibility of other blocks. Blender
    takes notice of such curves only when the viewport changes.
    """
    names = set()
    for owner, block in animated():
        asks = any(path.endswith("hide_viewport") for _, path in _driver_inputs(block))
        if asks or any(re.search(r"\.hide_(viewport|render)$", path) for path in paths(block)):
            names.add(str(owner.name_full))
    return sorted(names)


def reached() -> set[Any]:
    """Return the objects that some animation sets or reads by a path that leads through them.

    Such a path may begin at a scene. Blender counts the scene as a user of all its objects, so its
    list of users does not tell which of them the animation needs.
    """
    objects: set[Any] = set()
    for _, block in animated():
        outputs = [(block, path) for path in paths(block)]
        for start, path in (*outputs, *_driver_inputs(block)):
            objects.update(_objects_on(start, path))
    return objects


def simulated() -> list[str]:
    """Return the names of what may change with time, or be blurred, without keyframes or drivers.

    These are simulations, drawings, sequences of files, caches, and what has velocities.
    """
    blocks = [thing for thing in bpy.data.objects if is_simulated(thing)]
    blocks += [*bpy.data.cache_files, *bpy.data.movieclips, *bpy.data.volumes]
    blocks += [image for image in bpy.data.images if image.source in ("SEQUENCE", "MOVIE")]
    for group in (bpy.data.meshes, bpy.data.hair_curves, bpy.data.pointclouds):
        blocks += [block for block in group if _VELOCITY in block.attributes]
    blocks += [tree for tree in bpy.data.node_groups if _is_timed(tree)]
    return sorted({str(block.name_full) for block in blocks})


def is_simulated(thing: Any) -> bool:
    """Return whether an object may change with time without keyframes or drivers."""
    return (
        # Drawings have frames of their own.
        thing.type == "GREASEPENCIL"
        or bool(thing.rigid_body or thing.rigid_body_constraint)
        or any(modifier.type not in _STEADY_MODIFIERS for modifier in thing.modifiers)
    )


def _keyframes(source: Any) -> Iterator[Any]:
    """Yield the curves that a block's action, or that of an NLA strip, has for the block."""
    for layer in source.action.layers if source.action else ():
        for strip in layer.strips:
            for bag in strip.channelbags:
                if bag.slot_handle == source.action_slot_handle:
                    yield from bag.fcurves


def _all_strips(strips: Iterable[Any]) -> Iterator[Any]:
    """Yield NLA strips, and those that lie in them."""
    for strip in strips:
        yield strip
        yield from _all_strips(strip.strips)


def _driver_inputs(block: Any) -> Iterator[tuple[Any, str]]:
    """Yield what the drivers of a data-block read: where a path begins, and the path."""
    data = getattr(block, "animation_data", None)
    for curve in data.drivers if data else ():
        for variable in curve.driver.variables:
            for target in variable.targets:
                # Without a block of its own it reads the present scene.
                yield target.id or bpy.context.scene, str(target.data_path)


def _objects_on(start: Any, path: str) -> Iterator[Any]:
    """Yield each object that the path of a property leads through, as in objects["Cube"].scale."""
    for step in re.finditer(r"[.\[]", path):
        try:
            place = start.path_resolve(path[: step.start()])
        except ValueError:
            # The path leads nowhere, or this is no end of a step.
            continue
        if isinstance(place, bpy.types.Object):
            yield place


def _is_timed(tree: Any) -> bool:
    """Return whether geometry nodes may depend on time, or store velocities."""
    if tree.bl_idname != "GeometryNodeTree":
        return False
    sockets = [item for item in tree.interface.items_tree if item.item_type == "SOCKET"]
    # What else than geometry a modifier's nodes return becomes an attribute of any name.
    returns_attributes = sum(socket.in_out == "OUTPUT" for socket in sockets) > 1
    return returns_attributes or any(
        _TIMED_NODES.match(node.bl_idname) or _may_store_velocity(node) for node in tree.nodes
    )


def _may_store_velocity(node: Any) -> bool:
    if node.bl_idname not in _STORING_NODES:
        return False
    name = node.inputs.get("Name")
    return name is None or bool(name.is_linked or name.default_value == _VELOCITY)
