"""A nerfstudio dataset, read as its nerfstudio_dataparser.py and cameras.py do.

The reader undoes ``applied_transform`` in the poses and in the point cloud.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from oracles.readers.cameras import Camera, OfColmap, OpenCVFisheye, Panorama, Pinhole
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Part,
    development,
    number,
    numbers,
)
from oracles.readers.ply import read_ply

PARTS = {"train": "train", "val": "validation", "test": "test"}


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the transforms.json of an export, and its point cloud."""
    folder = listing.parent
    path = folder / "transforms.json"
    exported = Exported()
    with reading(path, "transforms.json"):
        content = read_json(path)
        exported.cameras.append(ExportedCamera(str(path), _camera(content)))
        applied = np.eye(4)
        applied[:3] = numbers(content["applied_transform"], (3, 4))
        undone = np.linalg.inv(applied)
        frames = content["frames"]
        for index, frame in enumerate(frames):
            place = f"frames[{index}]"
            with reading(f"{path}: {place}", "frame"):
                name = Path(str(frame["file_path"])).stem
                matrix = undone @ numbers(frame["transform_matrix"], (4, 4))
                exported.views.append(ExportedView(path, place, name, matrix))
                for key in ("file_path", "mask_path", "depth_file_path"):
                    if key in frame:
                        picture = folder / str(frame[key])
                        exported.expect_picture(f"{path}: {place}: {key}", picture, name, "{}.png")
                _add_pictures(folder, frame, name, options, exported)
        # Either all frames have a mask, or none. The options say whether they have depth.
        masks = sum("mask_path" in frame for frame in frames)
        exported.expect(f"{path}: frames with a mask_path", masks, len(frames) if masks else 0)
        depths = sum("depth_file_path" in frame for frame in frames)
        expected_depths = len(frames) if options["depth"] else 0
        exported.expect(f"{path}: frames with a depth_file_path", depths, expected_depths)
        _check_normals(folder / "normals_from_pretrain", exported, options)
        for part, name in PARTS.items():
            names = [Path(str(file)).stem for file in content[f"{part}_filenames"]]
            exported.parts.append(Part(f"{path}: {part}_filenames", name, names))
        cloud, faults = read_ply(folder / str(content["ply_file_path"]), undone)
    exported.clouds.append(cloud)
    exported.faults += faults
    return exported


def _check_normals(folder: Path, exported: Exported, options: dict[str, Any]) -> None:
    """Check that each view has the normals that dn-splatter finds in their order."""
    files = sorted(file.stem for file in folder.glob("*.png"))
    wanted = sorted(view.name for view in exported.views) if options.get("normals") else []
    exported.expect(f"{folder}: normals of the views", files == wanted, True)


def _add_pictures(
    folder: Path, frame: dict[str, Any], view: str, options: dict[str, Any], exported: Exported
) -> None:
    """Add the picture of a frame, its mask, and its depth in millimetres."""
    colour = folder / str(frame["file_path"])
    exported.add_picture(colour, view, "colour", development=development(options))
    mask = folder / str(frame.get("mask_path", f"masks/{view}.png"))
    exported.add_mask(mask, view, options.get("objects", ()))
    if "depth_file_path" in frame:
        # Rays of OPENCV and FISHEYE624 have length 1 along the axis. Other rays have length 1.
        is_pinhole = isinstance(exported.cameras[0].camera, Pinhole | OfColmap)
        meaning = "z" if is_pinhole else "distance"
        depth = folder / str(frame["depth_file_path"])
        exported.add_picture(depth, view, "steps", meaning=meaning, unit=0.001)


def _camera(content: dict[str, Any]) -> Camera:
    """Return the lens that all frames share. Source: Cameras.generate_rays."""
    width, height = int(content["w"]), int(content["h"])
    fx, fy, cx, cy = (number(content[key]) for key in ("fl_x", "fl_y", "cx", "cy"))
    model = content["camera_model"]
    if model == "OPENCV":
        k1, k2, k3, k4, p1, p2 = (
            number(content.get(key, 0.0)) for key in ("k1", "k2", "k3", "k4", "p1", "p2")
        )
        if k4:
            raise ValueError("k4: is r⁸'s factor to nerfstudio, and a divisor's to OpenCV")
        if not any((k1, k2, k3, p1, p2)):
            return Pinhole(width, height, fx, fy, cx, cy)
        parameters = (fx, fy, cx, cy, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0)
        return OfColmap(width, height, "FULL_OPENCV", parameters)
    if model == "FISHEYE624":
        distortion = numbers(content["distortion_params"], (12,)).tolist()
        name = "RAD_TAN_THIN_PRISM_FISHEYE"
        return OfColmap(width, height, name, (fx, fy, cx, cy, *distortion))
    if model == "OPENCV_FISHEYE":
        k1, k2, k3, k4 = (number(content[f"k{index}"]) for index in range(1, 5))
        return OpenCVFisheye(width, height, fx, fy, cx, cy, k1, k2, k3, k4)
    if model == "EQUIRECTANGULAR":
        # A turn of π a focal length, from the principal point.
        west, east = (math.pi * (x - cx) / fx for x in (0, width))
        north, south = (-math.pi * (y - cy) / fy for y in (0, height))
        return Panorama(width, height, west, east, north, south)
    raise ValueError(f"camera_model: {model!r} is not OPENCV, OPENCV_FISHEYE or EQUIRECTANGULAR")
