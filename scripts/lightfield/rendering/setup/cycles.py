"""Sets Cycles up once for all views of a light field: sampling, device, camera, passes."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import bpy

from lightfield.core import gpus
from lightfield.core.errors import OutsideError, UserError
from lightfield.core.machine import describe
from lightfield.core.names import FILE
from lightfield.formats.lightfield import OMNIDIRECTIONAL, LightField
from lightfield.formats.passes import AOV_PREFIX, GROUP_PREFIX, Pass
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.base import RadialLens
from lightfield.geometry.rigs.rig import EYES
from lightfield.planning.cost import TILE_SIDE
from lightfield.rendering.scenes import (
    animation,
    blend_file,
    frames,
    ids,
    instances,
    namesakes,
    volumes,
)
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.setup import (
    drawings,
    followed_camera,
    lens_shader,
    light_groups,
    motion_blur,
    moving_camera,
    principled_passes,
    pruning,
    shadow_catchers,
)
from lightfield.stages.measurement import RENDERS_ON, CheckDevice

# `auto` tries the kinds of GPU in this order.
_GPU_DEVICES = ("optix", "cuda", "hip", "oneapi", "metal")

_CAMERA_NAME = "plenoforge_camera"

# Cycles' settings by the keys of ``render`` blocks. Without a key, the .blend's value stays.
SAMPLING = {
    "max_bounces": "max_bounces",
    "clamp_indirect": "sample_clamp_indirect",
    "light_tree": "use_light_tree",
    "guiding": "use_guiding",
}

# Prefixes of the passes that a scene lacks until they are added: the passes of light groups, and
# the passes that materials write.
_ADDED_PASSES = (GROUP_PREFIX, AOV_PREFIX)


def set_up(
    blend: Path,
    inventory: Mapping[str, Any] | None,
    lightfield: LightField,
    device: str,
    threads: int,
) -> OpenScene:
    """Open a scene and set it up for the views of a light field.

    Leaves out what no pixel depends on, according to the scene's ``inventory``. Raises `UserError`
    if the scene cannot be opened, or if the ``device`` is missing.
    """
    left_out = inventory["left_out"] if inventory else []
    blend_file.open_scene(blend, lightfield.content.get("scene", {}), inventory)
    passes = lightfield.passes
    numbered = [each.name for each in passes if each.kind == "id"]
    if inventory and "hidden_objects" in left_out:
        pruning.remove_objects(inventory["hidden"])
    elif numbered and not inventory:
        # Remove the same objects as with an inventory, so that the numbers are the same.
        pruning.remove_objects(pruning.removable_objects())
    scene = bpy.context.scene
    # A marker may choose the artist's camera at this frame. Remove all markers' cameras afterwards.
    frames.go_to(lightfield.frame)
    numbers = ids.assign({"object" if kind == "instance" else kind for kind in numbered})
    focused = scene.camera if lightfield.render.depth_of_field else None
    file_camera = scene.camera
    if file_camera and lightfield.content.get("scene", {}).get("followed_camera") == FILE:
        followed_camera.freeze(file_camera)
    for marker in scene.timeline_markers:
        marker.camera = None
    # Settings that are not set below keep their values of this frame.
    animation.mute(scene, ("render.", "cycles."))
    scene.render.engine = "CYCLES"
    _set_quality(lightfield.render)
    _set_output(scene, lightfield, threads)
    _set_passes(scene, passes)
    shadow_catchers.check(passes)
    principled_passes.set_up(view_layer(scene), passes)
    if groups := lightfield.render.emitters_of_groups:
        light_groups.set_up(view_layer(scene), groups)
    shader_lens = _shader_lens(lightfield)
    _use_device(scene, device)
    if shader_lens:
        _check_shader_device(scene, shader_lens)
    _set_camera(scene, lightfield.content, shader_lens)
    drawings.set_up(view_layer(scene), scene.camera.data.type, bool(groups))
    _hide_empty_point_clouds()
    shares_names = namesakes.shown() if any(each.kind == "matte" for each in passes) else []
    only_volumes = volumes.alone()
    shown_instances = None
    if "instance" in numbered:
        instances.write_numbers(view_layer(scene))
        shown_instances = instances.shown(numbers["object"])
    if OMNIDIRECTIONAL in lightfield.content:
        _set_eyes(scene, lightfield.content[OMNIDIRECTIONAL])
    if focused:
        _set_focus(scene.camera.data, focused, shader_lens)
    if file_camera and lightfield.follows_views:
        followed_camera.follow_views(file_camera, scene.camera)
    if any(each.kind == "motion" for each in passes):
        left_out = [name for name in left_out if name != "animation"]
    pruning.leave_out(left_out)
    motion = lightfield.render.camera_motion
    if motion:
        moving_camera.blur(motion)
    return OpenScene(
        device=str(scene.cycles.device),
        numbers=numbers,
        instances=shown_instances,
        namesakes=shares_names,
        volumes=only_volumes,
        motion=motion,
        shader_lens=shader_lens,
    )


def _hide_empty_point_clouds() -> None:
    """Hide point clouds without points. They show nothing, but Cycles of Blender 5.0 crashes."""
    for obj in bpy.data.objects:
        if obj.type == "POINTCLOUD" and not obj.data.points and not obj.modifiers:
            obj.hide_render = True


def _set_quality(settings: RenderBlock) -> None:
    """Apply a dataset's ``render`` block. All else stays as in the .blend."""
    set_sampling(settings)
    cycles = bpy.context.scene.cycles
    cycles.use_animated_seed = False
    cycles.time_limit = 0
    cycles.use_layer_samples = "IGNORE"
    cycles.use_sample_subset = False
    # A switch for debugging moves all rays of a sample away from the centres of the pixels.
    if hasattr(cycles, "use_pixel_jitter"):  # Blender 5.0 lacks it.
        cycles.use_pixel_jitter = False
    # Culling would leave other objects out of each view, and out of its reflections and shadows.
    cycles.use_camera_cull = False
    cycles.use_distance_cull = False
    if settings.filter_width is not None:
        cycles.filter_width = settings.filter_width
    motion_blur.centre()
    if settings.motion_blur is not None:
        motion_blur.turn(settings.motion_blur)


def _set_output(scene: Any, lightfield: LightField, threads: int) -> None:
    """Make Cycles keep the scene in memory, and write all passes in full, as 32-bit floats."""
    render = scene.render
    render.use_persistent_data = True
    render.threads_mode = "FIXED"
    render.threads = threads
    render.resolution_x = lightfield.lens.width
    render.resolution_y = lightfield.lens.height
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1
    render.use_border = False
    render.use_multiview = False
    render.use_compositing = False
    render.use_sequencer = False
    render.use_freestyle = False
    # Blender would burn the file's name, the frame and the like into the pixels.
    render.use_stamp = False
    render.film_transparent = lightfield.transparent
    # Larger views take less memory in tiles, and show the same.
    scene.cycles.use_auto_tile = True
    scene.cycles.tile_size = TILE_SIDE
    render.use_overwrite = True
    output = render.image_settings
    output.media_type = "MULTI_LAYER_IMAGE"
    output.file_format = "OPEN_EXR_MULTILAYER"
    output.color_depth = "32"
    output.exr_codec = "NONE"


def _set_passes(scene: Any, passes: Iterable[Pass]) -> None:
    """Turn on colour and the passes of Cycles that ``passes`` need, and turn all others off.

    If there are ``passes``, geometry and colour use the same passes of Cycles. Cycles keeps the
    scene, and confuses passes if some come and go: with denoising, normals and numbers.
    """
    layer = view_layer(scene)
    for owner in (layer, layer.cycles):
        for name in dir(owner):
            if name.startswith("use_pass_"):
                setattr(owner, name, False)
    needed = [name for each in passes for name in each.needed]
    built_in = [name for name in needed if not name.startswith(_ADDED_PASSES)]
    for name in ("Combined", *built_in, *(("Depth",) if needed else ())):
        setattr(*pass_property(layer, name), True)
    # A cryptomatte pass holds two objects: 6 gives three passes.
    layer.pass_cryptomatte_depth = 6
    layer.cycles.denoising_store_passes = False
    layer.cycles.pass_debug_sample_count = False
    # Remove the artist's own passes and light groups.
    for group in (layer.aovs, layer.lightgroups):
        for entry in list(group):
            group.remove(entry)


def pass_property(layer: Any, name: str) -> tuple[Any, str]:
    """Return the property that turns a pass of Cycles on: its owner and its name."""
    owner = layer.cycles if name.startswith("Volume ") else layer
    if name.startswith("CryptoObject"):
        return owner, "use_pass_cryptomatte_object"
    short = {"Depth": "z", "Emission": "emit"}.get(name, name.lower().replace(" ", "_"))
    return owner, f"use_pass_{short}"


def set_sampling(settings: RenderBlock) -> None:
    """Set sampling and denoising, by a ``render`` block."""
    cycles = bpy.context.scene.cycles
    cycles.samples = settings.samples
    cycles.use_adaptive_sampling = settings.adaptive_threshold > 0
    cycles.adaptive_threshold = settings.adaptive_threshold
    cycles.use_denoising = settings.denoise
    # The scene decides. A view layer may leave denoising out on its own.
    view_layer(bpy.context.scene).cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    # Denoise with albedo and normals, which are denoised themselves first.
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = (settings.denoise_prefilter or "accurate").upper()
    cycles.denoising_quality = (settings.denoise_quality or "high").upper()
    for name, attribute in SAMPLING.items():
        value = getattr(settings, name)
        if value is not None:
            setattr(cycles, attribute, value)


def sampling() -> dict[str, Any]:
    """Return the sampling of the open scene, by the keys of a ``render`` block."""
    cycles = bpy.context.scene.cycles
    return {name: getattr(cycles, attribute) for name, attribute in SAMPLING.items()}


def set_window(x: int, y: int, width: int, height: int) -> None:
    """Render only these pixels of all following views. (0, 0) is the top left pixel."""
    render = bpy.context.scene.render
    render.use_border = True
    render.use_crop_to_border = True
    across = render.resolution_x
    down = render.resolution_y
    bottom = down - y - height
    # Blender computes the border in float32, and rounds it down to whole pixels. Half a pixel more
    # keeps the rounding away from the next lower pixel.
    render.border_min_x = (x + 0.5) / across
    render.border_max_x = (x + width + 0.5) / across
    render.border_min_y = (bottom + 0.5) / down
    render.border_max_y = (bottom + height + 0.5) / down


def check_device(job: CheckDevice) -> None:
    """Print the GPUs that a device means. Raise `UserError` if this machine has no such device."""
    if kind := gpu(job.device):
        models = _models(kind)
        used = "the GPU" if len(models) == 1 else f"{len(models)} GPUs:"
        print(
            f"{RENDERS_ON}{used} {' + '.join(models)} "
            f"(device={job.device}; device=cpu for the processor)"
        )


def gpu(device: str) -> str | None:
    """Return Cycles' name for the kind of GPU that a ``device`` means, or None for the processor.

    "gpu" means any kind. Raises `UserError` if the machine has no such GPU.
    """
    preferences = bpy.context.preferences.addons["cycles"].preferences
    for name in {"auto": _GPU_DEVICES, "gpu": _GPU_DEVICES, "cpu": ()}.get(device, (device,)):
        try:
            entries = list(preferences.get_devices_for_type(name.upper()) or ())
        except (TypeError, ValueError):
            continue
        if any(entry.type == name.upper() for entry in entries):
            return name.upper()
    if device == "gpu":
        raise OutsideError(
            f"device: this machine has no GPU that Cycles can use ({', '.join(_GPU_DEVICES)}), so "
            "there is nothing to check"
        )
    if device not in ("auto", "cpu"):
        raise OutsideError(
            f"device: this machine has no {device} device that Cycles can use; "
            "use device=cpu, or device=auto to use the best device here"
        )
    return None


def device_name(device: str) -> str:
    """Return the name of a ``device`` on this machine: cpu, or the kind and model of the GPU.

    Raises `UserError` if the machine has no such GPU.
    """
    kind = _gpu_of_this_process(device)
    if not kind:
        return "cpu"
    return " ".join([kind, *_models(kind)])


def _models(kind: str) -> list[str]:
    """Return the model of each GPU of a kind that Cycles sees."""
    entries = bpy.context.preferences.addons["cycles"].preferences.get_devices_for_type(kind)
    return sorted(entry.name for entry in entries if entry.type == kind)


def _gpu_of_this_process(device: str) -> str | None:
    """Return the kind of GPU that a ``device`` means, as `gpu` does.

    This process takes a GPU that no other process renders on.
    """
    candidates = gpus.visible(device)
    if len(candidates) > 1:
        # Take the GPU before Cycles looks for GPUs for the first time.
        gpus.use_one(candidates)
    kind = gpu(device)
    if kind:
        gpus.use_one(candidates)
    return kind


def _use_device(scene: Any, device: str) -> None:
    """Select Cycles' device, also for denoising. Raises `UserError` if a named one is missing."""
    kind = _gpu_of_this_process(device)
    scene.cycles.device = "GPU" if kind else "CPU"
    scene.cycles.denoising_use_gpu = kind is not None
    if kind:
        preferences = bpy.context.preferences.addons["cycles"].preferences
        preferences.compute_device_type = kind
        for entry in preferences.devices:
            entry.use = entry.type == kind


def machine(denoise: bool) -> str:
    """Describe the processor, and the GPU if Cycles uses one, which affect the pixels' bytes."""
    processor = describe(denoise)
    models = used_gpus()
    if not models:
        return processor
    preferences = bpy.context.preferences.addons["cycles"].preferences
    return f"{preferences.compute_device_type} {' + '.join(models)}, {processor}"


def used_gpus(*kinds: str) -> list[str]:
    """Return the models of the GPUs on which Cycles renders. ``kinds`` limits them to these."""
    if bpy.context.scene.cycles.device == "CPU":
        return []
    preferences = bpy.context.preferences.addons["cycles"].preferences
    used = [entry for entry in preferences.devices if entry.use]
    return sorted({entry.name for entry in used if not kinds or entry.type in kinds})


def _shader_lens(lightfield: LightField) -> RadialLens | None:
    """Return the lens if Cycles lacks it, so that a shader renders it. Or None."""
    lens = lightfield.lens
    if lens.in_cycles:
        return None
    if not isinstance(lens, RadialLens):
        raise UserError(f"camera: nothing renders a {lens.title}; reproject views of another lens")
    return lens


def _check_shader_device(scene: Any, lens: Lens) -> None:
    """Raise `UserError` if the device cannot run the shader of a lens."""
    kind = bpy.context.preferences.addons["cycles"].preferences.compute_device_type
    if scene.cycles.device == "GPU" and kind != lens_shader.GPU:
        raise UserError(
            f"device: {kind.lower()} cannot render the lens {lens.name!r}, which only "
            f"{lens_shader.GPU.lower()} and cpu can; use one of them, or render an equidistant "
            "lens and reproject it"
        )


def _set_camera(scene: Any, lightfield: Mapping[str, Any], shader_lens: RadialLens | None) -> None:
    """Set the camera up from the ``camera`` and the sizes in a lightfield.json.

    A shader makes it see through ``shader_lens``, if there is one.
    """
    camera = bpy.data.cameras.new(_CAMERA_NAME)
    # Cycles clips a perspective view at these distances. They must not cut anything away.
    camera.clip_start = 1e-4
    camera.clip_end = 1e9
    if shader_lens:
        lens_shader.see_through(camera, shader_lens)
    else:
        _set_native_lens(camera, lightfield)
    camera_object = bpy.data.objects.new(_CAMERA_NAME, camera)
    camera_object.rotation_mode = "XYZ"
    scene.collection.objects.link(camera_object)
    scene.camera = camera_object


def _set_native_lens(camera: Any, lightfield: Mapping[str, Any]) -> None:
    """Give a camera a lens of Cycles, from the ``camera`` and the sizes in a lightfield.json."""
    intrinsics = lightfield["camera"]
    camera.type = intrinsics["type"]
    sensor_width, sensor_height = lightfield["sensor_size"]
    camera.sensor_fit = "HORIZONTAL" if sensor_width >= sensor_height else "VERTICAL"
    camera.sensor_width = sensor_width
    camera.sensor_height = sensor_height
    if "principal_point" in intrinsics:
        width, height = lightfield["resolution"]
        # The unit of a perspective camera's shift is the side of the image that sensor_fit names.
        # The units of a panoramic camera's shift are the width and the height.
        side = width if sensor_width >= sensor_height else height
        across, up = (side, side) if intrinsics["type"] == "PERSP" else (width, height)
        x, y = intrinsics["principal_point"]
        camera.shift_x = (width / 2 - x) / across
        camera.shift_y = (y - height / 2) / up
    if intrinsics["type"] == "PERSP":
        camera.lens_unit = "MILLIMETERS"
        camera.lens = intrinsics["focal_length"]
    else:
        for name, value in intrinsics.items():
            if hasattr(camera, name) and name not in ("type", "lens"):
                setattr(camera, name, value)


def _set_eyes(scene: Any, distance: float) -> None:
    """Make the camera a stereo pair for omnidirectional stereo, ``distance`` metres apart."""
    scene.render.use_multiview = True
    scene.render.views_format = "STEREO_3D"
    views = scene.render.views
    for eye in EYES:
        # The artist may have renamed it.
        if eye not in views:
            views.new(eye)
    views["right"].use = False
    eyes = scene.camera.data.stereo
    eyes.use_spherical_stereo = True
    eyes.use_pole_merge = False
    eyes.interocular_distance = distance
    eyes.convergence_mode = "PARALLEL"
    eyes.pivot = "CENTER"


def choose_eye(name: str) -> None:
    """Let the next render show what the eye in the view's ``name`` sees, if the rig has eyes."""
    render = bpy.context.scene.render
    for eye in EYES if render.use_multiview else ():
        render.views[eye].use = name.endswith(f"_{eye}")


def _set_focus(lens: Any, camera: Any, shader_lens: RadialLens | None) -> None:
    """Give a camera the aperture and focus of the artist's ``camera`` at the current frame."""
    evaluated = camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    if lens.type != "PERSP":
        # Cycles uses a panorama's focal length only for the width of the aperture.
        lens.lens = evaluated.lens
    if shader_lens:
        lens_shader.set_focal_length(lens, shader_lens, evaluated.lens)
    for name in ("aperture_fstop", "aperture_blades", "aperture_rotation", "aperture_ratio"):
        setattr(lens.dof, name, getattr(evaluated.dof, name))
    lens.dof.focus_object = camera.data.dof.focus_object
    lens.dof.focus_subtarget = camera.data.dof.focus_subtarget
    lens.dof.focus_distance = evaluated.dof.focus_distance
    lens.dof.use_dof = True


def view_layer(scene: Any) -> Any:
    """Return the view layer to render: the first that the .blend uses. Turn all others off."""
    layer = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
    for other in scene.view_layers:
        other.use = other == layer
    return layer
