"""The colour of a view, with as many samples as the scene YAML asks for."""

import re
import time
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from lightfield.rendering.cycles import view_layer
from lightfield.rendering.view import Array, render_view

_COUNTS = "Debug Sample Count"


@dataclass(frozen=True)
class Colour:
    """The colour of a view, (height, width, 3) float32, scene-linear.

    ``render_seconds`` and ``synchronization_seconds`` are Cycles' own. ``samples``,
    (height, width), is how many each pixel took, and ``worked_seconds`` the processor time, of all
    threads, of those ``render_seconds``; None unless `watch_samples` asked for them.
    """

    pixels: Array
    samples: Array | None
    render_seconds: float
    worked_seconds: float | None
    synchronization_seconds: float


def render_colour(world_matrix: Array, seed: int) -> Colour:
    """Render the view of a camera at ``world_matrix``, (4, 4) camera-to-world."""
    watched = view_layer(bpy.context.scene).cycles.pass_debug_sample_count
    _reports.clear()
    found = render_view(
        world_matrix, seed, {"Combined": "RGB"} | ({_COUNTS: "X"} if watched else {})
    )
    samples = None
    if watched:
        # The pass holds each pixel's part of all samples.
        samples = np.rint(found.passes[_COUNTS][..., 0] * max(count for _, count in _reports))
    return Colour(
        pixels=found.passes["Combined"],
        samples=samples,
        worked_seconds=_reports[-1][0] - _reports[0][0] if _reports else None,
        render_seconds=found.render_seconds,
        synchronization_seconds=found.synchronization_seconds,
    )


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
