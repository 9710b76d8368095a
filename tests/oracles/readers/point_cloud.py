"""A point cloud without views: points.ply."""

from pathlib import Path
from typing import Any

from oracles.readers.contents import Exported
from oracles.readers.ply import read_ply


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the points.ply of an export."""
    cloud, faults = read_ply(listing.parent / "points.ply")
    return Exported(clouds=[cloud], faults=faults)
