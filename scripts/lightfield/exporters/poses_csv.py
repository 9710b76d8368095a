"""Writes poses as a table for rigs of type ``poses``: metres, and XYZ Euler radians."""

from pathlib import Path

from lightfield.core.files import write_csv
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import Export
from lightfield.geometry.rigs.poses import CSV_HEADER


class PosesCsv(Export):
    """A table of poses: name, position, rotation."""

    name = "poses_csv"
    summary = "Table of poses, for any program."
    rank = 17
    loader = "import csv\nposes = list(csv.DictReader(open('{}/poses.csv')))"

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``poses.csv`` into ``folder``."""
        rows = [
            (view.name, *view.position.tolist(), *view.rotation.tolist())
            for view in source.lightfield.views
        ]
        write_csv(folder / "poses.csv", [dict(zip(CSV_HEADER, row, strict=True)) for row in rows])
