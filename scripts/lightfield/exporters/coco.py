"""Writes the boxes of objects in each view as COCO's list of instances, and their segmentations.

``instances.json`` has an image for each view, and a category for each object of the scene. Each
object or instance that a view shows has an annotation. A box encloses exactly the pixels that show
the object in the passes ``object`` and ``instance``. Hidden parts of the object do not count. On
request, a segmentation has these pixels as the compressed text that pycocotools decodes. Sources:
"Data format" of the COCO dataset, and pycocotools' maskApi.c and coco.py.
"""

from collections.abc import Iterator
from itertools import pairwise
from operator import not_
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json
from lightfield.core.progress import Progress
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import Export
from lightfield.formats.lightfield import View
from lightfield.formats.passes import NAMES

Numbers = NDArray[np.uint32]
Integers = NDArray[np.int64]


class Coco(Export):
    """COCO's list of the objects in each view, with their boxes and segmentations."""

    name = "coco"
    summary = "Boxes of the objects in each view, for object detectors."
    rank = 11
    loader = "from pycocotools.coco import COCO\nboxes = COCO('{}/instances.json')"

    # Settings and export.json have it only if it is used, so that earlier exports keep their bytes.
    segmentation: bool = Field(
        False,
        exclude_if=not_,
        description="Also write which pixels show each object, as RLE that pycocotools decodes.",
    )

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
            for annotation in _annotations(objects, instances, self.segmentation):
                annotations.append(
                    {
                        "id": len(annotations) + 1,
                        "image_id": number,
                        **annotation,
                        "name": names.get(annotation["instance"], ""),
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


def _annotations(
    objects: Numbers, instances: Numbers, with_segmentation: bool
) -> list[dict[str, Any]]:
    """Return the annotations of a view, from its numbers of objects and instances.

    Two objects may share an instance's number: then each has an annotation.
    """
    shown = objects > 0
    # One number for both, because numpy is slow to find different rows.
    pairs = objects[shown].astype(np.uint64) << np.uint64(32) | instances[shown]
    numbers, index = np.unique(pairs, return_inverse=True)
    different = np.stack([numbers >> np.uint64(32), numbers & np.uint64(0xFFFFFFFF)], axis=-1)
    labels = np.full(objects.shape, -1)
    labels[shown] = index
    areas = np.bincount(labels[shown], minlength=len(different))
    annotations: list[dict[str, Any]] = [
        {"category_id": category, "bbox": box, "area": area, "iscrowd": 0, "instance": instance}
        for (category, instance), box, area in zip(
            different.tolist(),
            _boxes(labels, len(different)).tolist(),
            areas.tolist(),
            strict=True,
        )
    ]
    if with_segmentation:
        for annotation, lengths in zip(annotations, _runs(labels, len(different)), strict=True):
            annotation["segmentation"] = {"size": list(labels.shape), "counts": _text(lengths)}
    return annotations


def _boxes(labels: Integers, count: int) -> Integers:
    """Return the boxes (count, 4) of the pixels of each label: left, top, width and height.

    ``labels`` (height, width) are from 0 to ``count``, and -1 for none.
    """
    rows, columns = np.nonzero(labels >= 0)
    index = labels[rows, columns]
    places = np.stack([columns, rows], axis=-1)
    low = np.full((count, 2), np.iinfo(np.int64).max)
    high = np.full((count, 2), -1)
    np.minimum.at(low, index, places)
    np.maximum.at(high, index, places)
    return np.hstack([low, high - low + 1])


def _runs(labels: Integers, count: int) -> Iterator[Integers]:
    """Yield the lengths of runs of pixels, in turn without and with each label.

    The runs go down each column (``labels`` are as for `_boxes`). The first may be empty.
    """
    pixels = labels.ravel(order="F")
    starts = np.flatnonzero(np.diff(pixels, prepend=-2))
    ends = np.append(starts[1:], pixels.size)
    order = np.argsort(pixels[starts], kind="stable")
    first = np.searchsorted(pixels[starts], np.arange(count + 1), sorter=order)
    for begin, end in pairwise(first):
        runs = order[begin:end]
        edges = np.column_stack([starts[runs], ends[runs]]).ravel()
        lengths = np.diff(edges, prepend=0, append=pixels.size)
        yield lengths if lengths[-1] else lengths[:-1]


def _text(lengths: Integers) -> str:
    """Return lengths of runs as pycocotools' text, of the differences to the last but one.

    A character has five bits of a number, lowest first. Its bit 32 says that another one follows.
    """
    values = lengths.tolist()
    # The first three are whole.
    differences = values[:3] + [
        here - before for before, here in zip(values[1:], values[3:], strict=False)
    ]
    return "".join(_characters(difference) for difference in differences)


def _characters(number: int) -> str:
    bits, number = number & 31, number >> 5
    # The highest bit of the last character is the sign.
    if number == (-1 if bits & 16 else 0):
        return chr(48 + bits)
    return chr(48 + 32 + bits) + _characters(number)
