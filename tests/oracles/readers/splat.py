"""A Gaussian splat: splat.ply, read as viewers do."""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from oracles.readers.contents import Cloud, Exported
from oracles.readers.ply import read_vertices


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the splat.ply of an export. Its Gaussians lie on the surfaces."""
    path = listing.parent / "splat.ply"
    with reading(path, "PLY of a splat"):
        vertices = read_vertices(path)
        positions = np.stack([vertices[axis] for axis in "xyz"], axis=-1)
        rotations = np.stack([vertices[f"rot_{i}"] for i in range(4)], axis=-1)
        sizes = np.stack([vertices[f"scale_{i}"] for i in range(3)], axis=-1)
    is_wrong = np.abs(np.linalg.norm(rotations, axis=-1) - 1) > 1e-5
    is_wrong |= ~np.isfinite(sizes).all(axis=-1)
    faults = [f"{path}: vertex {index}: has no shape" for index in np.flatnonzero(is_wrong)]
    cloud = Cloud(path, "vertex", np.arange(len(vertices)), positions)
    return Exported(clouds=[cloud], faults=faults)
