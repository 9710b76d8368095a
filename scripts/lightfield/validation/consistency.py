"""Do the views of a light field see the same world? Depth of one view, looked up in another.

A view's depth is lifted into the world as small surface patches: 3 × 3 pixels and the plane that
fits them best. Depth may have been sampled somewhere under the pixel filter (SILVR's is), so one
value is only good to the slope of the surface times that jitter; the plane averages it, and how far
the nine points lie from it (`Patches.spread`) says how far it can be trusted. Patches that no plane
fits (edges, thin structures) are not used to ask, and give a range instead of an answer.

A patch's centre is then projected into another view, and the plane of the 3 × 3 pixels recorded
there is the answer. The distance from centre to plane has a sign: a point behind the recorded
surface is occluded, which is allowed, and a point in front of it is a contradiction, because that
view looked through the place where the first one saw a surface. A relation of two views is always
tried both ways, so whatever is wrong makes contradictions in one of them.

Errors too small for single points (a fraction of a pixel) show in the mean: `displacement` gives
the rigid motion between two views that their residuals ask for, and how large that is expected to
be where nothing is wrong; `scales` the error of field of view and of depth that all pairs together
ask for; both are first-order least squares on point-to-plane distances (Chen and Medioni 1992).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.depth import stored_distance
from lightfield.geometry.lenses import Lens
from lightfield.geometry.nearest import Cameras

Array = NDArray[np.float64]

# The nine pixels of a patch, row by row.
_ROWS, _COLUMNS = (offset.ravel() for offset in np.mgrid[-1:2, -1:2])

# A patch is a surface when its points lie within so many pixel footprints of their plane (standard
# deviation; the jitter of Cycles' default filter gives up to 0.25) and it is not seen edge-on.
SMOOTH_SPREAD = 0.35
GRAZING_COSINE = 0.2

# A point lies on a recorded surface within this many standard deviations of both planes, and never
# closer than this part of a footprint (curvature that a plane cannot follow).
TOLERANCE_DEVIATIONS = 4.0
TOLERANCE_FOOTPRINTS = 0.05

# Fewer points than this say nothing about a pair of views, nor about six unknowns of motion.
FEWEST_POINTS = 30
NEIGHBOURS = 6
# Among so many of the nearest views are the farther neighbours.
NEIGHBOURHOOD = 48
# Distances that are the same in so many decimals of a metre are the same.
DECIMALS = 6

# Residuals beyond this many footprints are another surface, not a slightly wrong view.
SAME_SURFACE = 1.0

UNKNOWN = 0
AGREE = 1
OCCLUDED = 2
CONTRADICT = 3


@dataclass(frozen=True)
class Camera:
    """Where a view is and what it sees: its lens, camera-to-world (4, 4), and what its depth means.

    ``depth`` is ``"z"`` (along the optical axis) or ``"distance"`` (along the ray), in metres.
    ``grain`` is the angle in radians, if any, within which a depth may come from beside its
    pixel's centre: a pixel of the view from which this one was reprojected.
    """

    lens: Lens
    world_matrix: Array
    depth: str
    grain: float = 0.0

    @property
    def position(self) -> Array:
        return self.world_matrix[:3, 3]

    def lift(self, depth: Array, columns: NDArray[np.int64], rows: NDArray[np.int64]) -> Array:
        """Return the world points (..., 3) that ``depth`` puts on the rays of the pixel centres."""
        rays = self.lens.rays(columns + 0.5, rows + 0.5)
        distance = stored_distance(depth, rays, self.depth)
        with np.errstate(invalid="ignore"):
            arms = rays * distance[..., np.newaxis]
            points: Array = arms @ self.world_matrix[:3, :3].T + self.position
        return points

    def pixels(self, points: Array) -> Array:
        """Return the pixel coordinates (..., 2) of world points, NaN where they are not seen."""
        return self.lens.pixels((points - self.position) @ self.world_matrix[:3, :3])


@dataclass(frozen=True)
class Patches:
    """Surface patches of one view, in world coordinates and metres; n of them.

    points (n, 3): the centres; normals (n, 3): unit, towards the camera; spread (n,): standard
    deviation of the nine points from their plane; footprint (n,): the width of a pixel, or of the
    grain if that is coarser, at that distance, across the ray; error (n,): how far the plane may
    lie off the surface by the grain and by what the file's number format resolves; curvature
    (n, 3): second derivatives of the surface's height above the plane, per pixel squared: along
    columns, along rows, and mixed.
    """

    points: Array
    normals: Array
    spread: Array
    footprint: Array
    error: Array
    curvature: Array

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "Patches":
        return Patches(*(getattr(self, each.name)[which] for each in fields(self)))

    def height(self, columns: Array | float = 0.0, rows: Array | float = 0.0) -> Array:
        """Return how far the curved surface lies in front of the plane, (n,) in metres.

        ``columns`` and ``rows`` (n,) say where, in pixels from the middle pixel's centre. The plane
        goes through the mean of the nine points, so a bulging surface lies in front of it.
        """
        along_columns, along_rows, mixed = self.curvature.T
        bend = along_columns * (columns**2 / 2 - 1 / 3) + along_rows * (rows**2 / 2 - 1 / 3)
        height: Array = bend + mixed * columns * rows
        return height


def _patches(
    camera: Camera, depth: NDArray[Any], columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[Patches, NDArray[np.bool_]]:
    """Fit planes to 3 × 3 pixels about inner pixels; also say which of them are smooth surfaces."""
    columns = columns[:, np.newaxis] + _COLUMNS
    rows = rows[:, np.newaxis] + _ROWS
    values = depth[rows, columns]
    with np.errstate(invalid="ignore", over="ignore"):
        points = camera.lift(values.astype(np.float64), columns, rows)
        finite = np.isfinite(points).all(axis=(1, 2))
        points[~finite] = 0.0
        centres = points.mean(axis=1)
        around = points - centres[:, np.newaxis]
        variances, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
        normals = axes[:, :, 0]
        sight = camera.position - centres
        distance = np.linalg.norm(sight, axis=1)
        cosine = np.einsum("ij,ij->i", normals, sight) / distance
        normals = normals * np.where(cosine < 0, -1.0, 1.0)[:, np.newaxis]
        directions = points - camera.position
        directions /= np.linalg.norm(directions, axis=2, keepdims=True)
        widths = [
            np.linalg.norm(directions[:, a] - directions[:, b], axis=1) for a, b in ((3, 5), (1, 7))
        ]
        footprint = distance * np.maximum(np.sqrt(widths[0] * widths[1]) / 2, camera.grain)
        # Nine points less the three unknowns of a plane.
        spread = np.sqrt(np.maximum(variances[:, 0], 0.0) / 6)
        precision = distance * float(np.finfo(depth.dtype).eps)
        # Half a grain along both sides of a pixel, on a surface that the ray meets at an angle.
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        error = precision + distance * camera.grain * sine / np.sqrt(2.0)
        smooth = (
            finite
            & (spread < SMOOTH_SPREAD * footprint + precision)
            & (np.abs(cosine) > GRAZING_COSINE)
        )
        curvature = _curvature(np.einsum("nij,nj->ni", around, normals))
    # Where pixels have no points there is no plane, and what they say has no extent of its own.
    footprint[~finite] = error[~finite] = 0.0
    return Patches(centres, normals, spread, footprint, error, curvature), smooth


def _curvature(heights: Array) -> Array:
    """Return `Patches.curvature` (n, 3) of nine points' heights (n, 9) above their plane.

    They are the least squares fit of a quadratic surface, from which the plane takes nothing.
    """
    square = heights.reshape(-1, 3, 3)
    along_columns = (square[:, :, 0] - 2 * square[:, :, 1] + square[:, :, 2]).mean(axis=1)
    along_rows = (square[:, 0] - 2 * square[:, 1] + square[:, 2]).mean(axis=1)
    mixed = (square[:, 0, 0] - square[:, 0, 2] - square[:, 2, 0] + square[:, 2, 2]) / 4
    return np.stack([along_columns, along_rows, mixed], axis=1)


def sample(camera: Camera, depth: NDArray[Any], rays: int) -> Patches:
    """Return up to ``rays`` smooth patches of a view, spread evenly over it.

    The image is divided into square cells; of four fixed places in each the smoothest is taken.
    ``depth``: (height, width) of a float type, misses +inf; below 3 × 3 there is no patch.
    """
    height, width = depth.shape
    if min(height, width) < 3:
        none = np.zeros(0, np.int64)
        return _patches(camera, depth, none, none)[0]
    cell = max((height * width / rays) ** 0.5, 2.0)
    down, across = int(height / cell), int(width / cell)
    # The four places of a cell: the corners of a square turned so that none share a row or column.
    places = np.array([(0.3, 0.1), (0.9, 0.3), (0.1, 0.7), (0.7, 0.9)])
    y, x = np.mgrid[0:down, 0:across].reshape(2, -1, 1) + places.T[:, np.newaxis]
    rows = np.clip(y * (height / down), 1, height - 2).astype(np.int64)
    columns = np.clip(x * (width / across), 1, width - 2).astype(np.int64)
    patches, smooth = _patches(camera, depth, columns.ravel(), rows.ravel())
    roughness = np.full(len(smooth), np.inf)
    roughness[smooth] = patches.spread[smooth] / patches.footprint[smooth]
    cells = roughness.reshape(-1, 4)
    best = cells.argmin(axis=1) + 4 * np.arange(len(cells))
    return patches[best[smooth[best]]]


@dataclass(frozen=True)
class Comparison:
    """What one view says of another's n patches.

    - ``verdict`` (n,): AGREE, OCCLUDED or CONTRADICT, or UNKNOWN beside pixels without a source.
    - ``fine`` (n,): where the answering view has a smooth patch, too.
    - ``asked`` and ``answered``: the patches of both views.
    - ``residual`` (n,): how far the centre of the one lies in front of the plane of the other, in
      units of ``footprint`` (n,), which is in metres.
    - ``expected`` (n,): the standard deviation of the residual in the same units. It follows from
      how well the planes fit, and from what the files resolve.
    - ``curved_residual`` (n,): the residual between curved surfaces. It is noisier. But a plane
      through nine pixels lies inside a ball, and deeper where the ball is seen at an angle.
    """

    verdict: NDArray[np.int64]
    fine: NDArray[np.bool_]
    asked: Patches
    answered: Patches
    residual: Array
    footprint: Array
    expected: Array
    curved_residual: Array

    def measuring(self) -> "Comparison | None":
        """Return the part that says how far the surfaces are apart; None if it is too small."""
        used = self.fine & (np.abs(self.residual) < SAME_SURFACE)
        if used.sum() < FEWEST_POINTS:
            return None
        return Comparison(*(getattr(self, each.name)[used] for each in fields(self)))


def _looks_for(asked: Patches, camera: Camera) -> tuple[NDArray[np.bool_], Array]:
    """Return which patches turn towards a view and lie in it, and at which pixels (n, 2)."""
    sight = camera.position - asked.points
    distance = np.linalg.norm(sight, axis=1)
    facing = np.einsum("ij,ij->i", asked.normals, sight) > GRAZING_COSINE * distance
    where = camera.pixels(asked.points)
    last = np.array([camera.lens.width, camera.lens.height]) - 1.0
    with np.errstate(invalid="ignore"):
        inside = ((where >= 1.0) & (where < last)).all(axis=1)
    return facing & inside, where


def compare(asked: Patches, camera: Camera, depth: NDArray[Any]) -> Comparison:
    """Look for the patches of another view in the view that ``camera`` took with ``depth``.

    Patches that the view cannot see, or sees from behind, are not in the answer.
    """
    looked_for, where = _looks_for(asked, camera)
    asked = asked[looked_for]
    where = where[looked_for]
    columns, rows = np.floor(where).astype(np.int64).T
    answered, smooth = _patches(camera, depth, columns, rows)
    residual = np.einsum("ij,ij->i", answered.normals, asked.points - answered.points)
    aside = where - np.floor(where) - 0.5
    curved_residual = residual + asked.height() - answered.height(aside[:, 0], aside[:, 1])
    # The centre of nine jittered points, and the plane of nine a pixel's half diagonal off centre.
    deviation = np.sqrt(asked.spread**2 / 9 + answered.spread**2 * (1 / 9 + 0.5 / 6))
    footprint = np.maximum(asked.footprint, answered.footprint)
    tolerance = (
        TOLERANCE_DEVIATIONS * deviation
        + TOLERANCE_FOOTPRINTS * footprint
        + asked.error
        + answered.error
    )
    verdict = np.full(len(asked), AGREE)
    verdict[residual < -tolerance] = OCCLUDED
    verdict[residual > tolerance] = CONTRADICT
    rough = np.flatnonzero(~smooth)
    nearest, farthest = _recorded_range(camera, depth, columns[rough], rows[rough])
    expected = np.linalg.norm(asked.points[rough] - camera.position, axis=1)
    slack = tolerance[rough] + footprint[rough]
    verdict[rough] = AGREE
    verdict[rough[farthest < expected - slack]] = OCCLUDED
    verdict[rough[nearest > expected + slack]] = CONTRADICT
    verdict[rough[np.isnan(nearest)]] = UNKNOWN
    # Of an error that may be anything up to its bound, as a number's last digit.
    resolved = (asked.error**2 + answered.error**2) / 12
    finest = TOLERANCE_FOOTPRINTS * footprint / TOLERANCE_DEVIATIONS
    expected = np.sqrt(deviation**2 + finest**2 + resolved)
    unit = np.maximum(footprint, np.finfo(np.float64).tiny)
    return Comparison(
        verdict,
        smooth,
        asked,
        answered,
        residual / unit,
        footprint,
        expected / unit,
        curved_residual / unit,
    )


def _recorded_range(
    camera: Camera, depth: NDArray[Any], columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the least and largest distance in 3 × 3 pixels; NaN where one has no source."""
    columns = columns[:, np.newaxis] + _COLUMNS
    rows = rows[:, np.newaxis] + _ROWS
    nine = depth[rows, columns].astype(np.float64)
    points = camera.lift(nine, columns, rows)
    with np.errstate(invalid="ignore"):
        distance = np.linalg.norm(points - camera.position, axis=2)
    # A miss has no point: its coordinates are inf, or NaN where the ray's are 0.
    distance[np.isposinf(nine)] = np.inf
    return distance.min(axis=1), distance.max(axis=1)


def displacement(measured: Comparison, camera: Camera) -> tuple[float, float]:
    """Return by how many pixels the asked patches must move to lie on the answered ones.

    The rigid motion about ``camera``, which answers, that makes the residuals least, in the
    directions that they determine; its root mean square over the points, in pixel footprints. The
    second value is the root mean square that residuals as large as expected lead to.
    """
    residual = measured.residual
    footprint = measured.footprint
    arms = (measured.asked.points - camera.position) / footprint[:, np.newaxis]
    # Unknowns of like size: both in pixels, the rotation as seen at the median distance.
    arms /= np.median(np.linalg.norm(arms, axis=1))
    # How each point moves with the six unknowns: (n, 3, 6).
    across = np.eye(3) * (np.median(footprint) / footprint)[:, np.newaxis, np.newaxis]
    around = np.cross(np.eye(3), arms[:, np.newaxis]).swapaxes(1, 2)
    moves = np.concatenate([across, around], axis=2)
    rows = np.einsum("ni,nij->nj", measured.answered.normals, moves)
    motion = np.zeros(6)
    for _ in range(5):
        root = np.sqrt(_huber(residual + rows @ motion))
        solution = np.linalg.pinv(rows * root[:, np.newaxis], rcond=0.1) * root
        motion = -solution @ residual
    spread = solution * measured.expected
    squares = np.einsum("nij,jk,nik->n", moves, np.outer(motion, motion), moves)
    expected = np.einsum("nij,jk,nik->n", moves, spread @ spread.T, moves)
    return float(np.sqrt(squares.mean())), float(np.sqrt(expected.mean()))


def _huber(residual: Array) -> Array:
    """Return Huber's weights; the scale is 1.5 times the median residual."""
    scale = 1.5 * np.median(np.abs(residual)) + 1e-12
    weights: Array = scale / np.maximum(np.abs(residual), scale)
    return weights


def scale_moments(measured: Comparison, asking: Camera, answering: Camera) -> Array:
    """Return what one comparison adds to the least squares of `scales`: moments (3, 3).

    They are the weighted sums of products of how the residual grows with the scale of all angles,
    how with that of all depths, and minus the residual itself.
    """
    asked = measured.asked
    answered = measured.answered
    # Where the two surfaces go when every angle from the axis, or every depth, grows.
    by_angle = _outwards(asking, asked.points) - _outwards(answering, answered.points)
    by_depth = answering.position - asking.position
    grows = np.stack(
        [np.einsum("ij,ij->i", answered.normals, by_angle), answered.normals @ by_depth], axis=1
    )
    residual = measured.curved_residual
    columns = np.column_stack([grows / measured.footprint[:, np.newaxis], -residual])
    moments: Array = (columns * _huber(residual)[:, np.newaxis]).T @ columns
    return moments


def _outwards(camera: Camera, points: Array) -> Array:
    """Return θ ∂point/∂θ: how points move when their angles θ from the optical axis are scaled."""
    arms = points - camera.position
    distance = np.linalg.norm(arms, axis=1, keepdims=True)
    axis = -camera.world_matrix[:3, 2]
    cosine = arms @ axis[:, np.newaxis] / distance
    sine = np.linalg.norm(np.cross(arms, axis), axis=1, keepdims=True) / distance
    tangent = (arms * cosine - axis * distance) / np.maximum(sine, 1e-12)
    outwards: Array = np.arctan2(sine, cosine) * tangent
    return outwards


def view_pairs(cameras: Sequence[Camera], patches: Sequence[Patches]) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of views to compare, in order.

    To each view the three nearest that can look for enough of its patches, and three farther away,
    whose wider baselines show what the near ones cannot. Views at one place count as neighbours.
    """
    positions = np.array([camera.position for camera in cameras])
    nearest = Cameras(positions)
    pairs = set()
    for view, patches_of_view in enumerate(patches):
        if len(patches_of_view) < FEWEST_POINTS:
            continue
        candidates = nearest.nearest(view, NEIGHBOURHOOD, 10**-DECIMALS)
        away = np.linalg.norm(positions[candidates] - positions[view], axis=1)
        order = np.argsort(np.round(away, DECIMALS), kind="stable")
        near = candidates[order[:NEIGHBOURHOOD]]
        starts = [0] * (NEIGHBOURS // 2)
        starts += [len(near) * step // 4 for step in range(1, NEIGHBOURS - NEIGHBOURS // 2 + 1)]
        chosen: set[int] = set()
        blind: set[int] = set()
        for start in starts:
            for other in near[start:].tolist():
                if other in chosen or other in blind:
                    continue
                if _looks_for(patches_of_view, cameras[other])[0].sum() >= FEWEST_POINTS:
                    chosen.add(other)
                    break
                blind.add(other)
        pairs |= {(min(view, other), max(view, other)) for other in chosen}
    return sorted(pairs)


@dataclass(frozen=True)
class Answer:
    """What one view says of another's patches, or two of each other's, in a few numbers.

    Counts of points by verdict; ``displacement`` and what of it is ``expected`` where nothing is
    wrong, as that function gives them, in pixels, or None; ``moments`` (3, 3) of the ``measured``
    points that `scales` uses.
    """

    agree: int = 0
    occluded: int = 0
    contradict: int = 0
    displacement: float | None = None
    expected: float | None = None
    moments: Array = field(default_factory=lambda: np.zeros((3, 3)))
    measured: int = 0

    @property
    def contradiction(self) -> float | None:
        """The part of the points not occluded that contradict; None where there are too few."""
        decided = self.agree + self.contradict
        return self.contradict / decided if decided >= FEWEST_POINTS else None

    def __add__(self, other: "Answer") -> "Answer":
        return Answer(
            self.agree + other.agree,
            self.occluded + other.occluded,
            self.contradict + other.contradict,
            _mean(self.displacement, other.displacement),
            _mean(self.expected, other.expected),
            self.moments + other.moments,
            self.measured + other.measured,
        )


def _mean(*values: float | None) -> float | None:
    numbers = [value for value in values if value is not None]
    return fmean(numbers) if numbers else None


NOTHING = Answer()
"""The sum of no answers."""


def ask(patches: Patches, asking: Camera, answering: Camera, depth: NDArray[Any]) -> Answer:
    """Look for the ``patches`` of one view in another, whose ``depth`` is (height, width)."""
    comparison = compare(patches, answering, depth)
    counts = np.bincount(comparison.verdict, minlength=4)
    answer = Answer(int(counts[AGREE]), int(counts[OCCLUDED]), int(counts[CONTRADICT]))
    measured = comparison.measuring()
    if measured is None:
        return answer
    moved, expected = displacement(measured, answering)
    return replace(
        answer,
        displacement=moved,
        expected=expected,
        moments=scale_moments(measured, asking, answering),
        measured=len(measured.residual),
    )


def scales(answers: Answer) -> tuple[Array, Array]:
    """Return by which part all angles from the axis and all depths must grow, and their deviation.

    Two arrays (2,): angle and depth. A deviation is inf where the residuals do not determine it.
    """
    squares = answers.moments[:2, :2]
    products = answers.moments[:2, 2]
    if answers.measured < FEWEST_POINTS or np.linalg.cond(squares) > 1e9:
        return np.zeros(2), np.full(2, np.inf)
    inverse = np.linalg.inv(squares)
    errors = inverse @ products
    left = max(float(answers.moments[2, 2] - errors @ products), 0.0)
    return errors, np.sqrt(np.diagonal(inverse) * left / answers.measured)
