"""Pairs of views, read as DUSt3R's dataset Waymo does.

OpenCV's axes of poses are undone, and pixel centres at whole numbers. Its JPEGs are lossy, so the
exporter's test compares their colours.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from oracles.readers.cameras import Pinhole
from oracles.readers.contents import Exported, ExportedCamera, ExportedView


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the waymo_pairs.npz of an export, and the files of its views."""
    folder = listing.parent
    path = folder / "waymo_pairs.npz"
    exported = Exported()
    with reading(path, "list of pairs"):
        with np.load(path) as data:
            scenes, frames, pairs = (data[key] for key in ("scenes", "frames", "pairs"))
        exported.expect(f"{path}: scenes", int(pairs[:, 0].max()), len(scenes) - 1)
        exported.expect(f"{path}: pairs", bool((pairs[:, 1] < pairs[:, 2]).all()), True)
        exported.expect(f"{path}: frames", bool(pairs[:, 1:].max() < len(frames)), True)
        for name in frames.tolist():
            place = folder / str(scenes[0]) / name
            camera = place.with_name(f"{place.name}.npz")
            with reading(camera, "camera"), np.load(camera) as data:
                (fx, _, cx), (_, fy, cy), _ = data["intrinsics"].tolist()
                matrix = data["cam2world"] @ np.diag([1, -1, -1, 1])
            pinhole = Pinhole(*size, fx, fy, cx + 0.5, cy + 0.5)
            exported.cameras.append(ExportedCamera(str(camera), pinhole))
            exported.views.append(ExportedView(camera, "cam2world", name, matrix))
            for suffix in (".jpg", ".exr"):
                picture = place.with_name(f"{place.name}{suffix}")
                exported.expect_picture(str(camera), picture, name, f"{{}}{suffix}")
            exported.add_picture(picture, name, "metres", meaning="z")
    return exported
