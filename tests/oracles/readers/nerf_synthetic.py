"""NeRF's synthetic layout, read as the original NeRF's load_blender.py does.

Poses are in the axes of lightfield.json, and in metres times the export's scale. A list describes
the lens by its horizontal angle only.
"""

import math
from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Part,
    development,
    number,
    numbers,
)
from oracles.readers.nerfstudio import PARTS


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the three lists of an export."""
    exported = Exported()
    width, height = size
    for part, name in PARTS.items():
        path = listing.parent / f"transforms_{part}.json"
        names = []
        with reading(path, "list of NeRF's synthetic scenes"):
            content = read_json(path)
            focal = width / 2 / math.tan(number(content["camera_angle_x"]) / 2)
            camera = Pinhole(width, height, focal, focal, width / 2, height / 2)
            exported.cameras.append(ExportedCamera(f"{path}: camera_angle_x", camera))
            for index, frame in enumerate(content["frames"]):
                place = f"frames[{index}]"
                with reading(f"{path}: {place}", "frame"):
                    picture = listing.parent / f"{frame['file_path']}.png"
                    view = picture.stem
                    names.append(view)
                    exported.expect_picture(f"{path}: {place}: file_path", picture, view, "{}.png")
                    colours = development(options)
                    exported.add_picture(picture, view, "colour", development=colours)
                    exported.add_picture(picture, view, "alpha")
                    matrix = numbers(frame["transform_matrix"], (4, 4))
                    matrix[:3, 3] /= options.get("scale", 1)
                    exported.views.append(ExportedView(path, place, view, matrix))
        exported.parts.append(Part(str(path), name, names))
    return exported
