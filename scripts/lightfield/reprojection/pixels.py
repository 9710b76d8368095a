"""A view's pixels in and out: read as linear light, resampled, and written as asked for."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.depth import with_precision
from lightfield.geometry.lenses import Array
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging.halves import narrow, widen
from lightfield.imaging.images import (
    DEPTH_ATTRIBUTE,
    KEY_ATTRIBUTE,
    Attribute,
    read_header,
    read_image,
    write_exr,
    write_png,
)
from lightfield.imaging.tonemap import decode_srgb, to_8_bit, to_16_bit, tone_map
from lightfield.reprojection.colour import colour_strips
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.geometry import Target
from lightfield.reprojection.job import Job, SourceView
from lightfield.reprojection.lens_map import LensMap

Attributes = Mapping[str, Attribute]

# A seventh of the time that zlib's own level and the choice of a filter for each row take, and
# files as small: level 4, and libpng's PNG_FILTER_AVG for every row.
PNG_OPTIONS = {"png:compressionLevel": 4, "png:filter": 64}


class SourcePixels:
    """The part of a view's pixels that its targets need, linear and in float32."""

    def __init__(
        self, job: Job, view: SourceView, windows: list[tuple[int, int, int, int]]
    ) -> None:
        low = np.min(windows, axis=0)
        high = np.max(windows, axis=0)
        self.rows = (int(low[0]), int(high[1]))
        self.columns = (int(low[2]), int(high[3]))
        faces = [self._read(job, path) for path in view.paths]
        self.colour = _side_by_side([face[0] for face in faces])
        depths = [face[1] for face in faces if face[1] is not None]
        self.depth = _side_by_side(depths) if len(depths) == len(faces) else None
        self.has_alpha = faces[0][2]
        # The file knows best; the configuration may be another program's.
        meaning = faces[0][3] or job.lightfield.depth or job.source.usual_depth
        self.is_z = meaning == "z"

    def _read(self, job: Job, path: Path) -> tuple[Array, Array | None, bool, Attribute | None]:
        lens = job.source.face if isinstance(job.source, CubeMap) else job.source
        header = read_header(path)
        if (header.width, header.height) != (lens.width, lens.height):
            raise UserError(
                f"{path}: has {header.width} × {header.height} pixels; "
                f"the lens expects {lens.width} × {lens.height}"
            )
        names = header.channels
        colours = "RGB" if {"R", "G", "B"} <= set(names) else "YYY"
        if colours[0] not in names:
            raise UserError(f"{path}: has no colour: its channels are {', '.join(names)}")
        wanted = {*colours, "A", "Z"} if job.depth_wanted else {*colours, "A"}
        image = read_image(path, [name for name in names if name in wanted], self.rows)
        columns = slice(*self.columns)
        channels = {name: array[:, columns] for name, array in image.channels.items()}
        alpha, depth = channels.get("A"), channels.get("Z")
        colour = _linear([channels[name] for name in colours], alpha)
        if alpha is not None and not job.lightfield.transparent:
            # What is wholly transparent is no sample.
            colour[alpha == 0] = np.nan
        if depth is not None and depth.dtype != np.float16:
            depth = depth.astype(np.float32, copy=False)
        return colour, depth, alpha is not None, image.attributes.get(DEPTH_ATTRIBUTE)

    def window(self, lens_map: LensMap) -> tuple[Array, Array | None]:
        """Return the colour and depth that a lens map reads."""
        row, end_row, column, end_column = lens_map.window
        rows = slice(row - self.rows[0], end_row - self.rows[0])
        columns = slice(column - self.columns[0], end_column - self.columns[0])
        colour = np.ascontiguousarray(self.colour[rows, columns])
        return colour, None if self.depth is None else self.depth[rows, columns]


def _side_by_side(faces: list[Array]) -> Array:
    """Return a cube map's faces as one strip; the one image of another lens as it is."""
    return faces[0] if len(faces) == 1 else np.concatenate(faces, axis=1)


def _linear(planes: list[Array], alpha: Array | None) -> Array:
    """Return pixels as (h, w, 4) float32 linear R G B A, colour associated with alpha."""
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
    job: Job,
    target: Target,
    lens_map: LensMap,
    source: SourcePixels,
    outputs: Mapping[str, Path],
    key: str,
) -> None:
    """Resample a view through one lens map and write its files."""
    if job.lightfield.transparent and not source.has_alpha:
        raise UserError("has no channel A, although --input-cfg says that it is transparent")
    image = _developed(job, target, lens_map, source, outputs)
    attributes = {KEY_ATTRIBUTE: key} | {
        f"plenoforge:{name}": str(value) for name, value in job.settings.published.items()
    }
    if "exr" in outputs and image.depth is not None:
        attributes[DEPTH_ATTRIBUTE] = target.lens.usual_depth
    for kind, path in outputs.items():
        match kind:
            case "exr":
                _write_exr(path, image, attributes)
            case "png":
                _write_png(path, image, {**attributes, **PNG_OPTIONS})
            case "depth":
                assert job.settings.depth_png is not None
                _write_depth(path, image, job.settings.depth_png, key)
            case "mask":
                mask = np.where(image.empty, 255, 0).astype(np.uint8)
                write_png(path, mask, {KEY_ATTRIBUTE: key})
        job.record.add(path, key)


@dataclass(frozen=True)
class _Image:
    """A resampled view, as its files hold it.

    ``half`` (3, h, w) is float16 R G B for an EXR, ``pixels`` (h, w, 3) sRGB for a PNG, ``alpha``
    (h, w) float32 what is covered, and ``depth`` (h, w) metres. What has no source is ``empty``.
    """

    half: Array
    pixels: Array
    alpha: Array
    depth: Array | None
    empty: Array
    transparent: bool

    @property
    def has_empty(self) -> bool:
        return bool(self.empty.any())


def _developed(
    job: Job, target: Target, lens_map: LensMap, source: SourcePixels, outputs: Mapping[str, Path]
) -> _Image:
    """Resample a view, and develop its colour for those ``outputs`` that hold it."""
    settings = job.settings
    transparent = job.lightfield.transparent
    encode = to_8_bit if settings.bits == 8 else to_16_bit
    strips, depth = _resampled(job, lens_map, source, target.lens.has_z_depth)
    size = lens_map.target_cos.shape
    empty = np.empty(size, bool)
    half = np.empty((3, *size), np.float16)
    pixels = np.empty((*size, 3), f"uint{settings.bits}")
    covered = np.empty(size, np.float32)
    for rows, strip in strips:
        empty[rows] = np.isnan(strip[:, :, 0])
        alpha = strip[:, :, 3:]
        if transparent:
            covered[rows] = alpha[:, :, 0].clip(0, 1)
            # Where there is light alone, nothing is covered.
            alpha = np.where(covered[rows] > 0, covered[rows], np.float32(1))[:, :, None]
        if source.has_alpha:
            with np.errstate(invalid="ignore", divide="ignore"):
                strip[:, :, :3] /= alpha
        colour = tone_map(strip[:, :, :3], settings.exposure, settings.reinhard)
        if "png" in outputs:
            pixels[rows] = encode(colour)
        if "exr" in outputs:
            half[:, rows] = narrow(colour * alpha if transparent else colour, 3)
    if empty.any():
        covered[empty] = 0
        half[:, empty] = 0
        if depth is not None:
            depth[empty] = np.nan
    return _Image(half, pixels, covered, depth, empty, transparent)


def _write_exr(path: Path, image: _Image, attributes: Attributes) -> None:
    """Write R G B and Z, and A where the view is transparent or no Z tells what is empty."""
    channels = dict(zip("RGB", image.half, strict=True))
    if image.depth is not None:
        channels["Z"] = image.depth
    if image.transparent:
        channels["A"] = image.alpha.astype(np.float16)
    elif image.depth is None and image.has_empty:
        channels["A"] = (~image.empty).astype(np.float16)
    write_exr(path, channels, attributes)


def _write_png(path: Path, image: _Image, attributes: Attributes) -> None:
    pixels = image.pixels
    if image.transparent or image.has_empty:
        alpha = image.alpha if image.transparent else (~image.empty).astype(np.float32)
        alpha = np.rint(alpha * np.iinfo(pixels.dtype).max).astype(pixels.dtype)
        pixels = np.dstack([pixels, alpha])
    write_png(path, pixels, attributes)


def _write_depth(path: Path, image: _Image, scale: float, key: str) -> None:
    """Write 16 bits of depth times ``scale``; 0 where there is none, or more than they hold."""
    if image.depth is None:
        raise UserError("--depth-png: the image has no channel Z")
    scaled = np.rint(image.depth.astype(np.float64) * scale)
    # Comparisons with NaN are false.
    is_held = (scaled > 0) & (scaled <= 65535)
    write_png(path, np.where(is_held, scaled, 0).astype(np.uint16), {KEY_ATTRIBUTE: key})


def _resampled(
    job: Job, lens_map: LensMap, source: SourcePixels, as_z: bool
) -> tuple[Iterable[tuple[slice, Array]], Array | None]:
    """Return the target's colour, in strips, and its depth in the source's precision."""
    colour, depth = source.window(lens_map)
    if job.copies and source.is_z == as_z:
        row, end_row, column, end_column = lens_map.window
        # A channel that is no number makes a pixel none, as it does where pixels are resampled.
        none = np.isnan(colour).any(axis=-1)
        none |= np.isnan(lens_map.target_cos[row:end_row, column:end_column])
        colour = np.where(none[:, :, None], np.float32(np.nan), colour)
        copy = None if depth is None else _in_frame(depth, lens_map)
        return [(np.s_[:], _in_frame(colour, lens_map))], copy
    if depth is not None:
        depth = resample_depth(depth, source.is_z, as_z, lens_map)
        if depth.dtype != np.float16:
            depth = with_precision(depth, job.depth_precision)
    return colour_strips(colour, lens_map), depth


def _in_frame(window: Array, lens_map: LensMap) -> Array:
    """Return the window's pixels in their place in the whole image, NaN around them."""
    out = np.full((*lens_map.target_cos.shape, *window.shape[2:]), np.nan, window.dtype)
    row, end_row, column, end_column = lens_map.window
    out[row:end_row, column:end_column] = window
    return out
