"""COCO's list of instances: images, categories, and boxes in pixels."""

from pathlib import Path
from typing import Any

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
            box = Box(
                int(annotation["id"]),
                (x, y, across, down),
                float(annotation["area"]),
                int(annotation["category_id"]),
                int(annotation["instance"]),
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
