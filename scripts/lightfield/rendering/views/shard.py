"""Renders a shard: some views of a dataset, in one process.

It writes each view as soon as the view is rendered, and notes the checksums of its files in the
shard's receipt. A view has one file, and one for each pass. A view is finished if its files have
the bytes that the receipt has for the view's current render key. Finished views are kept: a killed
shard renders only the missing views. The receipt's history gets a line for each rendered view: when
it was finished, and how long it took.
"""

import signal
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil

from lightfield.configuration import keys
from lightfield.core import gpus, leftovers, processors, units
from lightfield.core.cli import view_slice
from lightfield.core.errors import OutsideError
from lightfield.core.files import write_json
from lightfield.core.memory import available
from lightfield.core.progress import Progress
from lightfield.core.units import duration
from lightfield.formats import passes
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import Pass
from lightfield.geometry import depth
from lightfield.geometry.flow import shorter
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.planning.cost import rendering_memory
from lightfield.stages.views import RenderShard
from lightfield.workflow import shard_log
from lightfield.workflow.history import History, is_suspect

if TYPE_CHECKING:
    from lightfield.rendering.scenes.open_scene import OpenScene
    from lightfield.rendering.views.colour_pass import Colour
    from lightfield.rendering.views.geometry_pass import ViewGeometry

Array = np.ndarray[Any, Any]


def render(job: RenderShard) -> None:
    """Render the chosen views that are missing.

    Passes go into folders beside the views' folder. So do the names of the objects, materials and
    instances that passes number. A view that takes too long ends the process by SIGALRM.

    Raises `UserError` if the scene cannot be opened, if the device is missing, or if a file cannot
    be written.
    """
    lightfield = LightField.read(job.lightfield)
    folder = job.output
    images.check_codec("render.compression", lightfield.render.compression or "zip")
    # Remove leftovers on the render node: shared memory of killed jobs may fill its RAM.
    leftovers.remove()
    history = History()
    chosen_views = lightfield.views[view_slice(job.views, len(lightfield.views))]
    missing_views = [view for view in chosen_views if not _is_finished(view, lightfield, folder)]
    name_files = _name_files(lightfield, folder)
    names_key = keys.names_key(lightfield)
    missing_name_files = [path for path in name_files if not shard_log.is_finished(path, names_key)]
    _warn_of_other_versions(folder / f"{view.name}.exr" for view in missing_views)
    # The dataset's folder names the scene and the rig, and the frame of a sequence.
    label = f"render {folder.parent}" + (f" {job.views}" if job.views != ":" else "")
    progress = Progress(len(missing_views), label, already=len(chosen_views) - len(missing_views))
    if missing_views or missing_name_files:
        opened = _open_scene(job, lightfield, history)
        for path in missing_name_files:
            write_json(path, opened.names(path.parent.name))
            shard_log.add(path, names_key)
        _render_views(opened, missing_views, lightfield, folder, progress, job.stall)
    history.end()


def _is_finished(view: View, lightfield: LightField, folder: Path) -> bool:
    """Return whether all files of a view are finished, with its render key."""
    key = keys.render_key(lightfield, view)
    return all(shard_log.is_finished(path, key) for path in _files(folder, view, lightfield.passes))


def _files(folder: Path, view: View, view_passes: Iterable[Pass]) -> list[Path]:
    """Return all files of a view: its own, and one for each pass."""
    return [
        folder / f"{view.name}.exr",
        *(view_pass.path(folder.parent, view.name) for view_pass in view_passes),
    ]


def _name_files(lightfield: LightField, folder: Path) -> list[Path]:
    """Return the files with the names of the numbered objects, materials and instances."""
    return [
        folder.parent / view_pass.name / passes.NAMES
        for view_pass in lightfield.passes
        if view_pass.kind == "id"
    ]


def _open_scene(job: RenderShard, lightfield: LightField, history: History) -> "OpenScene":
    """Open the scene in Blender, set Cycles up, and note how long that took."""
    contents = read_inventory(job.inventory, "left_out") if job.inventory else None
    _check_memory(job.blend, contents or {}, lightfield)
    threads = job.threads or processors.available()
    # A finished shard does not import Blender, which takes a second.
    with processors.only(threads):
        from lightfield.rendering.setup import cycles
        from lightfield.rendering.views import gpu_kernels
    # An earlier shard of this process may have waited for the GPU.
    waited_before = gpus.waited_seconds()
    opened = cycles.set_up(job.blend, contents, lightfield, job.device, threads)
    waited = gpus.waited_seconds() - waited_before
    waited += gpu_kernels.compile_first(opened, lightfield.views[0].world_from_camera)
    start = {
        "start_up_seconds": round(time.time() - history.started - waited, 4),
        "start_up_cpu_seconds": round(time.process_time(), 4),
        "device": opened.device,
        "threads": threads,
    }
    if opened.device != "CPU":
        # For its GPU, and for Cycles' kernels.
        start["waited_seconds"] = round(waited, 4)
    shard_log.log(start)
    return opened


def _check_memory(blend: Path, inventory: Mapping[str, Any], lightfield: LightField) -> None:
    """Raise `UserError` if the scene and a view need more memory than the machine has.

    The inventory has the measured memory of the scene.
    """
    lens = lightfield.lens
    denoise = lightfield.render.denoise
    scene = inventory.get("memory_bytes", 0)
    groups = len(lightfield.light_groups)
    needed = rendering_memory(scene, lens.width * lens.height, denoise, groups)
    if needed > available():
        raise OutsideError(
            f"{blend}: a view of {lens.width} × {lens.height} pixels takes {units.size(needed)} "
            f"of memory, and this machine has {units.size(available())}; render it on a "
            "machine with more memory, lower the resolution, or make the scene lighter"
        )


def _warn_of_other_versions(paths: Iterable[Path]) -> None:
    """Warn of views that another version of bpy rendered, and that this run renders again."""
    versions = [images.attribute(path, images.BPY_ATTRIBUTE) for path in paths]
    for other in sorted({str(name) for name in versions if name} - {version("bpy")}):
        print(
            f"warning: views rendered by bpy {other}, which bpy {version('bpy')} renders again: "
            f"{versions.count(other)}",
            file=sys.stderr,
        )


def _render_views(
    opened: "OpenScene",
    views: Sequence[View],
    lightfield: LightField,
    folder: Path,
    progress: Progress,
    stall: int,
) -> None:
    """Render ``views`` one after the other in the open scene. Write and note each.

    A thread writes each view while Cycles renders the next, so that a GPU does not wait.
    """
    from lightfield.rendering.setup import holdouts, shadow_catchers

    visible = _visible_places(lightfield)
    catches = lightfield.transparent and bool(shadow_catchers.names())
    has_holdouts = holdouts.exist()
    files = _ViewFiles(lightfield, folder, progress)
    progress.begin()
    with ThreadPoolExecutor(max_workers=1) as writer:
        written: Future[None] | None = None
        for view in views:
            # Use a timer of the system, because a process that hangs may run no Python.
            signal.alarm(stall)
            rendered = _render_view(
                opened, view, lightfield, visible, catches=catches, has_holdouts=has_holdouts
            )
            # Hold at most two views in memory. An error in writing ends the shard here.
            if written:
                written.result()
            written = writer.submit(files.finish, view, rendered)
        if written:
            written.result()
    signal.alarm(0)


@dataclass(frozen=True)
class _Rendered:
    """One view as Cycles rendered it. ``geometry`` is None if neither depth nor a pass needs it.

    ``geometry_seconds`` is the time of the geometry's render. ``unshown_pixels`` is the number of
    pixels in which `unshown` left a surface out, or of all without depth if a holdout may be in
    them. None if the scene has neither shadow catchers nor holdouts.
    """

    colour: "Colour"
    geometry: "ViewGeometry | None"
    geometry_seconds: float
    unshown_pixels: int | None

    @property
    def seconds(self) -> dict[str, float]:
        """The figures of the history, in seconds."""
        parts = [part for part in (self.geometry, self.colour) if part]
        return {
            "render_seconds": round(sum(part.render_seconds for part in parts), 4),
            "synchronization_seconds": round(
                sum(part.synchronization_seconds for part in parts), 4
            ),
            "geometry_seconds": round(self.geometry_seconds, 4),
        }


def _visible_places(lightfield: LightField) -> Array | None:
    """Return the places between which views can show something. None if they show the whole."""
    from lightfield.rendering.views import visible_part

    return visible_part.places() if keys.renders_part(lightfield) else None


def _render_view(
    opened: "OpenScene",
    view: View,
    lightfield: LightField,
    visible: Array | None,
    *,
    catches: bool,
    has_holdouts: bool,
) -> _Rendered:
    """Render the geometry of a view, if depth or a pass needs it, and then its colour.

    ``visible`` are the places from `_visible_places`. ``catches`` says whether the view is
    transparent and the scene has shadow catchers, and ``has_holdouts`` whether the scene may have
    holdouts.
    """
    from lightfield.rendering.setup.cycles import choose_eye
    from lightfield.rendering.views import unshown, visible_part
    from lightfield.rendering.views.colour_pass import render_colour
    from lightfield.rendering.views.geometry_pass import render_geometry

    view_passes = lightfield.passes
    names = [view_pass.name for view_pass in view_passes if not view_pass.of_colour]
    began = time.perf_counter()
    choose_eye(view.name)
    part = visible_part.choose(visible, view.world_from_camera, lightfield.lens)
    # Render both at the same pose, one after the other, so that Cycles does not update the scene.
    geometry = None
    if lightfield.depth or names:
        geometry = render_geometry(opened, view.world_from_camera, names, alpha=catches)
    geometry_seconds = time.perf_counter() - began
    seed = keys.view_seed(lightfield.render.seed, view.name)
    pose = view.world_from_camera
    colour = render_colour(opened, pose, seed, view_passes, lightfield.transparent)
    unshown_pixels = None
    if catches:
        colour, geometry, unshown_pixels = unshown.left_out(colour, geometry, view_passes)
    if geometry and has_holdouts:
        unshown_pixels = int(np.isinf(geometry.depth).sum())
    if part:
        colour = replace(colour, pixels=part.in_whole(colour.pixels, 0))
        geometry = geometry and replace(geometry, depth=part.in_whole(geometry.depth, np.inf))
    return _Rendered(colour, geometry, geometry_seconds, unshown_pixels)


class _ViewFiles:
    """Writes the files of rendered views into ``folder`` and beside it, and notes them.

    The seconds of a view count from the view before, so that the seconds of all views add up.
    """

    def __init__(self, lightfield: LightField, folder: Path, progress: Progress) -> None:
        from lightfield.rendering.setup.cycles import machine

        self.lightfield = lightfield
        self.folder = folder
        self.progress = progress
        self.process = psutil.Process()
        self.earlier_seconds: list[float] = []
        self.depth_rays = depth_rays(lightfield)
        if lightfield.transparent:
            self.pixels_without_ray = ~np.isfinite(lightfield.lens.pixel_rays()[..., 0])
        self.compression = lightfield.render.compression or "zip"
        self.attributes = {
            images.BPY_ATTRIBUTE: version("bpy"),
            images.MACHINE_ATTRIBUTE: machine(lightfield.render.denoise),
        }
        self.finished = time.perf_counter()
        self.finished_cpu = time.process_time()

    def finish(self, view: View, rendered: _Rendered) -> None:
        """Write and note the view, and its line of the history. Warn if it was too fast."""
        self._write(view, rendered)
        before, before_cpu = self.finished, self.finished_cpu
        self.finished, self.finished_cpu = time.perf_counter(), time.process_time()
        shard_log.log(
            {
                "view": view.name,
                "finished": round(time.time(), 3),
                "wall_seconds": round(self.finished - before, 4),
                "cpu_seconds": round(self.finished_cpu - before_cpu, 4),
                **rendered.seconds,
                "memory_bytes": self.process.memory_info().rss,
            },
        )
        seconds = rendered.colour.render_seconds
        if is_suspect(seconds, self.earlier_seconds):
            print(
                f"warning: {self.folder}/{view.name}.exr took {duration(seconds)}, but other views "
                f"about {duration(median(self.earlier_seconds))}; check this view",
                file=sys.stderr,
            )
        self.earlier_seconds.append(seconds)
        self.progress.done()

    def _write(self, view: View, rendered: _Rendered) -> None:
        """Write and note the view's own file, and one for each pass."""
        lightfield = self.lightfield
        colour = rendered.colour
        geometry = rendered.geometry
        if lightfield.transparent:
            # Cycles makes pixels opaque if the lens has no ray for them.
            colour.pixels[self.pixels_without_ray, 3] = 0
        channels, attributes = colour_channels(colour.pixels)
        if geometry and lightfield.depth:
            channels["Z"] = depth_channel(geometry.depth, lightfield, self.depth_rays)
            attributes[images.DEPTH_ATTRIBUTE] = str(lightfield.depth)
            if rendered.unshown_pixels is not None:
                attributes[images.UNSHOWN_ATTRIBUTE] = rendered.unshown_pixels
        contents = [(channels, attributes)]
        contents += [
            pass_channels(view_pass, geometry, colour, lightfield.lens)
            for view_pass in lightfield.passes
        ]
        key = keys.render_key(lightfield, view)
        view_attributes = {images.KEY_ATTRIBUTE: key, **self.attributes}
        paths = _files(self.folder, view, lightfield.passes)
        for path, (channels, attributes) in zip(paths, contents, strict=True):
            images.write_exr(path, channels, attributes | view_attributes, self.compression)
            shard_log.add(path, key)


def depth_rays(lightfield: LightField) -> Array | None:
    """Return the unit rays (height, width, 3) that convert Cycles' depth to the dataset's.

    Return None if no conversion is needed.
    """
    if lightfield.depth in (None, depth.conventional_depth(lightfield.lens)):
        return None
    return lightfield.lens.pixel_rays()


def colour_channels(colour: Array) -> tuple[dict[str, Array], dict[str, images.Attribute]]:
    """Turn colour (height, width, 3 or 4) into the channels and attributes of a view's EXR.

    Values beyond the half range are clamped and counted. NaNs are counted and kept, so that
    validation finds them.
    """
    nan = int(np.isnan(colour).sum())
    clamped = int((np.abs(colour) > images.HALF_MAX).sum())
    half = np.clip(colour, -images.HALF_MAX, images.HALF_MAX).astype(np.float16)
    channels = {name: half[:, :, index] for index, name in enumerate("RGBA"[: half.shape[2]])}
    return channels, {images.CLAMPED_ATTRIBUTE: clamped, images.NAN_ATTRIBUTE: nan}


def pass_channels(
    view_pass: Pass, geometry: "ViewGeometry | None", colour: "Colour", lens: Lens
) -> tuple[dict[str, Array], dict[str, images.Attribute]]:
    """Return the channels and attributes of the EXR of one of a view's passes.

    NaNs are counted and become 0: Cycles leaves them out of the colour, but not out of passes.
    """
    if view_pass.kind == "matte":
        planes = np.moveaxis(colour.passes[view_pass.name], -1, 0)
        named = dict(zip(view_pass.channels, planes, strict=True))
        return named, passes.matte_header(colour.manifest)
    if view_pass.kind in ("light", "value"):
        channels, attributes = colour_channels(colour.passes[view_pass.name])
        numbers = [np.nan_to_num(plane, nan=0) for plane in channels.values()]
        return dict(zip(view_pass.channels, numbers, strict=True)), attributes
    attributes = {}
    of_view = colour if view_pass.of_colour else geometry
    assert of_view
    pixels = np.atleast_3d(of_view.passes[view_pass.name])
    if view_pass.kind in ("normal", "variance"):
        attributes[images.NAN_ATTRIBUTE] = int(np.isnan(pixels).sum())
        pixels = np.nan_to_num(pixels, nan=0)
    elif view_pass.kind == "motion":
        pixels = pixels.copy()
        pixels[..., ::2] = shorter(lens, pixels[..., ::2])
    planes = np.moveaxis(pixels.astype(view_pass.dtype), -1, 0)
    return dict(zip(view_pass.channels, planes, strict=True)), attributes


def depth_channel(cycles_depth: Array, lightfield: LightField, rays: Array | None) -> Array:
    """Turn Cycles' depth (height, width) in metres into channel Z of a view's EXR.

    ``rays`` come from `depth_rays`.
    """
    z = cycles_depth
    if rays is not None:
        assert lightfield.depth
        z = depth.converted(z, rays, depth.conventional_depth(lightfield.lens), lightfield.depth)
    # Outside the image circle there is no ray, and a pixel without a ray hits nothing.
    z = np.where(np.isnan(z), np.inf, z)
    return depth.with_precision(z, lightfield.render.depth_precision)
