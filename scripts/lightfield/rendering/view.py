"""One render of one view with Cycles, as `lightfield.rendering.cycles` has set it up."""

import math
import tempfile
from collections.abc import Mapping
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


@dataclass(frozen=True)
class Rendered:
    """What Cycles made of a view, in float32.

    ``passes`` are (height, width, channels) by Cycles' names for them.
    ``render_seconds`` and ``synchronization_seconds`` are Cycles' own.
    """

    passes: dict[str, Array]
    render_seconds: float
    synchronization_seconds: float


def render_view(world_matrix: Array, seed: int, passes: Mapping[str, str]) -> Rendered:
    """Render the view of a camera at ``world_matrix``, (4, 4) camera-to-world.

    ``passes`` are names and channels, as in {"Combined": "RGB"}.
    """
    scene = bpy.context.scene
    scene.camera.matrix_world = mathutils.Matrix(np.asarray(world_matrix).tolist())
    scene.cycles.seed = seed
    layer = view_layer(scene).name
    names = {
        name: [f"{layer}.{name}.{channel}" for channel in channels]
        for name, channels in passes.items()
    }
    with tempfile.TemporaryDirectory(prefix="plenoforge-", dir=_fast_folder()) as folder:
        path = Path(folder) / "view.exr"
        scene.render.filepath = str(path)
        with quiet():
            bpy.ops.render.render(write_still=True)
        image = images.read_image(path, [channel for group in names.values() for channel in group])
    return Rendered(
        {
            name: np.stack([image.channels[channel] for channel in group], axis=-1)
            for name, group in names.items()
        },
        _seconds(image.attributes[f"cycles.{layer}.render_time"]),
        _seconds(image.attributes[f"cycles.{layer}.synchronization_time"]),
    )


def _fast_folder() -> str | None:
    """Return a folder in memory for Cycles' own output, where the system has one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _seconds(text: images.Attribute) -> float:
    """Read a time of the form [hours:]minutes:seconds, as Cycles' header has it."""
    return math.fsum(
        float(part) * 60**power for power, part in enumerate(reversed(str(text).split(":")))
    )
