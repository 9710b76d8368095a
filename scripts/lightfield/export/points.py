"""Lifts evenly spread world points from the views' depth, and finds the views that see them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import write_bytes
from lightfield.core.progress import Progress
from lightfield.export.source import Floats, SourceDataset
from lightfield.formats.lightfield import View
from lightfield.geometry.visibility import pixel_indices
from lightfield.reading.surface import SeenSurface

# Lift this many candidates for each point, and keep an even selection of them.
_CANDIDATES = 8
# Lift more of them if fewer than this part of them were found.
_ENOUGH = 0.5
# The sides of cells grow by this factor from one distance to the next, so the density of points, as
# cameras see them, varies by its square.
_GROWTH = 2**0.5
# Distances from cameras are at least this long, in metres.
_LEAST_DISTANCE = 1e-6
# The largest side of a cell, in distances from the nearest camera. A few of them hold all points.
_LARGEST_CELL = 4.0
# Integers up to this size are exact as floats.
_LARGEST_INTEGER = 2**53


@dataclass(frozen=True)
class Points:
    """Points (n, 3) in metres, sRGB colours (n, 3) uint8, and normals (n, 3), NaN if unknown."""

    positions: Floats
    colours: NDArray[np.uint8]
    normals: Floats

    def chosen(self, which: NDArray[np.generic] | slice) -> "Points":
        return Points(self.positions[which], self.colours[which], self.normals[which])


_NO_POINTS = Points(np.empty((0, 3)), np.empty((0, 3), np.uint8), np.empty((0, 3)))


@dataclass(frozen=True)
class Observations:
    """Where one view sees points: their indices (m,) and their pixel coordinates (m, 2)."""

    indices: NDArray[np.intp]
    pixels: Floats


def lift(source: SourceDataset, count: int | None = None, voxel: float | None = None) -> Points:
    """Lift points from depth: ``count`` by `evenly_seen`, one in each ``voxel`` metres, or all.

    Points come from all views, or from the training views if the rig has a split. Each point has
    the colour that its view shows there. If the views hold fewer different points than ``count``,
    returns them all.
    """
    all_views = source.lightfield.views
    views = [view for view in all_views if view.split in (None, "train")] or all_views
    if count:
        points = _candidates(source, views, count)
        cameras = np.array([view.position for view in views])
        return points.chosen(evenly_seen(points.positions, cameras, count))
    kept = _NO_POINTS
    for points in _lifted(source, views, step=1):
        kept = joined([kept, points])
        # With a voxel, memory does not grow with the number of views.
        if voxel:
            kept = kept.chosen(one_a_voxel(kept.positions, voxel))
    return kept


def _candidates(source: SourceDataset, views: Sequence[View], count: int) -> Points:
    """Lift several points for each of ``count``, evenly over the pixels of the ``views``."""
    wanted = _CANDIDATES * count
    pixels = len(views) * source.rendered.lens.width * source.rendered.lens.height
    step = max(1, int((pixels / wanted) ** 0.5))
    while True:
        points = joined([_NO_POINTS, *_lifted(source, views, step)])
        share = len(points.positions) / wanted
        # Pixels of the sky, and pixels outside the views' frame, give no point.
        if step == 1 or share > _ENOUGH:
            return points
        step = max(1, min(step - 1, round(step * share**0.5)))


def _lifted(source: SourceDataset, views: Sequence[View], step: int) -> Iterator[Points]:
    """Yield the points of each view at every ``step``-th pixel."""
    progress = Progress(len(views), "points", "views")
    for view, surface in source.surfaces(views):
        yield _points_of(source, view, surface, step)
        progress.done()


def lift_one_each(source: SourceDataset, views: Sequence[View]) -> Points:
    """Lift one point from each of the ``views`` that has any finite depth."""
    parts = [_NO_POINTS]
    for view, surface in source.surfaces(views):
        points = _points_of(source, view, surface, step=1)
        middle = len(points.positions) // 2
        parts.append(points.chosen(np.s_[middle : middle + 1]))
    return joined(parts)


def _points_of(source: SourceDataset, view: View, surface: SeenSurface, step: int) -> Points:
    """Return the points of a surface at every ``step``-th pixel that the ``view`` shows."""
    positions, normals = surface.points(step)
    local = view.to_camera(positions)
    column, row, inside = pixel_indices(source.view(view).lens, local)
    inside &= source.valid(view)[row, column]
    return Points(positions, source.colour(view)[row, column], normals).chosen(inside)


def observations(source: SourceDataset, points: Points) -> list[Observations]:
    """Return the points that each view sees: points in its frame that no surface hides."""
    seen_points = []
    progress = Progress(len(source.lightfield.views), "tracks", "views")
    for view, surface in source.surfaces(source.lightfield.views):
        local = view.to_camera(points.positions)
        lens = source.view(view).lens
        column, row, inside = pixel_indices(lens, local)
        inside &= source.valid(view)[row, column] & surface.sees(points.positions)
        indices = np.flatnonzero(inside)
        seen_points.append(Observations(indices, lens.pixels(local[indices])))
        progress.done()
    return seen_points


def write_ply(path: Path, points: Points) -> None:
    """Write a binary PLY with positions, normals (0 if unknown) and colours.

    Consumers expect these properties. trimesh writes a point cloud without its normals, and with
    alpha.
    """
    kinds = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
    kinds += [(name, "u1") for name in ("red", "green", "blue")]
    vertices = np.empty(len(points.positions), kinds)
    columns = np.hstack([points.positions, np.nan_to_num(points.normals), points.colours])
    for name, values in zip(vertices.dtype.names or (), columns.T, strict=True):
        vertices[name] = values
    types = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {types[kind]} {name}\n" for name, kind in kinds)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        f"{properties}end_header\n"
    )
    write_bytes(path, header.encode() + vertices.tobytes())


def joined(parts: Sequence[Points]) -> Points:
    """Return the points of all ``parts``, in order."""
    return Points(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.colours for part in parts]),
        np.concatenate([part.normals for part in parts]),
    )


def evenly(positions: Floats, count: int) -> NDArray[np.intp]:
    """Return the indices of at most ``count`` of the ``positions`` (n, 3), evenly spread."""
    if len(positions) <= count:
        return np.arange(len(positions))
    # Views at one place see the same points, so there may be fewer than ``count``.
    different = np.sort(np.unique(positions, axis=0, return_index=True)[1])
    if len(different) <= count:
        return different
    extent = float(np.max(positions.max(axis=0) - positions.min(axis=0)))
    _, side = _sides_around(
        count, extent, 0.01, lambda side: len(np.unique(_cells(positions, side), axis=0))
    )
    return one_a_voxel(positions, side)


def evenly_seen(positions: Floats, cameras: Floats, count: int) -> NDArray[np.intp]:
    """Return the indices of ``count`` different ``positions`` (n, 3), evenly spread for cameras.

    Cells that hold one position each are the larger, the farther they are from the nearest of the
    ``cameras`` (m, 3). So positions are evenly spread over the angles that the cameras see. If
    fewer than ``count`` are different, returns all of these.
    """
    different = np.sort(np.unique(positions, axis=0, return_index=True)[1])
    if len(different) <= count:
        return different
    shells = _shells(positions, cameras)
    side, _ = _sides_around(
        count, _LARGEST_CELL, 0.001, lambda side: len(_one_a_cell(positions, shells, side))
    )
    kept = _one_a_cell(positions, shells, side)
    picked = np.linspace(0, len(kept) - 1, count).round().astype(int)
    return np.asarray(kept[picked], np.intp)


def _shells(positions: Floats, cameras: Floats) -> list[tuple[float, NDArray[np.intp]]]:
    """Return the indices of the ``positions`` at about each distance from the nearest camera."""
    # Only here, because it loads slowly, and exporters are imported whenever a YAML is read.
    from scipy.spatial import cKDTree

    distance = np.maximum(cKDTree(cameras).query(positions)[0], _LEAST_DISTANCE)
    steps = np.floor(np.log(distance) / np.log(_GROWTH))
    return [(float(_GROWTH**step), np.flatnonzero(steps == step)) for step in np.unique(steps)]


def _one_a_cell(
    positions: Floats, shells: Sequence[tuple[float, NDArray[np.intp]]], side: float
) -> NDArray[np.intp]:
    """Return the index of the first position in each cell, of ``side`` times its distance."""
    kept = [among[one_a_voxel(positions[among], side * away)] for away, among in shells]
    return np.sort(np.concatenate(kept))


def one_a_voxel(positions: Floats, voxel: float) -> NDArray[np.intp]:
    """Return the index of the first point in each cube of side ``voxel``."""
    if not len(positions):
        return np.arange(0)
    cells = _cells(positions, voxel)
    return np.sort(np.unique(cells, axis=0, return_index=True)[1])


def _cells(positions: Floats, voxel: float) -> Floats:
    """Return the cube of side ``voxel`` that each position is in, as one number (n,).

    Single numbers are sorted several times faster than triples. If there are too many cubes to
    number them exactly, returns triples (n, 3).
    """
    cells: Floats = np.floor(positions / voxel).astype(np.float64)
    cells -= cells.min(axis=0)
    rows, columns, layers = cells.max(axis=0) + 1
    if rows * columns * layers > _LARGEST_INTEGER:
        return cells
    row, column, layer = cells.T
    return np.asarray((row * columns + column) * layers + layer)


def _sides_around(
    count: int, largest: float, part: float, cells: Callable[[float], int]
) -> tuple[float, float]:
    """Return two sides of cells, close to one another: more than ``count`` hold points, or not.

    ``cells`` returns how many of a side hold points. ``part`` says how close, of the larger side.
    """
    low, high = 0.0, largest
    while high - low > part * high:
        middle = (low + high) / 2
        if cells(middle) > count:
            low = middle
        else:
            high = middle
    return low, high
