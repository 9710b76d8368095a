"""The ledger: the checksum of every file that a job of the workflow made, noted when a run ends.

work/sums.json: "files" gives each one's "bytes" and "sha256" by its path, "sha256" is of "files".
What lies in a shard is not in it: a shard's own record and log have that.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json

NAME = "sums.json"
Sums = dict[str, dict[str, Any]]


def read(path: Path) -> Sums:
    """Return the bytes and SHA-256 of each file by its path; nothing where there is no ledger.

    Raises `UserError` for one that is damaged.
    """
    if not path.exists():
        return {}
    content = read_json(path)
    if not isinstance(content, dict) or content.get("sha256") != _digest(content.get("files")):
        raise UserError(f"{path}: is damaged: its own checksum does not hold")
    files: Sums = content["files"]
    return files


def write(path: Path, files: Mapping[str, Any]) -> None:
    """Write the ledger, atomically."""
    ordered = dict(sorted(files.items()))
    write_json(path, {"files": ordered, "sha256": _digest(ordered)})


def note(
    path: Path, made: Iterable[str], others: Iterable[str], is_obsolete: Callable[[str], bool]
) -> None:
    """Note the files that were ``made`` now, and those of the ``others`` that it lacks.

    The others were made by a run that was killed before it could note them. What ``is_obsolete``
    and no longer there is left out from now on.
    """
    try:
        files = read(path)
    except UserError:
        files = {}
    known = dict(files)
    new = [*made, *(name for name in others if name not in known)]
    for file in map(Path, new):
        if file.is_file():
            files[str(file)] = {"bytes": file.stat().st_size, "sha256": sha256(file)}
    for name in list(files):
        if is_obsolete(name) and not Path(name).exists():
            del files[name]
    if files != known:
        write(path, files)


def damage(files: Sums, path: str) -> str | None:
    """Say of a file that it has other bytes than those noted in ``files``; None if it has not."""
    if path in files and Path(path).is_file() and sha256(path) != files[path]["sha256"]:
        return f"its sha256 is not the one in {NAME}"
    return None


def _digest(files: Any) -> str:
    return hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()
