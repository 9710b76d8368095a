"""A point cloud in a binary PLY: positions, normals and colours of vertices.

Source: Turk, "The PLY Polygon File Format".
"""

from pathlib import Path

import numpy as np

from lightfield.core.files import reading
from oracles.readers.contents import Cloud, Floats

_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1"}
_FORMAT = "format binary_little_endian 1.0"
# A normal's length differs from 1 by less than this.
_NOT_UNIT = 1e-5


def read_ply(path: Path, transform: Floats | None = None) -> tuple[Cloud, list[str]]:
    """Return a file's points, mapped by ``transform`` (4, 4), and what is wrong with the file."""
    with reading(path, "binary PLY of points"):
        content = path.read_bytes()
        head, _, body = content.partition(b"end_header\n")
        lines = head.decode("ascii").split("\n")
        if lines[:2] != ["ply", _FORMAT]:
            raise ValueError(f"it does not begin with ply and {_FORMAT}")
        elements = [line.split() for line in lines if line.startswith("element ")]
        if [element[1] for element in elements] != ["vertex"]:
            raise ValueError("it must have vertices and nothing else")
        properties = [line.split() for line in lines if line.startswith("property ")]
        kinds = np.dtype([(name, _TYPES[kind]) for _, kind, name in properties])
        vertices = np.frombuffer(body, kinds)
        if len(vertices) != int(elements[0][2]):
            raise ValueError(f"it has {len(vertices)} vertices, but says {elements[0][2]}")
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
