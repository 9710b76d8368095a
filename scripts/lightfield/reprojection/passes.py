"""Reprojects passes: light as colour, normals as unit vectors, all others unmixed.

Light groups are scaled so that they still add up to the colour.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lightfield.formats.passes import Pass, is_group
from lightfield.geometry.lenses import Array
from lightfield.imaging.halves import widen
from lightfield.imaging.images import HALF_MAX, KEY_ATTRIBUTE, Image, read_image
from lightfield.reprojection import kernels
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.job import ReprojectionJob, SourceView
from lightfield.reprojection.lens_map import LensMap
from lightfield.reprojection.pixels import SourcePixels
from lightfield.workflow import shard_log


def write_passes(
    job: ReprojectionJob,
    view: SourceView,
    paths: Mapping[Pass, Path],
    lens_map: LensMap,
    source: SourcePixels,
    key: str,
) -> None:
    """Resample passes of a view through one lens map, and write their files ``paths``.

    Pixels without a source are 0. ``source`` is the view's colour, to which the light groups add
    up. If it is relit, they are resampled one by one.
    """
    groups = [view_pass for view_pass in paths if is_group(view_pass)]
    balance = None
    if groups and not job.copies and not source.is_relit:
        balance = _Balance.of(job, groups, view, lens_map, source)
    for view_pass, path in paths.items():
        image = _read(job, view_pass, view)
        channels = image.channels
        if not job.copies:
            group_balance = balance if is_group(view_pass) else None
            channels = _resampled_channels(channels, view_pass, lens_map, group_balance)
        header = {
            name: value
            for name, value in image.attributes.items()
            if name.startswith("cryptomatte/")
        }
        job.write_exr(path, channels, header | {KEY_ATTRIBUTE: key})
        shard_log.add(path, key)


def _read(job: ReprojectionJob, view_pass: Pass, view: SourceView) -> Image:
    return read_image(view_pass.path(job.lightfield.folder, view.name), view_pass.channels)


@dataclass(frozen=True)
class _Balance:
    """The correction that makes resampled light groups add up to the resampled colour.

    Rounding, and filters that keep light from becoming negative, change their sum. ``missing`` (H,
    W, 3) is what the sum of ``count`` groups lacks. Each group takes its part of it, in proportion
    to its light. ``size`` (H, W, 3) is the sum of the groups' light. Only one group is in memory.
    """

    missing: Array
    size: Array
    count: int

    @classmethod
    def of(
        cls,
        job: ReprojectionJob,
        groups: Sequence[Pass],
        view: SourceView,
        lens_map: LensMap,
        source: SourcePixels,
    ) -> "_Balance":
        """Resample the colour and all ``groups`` of a view, and compare them."""
        pixels, _ = source.window(lens_map)
        colour = np.nan_to_num(resample_colour(pixels, lens_map)[..., :3], nan=0)
        # The colour as a file of half floats holds it.
        missing = colour.clip(-HALF_MAX, HALF_MAX).astype(np.float16).astype(np.float32)
        size = np.zeros_like(missing)
        for view_pass in groups:
            channels = _read(job, view_pass, view).channels
            planes = [channels[name] for name in view_pass.channels]
            light = _not_darker(_resampled(planes, view_pass, lens_map)[..., :3], planes)
            missing -= light
            size += np.abs(light)
        return cls(missing, size, len(groups))

    def applied(self, light: Array) -> Array:
        """Return the light (H, W, 3) of a group, with its part of what is missing."""
        equal_part = np.full_like(self.size, 1 / self.count)
        part = np.divide(np.abs(light), self.size, out=equal_part, where=self.size > 0)
        return np.asarray(light + part * self.missing)


def _not_darker(light: Array, planes: Sequence[Array]) -> Array:
    """Raise light below zero to the darkest value of its source ``planes``.

    The filter st_warp may make light negative.
    """
    darkest = min(np.float32(0), *(np.float32(plane.min()) for plane in planes))
    return np.maximum(light, darkest)


def _resampled_channels(
    channels: Mapping[str, Array], view_pass: Pass, lens_map: LensMap, balance: _Balance | None
) -> dict[str, Array]:
    """Return a pass's channels (h, w) resampled to (H, W), in the pass's dtype."""
    planes = [channels[name] for name in view_pass.channels]
    # Kernels resample three channels at a time.
    groups = [planes[first : first + 3] for first in range(0, len(planes), 3)]
    resampled = [_resampled(group, view_pass, lens_map) for group in groups]
    pixels = np.concatenate(resampled, axis=-1)[..., : len(planes)]
    if balance:
        pixels = balance.applied(_not_darker(pixels, planes))
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
    if view_pass.kind in ("id", "matte", "variance"):
        # An id cannot be mixed, and a mean of variances is not the variance of a mean. So take the
        # ray through each pixel's centre.
        has_source = ~np.isnan(lens_map.centers[..., 0])
        lens_map = replace(
            lens_map,
            settings={**lens_map.settings, "filter": "nearest", "samples": 1},
            coordinates=lens_map.centers,
            flags=np.where(has_source, kernels.INSIDE, kernels.NOTHING).astype(np.uint8),
        )
    return np.nan_to_num(resample_colour(source, lens_map), nan=0)
