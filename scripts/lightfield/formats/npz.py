"""Reads and writes files of numpy arrays. Equal arrays give equal bytes: NPZ files have no time."""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, read_error, write_bytes


def read(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays in a file by their names.

    Raises `UserError` for a missing or damaged file, and for Python objects in it.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as error:
        raise read_error(path, error) from None
    except (*DAMAGE, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error):
        raise UserError(f"{path}: is not an NPZ file of arrays") from None


def write(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by their names, atomically. They may hold no Python objects."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, array in arrays.items():
            # Without a time, a file in an archive is from 1980.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), npy(array))
    write_bytes(path, content.getvalue())


def npy(array: NDArray[Any]) -> bytes:
    """Return the content of an NPY file. The array may hold no Python objects."""
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return content.getvalue()
