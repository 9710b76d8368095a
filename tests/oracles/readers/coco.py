"""COCO's list of instances: images, categories, boxes in pixels, and segmentations.

A segmentation is a text that pycocotools decodes. Source: rleFrString and rleDecode of its
maskApi.c.
"""

from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import read_json, reading
from oracles.readers.contents import Box, Boxes, Exported, numbers


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the instances.json of an export. Its boxes must be within the images."""
    path = listing.parent / "instances.json"
    exported = Exported()
    width, height = size
    with reading(path, "list of instances"):
        content = read_json(path)
        for image in content["images"]:
            place = f"{path}: images: {image['file_name']}"
            exported.expect(place, [image["width"], image["height"]], [width, height])
        boxes: dict[int, list[Box]] = {image["id"]: [] for image in content["images"]}
        if len(boxes) < len(content["images"]):
            exported.faults.append(f"{path}: images: two have one id")
        categories = {category["id"] for category in content["categories"]}
        for annotation in content["annotations"]:
            place = f"{path}: annotations: {annotation['id']}"
            x, y, across, down = numbers(annotation["bbox"], (4,))
            is_inside = 0 <= x <= x + across <= width and 0 <= y <= y + down <= height
            if not is_inside or not 0 < annotation["area"] <= across * down:
                exported.faults.append(f"{place}: bbox: is not a box of pixels of its image")
            mask = _mask(annotation, size, f"{place}: segmentation", exported)
            is_segmented = options.get("segmentation", False)
            exported.expect(f"{place}: has a segmentation", mask is not None, is_segmented)
            box = Box(
                int(annotation["id"]),
                (x, y, across, down),
                float(annotation["area"]),
                int(annotation["category_id"]),
                int(annotation["instance"]),
                mask,
            )
            if annotation["image_id"] in boxes:
                boxes[annotation["image_id"]].append(box)
            else:
                exported.faults.append(f"{place}: image_id: is none of the images")
            if annotation["category_id"] not in categories:
                exported.faults.append(f"{place}: category_id: is none of the categories")
        exported.boxes = [
            Boxes(str(path), Path(str(image["file_name"])).stem, boxes[image["id"]])
            for image in content["images"]
        ]
    return exported


def _mask(
    annotation: dict[str, Any], size: tuple[int, int], place: str, exported: Exported
) -> NDArray[np.bool_] | None:
    """Return which pixels (height, width) a segmentation has. None without one."""
    if "segmentation" not in annotation:
        return None
    segmentation = annotation["segmentation"]
    width, height = size
    exported.expect(f"{place}: size", segmentation["size"], [height, width])
    text = segmentation["counts"]
    # pycocotools takes a segmentation that is a list for polygons.
    if not isinstance(text, str):
        raise ValueError(f"{place}: counts: must be a text")
    pixels: list[bool] = []
    for length, is_inside in zip(_lengths(text), cycle((False, True)), strict=False):
        if length < 0:
            raise ValueError(f"{place}: counts: has a run of {length} pixels")
        pixels += [is_inside] * length
    if len(pixels) != width * height:
        raise ValueError(f"{place}: counts: are of {len(pixels)} pixels, not {width * height}")
    return np.array(pixels).reshape(width, height).T


def _lengths(text: str) -> list[int]:
    """Return the lengths of runs, whose differences to the last but one a text has.

    A character has five bits, lowest first, above 48. Bit 32 says that another one follows. Bit 16
    of a number's last one is its sign.
    """
    lengths: list[int] = []
    value, place = 0, 1
    for character in text:
        code = ord(character) - 48
        value += place * (code % 32)
        place *= 32
        if code >= 32:
            continue
        if code >= 16:
            value -= place
        lengths.append(value + (lengths[-2] if len(lengths) > 2 else 0))
        value, place = 0, 1
    return lengths
