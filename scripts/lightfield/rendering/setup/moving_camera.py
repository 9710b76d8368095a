"""Places the camera for the next view: still, or moving while the shutter is open."""

from typing import Any

import bpy
import mathutils
import numpy as np

from lightfield.formats.render_block import CameraMotion
from lightfield.geometry.exposure import pose_at
from lightfield.rendering.scenes import frames
from lightfield.rendering.setup import motion_blur

Array = np.ndarray[Any, Any]


def blur(motion: CameraMotion) -> None:
    """Blur the following views by the camera's ``motion``.

    Objects are blurred only if they were before. Cycles must be set up for all else.
    """
    scene = bpy.context.scene
    if not motion_blur.is_on():
        for obj in bpy.data.objects:
            obj.cycles.use_motion_blur = obj == scene.camera
    motion_blur.turn(True)
    if motion.rolling is not None:
        scene.cycles.rolling_shutter_type = "TOP"
        scene.cycles.rolling_shutter_duration = motion.rolling
    scene.camera.rotation_mode = "QUATERNION"


def place_camera(world_from_camera: Array, motion: CameraMotion | None) -> None:
    """Place the scene's camera at ``world_from_camera``, (4, 4) camera-to-world.

    `blur` must have set the ``motion`` up, if there is one. A moving camera is at this place in the
    middle of the exposure.
    """
    scene = bpy.context.scene
    camera = scene.camera
    if motion is None:
        camera.matrix_world = mathutils.Matrix(np.asarray(world_from_camera).tolist())
        return
    middle = np.asarray(world_from_camera, np.float64)
    render = scene.render
    # Blender remaps frames before it reads keys.
    shutter = render.motion_blur_shutter * render.frame_map_old / render.frame_map_new
    # The keys have the same frames for each view, so they replace the previous view's keys.
    for time in (-0.5, 0.0, 0.5):
        pose = mathutils.Matrix(pose_at(middle, motion.travel, motion.turn, time).tolist())
        rotation = pose.to_quaternion()
        if time > -0.5:
            rotation.make_compatible(camera.rotation_quaternion)
        camera.location = pose.translation
        camera.rotation_quaternion = rotation
        frame = scene.frame_current_final + time * shutter
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
    frames.go_to(frames.current())
