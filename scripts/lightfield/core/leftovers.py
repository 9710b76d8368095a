"""Removes what killed processes leave behind: temporary folders, and half-written files."""

import fcntl
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lightfield.core.disk_space import SHARED_MEMORY
from lightfield.core.files import is_locked

# No user's folder may have this prefix: it would be removed.
PREFIX = "plenoforge-temporary-"
# Every Blender that runs has such a folder, an artist's, too.
BLENDERS = "blender_*"
# The names of `atomic_path`.
_ON_THE_WAY = re.compile(r"\..+\.\d+\.tmp(\.\w+)?")
# Seconds: nobody writes one file for so long, or has a Blender with an empty folder.
FILE_AGE = 3600.0
BLENDER_AGE = 24 * 3600.0
# Between making a folder and taking it.
FOLDER_AGE = 60.0


@contextmanager
def temporary_folder(parent: Path | str | None = None) -> Iterator[Path]:
    """Yield a temporary folder in ``parent``, or where the machine has its own.

    It is removed at the end, and where this process is killed by `remove`: a lock shows whether the
    process lives, which a number would not from within a container.
    """
    with tempfile.TemporaryDirectory(prefix=PREFIX, dir=parent) as name:
        lock = os.open(name, os.O_RDONLY)
        try:
            # Without locks of folders, as on some networks' file systems, `remove` leaves it.
            with suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX)
            yield Path(name)
        finally:
            os.close(lock)


def remove(folders: Iterable[Path] = ()) -> list[Path]:
    """Remove what killed processes of this user left behind. Return the removed paths.

    These are half-written files in ``folders`` and below, and temporary folders of this machine.
    """
    removed = [path for folder in folders for path in remove_unfinished(folder)]
    for parent in {Path(tempfile.gettempdir()), SHARED_MEMORY}:
        for path in parent.glob(f"{PREFIX}*"):
            if path.is_dir() and _is_old(path, FOLDER_AGE) and not _is_in_use(path):
                shutil.rmtree(path, ignore_errors=True)
                removed.append(path)
        for path in parent.glob(BLENDERS):
            if path.is_dir() and _is_old(path, BLENDER_AGE):
                # A folder that is not empty stays.
                with suppress(OSError):
                    path.rmdir()
                    removed.append(path)
    return removed


def remove_unfinished(folder: Path, age: float = FILE_AGE, kept: str = "") -> list[Path]:
    """Remove the files below a folder that were on their way ``age`` seconds ago; return them.

    Leaves alone what lies in its folder ``kept``.
    """
    removed = []
    for parent, folders, names in os.walk(folder):
        if Path(parent) == folder and kept in folders:
            folders.remove(kept)
        for name in names:
            path = Path(parent, name)
            if _ON_THE_WAY.fullmatch(name) and _is_old(path, age):
                path.unlink(missing_ok=True)
                removed.append(path)
    return removed


def _is_old(path: Path, age: float) -> bool:
    """Return whether a file or folder is this user's, and unchanged for ``age`` seconds."""
    try:
        status = path.lstat()
    except OSError:
        return False
    return status.st_uid == os.getuid() and status.st_mtime < time.time() - age


def _is_in_use(folder: Path) -> bool:
    """Return whether the process that made a temporary folder lives. Links always count as used."""
    try:
        return is_locked(folder, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return True
