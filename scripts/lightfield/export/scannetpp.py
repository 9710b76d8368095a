"""Writes ScanNet++'s layout of a fisheye camera, for 3DGRUT and Fisheye-GS.

- ``colmap/``: a COLMAP model as text.
- ``image_undistorted_fisheye/``: the views, each an ideal equidistant fisheye. Views with pixels
  that show nothing have a ``<view>_mask.png`` beside them. 0 means ignored.
- ``train_test_lists.json``: the views to train and to test with.

Source: ScanNet++'s documentation, and 3DGRUT's reader of it.
"""

from pathlib import Path
from typing import Any

from lightfield.configuration.exports import ScanNetPP
from lightfield.core.files import write_json
from lightfield.export.colmap import model
from lightfield.export.pictures import write_pictures
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits

IMAGES = "image_undistorted_fisheye"


def export(source: SourceDataset, settings: ScanNetPP, folder: Path) -> None:
    """Write a source's views into ``folder``."""
    model(source, settings.points).write_text(folder / "colmap")
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
