"""The files of a shard: what they are called, and whether they have the sizes of its record."""

import json
import os
from pathlib import Path
from stat import S_ISREG

from lightfield.core.files import DAMAGE

# Of a shard's files beside its record, which have its name: what its processes did, and the
# checksum of each view from the moment it was finished.
JOURNAL_SUFFIX, LOG_SUFFIX = ".journal.jsonl", ".sums.jsonl"


def recorded(record: Path, folder: str) -> dict[str, int] | None:
    """Return the size of each of a record's files by its path in the dataset's ``folder``.

    None where a file is not there, or of another size: deleted, or cut short. None, too, for a
    record that is broken; raises FileNotFoundError where there is none.
    """
    try:
        files = json.loads(record.read_bytes())["files"]
        sizes: dict[str, int] = {name: entry["bytes"] for name, entry in files.items()}
    except FileNotFoundError:
        raise
    except (OSError, *DAMAGE):
        return None
    try:
        for name, size in sizes.items():
            # A `Path` of each of a hundred thousand would take longer than all else.
            status = os.stat(f"{folder}/{name}")  # noqa: PTH116
            if status.st_size != size or not S_ISREG(status.st_mode):
                return None
    except OSError:
        return None
    return sizes
