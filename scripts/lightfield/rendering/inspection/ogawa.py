"""Finds out whether an Alembic file is whole. Blender crashes on one that is not.

Such a file is a tree of groups, in the container Ogawa. A head of 16 bytes ends with the place of
the root. A group is a count and the places of its children. A place with the highest bit set is of
data: a length and as many bytes. All numbers are of 64 bits, and a place of 0 is empty.
"""

import mmap
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_IS_DATA = np.uint64(1 << 63)


def check(path: Path) -> None:
    """Raise `ValueError` if an Alembic file is cut short, or of another format."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(16)
        # The sixth byte is 0 until the file is complete.
        if len(head) < 16 or head[:5] != b"Ogawa":
            raise ValueError("is not an Alembic file that Blender can read (Ogawa)")
        if head[5] != 0xFF:
            raise ValueError("is incomplete: its writer has not finished it")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            if not _is_whole(content, size, int.from_bytes(head[8:], "little")):
                raise ValueError("is cut short")


def _is_whole(content: mmap.mmap, size: int, root: int) -> bool:
    """Return whether a file has all groups and data that its root leads to."""
    visited: set[int] = set()
    pending = [root]
    while pending:
        place = pending.pop()
        if place in visited or not place:
            continue
        visited.add(place)
        children = _children(content, size, place)
        if children is None:
            return False
        is_data = children >= _IS_DATA
        # Data that begins last also ends last.
        last_data = max((children[is_data] - _IS_DATA).tolist(), default=0)
        if not _has_data(content, size, last_data):
            return False
        pending += children[~is_data].tolist()
    return True


def _children(content: mmap.mmap, size: int, place: int) -> NDArray[np.uint64] | None:
    """Return the places of a group's children. None if the file ends before."""
    count = int.from_bytes(content[place : place + 8], "little")
    end = place + 8 + 8 * count
    if place + 8 > size or end > size:
        return None
    return np.frombuffer(content[place + 8 : end], "<u8")


def _has_data(content: mmap.mmap, size: int, place: int) -> bool:
    """Return whether the file has the data at a place. An empty one is at 0."""
    length = int.from_bytes(content[place : place + 8], "little")
    return place == 0 or place + 8 + length <= size
