"""Keeps two runs from making the same datasets: each holds a lock until its process ends.

The kernel frees the lock of a killed process. Its jobs may live on: each holds a lock on its own
receipt (`lightfield.core.receipts`), for which the jobs of the next run wait.
"""

import fcntl
import json
import os
import pwd
import socket
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from lightfield.core.errors import UserError
from lightfield.core.files import open_file, read_bytes, writing

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
            _lock(file)
        except BlockingIOError:
            raise UserError(_refusal(path)) from None
        except OSError as error:
            print(f"warning: {path}: cannot be locked: {error.strerror}", file=sys.stderr)
        file.truncate(0)
        file.write(json.dumps([os.getpid(), _user(), socket.gethostname()]).encode())
        file.flush()
        _held.append(file)


def _user() -> str:
    """Return the name of this process's user."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"user {os.getuid()}"


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
    """Return which scene another run makes, and whose run it is."""
    try:
        number, user, host = json.loads(read_bytes(path))
    except (OSError, ValueError, TypeError):
        # That run has not written it yet, or is of an older version.
        whose, end = "", ""
    else:
        here = host == socket.gethostname()
        whose = f" (process {number} of {user}{'' if here else f' on {host}'})"
        is_own = here and user == _user()
        end = f", or end it (kill {number})" if is_own else f", or ask {user} to end it"
    return (
        f"another run{whose} makes the scene {path.parent.name}: wait for it{end}; "
        "snakemake --cores 1 status shows its progress"
    )


def is_held(folder: Path) -> bool:
    """Return whether a run holds the lock in a folder."""
    try:
        with open_file(folder / NAME) as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
