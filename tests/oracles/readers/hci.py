"""The layout of the HCI 4D light field benchmark: parameters.cfg, and maps of depth as PFM.

The views are numbered row by row from the top left. Their spacing is the same across and down. All
have the rotation of the middle view, whose pose is in parameters.cfg. Disparity is
b f (1 / Z − 1 / F). Source: Honauer et al. 2016, and the benchmark's parameters.
"""

import configparser
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from lightfield.geometry.rotations import euler_to_matrix
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import (
    DepthRange,
    Exported,
    ExportedCamera,
    ExportedView,
    development,
    number,
)

INFINITY = 1e9
"""The focus distance in metres of cameras with parallel axes."""


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the parameters.cfg of an export."""
    folder = listing.parent
    path = folder / "parameters.cfg"
    exported = Exported()
    with reading(path, "parameters.cfg of the HCI benchmark"):
        config = configparser.ConfigParser()
        try:
            config.read_string(path.read_text(encoding="utf-8"))
        except configparser.Error as error:
            raise ValueError(" ".join(str(error).split())) from None
        value = partial(
            _number, path, {**config["intrinsics"], **config["extrinsics"], **config["meta"]}
        )
        width, height = (int(value(f"image_resolution_{axis}_px")) for axis in "xy")
        # The sensor's longer side.
        focal = value("focal_length_mm") / value("sensor_size_mm")
        focal *= max(width, height)
        camera = Pinhole(width, height, focal, focal, width / 2, height / 2)
        exported.cameras.append(ExportedCamera(f"{path}: intrinsics", camera))
        columns, rows = (int(value(f"num_cams_{axis}")) for axis in "xy")
        if columns * rows != len([*folder.glob("input_Cam*.png")]):
            raise ValueError(f"num_cams_x, num_cams_y: there are no {columns} × {rows} pictures")
        baseline = value("baseline_mm") / 1000
        middle = np.eye(4)
        angles = [value(f"center_cam_r{axis}_rad") for axis in "xyz"]
        middle[:3, :3] = euler_to_matrix(np.array(angles))
        middle[:3, 3] = [value(f"center_cam_{axis}_m") for axis in "xyz"]
        for index in range(columns * rows):
            right = index % columns - columns // 2
            down = index // columns - rows // 2
            matrix = middle.copy()
            matrix[:3, 3] += baseline * (right * middle[:3, 0] - down * middle[:3, 1])
            exported.views.append(ExportedView(path, f"Cam{index:03}", None, matrix))
            _check_files(folder, f"_Cam{index:03}", (width, height), exported)
            of_view = {"position": tuple(matrix[:3, 3].tolist()), "size": (width, height)}
            colours = development(options)
            picture = folder / f"input_Cam{index:03}.png"
            exported.add_picture(picture, None, "colour", development=colours, **of_view)
            unit = baseline * focal
            for kind, name in (("metres", "depth"), ("disparity", "disp")):
                map_path = folder / f"gt_{name}_lowres_Cam{index:03}.pfm"
                exported.add_picture(map_path, None, kind, unit=unit, **of_view)
                if index == rows // 2 * columns + columns // 2:
                    middle_map = folder / f"gt_{name}_lowres.pfm"
                    exported.add_picture(middle_map, None, kind, unit=unit, **of_view)
        exported.expect(f"{path}: offset", value("offset"), 0.0)
        exported.expect(f"{path}: depth_map_scale", value("depth_map_scale"), 1.0)
        # Cameras with parallel axes focus at infinity: d = b f / Z, and 0 for a miss.
        focus = value("focus_distance_m")
        exported.expect(f"{path}: focus_distance_m", focus, INFINITY)
        far, near = (_depth(baseline * focal, value(f"disp_{end}")) for end in ("min", "max"))
        place = f"{path}: disp_min, disp_max"
        exported.ranges.append(DepthRange(place, None, near, far, "z", math.inf))
    _check_files(folder, "", (width, height), exported)
    return exported


def _number(path: Path, texts: Mapping[str, str], key: str) -> float:
    with reading(f"{path}: {key}", "number"):
        return number(float(texts[key]))


def _depth(unit: float, disparity: float) -> float:
    """Return the depth in metres of a disparity. ``unit`` is the disparity at one metre."""
    return unit / disparity if disparity else math.inf


def _check_files(folder: Path, end: str, size: tuple[int, int], exported: Exported) -> None:
    """Check that a view's maps have the views' size.

    ``end`` is the end of their names. It is empty for the middle view's maps, which exist twice.
    """
    if end and not (folder / f"input{end}.png").is_file():
        exported.faults.append(f"{folder}/parameters.cfg: there is no input{end}.png of it")
    width, height = size
    header = f"Pf\n{width} {height}\n-1.0\n".encode()
    for kind in ("depth", "disp"):
        path = folder / f"gt_{kind}_lowres{end}.pfm"
        with reading(path, "portable float map"), path.open("rb") as file:
            exported.expect(f"{path}: header", file.read(len(header)), header)
            exported.expect(f"{path}: bytes", path.stat().st_size, len(header) + 4 * width * height)
