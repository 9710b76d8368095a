"""What is there of a dataset now, and what of it can no longer be used."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, unreadable
from lightfield.dataset import config, shard_files
from lightfield.dataset.dataset import Dataset
from lightfield.dataset.view_store import ViewStore


def missing_views(dataset: Dataset) -> int:
    """How many views are not there yet."""
    there = sum(entry.name.endswith(".exr") for entry in _entries(dataset.folder, "exr"))
    return max(0, dataset.view_count - there)


def broken_files(dataset: Dataset) -> Iterator[tuple[str, str]]:
    """Yield each view and journal that cannot be read as a file, and why."""
    views = (view for name in dataset.image_folders for view in _entries(dataset.folder, name))
    journals = (journal for stage in dataset.stages for journal in _entries(dataset.work, stage))
    for entry in (*views, *journals):
        is_own = entry.name.endswith((".exr", ".png", ".jsonl"))
        if is_own and (problem := unreadable(entry.path)):
            yield entry.path, problem


def outgrown_records(dataset: Dataset) -> list[str]:
    """Return the records of imported views that were written anew since they were taken over.

    So is one whose source has another size. A view that left its source is needed no more.
    """
    if not dataset.imported:
        return []
    return [path for path in dataset.records("render") if _is_outgrown(dataset, Path(path))]


def _is_outgrown(dataset: Dataset, record: Path) -> bool:
    sizes = shard_files.recorded_sizes(record, dataset.folder)
    if not sizes:
        return False
    taken = record.stat().st_mtime_ns
    for name, size in sizes.items():
        source_size, changed = _size_and_time(Path(str(dataset.imported), name))
        if changed and (source_size != size or changed > taken):
            return True
    return False


def external_changed(dataset: Dataset, store: ViewStore | None) -> bool:
    """Whether a file that the user's .blend reads is no longer the one in its inventory.

    So is one that the view store has lost, if there is one.
    """
    if not dataset.source.blend:
        return False
    home = Path(dataset.source.blend).parent
    try:
        return any(
            _size_and_time(home / file["path"]) != (file["bytes"], file["mtime_ns"])
            or (store and file["bytes"] and not store.has(file["sha256"], file["bytes"]))
            for file in json.loads(Path(str(dataset.inventory)).read_bytes())["external_files"]
        )
    except FileNotFoundError:
        return False
    except (OSError, *DAMAGE):
        return True


def check_presence(dataset: Dataset) -> None:
    """Check that the user's .blend is where the scene YAML says, or can be downloaded.

    Raises `UserError`. Where machines see no common folder, only that of the user has the file.
    """
    source = dataset.source
    if source.blend and not source.url and not Path(source.blend).is_file():
        page = f"get it from {source.page} and " if source.page else ""
        raise UserError(
            f"{config.OWN_SCENES}/{dataset.scene_name}.yaml: scene.blend: "
            f"there is no file {source.blend}; {page}put it there"
        )


def check_external_files(dataset: Dataset) -> None:
    """Check that the files are there which the user's .blend read when it was last listed.

    Raises `UserError`. Of a .blend that was never listed nothing is known.
    """
    source = dataset.source
    if not source.blend or source.allow_missing:
        return
    try:
        listed = json.loads(Path(str(dataset.inventory)).read_bytes())["external_files"]
        home = Path(source.blend).parent
        paths = [
            Path(os.path.normpath(home / file["path"]))
            for file in listed
            if file["bytes"] is not None
        ]
    except (OSError, *DAMAGE):
        return
    # Path.exists() raises for a path that is too long; os.path.exists() does not.
    missing = [str(path) for path in paths if not os.path.exists(path)]  # noqa: PTH110
    if missing:
        more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
        raise UserError(
            f"{source.blend}: files that it shows are missing: {', '.join(missing[:8])}{more}; put "
            "them back, or render without them: scene: {allow_missing: true}"
        )


def check_imported(dataset: Dataset) -> None:
    """Check that the views of a dataset to import are where its lightfield.json is.

    Raises `UserError`.
    """
    folder = Path(str(dataset.imported), "exr")
    missing = [
        f"{pose.name}.exr"
        for pose in dataset.rig.poses()
        if not (folder / f"{pose.name}.exr").is_file()
    ]
    if missing:
        more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
        raise UserError(
            f"{folder}: {', '.join(missing[:8])}{more}: no such file, but the dataset's "
            "lightfield.json has the view"
        )


def _size_and_time(path: Path) -> tuple[int, int] | tuple[None, None]:
    """Return a file's bytes and when it was changed, in nanoseconds; None where there is none."""
    if not path.is_file():
        return None, None
    status = path.stat()
    return status.st_size, status.st_mtime_ns


def _entries(folder: str, name: str) -> list[os.DirEntry[str]]:
    """Return what lies in a folder in ``folder``; nothing where there is none."""
    try:
        with os.scandir(Path(folder, name)) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return []
