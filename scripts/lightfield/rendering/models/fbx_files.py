"""Finds the files that an FBX names, and its parts that Blender leaves out, without Blender.

An FBX is a tree of nodes, as bytes or as text.
"""

import mmap
import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import FileReference, Survey, printable

_MAGIC = b"Kaydara FBX Binary  \x00\x1a\x00"
# From this version on, sizes have eight bytes in place of four.
_WIDE = 7500
# The classes of geometry that Blender does not import, although they are surfaces.
_SURFACES_LEFT_OUT = ("NurbsSurface", "TrimNurbsSurface")
# The bytes of a property by its type. Other types begin with their length.
_SIZES = {b"Y": 2, b"C": 1, b"B": 1, b"I": 4, b"F": 4, b"D": 8, b"L": 8}


class _Node(NamedTuple):
    """A node of a binary FBX: its name, and where its properties and its children lie."""

    name: str
    properties: int
    property_count: int
    children: int
    end: int


class _Binary:
    """A binary FBX, whose nodes are read when they are asked for."""

    def __init__(self, path: Path, data: mmap.mmap) -> None:
        self._path = path
        self._data = data
        (version,) = self._numbers("<I", len(_MAGIC))
        self._head = "<3Q" if version >= _WIDE else "<3I"
        self.start = len(_MAGIC) + 4

    def _numbers(self, form: str, place: int) -> tuple[int, ...]:
        try:
            return struct.unpack_from(form, self._data, place)
        except struct.error:
            raise self._broken() from None

    def _broken(self) -> UserError:
        return UserError(f"{self._path}: is cut short, or not an FBX file; export it again")

    def nodes(self, place: int, end: int) -> Iterator[_Node]:
        """Yield the nodes from a place on. An empty node ends them, unless ``end`` does."""
        size = struct.calcsize(self._head)
        while place < end:
            node_end, count, length = self._numbers(self._head, place)
            if node_end == 0:
                return
            (name_length,) = self._numbers("<B", place + size)
            properties = place + size + 1 + name_length
            children = properties + length
            if not place < children <= node_end <= end:
                raise self._broken()
            name = self._data[place + size + 1 : properties].decode("ascii", "replace")
            yield _Node(name, properties, count, children, node_end)
            place = node_end
        if end == len(self._data):
            raise self._broken()

    def all_nodes(self) -> Iterator[_Node]:
        return self.nodes(self.start, len(self._data))

    def children(self, node: _Node) -> Iterator[_Node]:
        return self.nodes(node.children, node.end)

    def texts(self, node: _Node) -> Iterator[bytes]:
        """Yield the texts and the data among a node's properties, until one of another type."""
        place = node.properties
        for _ in range(node.property_count):
            kind = self._data[place : place + 1]
            if kind in _SIZES:
                place += 1 + _SIZES[kind]
                continue
            if kind not in (b"S", b"R"):
                return
            (length,) = self._numbers("<I", place + 1)
            yield self._data[place + 5 : place + 5 + length]
            place += 5 + length


def check(path: Path) -> None:
    """Raise `UserError` for an FBX that is cut short. Blender may import the part that is there."""
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) == _MAGIC:
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                # Each node says where it ends, and an empty one ends the file.
                for _ in _Binary(path, data).all_nodes():
                    pass
            return
    text = re.sub(rb'"[^"]*"|;[^\n]*', b"", path.read_bytes())
    if text.count(b"{") != text.count(b"}"):
        raise UserError(f"{path}: is cut short: it has braces that do not end; export it again")


def survey(path: Path) -> Survey:
    """Return the existing files that an FBX names, and its surfaces that Blender does not import.

    Missing textures are known after the import: not every texture that an FBX names is used.
    """
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) == _MAGIC:
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                names, left_out = _of_binary(_Binary(path, data))
        else:
            names, left_out = _of_text(path.read_bytes())
    references = []
    for absolute_name, relative_name in dict.fromkeys(names):
        for place in _places(path, absolute_name, relative_name):
            # Path.exists() raises for a path that is too long.
            if os.path.exists(place):  # noqa: PTH110
                references.append(FileReference(path, relative_name or absolute_name, place))
                break
    return Survey(references, left_out)


def _of_binary(fbx: _Binary) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the absolute and the relative name of each file, and what is left out."""
    names, left_out = [], []
    for top in fbx.all_nodes():
        for node in fbx.children(top) if top.name == "Objects" else ():
            if node.name in ("Texture", "Video"):
                fields = {each.name.lower(): fbx.texts(each) for each in fbx.children(node)}
                pair = [
                    os.fsdecode(next(fields.get(key, iter(())), b""))
                    for key in ("filename", "relativefilename")
                ]
                names.append((pair[0], pair[1]))
            elif node.name == "Geometry":
                texts = [text.decode("utf-8", "replace") for text in fbx.texts(node)]
                left_out += [_left_out(text) for text in texts if text in _SURFACES_LEFT_OUT]
    return names, left_out


def _of_text(text: bytes) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the same of an FBX that is a text."""
    names, absolute_name = [], ""
    for key, value in re.findall(rb'^\s*(\w*File[nN]ame)\s*:\s*"([^"\n]*)"', text, re.MULTILINE):
        name = os.fsdecode(value)
        if key == b"RelativeFilename":
            names.append((absolute_name, name))
        else:
            absolute_name = name
            names.append((name, ""))
    classes = re.findall(rb'^\s*Geometry\s*:[^"\n]*"[^"\n]*"\s*,\s*"(\w+)"', text, re.MULTILINE)
    kinds = [each.decode() for each in classes]
    return names, [_left_out(kind) for kind in kinds if kind in _SURFACES_LEFT_OUT]


def _left_out(kind: str) -> str:
    return f"Blender does not import a {printable(kind)}"


def _places(path: Path, absolute_name: str, relative_name: str) -> Iterator[Path]:
    """Yield the places where Blender looks for a texture, in its order."""
    folder = path.parent
    if relative_name:
        yield _normal(folder / relative_name.replace("\\", "/"))
    if not absolute_name:
        return
    yield _normal(Path(absolute_name))
    if drive := re.match(r"([A-Za-z]):[\\/]", absolute_name):
        # Blender takes C:/a for /c/a.
        yield _normal(Path(f"/{drive[1].lower()}/{absolute_name[3:]}".replace("\\", "/")))
    # Ever longer ends of the absolute path. Blender does not split it at backslashes.
    parts = [part for part in absolute_name.split("/") if part]
    for count in range(1, len(parts) + 1):
        yield _normal(folder.joinpath(*parts[-count:]))


def _normal(path: Path) -> Path:
    return Path(os.path.normpath(path))
