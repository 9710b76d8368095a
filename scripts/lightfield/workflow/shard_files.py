"""The files of a shard: their names, and the contents of its record."""

import os
from collections.abc import Iterator
from pathlib import Path
from stat import S_ISREG
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_json_lines
from lightfield.core.paths import check_inside

# A shard's other files have the name of its record, and these suffixes.
# The journal says what the shard's processes did.
JOURNAL_SUFFIX = ".journal.jsonl"
# The log has the checksum of each finished view.
LOG_SUFFIX = ".sums.jsonl"


def read_record(record: Path) -> dict[str, tuple[int, str]]:
    """Return each file's bytes and SHA-256 by its path in the dataset. Errors name the record.

    Raises `UserError` for a path that leads out of the dataset.
    """
    content = read_json(record)
    try:
        files = {
            path: (entry["bytes"], entry["sha256"]) for path, entry in content["files"].items()
        }
    except (LookupError, TypeError, AttributeError):
        raise UserError(f"{record}: files: must map paths to bytes and sha256") from None
    for path in files:
        check_inside(path, f"{record}: files")
    return files


def logged_lines(log: Path) -> Iterator[dict[str, Any]]:
    """Yield the complete lines of a log. Skips damaged lines.

    Raises `UserError` for a path that leads out of the dataset.
    """
    for line in read_json_lines(log):
        if all(isinstance(line.get(key), str) for key in ("file", "key", "sha256")):
            check_inside(line["file"], f"{log}: file")
            yield line


def recorded_sizes(record: Path, folder: str) -> dict[str, int] | None:
    """Return the size of each of a record's files by its path in the dataset's ``folder``.

    None if the record is missing or broken, or if a file is missing or has another size.
    """
    try:
        files = read_record(record)
    except UserError:
        return None
    try:
        for name, (size, _) in files.items():
            status = os.stat(f"{folder}/{name}")  # noqa: PTH116, a `Path` is slow for 100,000 files
            if status.st_size != size or not S_ISREG(status.st_mode):
                return None
    except OSError:
        return None
    return {name: size for name, (size, _) in files.items()}
