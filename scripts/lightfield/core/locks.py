"""Locks open files and folders, and says who holds a lock.

The kernel frees a lock when its file is closed, or when the process that holds it ends in any way.
A process number in a file would not do: containers count for themselves.
"""

import fcntl
import os
import pwd
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

# The locks of this machine, as the kernel lists them.
_LOCKS = Path("/proc/locks")


class Holder(NamedTuple):
    """A process that holds a lock: its number, its user, and its machine."""

    process: int
    user: str
    host: str

    @classmethod
    def this_process(cls) -> "Holder":
        """Return this process."""
        return cls(os.getpid(), _name_of(os.getuid()), socket.gethostname())

    @property
    def is_here(self) -> bool:
        """Whether the process works on this machine."""
        return self.host == socket.gethostname()

    @property
    def is_own(self) -> bool:
        """Whether this user can end the process."""
        return self.is_here and self.user == _name_of(os.getuid())

    def __str__(self) -> str:
        place = "" if self.is_here else f" on {self.host}"
        return f"process {self.process} of {self.user}{place}"


def _name_of(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return f"user {user}"


def holder_of(file: int | IO[Any]) -> Holder | None:
    """Return the process that holds the lock of an open file.

    None if the kernel does not say: for a process in another container or on another machine, and
    on some file systems.
    """
    status = os.fstat(file if isinstance(file, int) else file.fileno())
    device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}"
    with suppress(OSError):
        for line in _LOCKS.read_text(encoding="utf-8").splitlines():
            # 1: FLOCK  ADVISORY  WRITE 7439 fe:00:2164354 0 EOF
            _, kind, *_, process, inode, _, _ = line.split()
            if kind == "FLOCK" and inode == f"{device}:{status.st_ino}":
                user = Path("/proc", process).stat().st_uid
                return Holder(int(process), _name_of(user), socket.gethostname())
    return None


def try_lock(file: int | IO[Any], *, shared: bool = False) -> bool:
    """Lock an open file or folder. Return False if another process holds its lock.

    Several processes may hold a ``shared`` lock. Raises OSError if the file system cannot lock it.
    """
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def lock(file: int | IO[Any], awaited: str) -> None:
    """Lock an open file. Wait for the process that holds its lock, and say so.

    ``awaited`` is what this process waits for. Raises OSError if the file system cannot lock it.
    """
    if not try_lock(file):
        tell_waiting(awaited, [file])
        fcntl.flock(file, fcntl.LOCK_EX)


def tell_waiting(awaited: str, files: Sequence[int | IO[Any]]) -> None:
    """Print what this process waits for, and who holds the locks of the ``files``."""
    holders = [str(holder) for file in files if (holder := holder_of(file))]
    who = f" ({', '.join(holders)})" if holders else ""
    print(f"waiting for {awaited}{who}", file=sys.stderr, flush=True)


@contextmanager
def locked_folder(folder: Path | str) -> Iterator[None]:
    """Hold the lock of a folder. Do nothing on network file systems that cannot lock folders."""
    file = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
    finally:
        os.close(file)
