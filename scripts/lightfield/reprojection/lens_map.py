"""The lens map: the place in the source image at which each pixel of the target image looks.

A map depends on the two lenses, their sizes, the rotation between them and the filter, but not on
a view. It is computed once in float64, stored in float32, and applied to every view of a rig.
"""

import json
import math
import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from lightfield.configuration.reprojections import DEFAULT_FILTER
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, atomic_path, check_readable, read_error
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.reprojection.filters import FILTERS
from lightfield.reprojection.fold import Fold
from lightfield.reprojection.footprints import bounds, distance_to_missing, mark, measure
from lightfield.reprojection.kernels import Topology

_STRIP = 2**16  # pixels computed at a time, so that the temporary arrays stay in the caches
_HEADER = 65536  # bytes reserved for the description in a file


def rotation_matrix(pan: float, pitch: float, roll: float) -> Array:
    """Return the (3, 3) rotation from target to source camera coordinates. Angles are in degrees.

    A positive pan turns the target camera to the left, a positive pitch down, and a positive roll
    clockwise. SILVR's tool defines Ry(pan) · Rx(pitch) · Rz(roll) in a frame whose y points down.
    In this frame, whose y points up, pitch and roll change their signs.
    """
    pan = math.radians(pan)
    pitch = math.radians(-pitch)
    roll = math.radians(-roll)
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
    """The arrays that resample a view. (H, W) is the target's size, and (h, w) the window's.

    ``settings`` describes the purpose of the map. ``summary`` has the min, median and max of the
    magnification: target pixels for one source pixel along a line. It also has the fraction of the
    image that has a source (covered). ``window`` is the part of the source that the map reads
    (row, end row, column, end column). Coordinates count in pixels from the window's corner.
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
    # Only if the adaptive filter minifies. `counts` (H, W, 2) uint16 is the number of samples along
    # a pixel's row and column. `footprints` (H, W, 2, 2) float32 is the step from sample to sample.
    # Its first index is x or y, and its second is the row or the column.
    footprints: Array | None = None
    counts: Array | None = None
    # Only for a cube map, whose faces get borders of b pixels: (h + 2b, 6 (h + 2b), 2) float32.
    # For each pixel of the strip with borders, it has the place in the strip without borders. The
    # window is then the whole strip without borders. All other arrays have borders.
    strip: Array | None = None

    @property
    def topology(self) -> Topology:
        """How the source continues beyond its frame.

        The first value says whether the last column is the neighbour of the first. The others say
        whether the first row, and the last row, surround a pole.
        """
        wraps, top, bottom, _ = self.settings["topology"]
        return wraps, top, bottom


def settings(
    source: Lens, target: Lens, source_from_target: Array, filter_name: str, samples: int
) -> dict[str, Any]:
    """Return everything that a lens map depends on, as values of JSON. Each view's key has it."""
    return {
        "source": source.to_lightfield(),
        "target": target.to_lightfield(),
        "rotation": np.asarray(source_from_target, np.float64).tolist(),
        "filter": filter_name,
        "samples": samples,
        "topology": [*_topology(source), len(CUBE_FACES) if isinstance(source, CubeMap) else 1],
    }


def compute(
    source: Lens,
    target: Lens,
    source_from_target: Array,
    filter_name: str = DEFAULT_FILTER,
    samples: int = 1,
) -> LensMap:
    """Compute the map from ``source`` to ``target``, with ``samples`` × ``samples`` for each pixel.

    ``source_from_target`` (3, 3) turns rays of the target camera into the source camera's.
    """
    _check_sampling(filter_name, samples)
    reach = FILTERS[filter_name].reach
    fold = Fold.of_map(source, target, source_from_target)
    points, target_cos, magnification, footprints, counts, areas = _measure_pixels(
        source, target, source_from_target, fold, filter_name
    )
    summary = _summary(fold.unfolded(magnification))
    sample_points, sample_fold = points, fold
    if samples > 1:
        sample_points, areas = _measure_samples(source, target, source_from_target, samples, reach)
        sample_fold = Fold((len(sample_points), sample_points.shape[1]))
    part = _source_part(source, areas, sample_fold, reach)
    if isinstance(source, CubeMap):
        points = _on_strip(points, source, part.border)
    centers = fold.placed(points, part.corner, source)
    coordinates = centers
    if samples > 1:
        coordinates = sample_fold.placed(sample_points, part.corner, source)
    # These are the largest arrays, in float64. Free them early.
    del points, sample_points
    target_cos = fold.unfolded(target_cos)
    has_footprints = len(counts) > 0
    if has_footprints:
        footprints = fold.steps(footprints)
        counts = fold.unfolded(counts)
    lens_map = LensMap(
        settings=settings(source, target, source_from_target, filter_name, samples),
        summary=summary,
        window=part.window,
        centers=centers,
        coordinates=coordinates,
        flags=_flags(coordinates, part.cos, reach, footprints, counts),
        source_cos=part.cos,
        target_cos=target_cos,
        footprints=footprints if has_footprints else None,
        counts=counts if has_footprints else None,
        strip=part.strip,
    )
    # Read-only, as after `load`, so that both cases use the same compiled kernels.
    for array in _arrays(lens_map).values():
        array.flags.writeable = False
    return lens_map


def _check_sampling(filter_name: str, samples: int) -> None:
    """Raise `UserError` for an unknown filter, or a wrong number of samples."""
    if samples < 1:
        raise UserError(f"samples: {samples} must be at least 1")
    if filter_name not in FILTERS:
        raise UserError(f"filter: {filter_name!r} is not one of {', '.join(FILTERS)}")
    if samples > 1 and FILTERS[filter_name].covers:
        raise UserError(
            f"samples: the {filter_name} filter covers the whole pixel already; leave 1"
        )


def _measure_pixels(
    source: Lens, target: Lens, source_from_target: Array, fold: Fold, filter_name: str
) -> tuple[Array, Array, Array, Array, Array, list[Any]]:
    """Measure the target pixels of the fold's part: where each lies in the source, and its extent.

    Returns the points (h, w, 2) float64, cos θ in the target (h, w), and the magnification (h, w).
    Then come the footprints (h, w, 2, 2) and counts (h, w, 2) of `LensMap`, and the `bounds` of
    each strip of rows. Footprints and counts are empty if every pixel takes one sample.
    """
    reach = FILTERS[filter_name].reach
    covers = FILTERS[filter_name].covers
    period = float(source.width) if _topology(source)[0] else 0.0
    # A cube map's face continues by one face at most.
    widest = float(source.height) if isinstance(source, CubeMap) else math.inf
    height, width = fold.part
    # In float64, until they count from the window's corner, which follows from them.
    points = np.empty((height, width, 2))
    target_cos = np.empty((height, width), np.float32)
    magnification = np.empty((height, width), np.float32)
    # Zeros take no memory until something else is written.
    footprints = np.zeros((height, width, 2, 2) if covers else (0, 0, 2, 2), np.float32)
    counts = np.zeros((height, width, 2) if covers else (0, 0, 2), np.uint16)
    largest_count = 1
    areas = []
    for rows in _strips(height, width):
        # One more pixel on every side, for central differences at the border.
        x = np.arange(-1, width + 1) + 0.5
        y = np.arange(rows.start - 1, rows.stop + 1) + 0.5
        rays = target.rays(x[None, :], y[:, None])
        target_cos[rows] = -rays[1:-1, 1:-1, 2]
        padded = source.pixels(rays @ source_from_target.T)
        left, right, above, below = _neighbours(padded, source)
        count = measure(
            padded[1:-1, 1:-1],
            left,
            right,
            above,
            below,
            (source.width, source.height),
            period,
            widest,
            points[rows],
            magnification[rows],
            footprints[rows],
            counts[rows],
        )
        largest_count = max(largest_count, count)
        areas.append(bounds(points[rows], _margin(reach), footprints[rows], counts[rows]))
    if largest_count == 1:
        footprints, counts = footprints[:0], counts[:0]
    return points, target_cos, magnification, footprints, counts, areas


@dataclass(frozen=True)
class _SourcePart:
    """The part of the source that a map reads, with ``window``, ``cos``, ``strip`` of `LensMap`.

    Coordinates count from ``corner`` (x, y). A cube map's faces have borders of ``border`` pixels.
    """

    window: tuple[int, int, int, int]
    corner: tuple[int, int]
    cos: Array
    border: int = 0
    strip: Array | None = None


def _source_part(source: Lens, areas: list[Any], fold: Fold, reach: int) -> _SourcePart:
    """Return the part of the source that a filter reads. ``areas`` are `bounds` of the fold's part.

    For a cube map it is the whole strip, with borders as wide as the filter reaches.
    """
    if isinstance(source, CubeMap):
        border = _margin(reach + max(area[4] for area in areas))
        return _SourcePart(
            window=(0, source.height, 0, source.width),
            corner=(0, 0),
            cos=_face_cosines(source, border),
            border=border,
            strip=_strip_with_borders(source, border),
        )
    window = _window(areas, fold, source)
    return _SourcePart(window, (window[2], window[0]), _cosines(source, window))


def _flags(
    coordinates: Array, source_cos: Array, reach: int, footprints: Array, counts: Array
) -> Array:
    """Return `LensMap.flags`."""
    distance = np.empty(source_cos.shape, np.int32)
    distance_to_missing(source_cos, distance)
    flags = np.empty(coordinates.shape[:2], np.uint8)
    mark(coordinates, distance, reach, footprints, counts, flags)
    return flags


def save(path: Path | str, lens_map: LensMap) -> None:
    """Write a lens map atomically as one .npy record, which `load` can map into memory."""
    arrays = _arrays(lens_map)
    if lens_map.coordinates is lens_map.centers:
        del arrays["coordinates"]
    content = {
        "settings": lens_map.settings,
        "summary": lens_map.summary,
        "window": list(lens_map.window),
    }
    checksum = _checksum(content, arrays)
    description = json.dumps(content | {"checksum": checksum}).encode()
    dtype = np.dtype(
        [("description", f"S{_HEADER}")]
        + [(name, array.dtype, array.shape) for name, array in arrays.items()]
    )
    with atomic_path(path) as temporary:
        record = np.empty(1, dtype)
        record["description"] = description
        for name, array in arrays.items():
            record[name][0] = array
        with temporary.open("wb") as file:
            np.save(file, record)
        try:
            # NumPy does not report an error when it closes the file, so check the result.
            np.load(temporary, mmap_mode="r")
        except ValueError as error:
            raise OSError(f"the file is cut short: {error}") from None


def load(path: Path | str) -> LensMap:
    """Map a file of `save` into memory, read-only. Raises `UserError` for any other file."""
    try:
        check_readable(path)
        record = np.load(path, mmap_mode="r")
        description = json.loads(bytes(record["description"][0]))
        arrays = {name: record[name][0] for name in record.dtype.names if name != "description"}
        if description.pop("checksum") != _checksum(description, arrays):
            raise ValueError("it is damaged: its checksum does not hold")
        arrays.setdefault("coordinates", arrays["centers"])
        return LensMap(
            settings=description["settings"],
            summary=description["summary"],
            window=tuple(description["window"]),
            **arrays,
        )
    except OSError as error:
        raise read_error(path, error) from None
    except (EOFError, SyntaxError, TokenError, *DAMAGE) as error:
        raise UserError(
            f"{path}: is not a lens map that can be read: {error}; delete it, and the next run "
            "makes it again"
        ) from None


def _checksum(description: Mapping[str, Any], arrays: Mapping[str, Array]) -> int:
    """Return the CRC-32 of a lens map's description and arrays, which detects damage cheaply."""
    checksum = zlib.crc32(json.dumps(description, sort_keys=True).encode())
    for name in sorted(arrays):
        checksum = zlib.crc32(
            np.ascontiguousarray(arrays[name]).reshape(-1).view(np.uint8).data, checksum
        )
    return checksum


def _arrays(lens_map: LensMap) -> dict[str, Array]:
    """Return the arrays by name. The largest items come first, so that all are aligned."""
    arrays = {
        name: array for name, array in vars(lens_map).items() if isinstance(array, np.ndarray)
    }
    return dict(sorted(arrays.items(), key=lambda item: -item[1].itemsize))


def warnings(lens_map: LensMap) -> list[str]:
    """Return the warnings about the map's magnification: upsampling and aliasing."""
    if not lens_map.summary["covered"]:
        return ["the source sees nothing of the target image"]
    largest, smallest = lens_map.summary["max"], lens_map.summary["min"]
    if not smallest:
        return []
    texts = []
    if largest > 1.5:
        texts.append(
            f"upsampling: up to {largest:.3g} target pixels to one of the source (median "
            f"{lens_map.summary['median']:.3g}); a smaller --scale or field of view helps"
        )
    steps = math.ceil(1 / smallest)
    samples = lens_map.settings["samples"]
    if not FILTERS[lens_map.settings["filter"]].covers and samples * 1.5 * smallest < 1:
        texts.append(
            f"aliasing: one target pixel spans up to {1 / smallest:.3g} of the source's; "
            f"--filter adaptive or --samples {steps} helps"
        )
    return texts


def report(lens_maps: Sequence[LensMap]) -> None:
    """Print the magnification and the warnings to standard error, once for all targets."""
    summaries = [lens_map.summary for lens_map in lens_maps]
    with_source = [summary for summary in summaries if summary["covered"]] or summaries
    overall = {
        "min": min(summary["min"] for summary in with_source),
        "max": max(summary["max"] for summary in with_source),
        "median": float(np.median([summary["median"] for summary in with_source])),
        "covered": float(np.mean([summary["covered"] for summary in summaries])),
    }
    print(
        f"magnification: {overall['min']:.3g} to {overall['max']:.3g}, "
        f"median {overall['median']:.3g} target pixels to one of the source; "
        f"{overall['covered']:.1%} of the image has a source",
        file=sys.stderr,
    )
    for warning in warnings(replace(lens_maps[0], summary=overall)):
        print(f"warning: {warning}", file=sys.stderr)


def _summary(magnification: Array) -> dict[str, float]:
    """Return `LensMap.summary` of a magnification (H, W), which is NaN without a source."""
    # A pixel without any neighbour has an infinite magnification.
    finite: Array = magnification[np.isfinite(magnification)]
    if not finite.size:
        finite = np.zeros(1)
    return {
        "min": float(finite.min()),
        "median": float(np.median(finite)),
        "max": float(finite.max()),
        "covered": float(1 - np.isnan(magnification).mean()),
    }


def _topology(source: Lens) -> Topology:
    """Derive `LensMap.topology` from the source's rays."""
    if isinstance(source, CubeMap):
        return False, False, False
    height = np.array([0.25, 0.5, 0.75]) * source.height
    width = np.array([0.0, 0.4, 0.8]) * source.width
    left, middle, right = (source.rays(x * source.width, height) for x in (0.0, 0.5, 1.0))
    # The edges of a narrow lens are also near each other, but not nearer than its middle.
    wraps = bool(np.abs(left - right).max() < 1e-5 * np.abs(left - middle).max())
    ends = [source.rays(width, np.full(3, y)) for y in (0.0, float(source.height))]
    top, bottom = (wraps and bool(np.allclose(rays, rays[0], atol=1e-5)) for rays in ends)
    return wraps, top, bottom


def _strips(height: int, width: int) -> Iterator[slice]:
    """Yield an image's rows in strips that fit into the caches."""
    step = max(_STRIP // width, 4)
    for first in range(0, height, step):
        yield slice(first, min(first + step, height))


def _cosines(lens: Lens, window: tuple[int, int, int, int]) -> Array:
    """Return cos θ (h, w) float32 at a window's pixel centres. NaN where there is no ray."""
    row, end_row, column, end_column = window
    down, across = lens.mirrors
    fold = Fold(
        (end_row - row, end_column - column),
        (down and row + end_row == lens.height, across and column + end_column == lens.width),
    )
    part = np.empty(fold.part, np.float32)
    x = np.arange(column, column + part.shape[1]) + 0.5
    for rows in _strips(*part.shape):
        y = np.arange(row + rows.start, row + rows.stop) + 0.5
        part[rows] = -lens.rays(x[None, :], y[:, None])[..., 2]
    return fold.unfolded(part)


def _strip_with_borders(source: CubeMap, border: int) -> Array:
    """Return `LensMap.strip`."""
    places = np.arange(-border, source.height + border) + 0.5
    rays = source.face.rays(places[None, :], places[:, None])
    faces = [source.pixels(rays @ rotation.T) for rotation in CUBE_FACES.values()]
    exact = np.concatenate(faces, axis=1)
    strip = exact.astype(np.float32)
    # Rounding must not move a pixel to the strip's next face, which is not a neighbour in space.
    end = ((np.floor(exact[..., 0] / source.height) + 1) * source.height).astype(np.float32)
    strip[..., 0] = np.minimum(strip[..., 0], np.nextafter(end, np.float32(0)))
    return strip


def _face_cosines(source: CubeMap, border: int) -> Array:
    """Return cos θ from each face's axis, in the strip with borders. Borders repeat the edge."""
    places = np.arange(source.height) + 0.5
    cosines = -source.face.rays(places[None, :], places[:, None])[..., 2]
    return np.asarray(np.tile(np.pad(cosines.astype(np.float32), border, mode="edge"), 6))


def _measure_samples(
    source: Lens, target: Lens, source_from_target: Array, samples: int, reach: int
) -> tuple[Array, list[Any]]:
    """Return the source coordinates of n × n samples for each pixel, and their bounds.

    They are in float32 from the start, because they take n² times the memory of pixels.
    """
    height = target.height * samples
    width = target.width * samples
    fine = np.empty((height, width, 2), np.float32)
    x = (np.arange(width) + 0.5) / samples
    no_footprints = np.zeros((0, 0, 2, 2), np.float32)
    no_counts = np.zeros((0, 0, 2), np.uint16)
    areas = []
    for rows in _strips(height, width):
        y = (np.arange(rows.start, rows.stop) + 0.5) / samples
        pixels = source.pixels(target.rays(x[None, :], y[:, None]) @ source_from_target.T)
        inside = (pixels >= 0) & (pixels <= [source.width, source.height])
        if isinstance(source, CubeMap):
            pixels = _on_strip(pixels, source, _margin(reach))
        fine[rows] = np.where(inside.all(axis=-1, keepdims=True), pixels, np.nan)
        areas.append(bounds(fine[rows], _margin(reach), no_footprints, no_counts))
    return fine, areas


def _margin(reach: int) -> int:
    """Return how many pixels are read at most on each side of a sample's own, or of its face."""
    # Depth reads two pixels on each side of a ray's own, whatever the filter.
    return max(reach + 1, 2)


def _on_strip(pixels: Array, source: CubeMap, border: int) -> Array:
    """Convert coordinates from the strip of faces to the strip with borders."""
    face = np.floor(pixels[..., 0] / source.height)
    shift = np.stack([(2 * face + 1) * border, np.full_like(face, border)], axis=-1)
    return np.asarray(pixels + shift)


def _neighbours(padded: Array, source: Lens) -> tuple[Array, ...]:
    """Return the coordinates left, right, above and below each pixel of ``padded``'s inside.

    ``padded`` has a border of one pixel. Neighbours on another face of a cube map are continued
    onto the plane of the pixel's own face.
    """
    middle = padded[1:-1, 1:-1]
    around = (padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1])
    if not isinstance(source, CubeMap):
        return around
    return tuple(_on_face_of(source, beside, middle) for beside in around)


def _on_face_of(source: CubeMap, coordinates: Array, middle: Array) -> Array:
    """Continue ``coordinates`` on another face than ``middle`` onto the plane of its face."""
    out = coordinates.copy()
    face_of_middle = np.floor(middle[..., 0] / source.height)
    face = np.floor(coordinates[..., 0] / source.height)
    for index, rotation in enumerate(CUBE_FACES.values()):
        on_other_face = (face_of_middle == index) & (face != index)
        rays = source.rays(out[on_other_face, 0], out[on_other_face, 1]) @ rotation
        out[on_other_face] = source.face.pixels(rays) + np.array([index * source.height, 0])
    return out


def _window(areas: list[Any], fold: Fold, source: Lens) -> tuple[int, int, int, int]:
    """Return the rows and columns [row, end) × [column, end) that the filter may read.

    ``areas`` are the `bounds` of the fold's part. A source that wraps around needs all its columns.
    """
    limits = np.array([area[:4] for area in areas])
    low = limits[:, :2].min(axis=0)
    high = limits[:, 2:].max(axis=0)
    if np.isinf(low).any():
        return 0, 1, 0, 1
    size = np.array([source.width, source.height])
    low = np.where(fold.mirrors[::-1], np.minimum(low, size - high), low)
    high = np.where(fold.mirrors[::-1], size - low, high)
    left, top = (int(start) for start in np.clip(np.floor(low), 0, size - 1))
    right, bottom = (int(end) for end in np.clip(np.ceil(high), 1, size))
    if _topology(source)[0]:
        left = 0
        right = source.width
    return top, bottom, left, right
