"""What of a scene is left out of its rendering, because no pixel depends on it.

Only what keeps every byte of every view is left out, so none of it enters the render key, and only
what saves measurably: benchmarks/pruning.py measures each of these, and what was tried and is not
here (bounces of volumes, of transmission and of transparency where there are none: nothing saved).
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import bpy

from lightfield.rendering.quiet import quiet

REASONS = {
    "viewport": "nobody looks at the viewport: its copy of the scene is not kept",
    "hidden_objects": "objects that no render shows and nothing else refers to are unloaded",
    "motion_blur": "nothing moves: the scene is not evaluated at the shutter's opening and closing",
    "animation": "a dataset shows one frame: the scene is not evaluated anew for each view",
}


def left_out(inventory: Mapping[str, Any]) -> list[str]:
    """Decide from a scene's inventory which of `REASONS` apply to it."""
    blurred = bool(inventory["motion_blur"] and inventory["moving"])
    applies = {
        "viewport": True,
        "hidden_objects": bool(inventory["hidden"]),
        "motion_blur": inventory["motion_blur"] and not blurred,
        # What is blurred has to move while its view is rendered.
        "animation": bool(inventory["animated"]) and not blurred,
    }
    return [name for name in REASONS if applies[name]]


def removable_objects() -> list[str]:
    """Return the names of the objects that no render shows and that nothing but the scene holds.

    Hidden are objects by themselves, by their collections, or by having every kind of ray turned
    off. What a modifier, an instancer or a physics simulation may use is not removable.
    """
    layer = bpy.context.view_layer
    shown: set[Any] = set()
    _collect_shown(layer.layer_collection, shown)
    users = bpy.data.user_map()
    instanced: set[Any] = set()
    for collection in bpy.data.collections:
        if any(not isinstance(user, _HOLDS_ONLY) for user in users[collection]):
            instanced.update(collection.all_objects)
    removable = {
        thing
        for thing in bpy.context.scene.objects
        if (thing not in shown or not _meets_rays(thing))
        and thing not in instanced
        and thing.type != "CAMERA"
        and not thing.rigid_body
        and (thing.field is None or thing.field.type == "NONE")
        and not any(modifier.type == "COLLISION" for modifier in thing.modifiers)
    }
    while used := {
        thing
        for thing in removable
        if any(not isinstance(u, _HOLDS_ONLY) and u not in removable for u in users[thing])
    }:
        removable -= used
    return sorted(thing.name_full for thing in removable)


def remove_objects(names: Collection[str]) -> None:
    """Unload objects of the scene, with all that nothing else uses."""
    for thing in list(bpy.context.scene.objects):
        if thing.name_full in names:
            for collection in thing.users_collection:
                collection.objects.unlink(thing)
    if names:
        remove_unused()


def remove_unused() -> None:
    """Unload what nothing uses."""
    with quiet():
        bpy.ops.outliner.orphans_purge(do_recursive=True)


def leave_out(names: Collection[str]) -> None:
    """Leave out of the scene, set up for its frame, what `pruning.left_out` has found."""
    scene = bpy.context.scene
    if "motion_blur" in names:
        scene.render.use_motion_blur = False
    if "animation" in names:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for owner, tree in list(animated()):
            _freeze(owner, tree, depsgraph)
    if "viewport" in names:
        for thing in scene.objects:
            thing.hide_viewport = True
        bpy.context.view_layer.update()


@contextmanager
def unhidden(things: Iterable[Any]) -> Iterator[None]:
    """Show those of the ``things`` in the viewport for a while that only a render shows."""
    hidden = [thing for thing in things if thing.hide_viewport and not thing.hide_render]
    for thing in hidden:
        thing.hide_viewport = False
    yield
    for thing in hidden:
        thing.hide_viewport = True


def animated() -> Iterator[tuple[Any, bool]]:
    """Yield every data-block with animation or drivers, and whether these are its node tree's."""
    for name, collection in bpy.data.bl_rna.properties.items():
        # Blender 5.2 lists everything once more in `all_ids`.
        if collection.type != "COLLECTION" or name == "all_ids":
            continue
        for owner in getattr(bpy.data, name):
            for block in (owner, getattr(owner, "node_tree", None)):
                data = getattr(block, "animation_data", None)
                if data and (data.action or data.drivers or data.nla_tracks):
                    yield owner, block != owner


# What lists objects without making anything of them.
_HOLDS_ONLY = (
    bpy.types.Scene,
    bpy.types.Collection,
    bpy.types.Screen,
    bpy.types.WindowManager,
    bpy.types.WorkSpace,
)


def _collect_shown(layer_collection: Any, shown: set[Any]) -> None:
    if layer_collection.collection.hide_render:
        return
    if not layer_collection.exclude:
        shown.update(o for o in layer_collection.collection.objects if not o.hide_render)
    for child in layer_collection.children:
        _collect_shown(child, shown)


def _meets_rays(thing: Any) -> bool:
    """Return whether an object has any kind of ray turned on; empties stand for others."""
    return thing.type == "EMPTY" or any(
        getattr(thing, f"visible_{kind}")
        for kind in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    )


def _freeze(owner: Any, tree: bool, depsgraph: Any) -> None:
    """Remove a data-block's animation where its properties already hold this frame's values."""
    evaluated = owner.evaluated_get(depsgraph)
    if owner.library or not evaluated.is_evaluated:
        return
    block, now = (owner.node_tree, evaluated.node_tree) if tree else (owner, evaluated)
    data = block.animation_data
    if data.nla_tracks:
        return
    curves = list(data.drivers)
    if data.action:
        curves += [
            curve
            for layer in data.action.layers
            for strip in layer.strips
            for bag in strip.channelbags
            if bag.slot_handle == data.action_slot_handle
            for curve in bag.fcurves
        ]
    if all(_value(block, curve) == _value(now, curve) for curve in curves):
        block.animation_data_clear()


def _value(block: Any, curve: Any) -> Any:
    """Return the property that an animation curve sets; the block itself if there is no such."""
    try:
        value = block.path_resolve(curve.data_path)
        return value[curve.array_index] if hasattr(value, "__len__") else value
    except (ValueError, IndexError):
        return block
