"""Compares the depth of two views, to see whether they see the same world.

A view's depth is lifted into the world as small surface patches: 3 × 3 pixels and the plane that
fits them best. Depth may have been sampled anywhere under the pixel filter (SILVR's is). Then one
value is only as exact as the surface's slope times that jitter. The plane averages the jitter, and
`Patches.spread`, the distance of the nine points from the plane, tells how exact it is. No plane
fits edges and thin structures: they are not looked up, and answer with a range of depth.

A patch's centre is then projected into another view. The plane of the 3 × 3 pixels recorded there
is the answer. The distance from centre to plane has a sign. A point behind the recorded surface is
occluded, which is allowed. A point in front of it is a contradiction: that view looked through the
place where the first view saw a surface. Two views are always compared in both directions, so any
error makes contradictions in one of them.

Errors too small for single points (a fraction of a pixel) show in the mean:

- `displacement` finds the rigid motion between two views that explains their residuals best. It
  also gives the size to expect if nothing is wrong.
- `scales` finds the error of the field of view and of depth that explains all pairs best.

Both are first-order least squares on point-to-plane distances (Chen and Medioni 1992).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Lens

Array = NDArray[np.float64]

# The nine pixels of a patch, row by row.
_ROWS, _COLUMNS = (offset.ravel() for offset in np.mgrid[-1:2, -1:2])

# A patch is smooth if the standard deviation of its points from their plane is below this many
# pixel footprints. The jitter of Cycles' default filter gives up to 0.25.
_SMOOTH_SPREAD = 0.35
# A patch is not used if the cosine between its normal and the line of sight is smaller.
_GRAZING_COSINE = 0.2

# A point lies on a recorded surface within this many standard deviations of both planes. This part
# of a footprint is added for curvature that a plane cannot follow.
_TOLERANCE_DEVIATIONS = 4.0
_TOLERANCE_FOOTPRINTS = 0.05

# Fewer points than this say nothing about a pair of views, nor about six unknowns of motion.
_FEWEST_POINTS = 30
# Rounding may move all points alike by this many pixel footprints.
ROUNDING = 1e-4
NEIGHBOURS = 6
# The farther neighbours are chosen from this many of the nearest views.
_NEIGHBOURHOOD = 48
# Distances in metres are equal if they agree to this many decimals.
DECIMALS = 6

# Residuals beyond this many footprints of a pixel belong to another surface, not to a slightly
# wrong view. A view that is wrong by more has contradictions, and needs no measurement.
_SAME_SURFACE_FOOTPRINTS = 1.0

UNKNOWN = 0
AGREE = 1
OCCLUDED = 2
CONTRADICT = 3


@dataclass(frozen=True)
class Camera:
    """A view's camera.

    - ``world_from_camera`` (4, 4): camera to world.
    - ``depth``: ``"z"`` (along the optical axis) or ``"distance"`` (along the ray), in metres.
    - ``grain``: the angle in radians of a source view's pixel, if this view was reprojected. A
      depth may come from that far beside its pixel's centre.
    - ``spacing``: the number of pixels between neighbours in a patch. A magnified view may have one
      depth in all pixels that are nearer to each other.
    """

    lens: Lens
    world_from_camera: Array
    depth: str
    grain: float = 0.0
    spacing: int = 1

    @property
    def position(self) -> Array:
        return self.world_from_camera[:3, 3]

    def lift(self, depth: Array, columns: NDArray[np.int64], rows: NDArray[np.int64]) -> Array:
        """Return the world points (..., 3) at ``depth`` along the rays of the pixel centres."""
        rays = self.lens.rays(columns + 0.5, rows + 0.5)
        distance = converted(depth, rays, self.depth, "distance")
        with np.errstate(invalid="ignore"):
            arms = rays * distance[..., np.newaxis]
            points: Array = arms @ self.world_from_camera[:3, :3].T + self.position
        return points

    def pixels(self, points: Array) -> Array:
        """Return the pixel coordinates (..., 2) of world points. NaN where they are not seen."""
        return self.lens.pixels((points - self.position) @ self.world_from_camera[:3, :3])


@dataclass(frozen=True)
class Patches:
    """The n surface patches of one view, in world coordinates and metres.

    - ``points`` (n, 3): the centres.
    - ``normals`` (n, 3): unit vectors towards the camera.
    - ``spread`` (n,): the standard deviation of the nine points from their plane.
    - ``footprint`` (n,): the width of a pixel at that distance, across the ray. The width of the
      grain, if that is larger.
    - ``error`` (n,): how far the plane may lie off the surface. The causes are the grain and the
      file's number format.
    - ``curvature`` (n, 3): the second derivatives of the surface's height above the plane, per
      squared step of the patch: along columns, along rows, and mixed.
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

        ``columns`` and ``rows`` (n,) say where, in steps of the patch from the middle pixel's
        centre. The plane goes through the mean of the nine points, so a bulging surface lies in
        front of it.
        """
        along_columns, along_rows, mixed = self.curvature.T
        bend = along_columns * (columns**2 / 2 - 1 / 3) + along_rows * (rows**2 / 2 - 1 / 3)
        height: Array = bend + mixed * columns * rows
        return height


def _patches(
    camera: Camera, depth: NDArray[Any], columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[Patches, NDArray[np.bool_]]:
    """Fit planes to 3 × 3 pixels about inner pixels. Also return which are smooth surfaces (n,)."""
    columns, rows = _nine(camera, columns, rows)
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
            & (spread < _SMOOTH_SPREAD * footprint + precision)
            & (np.abs(cosine) > _GRAZING_COSINE)
        )
        curvature = _curvature(np.einsum("nij,nj->ni", around, normals))
    # Pixels without points have no plane, and so neither a footprint nor an error.
    footprint[~finite] = 0.0
    error[~finite] = 0.0
    return Patches(centres, normals, spread, footprint, error, curvature), smooth


def _nine(
    camera: Camera, columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and the rows (n, 9) of the patches about inner pixels (n,)."""
    return (
        columns[:, np.newaxis] + camera.spacing * _COLUMNS,
        rows[:, np.newaxis] + camera.spacing * _ROWS,
    )


def _curvature(heights: Array) -> Array:
    """Return `Patches.curvature` (n, 3) of nine points' heights (n, 9) above their plane.

    They are the least squares fit of a quadratic surface. Its second derivatives do not depend on
    the plane.
    """
    square = heights.reshape(-1, 3, 3)
    along_columns = (square[:, :, 0] - 2 * square[:, :, 1] + square[:, :, 2]).mean(axis=1)
    along_rows = (square[:, 0] - 2 * square[:, 1] + square[:, 2]).mean(axis=1)
    mixed = (square[:, 0, 0] - square[:, 0, 2] - square[:, 2, 0] + square[:, 2, 2]) / 4
    return np.stack([along_columns, along_rows, mixed], axis=1)


def sample(camera: Camera, depth: NDArray[Any], rays: int) -> Patches:
    """Return up to ``rays`` smooth patches of a view, spread evenly over it.

    The image is divided into square cells. Each cell gives the smoothest of four fixed places.
    ``depth`` is (height, width) of a float type, with misses +inf. An image that is smaller than a
    patch has none.
    """
    height, width = depth.shape
    rim = camera.spacing
    if min(height, width) < 1 + 2 * rim:
        none = np.zeros(0, np.int64)
        return _patches(camera, depth, none, none)[0]
    cell = max((height * width / rays) ** 0.5, 2.0)
    down, across = int(height / cell), int(width / cell)
    # The four places in a cell are the corners of a turned square: none share a row or column.
    places = np.array([(0.3, 0.1), (0.9, 0.3), (0.1, 0.7), (0.7, 0.9)])
    y, x = np.mgrid[0:down, 0:across].reshape(2, -1, 1) + places.T[:, np.newaxis]
    rows = np.clip(y * (height / down), rim, height - 1 - rim).astype(np.int64)
    columns = np.clip(x * (width / across), rim, width - 1 - rim).astype(np.int64)
    patches, smooth = _patches(camera, depth, columns.ravel(), rows.ravel())
    roughness = np.full(len(smooth), np.inf)
    roughness[smooth] = patches.spread[smooth] / patches.footprint[smooth]
    cells = roughness.reshape(-1, 4)
    best = cells.argmin(axis=1) + 4 * np.arange(len(cells))
    return patches[best[smooth[best]]]


@dataclass(frozen=True)
class Comparison:
    """How n patches of one view compare with what another view recorded.

    - ``verdict`` (n,): AGREE, OCCLUDED or CONTRADICT, or UNKNOWN beside pixels without a source.
    - ``smooth`` (n,): where the other view has a smooth patch, too.
    - ``queried``: the patches of the first view.
    - ``recorded``: the patches of the other view at the same pixels.
    - ``residual`` (n,): how far a queried centre lies in front of the recorded plane, in units of
      ``footprint``.
    - ``footprint`` (n,): in metres.
    - ``expected`` (n,): the standard deviation of the residual in the same units. It follows from
      the fit of the planes, and from what the files resolve.
    - ``curved_residual`` (n,): the residual between curved surfaces. It is noisier. But a plane
      through nine pixels lies inside a ball, and deeper where the ball is seen at an angle.
    """

    verdict: NDArray[np.int64]
    smooth: NDArray[np.bool_]
    queried: Patches
    recorded: Patches
    residual: Array
    footprint: Array
    expected: Array
    curved_residual: Array

    def measuring(self) -> "Comparison | None":
        """Return the patches that measure the surfaces' distance. None if they are too few."""
        used = self.smooth & (np.abs(self.residual) < _SAME_SURFACE_FOOTPRINTS)
        if used.sum() < _FEWEST_POINTS:
            return None
        return Comparison(*(getattr(self, each.name)[used] for each in fields(self)))


def _visible_patches(patches: Patches, camera: Camera) -> tuple[NDArray[np.bool_], Array]:
    """Return which patches turn towards a view and lie in it, and at which pixels (n, 2)."""
    sight = camera.position - patches.points
    distance = np.linalg.norm(sight, axis=1)
    facing = np.einsum("ij,ij->i", patches.normals, sight) > _GRAZING_COSINE * distance
    pixels = camera.pixels(patches.points)
    rim = float(camera.spacing)
    last = np.array([camera.lens.width, camera.lens.height]) - rim
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= rim) & (pixels < last)).all(axis=1)
    return facing & inside, pixels


def compare(queried: Patches, camera: Camera, depth: NDArray[Any]) -> Comparison:
    """Look up the patches of another view in the view of ``camera``, which recorded ``depth``.

    Leaves out the patches that this view cannot see, or sees from behind.
    """
    visible, pixels = _visible_patches(queried, camera)
    queried = queried[visible]
    pixels = pixels[visible]
    columns, rows = np.floor(pixels).astype(np.int64).T
    recorded, smooth = _patches(camera, depth, columns, rows)
    residual = np.einsum("ij,ij->i", recorded.normals, queried.points - recorded.points)
    off_centre = (pixels - np.floor(pixels) - 0.5) / camera.spacing
    recorded_height = recorded.height(off_centre[:, 0], off_centre[:, 1])
    curved_residual = residual + queried.height() - recorded_height
    # The queried centre is a mean of nine jittered points. The recorded plane is evaluated up to
    # half a pixel's diagonal off its centre.
    deviation = np.sqrt(queried.spread**2 / 9 + recorded.spread**2 * (1 / 9 + 0.5 / 6))
    footprint = np.maximum(queried.footprint, recorded.footprint)
    tolerance = (
        _TOLERANCE_DEVIATIONS * deviation
        + _TOLERANCE_FOOTPRINTS * footprint
        + queried.error
        + recorded.error
    )
    verdict = np.full(len(queried), AGREE)
    verdict[residual < -tolerance] = OCCLUDED
    verdict[residual > tolerance] = CONTRADICT
    rough = np.flatnonzero(~smooth)
    nearest, farthest = recorded_range(camera, depth, columns[rough], rows[rough])
    distance = np.linalg.norm(queried.points[rough] - camera.position, axis=1)
    slack = tolerance[rough] + footprint[rough]
    verdict[rough] = AGREE
    verdict[rough[farthest < distance - slack]] = OCCLUDED
    verdict[rough[nearest > distance + slack]] = CONTRADICT
    verdict[rough[np.isnan(nearest)]] = UNKNOWN
    # The variance of a rounding error is a twelfth of its squared bound.
    rounding = (queried.error**2 + recorded.error**2) / 12
    finest = _TOLERANCE_FOOTPRINTS * footprint / _TOLERANCE_DEVIATIONS
    expected = np.sqrt(deviation**2 + finest**2 + rounding)
    unit = np.maximum(footprint, np.finfo(np.float64).tiny)
    return Comparison(
        verdict,
        smooth,
        queried,
        recorded,
        residual / unit,
        footprint,
        expected / unit,
        curved_residual / unit,
    )


def recorded_range(
    camera: Camera, depth: NDArray[Any], columns: NDArray[np.int64], rows: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the least and largest distance in 3 × 3 pixels. NaN where a pixel has no source."""
    columns, rows = _nine(camera, columns, rows)
    nine = depth[rows, columns].astype(np.float64)
    points = camera.lift(nine, columns, rows)
    with np.errstate(invalid="ignore"):
        distance = np.linalg.norm(points - camera.position, axis=2)
    # A miss has no point: its coordinates are inf, or NaN where the ray's are 0.
    distance[np.isposinf(nine)] = np.inf
    return distance.min(axis=1), distance.max(axis=1)


def displacement(measured: Comparison, camera: Camera) -> tuple[float, float]:
    """Return how many pixels the queried patches must move to lie on the recorded ones.

    The motion is a rigid motion about ``camera``, the recording view. It minimises the residuals in
    the directions that they determine. The result is its root mean square over the points, in pixel
    footprints. The second value is the root mean square to expect if nothing is wrong: the noise of
    the residuals, as expected or as the motion leaves it, propagated to the motion. Both grow as
    the points become fewer.

    Planes and curved surfaces both measure the motion, and the smaller one counts. A plane lies
    inside a bulging surface, and deeper where it is seen at an angle. So the planes of a curved
    model seem displaced, however many points it has. Curved surfaces are noisier.
    """
    residuals = (measured.residual, measured.curved_residual)
    return min(_displacement(measured, residual, camera) for residual in residuals)


def _displacement(measured: Comparison, residual: Array, camera: Camera) -> tuple[float, float]:
    """Return the displacement that explains residuals, and the one to expect."""
    footprint = measured.footprint
    arms = (measured.queried.points - camera.position) / footprint[:, np.newaxis]
    # Give the unknowns a similar size: both are in pixels, the rotation at the median distance.
    arms /= np.median(np.linalg.norm(arms, axis=1))
    # How each point moves with the six unknowns: (n, 3, 6).
    across = np.eye(3) * (np.median(footprint) / footprint)[:, np.newaxis, np.newaxis]
    around = np.cross(np.eye(3), arms[:, np.newaxis]).swapaxes(1, 2)
    moves = np.concatenate([across, around], axis=2)
    rows = np.einsum("ni,nij->nj", measured.recorded.normals, moves)
    motion = np.zeros(6)
    for _ in range(5):
        root = np.sqrt(_huber(residual + rows @ motion))
        solution = np.linalg.pinv(rows * root[:, np.newaxis], rcond=0.1) * root
        motion = -solution @ residual
    squares = np.einsum("nij,jk,nik->n", moves, np.outer(motion, motion), moves)
    # Six of the residuals' degrees of freedom are in the motion.
    remaining = (residual + rows @ motion) * np.sqrt(len(rows) / (len(rows) - 6))
    expected = []
    for deviations in (measured.expected, remaining):
        spread = solution * deviations
        variances = np.einsum("nij,jk,nik->n", moves, spread @ spread.T, moves)
        expected.append(float(np.sqrt(variances.mean())))
    return float(np.sqrt(squares.mean())), max(expected)


def _huber(residual: Array) -> Array:
    """Return Huber's weights. The scale is 1.5 times the median residual."""
    scale = 1.5 * np.median(np.abs(residual)) + 1e-12
    weights: Array = scale / np.maximum(np.abs(residual), scale)
    return weights


def scale_moments(measured: Comparison, asking: Camera, answering: Camera) -> Array:
    """Return what one comparison adds to the least squares of `scales`: moments (3, 3).

    They are the weighted sums of products of three columns. The first two are the residual's
    derivatives by the scale of all angles and of all depths. The third is the negated residual.
    """
    queried = measured.queried
    recorded = measured.recorded
    # How the two surfaces move apart when every angle from the axis, or every depth, grows.
    by_angle = _outwards(asking, queried.points) - _outwards(answering, recorded.points)
    by_depth = answering.position - asking.position
    derivatives = np.stack(
        [np.einsum("ij,ij->i", recorded.normals, by_angle), recorded.normals @ by_depth], axis=1
    )
    residual = measured.curved_residual
    columns = np.column_stack([derivatives / measured.footprint[:, np.newaxis], -residual])
    moments: Array = (columns * _huber(residual)[:, np.newaxis]).T @ columns
    return moments


def _outwards(camera: Camera, points: Array) -> Array:
    """Return θ ∂point/∂θ: how points move when their angles θ from the optical axis are scaled."""
    arms = points - camera.position
    distance = np.linalg.norm(arms, axis=1, keepdims=True)
    axis = -camera.world_from_camera[:3, 2]
    cosine = arms @ axis[:, np.newaxis] / distance
    sine = np.linalg.norm(np.cross(arms, axis), axis=1, keepdims=True) / distance
    tangent = (arms * cosine - axis * distance) / np.maximum(sine, 1e-12)
    outwards: Array = np.arctan2(sine, cosine) * tangent
    return outwards


def view_pairs(cameras: Sequence[Camera], patches: Sequence[Patches]) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of views to compare, in order.

    Each view gets the three nearest views that see enough of its patches, and three farther away.
    The farther views' wider baselines show errors that near views cannot. Views at the same place
    count as neighbours.
    """
    positions = np.array([camera.position for camera in cameras])
    # Import it only here, because it imports scipy's trees, which most programs do not need.
    from lightfield.geometry.nearest import Cameras

    nearest = Cameras(positions)
    pairs = set()
    for view, patches_of_view in enumerate(patches):
        if len(patches_of_view) < _FEWEST_POINTS:
            continue
        candidates = nearest.nearest(view, _NEIGHBOURHOOD, 10**-DECIMALS)
        away = np.linalg.norm(positions[candidates] - positions[view], axis=1)
        order = np.argsort(np.round(away, DECIMALS), kind="stable")
        near = candidates[order[:_NEIGHBOURHOOD]]
        starts = [0] * (NEIGHBOURS // 2)
        starts += [len(near) * step // 4 for step in range(1, NEIGHBOURS - NEIGHBOURS // 2 + 1)]
        chosen: set[int] = set()
        blind: set[int] = set()
        for start in starts:
            for other in near[start:].tolist():
                if other in chosen or other in blind:
                    continue
                visible, _ = _visible_patches(patches_of_view, cameras[other])
                if visible.sum() >= _FEWEST_POINTS:
                    chosen.add(other)
                    break
                blind.add(other)
        pairs |= {(min(view, other), max(view, other)) for other in chosen}
    return sorted(pairs)


@dataclass(frozen=True)
class Answer:
    """A comparison of one view with another's patches, or of two with each other's, in few numbers.

    - ``agree``, ``occluded``, ``contradict``: numbers of points by verdict.
    - ``displacement``, ``expected``: the two values in pixels of `displacement`, or None.
    - ``moments`` (3, 3): the sums that `scales` uses.
    - ``measured``: the number of points in those sums.
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
        """The part of the points not occluded that contradict. None if there are too few points."""
        decided = self.agree + self.contradict
        return self.contradict / decided if decided >= _FEWEST_POINTS else None

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
    """Look up the ``patches`` of one view in another, whose ``depth`` is (height, width)."""
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
    """Return the relative errors of all angles from the axis and of all depths.

    Returns two arrays (2,) of angle and depth: by which part they must grow, and its standard
    deviation. A deviation is inf if the residuals do not determine it.
    """
    squares = answers.moments[:2, :2]
    products = answers.moments[:2, 2]
    if answers.measured < _FEWEST_POINTS or np.linalg.cond(squares) > 1e9:
        return np.zeros(2), np.full(2, np.inf)
    inverse = np.linalg.inv(squares)
    errors = inverse @ products
    unexplained = max(float(answers.moments[2, 2] - errors @ products), 0.0)
    # The residuals of rounding depend on each other. So many of them say no more than one.
    variance = max(unexplained / answers.measured, ROUNDING**2 * answers.measured)
    return errors, np.sqrt(np.diagonal(inverse) * variance)
