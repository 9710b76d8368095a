"""Goes to a frame of the open scene. A frame with a fraction lies between two whole frames."""

import math

import bpy


def go_to(frame: float) -> None:
    """Evaluate the open scene at a frame."""
    whole = math.floor(frame)
    bpy.context.scene.frame_set(whole, subframe=frame - whole)


def current() -> float:
    """Return the frame of the open scene. Only a frame with a fraction is a float."""
    scene = bpy.context.scene
    # Blender's fraction is a float32.
    fraction = round(scene.frame_subframe, 6)
    return scene.frame_current + fraction if fraction else int(scene.frame_current)
