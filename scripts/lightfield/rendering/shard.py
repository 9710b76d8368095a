"""A shard: views of a dataset that one process renders, keeping every one that is already right.

Each view is written, and its checksum logged beside the record, the moment it is done. A view whose
files, one and one for each pass, have the bytes that were logged for the render key that its
settings give is left as it is, so that a shard, killed and started again, renders only what is
missing. Its journal, one JSON line a rendered view, says what was done and how fast.
"""

import signal
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil

from lightfield.core import leftovers, processors
from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.memory import available
from lightfield.core.progress import Progress
from lightfield.dataset import keys, memory, passes
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.journal import Journal, is_suspect
from lightfield.dataset.lightfield import LightField, View
from lightfield.dataset.passes import Pass
from lightfield.dataset.records import ShardRecord
from lightfield.geometry import depth
from lightfield.geometry.flow import shorter
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images

if TYPE_CHECKING:
    from lightfield.rendering.colour_pass import Colour
    from lightfield.rendering.geometry_pass import Geometry

Array = np.ndarray[Any, Any]


def render(
    lightfield: LightField,
    views: str,
    folder: Path,
    *,
    blend: Path,
    inventory: Path | None,
    device: str,
    threads: int | None,
    record: Path | None = None,
    journal: Path | None = None,
    stall: int = 0,
) -> None:
    """Render into ``folder`` those of the ``views``, FIRST:END, that are missing there.

    Their passes go into folders beside it, with the names of what has a number in them.
    ``blend`` is the scene and ``inventory`` a JSON of what it contains; ``threads`` None are all.
    ``record`` and ``journal`` may be None. A view that takes more than ``stall`` seconds, if not
    0, ends the process by SIGALRM.
    Raises `UserError` where the scene cannot be opened, the ``device`` is not there, or a file
    cannot be written.
    """
    images.check_codec(lightfield.render.get("compression", "zip"))
    log = Journal(journal)
    sums = ShardRecord(record, folder)
    # On the machine that renders: what was killed there may fill its memory.
    leftovers.remove()
    chosen = lightfield.views[view_slice(views, len(lightfield.views))]
    wanted = lightfield.passes
    paths = {view.name: _files(folder, view, wanted) for view in chosen}
    names = [folder.parent / found.name / passes.NAMES for found in wanted if found.kind == "id"]
    names_key = keys.names_key(lightfield)
    missing = [
        view
        for view in chosen
        if not all(
            sums.is_finished(path, keys.render_key(lightfield, view)) for path in paths[view.name]
        )
    ]
    nameless = [path for path in names if not sums.is_finished(path, names_key)]
    _warn_of_other_versions(folder / f"{view.name}.exr" for view in missing)
    # The dataset's folder says which scene and rig it is, and in a sequence which frame.
    label = f"render {folder.parent}" + (f" {views}" if views != ":" else "")
    progress = Progress(len(missing), label, already=len(chosen) - len(missing))
    if missing or nameless:
        found = read_inventory(inventory, "left_out") if inventory else None
        _refuse_what_does_not_fit(blend, found or {}, lightfield)
        threads = threads or processors.available()
        # Only now, because it takes a second and a shard that is finished does not need it.
        with processors.only(threads):
            from lightfield.rendering import cycles
        used = cycles.set_up(blend, found, lightfield, device, threads)
        log.append(
            {
                "start_up_seconds": round(time.time() - log.started, 4),
                "start_up_cpu_seconds": round(time.process_time(), 4),
                "device": used,
                "threads": threads,
            }
        )
        for path in nameless:
            write_json(path, _names(path.parent.name))
            sums.add(path, names_key)
        _render_views(missing, lightfield, folder, sums, log, progress, stall)
    sums.write([*names, *(path for view in chosen for path in paths[view.name])])
    log.end()


def _files(folder: Path, view: View, wanted: Iterable[Pass]) -> list[Path]:
    """Return all files of a view: its own, and one for each pass."""
    return [
        folder / f"{view.name}.exr",
        *(found.path(folder.parent, view.name) for found in wanted),
    ]


def _names(kind: str) -> dict[str, int]:
    from lightfield.rendering import ids, instances

    return instances.shown().names if kind == "instance" else ids.names(kind)


def _refuse_what_does_not_fit(
    blend: Path, inventory: Mapping[str, Any], lightfield: LightField
) -> None:
    """Raise `UserError` where a scene, as it was measured, and a view exceed this memory."""
    lens = lightfield.lens
    denoise = lightfield.render["denoise"]
    needed = memory.needed(inventory.get("memory_bytes", 0), lens.width * lens.height, denoise)
    if needed > available():
        raise UserError(
            f"{blend}: a view of {lens.width} × {lens.height} pixels takes {needed / 1e9:.1f} GB "
            f"of memory, and this machine has {available() / 1e9:.1f} GB; render it on one that "
            "has more, or smaller, or make the scene lighter"
        )


def _warn_of_other_versions(paths: Iterable[Path]) -> None:
    """Warn if there are views that another version of bpy rendered, which are rendered again."""
    versions = [images.attribute(path, images.BPY_ATTRIBUTE) for path in paths]
    for other in sorted({str(found) for found in versions if found} - {version("bpy")}):
        print(
            f"warning: views rendered by bpy {other}, which bpy {version('bpy')} renders again: "
            f"{versions.count(other)}",
            file=sys.stderr,
        )


def _render_views(
    views: Sequence[View],
    lightfield: LightField,
    folder: Path,
    record: ShardRecord,
    journal: Journal,
    progress: Progress,
    stall: int,
) -> None:
    """Render ``views`` one after the other, in the scene that is set up for them."""
    from lightfield.rendering.colour_pass import render_colour
    from lightfield.rendering.cycles import choose_eye, machine
    from lightfield.rendering.geometry_pass import render_geometry

    rays = depth_rays(lightfield)
    blind = ~np.isfinite(lightfield.lens.pixel_rays()[..., 0]) if lightfield.transparent else None
    wanted = lightfield.passes
    seed = lightfield.render["seed"]
    compression = lightfield.render.get("compression", "zip")
    names = {found.name for found in wanted}
    has_geometry = lightfield.depth or not all(found.of_colour for found in wanted)
    made_here = {
        images.BPY_ATTRIBUTE: version("bpy"),
        images.MACHINE_ATTRIBUTE: machine(lightfield.render["denoise"]),
    }
    process = psutil.Process()
    past: list[float] = []
    progress.begin()
    for view in views:
        # The system's own timer: what hangs need not run any Python.
        signal.alarm(stall)
        began = time.perf_counter()
        began_cpu = time.process_time()
        choose_eye(view.name)
        # Of the same pose one after the other: Cycles keeps the scene as it is.
        geometry = (
            render_geometry(view.matrix, "motion" in names, "instance" in names)
            if has_geometry
            else None
        )
        geometry_seconds = time.perf_counter() - began
        colour = render_colour(
            view.matrix, keys.view_seed(seed, view.name), wanted, lightfield.transparent
        )
        if blind is not None:
            # Cycles calls opaque what the lens does not see.
            colour.pixels[blind, 3] = 0
        parts = [part for part in (geometry, colour) if part]
        channels, attributes = colour_channels(colour.pixels)
        if geometry and lightfield.depth:
            channels["Z"] = depth_channel(geometry.depth, lightfield, rays)
            attributes[images.DEPTH_ATTRIBUTE] = str(lightfield.depth)
        key = keys.render_key(lightfield, view)
        made = {images.KEY_ATTRIBUTE: key, **made_here}
        contents = [(channels, attributes)]
        contents += [pass_channels(found, geometry, colour, lightfield.lens) for found in wanted]
        for path, (channels, attributes) in zip(
            _files(folder, view, wanted), contents, strict=True
        ):
            images.write_exr(path, channels, attributes | made, compression)
            record.add(path, key)
        journal.append(
            {
                "view": view.name,
                "finished": round(time.time(), 3),
                "wall_seconds": round(time.perf_counter() - began, 4),
                "cpu_seconds": round(time.process_time() - began_cpu, 4),
                "render_seconds": round(sum(part.render_seconds for part in parts), 4),
                "synchronization_seconds": round(
                    sum(part.synchronization_seconds for part in parts), 4
                ),
                "geometry_seconds": round(geometry_seconds, 4),
                "memory_bytes": process.memory_info().rss,
            },
        )
        if is_suspect(colour.render_seconds, past):
            print(
                f"warning: {folder}/{view.name}.exr took {colour.render_seconds:.3g} s, and others "
                f"some {median(past):.3g} s: look at it",
                file=sys.stderr,
            )
        past.append(colour.render_seconds)
        progress.done()
    signal.alarm(0)


def depth_rays(lightfield: LightField) -> Array | None:
    """Return the unit rays that turn Cycles' depth into the dataset's, or None if it is that."""
    if lightfield.depth in (None, depth.conventional_depth(lightfield.lens)):
        return None
    return lightfield.lens.pixel_rays()


def colour_channels(colour: Array) -> tuple[dict[str, Array], dict[str, images.Attribute]]:
    """Turn colour (height, width, 3 or 4) into the channels and attributes of a view's EXR.

    Colour beyond the half range is clamped and counted; what is not a number is counted and kept,
    so that validation finds it.
    """
    nan = int(np.isnan(colour).sum())
    clamped = int((np.abs(colour) > images.HALF_MAX).sum())
    half = np.clip(colour, -images.HALF_MAX, images.HALF_MAX).astype(np.float16)
    channels = {name: half[:, :, index] for index, name in enumerate("RGBA"[: half.shape[2]])}
    return channels, {images.CLAMPED_ATTRIBUTE: clamped, images.NAN_ATTRIBUTE: nan}


def pass_channels(
    wanted: Pass, geometry: "Geometry | None", colour: "Colour", lens: Lens
) -> tuple[dict[str, Array], dict[str, images.Attribute]]:
    """Return the channels and attributes of the EXR of one of a view's passes.

    What is not a number is counted and becomes 0: Cycles leaves it out of the colour alone.
    """
    if wanted.kind == "matte":
        planes = np.moveaxis(colour.passes[wanted.name], -1, 0)
        named = dict(zip(wanted.channels, planes, strict=True))
        return named, passes.matte_header(colour.manifest)
    if wanted.of_colour:
        channels, attributes = colour_channels(colour.passes[wanted.name])
        return {name: np.nan_to_num(plane, nan=0) for name, plane in channels.items()}, attributes
    assert geometry
    attributes = {}
    match wanted.name:
        case "normal":
            pixels = np.nan_to_num(geometry.normal, nan=0)
            attributes[images.NAN_ATTRIBUTE] = int(np.isnan(geometry.normal).sum())
        case "object":
            pixels = geometry.objects[..., None]
        case "material":
            pixels = geometry.materials[..., None]
        case "instance":
            assert geometry.instances is not None
            pixels = geometry.instances[..., None]
        case _:
            assert geometry.motion is not None
            pixels = geometry.motion.copy()
            pixels[..., ::2] = shorter(lens, pixels[..., ::2])
    planes = np.moveaxis(pixels.astype(wanted.dtype), -1, 0)
    return dict(zip(wanted.channels, planes, strict=True)), attributes


def depth_channel(cycles_depth: Array, lightfield: LightField, rays: Array | None) -> Array:
    """Turn depth (height, width) as Cycles has it into channel Z of a view's EXR.

    ``rays`` are those of `depth_rays`.
    """
    z = cycles_depth
    if rays is not None and lightfield.depth == "z":
        z = depth.z_from_distance(z, rays)
    elif rays is not None:
        z = depth.distance_from_z(z, rays)
    # Outside the image circle there is no ray; nothing was hit there.
    z = np.where(np.isnan(z), np.inf, z)
    return depth.with_precision(z, lightfield.render["depth_precision"])
