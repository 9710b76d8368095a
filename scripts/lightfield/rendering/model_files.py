"""Finds the files that a model file refers to, without Blender, which does not list them."""

import json
import os
import re
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable

# The suffixes of files that a USD layer may refer to.
_USD_LAYERS = (".usd", ".usda", ".usdc", ".usdz")
_USD_TEXTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".bmp", ".tga", ".webp")


def check(path: Path) -> None:
    """Raise `UserError` for a model file that is empty, cut short, or of another format.

    Blender's importers say little about such files, or import the part that is there.
    """
    check_readable(path)
    size = path.stat().st_size
    if not size:
        raise UserError(f"{path}: is empty; must be a model")
    with path.open("rb") as file:
        head = file.read(84)
        file.seek(max(0, size - 4096))
        tail = file.read()
    match path.suffix.lower():
        case ".glb" | ".gltf" if not _begins_as_gltf(head):
            raise UserError(
                f"{path}: is not a glTF file: it begins with neither glTF nor {{; give it the "
                "suffix of its format, or export it again"
            )
        case ".glb" | ".gltf" if hidden := _hidden_node(path):
            raise UserError(
                f"{path}: hides the node {hidden} by KHR_node_visibility, but Blender would show "
                "it; export the model without hidden nodes"
            )
        case ".stl" if head.lstrip().startswith(b"solid") and b"facet" in head + tail:
            # A text may have several solids, each with its own end.
            if not re.search(rb"endsolid[^\r\n]*\s*$", tail):
                raise UserError(f"{path}: is cut short; an STL text ends with endsolid")
        case ".stl":
            # A head of 80 bytes, the number of triangles, and 50 bytes for each.
            expected = 84 + 50 * struct.unpack("<I", head[80:])[0] if len(head) == 84 else 84
            if size < expected or expected == 84:
                raise UserError(f"{path}: is cut short, or not an STL file: it has {size} bytes")
        case ".ply":
            least = _least_ply_bytes(path)
            if size < least:
                raise UserError(f"{path}: is cut short: it has {size} bytes of at least {least}")
        case ".usdz" if not zipfile.is_zipfile(path):
            raise UserError(f"{path}: is cut short, or not a USDZ file, which is a ZIP archive")


def _begins_as_gltf(head: bytes) -> bool:
    """Return whether a file may be glTF by its first bytes: a binary one, or JSON."""
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    return head.startswith(b"glTF") or text.startswith(b"{")


# Bytes of the types of values in a PLY.
_PLY_TYPES = {
    **dict.fromkeys((b"char", b"uchar", b"int8", b"uint8"), 1),
    **dict.fromkeys((b"short", b"ushort", b"int16", b"uint16"), 2),
    **dict.fromkeys((b"int", b"uint", b"int32", b"uint32", b"float", b"float32"), 4),
    **dict.fromkeys((b"double", b"float64"), 8),
}


def _least_ply_bytes(path: Path) -> int:
    """Return how many bytes a PLY has at least by its head. Each face has three corners or more.

    In a text, each value has a digit and a blank.
    """
    with path.open("rb") as file:
        content = file.read(65536)
    end = re.search(rb"end_header(\r\n|\n|\r)", content)
    head = content[: end.end()] if end else content
    is_text = b"format ascii" in head
    total = len(head)
    count = 0
    for line in head.splitlines():
        match line.split():
            case [b"element", _, number] if number.isdigit():
                count = int(number)
            case [b"property", b"list", length, value, _]:
                sizes = [_PLY_TYPES.get(kind, 1) for kind in (length, value)]
                total += count * (8 if is_text else sizes[0] + 3 * sizes[1])
            case [b"property", value, _]:
                total += count * (2 if is_text else _PLY_TYPES.get(value, 1))
    # The last line of a text may lack its end.
    return total - 1 if is_text else total


def referred(path: Path) -> list[Path]:
    """Return the files that a model file refers to, also missing ones, without the file itself.

    Those of an OBJ are its libraries of materials, without their textures. Raises `UserError` if
    the model file is broken.
    """
    match path.suffix.lower():
        case ".gltf" | ".glb":
            files = list(_of_gltf(path))
        case ".obj":
            files = list(_of_obj(path))
        case suffix if suffix in _USD_LAYERS[:3]:
            files = _of_usd(path)
        case _:
            files = []
    return sorted({Path(os.path.normpath(file)) for file in files})


def _gltf_document(path: Path) -> Any:
    """Return the JSON of a glTF file. Raises `UserError` if it has none."""
    with path.open("rb") as file:
        # A binary one has a head of 12 bytes, and then the JSON with its length and type.
        head = file.read(20)
        is_binary = head[:4] == b"glTF"
        length = int.from_bytes(head[12:16], "little")
        content = file.read(length) if is_binary else head + file.read()
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None


def _hidden_node(path: Path) -> str:
    """Return the name of a node that a glTF file hides, or its number. "" if it hides none."""
    try:
        for number, node in enumerate(_gltf_document(path).get("nodes", ())):
            visibility = node.get("extensions", {}).get("KHR_node_visibility", {})
            if not visibility.get("visible", True):
                return str(node.get("name", number))
    except (TypeError, AttributeError):
        # Blender refuses such a file.
        pass
    return ""


def _of_gltf(path: Path) -> Iterator[Path]:
    """Yield the buffers and images that a glTF file has outside of itself."""
    document = _gltf_document(path)
    try:
        entries: list[Any] = [*document.get("buffers", ()), *document.get("images", ())]
        addresses = [entry["uri"] for entry in entries if "uri" in entry]
    except (TypeError, AttributeError) as error:
        raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None
    for address in addresses:
        if not address.startswith("data:"):
            yield path.parent / unquote(address)


def _of_obj(path: Path) -> Iterator[Path]:
    """Yield the libraries of materials of an OBJ file."""
    with path.open("rb") as file:
        for line in file:
            if line.startswith(b"mtllib"):
                yield path.parent / os.fsdecode(line[6:].strip().strip(b'"'))


def _of_usd(path: Path) -> list[Path]:
    """Return the layers and textures of a USD file, and those of its layers."""
    files: set[Path] = set()
    pending = [path]
    visited = set()
    while pending:
        layer = pending.pop()
        visited.add(layer)
        for name in _usd_names(layer):
            file = Path(os.path.normpath(layer.parent / name))
            files.add(file)
            # An archive holds all that its layers refer to.
            is_layer = file.suffix.lower() in _USD_LAYERS[:3]
            if is_layer and file.is_file() and file not in visited:
                pending.append(file)
    return sorted(files - {path})


def _usd_names(layer: Path) -> set[str]:
    """Return the paths of files that a USD layer names. <UDIM> stands for the number of a tile."""
    content = layer.read_bytes()
    if content[:8] == b"PXR-USDC":
        names = _crate_tokens(content)
    else:
        names = {os.fsdecode(name) for name in re.findall(rb"@+([^@\n]+)@+", content)}
    # A file inside an archive is named as archive.usdz[file].
    names = {re.sub(r"\[.*\]$", "", name) for name in names}
    files = {name for name in names if name.lower().endswith(_USD_LAYERS + _USD_TEXTURES)}
    return {name for name in files if "<" not in name and "://" not in name}


def _crate_tokens(content: bytes) -> set[str]:
    """Return the tokens of a binary USD layer. The paths of its assets are among them.

    See "crateFile.h" of OpenUSD. The table of contents names each section in 16 bytes, with its
    start and size. Since version 0.4, tokens are compressed with LZ4. Returns nothing for a broken
    file, which Blender refuses.
    """
    try:
        (table,) = struct.unpack_from("<q", content, 16)
        (count,) = struct.unpack_from("<Q", content, table)
        for number in range(min(count, 64)):
            name, start, _ = struct.unpack_from("<16sqq", content, table + 8 + 32 * number)
            if name.rstrip(b"\0") == b"TOKENS":
                break
        else:
            return set()
        if content[8:11] < bytes([0, 4, 0]):
            _, size = struct.unpack_from("<QQ", content, start)
            tokens = content[start + 16 : start + 16 + size]
        else:
            _, _, size = struct.unpack_from("<QQQ", content, start)
            tokens = _decompressed(content[start + 24 : start + 24 + size])
    except (struct.error, IndexError):
        return set()
    return {os.fsdecode(token) for token in tokens.split(b"\0")}


def _decompressed(content: bytes) -> bytes:
    """Return content that OpenUSD has compressed: chunks of LZ4, each with its length before it.

    The first byte is the number of chunks. 0 means one without a length.
    """
    count = content[0]
    if not count:
        return _lz4_block(content[1:])
    parts = []
    start = 1
    for _ in range(count):
        (size,) = struct.unpack_from("<i", content, start)
        parts.append(_lz4_block(content[start + 4 : start + 4 + size]))
        start += 4 + size
    return b"".join(parts)


def _lz4_block(block: bytes) -> bytes:
    """Decompress a block of LZ4. See "LZ4 Block Format" of the lz4 project.

    Each sequence has a token with two lengths, literal bytes, and a copy of earlier bytes.
    """
    output = bytearray()
    at = 0

    def length(nibble: int) -> int:
        nonlocal at
        total = nibble
        while nibble == 15:
            total += block[at]
            at += 1
            if block[at - 1] != 255:
                break
        return total

    while at < len(block):
        token = block[at]
        at += 1
        literals = length(token >> 4)
        output += block[at : at + literals]
        at += literals
        if at >= len(block):
            break
        offset = int.from_bytes(block[at : at + 2], "little")
        at += 2
        repeated = length(token & 15) + 4
        if not 0 < offset <= len(output):
            raise IndexError
        for _ in range(repeated):
            output.append(output[-offset])
    return bytes(output)
