"""Keeps the finished files of a shard: asks the receipt of the job at work, and notes new files.

By hand, without a receipt, a file counts as finished if it is complete and its header has the key.
A JSON file has it under ``key``.
"""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256
from lightfield.engine import receipts
from lightfield.formats.layout import SUMS, read_sums
from lightfield.imaging import images


def is_finished(file: Path, key: str) -> bool:
    """Return whether a file has the bytes that the settings of ``key`` made."""
    receipt = receipts.current()
    if receipt is None:
        return _has_key(file, key)
    if not os.path.lexists(file):
        # Asking the other shards takes long if there are thousands.
        return False
    if not receipt.knows(file) and _is_published(file, key):
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


def _is_published(file: Path, key: str) -> bool:
    """Return whether a file has the key, and its dataset's published sums list its bytes.

    So the files of a dataset that was copied without its receipts are not made again.
    """
    # Not for a link to nowhere, or a folder.
    if not file.is_file() or not _has_key(file, key):
        return False
    return sha256(file) in _published_sums(_dataset_of(file))


def _dataset_of(file: Path) -> Path | None:
    """Return the folder of a file's dataset, if its sums are published."""
    return next((parent for parent in file.parents if (parent / SUMS).is_file()), None)


@lru_cache(maxsize=1)
def _published_sums(dataset: Path | None) -> frozenset[str]:
    """Return the SHA-256 of all published files of a dataset."""
    return frozenset(read_sums(dataset / SUMS).values()) if dataset else frozenset()
