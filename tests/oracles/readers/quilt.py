"""A quilt for Looking Glass displays: its file name says how it is divided into tiles."""

import re
from pathlib import Path
from typing import Any

from lightfield.core.files import reading
from lightfield.imaging import images
from oracles.readers.contents import Exported

NAME = re.compile(r".+_qs(\d+)x(\d+)a(\d+(?:\.\d+)?)\.png")


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the name and the size of the quilt of an export."""
    exported = Exported()
    with reading(listing.parent, "quilt"):
        (path,) = listing.parent.glob("*.png")
        parts = NAME.fullmatch(path.name)
        if parts is None:
            raise ValueError(f"{path.name}: does not say how many tiles it has")
        columns, rows, aspect = int(parts[1]), int(parts[2]), float(parts[3])
        header = images.read_header(path)
        if header.width % columns or header.height % rows:
            exported.faults.append(f"{path}: has no {columns} × {rows} equal tiles")
        width, height = header.width // columns, header.height // rows
        # The sides of a tile are whole pixels.
        if abs(width - aspect * height) > 1 and abs(width / aspect - height) > 1:
            exported.faults.append(f"{path}: its tiles of {width} × {height} have another aspect")
    return exported
