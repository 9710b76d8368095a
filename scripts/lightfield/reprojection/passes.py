"""Reprojects passes: light as colour, normals as unit vectors, ids and mattes unmixed."""

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
    job: Job, wanted: Pass, view: SourceView, lens_map: LensMap, path: Path, key: str
) -> None:
    """Resample one pass of a view through one lens map and write its file; 0 has no source."""
    image = read_image(wanted.path(job.lightfield.folder, view.name), wanted.channels)
    channels = image.channels
    if not job.copies:
        planes = [channels[name] for name in wanted.channels]
        resampled = [
            _resampled(planes[i : i + 3], wanted, lens_map) for i in range(0, len(planes), 3)
        ]
        pixels = np.concatenate(resampled, axis=-1)[..., : len(planes)]
        if wanted.kind == "normal":
            length = np.linalg.norm(pixels, axis=-1, keepdims=True)
            pixels = np.divide(pixels, length, out=np.zeros_like(pixels), where=length > 1e-6)
        elif wanted.kind == "light":
            pixels = pixels.clip(-HALF_MAX, HALF_MAX)
        planes = list(np.moveaxis(pixels.astype(wanted.dtype), -1, 0))
        channels = dict(zip(wanted.channels, planes, strict=True))
    header = {k: v for k, v in image.attributes.items() if k.startswith("cryptomatte/")}
    write_exr(path, channels, header | {KEY_ATTRIBUTE: key})
    job.record.add(path, key)


def _resampled(planes: list[Array], wanted: Pass, lens_map: LensMap) -> Array:
    row, end_row, column, end_column = lens_map.window
    # A float holds every id exactly.
    source = widen(*(plane[row:end_row, column:end_column] for plane in (planes * 3)[:3]))
    if wanted.kind in ("id", "matte"):
        # An id cannot be mixed: take the ray through each pixel's centre.
        seen = ~np.isnan(lens_map.centers[..., 0])
        lens_map = replace(
            lens_map,
            settings={**lens_map.settings, "filter": "nearest", "samples": 1},
            coordinates=lens_map.centers,
            flags=np.where(seen, kernels.INSIDE, kernels.NOTHING).astype(np.uint8),
        )
    return np.nan_to_num(resample_colour(source, lens_map), nan=0)
