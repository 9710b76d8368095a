"""Encodes raw video frames: planar 4:2:0, little-endian 16-bit samples (ffmpeg's yuv420p10le)."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import atomic_path
from lightfield.export.source import Floats
from lightfield.imaging.ffmpeg import encoding


def of_colour(encoded: Floats, bits: int) -> bytes:
    """Return a frame of sRGB-encoded colour (h, w, 3), 0 to 1, with even sides.

    Y'CbCr is in the narrow range. A chroma sample is the mean of four. Source: ITU-R BT.709, 3, 4.
    """
    red, green, blue = np.moveaxis(encoded, -1, 0)
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    unit = 2 ** (bits - 8)
    height, width = luma.shape
    planes = [(16 + 219 * luma) * unit]
    for value, scale in ((blue, 1.8556), (red, 1.5748)):
        chroma = (128 + 224 * (value - luma) / scale) * unit
        planes.append(chroma.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3)))
    return b"".join(np.round(plane).astype("<u2").tobytes() for plane in planes)


def of_levels(levels: NDArray[np.uint16], bits: int) -> bytes:
    """Return a frame without colour. Its luma is ``levels`` (h, w), with even sides."""
    grey = np.full(levels.size // 2, 2 ** (bits - 1), "<u2")
    return levels.astype("<u2").tobytes() + grey.tobytes()


def write_raw(path: Path, frames: Iterable[bytes]) -> None:
    """Write the frames one after the other, without a header."""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.writelines(frames)


def write_hevc(
    path: Path,
    frames: Iterable[bytes],
    size: tuple[int, int],
    bits: int,
    rate: float | None = None,
) -> None:
    """Write frames as lossless H.265 with ffmpeg: one, or several with ``rate`` a second.

    Frames are coded in the order of time, because OpenDIBR shows them as they are decoded. Raises
    `UserError` if ffmpeg fails.
    """
    pixel_format = ["-pix_fmt", f"yuv420p{bits}le"]
    raw_input = ["-f", "rawvideo", *pixel_format, "-s", f"{size[0]}x{size[1]}"]
    codec = ["-c:v", "libx265", "-x265-params", "lossless=1:log-level=none:pools=1:info=0"]
    reproducible = ["-fflags", "+bitexact", "-flags:v", "+bitexact", *pixel_format]
    if rate is not None:
        raw_input += ["-r", repr(rate)]
        codec[-1] += ":bframes=0"
    options = [*raw_input, "-i", "-", *codec, *reproducible]
    with encoding(path, options, f"H.265 of {bits} bits") as add:
        for frame in frames:
            add(frame)
