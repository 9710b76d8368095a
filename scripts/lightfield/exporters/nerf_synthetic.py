"""Writes the layout of NeRF's synthetic scenes: RGBA pictures, and a list for each part.

``transforms_train.json``, ``_val`` and ``_test`` hold ``camera_angle_x``, and name pictures without
their suffix. Poses are camera-to-world with OpenGL axes and Z up, as in lightfield.json. Without
views for validation, the test views validate. Source: load_blender.py of the original NeRF.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import ForTraining, centred_pinhole
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images


class NerfSynthetic(ForTraining):
    """The layout of NeRF's synthetic scenes: RGBA images, and a list for each part of the split."""

    name = "nerf_synthetic"
    summary = "Layout of NeRF's synthetic scenes, for programs that read it."
    rank = 4
    loader = "ns-train nerfacto --data {} blender-data"
    chooses_tests = True

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return centred_pinhole(lens)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        angle = 2 * math.atan(lens.width / 2 / cameras.focal_pixels(lens)[0])
        parts = splits(source.lightfield)
        progress = Progress(len(source.lightfield.views), "nerf_synthetic", "views")
        # Write the test pictures before val: without validation views, val lists the test pictures.
        lists = {"train": parts.train, "test": parts.test, "val": parts.validation}
        frames: dict[str, Any] = {}
        for part, part_views in lists.items():
            for view in part_views:
                if view.name in frames:
                    continue
                path = f"{part}/{view.name}"
                pixels = np.dstack([source.colour(view), source.alpha(view)])
                images.write_png(folder / f"{path}.png", pixels)
                frames[view.name] = {
                    "file_path": f"./{path}",
                    "transform_matrix": view.world_from_camera.tolist(),
                }
                progress.done()
            content = {
                "camera_angle_x": angle,
                "frames": [frames[view.name] for view in part_views],
            }
            write_json(folder / f"transforms_{part}.json", content)
