"""The layout of Neural 3D Video, read as 4DGaussians' neural_3D_dataset_NDC.py does.

A row of poses_bounds.npy belongs to the video with the same place in the order of names. The same
cameras see every frame.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Floats,
    Part,
    numbers,
)
from oracles.readers.mp4 import read_mp4
from oracles.readers.ply import read_ply


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the poses, the videos' headers, and the points of the first frame."""
    folder = listing.parent
    path = folder / "poses_bounds.npy"
    exported = Exported()
    videos = sorted(folder.glob("cam*.mp4"))
    with reading(path, "poses_bounds.npy"):
        rows = numbers(np.load(path), (len(videos), 17))
    for index, (row, video) in enumerate(zip(rows, videos, strict=True)):
        place = f"row {index}"
        height, width, focal = row[4:15:5]
        camera = Pinhole(int(width), int(height), focal, focal, width / 2, height / 2)
        exported.cameras.append(ExportedCamera(f"{path}: {place}", camera))
        exported.views.append(ExportedView(path, place, video.stem, llff_matrix(row)))
        near, far = row[15:]
        exported.expect(f"{path}: {place}: 0 < near < far", bool(0 < near < far), True)
        facts = read_mp4(video)
        exported.expect(f"{video}: pixels", [facts.width, facts.height], list(size))
        exported.expect(f"{video}: pictures", facts.pictures, len(frames))
        exported.expect(f"{video}: pictures a second", round(facts.rate, 6), options["rate"])
    tests = [view.name or "" for view in exported.views[:1]]
    trains = [view.name or "" for view in exported.views[1:]]
    exported.parts += [Part(str(path), "test", tests), Part(str(path), "train", trains)]
    cloud, faults = read_ply(folder / "points3D_downsample2.ply")
    exported.clouds.append(cloud)
    exported.faults += faults
    later = [
        Exported(views=exported.views, cameras=exported.cameras) for _ in range(len(frames) - 1)
    ]
    return [exported, *later]


def llff_matrix(row: Floats) -> Floats:
    """Return the camera-to-world matrix (4, 4) of a row, whose columns are down, right, back."""
    down, right, back, position, _ = row[:15].reshape(3, 5).T
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, -down, back, position], axis=-1)
    return matrix
