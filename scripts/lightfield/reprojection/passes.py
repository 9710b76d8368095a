"""Reprojects passes: light as colour, normals as unit vectors, ids and mattes unmixed."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from lightfield.dataset.passes import Pass
from lightfield.geometry.lenses import Array
from lightfield.imaging.halves import widen
from lightfield.imaging.images import HALF_MAX, KEY_ATTRIBUTE, read_image, write_exr
from lightfield.reprojection import kernels
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.job import Job, SourceView
from lightfield.reprojection.lens_map import LensMap


def write_pass(
    job: Job, view_pass: Pass, view: SourceView, lens_map: LensMap, path: Path, key: str
) -> None:
    """Resample one pass of a view through one lens map, and write its file.

    Pixels without a source are 0.
    """
    image = read_image(view_pass.path(job.lightfield.folder, view.name), view_pass.channels)
    channels = image.channels
    if not job.copies:
        channels = _resampled_channels(channels, view_pass, lens_map)
    header = {
        name: value for name, value in image.attributes.items() if name.startswith("cryptomatte/")
    }
    write_exr(path, channels, header | {KEY_ATTRIBUTE: key})
    job.record.add(path, key)


def _resampled_channels(
    channels: Mapping[str, Array], view_pass: Pass, lens_map: LensMap
) -> dict[str, Array]:
    """Return a pass's channels (h, w) resampled to (H, W), in the pass's dtype."""
    planes = [channels[name] for name in view_pass.channels]
    # Kernels resample three channels at a time.
    groups = [planes[first : first + 3] for first in range(0, len(planes), 3)]
    resampled = [_resampled(group, view_pass, lens_map) for group in groups]
    pixels = np.concatenate(resampled, axis=-1)[..., : len(planes)]
    if view_pass.kind == "normal":
        length = np.linalg.norm(pixels, axis=-1, keepdims=True)
        pixels = np.divide(pixels, length, out=np.zeros_like(pixels), where=length > 1e-6)
    elif view_pass.kind == "light":
        pixels = pixels.clip(-HALF_MAX, HALF_MAX)
    elif view_pass.kind == "value":
        # A filter may overshoot at edges.
        pixels = pixels.clip(0, 1)
    resampled_planes = np.moveaxis(pixels.astype(view_pass.dtype), -1, 0)
    return dict(zip(view_pass.channels, resampled_planes, strict=True))


def _resampled(planes: list[Array], view_pass: Pass, lens_map: LensMap) -> Array:
    """Return one to three planes (h, w) resampled to (H, W, 4) float32."""
    row, end_row, column, end_column = lens_map.window
    windows = [plane[row:end_row, column:end_column] for plane in planes]
    # A float holds every id exactly. Missing channels repeat the others.
    red, green, blue = (windows * 3)[:3]
    source = widen(red, green, blue)
    if view_pass.kind in ("id", "matte"):
        # An id cannot be mixed: take the ray through each pixel's centre.
        has_source = ~np.isnan(lens_map.centers[..., 0])
        lens_map = replace(
            lens_map,
            settings={**lens_map.settings, "filter": "nearest", "samples": 1},
            coordinates=lens_map.centers,
            flags=np.where(has_source, kernels.INSIDE, kernels.NOTHING).astype(np.uint8),
        )
    return np.nan_to_num(resample_colour(source, lens_map), nan=0)
