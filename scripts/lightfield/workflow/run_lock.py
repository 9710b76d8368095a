"""Keeps two runs from making the same datasets: each holds a lock until its process ends.

The kernel frees the lock of a killed process. Its jobs may live on: each holds a lock on its own
receipt (`lightfield.engine.receipts`), for which the jobs of the next run wait.
"""

import json
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from lightfield.core.errors import UserError
from lightfield.core.files import open_file, read_bytes, writing
from lightfield.core.locks import Holder, try_lock

NAME = "run.lock"
# The open files whose locks this process holds.
_held: list[IO[bytes]] = []


def take(folders: Iterable[Path]) -> None:
    """Hold the lock in the folder of each scene until this process ends.

    Raises `UserError` if another run holds one of them. File systems without locks get a warning.
    """
    for folder in folders:
        path = folder / NAME
        with writing(path):
            folder.mkdir(parents=True, exist_ok=True)
            file = path.open("a+b")
        try:
            if not _lock(file):
                raise UserError(_refusal(path))
        except OSError as error:
            print(f"warning: {path}: cannot be locked: {error.strerror}", file=sys.stderr)
        file.truncate(0)
        # The kernel does not say who holds a lock on another machine.
        file.write(json.dumps(Holder.this_process()).encode())
        file.flush()
        _held.append(file)


def _lock(file: IO[bytes]) -> bool:
    """Lock a file. Return False if another run holds the lock.

    A plan looks at the lock for a moment, so this tries again for a second.
    """
    for _ in range(10):
        if try_lock(file):
            return True
        time.sleep(0.1)
    return try_lock(file)


def _refusal(path: Path) -> str:
    """Return which scene another run makes, and whose run it is."""
    try:
        holder = Holder(*json.loads(read_bytes(path)))
    except (OSError, ValueError, TypeError):
        # That run has not written it yet, or is of an older version.
        whose, end = "", ""
    else:
        whose = f" ({holder})"
        end = f", or ask {holder.user} to end it"
        if holder.is_own:
            end = f", or end it (kill {holder.process})"
    return (
        f"another run{whose} makes the scene {path.parent.name}: wait for it{end}; "
        "snakemake --cores 1 status shows its progress"
    )


def is_held(folder: Path) -> bool:
    """Return whether a run holds the lock in a folder."""
    try:
        with open_file(folder / NAME) as file:
            # Shared, so that two plans do not take each other for a run.
            return not try_lock(file, shared=True)
    except OSError:
        return False
