"""The facts of an MP4 with one video: its size, the number of its pictures, and their rate.

Source: ISO/IEC 14496-12, the ISO base media file format.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lightfield.core.files import reading

# The boxes that hold those of a video track.
_TRACK = (b"moov", b"trak", b"mdia")
_SAMPLES = (b"minf", b"stbl")


@dataclass(frozen=True)
class Mp4:
    """``width`` and ``height`` in pixels, the number of ``pictures``, and pictures a second."""

    width: int
    height: int
    pictures: int
    rate: float


def read_mp4(path: Path) -> Mp4:
    """Read the headers of a file. Raises `UserError` for a file without a video."""
    with reading(path, "MP4"):
        content = path.read_bytes()
        media = content
        for kind in _TRACK:
            media = _box(media, kind)
        header = _box(media, b"mdhd")
        # Version 1 has times of 64 bits.
        ticks, duration = struct.unpack_from(
            ">IQ" if header[0] else ">II", header, 20 if header[0] else 12
        )
        samples = media
        for kind in _SAMPLES:
            samples = _box(samples, kind)
        (pictures,) = struct.unpack_from(">I", _box(samples, b"stsz"), 8)
        # After version, flags and count comes an entry with its own header of 8 bytes.
        width, height = struct.unpack_from(">HH", _box(samples, b"stsd"), 8 + 8 + 24)
        if not (pictures and duration and ticks):
            raise ValueError("it has no pictures")
    return Mp4(width, height, pictures, pictures * ticks / duration)


def _box(content: bytes, kind: bytes) -> bytes:
    """Return the content of the first box of a kind. Raises ValueError if there is none."""
    for box_kind, body in _boxes(content):
        if box_kind == kind:
            return body
    raise ValueError(f"it has no box {kind.decode()}")


def _boxes(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the kind and the content of each box."""
    place = 0
    while place + 8 <= len(content):
        size, kind = struct.unpack_from(">I4s", content, place)
        header = 8
        if size == 1:
            (size,) = struct.unpack_from(">Q", content, place + 8)
            header = 16
        end = place + size if size else len(content)
        if end > len(content) or end < place + header:
            raise ValueError(f"its box {kind!r} is cut short")
        yield kind, content[place + header : end]
        place = end
