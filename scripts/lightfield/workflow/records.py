"""A shard's record and its log of checksums, which show what files are finished.

The record is a JSON that is written when all files of the shard are finished. Its key "files" has
the "bytes" and "sha256" of each file, by its path in the dataset.

The log beside it, <record's name>.sums.jsonl, gets a line of JSON when a file is finished. It has
"file", "key" (of the settings that made it), "bytes" and "sha256". A file is finished if it still
has the logged bytes. The log outlives the record, which is removed when its files change.

On machines without a common folder, the view store takes the log's place.
"""

import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import (
    absolute_path,
    append_json_line,
    read_json,
    sha256,
    write_json,
)
from lightfield.imaging import images
from lightfield.workflow.shard_files import LOG_SUFFIX, logged_lines
from lightfield.workflow.view_store import ViewStore


class ShardRecord:
    """The record at ``path`` of a shard's files, in ``folder`` of a dataset or beside it.

    With ``path`` None nothing is recorded. A file then counts as finished if it is complete, and
    its header has the key. A JSON has it under ``key``.
    """

    def __init__(self, path: Path | None, folder: Path) -> None:
        self._path = path
        self._folder = folder
        # The name of a link, not that of the folder that it leads to.
        self._dataset_folder = absolute_path(folder).name
        self._finished: dict[str, dict[str, Any]] = {}
        self._store = ViewStore.configured()

    def is_finished(self, file: Path, key: str) -> bool:
        """Return whether a file still has the bytes that the settings of ``key`` made."""
        if self._path is None:
            is_finished = _names_key if file.suffix == ".json" else images.is_finished
            return is_finished(file, key)
        if self._store:
            self._take(file, key)
        if not file.is_file():
            return False
        name = self._name(file)
        sums = _sums(file)
        entry = (name, key, sums["sha256"])
        if entry not in self._logged_here and not self._is_logged_elsewhere(entry):
            return False
        self._finished[name] = sums
        return True

    def _is_logged_elsewhere(self, entry: tuple[Any, Any, Any]) -> bool:
        """Return whether another shard made this file, when shards had other bounds.

        Does not read the other logs if this shard made the file by other settings. Otherwise
        thousands of shards would each read the logs of all.
        """
        name, _, digest = entry
        return (name, digest) not in self._made_here and entry in self._logged_elsewhere

    def refuse_changed(self, file: Path, key: str) -> None:
        """Raise `UserError` for a file that was last logged for ``key``, but with other bytes."""
        if self._path is None:
            return
        last = self._last_logged.get(self._name(file), {})
        if last.get("key") == key and last.get("sha256") != sha256(file):
            raise UserError(
                f"{file}: has other bytes than at its import; put the right file back at its "
                f"source, or remove {_log(self._path)} to accept this one"
            )

    def add(self, file: Path, key: str) -> None:
        """Log a file that has just been finished. After a kill before this, it is made again."""
        if self._path is None:
            return
        name = self._name(file)
        sums = _sums(file)
        if self._store:
            self._store.put_view(file, name, key, sums["sha256"])
        append_json_line(_log(self._path), {"file": name, "key": key, **sums})
        self._finished[name] = sums

    def _take(self, file: Path, key: str) -> None:
        """Take the file that the settings of ``key`` made from the store, if the store has it."""
        assert self._store and self._path
        name = self._name(file)
        for stored_name, digest in self._store.listed(key):
            if stored_name == name and self._store.take(digest, file):
                entry = (name, key, digest)
                if entry not in self._logged_here:
                    append_json_line(_log(self._path), {"file": name, "key": key, **_sums(file)})
                    self._logged_here.add(entry)
                return

    def write(self, files: Iterable[Path], **more_keys: Any) -> None:
        """Write the record of ``files``, with ``more_keys``."""
        if self._path is None:
            return
        content = {}
        for file in files:
            name = self._name(file)
            content[name] = self._finished.get(name) or _sums(file)
        write_json(self._path, {"files": content, **more_keys})

    def _name(self, file: Path) -> str:
        # A view's passes lie beside the folder of the views.
        return os.path.normpath(Path(self._dataset_folder, os.path.relpath(file, self._folder)))

    @cached_property
    def _last_logged(self) -> dict[Any, dict[str, Any]]:
        """The last line of the log for each file."""
        assert self._path
        log = _log(self._path)
        return {line["file"]: line for line in logged_lines(log)} if log.exists() else {}

    @cached_property
    def _logged_here(self) -> set[tuple[Any, Any, Any]]:
        assert self._path
        log = _log(self._path)
        return _entries([log] if log.exists() else [])

    @cached_property
    def _made_here(self) -> set[tuple[Any, Any]]:
        """Name and SHA-256 of all files that this shard made, by any settings."""
        return {(name, digest) for name, _, digest in self._logged_here}

    @cached_property
    def _logged_elsewhere(self) -> set[tuple[Any, Any, Any]]:
        assert self._path
        return _entries(self._path.parent.glob(f"*{LOG_SUFFIX}"))


def _names_key(file: Path, key: str) -> bool:
    """Return whether a JSON file exists, is complete, and was made with the settings of ``key``."""
    try:
        return bool(read_json(file)["key"] == key)
    except (UserError, LookupError, TypeError):
        return False


def _log(record: Path) -> Path:
    return record.with_name(record.stem + LOG_SUFFIX)


def _entries(logs: Iterable[Path]) -> set[tuple[Any, Any, Any]]:
    """Return file, key and SHA-256 of every line of the logs."""
    return {
        (line["file"], line["key"], line["sha256"]) for log in logs for line in logged_lines(log)
    }


def _sums(file: Path) -> dict[str, Any]:
    return {"bytes": file.stat().st_size, "sha256": sha256(file)}
