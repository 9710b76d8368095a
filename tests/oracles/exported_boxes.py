"""Checks that COCO's boxes and segmentations are as the passes show the objects and instances."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.formats.layout import ImageSet
from lightfield.formats.passes import PASSES
from lightfield.imaging import images
from oracles.readers.contents import Box, Exported

Numbers = NDArray[np.uint32]


def faults(exported: Exported, dataset: Path, image_set: ImageSet) -> Iterator[str]:
    """Yield the images that an export lacks or has twice, and those with other boxes."""
    if exported.boxes is None:
        return
    counts = Counter(boxes.view for boxes in exported.boxes)
    place = exported.boxes[0].place if exported.boxes else f"{image_set.prefix}exports/coco"
    for view in image_set.views:
        if counts[view] != 1:
            yield f"{place}: has {view} {counts[view]} times"
    for view in sorted(counts.keys() - image_set.numbers.keys()):
        yield f"{place}: has {view}, which is none of the views"
    available = {each.name for each in image_set.lightfield.passes}
    kind = "instance" if "instance" in available else "object"
    for boxes in exported.boxes:
        if boxes.view not in image_set.numbers:
            continue
        try:
            objects, instances = (
                _pixels(dataset / image_set.name, name, boxes.view) for name in ("object", kind)
            )
        except UserError:
            continue  # The check of the passes reports it.
        wrong = [box for box in boxes.boxes if not _is_right(box, objects, instances)]
        for box in wrong:
            yield f"{boxes.place}: annotations: {box.number}: is not the object's"
        shown = np.stack([objects[objects > 0], instances[objects > 0]], axis=-1)
        different = {(box.category, box.instance) for box in boxes.boxes}
        missing = {tuple(pair) for pair in np.unique(shown, axis=0).tolist()} - different
        if missing or len(different) < len(boxes.boxes):
            yield (
                f"{boxes.place}: images: {boxes.view}: has {len(boxes.boxes)} boxes of "
                f"{len(different)} objects, and lacks {len(missing)}"
            )


def _pixels(folder: Path, name: str, view: str) -> Numbers:
    pixels: Numbers = images.read_image(PASSES[name].path(folder, view), ["Y"]).channels["Y"]
    return pixels


def _is_right(box: Box, objects: Numbers, instances: Numbers) -> bool:
    """Return whether a box and an area are those of the pixels of its object's instance."""
    is_shown = (objects == box.category) & (instances == box.instance)
    if not is_shown.any():
        return False
    across, down = (np.flatnonzero(is_shown.any(axis=axis)) for axis in (0, 1))
    expected: list[Any] = [across[0], down[0], np.ptp(across) + 1, np.ptp(down) + 1]
    is_box = list(box.sides) == expected and box.area == is_shown.sum()
    return bool(is_box and (box.mask is None or np.array_equal(box.mask, is_shown)))
