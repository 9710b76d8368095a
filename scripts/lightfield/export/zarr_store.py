"""Writes a Zarr store of version 2 as a folder, with its metadata also in one compressed file.

NCore reads the metadata from that file, ``.zmetadata.cbor.xz``. It is CBOR (RFC 8949) in xz, and
holds what the files ``.zgroup``, ``.zarray`` and ``.zattrs`` hold. Source: Zarr's specification of
version 2, and consolidate_compressed_metadata in NCore's stores.py.
"""

import hashlib
import lzma
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import read_bytes, write_bytes, write_json

METADATA = ".zmetadata.cbor.xz"

# The types of values in CBOR.
_UNSIGNED, _NEGATIVE, _TEXT, _LIST, _MAP = 0, 1, 3, 4, 5


class ZarrStore:
    """A store that grows in ``folder``. `close` completes it.

    Groups and arrays have paths such as ``poses/default``. A group must be written before what is
    in it. Paths are kept in the order of writing.
    """

    def __init__(self, folder: Path, attributes: dict[str, Any]) -> None:
        self.folder = folder
        self._metadata: dict[str, Any] = {}
        self._write(".zgroup", {"zarr_format": 2})
        self._write(".zattrs", attributes)

    def group(self, path: str, attributes: dict[str, Any] | None = None) -> None:
        """Write a group. Without ``attributes`` it has none."""
        self._write(f"{path}/.zgroup", {"zarr_format": 2})
        if attributes is not None:
            self._write(f"{path}/.zattrs", attributes)

    def array(
        self, path: str, values: NDArray[Any], attributes: dict[str, Any] | None = None
    ) -> None:
        """Write an array as one chunk, compressed with zlib."""
        compressor = {"id": "zlib", "level": 6}
        self._describe(path, values.dtype.str, values.shape, compressor, attributes)
        chunk = zlib.compress(np.ascontiguousarray(values).tobytes(), 6)
        write_bytes(self.folder / path / ".".join("0" * values.ndim), chunk)

    def encoded(self, path: str, file: Path, attributes: dict[str, Any]) -> None:
        """Move a ``file``, such as a PNG, into the store as a single value of bytes."""
        target = self.folder / path / "0"
        write_bytes(target, read_bytes(file))
        file.unlink()
        self._describe(path, f"|S{target.stat().st_size}", (), None, attributes)

    def close(self) -> str:
        """Write the compressed metadata. Return NCore's MD5 of the store."""
        write_bytes(self.folder / METADATA, consolidated(self._metadata))
        digest = hashlib.md5(usedforsecurity=False)
        _hash(self.folder, digest)
        return digest.hexdigest()

    def _describe(
        self,
        path: str,
        dtype: str,
        shape: tuple[int, ...],
        compressor: dict[str, Any] | None,
        attributes: dict[str, Any] | None,
    ) -> None:
        description = {
            "chunks": list(shape),
            "compressor": compressor,
            "dtype": dtype,
            "fill_value": None,
            "filters": None,
            "order": "C",
            "shape": list(shape),
            "zarr_format": 2,
        }
        self._write(f"{path}/.zarray", description)
        if attributes is not None:
            self._write(f"{path}/.zattrs", attributes)

    def _write(self, key: str, content: dict[str, Any]) -> None:
        write_json(self.folder / key, content)
        self._metadata[key] = content


def consolidated(metadata: dict[str, Any]) -> bytes:
    """Return a store's metadata, by the names of their files, as CBOR in xz."""
    return lzma.compress(_cbor({"zarr_consolidated_format": 1, "metadata": metadata}))


def _hash(folder: Path, digest: Any) -> None:
    """Add names and files of a folder to a digest. Source: MD5Hasher in NCore's util.py."""
    for path in sorted(folder.iterdir(), key=lambda path: str(path).lower()):
        digest.update(path.name.encode())
        if path.is_dir():
            _hash(path, digest)
        else:
            digest.update(read_bytes(path))


def _cbor(value: Any) -> bytes:
    """Encode what JSON can hold: mappings, lists, texts, numbers, true, false and null."""
    if value is None:
        return b"\xf6"
    if isinstance(value, bool):
        return b"\xf5" if value else b"\xf4"
    if isinstance(value, int):
        return _cbor_head(_UNSIGNED, value) if value >= 0 else _cbor_head(_NEGATIVE, -1 - value)
    if isinstance(value, float):
        return b"\xfb" + struct.pack(">d", value)
    if isinstance(value, str):
        text = value.encode()
        return _cbor_head(_TEXT, len(text)) + text
    if isinstance(value, list):
        return _cbor_head(_LIST, len(value)) + b"".join(map(_cbor, value))
    if isinstance(value, dict):
        pairs = (_cbor(key) + _cbor(entry) for key, entry in value.items())
        return _cbor_head(_MAP, len(value)) + b"".join(pairs)
    raise TypeError(f"CBOR: {type(value).__name__} is not a type of JSON")


def _cbor_head(kind: int, number: int) -> bytes:
    """Return the first bytes of a value: its kind, and its number or length."""
    if number < 24:
        return bytes([kind << 5 | number])
    for code, (form, limit) in enumerate(((">B", 8), (">H", 16), (">I", 32), (">Q", 64)), 24):
        if number < 1 << limit:
            return bytes([kind << 5 | code]) + struct.pack(form, number)
    raise OverflowError(f"CBOR: {number} has more than 64 bits")
