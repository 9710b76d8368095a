"""Checks that the disks have space for what a run writes, and says why a disk takes no files."""

import errno
import os
import resource
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lightfield.core import units
from lightfield.core.errors import UserError

# The bytes of a run are estimates. Refuse a run that needs more than SURELY times the free space.
# Warn about a run that needs more than NEARLY times the free space.
_SURELY = 2.0
_NEARLY = 0.9
# A disk with less free space than this, or with fewer free inodes, counts as full: a job's log
# alone may use them up.
_LEAST_BYTES = 1e6
_LEAST_FILES = 16

# False on macOS.
_BY_EFFECTIVE_USER = os.access in os.supports_effective_ids

# A folder in memory, on machines that have one.
SHARED_MEMORY = Path("/dev/shm")

# What the user can do about each error of writing.
REMEDIES = {
    errno.ENOSPC: "free some space",
    errno.EDQUOT: "free some space, or ask for a larger quota",
    errno.EFBIG: "raise the limit of a file's size (ulimit -f), or choose another disk",
    errno.EACCES: "change its permissions, or write elsewhere",
    errno.EPERM: "change its permissions, or write elsewhere",
    errno.EROFS: "mount its disk for writing, or write elsewhere",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
}


@dataclass(frozen=True)
class Need:
    """The space that a run needs below a folder: ``size`` bytes, in ``files`` files."""

    folder: Path
    size: float
    files: int = 0


def _nearest(path: Path) -> Path:
    """Return the path if something lies there, or else the nearest parent."""
    # `Path.exists` raises an error below a folder that may not be searched.
    return next(part for part in (path, *path.absolute().parents) if os.path.lexists(part))


def obstacle(path: Path) -> str | None:
    """Return why no file can be written at a path, and what to do. Return None if one can."""
    nearest = _nearest(path)
    folder = nearest.parent if nearest == path and not path.is_dir() else nearest
    if not folder.is_dir():
        kind = "is a file" if folder.exists() else "is a link that leads nowhere"
        return f"{folder} {kind}, and must be a folder: remove it, or give it another name"
    disk = os.statvfs(folder)
    if disk.f_flag & os.ST_RDONLY:
        return f"the disk of {folder} is read-only: {REMEDIES[errno.EROFS]}"
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=_BY_EFFECTIVE_USER):
        return f"you may not write in {folder}: {REMEDIES[errno.EACCES]}"
    if disk.f_bavail * disk.f_frsize < _LEAST_BYTES:
        return f"the disk of {folder} is full: {REMEDIES[errno.ENOSPC]}"
    if disk.f_files and disk.f_favail < _LEAST_FILES:
        return (
            f"the disk of {folder} takes no more files (its inodes are used up): remove some files"
        )
    return None


def check_folder(folder: Path) -> None:
    """Raise `UserError` for a folder in which no file can be written. It may be missing.

    Also raise it if no file may be large enough for a log.
    """
    problem = obstacle(folder / "file")
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    if 0 <= limit < _LEAST_BYTES:
        problem = f"a file may have {units.size(limit)} here: {REMEDIES[errno.EFBIG]}"
    if problem:
        raise UserError(f"{folder}: cannot be written: {problem}")


def write_problem(path: Path, error: OSError) -> str:
    """Return why writing a path raised ``error``, and what to do."""
    # Some libraries raise errors without a number, so ask the disk first.
    if cause := obstacle(path):
        return cause
    free = units.size(shutil.disk_usage(_nearest(path)).free)
    remedy = REMEDIES.get(error.errno or 0, "look for a quota, or a limit of files' sizes")
    return f"{error.strerror or error}; {free} are free on its disk: {remedy}"


def fast_folder(size: float) -> Path | None:
    """Return a folder in memory with ``size`` free bytes, or None."""
    if not os.access(SHARED_MEMORY, os.W_OK | os.X_OK):
        return None
    return SHARED_MEMORY if shutil.disk_usage(SHARED_MEMORY).free > size else None


def check(needs: Iterable[Need]) -> Iterator[str]:
    """Yield a warning for each disk that ``needs`` nearly fill.

    Raises `UserError` for a disk that cannot hold them, and for a folder that cannot be written.
    """
    needs_of_disk: dict[int, list[Need]] = {}
    for need in needs:
        check_folder(need.folder)
        device = _nearest(need.folder).stat().st_dev
        needs_of_disk.setdefault(device, []).append(need)
    for disk_needs in needs_of_disk.values():
        if warning := _space_warning(disk_needs):
            yield warning


def _space_warning(needs: list[Need]) -> str | None:
    """Return a warning if ``needs`` nearly fill their disk. Raises `UserError` if it is too small.

    All ``needs`` are on one disk.
    """
    folder = needs[0].folder
    existing_folder = _nearest(folder)
    size = sum(need.size for need in needs)
    files = sum(need.files for need in needs)
    disk = os.statvfs(existing_folder)
    free = shutil.disk_usage(existing_folder).free
    if disk.f_files and files > disk.f_favail:
        raise UserError(
            f"{folder}: its disk takes {disk.f_favail} more files (inodes), and this run "
            f"writes some {files}: remove some files, choose another disk, or build less"
        )
    text = (
        f"{folder}: {units.size(free)} are free on its disk, and this run writes some "
        f"{units.size(size)}"
    )
    if size > _SURELY * free:
        raise UserError(f"{text}: free some space, choose another disk, or build less")
    if size > _NEARLY * free:
        return f"{text}: if the disk fills up, the run stops; free some space and start it again"
    return None
