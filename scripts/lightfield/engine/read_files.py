"""Compares each file that a job reads with what the file must be, when the job reads it.

Libraries open files by their paths. So a file is hashed right before a library reads it, and its
identity is compared once more at the end of the job: size, times and inode. If they are the same,
the library has read the bytes that were hashed.
"""

import os
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from lightfield.core.errors import OutsideError, UserError
from lightfield.core.files import Identity, identity_and_sha256, sha256


class _ReadFile(NamedTuple):
    identity: Identity
    sha256: str
    # Whether a job made the file. Another run may make it again with equal bytes.
    is_made: bool


class ReadFiles:
    """The files that a job has read. Threads may share it."""

    def __init__(self) -> None:
        self._files: dict[str, _ReadFile] = {}
        self._problem: UserError | None = None

    def read(self, path: str, expected: str | None = None) -> str:
        """Return the SHA-256 of a file that is about to be read. Reads it if it may have changed.

        ``expected`` is what the job noted that made the file. None for a user's file. Raises
        OSError if there is no file, and `UserError` if it has other bytes. `check` raises that
        again, because the caller may take it for a fault of a picture.
        """
        earlier = self._files.get(path)
        if earlier and earlier.identity == Identity.of(path):
            return earlier.sha256
        identity, digest = identity_and_sha256(path)
        if expected not in (None, digest):
            self._problem = damaged(path)
            raise self._problem
        self._files.setdefault(path, _ReadFile(identity, digest, expected is not None))
        return digest

    def read_made(self, path: str, made: str | None) -> str | None:
        """Do as `read` for a file that a job ``made`` with a SHA-256. None for other files."""
        # A `Path` raises for names that are too long.
        is_file = made is not None and os.path.isfile(path)  # noqa: PTH113
        return self.read(path, made) if is_file else None

    def forget(self, path: str) -> None:
        """Forget a file, so that `check` does not look at it."""
        self._files.pop(path, None)

    def check(self) -> None:
        """Raise `UserError` for a file that had other bytes, or was written since its first read.

        Forgets the files.
        """
        files, self._files = self._files, {}
        problem, self._problem = self._problem, None
        if problem:
            raise problem
        for path, read in files.items():
            identity = Identity.of(path)
            if identity != read.identity and not _is_same(path, identity, read):
                raise changed(path)


def _is_same(path: str, identity: Identity | None, read: _ReadFile) -> bool:
    """Return whether a file of another identity is still the one that was read.

    A job may have made a file again, and a new hard link changes the time of change. Any other
    difference says that a user's file was written, and may have had other bytes in between.
    """
    if identity is None or not (read.is_made or identity.links != read.identity.links):
        return False
    with suppress(OSError):
        return identity_and_sha256(path)[1] == read.sha256
    return False


def damaged(path: str | Path) -> UserError:
    """Return the error about a file that is not as its job made it. Gives the file a new time.

    So the next plan compares its bytes, also if its size and its time were those in the receipt.
    """
    with suppress(OSError):
        os.utime(path)
    return OutsideError(f"{path}: is not as its job made it; the next run makes it again")


def check_since_plan(path: str | Path, planned: str) -> None:
    """Raise `UserError` unless a file has the SHA-256 with which the run was ``planned``."""
    if sha256(path) != planned:
        raise changed_since_plan(path)


def changed_since_plan(path: str | Path) -> UserError:
    """Return the error about a user's file that is not as it was when the run was planned."""
    return OutsideError(f"{path}: has changed since the plan; start the run again")


def changed(path: str | Path) -> UserError:
    """Return the error about a file that was written while a job read it."""
    return OutsideError(f"{path}: has changed while this job read it; start the run again")
