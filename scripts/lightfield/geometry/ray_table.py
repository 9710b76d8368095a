"""The rays of a lens as two splines, from which a shader computes them.

The first is the bend: what moves a point of the image where a lens is not radial. A radial lens has
none. The second is the angle θ over s = 1 − √(1 − r / reach). θ over s is smooth also where a lens
ends with a vertical tangent, as the orthographic one does. So the equations of a lens exist in its
own class alone.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import Array, RadialLens

INTERVALS = 256
# The intervals of the bend, along each side of the image.
BEND_INTERVALS = 32
# Pixels around the image that the tables cover. The widest pixel filter reaches 15 pixels out.
MARGIN = 16
# A shader must meet the lens's own rays within this many pixels.
LARGEST_ERROR = 1e-3
# Points in each interval where the splines are tested, and where the bend is fitted, too. The bend
# of a lens takes seconds for a million points.
_STEPS = 4
_BEND_STEPS = 2
# How strongly the bend is smooth where the lens has no rays that tell it.
_SMOOTHNESS = 1e-6


@dataclass(frozen=True)
class RayTable:
    """The rays of a lens as splines.

    - ``reach``: the largest r that the table has, in the units of the lens's r.
    - ``angles`` (INTERVALS + 3,): the coefficients of θ in radians.
    - ``bend`` (BEND_INTERVALS + 3, BEND_INTERVALS + 3, 2): the coefficients of how far the bend
      moves a point right and up, as parts of ``reach``. Its rows go up and its columns go right,
      over the image and `MARGIN` pixels around it. None for a radial lens.
    """

    reach: float
    angles: Array
    bend: Array | None

    @property
    def is_ahead(self) -> bool:
        """Whether all rays lie in front of the camera's plane."""
        return bool(np.abs(self.angles).max() < math.pi / 2)


# A build checks the lens of each rig, and rigs often share one.
@cache
def ray_table(lens: RadialLens) -> RayTable:
    """Return the table of a lens. Raises `UserError` if it errs by more than `LARGEST_ERROR`."""
    # Where a lens has no value, it gives NaN.
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        table = _table(lens)
        error = _largest_error(lens, table)
    if error > LARGEST_ERROR:
        raise UserError(
            f"camera: {lens.description}: would be rendered with an error of {error:.2g} pixels, "
            f"but at most {LARGEST_ERROR:g} is allowed; give it a smaller fov, so that no ray is "
            "near the angle where the lens ends"
        )
    return table


def _table(lens: RadialLens) -> RayTable:
    u, v = _around(lens, np.linspace(0, 1, BEND_INTERVALS * _BEND_STEPS + 1))
    unbent = np.stack(lens._unbent(u, v))
    r = np.hypot(*unbent)
    reach = min(lens._limit, float(np.nanmax(r)))
    s = np.linspace(0, 1, INTERVALS + 1)
    sin, cos = lens._sin_cos(reach * (1 - (1 - s) ** 2))
    # θ reaches 360° / 2, where rounding may turn the sign.
    angles = _interpolating(np.unwrap(np.arctan2(sin, cos)))
    offsets = (unbent - [u, v]) / reach
    bend = _fitted(offsets, r <= reach) if offsets.any() else None
    return RayTable(reach, angles, bend)


def _largest_error(lens: RadialLens, table: RayTable) -> float:
    """Return by how many pixels the rays of a table differ from the lens's own, at most.

    The splines are evaluated in float64 between the points that made them.
    """
    return _error_of_angles(lens, table) + _error_of_bend(lens, table)


def _error_of_angles(lens: RadialLens, table: RayTable) -> float:
    """Return by how many pixels the spline of θ moves a ray, at most."""
    s = (np.arange(INTERVALS * _STEPS) + 0.5) / (INTERVALS * _STEPS)
    theta = _basis(s, INTERVALS) @ table.angles
    r = table.reach * (1 - (1 - s) ** 2)
    error = np.abs(lens._radius(np.abs(np.sin(theta)), np.cos(theta))) - r
    return float(np.nanmax(np.abs(error)) / min(lens._unit))


def _error_of_bend(lens: RadialLens, table: RayTable) -> float:
    """Return by how many pixels the spline of the bend moves a point of the image, at most."""
    if table.bend is None:
        return 0.0
    places = (np.arange(BEND_INTERVALS * _BEND_STEPS) + 0.5) / (BEND_INTERVALS * _BEND_STEPS)
    u, v = _around(lens, places)
    right, up = lens._unbent(u, v)
    inside = (np.hypot(right, up) <= table.reach) & _in_image(lens, u, v)
    basis = _basis(places, BEND_INTERVALS)
    moved = np.einsum("yi,xj,ijk->kyx", basis, basis, table.bend) * table.reach
    off = np.hypot((u + moved[0] - right) / lens._unit[0], (v + moved[1] - up) / lens._unit[1])
    return float(off[inside].max(initial=0))


def _around(lens: RadialLens, places: Array) -> tuple[Array, Array]:
    """Return u and v (n, n) at ``places`` (n,), 0 to 1 over the image and its margin."""
    x = (lens.width + 2 * MARGIN) * places - MARGIN
    y = (lens.height + 2 * MARGIN) * (1 - places) - MARGIN
    u = (x - lens.center[0]) * lens._unit[0]
    v = (lens.center[1] - y) * lens._unit[1]
    columns, rows = np.meshgrid(u, v)
    return columns, rows


def _in_image(lens: RadialLens, u: Array, v: Array) -> Array:
    x = lens.center[0] + u / lens._unit[0]
    y = lens.center[1] - v / lens._unit[1]
    return np.asarray((x >= 0) & (x <= lens.width) & (y >= 0) & (y <= lens.height))


def _basis(places: Array, intervals: int) -> Array:
    """Return the cubic B-splines (n, intervals + 3) of equal ``intervals`` at ``places`` (n,)."""
    first = np.minimum((places * intervals).astype(int), intervals - 1)
    s = places * intervals - first
    t = 1 - s
    weights = np.stack([t**3, 4 - 6 * s**2 + 3 * s**3, 4 - 6 * t**2 + 3 * t**3, s**3], axis=1) / 6
    basis = np.zeros((places.size, intervals + 3))
    np.put_along_axis(basis, first[:, None] + np.arange(4), weights, axis=1)
    return basis


def _interpolating(values: Array) -> Array:
    """Return the coefficients of the spline through ``values`` (n + 1,), not a knot."""
    intervals = values.size - 1
    ends = np.zeros((2, intervals + 3))
    ends[0, :5] = ends[1, -5:] = 1, -4, 6, -4, 1
    matrix = np.vstack([_basis(np.linspace(0, 1, intervals + 1), intervals), ends])
    return np.linalg.solve(matrix, np.append(values, [0, 0]))


def _fitted(offsets: Array, inside: Array) -> Array:
    """Return the coefficients of the bend that fits ``offsets`` (2, n, n) best ``inside`` (n, n).

    Elsewhere it goes on smoothly, because the lens may have no value there.
    """
    # The import takes a quarter of a second, and radial lenses do not need it.
    from scipy import sparse
    from scipy.sparse.linalg import splu

    basis = _basis(np.linspace(0, 1, inside.shape[0]), BEND_INTERVALS)
    count = basis.shape[1]
    rows = sparse.kron(sparse.csr_matrix(basis), sparse.csr_matrix(basis), format="csr")
    rows = rows[np.flatnonzero(inside)]
    third = sparse.csr_matrix(np.diff(np.eye(count), n=3, axis=0) * _SMOOTHNESS)
    one = sparse.identity(count)
    smooth = sparse.vstack([sparse.kron(third, one), sparse.kron(one, third)])
    solver = splu((rows.T @ rows + smooth.T @ smooth).tocsc())
    planes = [solver.solve(rows.T @ plane[inside]) for plane in offsets]
    return np.asarray(np.stack(planes, axis=-1).reshape(count, count, 2))
