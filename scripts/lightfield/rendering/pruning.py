"""Leaves out of a render what no pixel depends on.

Leaving something out must not change a byte of any view, so the render key does not name it. It
must save measurably: benchmarks/pruning.py measures each of these. Fewer bounces for volumes,
transmission and transparency that a scene does not have saved nothing, and are not here.

What is left out is left out of every frame. So values that keyframes, a driver or a simulation may
change decide nothing.
"""

from collections.abc import Collection, Mapping
from typing import Any

import bpy

from lightfield.rendering import animation
from lightfield.rendering.quiet import quiet
from lightfield.rendering.render_graph import in_render

REASONS = {
    "viewport": "nobody looks at the viewport: its copy of the scene is not kept",
    "hidden_objects": "objects that no frame shows and nothing else refers to are unloaded",
    "motion_blur": "nothing changes: the scene is not evaluated when the shutter opens and closes",
    "animation": "a dataset shows one frame: the scene is not evaluated anew for each view",
}


def left_out(inventory: Mapping[str, Any]) -> list[str]:
    """Return which of `REASONS` apply to a scene, from its inventory."""
    changes = inventory["animated"] or inventory["simulated"]
    applies = {
        "viewport": not inventory["uses_visibility"],
        "hidden_objects": bool(inventory["hidden"]),
        "motion_blur": inventory["motion_blur"] and not changes,
        # What is blurred has to move while its view is rendered. A simulation may ask where things
        # were at earlier frames.
        "animation": bool(inventory["animated"])
        and not inventory["motion_blur"]
        and not inventory["simulated"],
    }
    return [name for name in REASONS if applies[name]]


def removable_objects() -> list[str]:
    """Return the names of the objects that no frame shows, and that nothing but the scene uses.

    An object may be hidden by itself, by its collections, or because all kinds of rays are turned
    off for it. Objects with keyframes or drivers are not removable, because these may show them.
    Blender cannot animate the visibility of collections, nor what a modifier, a constraint or an
    instancer refers to. Objects that these, a physics simulation or drivers may use are not
    removable.
    """
    scene = bpy.context.scene
    shown: set[Any] = set()
    _collect_shown(bpy.context.view_layer.layer_collection, shown)
    for background in background_scenes(scene):
        shown.update(background.objects)
    users = bpy.data.user_map()
    needed = animation.reached()
    for collection in bpy.data.collections:
        if any(not isinstance(user, _HOLDS_ONLY) for user in users[collection]):
            needed.update(collection.all_objects)
    removable = {
        thing
        for thing in scene.objects
        if (thing not in shown or not _meets_rays(thing))
        and thing not in needed
        and thing.type != "CAMERA"
        and not animation.is_animated(thing)
        and not _is_physical(thing)
        # Blender cannot remove objects from a collection of a linked file.
        and not any(collection.library for collection in thing.users_collection)
    }
    while used := {
        thing
        for thing in removable
        if any(not isinstance(u, _HOLDS_ONLY) and u not in removable for u in users[thing])
    }:
        removable -= used
    return sorted(thing.name_full for thing in removable)


def background_scenes(scene: Any) -> list[Any]:
    """Return a scene's background scene, the background scene of that one, and so on."""
    backgrounds: list[Any] = []
    while (scene := scene.background_set) and scene not in backgrounds:
        backgrounds.append(scene)
    return backgrounds


def remove_objects(names: Collection[str]) -> None:
    """Unload objects of the scene, and all that only they use."""
    for thing in list(bpy.context.scene.objects):
        if thing.name_full in names:
            for collection in thing.users_collection:
                collection.objects.unlink(thing)
    if names:
        remove_unused()


def remove_unused() -> None:
    """Unload all data-blocks that nothing uses."""
    with quiet():
        bpy.ops.outliner.orphans_purge(do_recursive=True)


def leave_out(names: Collection[str]) -> None:
    """Leave out what `left_out` names. The scene must be set up for its frame."""
    scene = bpy.context.scene
    if "motion_blur" in names:
        scene.render.use_motion_blur = False
    if "animation" in names:
        for block in in_render(_standing):
            block.animation_data_clear()
    if "viewport" in names:
        for thing in scene.objects:
            thing.hide_viewport = True
        bpy.context.view_layer.update()


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
    """Return whether an object has any kind of ray turned on. Empties may place other objects."""
    return thing.type == "EMPTY" or any(
        getattr(thing, f"visible_{kind}")
        for kind in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    )


def _is_physical(thing: Any) -> bool:
    """Return whether a physics simulation may use an object that it does not refer to."""
    return (
        animation.is_simulated(thing)
        or (thing.field is not None and thing.field.type != "NONE")
        or any(modifier.type == "COLLISION" for modifier in thing.modifiers)
    )


def _standing(depsgraph: Any) -> list[Any]:
    """Return what can go without its animation: its properties already hold this frame's values.

    These are data-blocks and node trees. What drivers make of variables may depend on more than the
    frame, such as the camera or a render's levels of detail.
    """
    blocks = []
    for owner, block in animation.animated():
        evaluated = owner.evaluated_get(depsgraph)
        data = block.animation_data
        if owner.library or not evaluated.is_evaluated or data.nla_tracks:
            continue
        now = evaluated if block == owner else evaluated.node_tree
        if all(
            not (curve.driver and curve.driver.variables)
            and _value(block, curve) == _value(now, curve)
            for curve in animation.curves(block)
        ):
            blocks.append(block)
    return blocks


def _value(block: Any, curve: Any) -> Any:
    """Return the property of a block that an animation curve sets; the block itself if none."""
    try:
        value = block.path_resolve(curve.data_path)
        # Where a path leads to another block, Blender does not always take it there.
        place = block.path_resolve(curve.data_path, False)
        if getattr(place, "id_data", block) != block:
            return block
        is_array = hasattr(value, "__getitem__") and not isinstance(value, str)
        return value[curve.array_index] if is_array else value
    except (ValueError, IndexError):
        return block
