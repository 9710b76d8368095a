"""A table of poses: name, x, y, z in metres, and rx, ry, rz, XYZ Euler angles in radians."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from lightfield.geometry.rotations import euler_to_matrix
from oracles.readers.contents import Exported, ExportedView, from_texts

HEADER = ["name", "x", "y", "z", "rx", "ry", "rz"]


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the poses.csv of an export."""
    path = listing.parent / "poses.csv"
    exported = Exported()
    with reading(path, "table of poses"), path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
        if header != HEADER:
            raise ValueError(f"its first row is not {','.join(HEADER)}")
        for index, (name, *texts) in enumerate(rows, 2):
            with reading(f"{path}: row {index}", "pose"):
                values = from_texts(texts)
                matrix = np.eye(4)
                matrix[:3, :3] = euler_to_matrix(values[3:6])
                matrix[:3, 3] = values[:3]
            exported.views.append(ExportedView(path, f"row {index}", name, matrix))
    return exported
