"""Writes a sequence as D-NeRF's scenes: RGBA pictures with a time, and a list for each part.

``transforms_train.json``, ``_val`` and ``_test`` have the keys of NeRF's synthetic scenes. Each
frame has ``time``, from 0 for the first frame of the animation to 1 for the last. All views of one
frame come before all views of the next, because D-NeRF wants a list to begin at time 0.
``fused.ply`` has points of the first frame, from which 4DGaussians starts. Sources: D-NeRF's
load_blender.py, and dataset_readers.py of 4DGaussians.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras
from lightfield.export.points import lift, write_ply
from lightfield.export.sequence import SourceSequence
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import ForTraining, PointCount, centred_pinhole
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images

POINTS = "fused.ply"


class Dnerf(ForTraining):
    """D-NeRF's layout of a sequence: NeRF's synthetic layout with a time for each picture."""

    name = "dnerf"
    summary = "Sequence for D-NeRF and 4DGaussians."
    rank = 12
    loader = "python train.py -s {} --configs arguments/dnerf/lego.py  # 4DGaussians"
    chooses_tests = True
    is_of_sequence = True
    needs_surfaces = True

    points: PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return centred_pinhole(lens)

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        angle = 2 * math.atan(lens.width / 2 / cameras.focal_pixels(lens)[0])
        lists: dict[str, list[dict[str, Any]]] = {"train": [], "val": [], "test": []}
        progress = Progress(len(source.frames), "dnerf", "frames")
        # A view has the same part at each frame, also if the rig moves.
        parts = splits(source.lightfield)
        # Without validation views, the test views validate, too.
        by_list = {"train": parts.train, "test": parts.test, "val": parts.validation}
        for frame, time in zip(source.frames, source.times, strict=True):
            view_of_name = {view.name: view for view in frame.lightfield.views}
            entries: dict[str, dict[str, Any]] = {}
            for part, views in by_list.items():
                for view in (view_of_name[each.name] for each in views):
                    if view.name not in entries:
                        path = f"{part}/{frame.dataset.name}_{view.name}"
                        pixels = np.dstack([frame.colour(view), frame.alpha(view)])
                        images.write_png(folder / f"{path}.png", pixels)
                        entries[view.name] = {
                            "file_path": f"./{path}",
                            "time": time,
                            "transform_matrix": view.world_from_camera.tolist(),
                        }
                    lists[part].append(entries[view.name])
            progress.done()
        for part, frames in lists.items():
            content = {"camera_angle_x": angle, "frames": frames}
            write_json(folder / f"transforms_{part}.json", content)
        write_ply(folder / POINTS, lift(source.frames[0], count=self.points))
