"""Reads a .blend's render settings. `lightfield.formats.blend` decides which of them to use."""

from collections.abc import Iterable
from typing import Any

import bpy
import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.rotations import Floats, is_mirrored, is_skewed
from lightfield.rendering.scenes import frames
from lightfield.rendering.setup import motion_blur
from lightfield.rendering.setup.cycles import view_layer

# The steps of Blender's table of a curve.
_CURVE_STEPS = 256


def facts(camera_frames: Iterable[float | None], is_blurred: bool = False) -> dict[str, Any]:
    """Return the open .blend's render settings, and its camera at some frames.

    None stands for the frame that the file was saved at. Without ``camera_frames``, no view is the
    camera's. ``is_blurred`` says whether motion blurs the views even if the file has no blur.
    Raises `UserError` if the camera does not have the same lens at all frames, or if a view cannot
    have its pose.
    """
    scene = bpy.context.scene
    layer = view_layer(scene)
    render = scene.render
    cycles = scene.cycles
    view = scene.view_settings
    frame = frames.current()
    nodes = scene.compositing_node_group
    views = [frame if each is None else each for each in camera_frames]
    may_blur = is_blurred or motion_blur.is_on()
    camera = _camera(views or [frame], is_taken=bool(views), may_blur=may_blur)
    frames.go_to(frame)
    return {
        "scenes": [other.name for other in bpy.data.scenes],
        "scene": scene.name,
        "frame": frame,
        "view_layers": len(scene.view_layers),
        "engine": render.engine,
        "samples": _samples(cycles, layer),
        "adaptive_sampling": bool(cycles.use_adaptive_sampling),
        "denoising": bool(cycles.use_denoising and layer.cycles.use_denoising),
        "motion_blur": motion_blur.is_on(),
        **_exposure(scene),
        "compositor": bool(render.use_compositing and nodes and nodes.nodes),
        "sequencer": bool(
            render.use_sequencer and scene.sequence_editor and scene.sequence_editor.strips
        ),
        "environment": bool(layer.use_sky),
        "film_transparent": bool(render.film_transparent),
        "display": scene.display_settings.display_device,
        "view_transform": view.view_transform,
        "look": view.look,
        "exposure": round(view.exposure, 4),
        "gamma": round(view.gamma, 4),
        **_curves(view),
        "white": list(view.white_balance_whitepoint) if view.use_white_balance else None,
        "pixel_aspect": round(render.pixel_aspect_x / render.pixel_aspect_y, 4),
        "border": bool(render.use_border),
        "stereoscopy": bool(render.use_multiview),
        "freestyle": bool(render.use_freestyle),
        "simplify": bool(render.use_simplify),
        "culling": bool(
            render.use_simplify and (cycles.use_camera_cull or cycles.use_distance_cull)
        ),
        "working_space": bpy.data.colorspace.working_space,
        "unit_scale": round(scene.unit_settings.scale_length, 6),
        "scripts": bool(bpy.app.autoexec_fail),
        "camera": camera,
    }


def _curves(view: Any) -> dict[str, Any]:
    """Return whether curves change the light for display, how, and their tables.

    Blender makes curves only once a user turns them on. Until then there may be none.
    """
    mapping = view.curve_mapping
    is_on = bool(view.use_curve_mapping and mapping)
    return {
        "curves": is_on,
        "curve_tone": mapping.tone if mapping else "STANDARD",
        "curve_tables": _curve_tables(mapping) if is_on else None,
    }


def _curve_tables(mapping: Any) -> dict[str, Any]:
    """Return the curves of light as `lightfield.imaging.look.Curves` has them.

    Blender, too, evaluates tables, each of a channel's curve followed by the curve of all channels.
    """
    mapping.initialize()
    together = mapping.curves[3]
    tables = []
    slopes = []
    starts = []
    ends = []
    for curve in list(mapping.curves)[:3]:
        start, end = _range(mapping, curve)
        table = [
            mapping.evaluate(together, mapping.evaluate(curve, float(place)))
            for place in np.linspace(start, end, _CURVE_STEPS + 1)
        ]
        slope = np.prod([_slopes(mapping, each) for each in (curve, together)], axis=0)
        starts.append(start)
        ends.append(end)
        tables.append(table)
        slopes.append(slope.tolist())
    return {
        "black": list(mapping.black_level),
        "white": list(mapping.white_level),
        "start": starts,
        "end": ends,
        "tables": tables,
        "slopes": slopes,
    }


def _range(mapping: Any, curve: Any) -> tuple[float, float]:
    """Return the values between which a curve is not a line."""
    places = [point.location.x for point in curve.points]
    return min(mapping.clip_min_x, *places), max(mapping.clip_max_x, *places)


def _slopes(mapping: Any, curve: Any) -> tuple[float, float]:
    """Return the slopes with which a curve goes on before its start and after its end."""
    start, end = _range(mapping, curve)
    before = mapping.evaluate(curve, start) - mapping.evaluate(curve, start - 1)
    after = mapping.evaluate(curve, end + 1) - mapping.evaluate(curve, end)
    return before, after


def _exposure(scene: Any) -> dict[str, Any]:
    """Return the settings that decide on which frames, when, and how long the shutter is open."""
    render = scene.render
    heights = {point.location.y for point in render.motion_blur_shutter_curve.curves[0].points}
    return {
        "remapped": [render.frame_map_old, render.frame_map_new],
        "shutter": round(render.motion_blur_shutter, 6),
        "shutter_position": render.motion_blur_position,
        "shutter_curve": len(heights) > 1,
        "rolling_shutter": scene.cycles.rolling_shutter_type != "NONE",
    }


def _samples(cycles: Any, layer: Any) -> int:
    """Return the samples per pixel. A view layer may set another number, or an upper bound."""
    layer_samples = int(layer.samples)
    scene_samples = int(cycles.samples)
    if not layer_samples or cycles.use_layer_samples == "IGNORE":
        return scene_samples
    return (
        min(layer_samples, scene_samples)
        if cycles.use_layer_samples == "BOUNDED"
        else layer_samples
    )


def _camera(camera_frames: list[float], is_taken: bool, may_blur: bool) -> dict[str, Any] | None:
    """Return the camera's lens, and its camera-to-world matrices (4, 4) by frame.

    Return None if the scene has no camera. A marker may change the camera with the frame.
    ``is_taken`` says whether views have the camera's poses. Only then, and if motion ``may_blur``
    them, ``moves`` says whether the camera moves during the exposure. Raises `UserError` if views
    cannot have its poses.
    """
    scene = bpy.context.scene
    lenses = []
    world_from_cameras = {}
    names = []
    clips = []
    moves = False
    for frame in sorted(set(camera_frames)):
        frames.go_to(frame)
        # Blender lets any object be the camera. Only a camera has a lens.
        if scene.camera is None or scene.camera.type != "CAMERA":
            return None
        camera = scene.camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
        names.append(scene.camera.name)
        lenses.append(_lens(camera.data))
        clips.append([round(camera.data.clip_start, 6), round(camera.data.clip_end, 6)])
        # Cycles ignores scale along the camera's own axes, too.
        world_from_camera = camera.matrix_world.normalized()
        world_from_cameras[str(frame)] = [list(row) for row in world_from_camera]
        if is_taken:
            _check_pose(names[-1], frame, np.array(world_from_camera))
            moves = moves or (may_blur and _moves(scene.camera, frame))
        if lenses[-1] != lenses[0]:
            raise UserError(
                f"the camera {names[-1]} has a different lens at frame {frame} than at frame "
                f"{min(camera_frames)}, and all views of a dataset share one lens; choose frames "
                "with the same lens"
            )
    return {
        "name": names[0],
        "lens": lenses[0],
        "clip": clips[0],
        "moves": moves,
        "matrices": world_from_cameras,
    }


def _moves(camera: Any, frame: float) -> bool:
    """Return whether a camera moves while the shutter is open at a frame."""
    half = bpy.context.scene.render.motion_blur_shutter / 2
    poses = []
    for moment in (frame - half, frame + half):
        frames.go_to(moment)
        evaluated = camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
        poses.append(np.array(evaluated.matrix_world))
    return not np.allclose(poses[0], poses[1], rtol=1e-6, atol=1e-6)


def _check_pose(name: str, frame: float, world_from_camera: Floats) -> None:
    """Raise `UserError` if no view can have the matrix (4, 4) of the camera ``name`` as its pose.

    Cycles mirrors or shears the picture of such a camera, and a pose is a rotation.
    """
    turn = world_from_camera[:3, :3]
    if is_skewed(turn):
        raise UserError(
            f"the camera {name} is sheared or flat at frame {frame}, and a view's pose cannot be; "
            "give each parent one scale for all axes, or apply the scales in Blender"
        )
    if is_mirrored(turn):
        raise UserError(
            f"the camera {name} is mirrored at frame {frame}, and a view's pose cannot be; "
            "make the negative scale of the camera or its parent positive"
        )


def _lens(camera: Any) -> dict[str, Any]:
    numbers = ("lens", "sensor_width", "sensor_height", "shift_x", "shift_y")
    return {
        "type": camera.type,
        "sensor_fit": camera.sensor_fit,
        "depth_of_field": bool(camera.dof.use_dof),
        **{name: round(getattr(camera, name), 6) for name in numbers},
    }
