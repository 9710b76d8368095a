"""Refocuses a plane of parallel cameras: moves each view by its disparity, and averages the views.

A point at the distance Z in front of the plane, seen from the camera at the offset o, is o f / Z
pixels from its place in the view of the middle. Views that are moved back by o f / F agree at the
distance F. Elsewhere their mean is blurred over a disc of aperture · f · |1 / Z − 1 / F| pixels.
Sources: Levoy and Hanrahan 1996, "Light Field Rendering"; Ng et al. 2005, "Light Field Photography
with a Hand-held Plenoptic Camera".
"""

import math

import numpy as np

from lightfield.core.compiled import kernel
from lightfield.core.errors import UserError
from lightfield.export.camera_grid import CameraGrid
from lightfield.export.source import Bools, Floats, SourceDataset
from lightfield.geometry.lenses import Array

# Points along each side of a camera's cell, of which the disc's part is counted.
_CELL_POINTS = 32


def disc_weights(grid: CameraGrid, diameter: float | None) -> Floats:
    """Return the weight (rows, columns) of each camera in an aperture of ``diameter`` metres.

    It is the part of the camera's cell that lies in the disc around the middle of the plane. The
    weights sum to 1. Without a ``diameter`` all are equal.
    """
    weights = np.ones(grid.offsets.shape[:2])
    if diameter is not None:
        right, up = _cell_points(grid)
        away = np.hypot(right, up)
        # A small disc has the nearest points at least.
        radius = max(diameter / 2, (1 + 1e-9) * away.min())
        weights = (away <= radius).mean(axis=(2, 3))
    return np.asarray(weights / weights.sum())


def _cell_points(grid: CameraGrid) -> tuple[Floats, Floats]:
    """Return places right and up of points in the cell of each camera, in metres.

    They are (rows, columns, 1, n) and (rows, columns, n, 1). A cell reaches half way to the
    neighbours. Across a single row or column, it has no extent.
    """
    parts = (np.arange(_CELL_POINTS) + 0.5) / _CELL_POINTS - 0.5
    width, height = grid.cell
    right, up = np.moveaxis(grid.offsets[:, :, np.newaxis, np.newaxis], -1, 0)
    return right + width * parts, up + height * parts[:, np.newaxis]


class MovableView:
    """A view that can be added to a sum after it was moved by parts of pixels.

    ``light`` (height, width, 4) is linear, with alpha, by which it is multiplied. It counts where
    it is finite and ``valid`` (height, width).
    """

    def __init__(self, light: Array, valid: Bools) -> None:
        valid = valid & np.isfinite(light).all(axis=-1)
        self._light = np.ascontiguousarray(np.where(valid[..., np.newaxis], light, 0), np.float32)
        self._valid = np.ascontiguousarray(valid)
        # Where 4 × 4 pixels count, of which this is the first.
        self._solid = np.zeros_like(valid)
        rows = valid[:-3] & valid[1:-2] & valid[2:-1] & valid[3:]
        whole = rows[:, :-3] & rows[:, 1:-2] & rows[:, 2:-1] & rows[:, 3:]
        self._solid[: whole.shape[0], : whole.shape[1]] = whole

    def add_to(self, total: Array, right: float, down: float, weight: float) -> None:
        """Add ``weight`` times the light at the places ``right`` and ``down`` of each pixel.

        ``total`` (height, width, 5) float32 is changed. Its last channel sums the weights. Light is
        interpolated between 4 × 4 pixels (Catmull and Rom 1974), or linearly between 2 × 2 where
        some of the former do not count, and not at all where some of the latter do not.
        Interpolation does not make light negative.
        """
        column, row = math.floor(right), math.floor(down)
        x, y = right - column, down - row
        _add_moved(
            total,
            self._light,
            self._valid,
            self._solid,
            (row, column),
            (_cubic(y), _cubic(x)),
            (_linear(y), _linear(x)),
            np.float32(weight),
            np.float32(min(0.0, float(np.min(self._light)))),
        )


def _cubic(part: float) -> Array:
    """Return the weights (4,) of the pixels at −1, 0, 1 and 2 for a place from 0 to 1."""
    t = part
    weights = (
        t * (t * (1 - t / 2) - 1 / 2),
        1 + t * t * (1.5 * t - 2.5),
        t * (0.5 + t * (2 - 1.5 * t)),
        t * t * (t / 2 - 1 / 2),
    )
    return np.array(weights, np.float32)


def _linear(part: float) -> Array:
    """Return the weights (2,) of the pixels at 0 and 1 for a place from 0 to 1."""
    return np.array([1 - part, part], np.float32)


def disparities(grid: CameraGrid, focal: tuple[float, float], distance: float) -> Floats:
    """Return where each camera (rows, columns, 2) sees a point, in pixels right and down.

    The place is relative to the point's place in the view of the middle. The point is at the
    ``distance`` in metres in front of the plane. ``focal`` is the focal length in pixels, across
    and down.
    """
    return np.asarray(grid.offsets / distance * (-focal[0], focal[1]))


def inverse_steps(near: float, far: float, count: int) -> list[float]:
    """Return ``count`` distances in metres, evenly spaced in their inverses, rounded."""
    inverses = np.linspace(1 / near, 1 / far, count)
    return [float(f"{distance:.4g}") for distance in 1 / inverses]


def depth_range(depth: Array) -> tuple[float, float] | None:
    """Return the nearest and the farthest depth, but for 1 % at each end. None without surfaces."""
    surfaces = depth[np.isfinite(depth) & (depth > 0)]
    if not surfaces.size:
        return None
    near, far = np.percentile(surfaces, [1, 99]).tolist()
    return near, far


def surface_range(source: SourceDataset, grid: CameraGrid, key: str) -> tuple[float, float]:
    """Return the `depth_range` in metres of what the plane's corners and middle see.

    Raises `UserError` if they see no surface: then the ``key`` must be given.
    """
    rows, columns = grid.views.shape[1:]
    places = {(0, 0), (0, -1), (-1, 0), (-1, -1), (rows // 2, columns // 2)}
    numbers = sorted({int(grid.views[0, row, column]) for row, column in places})
    depths = [source.depth(source.lightfield.views[number], "z") for number in numbers]
    reach = depth_range(np.stack(depths))
    if reach is None:
        raise UserError(f"{source.lightfield.path}: its views see no surface; give {key}")
    return reach


def mean_light(total: Array) -> Array:
    """Return the mean light with alpha (height, width, 4) of what was added. 0 for nothing."""
    weights = total[..., 4:]
    return np.divide(total[..., :4], weights, out=np.zeros_like(total[..., :4]), where=weights > 0)


@kernel
def _add_moved(
    total: Array,
    light: Array,
    valid: Bools,
    solid: Bools,
    place: tuple[int, int],
    cubic: tuple[Array, Array],
    linear: tuple[Array, Array],
    weight: np.float32,
    lowest: np.float32,
) -> None:
    height, width, _ = light.shape
    sample = np.empty(4, np.float32)
    for row in range(height):
        for column in range(width):
            y, x = row + place[0], column + place[1]
            is_seen = True
            if 1 <= y < height and 1 <= x < width and solid[y - 1, x - 1]:
                _cubic_sample(light, y - 1, x - 1, cubic[0], cubic[1], sample)
            else:
                is_seen = _linear_sample(light, valid, y, x, linear[0], linear[1], sample)
            if is_seen:
                for channel in range(4):
                    total[row, column, channel] += weight * max(sample[channel], lowest)
                total[row, column, 4] += weight


@kernel
def _cubic_sample(light: Array, top: int, left: int, wy: Array, wx: Array, sample: Array) -> None:
    """Fill ``sample`` with the weighted sum of 4 × 4 pixels from (``top``, ``left``) on."""
    s0 = s1 = s2 = s3 = np.float32(0)
    for i in range(4):
        for j in range(4):
            weight = wy[i] * wx[j]
            s0 += weight * light[top + i, left + j, 0]
            s1 += weight * light[top + i, left + j, 1]
            s2 += weight * light[top + i, left + j, 2]
            s3 += weight * light[top + i, left + j, 3]
    sample[0], sample[1], sample[2], sample[3] = s0, s1, s2, s3


@kernel
def _linear_sample(
    light: Array, valid: Bools, top: int, left: int, wy: Array, wx: Array, sample: Array
) -> bool:
    """Fill ``sample`` with the weighted sum of 2 × 2 pixels. Return whether all of them count."""
    height, width, _ = light.shape
    sample[:] = 0
    for i in range(2):
        for j in range(2):
            weight = wy[i] * wx[j]
            if weight == 0:
                continue
            y, x = top + i, left + j
            if not (0 <= y < height and 0 <= x < width and valid[y, x]):
                return False
            for channel in range(4):
                sample[channel] += weight * light[y, x, channel]
    return True
