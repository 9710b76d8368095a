"""Reads exports back, apart from the code that wrote them, and compares them with their views.

Exporters and oracles share no formula: an oracle knows what a consumer reads. `faults` compares the
exports of a dataset with its lightfield.json, its depth and its pixels. `sequence.faults` does the
same for the exports of a sequence.
"""

from collections.abc import Collection, Sequence
from pathlib import Path

from lightfield.formats.layout import ImageSet
from lightfield.validation.files import read_sets
from oracles import exported_cameras, exported_depth, exported_pictures


def faults(
    dataset: Path, reprojections: Sequence[str] = (), lists: Collection[Path] | None = None
) -> list[str]:
    """Return what is wrong in the exports of a dataset.

    ``lists`` are the export.json or transforms.json of the exports to read. None reads all.
    """
    dataset = dataset.resolve()
    sets, _ = read_sets(dataset, reprojections)
    return faults_of_sets(dataset, sets, lists)


def faults_of_sets(
    dataset: Path, sets: Sequence[ImageSet], lists: Collection[Path] | None = None
) -> list[str]:
    """Return what is wrong in the exports of a dataset whose light fields are read already."""
    problems, set_exports = exported_cameras.check(dataset, sets, lists)
    problems += exported_depth.faults(dataset, sets, set_exports)
    problems += exported_pictures.faults(dataset, sets, set_exports)
    return [problem.replace(f"{dataset}/", "") for problem in problems]
