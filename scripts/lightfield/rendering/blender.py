"""Blender, headless: the one module of the library that imports bpy.

Opens a scene with its scripts disabled, sets Cycles up once, and renders view after view with the
scene kept in memory.
"""

import math
import os
import re
import struct
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import mathutils
import numpy as np

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField
from lightfield.imaging import images

Array = np.ndarray[Any, Any]

# In the order in which `auto` tries them.
GPU_DEVICES = ("optix", "cuda", "hip", "oneapi", "metal")

# Cycles gives this depth to a ray that hits nothing.
CYCLES_MISS = 1e10

CAMERA_NAME = "plenoforge_camera"


@dataclass(frozen=True)
class Raw:
    """One view as Cycles made it, in float32.

    ``colour`` is (height, width, 3), scene-linear; ``depth`` is (height, width) in metres, inf
    where nothing was hit: Z-depth for a perspective camera and distance for any other, or None if
    it was not asked for. ``render_seconds`` and ``synchronization_seconds`` are Cycles' own.
    ``samples``, (height, width), is how many each pixel took, and ``worked_seconds`` the processor
    time, of all threads, of those ``render_seconds``; None unless `watch_samples` asked for them.
    """

    colour: Array
    depth: Array | None
    samples: Array | None
    render_seconds: float
    worked_seconds: float | None
    synchronization_seconds: float


def new_scene() -> None:
    """Start from an empty scene with one empty world-less view layer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


def save_scene(path: Path) -> None:
    """Save the current scene as a compressed .blend without backup copies; OSError if it fails."""
    bpy.context.preferences.filepaths.save_version = 0
    try:
        with _quiet():
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, copy=True)
    except RuntimeError as error:
        raise OSError(str(error).strip()) from None
    _check_blend(path)


def _check_blend(path: Path) -> None:
    """Raise an OSError for a compressed .blend that is cut short, of which Blender says nothing.

    It ends with the table of its Zstandard frames: see "Zstandard Seekable Format" of the zstd
    project. A head of 8 bytes, 8 bytes a frame of which the first 4 are its compressed length, and
    9 bytes, which begin with the number of frames and end with a magic number.
    """
    content = path.read_bytes()
    whole = content.endswith(b"\xb1\xea\x92\x8f")
    if whole:
        count = int.from_bytes(content[-9:-5], "little")
        lengths = struct.unpack(f"<{2 * count}I", content[-9 - 8 * count : -9])[::2]
        whole = len(content) == sum(lengths) + 8 + 8 * count + 9
    if not whole:
        raise OSError("the file is cut short")


def open_scene(path: Path) -> None:
    """Open a .blend with its scripts disabled.

    Raises `UserError` if Blender cannot read it, or would lose what it does not know: where a newer
    version saved it, or a library that it links.
    """
    here = bpy.app.version_string
    try:
        with _quiet():
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise UserError(f"{path}: Blender {here} cannot open it: {str(error).strip()}") from None
    libraries = [(path_of(library), library.version) for library in bpy.data.libraries]
    for file, saved in [(path, bpy.data.version), *libraries]:
        if tuple(saved[:2]) > bpy.app.version[:2]:
            newer = f"{saved[0]}.{saved[1]}"
            raise UserError(
                f"{file}: was saved by Blender {newer}, and Blender {here} would lose what is "
                f"new in it; build with bpy {newer}, or save it with Blender "
                f"{bpy.app.version[0]}.{bpy.app.version[1]}"
            )


def set_up_render(
    settings: Mapping[str, Any],
    lightfield: LightField,
    device: str,
    threads: int,
) -> str:
    """Set Cycles up for every view that follows; returns what it renders on, CPU or GPU.

    ``settings`` is a scene YAML's ``render`` block.
    Raises `UserError` if the ``device`` is not there.
    """
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    set_sampling(settings)
    cycles.use_animated_seed = False
    cycles.time_limit = 0
    if "max_bounces" in settings:
        cycles.max_bounces = settings["max_bounces"]
    if "clamp_indirect" in settings:
        cycles.sample_clamp_indirect = settings["clamp_indirect"]
    if "filter_width" in settings:
        cycles.filter_width = settings["filter_width"]

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
    render.use_overwrite = True
    output = render.image_settings
    output.media_type = "MULTI_LAYER_IMAGE"
    output.file_format = "OPEN_EXR_MULTILAYER"
    output.color_depth = "32"
    output.exr_codec = "NONE"

    layer = _first_layer(scene)
    for name in dir(layer):
        if name.startswith("use_pass_"):
            setattr(layer, name, False)
    layer.use_pass_combined = True
    layer.use_pass_z = lightfield.depth is not None
    layer.cycles.denoising_store_passes = False
    layer.cycles.pass_debug_sample_count = False
    # Passes of the artist's own, and those of light groups.
    for group in (layer.aovs, layer.lightgroups):
        for entry in list(group):
            group.remove(entry)

    _use_device(scene, device)
    _set_camera(scene, lightfield.content)
    scene.frame_set(lightfield.frame)
    return str(cycles.device)


def set_sampling(settings: Mapping[str, Any]) -> None:
    """Set how many samples a pixel takes and what is made of them, as ``render`` blocks have it.

    ``guiding`` turns path guiding on or off; without that key it stays as the .blend has it.
    """
    cycles = bpy.context.scene.cycles
    cycles.samples = settings["samples"]
    cycles.use_adaptive_sampling = settings["adaptive_threshold"] > 0
    cycles.adaptive_threshold = settings["adaptive_threshold"]
    cycles.use_denoising = settings["denoise"]
    cycles.denoiser = "OPENIMAGEDENOISE"
    # Guided by the surfaces' albedo and normals, which are denoised themselves first.
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = "ACCURATE"
    cycles.denoising_quality = "HIGH"
    if "guiding" in settings:
        cycles.use_guiding = settings["guiding"]


def set_window(x: int, y: int, width: int, height: int) -> None:
    """Let every view that follows consist of these pixels alone, (0, 0) being the top left one."""
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    across, down = render.resolution_x, render.resolution_y
    render.border_min_x, render.border_max_x = x / across, (x + width) / across
    render.border_min_y, render.border_max_y = 1 - (y + height) / down, 1 - y / down


def watch_samples() -> None:
    """Let every view that follows say how many samples its pixels took, and the work they were."""
    _first_layer(bpy.context.scene).cycles.pass_debug_sample_count = True
    bpy.app.handlers.render_stats.append(_watch)


# What Cycles tells in its progress about the view that is being rendered, as `… | Sample 80/256`
# and at last `Finished`: when, in processor seconds, and how many samples.
_told: list[tuple[float, int]] = []


def _watch(text: str, _: Any) -> None:
    sample = re.search(r"Sample (\d+)/", text)
    if sample or text.endswith("Finished"):
        _told.append((time.process_time(), int(sample[1]) if sample else 0))


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
        with _quiet():
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


def path_of(block: Any) -> Path:
    """Return the absolute path of a data-block's file."""
    return Path(bpy.path.abspath(block.filepath, library=block.library))


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
    """Tell whether an object has any kind of ray turned on; empties stand for others."""
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


def render_view(world_matrix: Array, seed: int) -> Raw:
    """Render the view of a camera at ``world_matrix``, (4, 4) camera-to-world."""
    scene = bpy.context.scene
    scene.camera.matrix_world = mathutils.Matrix(np.asarray(world_matrix).tolist())
    scene.cycles.seed = seed
    _told.clear()
    with tempfile.TemporaryDirectory(prefix="plenoforge-", dir=_fast_folder()) as folder:
        path = Path(folder) / "view.exr"
        scene.render.filepath = str(path)
        with _quiet():
            bpy.ops.render.render(write_still=True)
        image = images.read_image(path)
    layer = _first_layer(scene).name
    depth = image.channels.get(f"{layer}.Depth.Z")
    if depth is not None:
        depth = np.where(depth >= CYCLES_MISS, np.float32(np.inf), depth)
    colour = np.stack([image.channels[f"{layer}.Combined.{c}"] for c in "RGB"], axis=-1)
    counts = image.channels.get(f"{layer}.Debug Sample Count.X")
    return Raw(
        colour=colour,
        depth=depth,
        # The pass holds each pixel's part of all samples.
        samples=None if counts is None else np.rint(counts * max(count for _, count in _told)),
        worked_seconds=_told[-1][0] - _told[0][0] if _told else None,
        render_seconds=_seconds(image.attributes[f"cycles.{layer}.render_time"]),
        synchronization_seconds=_seconds(image.attributes[f"cycles.{layer}.synchronization_time"]),
    )


def _first_layer(scene: Any) -> Any:
    """Return the one view layer that is rendered: the first that the .blend has in use."""
    layer = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
    for other in scene.view_layers:
        other.use = other == layer
    return layer


def _set_camera(scene: Any, lightfield: Mapping[str, Any]) -> None:
    """Make the camera of a lightfield.json's ``camera``, ``resolution`` and ``sensor_size``."""
    intrinsics = lightfield["camera"]
    camera = bpy.data.cameras.new(CAMERA_NAME)
    camera.type = intrinsics["type"]
    sensor_width, sensor_height = lightfield["sensor_size"]
    camera.sensor_fit = "HORIZONTAL" if sensor_width >= sensor_height else "VERTICAL"
    camera.sensor_width, camera.sensor_height = sensor_width, sensor_height
    if "principal_point" in intrinsics:
        width, height = lightfield["resolution"]
        # Blender counts a perspective camera's shift in sides of the image that sensor_fit names,
        # and a panoramic one's in widths and heights.
        side = width if sensor_width >= sensor_height else height
        across, up = (side, side) if intrinsics["type"] == "PERSP" else (width, height)
        x, y = intrinsics["principal_point"]
        camera.shift_x, camera.shift_y = (width / 2 - x) / across, (y - height / 2) / up
    # Cycles clips a perspective view between these; nothing of a scene shall be cut away.
    camera.clip_start, camera.clip_end = 1e-4, 1e9
    if intrinsics["type"] == "PERSP":
        camera.lens_unit = "MILLIMETERS"
        camera.lens = intrinsics["focal_length"]
    else:
        for name, value in intrinsics.items():
            if hasattr(camera, name) and name not in ("type", "lens"):
                setattr(camera, name, value)
    camera_object = bpy.data.objects.new(CAMERA_NAME, camera)
    camera_object.rotation_mode = "XYZ"
    scene.collection.objects.link(camera_object)
    scene.camera = camera_object


def _use_device(scene: Any, device: str) -> None:
    """Choose what Cycles renders on; a device that is asked for by name must be there."""
    if device == "cpu":
        scene.cycles.device = "CPU"
        return
    preferences = bpy.context.preferences.addons["cycles"].preferences
    for name in GPU_DEVICES if device == "auto" else (device,):
        try:
            found = list(preferences.get_devices_for_type(name.upper()) or ())
        except (TypeError, ValueError):
            found = []
        gpus = [entry for entry in found if entry.type == name.upper()]
        if gpus:
            preferences.compute_device_type = name.upper()
            for entry in preferences.devices:
                entry.use = entry.type == name.upper()
            scene.cycles.device = "GPU"
            return
    if device != "auto":
        raise UserError(
            f"device: this machine has no {device} device that Cycles can use; "
            "use device=cpu, or device=auto to take what there is"
        )
    scene.cycles.device = "CPU"


def _fast_folder() -> str | None:
    """Return a folder in memory for Cycles' own output, where the system has one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _seconds(text: images.Attribute) -> float:
    """Read a time of the form [hours:]minutes:seconds, as Cycles' header has it."""
    return math.fsum(
        float(part) * 60**power for power, part in enumerate(reversed(str(text).split(":")))
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Blender itself prints to standard output out of ours."""
    sys.stdout.flush()
    saved = os.dup(1)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(saved, 1)
            os.close(saved)
