"""Makes the viewport show what a render shows."""

from typing import Any

import bpy

from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.scenes.volumes import alone


def show_what_is_rendered() -> None:
    """Make the viewport show what a render of the current frame shows, without its volumes."""
    shown = in_render(_shown) - alone()
    for obj in bpy.data.objects:
        animation.mute(obj, ("hide_viewport",))
        obj.hide_viewport = obj.name_full not in shown
    for settings in bpy.data.particles:
        settings.display_percentage = 100
    show_collections()


def show_collections() -> None:
    """Show in the viewport what only the viewport hides, and the collections that renders show."""
    layer = bpy.context.view_layer
    for obj in layer.objects:
        obj.hide_set(False)
    for collection in bpy.data.collections:
        collection.hide_viewport = collection.hide_render
    parts = [layer.layer_collection]
    for part in parts:
        part.hide_viewport = False
        parts += part.children


def _shown(depsgraph: Any) -> set[str]:
    """Return the full names of the objects that are not hidden in a render."""
    objects = (entry.object for entry in depsgraph.object_instances)
    return {str(obj.original.name_full) for obj in objects if not obj.hide_render}
