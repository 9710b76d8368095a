"""Poses as a table, which a rig of type ``poses`` reads: metres, and XYZ Euler radians."""

import csv
from pathlib import Path

from lightfield.core.files import atomic_path
from lightfield.dataset.exports import PosesCsv
from lightfield.export.source import Source
from lightfield.geometry.rigs.poses import CSV_HEADER


def export(source: Source, settings: PosesCsv, folder: Path) -> None:
    """Write ``poses.csv`` into ``folder``."""
    with (
        atomic_path(folder / "poses.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV_HEADER)
        for view in source.lightfield.views:
            writer.writerow([view.name, *view.position.tolist(), *view.rotation.tolist()])
