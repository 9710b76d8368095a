"""Compares reconstructed surfaces with true ones, as three benchmarks define it.

Surfaces are meshes or point clouds in metres. A mesh is replaced by points on it. Sources:

- DTU: Jensen et al. 2014, with the sampling of github.com/jzhangbs/DTUeval-python;
- NeRF-synthetic: Tang et al. 2023 (NeRF2Mesh), 2.5 million points on each surface;
- Tanks and Temples: Knapitsch et al. 2017, python_toolbox/evaluation of its authors.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable, keep_apart, reading, write_json
from lightfield.stages.measurement import EvaluateSurface, SurfaceSettings

Points = NDArray[np.float64]

# DTU's values, in metres: points this far apart, and distances from which on points do not count.
_DTU_SPACING = 0.2e-3
_DTU_MOST_DISTANCE = 20e-3
NERF_SYNTHETIC_POINTS = 2_500_000
# More points would take hours.
_MOST_POINTS = 20_000_000
# How many random points a surface gets for each square of the spacing or voxel, before they are
# thinned. With 8 about one square in three thousand stays empty.
_OVERSAMPLING = 8
# Seeds of the random points. With the same points on both surfaces, equal meshes would have no
# error, and similar ones too little.
_SHOWN = 1
TRUE = 2
SUFFIXES = (".ply", ".obj", ".glb", ".gltf", ".stl")
# glTF has Y up. All other files have Z up, as the dataset has.
_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class MeasuredSurface:
    """A surface read from ``path``: corners (n, 3, 3) of its triangles, or its points (n, 3)."""

    path: Path
    triangles: Points | None
    points: Points

    @property
    def area(self) -> float:
        """The area of a mesh in square metres."""
        assert self.triangles is not None
        return float(_areas(self.triangles).sum())


def read_surface(path: Path) -> MeasuredSurface:
    """Read a mesh or a point cloud. Raises `UserError` if it is neither, or not finite."""
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(
            f"{path}: is not a surface file; its name must end in {', '.join(SUFFIXES)}"
        )
    with reading(path, "surface"):
        check_readable(path)
        content = trimesh.load_scene(path, process=False)
        geometries = content.dump()
    triangles = [np.asarray(g.triangles) for g in geometries if isinstance(g, trimesh.Trimesh)]
    points = [np.asarray(g.vertices) for g in geometries if hasattr(g, "vertices")]
    if not points or not sum(map(len, points)):
        raise UserError(f"{path}: has no points")
    vertices = np.concatenate(points).astype(np.float64)
    corners = np.concatenate(triangles).astype(np.float64) if triangles else np.zeros((0, 3, 3))
    if path.suffix.lower() in (".glb", ".gltf"):
        vertices = vertices @ _Z_UP.T
        corners = corners @ _Z_UP.T
    if not np.isfinite(vertices).all():
        raise UserError(f"{path}: has points that are not finite")
    return MeasuredSurface(path, corners if len(corners) else None, vertices)


def evaluate(job: EvaluateSurface) -> None:
    """Print the figures of a surface by its protocol, and write them."""
    if job.output:
        keep_apart("--output", job.output, job.candidate, job.reference)
    candidate = read_surface(job.candidate)
    reference = read_surface(job.reference)
    figures = _figures(candidate, reference, job.settings)
    if job.output:
        write_json(job.output, {**job.settings.as_json(), **figures})
    print(", ".join(f"{name} {value:.6g}" for name, value in figures.items()))


def _figures(
    candidate: MeasuredSurface, reference: MeasuredSurface, settings: SurfaceSettings
) -> dict[str, float]:
    """Return the figures of a surface by a protocol."""
    if settings.protocol == "dtu":
        spacing = settings.spacing or _DTU_SPACING
        return dtu(candidate, reference, spacing, settings.most_distance or _DTU_MOST_DISTANCE)
    if settings.protocol == "nerf_synthetic":
        return nerf_synthetic(candidate, reference, settings.points or NERF_SYNTHETIC_POINTS)
    assert settings.tau is not None
    return tanks_and_temples(candidate, reference, settings.tau)


def dtu(
    candidate: MeasuredSurface,
    reference: MeasuredSurface,
    spacing: float = _DTU_SPACING,
    most_distance: float = _DTU_MOST_DISTANCE,
) -> dict[str, float]:
    """Return DTU's figures in metres: accuracy, completeness, and their mean, the Chamfer distance.

    Both are mean distances, not squared: from the candidate to the reference, and back. Points are
    ``spacing`` apart. Distances of ``most_distance`` or more do not count. DTU leaves out what its
    scanner did not observe. Here the reference is complete.
    """
    shown = thinned(_dense(candidate, spacing, _SHOWN), spacing)
    # DTU takes its scanned points as they are.
    true = reference.points
    if reference.triangles is not None:
        true = thinned(_dense(reference, spacing, TRUE), spacing)
    accuracy, completeness = (
        distances[distances < most_distance] for distances in _both_distances(shown, true)
    )
    if not (accuracy.size and completeness.size):
        raise UserError(
            f"{candidate.path}: is {most_distance:g} m or more from the reference everywhere; "
            "bring it to the dataset's coordinates, or give a larger --most-distance"
        )
    figures = {"accuracy": float(accuracy.mean()), "completeness": float(completeness.mean())}
    return {**figures, "chamfer": sum(figures.values()) / 2}


def nerf_synthetic(
    candidate: MeasuredSurface, reference: MeasuredSurface, count: int = NERF_SYNTHETIC_POINTS
) -> dict[str, float]:
    """Return the figures of NeRF-synthetic in metres, from ``count`` points on each surface.

    The Chamfer distance is the sum of both mean distances, not squared.
    """
    shown = _sampled(candidate, count, _SHOWN)
    true = _sampled(reference, count, TRUE)
    accuracy, completeness = (float(distances.mean()) for distances in _both_distances(shown, true))
    return {
        "accuracy": accuracy,
        "completeness": completeness,
        "chamfer": accuracy + completeness,
    }


def tanks_and_temples(
    candidate: MeasuredSurface, reference: MeasuredSurface, tau: float
) -> dict[str, float]:
    """Return precision, recall, and their harmonic mean, the F-score.

    Precision is the part of the candidate's points that are nearer than ``tau`` metres to the
    reference, recall the part of the reference's. Both have one point in each voxel of tau / 2.
    """
    shown = _voxel_means(_dense(candidate, tau / 2, _SHOWN), tau / 2)
    true = _voxel_means(_dense(reference, tau / 2, TRUE), tau / 2)
    precision, recall = (
        float((distances < tau).mean()) for distances in _both_distances(shown, true)
    )
    total = precision + recall
    f_score = 2 * precision * recall / total if total else 0.0
    return {"precision": precision, "recall": recall, "f_score": f_score}


def thinned(points: Points, spacing: float) -> Points:
    """Return those points (n, 3) that are at least ``spacing`` from all others that stay.

    Points are taken in random order, always in the same one.
    """
    shuffled = np.random.default_rng(0).permutation(points)
    tree = cKDTree(shuffled)
    stays = np.ones(len(shuffled), bool)
    # Search in parts, because the neighbours of all points at once need much memory.
    for first in range(0, len(shuffled), 100_000):
        part = np.arange(first, min(first + 100_000, len(shuffled)))
        part = part[stays[part]]
        near = tree.query_ball_point(shuffled[part], spacing, workers=-1)
        for index, neighbours in zip(part, near, strict=True):
            if stays[index]:
                stays[neighbours] = False
                stays[index] = True
    kept: Points = shuffled[stays]
    return kept


def _voxel_means(points: Points, size: float) -> Points:
    """Return the mean of the points (n, 3) in each voxel of a grid, as Open3D does."""
    lowest = points.min(axis=0) - size / 2
    voxels = np.floor((points - lowest) / size).astype(np.int64)
    _, voxel, counts = np.unique(voxels, axis=0, return_inverse=True, return_counts=True)
    means = np.zeros((len(counts), 3))
    for axis in range(3):
        means[:, axis] = np.bincount(voxel.ravel(), points[:, axis]) / counts
    return means


def _dense(surface: MeasuredSurface, spacing: float, seed: int) -> Points:
    """Return points much denser than one in a square of ``spacing``. A cloud is returned as is."""
    if surface.triangles is None:
        return surface.points
    count = int(np.ceil(_OVERSAMPLING * surface.area / spacing**2))
    if count > _MOST_POINTS:
        least = float(np.sqrt(_OVERSAMPLING * surface.area / _MOST_POINTS))
        raise UserError(
            f"{surface.path}: has {surface.area:.4g} square metres, too many for a spacing of "
            f"{spacing:g} m; give one of {least:.2g} m or more"
        )
    return np.concatenate([surface.points, _sampled(surface, count, seed)])


def _sampled(surface: MeasuredSurface, count: int, seed: int) -> Points:
    """Return ``count`` random points (count, 3) on a mesh, uniform by area.

    A cloud with more points is thinned at random. One with fewer is returned as is.
    """
    random = np.random.default_rng(seed)
    if surface.triangles is None:
        return random.permutation(surface.points)[:count]
    areas = np.cumsum(_areas(surface.triangles))
    if not areas[-1] > 0:
        raise UserError(f"{surface.path}: its triangles have no area")
    # One random place in each of equal steps of the area spreads points better than any places.
    places = (np.arange(count) + random.random(count)) / count * areas[-1]
    chosen = np.minimum(np.searchsorted(areas, places, side="right"), len(areas) - 1)
    corners = surface.triangles[chosen]
    # Uniform on a triangle: Osada et al. 2002, section 4.2.
    root = np.sqrt(random.random((count, 1)))
    along = random.random((count, 1))
    points: Points = (1 - root) * corners[:, 0]
    points += root * (1 - along) * corners[:, 1]
    points += root * along * corners[:, 2]
    return points


def _areas(triangles: Points) -> Points:
    sides = triangles[:, 1:] - triangles[:, :1]
    areas: Points = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1) / 2
    return areas


def _both_distances(shown: Points, true: Points) -> tuple[Points, Points]:
    """Return the distance from each point to the nearest of the others: to the truth, and back."""
    to_truth = cKDTree(true).query(shown, workers=-1)[0]
    from_truth = cKDTree(shown).query(true, workers=-1)[0]
    return to_truth, from_truth
