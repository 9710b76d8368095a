"""A sphere: a camera on each vertex of Blender's icosphere, in Blender's order, looking outward."""

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.geometry.rigs.rig import Rig, UnitPoses, ball_outline
from lightfield.geometry.rotations import Floats, matrix_to_euler

# Cameras are in one ring if their heights differ by less than this part of the sphere's height.
# They differ at all because Blender's icosahedron has rounded coordinates.
_SAME_LEVEL = 1e-3


class Sphere(Rig):
    """A camera on each vertex of Blender's icosphere, in Blender's order, looking outward."""

    shape = "SPHERE"
    is_round = True

    type: Literal["sphere"]
    subdivisions: int = Field(
        ge=1,
        le=7,
        description="Subdivisions of the icosphere whose vertices are the cameras: 1 gives 12 "
        "cameras, 2 gives 42, 3 gives 162, and 4 gives 642.",
    )

    @property
    def positions(self) -> int:
        return vertices(self.subdivisions)

    def unit_poses(self) -> UnitPoses:
        places = icosphere(self.subdivisions)
        normal = _unit(places)
        side = np.cross([0.0, 0.0, 1.0], normal)
        poles = np.linalg.norm(side, axis=-1) <= 1e-4
        side[poles] = np.cross([0.0, 1.0, 0.0], normal[poles])
        side = _unit(side)
        up = np.cross(side, normal)
        turns = matrix_to_euler(np.stack([-side, -up, -normal], axis=-1))
        return UnitPoses.of_sides(("", 0.5 * places, turns))

    def _thinned_to(self, positions: int) -> Self | None:
        for subdivisions in range(self.subdivisions - 1, 0, -1):
            thinner = self.model_copy(update={"subdivisions": subdivisions})
            if thinner.positions <= positions:
                return thinner
        return None

    def middle_row(self, places: Floats) -> list[int]:
        """Return the ring of cameras nearest to the equator."""
        order = np.argsort(places[:, 2], kind="stable")
        heights = places[order, 2]
        gaps = np.flatnonzero(np.diff(heights) > _SAME_LEVEL * np.ptp(heights)) + 1
        rings = [ring for ring in np.split(order, gaps) if len(ring) >= 3]
        nearest = min(rings, key=lambda ring: abs(places[ring, 2].mean()), default=order[:0])
        return [int(number) for number in np.sort(nearest)]

    def cells(self) -> list[tuple[int, ...]]:
        # SciPy takes long to import, and no plan needs it.
        from scipy.spatial import ConvexHull

        hull = ConvexHull(icosphere(self.subdivisions))
        return [tuple(map(int, corners)) for corners in hull.simplices]

    def unit_outline(self) -> list[Floats]:
        return ball_outline()


def vertices(subdivisions: int) -> int:
    """Return the number of an icosphere's vertices."""
    return int(10 * 4 ** (subdivisions - 1) + 2)


def icosphere(subdivisions: int) -> Floats:
    """Return the vertices (n, 3) of Blender's icosphere of radius 1, in Blender's order.

    Blender first cuts each edge of an icosahedron into 2^(subdivisions−1) pieces, edge by edge.
    Then it fills each face with rows between two of its edges, face by face. It projects every new
    point to the sphere at once. The result agrees with Blender 5.0 to 1e-6 for 1 to 7 subdivisions.
    The first level keeps the icosahedron's rounded coordinates.
    """
    base = np.array(_ICOSAHEDRON) / 200.0
    if subdivisions == 1:
        return base
    pieces = 2 ** (subdivisions - 1)
    steps = np.arange(1, pieces)[:, None] / pieces
    points = [_unit(base)]
    for start, end in _EDGES:
        points.append(_unit(base[start] + (base[end] - base[start]) * steps))
    for apex, left, right in _FACES:
        row_starts = _unit(base[apex] + (base[left] - base[apex]) * steps)
        row_ends = _unit(base[apex] + (base[right] - base[apex]) * steps)
        for row in range(1, pieces - 1):
            along = np.arange(1, row + 1)[:, None] / (row + 1)
            points.append(_unit(row_starts[row] + (row_ends[row] - row_starts[row]) * along))
    return np.concatenate(points)


def nested(count: int) -> list[NDArray[np.intp]]:
    """Return the vertices that an icosphere shares with each coarser icosphere, finest first.

    Each array holds numbers of vertices. The icosphere has ``count`` vertices. The list is empty
    if no icosphere has so many.
    """
    # SciPy takes long to import, and no plan needs it.
    from scipy.spatial import KDTree

    level_of_count = {vertices(level): level for level in range(1, 8)}
    finest = level_of_count.get(count, 1)
    tree = KDTree(_unit(icosphere(finest)))
    shared = []
    for level in range(finest - 1, 0, -1):
        _, numbers = tree.query(_unit(icosphere(level)))
        shared.append(np.sort(numbers))
    return shared


# The icosahedron that Blender starts from, with coordinates as rounded in its source
# (bmesh/operators/bmo_primitive.cc). Edges and faces are in the order of Blender's subdivision,
# each face from its apex. The tests compare the result with Blender's own.
_ICOSAHEDRON = [
    (0.0, 0.0, -200.0),
    (144.72, -105.144, -89.443),
    (-55.277, -170.128, -89.443),
    (-178.885, 0.0, -89.443),
    (-55.277, 170.128, -89.443),
    (144.72, 105.144, -89.443),
    (55.277, -170.128, 89.443),
    (-144.72, -105.144, 89.443),
    (-144.72, 105.144, 89.443),
    (55.277, 170.128, 89.443),
    (178.885, 0.0, 89.443),
    (0.0, 0.0, 200.0),
]
# fmt: off
_EDGES = [
    (2, 0), (0, 1), (1, 2), (5, 1), (0, 5), (3, 0), (2, 3), (4, 0), (3, 4), (4, 5),
    (10, 1), (5, 10), (6, 2), (1, 6), (7, 3), (2, 7), (8, 4), (3, 8), (9, 5), (4, 9),
    (10, 6), (6, 7), (7, 8), (8, 9), (9, 10), (11, 6), (10, 11), (11, 7), (11, 8), (11, 9),
]
_FACES = [
    (11, 10, 9), (11, 9, 8), (11, 8, 7), (11, 7, 6), (11, 6, 10),
    (10, 5, 9), (9, 4, 8), (8, 3, 7), (7, 2, 6), (6, 1, 10),
    (9, 5, 4), (8, 4, 3), (7, 3, 2), (6, 2, 1), (10, 1, 5),
    (5, 0, 4), (4, 0, 3), (3, 0, 2), (5, 1, 0), (2, 0, 1),
]
# fmt: on


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
