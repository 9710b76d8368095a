"""Renders one view with Cycles. `lightfield.rendering.setup.cycles` sets Cycles up before."""

import math
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from lightfield.core import disk_space, units
from lightfield.core.errors import LESS_GPU_MEMORY, LESS_MEMORY, OutsideError, UserError
from lightfield.core.leftovers import temporary_folder
from lightfield.imaging import images
from lightfield.planning.cost import temporary_bytes
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.scenes.quiet import quiet
from lightfield.rendering.setup.cycles import view_layer
from lightfield.rendering.setup.moving_camera import place_camera

Array = np.ndarray[Any, Any]

# As CUDA, HIP, OptiX, Cycles and Blender say it.
_OUT_OF_MEMORY = re.compile(r"(out.of|not enough).*memory", re.IGNORECASE)


@dataclass(frozen=True)
class Rendered:
    """A view as Cycles rendered it, in float32.

    ``passes`` are (height, width, channels) by Cycles' names. ``attributes`` is the EXR's header.
    ``render_seconds`` and ``synchronization_seconds`` are as Cycles measured them.
    """

    passes: dict[str, Array]
    attributes: dict[str, images.Attribute]
    render_seconds: float
    synchronization_seconds: float


def render_view(
    opened: OpenScene, world_from_camera: Array, seed: int, passes: Mapping[str, str]
) -> Rendered:
    """Render the view of a camera at ``world_from_camera``, (4, 4) camera-to-world.

    ``passes`` are names and channels, as in {"Combined": "RGB"}.
    """
    scene = bpy.context.scene
    place_camera(world_from_camera, opened.motion)
    scene.cycles.seed = seed
    groups = len(view_layer(scene).lightgroups)
    layer = view_layer(scene).name
    names = {
        name: [f"{layer}.{name}.{channel}" for channel in channels]
        for name, channels in passes.items()
    }
    size = temporary_bytes(scene.render.resolution_x * scene.render.resolution_y, groups)
    with temporary_folder(disk_space.fast_folder(size)) as folder:
        scene.render.filepath = str(folder / "view.exr")
        try:
            with quiet():
                bpy.ops.render.render(write_still=True)
        except RuntimeError as error:
            # Blender repeats Cycles' errors at the end of the render.
            lines = [line.removeprefix("Error:").strip() for line in str(error).splitlines()]
            text = "; ".join(dict.fromkeys(filter(None, lines)))
            text = f"Cycles cannot render the view: {text}"
            if _OUT_OF_MEMORY.search(text):
                on_gpu = scene.cycles.device == "GPU"
                advice = LESS_GPU_MEMORY if on_gpu else LESS_MEMORY
                raise OutsideError(f"{text}: {advice}") from None
            raise UserError(text) from None
        try:
            # One eye of a stereo pair is in view_L.exr or view_R.exr.
            path = next(folder.glob("*.exr"), folder / "view.exr")
            channels = [channel for group in names.values() for channel in group]
            image = images.read_image(path, channels)
        except UserError as error:
            free = units.size(shutil.disk_usage(folder).free)
            needed = units.size(size)
            raise OutsideError(
                f"{error}; {free} are free there: free some space, or set TMPDIR to a folder with "
                f"{needed}"
            ) from None
    return Rendered(
        {
            name: np.stack([image.channels[channel] for channel in group], axis=-1)
            for name, group in names.items()
        },
        image.attributes,
        _seconds(image.attributes[f"cycles.{layer}.render_time"]),
        _seconds(image.attributes[f"cycles.{layer}.synchronization_time"]),
    )


def _seconds(text: images.Attribute) -> float:
    """Return the seconds of a time in Cycles' header: [hours:]minutes:seconds."""
    return math.fsum(
        float(part) * 60**power for power, part in enumerate(reversed(str(text).split(":")))
    )
