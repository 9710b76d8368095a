"""A scene in WAI, read as MapAnything's load_frame and its datasets do.

OpenCV's axes of poses are undone, and pixel centres at whole numbers.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    development,
    number,
    numbers,
)

# MapAnything takes the numbers of a .npy from this byte on.
OFFSET = 128
KEYS = {"image": "image", "depth": "depth", "mask": "binary"}


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the scene_meta.json of an export, and its covisibility."""
    folder = listing.parent
    path = folder / "scene_meta.json"
    exported = Exported()
    with reading(path, "scene_meta.json"):
        content = read_json(path)
        exported.expect(f"{path}: camera_convention", content["camera_convention"], "opencv")
        modalities = content["frame_modalities"]
        formats = {name: modality["format"] for name, modality in modalities.items()}
        exported.expect(f"{path}: formats", KEYS | formats == KEYS, True)
        keys = {name: str(modality["frame_key"]) for name, modality in modalities.items()}
        for index, frame in enumerate(content["frames"]):
            place = f"{path}: frames[{index}]"
            with reading(place, "frame"):
                name = str(frame["frame_name"])
                exported.cameras.append(ExportedCamera(place, _camera(content | frame)))
                matrix = numbers(frame["transform_matrix"], (4, 4)) @ np.diag([1, -1, -1, 1])
                exported.views.append(ExportedView(path, f"frames[{index}]", name, matrix))
                image, depth = (folder / str(frame[keys[key]]) for key in ("image", "depth"))
                exported.expect_picture(place, image, name, "{}.png")
                exported.expect_picture(place, depth, name, "{}.exr")
                exported.expect(f"{place}: file_path", frame["file_path"], frame[keys["image"]])
                colours = development(options)
                exported.add_picture(image, name, "opaque", development=colours)
                exported.add_picture(depth, name, "metres", meaning="z")
                exported.add_mask(folder / str(frame.get(keys.get("mask"), "none")), name)
        modality = content["scene_modalities"]["pairwise_covisibility"]
        shares = _shares(folder / str(modality["scene_key"]))
        count = len(exported.views)
        exported.expect(f"{path}: pairwise_covisibility: shape", shares.shape == (count,) * 2, True)
        inside = (shares >= 0) & (shares <= np.diagonal(shares)[:, np.newaxis] + 1e-6)
        exported.expect(f"{path}: pairwise_covisibility: shares", bool(inside.all()), True)
    return exported


def _camera(content: dict[str, Any]) -> Pinhole:
    if content["camera_model"] != "PINHOLE":
        raise ValueError(f"camera_model: {content['camera_model']!r} is not PINHOLE")
    fx, fy, cx, cy = (number(content[key]) for key in ("fl_x", "fl_y", "cx", "cy"))
    return Pinhole(int(content["w"]), int(content["h"]), fx, fy, cx + 0.5, cy + 0.5)


def _shares(path: Path) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Return the matrix of a file whose name says its shape: …--12x12.npy."""
    try:
        rows, columns = (int(side) for side in path.stem.split("--")[1].split("x"))
        return np.frombuffer(path.read_bytes()[OFFSET:], "<f4").reshape(rows, columns)
    except (OSError, LookupError) as error:
        raise ValueError(f"{path.name}: is no matrix with its shape in its name") from error
