"""Reads the inventory of a scene, which scripts/inventory.py writes."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter

# Pydantic needs this one in Python 3.11.
from typing_extensions import TypedDict

from lightfield.core.errors import UserError
from lightfield.core.files import read_keys
from lightfield.settings.base import checked

_Count = Annotated[int, Field(ge=0)]


class _ExternalFile(TypedDict, total=False):
    """A file that a .blend reads. Size, time and SHA-256 of a missing file are null."""

    path: str
    bytes: _Count | None
    mtime_ns: _Count | None
    sha256: str | None


class _Inventory(TypedDict, total=False):
    """The keys that programs read. Each program says which keys it needs."""

    __pydantic_config__ = ConfigDict(strict=True)  # type: ignore[misc]

    blend: dict[str, Any]
    box: list[list[float]] | None
    emitters: list[str]
    external_files: list[_ExternalFile]
    hidden: list[str]
    left_out: list[str]
    memory_bytes: _Count
    missing: list[dict[str, Any]]
    sampling: dict[str, Any]
    volumes: list[str]


_INVENTORY = TypeAdapter(_Inventory)


def read_inventory(path: Path | str, *keys: str) -> dict[str, Any]:
    """Return the inventory of a scene. Raises `UserError` if a key is missing or wrong."""
    content = read_keys(path, "inventory.py", *keys)
    checked(_INVENTORY, content, str(path))
    return content


def scene_box(path: Path | str) -> NDArray[np.float64]:
    """Return the box (2, 3) in metres of the scene of an inventory.

    Raises `UserError` if the scene has none, or if no rig needs it.
    """
    box = read_inventory(path, "box")["box"]
    if box is None:
        raise UserError(
            f"{path}: box: the scene has none, because it shows no surface, or one whose places "
            "are not finite; give the rig its size and center in metres"
        )
    return np.array(box, np.float64).reshape(2, 3)
