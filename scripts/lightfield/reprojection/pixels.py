"""Reads a view's pixels as linear light, resamples them, and writes them in each format."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.depth import depth_meaning
from lightfield.geometry.depth import in_16_bits, with_precision
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging.alpha import divisor
from lightfield.imaging.halves import narrow, widen
from lightfield.imaging.images import (
    DEPTH_ATTRIBUTE,
    KEY_ATTRIBUTE,
    UNSHOWN_ATTRIBUTE,
    Attribute,
    Header,
    read_header,
    read_image,
    write_png,
)
from lightfield.imaging.primaries import PRIMARIES, are_rec_709, from_rec_709, to_rec_709
from lightfield.imaging.sensor import Sensed, SensorParameters, sense
from lightfield.imaging.tonemap import decode_srgb, to_8_bit, to_16_bit, tone_map
from lightfield.reprojection.colour import colour_strips
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.geometry import Target
from lightfield.reprojection.job import Light, ReprojectionJob, SourceView
from lightfield.reprojection.lens_map import LensMap
from lightfield.workflow import shard_log

Attributes = Mapping[str, Attribute]

# Level 4, and libpng's PNG_FILTER_AVG for every row. The defaults are zlib's level, and a choice of
# filter for each row: they take seven times as long, and the files are no smaller.
_PNG_OPTIONS = {"png:compressionLevel": 4, "png:filter": 64}


@dataclass(frozen=True)
class _Face:
    """One image file of a view: the whole view, or one face of a cube map.

    ``colour`` (h, w, 4) is linear float32. ``meaning`` says whether ``depth`` (h, w) is "z" or
    "distance". None if nothing says so. ``unshown`` is the header's `UNSHOWN_ATTRIBUTE`.
    """

    colour: Array
    depth: Array | None
    has_alpha: bool
    meaning: str | None
    unshown: Attribute | None


class SourcePixels:
    """The part of a view's pixels that its targets need, linear and in float32."""

    def __init__(
        self, job: ReprojectionJob, view: SourceView, windows: list[tuple[int, int, int, int]]
    ) -> None:
        low = np.min(windows, axis=0)
        high = np.max(windows, axis=0)
        self.rows = (int(low[0]), int(high[1]))
        self.columns = (int(low[2]), int(high[3]))
        self._job = job
        self._view = view
        faces = [self._read(job, path) for path in view.paths]
        self.colour = _side_by_side([face.colour for face in faces])
        depths = [face.depth for face in faces if face.depth is not None]
        self.depth = _side_by_side(depths) if len(depths) == len(faces) else None
        self.has_alpha = faces[0].has_alpha
        self.is_z = (faces[0].meaning or job.source.usual_depth) == "z"
        self.unshown = faces[0].unshown
        self.is_relit = False

    def light_up(self, light: Light) -> None:
        """Replace the colour by the sum of the light groups with the weights of a light."""
        if light.weights is None:
            return
        self.is_relit = True
        total = np.zeros((*self.colour.shape[:2], 3), np.float32)
        for group, weights in light.weights.items():
            if any(weights):
                path = self._job.group_path(self._view, group)
                _check_size(path, read_header(path), self._job.source)
                pixels = read_image(path, "RGB", self.rows).colour[:, slice(*self.columns)]
                total += pixels * np.array(weights, np.float32)
        # Pixels without a source stay so.
        self.colour[..., :3] = np.where(np.isnan(self.colour[..., :3]), np.nan, total)

    def _read(self, job: ReprojectionJob, path: Path) -> _Face:
        lens = job.source.face if isinstance(job.source, CubeMap) else job.source
        header = read_header(path)
        _check_size(path, header, lens)
        names = header.channels
        colours = "RGB" if {"R", "G", "B"} <= set(names) else "YYY"
        if colours[0] not in names:
            raise UserError(f"{path}: has no colour: its channels are {', '.join(names)}")
        needed = {*colours, "A"}
        if job.needs_depth:
            needed.add("Z")
        image = read_image(path, [name for name in names if name in needed], self.rows)
        columns = slice(*self.columns)
        channels = {name: array[:, columns] for name, array in image.channels.items()}
        alpha = channels.get("A")
        depth = channels.get("Z")
        colour = _linear([channels[name] for name in colours], alpha)
        if not are_rec_709(image.chromaticities):
            colour[:, :, :3] = to_rec_709(colour[:, :, :3], image.chromaticities)
        if alpha is not None and not job.lightfield.transparent:
            # A fully transparent pixel has no colour to resample.
            colour[alpha == 0] = np.nan
        if depth is not None and depth.dtype != np.float16:
            depth = depth.astype(np.float32, copy=False)
        return _Face(
            colour,
            depth,
            alpha is not None,
            depth_meaning(image.attributes, job.lightfield),
            image.attributes.get(UNSHOWN_ATTRIBUTE),
        )

    def window(self, lens_map: LensMap) -> tuple[Array, Array | None]:
        """Return the colour and depth that a lens map reads."""
        row, end_row, column, end_column = lens_map.window
        rows = slice(row - self.rows[0], end_row - self.rows[0])
        columns = slice(column - self.columns[0], end_column - self.columns[0])
        colour = np.ascontiguousarray(self.colour[rows, columns])
        return colour, None if self.depth is None else self.depth[rows, columns]


def _check_size(path: Path, header: Header, lens: Lens) -> None:
    """Raise `UserError` if an image has not the size of a lens."""
    if (header.width, header.height) != (lens.width, lens.height):
        raise UserError(
            f"{path}: has {header.width} × {header.height} pixels; "
            f"the lens expects {lens.width} × {lens.height}"
        )


def _side_by_side(faces: list[Array]) -> Array:
    """Return a cube map's faces as one strip, or the only image of another lens."""
    return faces[0] if len(faces) == 1 else np.concatenate(faces, axis=1)


def _linear(planes: list[Array], alpha: Array | None) -> Array:
    """Return pixels as (h, w, 4) float32 linear R G B A. Colour is associated with alpha."""
    if planes[0].dtype.kind == "u":
        largest = np.iinfo(planes[0].dtype).max
        table = decode_srgb(np.arange(largest + 1) / largest).astype(np.float32)
        planes = [table[plane] for plane in planes]
        if alpha is not None:
            alpha = alpha.astype(np.float32) / np.float32(largest)
            planes = [plane * alpha for plane in planes]
    red, green, blue = planes
    return widen(red, green, blue, alpha)


def write(
    job: ReprojectionJob,
    view: SourceView,
    target: Target,
    light: Light,
    lens_map: LensMap,
    source: SourcePixels,
    key: str,
) -> None:
    """Resample a view in one of the lights through one lens map, and write its files."""
    outputs = job.outputs(view, target, light)
    parameters = job.sensor_parameters(view, target)
    if job.lightfield.transparent and not source.has_alpha:
        raise UserError("has no channel A, although --input-cfg says that it is transparent")
    image = _developed(job, target, lens_map, source, outputs, parameters)
    attributes: dict[str, Attribute] = {KEY_ATTRIBUTE: key}
    for name, value in job.published.items():
        attributes[f"plenoforge:{name}"] = str(value)
    if job.look:
        attributes["plenoforge:look"] = job.look.header
    if "exr" in outputs and image.depth is not None:
        attributes[DEPTH_ATTRIBUTE] = target.lens.usual_depth
        if source.unshown is not None:
            attributes[UNSHOWN_ATTRIBUTE] = source.unshown
    for kind, path in outputs.items():
        match kind:
            case "exr":
                _write_exr(job, path, image, attributes)
            case "png":
                _write_png(path, image, {**attributes, **_PNG_OPTIONS})
            case "depth":
                assert job.settings.depth_png is not None
                lost = _write_depth(path, image, job.settings.depth_png, key)
                job.lost_depths.append(lost)
            case "mask":
                mask = np.where(image.empty, 255, 0).astype(np.uint8)
                write_png(path, mask, {KEY_ATTRIBUTE: key})
            case _:
                assert parameters and image.sensed
                look = {"look": job.look.to_json()} if job.look else {}
                described = {"key": key, **parameters.to_json(), **look}
                _write_of_sensor(job, kind, path, image.sensed, described)
        shard_log.add(path, key)


@dataclass(frozen=True)
class _Image:
    """A resampled view, as its files hold it.

    ``half`` (3, h, w) is float16 R G B for an EXR. ``pixels`` (h, w, 3) is sRGB for a PNG.
    ``alpha`` (h, w) is float32, and ``depth`` (h, w) is in metres. ``empty`` (h, w) marks pixels
    without a source. ``sensed`` is what the sensor sees, if there is one.
    """

    half: Array
    pixels: Array
    alpha: Array
    depth: Array | None
    empty: Array
    transparent: bool
    sensed: Sensed | None = None

    @property
    def has_empty(self) -> bool:
        return bool(self.empty.any())


def _developed(
    job: ReprojectionJob,
    target: Target,
    lens_map: LensMap,
    source: SourcePixels,
    outputs: Mapping[str, Path],
    parameters: SensorParameters | None,
) -> _Image:
    """Resample a view, and develop its colour for the ``outputs`` that hold colour.

    ``parameters`` describe the sensor, if there is one.
    """
    settings = job.settings
    transparent = job.lightfield.transparent
    encode = to_8_bit if settings.bits == 8 else to_16_bit
    strips, depth = _resampled(job, lens_map, source, target.lens.usual_depth == "z")
    size = lens_map.target_cos.shape
    empty = np.empty(size, bool)
    half = np.empty((3, *size), np.float16)
    pixels = np.empty((*size, 3), f"uint{settings.bits}")
    covered = np.empty(size, np.float32)
    light = np.empty((*size, 3) if parameters else (0,), np.float32)
    for rows, strip in strips:
        empty[rows] = np.isnan(strip[:, :, 0])
        alpha = strip[:, :, 3:]
        if transparent:
            covered[rows] = alpha[:, :, 0].clip(0, 1)
            alpha = divisor(covered[rows])[:, :, None]
        if source.has_alpha:
            with np.errstate(invalid="ignore", divide="ignore"):
                strip[:, :, :3] /= alpha
        if parameters:
            light[rows] = strip[:, :, :3]
            continue
        if job.look:
            covering = alpha if transparent else None
            pixels[rows] = job.look.to_pixels(strip[:, :, :3], settings.bits, covering)
            continue
        colour = tone_map(strip[:, :, :3], settings.exposure, settings.reinhard)
        if "png" in outputs:
            pixels[rows] = encode(colour)
        if "exr" in outputs:
            stored = colour * alpha if transparent else colour
            narrow(from_rec_709(stored, settings.primaries or "rec709"), half[:, rows])
    if empty.any():
        covered[empty] = 0
        half[:, empty] = 0
        pixels[empty] = 0
        if depth is not None:
            depth[empty] = np.nan
    if parameters:
        sensed = _sensed(sense(light, parameters, "weights" in outputs, job.look), empty)
        return _Image(half, sensed.pixels, covered, depth, empty, transparent, sensed)
    return _Image(half, pixels, covered, depth, empty, transparent)


def _sensed(sensed: Sensed, empty: Array) -> Sensed:
    """Return what a sensor sees, with pixels without a source as 0."""
    for pixels in (sensed.pixels, sensed.clipped, sensed.weights):
        if pixels is not None:
            pixels[empty] = 0
    return sensed


def _write_of_sensor(
    job: ReprojectionJob, kind: str, path: Path, sensed: Sensed, parameters: dict[str, Any]
) -> None:
    """Write a file that lies beside the PNG of a sensor. ``parameters`` have the view's key."""
    key = parameters["key"]
    match kind:
        case "parameters":
            write_json(path, parameters)
        case "clipped":
            write_png(path, sensed.clipped, {KEY_ATTRIBUTE: key, **_PNG_OPTIONS})
        case "weights":
            assert sensed.weights is not None
            planes = np.moveaxis(sensed.weights, -1, 0)
            job.write_exr(path, dict(zip("RGB", planes, strict=True)), {KEY_ATTRIBUTE: key})


def _write_exr(job: ReprojectionJob, path: Path, image: _Image, attributes: Attributes) -> None:
    """Write R G B and Z. Write A if the view is transparent, or if no Z marks empty pixels."""
    channels = dict(zip("RGB", image.half, strict=True))
    if image.depth is not None:
        channels["Z"] = image.depth
    if image.transparent:
        channels["A"] = image.alpha.astype(np.float16)
    elif image.depth is None and image.has_empty:
        channels["A"] = (~image.empty).astype(np.float16)
    # Without an attribute, readers take R G B for Rec. 709.
    primaries = job.settings.primaries
    job.write_exr(path, channels, attributes, PRIMARIES[primaries] if primaries else None)


def _write_png(path: Path, image: _Image, attributes: Attributes) -> None:
    pixels = image.pixels
    if image.transparent or image.has_empty:
        alpha = image.alpha if image.transparent else (~image.empty).astype(np.float32)
        alpha = np.rint(alpha * np.iinfo(pixels.dtype).max).astype(pixels.dtype)
        pixels = np.dstack([pixels, alpha])
    write_png(path, pixels, attributes)


def _write_depth(path: Path, image: _Image, scale: float, key: str) -> int:
    """Write depth times ``scale`` in 16 bits, with 0 for none. Return how many depths are lost."""
    if image.depth is None:
        raise UserError("--depth-png: the image has no channel Z")
    steps, lost = in_16_bits(image.depth.astype(np.float64) * scale)
    write_png(path, steps, {KEY_ATTRIBUTE: key})
    return lost


def _resampled(
    job: ReprojectionJob, lens_map: LensMap, source: SourcePixels, as_z: bool
) -> tuple[Iterable[tuple[slice, Array]], Array | None]:
    """Return the target's colour, in strips, and its depth in the source's precision."""
    colour, depth = source.window(lens_map)
    if job.copies and source.is_z == as_z:
        row, end_row, column, end_column = lens_map.window
        # As in resampling, a pixel with NaN in one channel is empty.
        empty = np.isnan(colour).any(axis=-1)
        empty |= np.isnan(lens_map.target_cos[row:end_row, column:end_column])
        colour = np.where(empty[:, :, None], np.float32(np.nan), colour)
        copied_depth = None if depth is None else _in_frame(depth, lens_map)
        return [(np.s_[:], _in_frame(colour, lens_map))], copied_depth
    if depth is not None:
        depth = resample_depth(depth, source.is_z, as_z, lens_map)
        if depth.dtype != np.float16:
            depth = with_precision(depth, job.depth_precision)
    return colour_strips(colour, lens_map), depth


def _in_frame(window: Array, lens_map: LensMap) -> Array:
    """Return the target's whole image with the window's pixels in place, and NaN around them."""
    out = np.full((*lens_map.target_cos.shape, *window.shape[2:]), np.nan, window.dtype)
    row, end_row, column, end_column = lens_map.window
    out[row:end_row, column:end_column] = window
    return out
