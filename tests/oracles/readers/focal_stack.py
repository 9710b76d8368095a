"""A focal stack: the pictures that focal_stack.json lists, and their camera."""

from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import Exported, ExportedCamera, number, numbers


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the focal_stack.json of an export. Its camera has the lens of the views."""
    path = listing.parent / "focal_stack.json"
    exported = Exported()
    with reading(path, "list of a focal stack"):
        content = read_json(path)
        camera = content["camera"]
        width, height = (int(side) for side in numbers(camera["resolution"], (2,)))
        focal = numbers(camera["focal_length"], (2,)).tolist()
        axis = numbers(camera["principal_point"], (2,)).tolist()
        numbers(camera["world_matrix"], (4, 4))
        lens = Pinhole(width, height, *focal, *axis)
        exported.cameras.append(ExportedCamera(f"{path}: camera", lens))
        weights = [number(weight) for weight in content["views"].values()]
        exported.expect(f"{path}: views", sum(weights), 1.0)
        for entry in content["pictures"]:
            if number(entry["distance"]) <= 0 or not (path.parent / str(entry["file"])).is_file():
                exported.faults.append(f"{path}: pictures: has no {entry['file']} in focus")
    return exported
