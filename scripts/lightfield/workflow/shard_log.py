"""Keeps the finished files of a shard: asks the receipt of the job at work, and notes new files.

By hand, without a receipt, a file counts as finished if it is complete and its header has the key.
A JSON file has it under ``key``.
"""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from lightfield.core import receipts
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_json_lines, sha256
from lightfield.core.receipts import FOLDER, OpenReceipt
from lightfield.formats.layout import SUMS, read_sums
from lightfield.imaging import images

# Versions before receipts logged the finished files of a shard in files with this suffix.
_OLD_SUFFIX = ".sums.jsonl"


def is_finished(file: Path, key: str) -> bool:
    """Return whether a file has the bytes that the settings of ``key`` made."""
    receipt = receipts.current()
    if receipt is None:
        return _has_key(file, key)
    if not os.path.lexists(file):
        # Asking the other shards takes long if there are thousands.
        return False
    if not receipt.knows(file) and _is_of_older_version(file, key, receipt):
        receipt.adopt(file, key)
    return receipt.is_finished(file, key)


def add(file: Path, key: str) -> None:
    """Note a file that was just written. After a kill before this, it is made again."""
    if receipt := receipts.current():
        receipt.add(file, key)


def log(entry: Mapping[str, Any]) -> None:
    """Add a line to the history of the job at work."""
    if receipt := receipts.current():
        receipt.log(entry)


def _has_key(file: Path, key: str) -> bool:
    """Return whether a file exists, is complete, and has the key."""
    if file.suffix != ".json":
        return images.is_finished(file, key)
    try:
        return bool(read_json(file)["key"] == key)
    except (UserError, LookupError, TypeError):
        return False


def _is_of_older_version(file: Path, key: str, receipt: OpenReceipt) -> bool:
    """Return whether a version before receipts made a file, and noted its key and its sum."""
    if not file.is_file():
        # A link to nowhere, or a folder.
        return False
    digest = sha256(file)
    if (file.name, key, digest) in _old_notes(_old_folder(receipt)):
        return True
    return _has_key(file, key) and digest in _published_sums(_dataset_of(file))


def _old_folder(receipt: OpenReceipt) -> Path:
    """Return the folder in which older versions noted the files of a shard, or of a member."""
    inside = receipt.path.relative_to(receipt.work / FOLDER)
    return receipt.work / inside.parent


@lru_cache(maxsize=1)
def _old_notes(folder: Path) -> set[tuple[str, str, str]]:
    """Return name, key and SHA-256 of the files that older versions noted in a folder."""
    notes = set()
    for log in folder.rglob(f"*{_OLD_SUFFIX}"):
        for line in read_json_lines(log):
            if all(isinstance(line.get(name), str) for name in ("file", "key", "sha256")):
                notes.add((Path(line["file"]).name, line["key"], line["sha256"]))
    return notes


def _dataset_of(file: Path) -> Path | None:
    """Return the folder of a file's dataset, if its sums are published."""
    return next((parent for parent in file.parents if (parent / SUMS).is_file()), None)


@lru_cache(maxsize=1)
def _published_sums(dataset: Path | None) -> frozenset[str]:
    """Return the SHA-256 of all published files of a dataset."""
    return frozenset(read_sums(dataset / SUMS).values()) if dataset else frozenset()
