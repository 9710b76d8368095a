"""Reads PLY files a second time: text, and binary of both byte orders.

The coordinates are in the file's own axes.
"""

import itertools
import os
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import Geometry, ModelFacts, linear_colours
from lightfield.rendering.models.second_readers.text_lines import read_lines

# Blender crashes at a longer line of a header. In bytes, without the end of the line.
_LONGEST_LINE = 65535
# The types of values as in numpy.
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_TEXT = "text"
_ORDERS = {"ascii": _TEXT, "binary_little_endian": "<", "binary_big_endian": ">"}
# Names of properties. Of these, Blender reads only the first of vertices.
_COLOURS = (
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
_UVS = (("s", "t"), ("texture_u", "texture_v"), ("u", "v"))
_CORNERS = ("vertex_indices", "vertex_index")
_TEXTURES = ("texnumber", "texture_index")
_KNOWN_ELEMENTS = ("vertex", "face", "tristrips")


class _Property(NamedTuple):
    """A property of an element: types as in numpy. ``length`` is the type of a list's length."""

    name: str
    type: str
    length: str | None


class _Column(NamedTuple):
    """The values of a property, and the type in its file. ``lengths`` are those of lists."""

    values: NDArray[Any]
    type: str
    lengths: NDArray[np.int64] | None = None


_Columns = dict[str, _Column]


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass
class PlyHeader:
    """What the header of a PLY says. It has ``size`` bytes in ``lines``."""

    order: str = ""
    elements: list[_Element] = field(default_factory=list)
    textures: list[str] = field(default_factory=list)
    size: int = 0
    lines: int = 0


@dataclass(frozen=True)
class Content:
    """The faces of a PLY.

    ``places`` (V, 3); ``corners`` (C,) are the vertices of all corners, and ``sizes`` (F,) the
    corners of each face. Each is None if the file has none: ``colours`` (C, 3) of corners, linear;
    ``uvs`` (C, 2) of corners; ``texture_of_face`` (F,), whose numbers count ``textures``.
    """

    places: NDArray[np.float64]
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    colours: NDArray[np.float64] | None
    uvs: NDArray[np.float64] | None
    texture_of_face: NDArray[np.int64] | None
    textures: list[str]
    unused: list[str]


def read(path: Path) -> ModelFacts:
    """Return what a PLY says. Raises `UserError` as `read_content` does."""
    content = read_content(path)
    geometry = Geometry(content.places, content.corners, content.sizes, content.colours)
    lost = []
    if content.textures and content.uvs is None:
        lost = [f"the texture {printable(name)}, which has no place" for name in content.textures]
    dropped = len(content.sizes) - geometry.faces
    if dropped:
        content.unused.append(
            f"{dropped} of {len(content.sizes)} faces, which repeat a corner or another face"
        )
    meshes = [geometry.placed(path.stem)] if geometry else []
    return ModelFacts(meshes, lost=lost, unused=content.unused)


def read_header(path: Path) -> PlyHeader:
    """Return the header of a PLY.

    Raises `UserError` if it has no end, a line that Blender cannot read, or an unknown type.
    """
    header = PlyHeader()
    with path.open("rb") as file:
        number = 0
        while line := file.readline(_LONGEST_LINE + 2):
            number += 1
            if len(line.rstrip(b"\r\n")) > _LONGEST_LINE:
                raise UserError(
                    f"{path}: line {number} of its header has more than {_LONGEST_LINE} bytes, at "
                    "which Blender crashes; shorten it, such as a comment"
                )
            words = os.fsdecode(line).split()
            if number == 1 and words != ["ply"]:
                raise UserError(f"{path}: is not a PLY file: it does not begin with ply")
            if words == ["end_header"]:
                header.size, header.lines = file.tell(), number
                return header
            try:
                _read_line(header, words, os.fsdecode(line).strip())
            except (KeyError, ValueError, IndexError):
                raise UserError(
                    f"{path}: line {number} of its header is none of a PLY; export it again"
                ) from None
    raise UserError(f"{path}: is cut short: its header has no end; export it again")


def _read_line(header: PlyHeader, words: list[str], line: str) -> None:
    match words:
        case ["format", order, _]:
            header.order = _ORDERS[order]
        case ["element", name, count]:
            if not count.isdecimal():
                raise ValueError
            header.elements.append(_Element(name, int(count)))
        case ["property", "list", length, kind, name]:
            header.elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[length]))
        case ["property", kind, name]:
            header.elements[-1].properties.append(_Property(name, _TYPES[kind], None))
        case ["comment", "TextureFile", _, *_]:
            header.textures.append(line.split(None, 2)[2])


def read_content(path: Path) -> Content:
    """Return the faces of a PLY.

    Raises `UserError` if it is cut short, or has places that are not numbers, or faces with
    vertices that do not exist.
    """
    header = read_header(path)
    columns = _columns(path, header)
    vertices, faces = columns.get("vertex", {}), columns.get("face", {})
    if not {"x", "y", "z"} <= vertices.keys():
        raise UserError(f"{path}: has no vertices with x, y and z; export it again")
    places = np.stack([vertices[axis].values.astype(np.float64) for axis in "xyz"], axis=1)
    if not np.isfinite(places).all():
        raise UserError(f"{path}: has vertices whose places are not numbers; export it again")
    corners, sizes = _corners(columns)
    if ((corners < 0) | (corners >= len(places))).any():
        raise UserError(
            f"{path}: has {len(sizes)} faces, some of which have corners that do not exist; export "
            "it again"
        )
    of_vertices, of_faces = _colours(vertices), _colours(faces)
    colours = None if of_faces is None else np.repeat(of_faces, sizes, axis=0)
    textures = next((faces[name].values for name in _TEXTURES if name in faces), None)
    return Content(
        places,
        corners,
        sizes,
        colours if of_vertices is None else of_vertices[corners],
        _uvs(vertices, faces, corners),
        None if textures is None else textures.astype(np.int64),
        header.textures,
        list(_unused(header, columns)),
    )


# ---- the values -----------------------------------------------------------------------------

# The values of a property, and the lengths of its lists.
_Values = tuple[NDArray[Any], NDArray[np.int64] | None]


def _columns(path: Path, header: PlyHeader) -> dict[str, _Columns]:
    """Return the properties of each element by their names."""
    rows = _TextRows(path, header) if header.order == _TEXT else _BinaryRows(path, header)
    columns = {}
    for element in header.elements:
        try:
            values = rows.read(element)
        except (ValueError, IndexError, OverflowError, struct.error):
            raise UserError(
                f"{path}: has fewer values than its header promises: it may be cut short; export "
                "it again"
            ) from None
        columns[element.name] = {
            each.name: _Column(column, each.type, lengths)
            for each, (column, lengths) in zip(element.properties, values, strict=True)
        }
    return columns


class _TextRows:
    """The rows of a text: a line each. More values than the header promises are passed over."""

    def __init__(self, path: Path, header: PlyHeader) -> None:
        parts = [
            lines.all_numbers() for lines in read_lines(path, header.size, header.lines + 1)
        ] or [(np.zeros(0), np.zeros(0, np.int64))]
        self._numbers = np.concatenate([numbers for numbers, _ in parts])
        counts = np.concatenate([counts for _, counts in parts])
        # The first number of each row, and the end of the last.
        self._bounds = np.concatenate([[0], np.cumsum(counts[counts > 0])])
        self._row = 0

    def read(self, element: _Element) -> list[_Values]:
        """Return the properties of the next element."""
        first, self._row = self._row, self._row + element.count
        places, ends = self._bounds[first : self._row], self._bounds[first + 1 : self._row + 1]
        if len(ends) != element.count:
            raise ValueError
        values: list[_Values] = []
        for each in element.properties:
            lengths = np.ones(element.count, np.int64)
            if each.length:
                lengths = self._numbers[places].astype(np.int64)
                places = places + 1
            column = self._numbers[_listed(places, lengths)]
            values.append((column, lengths if each.length else None))
            places = places + lengths
        if (places > ends).any():
            raise ValueError
        return values


class _BinaryRows:
    """The rows of a binary file."""

    def __init__(self, path: Path, header: PlyHeader) -> None:
        self._data = np.fromfile(path, np.uint8, offset=header.size)
        self._order = header.order
        self._place = 0

    def read(self, element: _Element) -> list[_Values]:
        """Return the properties of the next element."""
        stored = [
            _Property(each.name, self._order + each.type, each.length and self._order + each.length)
            for each in element.properties
        ]
        least = sum(np.dtype(each.length or each.type).itemsize for each in stored)
        if element.count * least > len(self._data) - self._place:
            raise ValueError
        rows = (element.count, stored, self._data, self._place)
        values, self._place = _equal_rows(*rows) or _unequal_rows(*rows)
        return values


def _equal_rows(
    count: int, properties: list[_Property], data: NDArray[np.uint8], place: int
) -> tuple[list[_Values], int] | None:
    """Return the properties of rows whose lists are as long as the first row's, or None."""
    fields: list[Any] = []
    row = place
    for number, each in enumerate(properties):
        length = 1
        if each.length:
            fields.append((f"length{number}", each.length))
            first = data[row : row + np.dtype(each.length).itemsize]
            length = int(first.view(each.length)[0]) if count else 0
            row += len(first)
        fields.append((f"values{number}", each.type, (length,)))
        row += length * np.dtype(each.type).itemsize
    end = place + count * (row - place)
    if end > len(data):
        return None
    rows = data[place:end].view(np.dtype(fields)) if count else np.zeros(0, np.dtype(fields))
    values: list[_Values] = []
    for number, each in enumerate(properties):
        column = rows[f"values{number}"]
        if each.length and (rows[f"length{number}"] != column.shape[1]).any():
            return None
        lengths = np.full(count, column.shape[1]) if each.length else None
        values.append((column.ravel(), lengths))
    return values, end


def _unequal_rows(
    count: int, properties: list[_Property], data: NDArray[np.uint8], place: int
) -> tuple[list[_Values], int]:
    """Return the properties of rows with lists of different lengths."""
    content = data.tobytes()
    readers = [each.length and _struct(each.length) for each in properties]
    sizes = [np.dtype(each.type).itemsize for each in properties]
    starts, lengths = [], []
    for reader, size in itertools.chain.from_iterable(
        itertools.repeat(list(zip(readers, sizes, strict=True)), count)
    ):
        length = 1
        if reader:
            length = int(reader.unpack_from(content, place)[0])
            place += reader.size
        starts.append(place)
        lengths.append(length)
        place += length * size
    if place > len(data):
        raise ValueError
    all_starts = np.array(starts, np.int64).reshape(count, -1)
    all_lengths = np.array(lengths, np.int64).reshape(count, -1)
    values: list[_Values] = []
    for number, each in enumerate(properties):
        column = _gathered(data, all_starts[:, number], all_lengths[:, number], each.type)
        values.append((column, all_lengths[:, number] if each.length else None))
    return values, place


def _struct(kind: str) -> struct.Struct:
    """Return the reader of a type of numpy with its order."""
    return struct.Struct(kind[0] + np.dtype(kind).char)


def _gathered(
    data: NDArray[np.uint8], starts: NDArray[np.int64], lengths: NDArray[np.int64], kind: str
) -> NDArray[Any]:
    """Return lists of values from their places in the data, one after the other."""
    size = np.dtype(kind).itemsize
    values: NDArray[Any] = data[_listed(starts, lengths * size)].view(kind)
    return values


def _listed(starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices of lists, one list after the other."""
    if (lengths < 0).any():
        raise ValueError
    ends = np.cumsum(lengths)
    places: NDArray[np.int64] = np.arange(lengths.sum(), dtype=np.int64)
    return places + np.repeat(starts - ends + lengths, lengths)


# ---- what they mean -------------------------------------------------------------------------


def _corners(columns: dict[str, _Columns]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the vertices of all corners, and the corners of each face."""
    for name in _CORNERS:
        indices = columns.get("face", {}).get(name)
        if indices and indices.lengths is not None:
            return indices.values.astype(np.int64), indices.lengths
    for indices in columns.get("tristrips", {}).values():
        if indices.lengths is not None:
            # -1 begins another strip.
            strip = np.insert(indices.values.astype(np.int64), np.cumsum(indices.lengths), -1)
            triangles = np.lib.stride_tricks.sliding_window_view(strip, 3)
            triangles = triangles[(triangles != -1).all(axis=1)]
            return triangles.ravel(), np.full(len(triangles), 3)
    return np.zeros(0, np.int64), np.zeros(0, np.int64)


def _named(columns: _Columns, choices: Iterable[tuple[str, ...]]) -> list[_Column]:
    """Return the properties of the first names that an element has. [] if it has none."""
    for names in choices:
        if columns.keys() >= set(names):
            return [columns[name] for name in names]
    return []


def _colours(columns: _Columns) -> NDArray[np.float64] | None:
    """Return the linear colours (N, 3) of an element. None if it has none."""
    found = _named(columns, _COLOURS)
    if not found or any(column.lengths is not None for column in found):
        return None
    colours = np.stack([_fractions(column) for column in found], axis=1)
    return linear_colours(colours) if np.isfinite(colours).all() else None


def _fractions(column: _Column) -> NDArray[np.float64]:
    """Return a property whose largest value is 1."""
    largest = 1 if column.type.startswith("f") else np.iinfo(column.type).max
    return column.values.astype(np.float64) / largest


def _uvs(vertices: _Columns, faces: _Columns, corners: NDArray[np.int64]) -> Any:
    """Return the places (C, 2) in textures of all corners. None if it has none."""
    lists = faces.get("texcoord")
    if lists is not None and len(lists.values) == 2 * len(corners):
        return lists.values.astype(np.float64).reshape(-1, 2)
    found = _named(vertices, _UVS)
    if not found:
        return None
    return np.stack([column.values.astype(np.float64) for column in found], axis=1)[corners]


def _unused(header: PlyHeader, columns: dict[str, _Columns]) -> Iterator[str]:
    """Yield what no view shows."""
    for element in header.elements:
        if element.name not in _KNOWN_ELEMENTS and element.count:
            yield f"the element {printable(element.name)}"
    alpha = columns.get("vertex", {}).get("alpha")
    if alpha and alpha.lengths is None and (_fractions(alpha) < 1).any():
        yield "the alpha of vertices"
    if header.textures and any(_named(each, _COLOURS) for each in columns.values()):
        yield "the colours of vertices and faces, which have a texture"
