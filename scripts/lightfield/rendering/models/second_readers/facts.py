"""What a model file says, as a second reader of its format finds it, without Blender.

Lengths are in metres before `unit: box` scales the model, or as in the file if it names no unit.
Points are in the world of Blender: right-handed, z up.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The parts of a material that a texture may give: the names of `MaterialFacts.textures`.
ROLES = {
    "base colour": "Base Color",
    "opacity": "Alpha",
    "metallic": "Metallic",
    "roughness": "Roughness",
    "normal": "Normal",
    "emission": "Emission Color",
    "transmission": "Transmission Weight",
}


@dataclass(frozen=True)
class MeshFacts:
    """One mesh as it stands in the world. Each instance of a mesh is one more.

    ``box`` (2, 3) has the least and the largest coordinates of all corners of faces. A face of n
    corners counts as n - 2 ``triangles``. ``area`` is the sum of the faces' vector areas, which
    does not depend on how faces are split into triangles. None is what the reader cannot judge.

    ``colour`` (3,) is the mean linear colour of all corners of faces, and ``opacity`` their mean
    alpha. They are None if the mesh has no colours or alphas of its own, beside its material.

    Blender's box may be smaller on each side by ``slack``, because it shows curves as flat faces.
    """

    name: str
    box: NDArray[np.float64]
    triangles: int | None = None
    area: float | None = None
    colour: NDArray[np.float64] | None = None
    opacity: float | None = None
    slack: float = 0.0


@dataclass(frozen=True)
class MaterialFacts:
    """A material that a mesh uses.

    ``colour`` is its linear base colour, ``opacity`` its alpha from 0 to 1. None if a texture gives
    them, or if the reader cannot judge them. ``textures`` has the names of picture files, without
    folders, by `ROLES`. The name of a picture inside the model may be "", which is any picture.
    """

    name: str
    colour: tuple[float, float, float] | None = None
    opacity: float | None = None
    textures: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelFacts:
    """What a model file says. ``meshes`` is None if the reader cannot judge them.

    ``lost`` are parts that Blender does not show, so that views would be wrong: the import is
    refused, or notes them if `allow_missing`. ``unused`` are features that the file names, and that
    no view shows, and are always noted. ``unjudged`` is what the reader cannot judge, said once.
    """

    meshes: list[MeshFacts] | None
    materials: list[MaterialFacts] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)
    unjudged: list[str] = field(default_factory=list)


_Function = TypeVar("_Function", bound=Callable[..., Any])


def _quietly(function: _Function) -> _Function:
    """Let a function compute with places that are not finite. They are refused later, by name."""
    return np.errstate(invalid="ignore", over="ignore")(function)


class Geometry:
    """The faces of a mesh in its own coordinates, ready to be placed as often as it is shown."""

    @_quietly
    def __init__(
        self,
        places: ArrayLike,
        corners: ArrayLike,
        sizes: ArrayLike,
        colours: NDArray[np.floating[Any]] | None = None,
        opacities: NDArray[np.floating[Any]] | None = None,
    ) -> None:
        """Take vertices (V, 3), the vertices of all corners (C,), and each face's corners (F,).

        ``colours`` (C, 3) are linear, and ``opacities`` (C,) from 0 to 1.

        Corners at the place of the next, and faces at the place of another, are not counted: no
        pixel shows them, and importers remove them.
        """
        points = np.asarray(places, np.float64).reshape(-1, 3)
        indices: NDArray[np.int64] = np.asarray(corners, np.int64).ravel()
        counts: NDArray[np.int64] = np.asarray(sizes, np.int64).ravel()
        if len(indices) < len(points):
            # One of many objects of a file, whose vertices stand in one list.
            used, indices = np.unique(indices, return_inverse=True)
            points = points[used]
        is_used = np.zeros(len(points), bool)
        is_used[indices] = True
        self._used = points[is_used]
        has_corners = len(indices) > 0
        self.colour = (
            colours.mean(0, dtype=np.float64) if colours is not None and has_corners else None
        )
        self.opacity = float(opacities.mean()) if opacities is not None and has_corners else None
        indices, counts = _without_repeated(points, indices, counts)
        self.faces = len(counts)
        self.triangles = int((counts - 2).sum())
        self._areas = _vector_areas(points, indices, counts)

    def __bool__(self) -> bool:
        return len(self._used) > 0

    @_quietly
    def placed(self, name: str, world_from_mesh: NDArray[np.float64] | None = None) -> MeshFacts:
        """Return the mesh at a place: (4, 4), or its own coordinates."""
        matrix = np.eye(4) if world_from_mesh is None else np.asarray(world_from_mesh, np.float64)
        areas = _cofactors(matrix[:3, :3]) @ self._areas
        return MeshFacts(
            name,
            box_of(self._used, matrix),
            self.triangles,
            float(np.sqrt(np.einsum("if,if->f", areas, areas)).sum()),
            self.colour,
            self.opacity,
        )


def box_of(points: NDArray[Any], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the box (2, 3) of points (V, 3) that a matrix (4, 4) moves."""
    moved = points @ matrix[:3, :3].T + matrix[:3, 3]
    return np.array([moved.min(0), moved.max(0)])


def linear_colours(colours: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the linear colours of sRGB colours. Negative ones are 0."""
    # Few models have colours, and this module takes long to import.
    from lightfield.imaging.tonemap import decode_srgb

    return decode_srgb(np.maximum(colours, 0))


def upright(facts: ModelFacts) -> ModelFacts:
    """Return the facts of a model in which y points up with z up."""
    meshes = facts.meshes or []
    return replace(facts, meshes=[replace(each, box=_upright(each.box)) for each in meshes])


def _upright(box: NDArray[np.float64]) -> NDArray[np.float64]:
    (x, y, z), (far_x, far_y, far_z) = box
    return np.array([(x, -far_z, y), (far_x, -z, far_y)])


def _cofactors(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix (3, 3) that turns vector areas as ``matrix`` turns points."""
    first, second, third = matrix
    return np.array([np.cross(second, third), np.cross(third, first), np.cross(first, second)])


def _next_corners(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each corner the index of the next corner of its face. No face is empty."""
    ends = np.cumsum(sizes)
    following = np.arange(1, int(sizes.sum()) + 1)
    following[ends - 1] = ends - sizes
    return following


def _without_repeated(
    points: NDArray[np.float64], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return corners and sizes without repeated corners, and without repeated or empty faces."""
    sizes = sizes[sizes > 0]
    places = _hashes(points)[corners]
    is_kept = places != places[_next_corners(sizes)]
    # What is left of a face may be a line.
    left = _sums(is_kept, sizes)
    is_kept &= np.repeat(left > 2, sizes)
    corners, places, sizes = corners[is_kept], places[is_kept], left[left > 2]
    faces = _sums(places, sizes)
    in_order = np.sort(faces)
    if (in_order[1:] == in_order[:-1]).any():
        _, first = np.unique(faces, return_index=True)
        is_first = np.isin(np.arange(len(sizes)), first)
        return corners[np.repeat(is_first, sizes)], sizes[is_first]
    return corners, sizes


def _hashes(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return a number for each place in 32 bits. Equal places have equal numbers."""
    # The sum makes -0.0 to 0.0.
    bits = (points.astype(np.float32) + np.float32(0)).view(np.uint32).astype(np.uint64)
    number = np.zeros(len(points), np.uint64)
    for column in bits.T:
        # The mixing steps of SplitMix64.
        number = number * np.uint64(0x9E3779B97F4A7C15) + column
        number = (number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        number = (number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        number ^= number >> np.uint64(31)
    return number


def _sums(values: NDArray[Any], sizes: NDArray[np.int64]) -> NDArray[Any]:
    """Return the sum of the values (…, C) of each face (…, F). No face is empty."""
    if not len(sizes):
        return values[..., :0]
    kind = np.int64 if values.dtype == bool else values.dtype
    sums: NDArray[Any] = np.add.reduceat(values, np.cumsum(sizes) - sizes, axis=-1, dtype=kind)
    return sums


def _vector_areas(
    points: NDArray[np.float64], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the vector area (3, F) of each face."""
    if (sizes == 3).all():
        first, second, third = (points[corners[number::3]].T for number in range(3))
        return _cross(second - first, third - first) / 2
    # From the first corner, to lose no digits far from the origin.
    starts = np.repeat(np.cumsum(sizes) - sizes, sizes)
    arms = (points[corners] - points[corners[starts]]).T
    return _sums(_cross(arms, arms[:, _next_corners(sizes)]), sizes) / 2


def _cross(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products of the columns of two arrays (3, N)."""
    # Ten times faster than numpy's own.
    (a, b, c), (d, e, f) = first, second
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])
