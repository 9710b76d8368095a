"""Renders the colour of a view, with the samples of the scene YAML."""

import re
import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import bpy
import mathutils
import numpy as np

from lightfield.formats.passes import VARIANCE, Pass
from lightfield.imaging.images import Attribute
from lightfield.rendering.scenes import namesakes
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.scenes.render_graph import changed
from lightfield.rendering.setup.cycles import view_layer
from lightfield.rendering.views import sample_parts
from lightfield.rendering.views.view import Array, Rendered, render_view

_COUNTS = "Debug Sample Count"
# For a matte without colour.
_MATTE_SAMPLING = {"max_bounces": 0, "use_adaptive_sampling": False, "use_denoising": False}


@dataclass(frozen=True)
class Colour:
    """The colour of a view.

    - ``pixels`` (height, width, 3 or 4): float32, linear Rec. 709, alpha associated.
    - ``passes``: the requested passes by name, each like ``pixels``.
    - ``manifest``: the hashes of the objects in a matte.
    - ``samples`` (height, width): the samples of each pixel. None without `watch_samples`.
    - ``render_seconds``, ``synchronization_seconds``: as Cycles measured them.
    - ``worked_seconds``: the processor time of all threads in ``render_seconds``. None without
      `watch_samples`.
    """

    pixels: Array
    passes: dict[str, Array]
    manifest: dict[str, str]
    samples: Array | None
    render_seconds: float
    worked_seconds: float | None
    synchronization_seconds: float


def render_colour(
    opened: OpenScene,
    world_from_camera: Array,
    seed: int,
    passes: Iterable[Pass] = (),
    alpha: bool = False,
) -> Colour:
    """Render the view of a camera at ``world_from_camera``, (4, 4) camera-to-world.

    Also returns the ``passes`` that belong to colour. The scene must be set up for them.
    """
    counts_samples = view_layer(bpy.context.scene).cycles.pass_debug_sample_count
    colour_passes = [view_pass for view_pass in passes if view_pass.of_colour]
    mattes = [view_pass for view_pass in colour_passes if view_pass.kind == "matte"]
    has_variance = any(view_pass.kind == "variance" for view_pass in colour_passes)
    matte = None
    # The mean of hashes is no hash.
    if mattes and (opened.namesakes or has_variance):
        matte = _render_matte(opened, world_from_camera, seed, mattes)
    _reports.clear()
    needed: dict[str, str] = {}
    for view_pass in colour_passes:
        if matte and view_pass in mattes:
            continue
        channels = {"matte": "rgba", "value": "X"}.get(view_pass.kind, "RGB")
        needed |= dict.fromkeys(view_pass.needed, channels)
        if view_pass.unless:
            needed[view_pass.unless] = "X"
    needed["Combined"] = "RGBA" if alpha else "RGB"
    if counts_samples:
        needed[_COUNTS] = "X"
    to_rec_709 = _to_rec_709()
    if has_variance:
        rendered, variance = sample_parts.render_in_parts(
            opened, world_from_camera, seed, needed, _divisors(colour_passes), to_rec_709
        )
        rendered.passes[VARIANCE] = variance
    else:
        rendered = render_view(opened, world_from_camera, seed, needed)
    if matte:
        rendered.passes.update(matte.passes)
    samples = None
    if counts_samples:
        # The pass holds each pixel's part of all samples.
        samples = np.rint(rendered.passes[_COUNTS][..., 0] * max(count for _, count in _reports))
    composed = {
        view_pass.name: _composed(view_pass, rendered.passes) for view_pass in colour_passes
    }
    if to_rec_709 is not None:
        lights = [composed[each.name] for each in colour_passes if each.kind == "light"]
        for pixels in (rendered.passes["Combined"], *lights):
            pixels[..., :3] = pixels[..., :3] @ to_rec_709.T
    renders = [matte, rendered] if matte else [rendered]
    return Colour(
        pixels=rendered.passes["Combined"],
        passes=composed,
        manifest=_manifest((matte or rendered).attributes),
        samples=samples,
        worked_seconds=_reports[-1][0] - _reports[0][0] if _reports else None,
        render_seconds=sum(each.render_seconds for each in renders),
        synchronization_seconds=sum(each.synchronization_seconds for each in renders),
    )


def _render_matte(
    opened: OpenScene, world_from_camera: Array, seed: int, mattes: Iterable[Pass]
) -> Rendered:
    """Render ``mattes`` alone. Objects of equal names have their full names in them.

    The camera's rays are the same as for the colour. Cycles follows no other rays.
    """
    needed = {name: "rgba" for matte in mattes for name in matte.needed}
    cycles = bpy.context.scene.cycles
    with ExitStack() as stack:
        for name, value in _MATTE_SAMPLING.items():
            stack.enter_context(changed(cycles, name, value))
        stack.enter_context(namesakes.under_full_names(opened.namesakes))
        return render_view(opened, world_from_camera, seed, needed)


def _divisors(passes: Iterable[Pass]) -> dict[str, str]:
    """Return the Cycles passes by which Cycles divides others, by the names of the others."""
    return {name: each.factor for each in passes if each.factor for name in each.cycles}


def _to_rec_709() -> Array | None:
    """Return the matrix (3, 3) from the .blend's working space to linear Rec. 709.

    Return None if the working space is linear Rec. 709.
    """
    units = [mathutils.Color(unit) for unit in np.eye(3)]
    matrix = np.array([unit.from_scene_linear_to_rec709_linear() for unit in units], np.float32).T
    return None if np.allclose(matrix, np.eye(3), atol=1e-6) else matrix


def _composed(view_pass: Pass, passes: Mapping[str, Array]) -> Array:
    """Return a pass of the dataset, composed from Cycles' ``passes`` by name."""
    if view_pass.kind == "variance":
        return passes[VARIANCE]
    parts = [passes[name] for name in view_pass.cycles]
    if view_pass.kind == "matte":
        return np.concatenate(parts, axis=-1)
    total = np.sum(parts, axis=0)
    if view_pass.factor:
        total = total * passes[view_pass.factor]
    if view_pass.without:
        # Rounding may leave a little less than nothing.
        total = np.maximum(total - passes[view_pass.without], 0)
    if view_pass.unless:
        total = np.where(passes[view_pass.unless] > 0, np.float32(0), total)
    return np.asarray(total)


def _manifest(attributes: Mapping[str, Attribute]) -> dict[str, str]:
    """Return the objects' names and hashes. Cycles writes them without escaping quotes."""
    text = next((str(text) for name, text in attributes.items() if name.endswith("/manifest")), "")
    return dict(sorted(re.findall(r'"(.*?)":"([0-9a-f]{8})"(?:,|}$)', text)))


def watch_samples() -> None:
    """Count the samples and the processor time of all following views."""
    view_layer(bpy.context.scene).cycles.pass_debug_sample_count = True
    bpy.app.handlers.render_stats.append(_watch)


# Cycles' progress reports on the current view: processor seconds, and the number of samples. Cycles
# reports `… | Sample 80/256`, and at last `Finished`.
_reports: list[tuple[float, int]] = []


def _watch(text: str, _: Any) -> None:
    sample = re.search(r"Sample (\d+)/", text)
    if sample or text.endswith("Finished"):
        _reports.append((time.process_time(), int(sample[1]) if sample else 0))
