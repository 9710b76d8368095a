"""Keeps two runs from making the same datasets: each holds a lock until its process ends.

The kernel frees the lock of a killed process. Its jobs may live on: each holds a lock on its own
receipt (`lightfield.core.receipts`), for which the jobs of the next run wait.
"""

import fcntl
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from lightfield.core.errors import UserError

NAME = "run.lock"
# The open files whose locks this process holds.
_held: list[IO[bytes]] = []


def take(folders: Iterable[Path]) -> None:
    """Hold the lock in each folder until this process ends.

    Raises `UserError` if another run holds one of them. File systems without locks get a warning.
    """
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / NAME
        file = path.open("a+b")
        try:
            _lock(file)
        except BlockingIOError:
            raise UserError(_refusal(path)) from None
        except OSError as error:
            print(f"warning: {path}: cannot be locked: {error.strerror}", file=sys.stderr)
        file.truncate(0)
        file.write(f"{os.getpid()}\n".encode())
        file.flush()
        _held.append(file)


def _lock(file: IO[bytes]) -> None:
    """Lock a file. A plan looks at the lock for a moment, so this tries again for a second."""
    for _ in range(10):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(0.1)
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _refusal(path: Path) -> str:
    number = path.read_text(encoding="utf-8").strip()
    process = f", process {number}" if number else ""
    end = f", or end it (kill {number})" if number else ""
    return (
        f"another run makes these files{process}: wait for it{end}; snakemake --cores 1 status "
        "shows its progress"
    )


def is_held(folder: Path) -> bool:
    """Return whether a run holds the lock in a folder."""
    try:
        with (folder / NAME).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
