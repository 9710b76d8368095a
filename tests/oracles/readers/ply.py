"""A point cloud in a binary PLY: positions, normals and colours of vertices.

Source: Turk, "The PLY Polygon File Format".
"""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from lightfield.core.files import reading
from oracles.readers.contents import Cloud, Floats

# A normal's length differs from 1 by less than this.
_NOT_UNIT = 1e-5


def read_vertices(path: Path) -> NDArray[Any]:
    """Return a file's vertices, with a field for each property."""
    raw = trimesh.load(path).metadata["_ply_raw"]
    if [*raw] != ["vertex"]:
        raise ValueError("it must have vertices and nothing else")
    return np.asarray(raw["vertex"]["data"])


def read_ply(path: Path, transform: Floats | None = None) -> tuple[Cloud, list[str]]:
    """Return a file's points, mapped by ``transform`` (4, 4), and what is wrong with the file."""
    with reading(path, "binary PLY of points"):
        vertices = read_vertices(path)
        positions = np.stack([vertices[axis] for axis in "xyz"], axis=-1)
        normals = np.stack([vertices[f"n{axis}"] for axis in "xyz"], axis=-1)
    # A damaged number may be anything.
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(normals, axis=-1)
    wrong = np.flatnonzero(~((np.abs(lengths - 1) < _NOT_UNIT) | (lengths == 0)))
    faults = [f"{path}: vertex {index}: its normal is not a unit vector" for index in wrong]
    if transform is not None and not np.array_equal(transform, np.eye(4)):
        positions = positions @ transform[:3, :3].T + transform[:3, 3]
    return Cloud(path, "vertex", np.arange(len(vertices)), positions), faults
