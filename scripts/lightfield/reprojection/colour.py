"""Resamples colour through a lens map."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.lenses import Array
from lightfield.reprojection import kernels
from lightfield.reprojection.lens_map import LensMap

# The kernel of each filter that fills one output pixel for each sample. kernels.py explains their
# arguments. OpenImageIO does this for st_warp.
_SAMPLE = {
    "nearest": kernels.nearest,
    "bilinear": kernels.interpolating(kernels.linear_weights),
    "bicubic": kernels.interpolating(kernels.cubic_weights),
    "lanczos": kernels.interpolating(kernels.lanczos_weights),
    "adaptive": kernels.interpolating(kernels.cubic_weights),
}
# The kernel of each filter that averages as many samples as cover the whole pixel.
_COVER = {"adaptive": kernels.covering(kernels.cubic_weights)}

_STRIP = 64  # rows, or rows of samples, resampled at a time


def resample_colour(source: Array, lens_map: LensMap) -> Array:
    """Resample a source window (h, w, 4) float32 to (H, W, 4). NaN where it has no source."""
    out = np.empty((*lens_map.target_cos.shape, 4), np.float32)
    for rows, strip in colour_strips(source, lens_map):
        out[rows] = strip
    return out


def colour_strips(source: Array, lens_map: LensMap) -> Iterator[tuple[slice, Array]]:
    """Yield the result of `resample_colour` in strips of rows that fit into the caches."""
    height, width = lens_map.target_cos.shape
    source = _with_borders(source, lens_map)
    valid = lens_map.source_cos
    topology = lens_map.topology
    if source.shape[:2] != valid.shape:
        raise UserError(
            f"the source window has {source.shape[1]} × {source.shape[0]} pixels and the lens map "
            f"expects {valid.shape[1]} × {valid.shape[0]}"
        )
    samples = lens_map.settings["samples"]
    filter_name = lens_map.settings["filter"]
    if filter_name == "st_warp":
        yield slice(0, height), _st_warp(source, lens_map)
        return
    step = max(1, _STRIP // samples)
    for first in range(0, height, step):
        rows = slice(first, min(first + step, height))
        fine = slice(rows.start * samples, rows.stop * samples)
        coordinates = lens_map.coordinates[fine]
        flags = lens_map.flags[fine]
        out = np.empty((*flags.shape, 4), np.float32)
        if (
            filter_name in _COVER
            and lens_map.footprints is not None
            and lens_map.counts is not None
        ):
            footprints = lens_map.footprints[rows]
            counts = lens_map.counts[rows]
            _COVER[filter_name](
                source, valid, coordinates, footprints, counts, flags, topology, out
            )
        else:
            _SAMPLE[filter_name](source, valid, coordinates, flags, topology, out)
        if samples > 1:
            mean = np.empty((rows.stop - first, width, 4), np.float32)
            kernels.block_mean(out, samples, mean)
            out = mean
        yield rows, out


def _with_borders(source: Array, lens_map: LensMap) -> Array:
    """Return the window. Each face of a cube map gets a border from the faces around it."""
    if lens_map.strip is None:
        return source
    out = np.empty((*lens_map.strip.shape[:2], 4), np.float32)
    kernels.continue_faces(source, lens_map.strip, out)
    return out


def _st_warp(source: Array, lens_map: LensMap) -> Array:
    """Resample with OpenImageIO's st_warp and its Catmull-Rom filter."""
    import OpenImageIO as oiio

    height, width = lens_map.target_cos.shape
    valid = np.isfinite(source).all(axis=-1) & ~np.isnan(lens_map.source_cos)
    # A fifth channel counts the weights that fell on valid pixels.
    channels = np.dstack([np.where(valid[..., None], source, 0), valid]).astype(np.float32)
    scale = np.array([source.shape[1], source.shape[0]], np.float32)
    has_nothing = (lens_map.flags == kernels.NOTHING)[..., None]
    st = np.where(has_nothing, -1, lens_map.coordinates / scale)
    warped = _image_buffer(np.zeros((*st.shape[:2], 5), np.float32))
    coordinates = _image_buffer(st.astype(np.float32))
    has_warped = oiio.ImageBufAlgo.st_warp(
        warped, _image_buffer(channels), coordinates, "catmull-rom", nthreads=1
    )
    if not has_warped:
        raise UserError(f"filter: st_warp failed: {warped.geterror()}")
    samples = lens_map.settings["samples"]
    # In a window of few pixels, the filter reaches from −1 into the window.
    pixels = np.where(has_nothing, 0, warped.get_pixels(oiio.FLOAT))
    blocks = pixels.reshape(height, samples, width, samples, 5).mean(axis=(1, 3))
    weight = blocks[..., 4:]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(weight > 1e-3, blocks[..., :4] / weight, np.nan))


def _image_buffer(pixels: Array) -> Any:
    import OpenImageIO as oiio

    height, width, count = pixels.shape
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, count, "float"))
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, count), np.ascontiguousarray(pixels))
    return buffer
