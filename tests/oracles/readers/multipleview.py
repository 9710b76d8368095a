"""4DGaussians' MultipleView, read as its multipleview_dataset.py and dataset_readers.py do.

The image numbered n of the model is the camera of the folder cam<n>, which sees every frame.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import reading
from lightfield.imaging import images
from oracles.readers.colmap import exported_model, read_model
from oracles.readers.contents import Exported, numbers
from oracles.readers.neural_3d_video import llff_matrix
from oracles.readers.ply import read_ply


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the model, the poses, the pictures' headers, and the points of the first frame."""
    folder = listing.parent
    exported = exported_model(read_model(folder / "sparse_", ".bin"), None)
    path = folder / "poses_bounds_multipleview.npy"
    with reading(path, "poses_bounds.npy"):
        rows = numbers(np.load(path), (len(exported.views), 17))
    for index, (row, view) in enumerate(zip(rows, exported.views, strict=True)):
        exported.expect(f"{path}: row {index}: pose", llff_matrix(row), view.world_from_camera)
        exported.expect(f"{path}: row {index}: 0 < near < far", bool(0 < row[15] < row[16]), True)
        camera = folder / f"cam{(view.name or '').removeprefix('image').zfill(2)}"
        exported.faults += _picture_faults(camera, size, len(frames))
    cloud, faults = read_ply(folder / "points3D_multipleview.ply")
    # The model has no points of its own.
    exported.clouds = [cloud]
    exported.faults += faults
    same_cameras = Exported(views=exported.views, cameras=exported.cameras)
    return [exported, *[same_cameras] * (len(frames) - 1)]


def _picture_faults(camera: Path, size: tuple[int, int], count: int) -> list[str]:
    """Return what is wrong with a camera's frames. The reader counts all files in its folder."""
    expected = [f"frame_{number:05d}.jpg" for number in range(1, count + 1)]
    if sorted(path.name for path in camera.glob("*")) != expected:
        return [f"{camera}: must have {expected[0]} to {expected[-1]}, and nothing else"]
    faults = []
    for name in expected:
        try:
            header = images.read_header(camera / name)
        except UserError as error:
            faults.append(str(error))
            continue
        if (header.width, header.height) != size:
            faults.append(f"{camera / name}: does not have the size of its view")
    return faults
