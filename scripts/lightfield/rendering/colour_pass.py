"""The colour of a view, with as many samples as the scene YAML asks for."""

import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import mathutils
import numpy as np

from lightfield.dataset.passes import Pass
from lightfield.imaging.images import Attribute
from lightfield.rendering.cycles import view_layer
from lightfield.rendering.view import Array, render_view

_COUNTS = "Debug Sample Count"


@dataclass(frozen=True)
class Colour:
    """The colour of a view, (height, width, 3 or 4) float32, linear Rec. 709, alpha associated.

    ``passes`` are those that were asked for, by name, each as the colour itself; ``manifest`` has
    the hashes of the objects in a matte.
    ``render_seconds`` and ``synchronization_seconds`` are Cycles' own. ``samples``,
    (height, width), is how many each pixel took, and ``worked_seconds`` the processor time, of all
    threads, of those ``render_seconds``; None unless `watch_samples` asked for them.
    """

    pixels: Array
    passes: dict[str, Array]
    manifest: dict[str, str]
    samples: Array | None
    render_seconds: float
    worked_seconds: float | None
    synchronization_seconds: float


def render_colour(
    world_matrix: Array, seed: int, passes: Iterable[Pass] = (), alpha: bool = False
) -> Colour:
    """Render the view of a camera at ``world_matrix``, (4, 4) camera-to-world.

    Of the ``passes`` those are made that are of colour, for which Cycles has been set up.
    """
    watched = view_layer(bpy.context.scene).cycles.pass_debug_sample_count
    _reports.clear()
    wanted = [rendered for rendered in passes if rendered.of_colour]
    needed = {
        name: "rgba" if each.kind == "matte" else "RGB" for each in wanted for name in each.needed
    }
    needed |= {"Combined": "RGBA" if alpha else "RGB"} | ({_COUNTS: "X"} if watched else {})
    rendered = render_view(world_matrix, seed, needed)
    samples = None
    if watched:
        # The pass holds each pixel's part of all samples.
        samples = np.rint(rendered.passes[_COUNTS][..., 0] * max(count for _, count in _reports))
    made = {each.name: _composed(each, rendered.passes) for each in wanted}
    to_rec_709 = _to_rec_709()
    if to_rec_709 is not None:
        lights = [made[each.name] for each in wanted if each.kind == "light"]
        for pixels in (rendered.passes["Combined"], *lights):
            pixels[..., :3] = pixels[..., :3] @ to_rec_709.T
    return Colour(
        pixels=rendered.passes["Combined"],
        passes=made,
        manifest=_manifest(rendered.attributes),
        samples=samples,
        worked_seconds=_reports[-1][0] - _reports[0][0] if _reports else None,
        render_seconds=rendered.render_seconds,
        synchronization_seconds=rendered.synchronization_seconds,
    )


def _to_rec_709() -> Array | None:
    """Return what takes colours (3,) of the .blend's working space to linear Rec. 709; (3, 3).

    None where it is that.
    """
    units = [mathutils.Color(unit) for unit in np.eye(3)]
    matrix = np.array([unit.from_scene_linear_to_rec709_linear() for unit in units], np.float32).T
    return None if np.allclose(matrix, np.eye(3), atol=1e-6) else matrix


def _composed(wanted: Pass, passes: Mapping[str, Array]) -> Array:
    """Return a pass of ours from those of Cycles, by name."""
    parts = [passes[name] for name in wanted.cycles]
    if wanted.kind == "matte":
        return np.concatenate(parts, axis=-1)
    total = np.sum(parts, axis=0)
    return np.asarray(total * passes[wanted.factor] if wanted.factor else total)


def _manifest(attributes: Mapping[str, Attribute]) -> dict[str, str]:
    """Return the objects' names and hashes, which Cycles writes without escaping a quote."""
    text = next((str(text) for name, text in attributes.items() if name.endswith("/manifest")), "")
    return dict(sorted(re.findall(r'"(.*?)":"([0-9a-f]{8})"(?:,|}$)', text)))


def watch_samples() -> None:
    """Let every view that follows say how many samples its pixels took, and the work they were."""
    view_layer(bpy.context.scene).cycles.pass_debug_sample_count = True
    bpy.app.handlers.render_stats.append(_watch)


# What Cycles reports in its progress about the view that is being rendered, as `… | Sample 80/256`
# and at last `Finished`: when, in processor seconds, and how many samples.
_reports: list[tuple[float, int]] = []


def _watch(text: str, _: Any) -> None:
    sample = re.search(r"Sample (\d+)/", text)
    if sample or text.endswith("Finished"):
        _reports.append((time.process_time(), int(sample[1]) if sample else 0))
