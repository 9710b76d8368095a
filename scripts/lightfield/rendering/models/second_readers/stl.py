"""Reads STL files a second time: text and binary.

The coordinates are in the file's own axes.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.models.second_readers.facts import Geometry, ModelFacts, linear_colours
from lightfield.rendering.models.second_readers.text_lines import Lines, read_lines

_HEADER = 80
# Materialise Magics names the colour of all facets after this word, in RGBA.
_COLOUR_OF_ALL = b"COLOR="
# The linear colour of meshes without a material.
_GREY = 0.5
_FACET = np.dtype([("normal", "<f4", 3), ("places", "<f4", (3, 3)), ("colour", "<u2")])


def read(path: Path) -> ModelFacts:
    """Return what an STL says. Raises `UserError` as `read_facets` does."""
    places, colours = read_facets(path)
    corners = np.arange(3 * len(places))
    corner_colours = None if colours is None else np.repeat(colours, 3, axis=0)
    geometry = Geometry(places, corners, np.full(len(places), 3), corner_colours)
    dropped = len(places) - geometry.faces
    note = f"{dropped} of {len(places)} facets, which repeat a corner or another facet"
    return ModelFacts(
        [geometry.placed(path.stem)] if geometry else [],
        unused=[note] if dropped else [],
    )


def read_facets(path: Path) -> tuple[NDArray[np.floating[Any]], NDArray[np.float64] | None]:
    """Return the corners of all facets (F, 3, 3), and their linear colours (F, 3) or None.

    Raises `UserError` if the file is cut short, or has places that are not numbers.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER + 4)
    size = path.stat().st_size
    expected = _HEADER + 4 + _FACET.itemsize * int.from_bytes(head[_HEADER:], "little")
    if head.lstrip().startswith(b"solid") and size != expected:
        return _of_text(path), None
    if len(head) < _HEADER + 4 or size < expected or expected == _HEADER + 4:
        raise UserError(f"{path}: is cut short, or not an STL file: it has {size} bytes")
    facets = np.fromfile(path, _FACET, offset=_HEADER + 4, count=(expected - 84) // 50)
    if not np.isfinite(facets["places"]).all():
        raise UserError(f"{path}: has vertices whose places are not numbers; export it again")
    return facets["places"], _colours(head, facets["colour"])


def _of_text(path: Path) -> NDArray[np.float64]:
    """Return the corners of the facets of a text."""
    parts = [np.zeros((0, 3))]
    ends = 0
    for lines in read_lines(path):
        parts.append(_vertices(lines))
        ends += int(lines.starting_with(b"endsolid").sum() - lines.starting_with(b"solid").sum())
    places = np.concatenate(parts)
    if ends or len(places) % 3:
        raise UserError(f"{path}: is cut short; an STL text ends with endsolid")
    return places.reshape(-1, 3, 3)


def _vertices(lines: Lines) -> NDArray[np.float64]:
    is_vertex = lines.starting_with(b"vertex")
    numbers, counts = lines.numbers(is_vertex, b"vertex")
    is_right = counts == 3
    if is_right.all():
        is_right = np.isfinite(numbers.reshape(-1, 3)).all(axis=1)
    if not is_right.all():
        line = np.flatnonzero(is_vertex)[np.argmin(is_right)]
        lines.refuse(line, "has a vertex whose place is not three numbers")
    return numbers.reshape(-1, 3)


def _colours(head: bytes, words: NDArray[np.uint16]) -> NDArray[np.float64] | None:
    """Return the linear colours (F, 3) of facets from their attributes of 16 bits.

    None if none has a colour. VisCAM and SolidView set the highest bit of a facet with a colour,
    and have blue in the lowest bits. Materialise Magics names a colour of all in the header, sets
    the bit of facets without a colour of their own, and has red in the lowest bits.
    """
    is_set = words >> 15 == 1
    steps = np.stack([words >> 10 & 31, words >> 5 & 31, words & 31], axis=1) / 31
    _, word, rest = head[:_HEADER].partition(_COLOUR_OF_ALL)
    if word:
        of_all = np.frombuffer(rest[:3].ljust(3, b"\xff"), np.uint8) / 255
        return linear_colours(np.where(is_set[:, None], of_all, steps[:, ::-1]))
    # A facet without a colour is as grey as meshes without a material.
    return np.where(is_set[:, None], linear_colours(steps), _GREY) if is_set.any() else None
