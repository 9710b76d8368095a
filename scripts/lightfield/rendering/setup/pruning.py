"""Leaves out of a render whatever changes no pixel.

Leaving something out must not change a byte of any view. So the render key does not name it. It
must save measurable time: docs/explanation/pruning.md has the time that each of these saves. Fewer
bounces for volumes, transmission and transparency that a scene does not have saved nothing.

What is left out is left out of every frame. So the decision never depends on values that keyframes,
a driver or a simulation may change.
"""

from collections.abc import Collection, Mapping
from typing import Any

import bpy

from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.quiet import quiet
from lightfield.rendering.scenes.render_graph import in_render

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
        # Blurred objects must move during a render. A simulation may read earlier frames.
        "animation": bool(inventory["animated"])
        and not inventory["motion_blur"]
        and not inventory["simulated"],
    }
    return [name for name in REASONS if applies[name]]


def removable_objects() -> list[str]:
    """Return the names of the objects that no frame shows, and that nothing but the scene uses.

    An object may be hidden by itself, by its collections, or because all its kinds of rays are
    turned off. Objects with keyframes or drivers stay, because these may show them. Blender cannot
    animate the visibility of collections, nor the object that a modifier, a constraint or an
    instancer refers to. Objects that these, a physics simulation or drivers may use stay, too.
    """
    scene = bpy.context.scene
    shown: set[Any] = set()
    _collect_shown(bpy.context.view_layer.layer_collection, shown)
    for background in background_scenes(scene):
        shown.update(background.objects)
    users = bpy.data.user_map()
    needed = animation.reached() | objects_of_used_collections(users)
    removable = {
        obj
        for obj in scene.objects
        if (obj not in shown or not _meets_rays(obj))
        and obj not in needed
        and obj.type != "CAMERA"
        and not animation.is_animated(obj)
        and not _is_physical(obj)
        # Blender cannot remove objects from a collection of a linked file.
        and not any(collection.library for collection in obj.users_collection)
    }
    # Keep what a kept object uses, until nothing changes.
    while True:
        used = {obj for obj in removable if _is_used(users[obj], removable)}
        if not used:
            break
        removable -= used
    return sorted(obj.name_full for obj in removable)


def objects_of_used_collections(users: Mapping[Any, Any]) -> set[Any]:
    """Return the objects of all collections that an instancer, a modifier or the like uses.

    ``users`` holds the users of each data-block, from ``bpy.data.user_map()``.
    """
    objects: set[Any] = set()
    for collection in bpy.data.collections:
        if any(not isinstance(user, _HOLDS_ONLY) for user in users[collection]):
            objects.update(collection.all_objects)
    return objects


def _is_used(users: Collection[Any], removable: Collection[Any]) -> bool:
    """Return whether any user of an object needs it, and is not removable itself."""
    return any(not isinstance(user, _HOLDS_ONLY) and user not in removable for user in users)


def background_scenes(scene: Any) -> list[Any]:
    """Return a scene's background scene, the background scene of that one, and so on."""
    backgrounds: list[Any] = []
    background = scene.background_set
    while background and background not in backgrounds:
        backgrounds.append(background)
        background = background.background_set
    return backgrounds


def remove_objects(names: Collection[str]) -> None:
    """Unload objects of the scene, and all data that only they use."""
    for obj in list(bpy.context.scene.objects):
        if obj.name_full in names:
            for collection in obj.users_collection:
                collection.objects.unlink(obj)
    if names:
        remove_unused()


def remove_unused() -> None:
    """Unload all data-blocks that nothing uses."""
    with quiet():
        bpy.ops.outliner.orphans_purge(do_recursive=True)


def leave_out(names: Collection[str]) -> None:
    """Leave out what ``names`` from `left_out` say. The scene must be set up for its frame."""
    scene = bpy.context.scene
    if "motion_blur" in names:
        scene.render.use_motion_blur = False
    if "animation" in names:
        for block in in_render(_standing):
            block.animation_data_clear()
    if "viewport" in names:
        for obj in scene.objects:
            obj.hide_viewport = True
        bpy.context.view_layer.update()


# Types that hold objects without using them.
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


def _meets_rays(obj: Any) -> bool:
    """Return whether an object has any kind of ray turned on. Empties may place other objects."""
    return obj.type == "EMPTY" or any(
        getattr(obj, f"visible_{kind}")
        for kind in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    )


def _is_physical(obj: Any) -> bool:
    """Return whether a physics simulation may use an object that it does not refer to."""
    return (
        animation.is_simulated(obj)
        or (obj.field is not None and obj.field.type != "NONE")
        or any(modifier.type == "COLLISION" for modifier in obj.modifiers)
    )


def _standing(depsgraph: Any) -> list[Any]:
    """Return data-blocks and node trees whose properties already hold this frame's values.

    Their animation is not needed. Drivers with variables stay: their values may depend on more than
    the frame, such as the camera or a render's levels of detail.
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
    """Return the value of the property that a curve sets. Return the block if there is none."""
    try:
        value = block.path_resolve(curve.data_path)
        # Blender does not always follow a path into another block.
        place = block.path_resolve(curve.data_path, False)
        if getattr(place, "id_data", block) != block:
            return block
        is_array = hasattr(value, "__getitem__") and not isinstance(value, str)
        return value[curve.array_index] if is_array else value
    except (ValueError, IndexError):
        return block
