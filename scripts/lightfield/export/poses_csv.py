"""Writes poses as a table for rigs of type ``poses``: metres, and XYZ Euler radians."""

from pathlib import Path

from lightfield.configuration.exports import PosesCsv
from lightfield.core.files import write_csv
from lightfield.export.source import SourceDataset
from lightfield.geometry.rigs.poses import CSV_HEADER


def export(source: SourceDataset, settings: PosesCsv, folder: Path) -> None:
    """Write ``poses.csv`` into ``folder``."""
    rows = [
        (view.name, *view.position.tolist(), *view.rotation.tolist())
        for view in source.lightfield.views
    ]
    write_csv(folder / "poses.csv", [dict(zip(CSV_HEADER, row, strict=True)) for row in rows])
