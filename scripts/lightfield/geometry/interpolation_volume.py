"""The immersive interpolation volume of a rig.

The volume is the set of points at which interpolation gives a light ray of any direction. Source:
Courteaux et al. 2022 (the SILVR paper), section "Related Datasets". This file makes it exact:

- The cameras span a surface: a mesh of triangles, each between neighbouring cameras.
- Interpolation gives a ray if the ray crosses a triangle and all of its cameras see the ray's
  direction. Where cameras face outward, light reaches a point through the surface in front of the
  viewer. Where they face inside, it does so behind the viewer.
- So a point belongs to the volume if two things hold. The surface surrounds the point. For every
  triangle, each of its cameras sees all rays between the point and the triangle.

Within 90° of its axis, a camera's field of view is a cone. A convex cone holds all rays to a
triangle if it holds the rays to its corners. Each side of the cone and each corner then bound the
point by a plane. So the volume is a convex polyhedron, and nothing is sampled. For 180° fisheyes,
as SILVR has, the result is exact. Other fields of view become `_CONE_SIDES`-sided pyramids inside
the cone, which takes less than 1e-4 off the volume. What a lens sees beyond 90° does not count,
unless it sees all round.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from lightfield.geometry.lenses import Lens

_CONE_SIDES = 360
# A volume that is thinner than this part of its length is made of rounding.
_FLAT = 1e-6

Floats = NDArray[np.float64]


def _immersive_planes(
    mesh: list[tuple[int, ...]],
    hull: ConvexHull,
    world_from_cameras: Floats,
    lens: Lens,
    face_inside: bool,
) -> Floats | None:
    """Return the planes (n, 4) around the immersive volume: n · p + c ≤ 0 within.

    ``mesh`` holds the triangles of a closed surface between cameras (m, 4, 4). ``hull`` is the
    convex hull of their positions. None if the lens does not see its own axis: the volume is empty.
    """
    positions = world_from_cameras[:, :3, 3]
    outside: Floats = hull.equations
    if sees_all_round(lens):
        return outside
    sides = _cone_sides(lens)
    if sides is None:
        return None
    # If cameras face inside, a ray runs from the surface through the point.
    sign = -1.0 if face_inside else 1.0
    normals = sign * sides @ np.swapaxes(world_from_cameras[:, :3, :3], 1, 2)
    bounds = np.full(normals.shape[:2], np.inf)
    for camera, corner in neighbours(mesh):
        bounds[camera] = np.minimum(bounds[camera], normals[camera] @ positions[corner])
    planes = np.concatenate([normals, -bounds[..., None]], axis=-1).reshape(-1, 4)
    bounded: Floats = np.concatenate([_tightest(planes), outside])
    return bounded


def parts_to_edge(world_from_cameras: Floats, lens: Lens, places: Floats) -> Floats:
    """Return where places (n, 3) lie between the middle and the edge of the immersive volume.

    0 is the middle of the cameras ``world_from_cameras`` (m, 4, 4), and 1 is the edge in that
    direction. All are inf if the middle itself is outside, as it is among cameras in a plane. The
    convex hull of the cameras stands for the surface between them.
    """
    positions = world_from_cameras[:, :3, 3]
    middle = positions.mean(axis=0)
    nowhere = np.full(len(places), np.inf)
    if flatness(positions) < _FLAT:
        return nowhere
    hull = ConvexHull(positions)
    outward = ((positions - middle) * -world_from_cameras[:, :3, 2]).sum() >= 0
    mesh = [tuple(map(int, cell)) for cell in hull.simplices]
    planes = _immersive_planes(mesh, hull, world_from_cameras, lens, not outward)
    if planes is None or (planes[:, :3] @ middle + planes[:, 3] >= 0).any():
        return nowhere
    reach = -(planes[:, :3] @ middle + planes[:, 3])
    parts: Floats = ((places - middle) @ planes[:, :3].T / reach).max(axis=1)
    return parts


def flatness(positions: Floats) -> float:
    """Return how thin the space is that ``positions`` (n, 3) span: its thickness by its length.

    0 for positions in a plane, but for rounding.
    """
    spans = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    return float(spans[2] / spans[0]) if len(spans) == 3 and spans[0] > 0 else 0.0


def neighbours(mesh: list[tuple[int, ...]]) -> list[tuple[int, int]]:
    """Return all pairs (camera, corner) within a triangle. A camera also pairs with itself."""
    return sorted({(camera, corner) for cell in mesh for camera in cell for corner in cell})


def sees_all_round(lens: Lens) -> bool:
    """Return whether the lens's image shows all directions."""
    theta, azimuth = np.meshgrid(np.linspace(0, 3.1, 17), np.linspace(-3.1, 3.1, 17))
    return bool(_is_visible(lens, _directions(theta, azimuth)).all())


def _cone_sides(lens: Lens) -> Floats | None:
    """Return the inward normals (n, 3), in camera coordinates, of the field of view's sides.

    The lens sees a direction d if normal · d ≥ 0 for all of them. None if the lens does not see
    its own axis. For a field of view of 180° or more the only side is the camera's plane.
    """
    azimuths = 2 * math.pi * np.arange(_CONE_SIDES) / _CONE_SIDES
    corners = [
        math.atan2(lens.center[1] - y, x - lens.center[0])
        for x in (0, lens.width)
        for y in (0, lens.height)
    ]
    azimuths = np.unique(np.concatenate([azimuths, np.mod(corners, 2 * math.pi)]))
    if not _is_visible(lens, _directions(np.zeros(1), azimuths[:1])).all():
        return None
    low = np.zeros_like(azimuths)
    high = np.full_like(azimuths, math.pi / 2)
    is_right_angle_visible = _is_visible(lens, _directions(high, azimuths))
    if is_right_angle_visible.all():
        return np.array([[0.0, 0.0, -1.0]])
    # Bisect the angle of the rim at each azimuth.
    for _ in range(48):
        middle = (low + high) / 2
        is_visible = _is_visible(lens, _directions(middle, azimuths))
        low = np.where(is_visible, middle, low)
        high = np.where(is_visible, high, middle)
    rim = _directions(np.where(is_right_angle_visible, math.pi / 2, low), azimuths)
    normals = np.cross(np.roll(rim, -1, axis=0), rim)
    unit: Floats = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit


def _directions(theta: Floats, azimuth: Floats) -> Floats:
    side = np.sin(theta)
    stacked: Floats = np.stack(
        [side * np.cos(azimuth), side * np.sin(azimuth), -np.cos(theta)], axis=-1
    )
    return stacked


def _is_visible(lens: Lens, directions: Floats) -> NDArray[np.bool_]:
    """Return whether the image shows these directions. The edge may be 1e-6 pixels outside."""
    pixels = lens.pixels(directions)
    with np.errstate(invalid="ignore"):
        inside = (pixels > -1e-6) & (pixels < np.array([lens.width, lens.height]) + 1e-6)
    is_visible: NDArray[np.bool_] = inside.all(axis=-1)
    return is_visible


def _tightest(planes: Floats) -> Floats:
    """Keep only the tightest of parallel planes n · p + c ≤ 0. A flat side has many of them."""
    normals, group = np.unique(np.round(planes[:, :3], 9), axis=0, return_inverse=True)
    constants = np.full(len(normals), -np.inf)
    np.maximum.at(constants, group.ravel(), planes[:, 3])
    return np.column_stack([normals, constants])
