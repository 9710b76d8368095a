"""One view, rendered with Cycles as `lightfield.rendering.cycles` has set it up."""

import math
import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import mathutils
import numpy as np

from lightfield.imaging import images
from lightfield.rendering.cycles import view_layer
from lightfield.rendering.quiet import quiet

Array = np.ndarray[Any, Any]

# Cycles gives this depth to a ray that hits nothing.
CYCLES_MISS = 1e10


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


def render_view(world_matrix: Array, seed: int) -> Raw:
    """Render the view of a camera at ``world_matrix``, (4, 4) camera-to-world."""
    scene = bpy.context.scene
    scene.camera.matrix_world = mathutils.Matrix(np.asarray(world_matrix).tolist())
    scene.cycles.seed = seed
    _told.clear()
    with tempfile.TemporaryDirectory(prefix="plenoforge-", dir=_fast_folder()) as folder:
        path = Path(folder) / "view.exr"
        scene.render.filepath = str(path)
        with quiet():
            bpy.ops.render.render(write_still=True)
        image = images.read_image(path)
    layer = view_layer(scene).name
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


def _fast_folder() -> str | None:
    """Return a folder in memory for Cycles' own output, where the system has one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _seconds(text: images.Attribute) -> float:
    """Read a time of the form [hours:]minutes:seconds, as Cycles' header has it."""
    return math.fsum(
        float(part) * 60**power for power, part in enumerate(reversed(str(text).split(":")))
    )


def watch_samples() -> None:
    """Let every view that follows say how many samples its pixels took, and the work they were."""
    view_layer(bpy.context.scene).cycles.pass_debug_sample_count = True
    bpy.app.handlers.render_stats.append(_watch)


# What Cycles tells in its progress about the view that is being rendered, as `… | Sample 80/256`
# and at last `Finished`: when, in processor seconds, and how many samples.
_told: list[tuple[float, int]] = []


def _watch(text: str, _: Any) -> None:
    sample = re.search(r"Sample (\d+)/", text)
    if sample or text.endswith("Finished"):
        _told.append((time.process_time(), int(sample[1]) if sample else 0))
