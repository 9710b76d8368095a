"""Writes the layout of NeRF's synthetic scenes: RGBA pictures, and a list for each part.

``transforms_train.json``, ``_val`` and ``_test`` hold ``camera_angle_x``, and name pictures without
their suffix. Poses are camera-to-world with OpenGL axes and Z up, as in lightfield.json. Without
views for validation, the test views validate. Source: load_blender.py and run_nerf.py of the
original NeRF.
"""

import math
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras, llff
from lightfield.export.source import Floats, SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import ForTraining, centred_pinhole
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images

# Readers sample rays only between these Z.
NEAR, FAR = 2.0, 6.0
# A smaller part of the surfaces outside is not worth a warning.
_FEW = 0.01


class NerfSynthetic(ForTraining):
    """The layout of NeRF's synthetic scenes: RGBA images, and a list for each part of the split."""

    name = "nerf_synthetic"
    summary = "Layout of NeRF's synthetic scenes, for programs that read it."
    rank = 4
    loader = "ns-train nerfacto --data {} blender-data"
    chooses_tests = True

    scale: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        None,
        description="Factor of the cameras' positions. Readers sample only between Z = 2 and 6. "
        "Without this key, it is 1, and a warning says which factor fits.",
        json_schema_extra={"unit": "units/m"},
    )

    @property
    def recorded(self) -> dict[str, Any]:
        # An export records the scale only if it is used.
        options = super().recorded
        return options if self.scale else {k: v for k, v in options.items() if k != "scale"}

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return centred_pinhole(lens)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        if problem := _unsampled(_depths(source, lens), self.scale or 1.0):
            print(f"warning: {folder}: {problem}", file=sys.stderr)
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
                matrix = view.world_from_camera.copy()
                matrix[:3, 3] *= self.scale or 1.0
                frames[view.name] = {
                    "file_path": f"./{path}",
                    "transform_matrix": matrix.tolist(),
                }
                progress.done()
            content = {
                "camera_angle_x": angle,
                "frames": [frames[view.name] for view in part_views],
            }
            write_json(folder / f"transforms_{part}.json", content)


def _depths(source: SourceDataset, lens: Rectilinear) -> Floats:
    """Return the Z in metres of the surfaces in all views' frames, as far as they are known."""
    if not source.has_surfaces:
        return np.empty(0)
    surfaces = source.surfaces(source.lightfield.views)
    return np.concatenate([llff.depths(lens, view, surface) for view, surface in surfaces])


def _unsampled(depths: Floats, scale: float) -> str | None:
    """Return how many surfaces readers do not sample, and the best scale. None if they are few.

    ``depths`` (n,) are the surfaces' Z in metres.
    """
    share = _share_outside(depths, scale)
    if share < _FEW:
        return None
    best_scale = float(f"{_best_scale(depths):.3g}")
    best_share = _share_outside(depths, best_scale)
    return (
        f"{share:.0%} of the surfaces are nearer than {NEAR:g} or farther than {FAR:g} units, "
        f"where readers do not look; scale: {best_scale:g} leaves {best_share:.0%}"
    )


def _share_outside(depths: Floats, scale: float) -> float:
    scaled = depths * scale
    return float(np.mean((scaled < NEAR) | (scaled > FAR))) if len(depths) else 0.0


def _best_scale(depths: Floats) -> float:
    """Return a scale that brings the most surfaces between near and far, with equal margins."""
    ordered = np.sort(depths)
    ends = np.searchsorted(ordered, ordered * (FAR / NEAR), side="right")
    first = int(np.argmax(ends - np.arange(len(ordered))))
    return float(np.sqrt(NEAR * FAR / (ordered[first] * ordered[ends[first] - 1])))
