"""Reads the tree of an FBX, of bytes or of text: its objects, and how they are connected."""

import importlib
import math
import re
import struct
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError

# From this version on, objects have numbers.
_NUMBERED = 7000
_MAGIC = b"Kaydara FBX Binary"
# The parts of an FBX of text: comments, names, texts, arrays' lengths, numbers, and signs.
_TOKEN = re.compile(
    rb';[^\n]*|([A-Za-z_][\w|]*)\s*:|"([^"]*)"|\*\d+|([-+]?[\d.][-+.\w#]*)|([{},])|([A-Za-z]\w*)'
)
# What the reader that comes with Blender raises for a file that it does not understand.
_UNREADABLE = (OSError, ValueError, LookupError, AssertionError, struct.error, MemoryError)


class Node(NamedTuple):
    """A node of the tree: its name, its values, and its children."""

    name: str
    values: list[Any]
    children: list["Node"]

    def child(self, name: str) -> "Node | None":
        return next((each for each in self.children if each.name == name), None)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return the numbers of a child. None if it is missing or empty."""
        child = self.child(name)
        if child is None:
            return np.zeros(0)
        # A text may have an array in a child of its own, or all numbers as values.
        inner = child.child("a") or child
        values = inner.values[0] if len(inner.values) == 1 else inner.values
        return np.array(values, np.float64).ravel()


class Connection(NamedTuple):
    """A connection of an object to its owner, and to which of the owner's properties."""

    child: int
    owner: int
    property: str


class Thing(NamedTuple):
    """An object of an FBX: its kind, its class, its name, and its node."""

    kind: str
    category: str
    name: str
    node: Node


class Tree:
    """An FBX file. Of versions before 7, only the ``version`` is read."""

    def __init__(self, path: Path) -> None:
        """Raises `UserError` if the file is broken."""
        try:
            top = _of_bytes(path) if path.read_bytes()[:18] == _MAGIC else _of_text(path)
        except _UNREADABLE:
            raise UserError(f"{path}: is cut short, or not an FBX file; export it again") from None
        self._sections = {node.name: node for node in top}
        head = self._sections.get("FBXHeaderExtension")
        version = head and head.child("FBXVersion")
        self.version = int(version.values[0]) if version else 0
        is_readable = not self.is_old
        objects = self._sections.get("Objects") if is_readable else None
        connections = self._sections.get("Connections") if is_readable else None
        self.objects = dict(_objects(objects)) if objects else {}
        self.connections = list(_connections(connections))
        self._children: dict[int, list[Connection]] = defaultdict(list)
        for connection in self.connections:
            self._children[connection.owner].append(connection)
        self._defaults = self._templates()

    @property
    def is_old(self) -> bool:
        """Whether the file is older than FBX 7, so that its objects are not read."""
        return self.version < _NUMBERED

    def children(self, owner: int, kind: str) -> Iterator[tuple[int, Thing, str]]:
        """Yield the objects of a kind that are connected to an owner, and to which property."""
        for connection in self._children[owner]:
            thing = self.objects.get(connection.child)
            if thing and thing.kind == kind:
                yield connection.child, thing, connection.property

    def settings(self) -> dict[str, Any]:
        """Return the properties of the whole file, such as the axis that points up."""
        section = self._sections.get("GlobalSettings")
        return _properties(section) if section else {}

    def properties(self, thing: Thing) -> dict[str, Any]:
        """Return the properties of an object, with the defaults of its kind."""
        return self._defaults.get(thing.kind, {}) | _properties(thing.node)

    def _templates(self) -> dict[str, dict[str, Any]]:
        section = self._sections.get("Definitions")
        templates = {}
        for kind in section.children if section else ():
            if kind.name == "ObjectType" and (template := kind.child("PropertyTemplate")):
                templates[str(kind.values[0])] = _properties(template)
        return templates


def _objects(section: Node) -> Iterator[tuple[int, Thing]]:
    for node in section.children:
        if len(node.values) >= 3:
            number, label, category = node.values[:3]
            yield int(number), Thing(node.name, str(category), _name(str(label)), node)


def _name(label: str) -> str:
    """Return the name of an object. A text has its kind before it, and bytes after it."""
    return label.partition("\0\1")[0] if "\0\1" in label else label.rpartition("::")[2]


def _connections(section: Node | None) -> Iterator[Connection]:
    for node in section.children if section else ():
        # Connections of properties to properties move nothing.
        if node.name == "C" and len(node.values) >= 3 and node.values[0] in ("OO", "OP"):
            name = str(node.values[3]) if len(node.values) > 3 else ""
            yield Connection(int(node.values[1]), int(node.values[2]), name)


def _properties(node: Node) -> dict[str, Any]:
    """Return the properties of a node by their name: a number, a text, or three numbers."""
    table = node.child("Properties70")
    found = {}
    for entry in table.children if table else ():
        name, values = str(entry.values[0]), entry.values[4:]
        if values:
            found[name] = values[0] if len(values) == 1 else tuple(values)
    return found


def _of_bytes(path: Path) -> list[Node]:
    # It comes with Blender.
    reader: Any = importlib.import_module("io_scene_fbx.parse_fbx")
    root, _ = reader.parse(str(path))
    return [_node(element) for element in root.elems]


def _node(element: Any) -> Node:
    values = [
        value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        for value in element.props
    ]
    return Node(element.id.decode(), values, [_node(each) for each in element.elems])


def _of_text(path: Path) -> list[Node]:
    top: list[Node] = []
    # The lists of children to which the next node may be added.
    lists = [top]
    for match in _TOKEN.finditer(path.read_bytes()):
        name, text, number, sign, word = match.groups()
        if name is not None:
            lists[-1].append(Node(name.decode(), [], []))
        elif sign == b"{":
            lists.append(lists[-1][-1].children)
        elif sign == b"}":
            lists.pop()
        elif text is not None and lists[-1]:
            lists[-1][-1].values.append(text.decode("utf-8", "replace"))
        elif number is not None and lists[-1]:
            lists[-1][-1].values.append(_number(number))
        elif word is not None and lists[-1]:
            lists[-1][-1].values.append(word.decode())
    return top


def _number(text: bytes) -> int | float | str:
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        # Some programs write 1.#INF and -1.#IND for what is no number.
        return math.nan if b"#" in text or b"nan" in text.lower() else text.decode()
