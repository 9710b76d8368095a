"""Encodes raw video frames: planar 4:2:0, little-endian 16-bit samples (ffmpeg's yuv420p10le)."""

import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path
from lightfield.export.source import Floats


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


def write_hevc(path: Path, frame: bytes, size: tuple[int, int], bits: int) -> None:
    """Write one frame as lossless H.265 with ffmpeg. Raises `UserError` if ffmpeg fails."""
    pixel_format = ["-pix_fmt", f"yuv420p{bits}le"]
    raw_input = ["-f", "rawvideo", *pixel_format, "-s", f"{size[0]}x{size[1]}", "-i", "-"]
    codec = ["-c:v", "libx265", "-x265-params", "lossless=1:log-level=none:pools=1:info=0"]
    reproducible = ["-fflags", "+bitexact", "-flags:v", "+bitexact", *pixel_format]
    with atomic_path(path) as temporary:
        options = [*raw_input, *codec, *reproducible]
        command = ["ffmpeg", "-v", "error", "-y", *options, str(temporary)]
        result = subprocess.run(command, input=frame, capture_output=True, check=False)
        if result.returncode:
            problem = " ".join(result.stderr.decode(errors="replace").split())
            raise UserError(f"{path}: ffmpeg cannot write H.265 of {bits} bits: {problem}")
