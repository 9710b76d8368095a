"""Reads the JSON of a glTF and the numbers in its buffers, without Blender."""

import base64
import json
import os
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError

Array = NDArray[np.float64]

_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
JSON, BINARY = 0x4E4F534A, 0x004E4942


class CompressedError(Exception):
    """The data are compressed by an extension, which only a decoder can read."""


class Document:
    """A glTF file: its JSON as ``content``, and the numbers of its accessors."""

    def __init__(self, path: Path) -> None:
        """Raises `UserError` if the file has no JSON."""
        self.path = path
        data = path.read_bytes()
        chunks = _chunks(data) if data[:4] == b"glTF" else {JSON: data}
        self.binary = chunks.get(BINARY, b"")
        try:
            self.content: dict[str, Any] = json.loads(chunks.get(JSON, b"").decode("utf-8-sig"))
        except (ValueError, RecursionError) as error:
            raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None

    def all(self, kind: str) -> list[Any]:
        """Return a list of the document's top level, such as its nodes."""
        return list(self.content.get(kind, ()))

    def numbers(self, accessor: int) -> Array:
        """Return the values of an accessor, (count, width).

        Raises `CompressedError` if only a decoder can read them.
        """
        entry = self.all("accessors")[accessor]
        values = self._plain(entry, entry["count"])
        if sparse := entry.get("sparse"):
            places = self._plain(sparse["indices"] | {"type": "SCALAR"}, sparse["count"])
            kind = {key: entry[key] for key in ("type", "componentType")}
            changed = self._plain(kind | sparse["values"], sparse["count"])
            values[places.ravel().astype(int)] = changed
        return _normalised(values, entry) if entry.get("normalized") else values

    def _plain(self, entry: dict[str, Any], count: int) -> Array:
        kind, width = np.dtype(_KINDS[entry["componentType"]]), _WIDTHS[entry["type"]]
        if "bufferView" not in entry:
            return np.zeros((count, width))
        view = self.all("bufferViews")[entry["bufferView"]]
        if any("_compression" in name for name in view.get("extensions", ())):
            raise CompressedError
        # Columns of small matrices begin at multiples of four bytes.
        if entry["type"] in ("MAT2", "MAT3") and kind.itemsize < 4:
            raise CompressedError
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        data = self._buffers[view["buffer"]]
        array: NDArray[Any] = np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))
        return array.astype(np.float64)

    @cached_property
    def _buffers(self) -> list[bytes]:
        return [self._buffer(entry) for entry in self.all("buffers")]

    def _buffer(self, entry: dict[str, Any]) -> bytes:
        address = entry.get("uri")
        if address is None:
            return self.binary
        if is_data(address):
            return base64.b64decode(address.partition(",")[2])
        return file_of(self.path, address).read_bytes()


def is_data(address: str) -> bool:
    """Return whether an address holds the data. Blender takes other data addresses for paths."""
    return address.startswith("data:") and ";base64," in address


def file_of(path: Path, address: str) -> Path:
    """Return the file that a glTF names by an address, as Blender reads it."""
    return Path(os.path.normpath(path.parent / unquote(address.replace("\\", "/"))))


def _chunks(data: bytes) -> dict[int, bytes]:
    """Return the chunks of a binary glTF by their type."""
    chunks: dict[int, bytes] = {}
    place = 12
    while place + 8 <= len(data):
        length, kind = (int.from_bytes(data[place + i : place + i + 4], "little") for i in (0, 4))
        chunks.setdefault(kind, data[place + 8 : place + 8 + length])
        place += 8 + length
    return chunks


def _normalised(values: Array, entry: dict[str, Any]) -> Array:
    """Return integers as the fractions for which they stand."""
    kind = np.dtype(_KINDS[entry["componentType"]])
    return values if kind.kind == "f" else np.maximum(values / np.iinfo(kind).max, -1)
