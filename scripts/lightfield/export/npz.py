"""Writes NPZ files with equal bytes for equal arrays. numpy's own have the time in them."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import write_bytes


def write(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by their names, atomically. They may hold no Python objects."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, array in arrays.items():
            # Without a time, a file in an archive is from 1980.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as file:
                np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=False)
    write_bytes(path, content.getvalue())
