"""Compares points and depth in exports with the depth of the views.

A point was lifted from the centre of a pixel of a rendered view. So it must lie where that pixel's
depth puts it, as exactly as float32 resolves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.exporters.instant_ngp import BOUNDS_PIXELS, BOUNDS_VIEWS
from lightfield.formats.layout import ImageSet, rendered
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.validation.cameras import camera_of
from lightfield.validation.consistency import Camera
from oracles import unit_cube
from oracles.exported_cameras import SetExport
from oracles.readers.contents import FLOAT32, Cloud, DepthMap, DepthRange, same

Floats = NDArray[np.float64]

# At most this many wrong points of a cloud are named one by one.
MOST_NAMED = 100
# A plane that is seen head on has one depth. Exports widen its range by at most this factor.
WIDENED = 1.002


@dataclass(frozen=True)
class _View:
    """A view with depth (height, width), in metres as ``camera.depth`` says."""

    camera: Camera
    depth: NDArray[Any]


def faults(dataset: Path, sets: Sequence[ImageSet], exports: Sequence[SetExport]) -> list[str]:
    """Return the points, ranges and maps that do not agree with the depth of the views."""
    problems: list[str] = []
    for export in exports:
        image_set = sets[export.number]
        for depth_range in export.exported.ranges:
            views = _views_of(depth_range, image_set)
            problems += _range_faults(depth_range, [_read(dataset, image_set, v) for v in views])
        if export.fits_depth and export.exported.cube:
            points = np.concatenate([*_seen_points(dataset, image_set)])
            cameras = image_set.lightfield.world_from_cameras[:, :3, 3]
            problems += unit_cube.seen_faults(export.exported.cube, cameras, points)
        if export.exported.depth_map:
            problems += _depth_map_faults(export.exported.depth_map, dataset, image_set)
        source = rendered(sets)
        for cloud in export.exported.clouds:
            problems += _cloud_faults(cloud, dataset, source)
    return problems


def range_faults(depth_range: DepthRange, frames: Sequence[tuple[Path, ImageSet]]) -> Iterator[str]:
    """Compare the range of a view with its depth in all frames: folders, and the views there."""
    views = [
        _read(folder, image_set, view)
        for folder, image_set in frames
        for view in _views_of(depth_range, image_set)
    ]
    yield from _range_faults(depth_range, views)


def converted(depth: NDArray[Any], camera: Camera, meaning: str) -> NDArray[Any]:
    """Return a view's depth (height, width) as "z" or "distance". NaN where it has no value."""
    if meaning == camera.depth:
        return depth
    values: NDArray[Any] = depth * _factors(camera.lens, meaning)
    return values


@lru_cache(maxsize=1)
def _factors(lens: Lens, meaning: str) -> Floats:
    """Return the factors (height, width) that convert the other kind of depth to this one."""
    cosine = -lens.pixel_rays()[..., 2]
    cosine = np.where(cosine > 0, cosine, np.nan)
    factors: Floats = cosine if meaning == "z" else 1 / cosine
    return factors


def _read(dataset: Path, image_set: ImageSet, view: int) -> _View:
    path = dataset / image_set.folder / f"{image_set.views[view]}.exr"
    return _View(camera_of(image_set, view), images.read_image(path, ["Z"]).channels["Z"])


def _views_of(depth_range: DepthRange, image_set: ImageSet) -> list[int]:
    if depth_range.view is None:
        return [*range(len(image_set.views))]
    number = image_set.numbers.get(depth_range.view)
    return [] if number is None else [number]


def _range_faults(depth_range: DepthRange, views: Sequence[_View]) -> Iterator[str]:
    """Compare a range with the nearest and the farthest depth of its views."""
    if not views:
        return
    depths = [converted(view.depth, view.camera, depth_range.meaning) for view in views]
    near = min(depth_range.farthest, *(float(np.nanmin(depth)) for depth in depths))
    far = max(near, *(min(float(np.nanmax(depth)), depth_range.farthest) for depth in depths))
    # If the range may reach to infinity, pixels without a source count as infinitely far.
    if np.isinf(depth_range.farthest) and any(np.isnan(depth).any() for depth in depths):
        far = depth_range.farthest
    is_near = same(depth_range.near, near)
    is_far = (
        depth_range.far == far
        or same(depth_range.far, far)
        or far <= depth_range.far <= WIDENED * near
    )
    if not (is_near and is_far):
        yield (
            f"{depth_range.place}: is {depth_range.near:.7g} to {depth_range.far:.7g} m, "
            f"but depth goes from {near:.7g} to {far:.7g} m"
        )


def _seen_points(dataset: Path, image_set: ImageSet) -> Iterator[Floats]:
    """Yield the world points (n, 3) to which instant-ngp's cube is fitted, of one view each."""
    last = len(image_set.views) - 1
    lens = image_set.lightfield.lens
    step = max(1, max(lens.width, lens.height) // BOUNDS_PIXELS)
    for number in np.unique(np.linspace(0, last, BOUNDS_VIEWS).round().astype(int)):
        view = _read(dataset, image_set, int(number))
        down, across = (np.arange(step // 2, side, step) for side in view.depth.shape)
        columns, rows = (axis.ravel() for axis in np.meshgrid(across, down))
        depth = view.depth[rows, columns].astype(np.float64)
        points = view.camera.lift(depth, columns, rows)
        yield points[np.isfinite(points).all(axis=1)]


def _depth_map_faults(depth_map: DepthMap, dataset: Path, image_set: ImageSet) -> Iterator[str]:
    """Compare one depth map, in metres by the export's unit, with the depth of its view."""
    if depth_map.view not in image_set.numbers or image_set.lightfield.depth is None:
        return
    view = _read(dataset, image_set, image_set.numbers[depth_map.view])
    try:
        steps = images.read_image(depth_map.path).channels["Y"].astype(np.float64)
    except UserError:
        return  # The comparison of pictures says it.
    depth = converted(view.depth, view.camera, depth_map.meaning)
    has_depth = steps > 0
    errors = np.abs(steps * depth_map.metres - depth)[has_depth]
    rounding = (0.5 + FLOAT32) * depth_map.metres + FLOAT32 * depth[has_depth]
    if not (errors <= rounding).all():
        error = f"{errors.max():.2g} m"
        yield f"{depth_map.place}: with it {depth_map.path} is up to {error} off its view"


def _cloud_faults(cloud: Cloud, dataset: Path, source: ImageSet | None) -> Iterator[str]:
    """Yield the points of a cloud that no rendered view's depth puts there."""
    if source is None:
        return
    points = cloud.positions.astype(np.float64)
    gaps = np.full(len(points), np.inf)
    for number in range(len(source.views)):
        gaps = np.fmin(gaps, _gaps(points, _read(dataset, source, number)))
    # Points are stored as float32.
    with np.errstate(invalid="ignore"):
        resolved = FLOAT32 * (1 + np.abs(points).max(axis=1, initial=0))
    wrong = np.flatnonzero(~(gaps <= resolved))
    for point in wrong[:MOST_NAMED]:
        away = f"; what is seen there is {gaps[point]:.2g} m away"
        gap = away if np.isfinite(gaps[point]) else ""
        yield f"{cloud.name(point)}: is not a point of a view's depth{gap}"
    if len(wrong) > MOST_NAMED:
        yield f"{cloud.file}: {len(wrong)} points are not points of a view's depth"


def _gaps(points: Floats, view: _View) -> Floats:
    """Return how far world points (n, 3) are from what their pixels see. NaN for a miss."""
    lens = view.camera.lens
    # A damaged point may be anywhere.
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = view.camera.pixels(points)
        inside = ((pixels >= 0) & (pixels < [lens.width, lens.height])).all(axis=1)
        columns, rows = np.where(inside[:, np.newaxis], pixels, 0).astype(np.int64).T
        depth = view.depth[rows, columns].astype(np.float64)
        gaps = np.linalg.norm(view.camera.lift(depth, columns, rows) - points, axis=1)
    return np.where(inside & np.isfinite(gaps), gaps, np.nan)
