"""Decides which camera the scene's objects follow: the file's in all views, or each view's own.

Constraints, drivers, parents, modifiers and geometry nodes may follow a camera. They name it, or
they take the scene's active one, which is each view's own while Cycles renders. Blender tells what
it evaluates anew after a camera has changed.
"""

import re
from collections.abc import Sequence
from typing import Any

import bpy
from mathutils import Matrix

from lightfield.core.errors import UserError
from lightfield.core.names import FILE
from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.ids import has_no_surface
from lightfield.rendering.setup import viewport

_ACTIVE_CAMERA = "GeometryNodeInputActiveCamera"
# Constraints that take the active camera if they name none.
_TRACKS = ("FOLLOW_TRACK", "OBJECT_SOLVER")


def followers(choice: str) -> dict[str, list[str]]:
    """Return the names of the file's camera's followers: by its name, or as the ``active`` one.

    They are objects, lamps, materials and worlds. ``choice`` is the scene YAML's key
    ``followed_camera``. The scene must be at its frame, and is changed. Raises `UserError` if
    nothing can follow the file's camera alone.
    """
    scene = bpy.context.scene
    file_camera = scene.camera
    # Markers may choose other cameras at other frames.
    cameras = {file_camera, *(marker.camera for marker in scene.timeline_markers)} - {None}
    _show_in_viewport()
    view_camera = bpy.data.objects.new("plenoforge_view", bpy.data.cameras.new("plenoforge_view"))
    scene.camera = view_camera
    # A new object also makes Blender look for all relations again.
    scene.collection.objects.link(view_camera)
    by_name = sorted({name for camera in cameras for name in _changed_with(camera)})
    active = list(_changed_with(view_camera))
    if active and choice == FILE:
        if file_camera is None:
            raise UserError(
                f"the scene {scene.name} has no camera, which {_listed(active)} would follow; give "
                "it one, or let them follow each view's camera: scene: {followed_camera: view}"
            )
        freeze(file_camera)
        if moving := _moved_with(view_camera):
            raise UserError(
                f"{_listed(moving)}: would follow each view's camera, and each view would show "
                "another scene; change that in Blender, or allow it: "
                "scene: {followed_camera: view}"
            )
    return {"by_name": by_name, "active": active}


def freeze(camera: Any) -> None:
    """Make everything that follows the active camera follow ``camera``, in every view."""
    for tree in bpy.data.node_groups:
        for node in [node for node in tree.nodes if node.bl_idname == _ACTIVE_CAMERA]:
            replacement = tree.nodes.new("GeometryNodeInputObject")
            replacement.object = camera
            for link in list(node.outputs[0].links):
                is_muted = link.is_muted
                tree.links.new(replacement.outputs[0], link.to_socket).is_muted = is_muted
            tree.nodes.remove(node)
    path = f'objects["{bpy.utils.escape_identifier(camera.name)}"]'
    for _, block in animation.animated():
        for target in animation.driver_targets(block):
            # A target without a block reads the current scene.
            if target.id in (None, bpy.context.scene):
                target.data_path = re.sub(r"^camera\b", lambda _: path, target.data_path)
    for obj in bpy.data.objects:
        bones = obj.pose.bones if obj.pose else ()
        for owner in (obj, *bones):
            for constraint in owner.constraints:
                if constraint.type in _TRACKS and constraint.camera is None:
                    constraint.camera = camera
        for modifier in obj.modifiers:
            if modifier.type == "LINEART" and not modifier.use_custom_camera:
                modifier.use_custom_camera = True
                modifier.source_camera = camera


def follow_views(file_camera: Any, view_camera: Any) -> None:
    """Make everything that names the file's camera follow each view's own camera."""
    if file_camera.type == "CAMERA":
        file_camera.data.user_remap(view_camera.data)
    file_camera.user_remap(view_camera)


def _show_in_viewport() -> None:
    """Let the viewport evaluate all that a render may. Blender tells changes of the viewport."""
    for obj in bpy.context.scene.objects:
        animation.mute(obj, ("hide_viewport", "modifiers["))
        obj.hide_viewport = obj.hide_render
        for modifier in obj.modifiers:
            modifier.show_viewport = modifier.show_render
    viewport.show_collections()


def _changed_with(camera: Any) -> dict[str, bool]:
    """Return the blocks that Blender evaluates anew after a camera has changed, by their names.

    The value says whether Blender evaluates the place of an object alone, and not its mesh.
    """
    blocks: dict[str, bool] = {}

    def note(_: Any, depsgraph: Any) -> None:
        for update in depsgraph.updates:
            if _is_shown(update):
                name = str(update.id.original.name_full)
                is_place = update.is_updated_transform and not update.is_updated_geometry
                blocks[name] = is_place and blocks.get(name, True)

    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        camera.update_tag()
        if camera.data:
            camera.data.update_tag()
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    return dict(sorted(blocks.items()))


def _moved_with(camera: Any) -> list[str]:
    """Return the names of the blocks that are others if a camera is elsewhere. Move the camera.

    Blender evaluates what follows a film anew with the active camera, even if its constraint names
    another one. So an object of which only the place is evaluated counts only if it moves.
    """
    blocks = _changed_with(camera)
    placed = [name for name, is_place in blocks.items() if is_place]
    before = [_place(name) for name in placed]
    camera.matrix_world = Matrix.Translation((3, 4, 5)) @ Matrix.Rotation(1, 4, (1, 2, 3))
    bpy.context.view_layer.update()
    stays = {name for name, place in zip(placed, before, strict=True) if _place(name) == place}
    return [name for name in blocks if name not in stays]


def _place(name: str) -> Any:
    """Return where the object with a full name is."""
    (obj,) = (obj for obj in bpy.data.objects if obj.name_full == name)
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.copy()


def _is_shown(update: Any) -> bool:
    """Return whether a block that was evaluated anew is one that views may show."""
    block = update.id.original
    if isinstance(block, bpy.types.Object):
        is_moved = update.is_updated_transform or update.is_updated_geometry
        return is_moved and (block.type == "LIGHT" or not has_no_surface(block))
    return isinstance(block, bpy.types.Material | bpy.types.World | bpy.types.Light)


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:8])}{' …' if len(names) > 8 else ''}"
