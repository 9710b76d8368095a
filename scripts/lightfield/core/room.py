"""Whether there is room for what a run is about to write."""

import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

from lightfield.core.errors import UserError

# Bytes are estimated before they are written: so many times the room there is will not fit into it,
# and so large a part of it may not.
SURELY, NEARLY = 2.0, 0.9

# A folder in memory, where there is one.
SHARED_MEMORY = Path("/dev/shm")


def fast_folder(size: float) -> Path | None:
    """Return a folder in memory with room for so many bytes, or None."""
    if not os.access(SHARED_MEMORY, os.W_OK | os.X_OK):
        return None
    return SHARED_MEMORY if shutil.disk_usage(SHARED_MEMORY).free > size else None


def check(needs: Iterable[tuple[Path, float]]) -> Iterator[str]:
    """Yield a warning for each disk that has hardly room for what its folders need, in bytes.

    Raises `UserError` where it has none.
    """
    disks: dict[int, tuple[Path, Path, float]] = {}
    for folder, size in needs:
        there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        disk = there.stat().st_dev
        first, _, others = disks.get(disk, (folder, there, 0.0))
        disks[disk] = (first, there, others + size)
    for folder, there, size in disks.values():
        free = shutil.disk_usage(there).free
        text = f"{folder}: {free} bytes are free on its disk, and this run writes some {size:.0f}"
        if size > SURELY * free:
            raise UserError(f"{text}: make room, choose another disk, or build less")
        if size > NEARLY * free:
            yield f"{text}: where that is too little, it stops, and goes on when there is room"
