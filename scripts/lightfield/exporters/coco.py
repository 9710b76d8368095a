"""Writes the boxes of objects in each view as COCO's list of instances.

``instances.json`` has an image for each view, and a category for each object of the scene. Each
object or instance that a view shows has an annotation. A box encloses exactly the pixels that show
the object in the passes ``object`` and ``instance``. Hidden parts of the object do not count.
Source: "Data format" of the COCO dataset.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json
from lightfield.core.progress import Progress
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import Export
from lightfield.formats.lightfield import View
from lightfield.formats.passes import NAMES

Numbers = NDArray[np.uint32]


class Coco(Export):
    """COCO's list of the objects in each view, with their boxes."""

    name = "coco"
    summary = "Boxes of the objects in each view, for object detectors."
    rank = 11
    loader = "from pycocotools.coco import COCO\nboxes = COCO('{}/instances.json')"

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("object",)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``instances.json`` into ``folder``."""
        lens = source.lens
        available = {each.name for each in source.lightfield.passes}
        if "object" not in available:
            raise UserError(
                f"{source.lightfield.path}: passes: lack object, from which the boxes are "
                "computed; add it to render.passes, and to passes of the reprojection"
            )
        kind = "instance" if "instance" in available else "object"
        names = {number: name for name, number in _names(source, kind).items()}
        images_of_views = []
        annotations: list[dict[str, Any]] = []
        progress = Progress(len(source.lightfield.views), "coco", "views")
        for number, view in enumerate(source.lightfield.views, 1):
            images_of_views.append(
                {
                    "id": number,
                    "file_name": source.path(view).name,
                    "width": lens.width,
                    "height": lens.height,
                }
            )
            objects = _pixels(source, view, "object")
            instances = _pixels(source, view, kind)
            for shown, category, box, area in _boxes(objects, instances):
                annotations.append(
                    {
                        "id": len(annotations) + 1,
                        "image_id": number,
                        "category_id": category,
                        "bbox": box,
                        "area": area,
                        "iscrowd": 0,
                        "instance": shown,
                        "name": names.get(shown, ""),
                    }
                )
            progress.done()
        categories = [
            {"id": number, "name": name, "supercategory": "object"}
            for name, number in _names(source, "object").items()
        ]
        content = {
            "images": images_of_views,
            "categories": categories,
            "annotations": annotations,
        }
        write_json(folder / "instances.json", content)


def _names(source: SourceDataset, kind: str) -> dict[str, int]:
    """Return the numbers of a pass by their names."""
    names: dict[str, int] = read_json(source.dataset / kind / NAMES)
    return names


def _pixels(source: SourceDataset, view: View, kind: str) -> Numbers:
    """Return a view's numbers (height, width) of a pass."""
    return source.view(view).read(kind)


def _boxes(objects: Numbers, instances: Numbers) -> Iterator[tuple[int, int, list[int], int]]:
    """Yield each instance, its object, its box in pixels, and the number of its pixels.

    A box is the left column, the upper row, the width and the height. Two objects may share an
    instance's number: then each has a box of its own.
    """
    shown = objects > 0
    rows, columns = np.nonzero(shown)
    pairs = np.stack([objects[shown], instances[shown]], axis=-1)
    different, index, counts = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    low = np.full((len(different), 2), np.iinfo(np.int64).max)
    high = np.full((len(different), 2), -1)
    places = np.stack([columns, rows], axis=-1)
    np.minimum.at(low, index, places)
    np.maximum.at(high, index, places)
    for (category, number), least, most, area in zip(different, low, high, counts, strict=True):
        width, height = most - least + 1
        box = [int(least[0]), int(least[1]), int(width), int(height)]
        yield int(number), int(category), box, int(area)
