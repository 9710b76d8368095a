"""Finds and reads what is known of the time that a dataset's views take."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

from lightfield.configuration.config_file import Configuration
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import Paths
from lightfield.core.errors import UserError
from lightfield.core.names import RENDERED, scene_folder
from lightfield.engine.receipts import FOLDER
from lightfield.planning.cost import probe_path
from lightfield.planning.estimate import Known, read_gpu_check, read_probe
from lightfield.workflow.finished_views import read_finished_views

Content = TypeVar("Content")


class TimeFiles(NamedTuple):
    """The files that tell the time of a dataset's views. Each of them may be missing.

    ``finished`` has the lightfield.json and the folder of receipts of the dataset's views under
    each preset.
    """

    probe: Path
    gpu_check: Path
    finished: list[tuple[Path, Path]]

    def read(self) -> Known:
        """Return what the files say."""
        return read_known(self.probe, self.gpu_check, self.finished)


def time_files(dataset: Dataset, config: Configuration) -> TimeFiles:
    """Return the files that tell the time of a dataset's views."""
    checked = Path(dataset.results_root, "benchmarks/gpu_check", f"{dataset.scene_name}.json")
    return TimeFiles(probe_path(dataset), checked, [*_finished(dataset, config)])


def _finished(dataset: Dataset, config: Configuration) -> Iterator[tuple[Path, Path]]:
    folders = [scene_folder(dataset.scene_name, preset) for preset in config.presets]
    # A member of a family has no presets of its own.
    for folder in [dataset.scene_folder] if dataset.member else folders:
        paths = Paths(dataset.results_root, dataset.work_root, folder, dataset.rig_folder)
        receipts = Path(dataset.work_root, FOLDER, folder, dataset.rig_folder, RENDERED)
        yield Path(paths.lightfield), receipts


def finished_of(finished: Iterable[tuple[str, Path, Path]], name: str) -> list[tuple[Path, Path]]:
    """Return the files of the finished views of a dataset, which is named before its files."""
    return [(views, receipts) for dataset, views, receipts in finished if dataset == name]


def read_known(
    probe: Path | None, gpu_check: Path | None, finished: Iterable[tuple[Path, Path]]
) -> Known:
    """Return what files say of the time of views. Missing and damaged files say nothing."""
    views = (read_finished_views(lightfield, receipts) for lightfield, receipts in finished)
    return Known(
        _read(read_probe, probe),
        _read(read_gpu_check, gpu_check),
        [each for each in views if each],
    )


def _read(reader: Callable[[Path], Content], path: Path | None) -> Content | None:
    if path is None or not path.exists():
        return None
    try:
        return reader(path)
    except UserError:
        return None
