"""The immersive interpolation volume of a rig, and the spacing of its cameras.

The SILVR paper (Courteaux et al. 2022, section "Related Datasets") defines the immersive
interpolation volume as the points for which light rays in ANY direction can be obtained by
interpolating what the cameras captured. Made exact here:

- The cameras span a surface: a mesh of cells, each between neighbouring cameras (four of a grid,
  three of a sphere).
- A ray is obtained by interpolation if it crosses a cell all of whose cameras see its direction.
  Light reaches a point of the volume through the surface in front of the viewer where cameras
  face outward, behind the viewer where they face inside.
- So a point belongs to the volume if the surface surrounds it and, for every cell, all rays
  between the point and the cell are within the view of each of the cell's cameras.

A camera's field of view, as far as it lies within 90° of its axis, is a cone. Where the cone is
convex it holds all rays to a cell if it holds those to the cell's corners. Each side of the cone
and each corner then bound the point by a plane, and the volume is a convex polyhedron: nothing is
sampled. For 180° fisheyes, as SILVR has, the result is exact. Other fields of view are
`CONE_SIDES`-sided pyramids inside the cone, which takes less than 1e-4 off the volume; what a lens
sees beyond 90° is not counted, unless it sees all round.
"""

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, KDTree, QhullError

from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs import Rig

CONE_SIDES = 360

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class InterpolationVolume:
    """Volumes in m³: the immersive interpolation volume, and what the cameras' surface encloses.

    Both are 0 where the surface has an opening, as a plane's and a cylinder's.
    """

    immersive: float
    enclosed: float


def interpolation_volume(rig: Rig, lens: Lens) -> InterpolationVolume | None:
    """Return the volumes of a rig with a lens. None for poses of a file, which span no surface."""
    mesh = rig.cells()
    if mesh is None:
        return None
    views = rig.poses()[:: rig.views_a_position]
    matrices = np.stack([view.matrix() for view in views])
    positions = matrices[:, :3, 3]
    if not is_closed(mesh, positions):
        return InterpolationVolume(0.0, 0.0)
    try:
        hull = ConvexHull(positions)
    except QhullError:  # of cameras in a plane
        return InterpolationVolume(0.0, 0.0)
    enclosed = float(hull.volume)
    if rig.cube_map or sees_all_round(lens):
        return InterpolationVolume(enclosed, enclosed)
    planes = immersive_planes(mesh, hull, matrices, lens, rig.face_inside)
    return InterpolationVolume(0.0 if planes is None else _polyhedron_volume(planes), enclosed)


def immersive_planes(
    mesh: list[tuple[int, ...]],
    hull: ConvexHull,
    matrices: Floats,
    lens: Lens,
    face_inside: bool,
) -> Floats | None:
    """Return the planes (n, 4) around the immersive volume: n · p + c ≤ 0 within.

    ``mesh`` are the cells of a closed surface between cameras (m, 4, 4), and ``hull`` is that of
    their positions. None if the lens does not see its own axis: nothing is within.
    """
    positions = matrices[:, :3, 3]
    outside: Floats = hull.equations
    if sees_all_round(lens):
        return outside
    sides = cone_sides(lens)
    if sides is None:
        return None
    # Facing inside, a ray runs from the surface through the point: the cone opens towards it.
    sign = -1.0 if face_inside else 1.0
    normals = sign * sides @ np.swapaxes(matrices[:, :3, :3], 1, 2)
    bounds = np.full(normals.shape[:2], np.inf)
    for camera, corner in neighbours(mesh):
        bounds[camera] = np.minimum(bounds[camera], normals[camera] @ positions[corner])
    planes = np.concatenate([normals, -bounds[..., None]], axis=-1).reshape(-1, 4)
    bounded: Floats = np.concatenate([_tightest(planes), outside])
    return bounded


def parts_to_edge(matrices: Floats, lens: Lens, places: Floats) -> Floats:
    """Return where places (n, 3) lie between the middle and the edge of the immersive volume.

    0 is the middle of the cameras ``matrices`` (m, 4, 4), and 1 the edge in that direction. inf if
    the middle itself is outside, as it is among cameras in a plane. The convex hull of the cameras
    stands for the surface between them.
    """
    positions = matrices[:, :3, 3]
    middle = positions.mean(axis=0)
    nowhere = np.full(len(places), np.inf)
    try:
        hull = ConvexHull(positions)
    except QhullError:
        return nowhere
    outward = ((positions - middle) * -matrices[:, :3, 2]).sum() >= 0
    mesh = [tuple(map(int, cell)) for cell in hull.simplices]
    planes = immersive_planes(mesh, hull, matrices, lens, not outward)
    if planes is None or (planes[:, :3] @ middle + planes[:, 3] >= 0).any():
        return nowhere
    reach = -(planes[:, :3] @ middle + planes[:, 3])
    parts: Floats = ((places - middle) @ planes[:, :3].T / reach).max(axis=1)
    return parts


def spacing(positions: Floats) -> float:
    """Return the mean distance in metres from each camera (n, 3) to its nearest neighbour.

    Cameras at one position, as on a cuboid's edges, are not each other's neighbours. NaN where
    all cameras share one position.
    """
    places, place_of = np.unique(np.round(positions, 9), axis=0, return_inverse=True)
    if len(places) < 2:
        return math.nan
    distances, _ = KDTree(places).query(places, k=2)
    return float(distances[place_of.ravel(), 1].mean())


def neighbour_spacing(mesh: list[tuple[int, ...]], positions: Floats) -> float:
    """Return the mean length in metres of the cells' edges, each counted once, or NaN."""
    edges = {frozenset((a, b)) for cell in mesh for a, b in _edges(cell) if a != b}
    if not edges:
        return math.nan
    ends = positions[[sorted(edge) for edge in edges]]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1).mean())


def is_closed(mesh: list[tuple[int, ...]], positions: Floats) -> bool:
    """Return whether each edge joins two cells. Cameras at one place are one corner."""
    _, place_of = np.unique(np.round(positions, 9), axis=0, return_inverse=True)
    place_of = place_of.ravel()
    edges = Counter(
        frozenset((int(place_of[a]), int(place_of[b]))) for cell in mesh for a, b in _edges(cell)
    )
    return bool(edges) and all(len(edge) == 2 and n == 2 for edge, n in edges.items())


def neighbours(mesh: list[tuple[int, ...]]) -> list[tuple[int, int]]:
    """Return all pairs (camera, corner) of a cell, also of a camera with itself."""
    return sorted({(camera, corner) for cell in mesh for camera in cell for corner in cell})


def sees_all_round(lens: Lens) -> bool:
    """Return whether the lens's image shows all directions."""
    theta, azimuth = np.meshgrid(np.linspace(0, 3.1, 17), np.linspace(-3.1, 3.1, 17))
    return bool(_seen(lens, _directions(theta, azimuth)).all())


def cone_sides(lens: Lens) -> Floats | None:
    """Return the inward normals (n, 3), in camera coordinates, of the field of view's sides.

    A direction d is seen if normal · d ≥ 0 for all of them; None if the lens does not see its
    own axis. For a field of view of 180° or more this is the one plane of the camera.
    """
    azimuths = 2 * math.pi * np.arange(CONE_SIDES) / CONE_SIDES
    corners = [
        math.atan2(lens.center[1] - y, x - lens.center[0])
        for x in (0, lens.width)
        for y in (0, lens.height)
    ]
    azimuths = np.unique(np.concatenate([azimuths, np.mod(corners, 2 * math.pi)]))
    if not _seen(lens, _directions(np.zeros(1), azimuths[:1])).all():
        return None
    low = np.zeros_like(azimuths)
    high = np.full_like(azimuths, math.pi / 2)
    whole = _seen(lens, _directions(high, azimuths))
    if whole.all():
        return np.array([[0.0, 0.0, -1.0]])
    for _ in range(48):
        middle = (low + high) / 2
        seen = _seen(lens, _directions(middle, azimuths))
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    rim = _directions(np.where(whole, math.pi / 2, low), azimuths)
    normals = np.cross(np.roll(rim, -1, axis=0), rim)
    unit: Floats = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit


def _directions(theta: Floats, azimuth: Floats) -> Floats:
    side = np.sin(theta)
    stacked: Floats = np.stack(
        [side * np.cos(azimuth), side * np.sin(azimuth), -np.cos(theta)], axis=-1
    )
    return stacked


def _seen(lens: Lens, directions: Floats) -> NDArray[np.bool_]:
    """Return whether the image shows these directions, its edge and 1e-6 pixels included."""
    pixels = lens.pixels(directions)
    with np.errstate(invalid="ignore"):
        inside = (pixels > -1e-6) & (pixels < np.array([lens.width, lens.height]) + 1e-6)
    seen: NDArray[np.bool_] = inside.all(axis=-1)
    return seen


def _edges(cell: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(cell, (*cell[1:], cell[0]), strict=True))


def _tightest(planes: Floats) -> Floats:
    """Return only the tightest of parallel planes n · p + c ≤ 0, such as those of a flat side."""
    normals, group = np.unique(np.round(planes[:, :3], 9), axis=0, return_inverse=True)
    constants = np.full(len(normals), -np.inf)
    np.maximum.at(constants, group.ravel(), planes[:, 3])
    return np.column_stack([normals, constants])


def _polyhedron_volume(planes: Floats) -> float:
    """Return the volume of {p : n · p + c ≤ 0} for all rows (n, c), 0 if it is empty or flat."""
    # The centre of the largest ball inside, by linear programming, is well inside.
    lengths = np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    ball = linprog(
        [0, 0, 0, -1],
        A_ub=np.hstack([planes[:, :3], lengths]),
        b_ub=-planes[:, 3],
        bounds=[(None, None)] * 3 + [(0, None)],
    )
    if not ball.success or ball.x[3] < 1e-9:
        return 0.0
    try:
        corners = HalfspaceIntersection(planes, ball.x[:3]).intersections
        return float(ConvexHull(corners).volume)
    except QhullError:
        return 0.0
