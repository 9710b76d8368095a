"""The files of a shard: what they are called, what its record holds, and whether it still does."""

import os
from pathlib import Path
from stat import S_ISREG

from lightfield.core.errors import UserError
from lightfield.core.files import read_json

# Of a shard's files beside its record, which have its name: what its processes did, and the
# checksum of each view from the moment it was finished.
JOURNAL_SUFFIX = ".journal.jsonl"
LOG_SUFFIX = ".sums.jsonl"


def read_record(record: Path) -> dict[str, tuple[int, str]]:
    """Return each file's bytes and SHA-256 by its path in the dataset; errors name the record."""
    content = read_json(record)
    try:
        return {path: (entry["bytes"], entry["sha256"]) for path, entry in content["files"].items()}
    except (LookupError, TypeError, AttributeError):
        raise UserError(f"{record}: files: must map paths to bytes and sha256") from None


def recorded_sizes(record: Path, folder: str) -> dict[str, int] | None:
    """Return the size of each of a record's files by its path in the dataset's ``folder``.

    None where the record is broken or not there, and where a file is not there or of another size:
    deleted, or cut short.
    """
    try:
        files = read_record(record)
    except UserError:
        return None
    try:
        for name, (size, _) in files.items():
            # A `Path` of each of a hundred thousand would take longer than all else.
            status = os.stat(f"{folder}/{name}")  # noqa: PTH116
            if status.st_size != size or not S_ISREG(status.st_mode):
                return None
    except OSError:
        return None
    return {name: size for name, (size, _) in files.items()}
