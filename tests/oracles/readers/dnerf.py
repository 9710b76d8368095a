"""D-NeRF's layout of a sequence, read as its load_blender.py and 4DGaussians' readers do."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Part,
    number,
    numbers,
)
from oracles.readers.nerfstudio import PARTS
from oracles.readers.ply import read_ply

# How far a time may be from that of its frame.
_ROUNDING = 1e-9


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the three lists of an export, and the points of the first frame."""
    width, height = size
    exported = {name: Exported() for name in frames}
    first, last = min(frames.values()), max(frames.values())
    times = {name: (frame - first) / (last - first) for name, frame in frames.items()}
    first_frame = exported[next(iter(frames))]
    for suffix, part in PARTS.items():
        path = listing.parent / f"transforms_{suffix}.json"
        with reading(path, "list of D-NeRF"):
            content = read_json(path)
            focal = width / 2 / math.tan(number(content["camera_angle_x"]) / 2)
            camera = Pinhole(width, height, focal, focal, width / 2, height / 2)
            first_frame.cameras.append(ExportedCamera(f"{path}: camera_angle_x", camera))
            names: dict[str, list[str]] = {name: [] for name in frames}
            previous = 0.0
            for index, entry in enumerate(content["frames"]):
                place = f"frames[{index}]"
                with reading(f"{path}: {place}", "frame"):
                    time = number(entry["time"])
                    picture = listing.parent / f"{entry['file_path']}.png"
                    matrix = numbers(entry["transform_matrix"], (4, 4))
                frame = next((n for n in frames if abs(times[n] - time) < _ROUNDING), None)
                if frame is None or time < previous or (index == 0 and time != 0):
                    problem = "times must begin at 0, grow, and be those of the frames"
                    first_frame.faults.append(f"{path}: {place}: time: is {time:g}; {problem}")
                    continue
                previous = time
                view = picture.stem.removeprefix(f"{frame}_")
                exported[frame].expect_picture(
                    f"{path}: {place}: file_path", picture, view, f"{frame}_{{}}.png"
                )
                exported[frame].views.append(ExportedView(path, place, view, matrix))
                names[frame].append(view)
        for frame in frames:
            exported[frame].parts.append(Part(f"{path}: frames of {frame}", part, names[frame]))
    cloud, faults = read_ply(listing.parent / "fused.ply")
    first_frame.clouds.append(cloud)
    first_frame.faults += faults
    return [*exported.values()]
