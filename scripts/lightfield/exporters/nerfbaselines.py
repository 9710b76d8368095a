"""Writes a COLMAP model with the files from which nerfbaselines trains any of its methods.

- ``nb-info.json``: the loader, and the names of the dataset and the scene.
- ``train_list.txt``, ``test_list.txt``: the names of the images to train and to test with.
- ``sparse/0/``: a binary COLMAP model.
- ``images/``: the views as 8-bit PNG.
- ``masks/<view>.png``: 0 means ignored. Either all images have a mask, or none. COLMAP itself
  expects other names.

nerfbaselines also reads OPENCV_FISHEYE. But its search for a pixel's ray diverges 76° from the axis
of an equidistant lens, or ends in an error. Source: datasets/colmap.py, datasets/_common.py and
cameras.py of nerfbaselines.
"""

from pathlib import Path

from lightfield.core.files import write_json, write_text
from lightfield.export import heads
from lightfield.export.pictures import write_pictures
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import (
    TO_RECTILINEAR,
    ForTraining,
    PointCount,
    sideways_refusal,
    tracked_points,
)
from lightfield.exporters.colmap import model
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.rectilinear import Rectilinear


class NerfBaselines(ForTraining):
    """A COLMAP model with lists of images, for nerfbaselines."""

    name = "nerfbaselines"
    summary = "COLMAP model with lists of images, for all methods of nerfbaselines."
    rank = 20
    loader = "nerfbaselines train --method gaussian-splatting --data {}"
    chooses_tests = True
    needs_surfaces = True

    points: PointCount = tracked_points()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear | BrownConrady):
            return f"has a lens whose rays nerfbaselines does not find; {TO_RECTILINEAR}"
        if isinstance(lens, BrownConrady) and any(lens.coefficients[4:]):
            return f"has k3 to k6, at which nerfbaselines stops; {TO_RECTILINEAR}"
        return sideways_refusal(lens, "nerfbaselines'")

    def joins(self, lens: Lens, other: Lens) -> bool:
        return True

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write the model of a source's views, and the lists, into ``folder``."""
        source = heads.by_camera(source)
        views = source.lightfield.views
        model(source, self.points).write_binary(folder / "sparse" / "0")
        has_mask = any(not source.valid(view).all() for view in views)
        for _ in write_pictures(
            source,
            folder,
            self.name,
            picture="images/{}.png",
            mask="masks/{}.png",
            mask_all=has_mask,
        ):
            pass
        parts = splits(source.lightfield)
        for part, part_views in (("train", parts.train), ("test", parts.test)):
            names = "".join(f"{view.name}.png\n" for view in part_views)
            write_text(folder / f"{part}_list.txt", names)
        content = {"loader": "colmap", "id": "plenoforge", "scene": source.dataset.resolve().name}
        write_json(folder / "nb-info.json", content)
