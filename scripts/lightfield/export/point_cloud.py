"""Writes a point cloud of all visible surfaces: a binary PLY with colours and normals."""

from pathlib import Path

from lightfield.configuration.exports import PointCloud
from lightfield.export.points import lift, write_ply
from lightfield.export.source import SourceDataset


def export(source: SourceDataset, settings: PointCloud, folder: Path) -> None:
    """Write ``points.ply`` into ``folder``."""
    write_ply(folder / "points.ply", lift(source, voxel=settings.voxel))
