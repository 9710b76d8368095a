"""The lens map: where in the source image each pixel of the target image looks.

A map depends on the two lenses, their sizes, the rotation between them and the filter, and on no
view. It is computed once in float64, kept in float32, and applied to every view of a rig.
"""

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_cdt

from lightfield.errors import UserError
from lightfield.files import atomic_path
from lightfield.lenses import Array, Lens
from lightfield.resample import ADAPTIVE, DEFAULT_FILTER, FILTERS, SUPPORT

# What a target pixel (or one of its samples) finds in the source.
NOTHING = 0  # the source does not see the ray
INSIDE = 1  # every source pixel that the filter reads exists
CAREFUL = 2  # some may not: the image's edge, its seam or pole, the rim of the image circle

_STRIP = 64  # rows computed at a time, so that the temporary arrays stay in the caches
_HEADER = 65536  # bytes kept for the description in a file


def rotation_matrix(pan: float, pitch: float, roll: float) -> Array:
    """Return the (3, 3) rotation from target to source camera coordinates; angles in degrees.

    The published tool's convention: Ry(pan) · Rx(pitch) · Rz(roll) in a frame whose y points
    down, which are −pitch and −roll where y points up. So a positive pan turns the target
    camera to the left, a positive pitch down, and a positive roll clockwise.
    """
    pan, pitch, roll = math.radians(pan), math.radians(-pitch), math.radians(-roll)
    about_x = [
        [1, 0, 0],
        [0, math.cos(pitch), -math.sin(pitch)],
        [0, math.sin(pitch), math.cos(pitch)],
    ]
    about_y = [[math.cos(pan), 0, math.sin(pan)], [0, 1, 0], [-math.sin(pan), 0, math.cos(pan)]]
    about_z = [[math.cos(roll), -math.sin(roll), 0], [math.sin(roll), math.cos(roll), 0], [0, 0, 1]]
    matrix: Array = np.array(about_y) @ np.array(about_x) @ np.array(about_z)
    return matrix


@dataclass(frozen=True)
class LensMap:
    """What it takes to resample a view; (H, W) is the target's size, (h, w) the window's.

    ``settings`` describes what the map is for, ``magnification`` what it does. ``window`` is the
    part of the source (row, end row, column, end column) that the map reads at all, and every
    coordinate counts in pixels from that window's corner.
    """

    settings: dict[str, Any]
    magnification: dict[str, float]
    window: tuple[int, int, int, int]
    # (H, W, 2) float32 (x, y) of the pixels' centres; NaN where the source does not see the ray.
    centers: Array
    # (H·n, W·n, 2) float32 (x, y) of the n × n samples of each pixel; `centers` itself if n = 1.
    samples: Array
    # (H·n, W·n) uint8: NOTHING, INSIDE or CAREFUL for each sample.
    flags: Array
    # (H, W, 2, 2) float32: d(x, y)/d(column, row) at the pixels' centres.
    jacobian: Array
    # (h, w) and (H, W) float32: cos θ at each pixel's centre; NaN where it has no ray.
    source_cos: Array
    target_cos: Array

    @property
    def wraps(self) -> bool:
        """Whether the source's last column is the neighbour of its first."""
        return bool(self.settings["wraps"])

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the source's first and last row are the surroundings of a pole."""
        top, bottom = self.settings["poles"]
        return bool(top), bool(bottom)


def settings(
    source: Lens, target: Lens, rotation: Array, filter_name: str, samples: int
) -> dict[str, Any]:
    """Return all that a lens map depends on, as JSON can hold it."""
    wraps, poles = _topology(source)
    return {
        "source": source.to_lightfield(),
        "target": target.to_lightfield(),
        "rotation": np.asarray(rotation, np.float64).tolist(),
        "filter": filter_name,
        "samples": samples,
        "wraps": wraps,
        "poles": list(poles),
    }


def compute(
    source: Lens,
    target: Lens,
    rotation: Array,
    filter_name: str = DEFAULT_FILTER,
    samples: int = 1,
) -> LensMap:
    """Compute the map from ``source`` to ``target``, ``samples`` × ``samples`` a target pixel.

    ``rotation`` (3, 3) turns rays of the target camera into the source camera's.
    """
    if samples < 1:
        raise UserError(f"samples: {samples} must be at least 1")
    if filter_name not in FILTERS:
        raise UserError(f"filter: {filter_name!r} is not one of {', '.join(FILTERS)}")
    if samples > 1 and filter_name == ADAPTIVE:
        raise UserError("samples: the adaptive filter covers the whole pixel already; leave 1")
    wraps, _ = _topology(source)
    period = source.width if wraps else 0
    # One pixel more on every side, for central differences at the border too.
    padded = _coordinates(
        source, target, rotation, np.arange(-1, target.width + 1) + 0.5,
        np.arange(-1, target.height + 1) + 0.5, wraps,
    )  # fmt: skip
    jacobian = _jacobian(padded, period)
    centers = _framed(padded[1:-1, 1:-1], source)
    if samples > 1:
        points = _framed(
            _coordinates(
                source, target, rotation, (np.arange(target.width * samples) + 0.5) / samples,
                (np.arange(target.height * samples) + 0.5) / samples, wraps,
            ),
            source,
        )  # fmt: skip
    else:
        points = centers
    columns = np.arange(source.width) + 0.5
    source_cos = np.concatenate(
        [
            -source.rays(columns[None, :], rows[:, None])[..., 2]
            for rows in _strips(np.arange(source.height) + 0.5)
        ]
    ).astype(np.float32)
    target_cos = np.concatenate(
        [
            -target.rays((np.arange(target.width) + 0.5)[None, :], rows[:, None])[..., 2]
            for rows in _strips(np.arange(target.height) + 0.5)
        ]
    ).astype(np.float32)

    reach = _reach(filter_name, jacobian, samples)
    window = _window(points, source, reach, wraps)
    flags = _flags(points, ~np.isnan(source_cos), reach)
    corner = np.array([window[2], window[0]])
    points32 = (points - corner).astype(np.float32)
    return LensMap(
        settings=settings(source, target, rotation, filter_name, samples),
        magnification=_magnification(jacobian, np.isnan(centers[..., 0])),
        window=window,
        centers=points32 if samples == 1 else (centers - corner).astype(np.float32),
        samples=points32,
        flags=flags,
        jacobian=jacobian.astype(np.float32),
        source_cos=np.ascontiguousarray(source_cos[window[0] : window[1], window[2] : window[3]]),
        target_cos=target_cos,
    )


def save(path: Path | str, lens_map: LensMap) -> None:
    """Write a lens map as one .npy record that `load` maps into memory; atomic."""
    description = json.dumps(
        {
            "settings": lens_map.settings,
            "magnification": lens_map.magnification,
            "window": lens_map.window,
        }
    ).encode()
    fields = {
        name: getattr(lens_map, name)
        for name in ("centers", "samples", "jacobian", "source_cos", "target_cos", "flags")
        if name != "samples" or lens_map.samples is not lens_map.centers
    }
    dtype = np.dtype(
        [("description", f"S{_HEADER}")]
        + [(name, array.dtype, array.shape) for name, array in fields.items()]
    )
    with atomic_path(path) as temporary:
        record = np.empty(1, dtype)
        record["description"] = description
        for name, array in fields.items():
            record[name][0] = array
        np.save(temporary, record)


def load(path: Path | str) -> LensMap:
    """Map a file of `save` into memory, read-only; raises `UserError` for any other file."""
    try:
        record = np.load(path, mmap_mode="r")
        description = json.loads(bytes(record["description"][0]))
        arrays = {name: record[name][0] for name in record.dtype.names if name != "description"}
        return LensMap(
            settings=description["settings"],
            magnification=description["magnification"],
            window=tuple(description["window"]),
            **({"samples": arrays["centers"]} | arrays),
        )
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        raise UserError(f"{path}: is not a lens map that can be read: {error}") from None


def warnings(lens_map: LensMap) -> list[str]:
    """Return what a person should know of the map's magnification: upsampling and aliasing."""
    if not lens_map.magnification["covered"]:
        return ["the source sees nothing of the target image"]
    found = []
    largest, smallest = lens_map.magnification["max"], lens_map.magnification["min"]
    if largest > 1.5:
        found.append(
            f"upsampling: up to {largest:.3g} target pixels to one of the source (median "
            f"{lens_map.magnification['median']:.3g}); a smaller --scale or field of view helps"
        )
    steps = math.ceil(1 / smallest)
    samples = lens_map.settings["samples"]
    if lens_map.settings["filter"] != ADAPTIVE and samples * 1.5 * smallest < 1:
        found.append(
            f"aliasing: one target pixel spans up to {1 / smallest:.3g} of the source's; "
            f"--filter adaptive or --samples {steps} helps"
        )
    return found


def report(lens_map: LensMap) -> None:
    """Print the magnification and the warnings to standard error."""
    found = lens_map.magnification
    print(
        f"magnification: {found['min']:.3g} to {found['max']:.3g}, median {found['median']:.3g} "
        f"target pixels to one of the source; {found['covered']:.1%} of the image has a source",
        file=sys.stderr,
    )
    for warning in warnings(lens_map):
        print(f"warning: {warning}", file=sys.stderr)


def magnification(jacobian: npt.ArrayLike) -> Array:
    """Return the local linear magnification (...) of jacobians (..., 2, 2): target per source px.

    1 / √|det J|: above 1 the target has more pixels than the source, below 1 it has fewer.
    """
    j = np.asarray(jacobian)
    area = np.abs(j[..., 0, 0] * j[..., 1, 1] - j[..., 0, 1] * j[..., 1, 0])
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(area))


def _magnification(jacobian: Array, nothing: Array) -> dict[str, float]:
    seen = magnification(jacobian)[~nothing]
    seen = seen[np.isfinite(seen)]
    if not seen.size:
        return {"min": 0.0, "median": 0.0, "max": 0.0, "covered": 0.0}
    low, middle, high = np.quantile(seen, [0.0, 0.5, 1.0])
    return {
        "min": float(low),
        "median": float(middle),
        "max": float(high),
        "covered": float(1 - nothing.mean()),
    }


def _topology(source: Lens) -> tuple[bool, tuple[bool, bool]]:
    """Find from its rays whether a source's sides meet, and whether its ends are poles."""
    height = np.array([0.25, 0.5, 0.75]) * source.height
    width = np.array([0.0, 0.4, 0.8]) * source.width
    left, right = source.rays(np.zeros(3), height), source.rays(np.full(3, source.width), height)
    wraps = bool(np.allclose(left, right, atol=1e-5))
    ends = (source.rays(width, np.full(3, y)) for y in (0.0, float(source.height)))
    top, bottom = (wraps and bool(np.allclose(rays, rays[0], atol=1e-5)) for rays in ends)
    return wraps, (top, bottom)


def _strips(values: Array) -> list[Array]:
    return np.array_split(values, max(1, len(values) // _STRIP))


def _coordinates(
    source: Lens, target: Lens, matrix: Array, x: Array, y: Array, wraps: bool
) -> Array:
    """Return the (len(y), len(x), 2) source coordinates of a grid of target coordinates."""
    parts = []
    for rows in _strips(y):
        rays = target.rays(x[None, :], rows[:, None])
        parts.append(source.pixels(rays @ matrix.T))
    coordinates = np.concatenate(parts)
    if wraps:
        coordinates[..., 0] %= source.width
    return coordinates


def _framed(coordinates: Array, source: Lens) -> Array:
    """Return the coordinates with NaN in place of those outside the source's frame."""
    inside = (coordinates >= 0) & (coordinates <= [source.width, source.height])
    return np.where(inside.all(axis=-1, keepdims=True), coordinates, np.nan)


def _jacobian(padded: Array, period: int) -> Array:
    """Return central differences (H, W, 2, 2) of (H + 2, W + 2, 2) coordinates.

    Where one neighbour has no coordinates the difference is one-sided, and 0 where neither has.
    """
    out = np.empty((padded.shape[0] - 2, padded.shape[1] - 2, 2, 2))
    middle = padded[1:-1, 1:-1]
    for axis, (before, after) in enumerate(
        ((padded[1:-1, :-2], padded[1:-1, 2:]), (padded[:-2, 1:-1], padded[2:, 1:-1]))
    ):
        backward, forward = middle - before, after - middle
        if period:
            for difference in (backward, forward):
                difference[..., 0] -= period * np.round(difference[..., 0] / period)
        lacks = np.isnan(forward), np.isnan(backward)
        forward = np.where(lacks[0], backward, forward)
        backward = np.where(lacks[1], forward, backward)
        out[..., axis] = np.nan_to_num((forward + backward) / 2)
    return out


def _reach(filter_name: str, jacobian: Array, samples: int) -> Array:
    """Return how many source pixels (H·n, W·n) or () around its own a sample may read."""
    return np.asarray(SUPPORT[filter_name])


def _flags(points: Array, valid: Array, reach: Array) -> Array:
    """Return NOTHING, INSIDE or CAREFUL for each of the ``points``."""
    depth = distance_transform_cdt(np.pad(valid, 1), metric="chessboard")[1:-1, 1:-1]
    nothing = np.isnan(points[..., 0])
    index = np.where(nothing[..., None], 0, points).astype(np.int64)
    row = np.minimum(index[..., 1], valid.shape[0] - 1)
    column = np.minimum(index[..., 0], valid.shape[1] - 1)
    flags = np.where(depth[row, column] > reach, INSIDE, CAREFUL)
    flags[nothing] = NOTHING
    return flags.astype(np.uint8)


def _window(points: Array, source: Lens, reach: Array, wraps: bool) -> tuple[int, int, int, int]:
    """Return the rows and columns [row, end) × [column, end) that the filter may read."""
    if np.isnan(points[..., 0]).all():
        return 0, 1, 0, 1
    margin = int(np.max(reach)) + 1
    low = np.nanmin(points, axis=(0, 1)).astype(int) - margin
    high = np.nanmax(points, axis=(0, 1)).astype(int) + margin + 1
    first_row, last_row = max(0, low[1]), min(source.height, high[1])
    if wraps:
        return int(first_row), int(last_row), 0, source.width
    return int(first_row), int(last_row), int(max(0, low[0])), int(min(source.width, high[0]))
