"""Reads OBJ files and their libraries of materials a second time.

The coordinates are in the file's own axes.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.rendering.models import obj_files
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import Geometry, ModelFacts, linear_colours
from lightfield.rendering.models.second_readers.mtl import Materials
from lightfield.rendering.models.second_readers.text_lines import Lines, read_lines

# What Blender leaves out, by the keyword of its lines.
_LOST = {
    "surf": "free-form surfaces (surf)",
    "call": "other files (call)",
    "csh": "the output of commands (csh)",
    "bsp": "patches of OBJ 2 (bsp)",
    "bzp": "patches of OBJ 2 (bzp)",
    "cdc": "patches of OBJ 2 (cdc)",
    "res": "patches of OBJ 2 (res)",
}
_UNUSED = {
    "p": "points (p)",
    "l": "lines (l)",
    "curv": "free-form curves (curv)",
    "curv2": "free-form curves (curv2)",
    "bevel": "bevels (bevel)",
    "c_interp": "colours between vertices (c_interp)",
    "d_interp": "opacities between vertices (d_interp)",
    "lod": "levels of detail (lod)",
    "shadow_obj": "an object that casts the shadow (shadow_obj)",
    "trace_obj": "an object that is reflected (trace_obj)",
    "maplib": "texture maps of OBJ 2 (maplib)",
    "usemap": "texture maps of OBJ 2 (usemap)",
}


def read(path: Path) -> ModelFacts:
    """Return what an OBJ and its libraries of materials say.

    Raises `UserError` for what is not a number, and for faces whose vertices do not exist.
    """
    reader = _ObjReader(path)
    for lines in read_lines(path):
        reader.read(lines)
    return reader.facts(Materials(obj_files.libraries(path)))


@dataclass
class _Part:
    """The faces of an object: vertices of corners (C,), and corners of faces (F,)."""

    name: str
    corners: list[NDArray[np.int64]] = field(default_factory=list)
    sizes: list[NDArray[np.int64]] = field(default_factory=list)


class _ObjReader:
    """Collects the vertices and faces of an OBJ."""

    def __init__(self, path: Path) -> None:
        # Of each part of the file: (V, 3), and (V, 3) or (0, 3).
        self.points: list[NDArray[np.float64]] = [np.zeros((0, 3))]
        self.colours: list[NDArray[np.float64]] = [np.zeros((0, 3))]
        self.count = 0
        self.parts = [_Part(path.stem)]
        self.material = b""
        self.used_materials: dict[bytes, None] = {}
        self.keywords: set[str] = set()

    def read(self, lines: Lines) -> None:
        """Read some lines of the file."""
        is_vertex, is_face = lines.starting_with(b"v"), lines.starting_with(b"f")
        vertices_before = self.count + np.cumsum(is_vertex)
        self._read_vertices(lines, is_vertex)
        self._read_faces(lines, is_face, vertices_before)
        self._read_materials(lines, is_face)
        for word in {*_LOST, *_UNUSED} - self.keywords:
            if lines.starting_with(word.encode()).any():
                self.keywords.add(word)

    def _read_vertices(self, lines: Lines, is_vertex: NDArray[np.bool_]) -> None:
        numbers, counts = lines.numbers(is_vertex, b"v")
        starts = np.cumsum(counts) - counts
        has_place = counts >= 3
        is_right = has_place.copy()
        points = numbers[starts[has_place, None] + np.arange(3)]
        is_right[has_place] = np.isfinite(points).all(axis=1)
        if not is_right.all():
            line = np.flatnonzero(is_vertex)[np.argmin(is_right)]
            lines.refuse(line, "has a vertex whose place is not three numbers")
        self.points.append(points)
        self.colours.append(numbers[starts[counts >= 6, None] + np.arange(3, 6)])
        self.count += len(points)

    def _read_faces(
        self, lines: Lines, is_face: NDArray[np.bool_], vertices_before: NDArray[np.int64]
    ) -> None:
        numbers, sizes = lines.whole_numbers(is_face, b"f")
        face_of = np.repeat(np.arange(len(sizes)), sizes)
        known = vertices_before[is_face][face_of]
        # Negative numbers count back from the last vertex.
        corners = np.where(numbers < 0, known + numbers, numbers - 1)
        is_wrong = (corners < 0) | (corners >= known)
        if is_wrong.any():
            line = np.flatnonzero(is_face)[face_of[np.argmax(is_wrong)]]
            lines.refuse(line, "has a face with a vertex that does not exist")
        starts = np.flatnonzero(lines.starting_with(b"o"))
        ends = np.concatenate([[0], np.cumsum(sizes)])
        owners = np.searchsorted(starts, np.flatnonzero(is_face))
        for number in range(len(starts) + 1):
            if number:
                name = lines.text(starts[number - 1])[1:].strip()
                self.parts.append(_Part(os.fsdecode(name)))
            first, last = np.searchsorted(owners, [number, number + 1])
            self.parts[-1].corners.append(corners[ends[first] : ends[last]])
            self.parts[-1].sizes.append(sizes[first:last])

    def _read_materials(self, lines: Lines, is_face: NDArray[np.bool_]) -> None:
        """Note the materials that faces follow."""
        faces = np.flatnonzero(is_face)
        changes = np.flatnonzero(lines.starting_with(b"usemtl"))
        first_faces = np.searchsorted(faces, [0, *changes, len(lines)])
        for number in range(len(changes) + 1):
            if number:
                self.material = lines.text(changes[number - 1])[len(b"usemtl") :].strip()
            if first_faces[number] < first_faces[number + 1]:
                self.used_materials[self.material] = None

    def facts(self, materials: Materials) -> ModelFacts:
        """Return what the file says, with its libraries' ``materials``."""
        points, colours = np.concatenate(self.points), np.concatenate(self.colours)
        has_colours = len(colours) == len(points) and np.isfinite(colours).all()
        linear = linear_colours(colours) if has_colours else None
        meshes = [
            geometry.placed(part.name)
            for part in self.parts
            if (geometry := _geometry(part, points, linear))
        ]
        named = [name for name in self.used_materials if name]
        used = [name for name in named if name in materials]
        unused = [_UNUSED[word] for word in _UNUSED if word in self.keywords]
        if linear is not None and used:
            unused.append("the colours of vertices, which have materials")
        unused += [
            f"the material {printable(os.fsdecode(name))}, which no library has"
            for name in named
            if name not in materials
        ]
        lost = [_LOST[word] for word in _LOST if word in self.keywords]
        return ModelFacts(
            meshes,
            [materials.facts(name) for name in used],
            lost + [each for name in used for each in materials.lost(name)],
            unused + [each for name in used for each in materials.unused(name)],
        )


def _geometry(
    part: _Part, points: NDArray[np.float64], colours: NDArray[np.float64] | None
) -> Geometry:
    corners, sizes = np.concatenate(part.corners), np.concatenate(part.sizes)
    return Geometry(points, corners, sizes, None if colours is None else colours[corners])
