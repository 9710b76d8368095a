"""Turns the motion blur of the open scene on and off, and centres it on the frame.

Cycles blurs only if both the scene and its view layer have motion blur on. The view layer is that
of Blender's context: `lightfield.rendering.scenes.blend_file` renders no other.
"""

import bpy


def turn(is_on: bool) -> None:
    """Turn motion blur on or off."""
    bpy.context.scene.render.use_motion_blur = is_on
    if is_on:
        bpy.context.view_layer.use_motion_blur = True


def centre() -> None:
    """Expose all rows evenly, and let the middle of the exposure be at the frame.

    Depth, passes and poses describe that moment.
    """
    scene = bpy.context.scene
    scene.render.motion_blur_position = "CENTER"
    scene.cycles.rolling_shutter_type = "NONE"
    curve = scene.render.motion_blur_shutter_curve
    for point in curve.curves[0].points:
        point.location.y = 1
    curve.update()


def is_on() -> bool:
    """Return whether Cycles blurs what moves."""
    return bool(bpy.context.scene.render.use_motion_blur and bpy.context.view_layer.use_motion_blur)
