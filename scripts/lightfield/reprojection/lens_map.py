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

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.reprojection.filters import DEFAULT_FILTER, FILTERS
from lightfield.reprojection.kernels import CAREFUL, INSIDE, NOTHING, Topology

_STRIP = 64  # rows computed at a time, so that the temporary arrays stay in the caches
_MOST_SAMPLES = 256  # each way, of a footprint that meets a pole
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

    ``settings`` describes what the map is for; ``summary`` has the magnification's min, median and
    max, and the fraction of the image that has a source (covered). ``window`` is the
    part of the source (row, end row, column, end column) that the map reads at all, and every
    coordinate counts in pixels from that window's corner.
    """

    settings: dict[str, Any]
    summary: dict[str, float]
    window: tuple[int, int, int, int]
    # (H, W, 2) float32 (x, y) of the pixels' centres; NaN where the source does not see the ray.
    centers: Array
    # (H·n, W·n, 2) float32 (x, y) of the n × n samples of each pixel; `centers` itself if n = 1.
    coordinates: Array
    # (H·n, W·n) uint8: NOTHING, INSIDE or CAREFUL for each sample.
    flags: Array
    # (h, w) and (H, W) float32: cos θ at each pixel's centre; NaN where it has no ray.
    source_cos: Array
    target_cos: Array
    # (H, W) float32: target pixels to one of the source, along a line; NaN where it has no source.
    magnification: Array
    # Of the adaptive filter where anything is minified: (H, W, 2) uint16, how many samples a pixel
    # takes along its row and its column, and (H, W, 2, 2) float32, the (x, y) step from one to the
    # next, the first index being x or y and the second the way.
    footprints: Array | None = None
    counts: Array | None = None
    # Of a cube map: (h + 2b, 6 (h + 2b), 2) float32, where in the strip of faces each pixel of the
    # strip of faces with borders of b pixels lies. All other coordinates, `source_cos` and the
    # flags are then of the strip with borders, and the window is the whole of the one without.
    strip: Array | None = None

    @property
    def topology(self) -> Topology:
        """How the source continues beyond its frame.

        Whether the last column is the neighbour of the first; whether the first and the last row
        surround a pole.
        """
        wraps, top, bottom, _ = self.settings["topology"]
        return wraps, top, bottom


def settings(
    source: Lens, target: Lens, rotation: Array, filter_name: str, samples: int
) -> dict[str, Any]:
    """Return all that a lens map depends on, as JSON can hold it: a part of every view's key."""
    return {
        "source": source.to_lightfield(),
        "target": target.to_lightfield(),
        "rotation": np.asarray(rotation, np.float64).tolist(),
        "filter": filter_name,
        "samples": samples,
        "topology": [*_topology(source), len(CUBE_FACES) if isinstance(source, CubeMap) else 1],
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
    if samples > 1 and FILTERS[filter_name].cover:
        raise UserError(
            f"samples: the {filter_name} filter covers the whole pixel already; leave 1"
        )
    wraps, _, _ = _topology(source)
    # One pixel more on every side, for central differences at the border too.
    padded = _coordinates(
        source,
        target,
        rotation,
        np.arange(-1, target.width + 1) + 0.5,
        np.arange(-1, target.height + 1) + 0.5,
    )
    jacobian = _jacobian(padded, source, wraps)
    reach = np.asarray(FILTERS[filter_name].reach)
    footprints, counts = None, None
    if FILTERS[filter_name].cover:
        footprints, counts = _footprints(jacobian, source)
        if counts.max() == 1:
            footprints, counts = None, None
        else:
            extent = np.abs(footprints * (counts[..., None, :] - 1)).sum(axis=-1) / 2
            reach = reach + np.ceil(extent.max(axis=-1))
    border = 0
    if isinstance(source, CubeMap):
        # Depth reads two pixels on each side of the one that the ray falls in.
        border = max(int(reach.max()) + 1, 2)
    centers = _framed(padded[1:-1, 1:-1], source, border)
    points = centers
    if samples > 1:
        x = (np.arange(target.width * samples) + 0.5) / samples
        y = _strips((np.arange(target.height * samples) + 0.5) / samples)
        # In float32 from the start: they are n² times as many as the pixels.
        points = np.concatenate(
            [
                _framed(_coordinates(source, target, rotation, x, rows), source, border).astype(
                    np.float32
                )
                for rows in y
            ]
        )
    strip = None
    if isinstance(source, CubeMap):
        strip = _strip_with_borders(source, border)
        source_cos = _face_cosines(source, border)
        window, corner = (0, source.height, 0, source.width), np.zeros(2, points.dtype)
    else:
        source_cos = _cosines(source)
        window = _window(points, source, reach, wraps)
        corner = np.array([window[2], window[0]], points.dtype)
    centers32 = (centers - corner).astype(np.float32)
    nothing = np.isnan(centers[..., 0])
    scale = np.where(nothing, np.nan, magnification(jacobian))
    lens_map = LensMap(
        settings=settings(source, target, rotation, filter_name, samples),
        summary=_summary(scale),
        window=window,
        centers=centers32,
        coordinates=centers32 if samples == 1 else (points - corner).astype(np.float32),
        flags=_flags(points, ~np.isnan(source_cos), reach),
        source_cos=source_cos if strip is not None else _cut(source_cos, window),
        target_cos=_cosines(target),
        magnification=scale.astype(np.float32),
        footprints=footprints,
        counts=counts,
        strip=strip,
    )
    # Read-only, as `load` gives them, so that both use the same compiled kernels.
    for array in _arrays(lens_map).values():
        array.flags.writeable = False
    return lens_map


def save(path: Path | str, lens_map: LensMap) -> None:
    """Write a lens map as one .npy record that `load` maps into memory; atomic."""
    description = json.dumps(
        {
            "settings": lens_map.settings,
            "summary": lens_map.summary,
            "window": lens_map.window,
        }
    ).encode()
    fields = _arrays(lens_map)
    if lens_map.coordinates is lens_map.centers:
        del fields["coordinates"]
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
        try:
            # NumPy does not report what is lost when it closes the file.
            np.load(temporary, mmap_mode="r")
        except ValueError as error:
            raise OSError(f"the file is cut short: {error}") from None


def load(path: Path | str) -> LensMap:
    """Map a file of `save` into memory, read-only; raises `UserError` for any other file."""
    try:
        record = np.load(path, mmap_mode="r")
        description = json.loads(bytes(record["description"][0]))
        arrays = {name: record[name][0] for name in record.dtype.names if name != "description"}
        return LensMap(
            settings=description["settings"],
            summary=description["summary"],
            window=tuple(description["window"]),
            **({"coordinates": arrays["centers"]} | arrays),
        )
    except (OSError, EOFError, ValueError, KeyError, IndexError, TypeError) as error:
        raise UserError(f"{path}: is not a lens map that can be read: {error}") from None


def _arrays(lens_map: LensMap) -> dict[str, Array]:
    """Return the arrays by name, those of the largest items first, so that all are aligned."""
    arrays = {
        name: array for name, array in vars(lens_map).items() if isinstance(array, np.ndarray)
    }
    return dict(sorted(arrays.items(), key=lambda item: -item[1].itemsize))


def warnings(lens_map: LensMap) -> list[str]:
    """Return what a person should know of the map's magnification: upsampling and aliasing."""
    if not lens_map.summary["covered"]:
        return ["the source sees nothing of the target image"]
    found = []
    largest, smallest = lens_map.summary["max"], lens_map.summary["min"]
    if largest > 1.5:
        found.append(
            f"upsampling: up to {largest:.3g} target pixels to one of the source (median "
            f"{lens_map.summary['median']:.3g}); a smaller --scale or field of view helps"
        )
    steps = math.ceil(1 / smallest)
    samples = lens_map.settings["samples"]
    if not FILTERS[lens_map.settings["filter"]].cover and samples * 1.5 * smallest < 1:
        found.append(
            f"aliasing: one target pixel spans up to {1 / smallest:.3g} of the source's; "
            f"--filter adaptive or --samples {steps} helps"
        )
    return found


def report(lens_map: LensMap) -> None:
    """Print the magnification and the warnings to standard error."""
    found = lens_map.summary
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


def _summary(scale: Array) -> dict[str, float]:
    seen = scale[np.isfinite(scale)]
    if not seen.size:
        return {"min": 0.0, "median": 0.0, "max": 0.0, "covered": 0.0}
    return {
        "min": float(seen.min()),
        "median": float(np.median(seen)),
        "max": float(seen.max()),
        "covered": float(1 - np.isnan(scale).mean()),
    }


def _topology(source: Lens) -> Topology:
    """Find from its rays how a source continues; see `LensMap.topology`."""
    if isinstance(source, CubeMap):
        return False, False, False
    height = np.array([0.25, 0.5, 0.75]) * source.height
    width = np.array([0.0, 0.4, 0.8]) * source.width
    left, right = source.rays(np.zeros(3), height), source.rays(np.full(3, source.width), height)
    wraps = bool(np.allclose(left, right, atol=1e-5))
    ends = [source.rays(width, np.full(3, y)) for y in (0.0, float(source.height))]
    top, bottom = (wraps and bool(np.allclose(rays, rays[0], atol=1e-5)) for rays in ends)
    return wraps, top, bottom


def _cosines(lens: Lens) -> Array:
    """Return cos θ (height, width) float32 at the pixels' centres; NaN where there is no ray."""
    x = np.arange(lens.width) + 0.5
    strips = _strips(np.arange(lens.height) + 0.5)
    return np.concatenate(
        [-lens.rays(x[None, :], y[:, None])[..., 2].astype(np.float32) for y in strips]
    )


def _cut(pixels: Array, window: tuple[int, int, int, int]) -> Array:
    return np.ascontiguousarray(pixels[window[0] : window[1], window[2] : window[3]])


def _strip_with_borders(source: CubeMap, border: int) -> Array:
    """Return where the pixels of the faces with borders lie in the strip; see `LensMap.strip`."""
    places = np.arange(-border, source.height + border) + 0.5
    rays = source.face.rays(places[None, :], places[:, None])
    faces = [source.pixels(rays @ rotation.T) for rotation in CUBE_FACES.values()]
    return np.concatenate(faces, axis=1).astype(np.float32)


def _face_cosines(source: CubeMap, border: int) -> Array:
    """Return cos θ from each face's own axis, in the strip with borders, which repeat the edge."""
    places = np.arange(source.height) + 0.5
    cosines = -source.face.rays(places[None, :], places[:, None])[..., 2]
    return np.asarray(np.tile(np.pad(cosines.astype(np.float32), border, mode="edge"), 6))


def _strips(values: Array) -> list[Array]:
    return np.array_split(values, max(1, len(values) // _STRIP))


def _coordinates(source: Lens, target: Lens, rotation: Array, x: Array, y: Array) -> Array:
    """Return the (len(y), len(x), 2) source coordinates of a grid of target coordinates."""
    parts = []
    for rows in _strips(y):
        rays = target.rays(x[None, :], rows[:, None])
        parts.append(source.pixels(rays @ rotation.T))
    return np.concatenate(parts)


def _framed(coordinates: Array, source: Lens, border: int) -> Array:
    """Return the coordinates with NaN in place of those outside the source's frame.

    Those in a cube map's strip become those in its strip of faces with a ``border``.
    """
    inside = (coordinates >= 0) & (coordinates <= [source.width, source.height])
    shift = np.zeros_like(coordinates)
    if border:
        face = np.floor(coordinates[..., 0] / source.height)
        shift[..., 0], shift[..., 1] = (2 * face + 1) * border, border
    return np.where(inside.all(axis=-1, keepdims=True), coordinates + shift, np.nan)


def _jacobian(padded: Array, source: Lens, wraps: bool) -> Array:
    """Return central differences (H, W, 2, 2) of (H + 2, W + 2, 2) source coordinates.

    Where one neighbour has no coordinates the difference is one-sided, and 0 where neither has.
    """
    out = np.empty((padded.shape[0] - 2, padded.shape[1] - 2, 2, 2))
    middle = padded[1:-1, 1:-1]
    neighbours = (
        (padded[1:-1, :-2], padded[1:-1, 2:]),
        (padded[:-2, 1:-1], padded[2:, 1:-1]),
    )
    for axis, (before, after) in enumerate(neighbours):
        if isinstance(source, CubeMap):
            before, after = (_on_face_of(source, c, middle) for c in (before, after))
        backward, forward = middle - before, after - middle
        if wraps:
            for difference in (backward, forward):
                difference[..., 0] -= source.width * np.round(difference[..., 0] / source.width)
        lacks = np.isnan(forward), np.isnan(backward)
        forward = np.where(lacks[0], backward, forward)
        backward = np.where(lacks[1], forward, backward)
        # A grazing ray moves beyond all bounds: as good as beyond every image.
        out[..., axis] = np.clip(np.nan_to_num((forward + backward) / 2), -1e9, 1e9)
    return out


def _on_face_of(source: CubeMap, coordinates: Array, middle: Array) -> Array:
    """Return the coordinates, those on another face than ``middle`` continued onto its plane."""
    out = coordinates.copy()
    here, there = (np.floor(c[..., 0] / source.height) for c in (middle, coordinates))
    for index, rotation in enumerate(CUBE_FACES.values()):
        other = (here == index) & (there != index)
        rays = source.rays(out[other, 0], out[other, 1]) @ rotation
        out[other] = source.face.pixels(rays) + np.array([index * source.height, 0])
    return out


def _footprints(jacobian: Array, source: Lens) -> tuple[Array, Array]:
    """Return the adaptive filter's steps from sample to sample, and how many samples each way.

    A pixel is a mean over its area, in the source too, so what is missing to a target pixel that
    spans s source pixels is a box of width √(s² − 1), by the variances. n samples at distance d
    have the variance of a box of width d √(n² − 1), so that gives d; n is as small as the bicubic
    kernel, under which d may exceed a pixel, allows. Where s is little above 1 or below it, one
    sample is all: magnifying does not blur. A face of a cube map continues in its plane no further
    than its own width.
    """
    span = np.hypot(jacobian[..., 0, :], jacobian[..., 1, :])
    box = np.sqrt(np.maximum(span * span - 1, 0))
    if isinstance(source, CubeMap):
        box = np.minimum(box, source.height)
    counts = np.where(box > 0.5, np.clip(np.ceil(0.75 * box), 2, _MOST_SAMPLES), 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(counts > 1, box / span / np.sqrt(counts * counts - 1), 0)
    return (jacobian * scale[..., None, :]).astype(np.float32), counts.astype(np.uint16)


def _flags(points: Array, valid: Array, reach: Array) -> Array:
    """Return NOTHING, INSIDE or CAREFUL for each of the ``points``."""
    # Imported here because applying a map, which is most of the work, does without.
    from scipy.ndimage import distance_transform_cdt

    depth = distance_transform_cdt(np.pad(valid, 1), metric="chessboard")[1:-1, 1:-1]
    flags = np.empty(points.shape[:2], np.uint8)
    for rows in _strips(np.arange(len(points))):
        strip = points[rows]
        nothing = np.isnan(strip[..., 0])
        row, column = (
            np.minimum(np.where(nothing, 0, strip[..., axis]).astype(np.int32), limit - 1)
            for axis, limit in ((1, valid.shape[0]), (0, valid.shape[1]))
        )
        inside = depth[row, column] > (reach[rows] if reach.ndim else reach)
        flags[rows] = np.where(nothing, NOTHING, np.where(inside, INSIDE, CAREFUL))
    return flags


def _window(points: Array, source: Lens, reach: Array, wraps: bool) -> tuple[int, int, int, int]:
    """Return the rows and columns [row, end) × [column, end) that the filter may read.

    All columns if the source ``wraps`` around.
    """
    if np.isnan(points[..., 0]).all():
        return 0, 1, 0, 1
    margin = reach + 1
    if margin.ndim:
        low = np.nanmin(points - margin[..., None], axis=(0, 1))
        high = np.nanmax(points + margin[..., None], axis=(0, 1))
    else:
        low = np.fmin.reduce(points, axis=(0, 1)) - margin
        high = np.fmax.reduce(points, axis=(0, 1)) + margin
    size = np.array([source.width, source.height])
    left, top = (int(start) for start in np.clip(np.floor(low), 0, size - 1))
    right, bottom = (int(end) for end in np.clip(np.ceil(high), 1, size))
    if wraps:
        left, right = 0, source.width
    return top, bottom, left, right
