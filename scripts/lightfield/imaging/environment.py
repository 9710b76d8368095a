"""Checks the picture of an environment that lights a model, before Blender reads it."""

from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable, open_file
from lightfield.imaging.images import read_header, read_image

# How files of these suffixes begin. A Radiance picture names one of two programs.
_BEGINNINGS = {".hdr": (b"#?",), ".exr": (b"\x76\x2f\x31\x01",)}
_CHANNELS = ("R", "G", "B")
# As floats, a picture of this width takes 6 GB.
_LARGEST_WIDTH = 32768


def check_header(path: Path) -> None:
    """Raise `UserError` for a file that is no equirectangular .hdr or .exr. Reads its header."""
    check_readable(path)
    with open_file(path) as file:
        beginning = file.read(4)
    suffix = path.suffix.lower()
    if not beginning.startswith(_BEGINNINGS[suffix]):
        raise UserError(f"{path}: is not an {suffix} file; save the picture as .hdr or .exr")
    header = read_header(path)
    missing_channels = [name for name in _CHANNELS if name not in header.channels]
    if missing_channels:
        raise UserError(
            f"{path}: has the channels {', '.join(header.channels)}; must have R, G and B"
        )
    size = f"{header.width} × {header.height}"
    if header.width != 2 * header.height:
        raise UserError(
            f"{path}: has {size} pixels; must be twice as wide as high, as equirectangular "
            "pictures of all directions are"
        )
    if header.width > _LARGEST_WIDTH:
        raise UserError(f"{path}: has {size} pixels; must be at most {_LARGEST_WIDTH} pixels wide")


def check(path: Path) -> None:
    """Raise `UserError` for a file that cannot light a model. Reads it to its end."""
    check_header(path)
    pixels = read_image(path, _CHANNELS).channels
    if not all(np.isfinite(pixels[name]).all() for name in _CHANNELS):
        raise UserError(
            f"{path}: has pixels that are infinite or not numbers; clamp them, because Cycles "
            "would render black"
        )
