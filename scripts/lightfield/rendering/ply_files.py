"""Reads the header of a PLY, and says which of its faces Blender leaves out."""

from pathlib import Path
from typing import NamedTuple

from lightfield.core.errors import UserError

# Blender crashes at a longer line of a header. In bytes, without the end of the line.
_LONGEST_LINE = 65535
# What Blender prints about a face with a corner that does not exist.
_NO_SUCH_CORNER = b"Invalid PLY vertex index"
# Bytes of the types of values.
_TYPES = {
    **dict.fromkeys((b"char", b"uchar", b"int8", b"uint8"), 1),
    **dict.fromkeys((b"short", b"ushort", b"int16", b"uint16"), 2),
    **dict.fromkeys((b"int", b"uint", b"int32", b"uint32", b"float", b"float32"), 4),
    **dict.fromkeys((b"double", b"float64"), 8),
}


class _Header(NamedTuple):
    """The words of each line of a header, and its bytes."""

    lines: list[list[bytes]]
    size: int

    def faces(self) -> int:
        """Return how many faces the header promises."""
        for words in self.lines:
            if words[:2] == [b"element", b"face"] and words[2:] and words[2].isdigit():
                return int(words[2])
        return 0


def _header(path: Path) -> _Header:
    """Return the header of a PLY. Raises `UserError` for a line that is too long for Blender."""
    lines: list[list[bytes]] = []
    with path.open("rb") as file:
        while line := file.readline(_LONGEST_LINE + 2):
            if len(line.rstrip(b"\r\n")) > _LONGEST_LINE:
                raise UserError(
                    f"{path}: line {len(lines) + 1} of its header has more than {_LONGEST_LINE} "
                    "bytes, at which Blender crashes; shorten it, such as a comment"
                )
            lines.append(line.split())
            if lines[0] != [b"ply"] or lines[-1] == [b"end_header"]:
                break
        return _Header(lines, file.tell())


def least_bytes(path: Path) -> int:
    """Return how many bytes a PLY has at least by its header. Each face has three corners or more.

    In a text, each value has a digit and a blank.
    """
    header = _header(path)
    is_text = [b"format", b"ascii"] in [words[:2] for words in header.lines]
    total = header.size
    count = 0
    for words in header.lines:
        match words:
            case [b"element", _, number] if number.isdigit():
                count = int(number)
            case [b"property", b"list", length, value, _]:
                sizes = [_TYPES.get(kind, 1) for kind in (length, value)]
                total += count * (8 if is_text else sizes[0] + 3 * sizes[1])
            case [b"property", value, _]:
                total += count * (2 if is_text else _TYPES.get(value, 1))
    # The last line of a text may lack its end.
    return total - 1 if is_text else total


def faces_left_out(path: Path, count: int, printed: bytes) -> list[str]:
    """Return which faces Blender has left out of a PLY, of which it has read ``count`` faces.

    ``printed`` is what it printed. Raises `UserError` if faces have corners that do not exist.
    """
    promised = _header(path).faces()
    if count >= promised:
        return []
    if _NO_SUCH_CORNER in printed:
        raise UserError(
            f"{path}: has {promised} faces, of which Blender reads {count}: others have corners "
            "that do not exist; export it again"
        )
    return [f"{promised - count} of {promised} faces, which repeat a corner or another face"]
