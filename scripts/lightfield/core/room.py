"""Whether there is room for what a run is about to write, and why a disk takes nothing more."""

import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lightfield.core.errors import UserError

# Bytes are estimated before they are written: so many times the room there is will not fit into it,
# and so large a part of it may not.
SURELY, NEARLY = 2.0, 0.9
# A disk with fewer bytes, or room for fewer files, is full: a job's log alone may take them.
LEAST_BYTES, LEAST_FILES = 1e6, 16

# Not on macOS.
_BY_EFFECTIVE_USER = os.access in os.supports_effective_ids

# A folder in memory, where there is one.
SHARED_MEMORY = Path("/dev/shm")

# What to do where the system says of a write only what went wrong.
REMEDIES = {
    errno.ENOSPC: "make room",
    errno.EDQUOT: "make room, or ask for a larger quota",
    errno.EFBIG: "raise the limit of a file's size (ulimit -f), or choose another disk",
    errno.EACCES: "change its permissions, or write elsewhere",
    errno.EPERM: "change its permissions, or write elsewhere",
    errno.EROFS: "mount its disk for writing, or write elsewhere",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
}


@dataclass(frozen=True)
class Need:
    """What is about to be written below a folder: so many bytes, in so many files."""

    folder: Path
    size: float
    files: int = 0


def gigabytes(size: float) -> str:
    """Return a number of bytes as a person reads it: ``12.6 GB``."""
    if size < 5e6:
        return "less than 0.01 GB" if size else "0 GB"
    return f"{size / 1e9:,.2f} GB" if size < 1e10 else f"{size / 1e9:,.0f} GB"


def nearest_folder(path: Path) -> Path:
    """Return a path, or the nearest of the folders above it, that exists."""
    return next(part for part in (path, *path.absolute().parents) if part.exists())


def obstacle(path: Path) -> str | None:
    """Return why no file can be written below a path, and what to do; None if one can."""
    folder = nearest_folder(path)
    folder = folder if folder.is_dir() else folder.parent
    disk = os.statvfs(folder)
    if disk.f_flag & os.ST_RDONLY:
        return f"the disk of {folder} is read-only: {REMEDIES[errno.EROFS]}"
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=_BY_EFFECTIVE_USER):
        return f"you may not write in {folder}: {REMEDIES[errno.EACCES]}"
    if disk.f_bavail * disk.f_frsize < LEAST_BYTES:
        return f"the disk of {folder} is full: make room"
    if disk.f_files and disk.f_favail < LEAST_FILES:
        return (
            f"the disk of {folder} takes no more files (its inodes are used up): remove some files"
        )
    return None


def write_problem(path: Path, error: OSError) -> str:
    """Return why a path cannot be written, from what the system said of it, and what to do."""
    # Libraries raise errors without a number, and a text of their own.
    if cause := obstacle(path):
        return cause
    free = gigabytes(shutil.disk_usage(nearest_folder(path)).free)
    remedy = REMEDIES.get(error.errno or 0, "look for a quota, or a limit of files' sizes")
    return f"{error.strerror or error}; {free} are free on its disk: {remedy}"


def fast_folder(size: float) -> Path | None:
    """Return a folder in memory with room for so many bytes, or None."""
    if not os.access(SHARED_MEMORY, os.W_OK | os.X_OK):
        return None
    return SHARED_MEMORY if shutil.disk_usage(SHARED_MEMORY).free > size else None


def check(needs: Iterable[Need]) -> Iterator[str]:
    """Yield a warning for each disk that has hardly room for what is about to be written.

    Raises `UserError` where it has none, or nothing can be written at all.
    """
    disks: dict[int, list[Need]] = {}
    for need in needs:
        disks.setdefault(nearest_folder(need.folder).stat().st_dev, []).append(need)
        if cause := obstacle(need.folder):
            raise UserError(f"{need.folder}: cannot be written: {cause}")
    for wanted in disks.values():
        folder = wanted[0].folder
        there = nearest_folder(folder)
        size = sum(need.size for need in wanted)
        files = sum(need.files for need in wanted)
        disk = os.statvfs(there)
        free = shutil.disk_usage(there).free
        if disk.f_files and files > disk.f_favail:
            raise UserError(
                f"{folder}: its disk takes {disk.f_favail} more files (inodes), and this run "
                f"writes some {files}: remove some files, choose another disk, or build less"
            )
        text = (
            f"{folder}: {gigabytes(free)} are free on its disk, and this run writes some "
            f"{gigabytes(size)}"
        )
        if size > SURELY * free:
            raise UserError(f"{text}: make room, choose another disk, or build less")
        if size > NEARLY * free:
            yield f"{text}: where that is too little, it stops, and goes on when there is room"
