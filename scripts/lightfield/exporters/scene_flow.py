"""Writes how far each surface moves in the world from one frame of a sequence to the next.

``<frame>/<view>.exr`` has channels X, Y and Z in metres, in the axes of lightfield.json, and V,
which is 1 where the flow is known. The last frame has none. Flow follows from the views' depth at
both frames and from their pass motion: see `lightfield.geometry.flow.scene_flow`.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, Export
from lightfield.formats.lightfield import View
from lightfield.formats.passes import PASSES
from lightfield.geometry.flow import scene_flow
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs import Rig
from lightfield.imaging import images

MOTION = PASSES["motion"]


class SceneFlow(Export):
    """How far each surface moves in the world from one frame to the next."""

    name = "scene_flow"
    summary = "Motion of surfaces in the world, for each frame of a sequence."
    rank = 16
    loader = "import OpenEXR\nflow = OpenEXR.File('{}/{frame}/{view}.exr').channels()"
    is_of_sequence = True

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("motion",)

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return None if has_depth else NO_DEPTH

    def rig_refusal(self, rig: Rig) -> str | None:
        if rig.sequence and rig.sequence.step != 1:
            return "leaves out frames, but the pass motion leads to the next frame; give it step: 1"
        return super().rig_refusal(rig)

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``.

        Raises `UserError` if a frame between two is missing.
        """
        source.require_still_cameras()
        for number, next_number in pairwise(source.numbers):
            if next_number != number + 1:
                raise UserError(
                    f"{source.dataset}: frame {number} is followed by {next_number}, but the pass "
                    "motion leads to the very next frame; render every frame"
                )
        progress = Progress(len(source.frames) - 1, "scene_flow", "frames")
        for frame, following in pairwise(source.frames):
            for view in frame.lightfield.views:
                flow, is_known = scene_flow(
                    source.lens,
                    view.world_from_camera,
                    frame.depth(view, "distance"),
                    _motion(frame, view, "next"),
                    following.depth(view, "distance"),
                    _motion(following, view, "previous"),
                )
                planes: list[NDArray[np.float32]] = [
                    *np.moveaxis(flow, -1, 0).astype(np.float32),
                    is_known.astype(np.float32),
                ]
                path = folder / frame.dataset.name / f"{view.name}.exr"
                images.write_exr(path, dict(zip("XYZV", planes, strict=True)))
            progress.done()


def _motion(frame: SourceDataset, view: View, direction: str) -> Floats:
    """Return a view's motion (h, w, 2) to the "next" or to the "previous" frame, in pixels."""
    if MOTION.name not in {each.name for each in frame.lightfield.passes}:
        raise UserError(f"{frame.lightfield.path}: passes: lack motion; add it to render.passes")
    part = [MOTION.channels.index(f"{direction}.{axis}") for axis in "XY"]
    return frame.view(view).read(MOTION.name)[..., part].astype(np.float64)
