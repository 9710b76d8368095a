"""Removes what killed processes leave behind: temporary folders, and half-written files."""

import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lightfield.core.disk_space import SHARED_MEMORY
from lightfield.core.locks import locked_folder, try_lock
from lightfield.core.paths import files_below

# No user's folder may have this prefix: it would be removed.
PREFIX = "plenoforge-temporary-"
# Every running Blender has such a folder, and so has an artist's.
BLENDERS = "blender_*"
# The names that `atomic_path` gives to unfinished files.
_UNFINISHED = re.compile(r"\..+\.\d+\.tmp(\.\w+)?")
# Seconds. Nobody writes one file for so long.
_FILE_AGE = 3600.0
# Seconds. No Blender has an empty folder for so long.
BLENDER_AGE = 24 * 3600.0
# Seconds. A new folder is locked long before.
FOLDER_AGE = 60.0


@contextmanager
def temporary_folder(parent: Path | str | None = None) -> Iterator[Path]:
    """Yield a temporary folder in ``parent``, or in the machine's folder of temporary files.

    The folder is removed at the end. If this process is killed, `remove` does it later. A lock
    shows that the process lives. Where folders cannot be locked, `remove` leaves the folder.
    """
    with tempfile.TemporaryDirectory(prefix=PREFIX, dir=parent) as name, locked_folder(name):
        yield Path(name)


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
                # This fails for a folder that is not empty.
                with suppress(OSError):
                    path.rmdir()
                    removed.append(path)
    return removed


def remove_unfinished(folder: Path, age: float = _FILE_AGE, excluded: str = "") -> list[Path]:
    """Remove unfinished files below a folder that are older than ``age`` seconds. Return them.

    Skips the folder's subfolder ``excluded``.
    """
    removed = []
    for path in files_below(folder, strict=False):
        is_excluded = path.relative_to(folder).parts[0] == excluded
        if _UNFINISHED.fullmatch(path.name) and not is_excluded and _is_old(path, age):
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
        file = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return True
    try:
        return not try_lock(file)
    except OSError:
        return True
    finally:
        os.close(file)
