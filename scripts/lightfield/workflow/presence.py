"""Checks which files of a dataset exist, and which are broken or outdated."""

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, is_outdated, size_and_time, unreadable
from lightfield.workflow import shard_files
from lightfield.workflow.view_store import ViewStore

# Some file systems keep times to two seconds.
_TIME_PRECISION_NS = 2 * 10**9


def missing_views(dataset: Dataset) -> int:
    """Return how many views do not exist yet."""
    existing = sum(entry.name.endswith(".exr") for entry in _entries(dataset.paths.folder, "exr"))
    return max(0, dataset.view_count - existing)


def broken_files(dataset: Dataset) -> Iterator[tuple[str, str]]:
    """Yield each view and journal that cannot be read as a file, and why."""
    entries = []
    for name in dataset.image_folders:
        entries += _entries(dataset.paths.folder, name)
    for stage in dataset.stages:
        entries += _entries(dataset.paths.work, stage)
    for entry in entries:
        is_view_or_journal = entry.name.endswith((".exr", ".png", ".jsonl"))
        if is_view_or_journal and (problem := unreadable(entry.path)):
            yield entry.path, problem


def outgrown_records(dataset: Dataset) -> list[str]:
    """Return the records of imported views whose source files have changed since the import."""
    if not dataset.imported:
        return []
    return [path for path in dataset.records("render") if _is_outgrown(dataset, Path(path))]


def _is_outgrown(dataset: Dataset, record: Path) -> bool:
    """Return whether a source file is newer than the record, or not the one that was imported.

    The imported file has the size and time of its source, but a source may be replaced by an older
    file. A source file that no longer exists does not count, because the import has its copy.
    """
    sizes = shard_files.recorded_sizes(record, dataset.paths.folder)
    if not sizes:
        return False
    import_time = record.stat().st_mtime_ns
    for name, size in sizes.items():
        source = size_and_time(Path(str(dataset.imported), name))
        imported = size_and_time(Path(dataset.paths.folder, name))
        if source is None or imported is None:
            continue
        source_size, source_time = source
        is_other_file = abs(source_time - imported[1]) > _TIME_PRECISION_NS
        if source_size != size or source_time > import_time or is_other_file:
            return True
    return False


def external_changed(dataset: Dataset, store: ViewStore | None) -> bool:
    """Return whether a file that the user's .blend reads differs from its inventory.

    Also return True if a view store has lost such a file.
    """
    if not dataset.source.blend:
        return False
    home = Path(dataset.source.blend).parent

    def differs(inventory: Mapping[str, Any]) -> bool:
        for file in inventory["external_files"]:
            if _has_changed(home, file):
                return True
            if store and file["bytes"] and not store.has(file["sha256"], file["bytes"]):
                return True
        return False

    return is_outdated(Path(dataset.paths.inventory), differs)


def model_changed(dataset: Dataset) -> bool:
    """Return whether a file that a model was read from differs from the record of its import."""
    if not dataset.source.model:
        return False
    home = Path(dataset.source.model).parent
    return is_outdated(
        Path(dataset.paths.model_record),
        lambda record: any(_has_changed(home, file) for file in record["external_files"]),
    )


def _has_changed(home: Path, file: Mapping[str, Any]) -> bool:
    """Return whether a file, with its path from ``home``, has another size or time than listed."""
    listed = (file["bytes"], file["mtime_ns"])
    return (size_and_time(home / file["path"]) or (None, None)) != listed


def check_presence(dataset: Dataset) -> None:
    """Check that the user's .blend exists or can be downloaded, and that the model exists.

    Raises `UserError`.

    On machines without a common folder, only the user's machine has the file.
    """
    source = dataset.source
    if source.model and not Path(source.model).is_file():
        raise UserError(
            f"{scene_yaml.OWN_SCENES}/{dataset.scene_name}.yaml: scene.model: "
            f"there is no file {source.model}; put it there"
        )
    if source.blend and not source.url and not Path(source.blend).is_file():
        page = f"get it from {source.page} and " if source.page else ""
        raise UserError(
            f"{scene_yaml.OWN_SCENES}/{dataset.scene_name}.yaml: scene.blend: "
            f"there is no file {source.blend}; {page}put it there"
        )


def check_external_files(dataset: Dataset) -> None:
    """Check that the files in the inventory of the user's .blend exist. Raises `UserError`.

    Without an inventory, nothing is checked.
    """
    source = dataset.source
    if not source.blend or source.allow_missing:
        return
    try:
        inventory = json.loads(Path(dataset.paths.inventory).read_bytes())
        home = Path(source.blend).parent
        paths = [
            Path(os.path.normpath(home / file["path"]))
            for file in inventory["external_files"]
            if file["bytes"] is not None
        ]
    except (OSError, *DAMAGE):
        return
    # Path.exists() raises for a path that is too long. os.path.exists() does not.
    missing_files = [str(path) for path in paths if not os.path.exists(path)]  # noqa: PTH110
    if missing_files:
        raise UserError(
            f"{source.blend}: files that it shows are missing: {_first_names(missing_files)}; put "
            "them back, or render without them: scene: {allow_missing: true}"
        )


def check_imported(dataset: Dataset) -> None:
    """Check that the views of a dataset to import exist. Raises `UserError`."""
    folder = Path(str(dataset.imported), "exr")
    files = [f"{pose.name}.exr" for pose in dataset.rig.poses()]
    missing_files = [file for file in files if not (folder / file).is_file()]
    if missing_files:
        raise UserError(
            f"{folder}: {_first_names(missing_files)}: no such file, but the dataset's "
            "lightfield.json has the view"
        )


def _first_names(names: list[str]) -> str:
    """Return the first eight names, and the number of the others."""
    text = ", ".join(names[:8])
    return text if len(names) <= 8 else f"{text} and {len(names) - 8} more"


def _entries(folder: str, name: str) -> list[os.DirEntry[str]]:
    """Return the entries of the folder ``name`` in ``folder``. Empty if it does not exist."""
    try:
        with os.scandir(Path(folder, name)) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return []
