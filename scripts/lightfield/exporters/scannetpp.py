"""Writes ScanNet++'s layout of a fisheye camera, for 3DGRUT and Fisheye-GS.

- ``colmap/``: a COLMAP model as text.
- ``image_undistorted_fisheye/``: the views, each an ideal equidistant fisheye. Views with pixels
  that show nothing have a ``<view>_mask.png`` beside them. 0 means ignored.
- ``train_test_lists.json``: the views to train and to test with.

Source: ScanNet++'s documentation, and 3DGRUT's reader of it.
"""

import math
from pathlib import Path
from typing import Any

from lightfield.core.files import write_json
from lightfield.export.pictures import write_pictures
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import ForTraining, PointCount, angle, tracked_points
from lightfield.exporters.colmap import model
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant

IMAGES = "image_undistorted_fisheye"


class ScanNetPP(ForTraining):
    """ScanNet++'s layout of a fisheye camera, for 3DGRUT and Fisheye-GS."""

    name = "scannetpp"
    summary = "ScanNet++'s fisheye layout, for 3DGRUT and Fisheye-GS."
    rank = 8
    loader = "python train.py --config-name apps/scannetpp_3dgut path={}  # 3DGRUT"
    chooses_tests = True
    needs_surfaces = True

    points: PointCount = tracked_points()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant):
            if lens.fov < math.pi:
                return None
            return f"{angle(lens)}, but this layout ends below 180; give it a smaller fov"
        return "is not an equidistant fisheye below 180 degrees; reproject to one"

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        model(source, self.points).write_text(folder / "colmap")
        has_masks = [
            has_mask
            for _, has_mask in write_pictures(
                source,
                folder,
                "scannetpp",
                picture=f"{IMAGES}/{{}}.png",
                mask=f"{IMAGES}/{{}}_mask.png",
            )
        ]
        parts = splits(source.lightfield)
        lists = {"train": parts.train, "test": parts.test}
        content: dict[str, Any] = {}
        for part, part_views in lists.items():
            content[part] = [f"{view.name}.png" for view in part_views]
        content["has_masks"] = any(has_masks)
        write_json(folder / "train_test_lists.json", content)
