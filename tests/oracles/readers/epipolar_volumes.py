"""Arrays of the views of a rig, and epipolar_volumes.json, which says what their axes are."""

from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from oracles.readers.contents import Exported


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the axes and the shapes of the arrays of an export."""
    path = listing.parent / "epipolar_volumes.json"
    exported = Exported()
    with reading(path, "list of arrays"):
        content = read_json(path)
        for entry in content["volumes"]:
            views = np.array(entry["views"])
            picture = (*views.shape, size[1], size[0])
            shapes = {entry["file"]: (*picture, len(content["channels"]))}
            if content["depth"]:
                shapes[entry["depth"]] = picture
            for name, shape in shapes.items():
                file = path.parent / str(name)
                exported.expect(f"{file}: shape", _shape_of(file), shape)
            exported.expect(f"{path}: axes", len(entry["axes"]), views.ndim + 3)
            exported.expect(f"{path}: positions", np.shape(entry["positions"]), (*views.shape, 3))
    return exported


def _shape_of(path: Path) -> tuple[int, ...]:
    """Return the shape of an array that fills its file."""
    try:
        shape: tuple[int, ...] = np.load(path, mmap_mode="r").shape
    except (EOFError, SyntaxError, TokenError) as error:
        raise ValueError(str(error)) from None
    return shape
