"""Writes a point cloud of all visible surfaces: a binary PLY with colours and normals."""

from pathlib import Path

from pydantic import Field

from lightfield.export.points import lift, write_ply
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import Developed


class PointCloud(Developed):
    """A .ply of all surfaces that the views see."""

    name = "point_cloud"
    summary = "Point cloud of all surfaces that the views see, for any program."
    rank = 18
    loader = "import open3d\ncloud = open3d.io.read_point_cloud('{}/points.ply')"
    needs_surfaces = True

    voxel: float = Field(
        0.01,
        gt=0,
        description="Side of a voxel. Each voxel keeps one point at most.",
        json_schema_extra={"unit": "m"},
    )

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``points.ply`` into ``folder``."""
        write_ply(folder / "points.ply", lift(source, voxel=self.voxel))
