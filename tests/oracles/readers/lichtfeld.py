"""A dataset for LichtFeld Studio, read as its transforms.cpp and blender_loader.cpp do."""

import math
from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, read_text, reading
from oracles.readers.cameras import Camera, OpenCVFisheye, Panorama, Pinhole
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


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the transforms.json of an export, its point cloud and its two lists of images."""
    folder = listing.parent
    path = folder / "transforms.json"
    image = f"{{}}.{options['format']}"
    exported = Exported()
    with reading(path, "transforms.json"):
        content = read_json(path)
        exported.cameras.append(ExportedCamera(str(path), _camera(content)))
        for index, frame in enumerate(content["frames"]):
            place = f"frames[{index}]"
            with reading(f"{path}: {place}", "frame"):
                picture = folder / str(frame["file_path"])
                matrix = numbers(frame["transform_matrix"], (4, 4))
                exported.views.append(ExportedView(path, place, picture.stem, matrix))
                exported.expect_picture(f"{path}: {place}", picture, picture.stem, image)
                view = picture.stem
                exported.add_picture(picture, view, "colour", development=development(options))
                exported.add_mask(folder / "masks" / f"{view}.png", view)
                exported.add_picture(folder / "depth" / f"{view}.png", view, "relative")
        cloud, faults = read_ply(folder / str(content["ply_file_path"]))
    exported.clouds.append(cloud)
    exported.faults += faults
    _check_side_folders(folder, exported, options)
    for part in ("train", "test"):
        names = read_text(folder / f"{part}.txt").splitlines()
        place = str(folder / f"{part}.txt")
        exported.parts.append(Part(place, part, [Path(name).stem for name in names]))
        for name in names:
            exported.expect(f"{place}: {name}: suffix", Path(name).suffix, f".{options['format']}")
    return exported


def _check_side_folders(folder: Path, exported: Exported, options: dict[str, Any]) -> None:
    """Check that each view has the files that LichtFeld finds by the image's name."""
    expected = {view.name for view in exported.views}
    for name in ("depth", "normals"):
        files = {file.stem for file in (folder / name).glob("*.png")}
        wanted = expected if options[name] else set()
        exported.expect(f"{folder / name}: images", sorted(files) == sorted(wanted, key=str), True)
    unknown = {file.stem for file in (folder / "masks").glob("*")} - expected
    exported.expect(f"{folder / 'masks'}: files without an image", len(unknown), 0)


def _camera(content: dict[str, Any]) -> Camera:
    """Return the lens that all frames share. k4 is not read."""
    width, height = int(content["w"]), int(content["h"])
    model = content["camera_model"]
    if model == "EQUIRECTANGULAR":
        # Other keys of a panorama are not read.
        return Panorama(width, height, -math.pi, math.pi, math.pi / 2, -math.pi / 2)
    fx, fy, cx, cy = (number(content[key]) for key in ("fl_x", "fl_y", "cx", "cy"))
    if model == "PINHOLE":
        return Pinhole(width, height, fx, fy, cx, cy)
    if model == "OPENCV_FISHEYE":
        k1, k2, k3 = (number(content[f"k{index}"]) for index in range(1, 4))
        return OpenCVFisheye(width, height, fx, fy, cx, cy, k1, k2, k3)
    raise ValueError(f"camera_model: {model!r} is not PINHOLE, OPENCV_FISHEYE or EQUIRECTANGULAR")
