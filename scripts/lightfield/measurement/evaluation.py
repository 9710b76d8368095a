"""How well somebody's views of a dataset are those that were rendered: view by view, by region.

A render is ``<view>.png``, sRGB, or ``<view>.exr``, linear, whose channel Z is depth as the
dataset's; normals are ``normal/<view>.exr``, as the dataset's pass of that name. Each may have the
rig's name before the view's, as exports of several rigs have: ``spiral_view_0000f.png``. What is
compared is the developed picture. LPIPS is not among the metrics: no package of this environment
holds the weights of its network.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from lightfield.core.errors import UserError
from lightfield.core.files import whole
from lightfield.dataset.lightfield import View
from lightfield.export.source import Bools, Floats, Source, check_size
from lightfield.geometry.depth import distance_from_z
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb, tone_map
from lightfield.measurement import metrics

# Neighbouring depths of different surfaces differ by more than this part.
EDGE = 0.1
EDGE_PIXELS = 5  # the width of what counts as an edge
NORMALS = "normal"


@dataclass(frozen=True)
class Pictures:
    """What one view is compared by: sRGB-encoded colour (h, w, 3), depth (h, w), normals."""

    colour: Floats
    depth: Floats | None
    normals: Floats | None


def find(
    folder: Path, source: Source, view: View, suffixes: Sequence[str] = (".exr", ".png")
) -> Path:
    """Return the picture of a view in a folder; raises `UserError` where there is none.

    The name with the rig's before it goes first: the other may be that of another rig's view.
    """
    names = [*(f"{rig}_{view.name}" for rig in _rig_names(source)), view.name]
    for name in names:
        for suffix in suffixes:
            path = folder / f"{name}{suffix}"
            if path.is_file():
                return path
    endings = " or ".join(suffixes)
    raise UserError(
        f"{folder}: has no {view.name}{endings}, nor {names[0]}{endings}; "
        "it must have each view to test with"
    )


def _rig_names(source: Source) -> list[str]:
    """Return what the rig of a dataset's folder may be called, the whole folder's name first.

    The folder of a frame lies in the rig's. A package unfolds to <scene>_<rig>, where a preset may
    stand between.
    """
    folder = whole(source.dataset)
    if re.fullmatch(r"f\d{5,}", folder.name):
        folder = folder.parent
    lightfield = source.lightfield
    scene = lightfield.scene.get("name") if "scene" in lightfield.content else None
    if not folder.name.startswith(f"{scene}_"):
        return [folder.name]
    parts = folder.name.split("_")
    return ["_".join(parts[first:]) for first in range(len(parts))]


def mask(path: Path, source: Source) -> Bools:
    """Return where a grey picture is not 0; raises `UserError` for one of another size or kind."""
    pixels = images.read_image(path, ["Y"]).channels["Y"]
    check_size(path, source.lightfield, pixels)
    return np.asarray(pixels > 0)


def truth(source: Source, view: View, like: Path) -> Pictures:
    """Return a dataset's own view; as coarse as a PNG if what it is compared with is ``like``."""
    coarse = like.suffix == ".png"
    has_depth = source.suffix == ".exr" and source.lightfield.depth
    return Pictures(
        source.colour(view) / 255 if coarse else source.encoded(view),
        source.depth(view, source.lightfield.depth or "") if has_depth else None,
        _normals(source.dataset / source.name / NORMALS / f"{view.name}.exr"),
    )


def rendered(path: Path, source: Source) -> Pictures:
    """Return somebody's view.

    Raises `UserError` where it has no colour, or another size than the dataset's.
    """
    image = images.read_image(path)
    if not {*"RGB"} <= image.channels.keys():
        raise UserError(f"{path}: has the channels {', '.join(image.channels)}; must have RGB")
    check_size(path, source.lightfield, image.channels["R"])
    if path.suffix == ".png":
        pixels = np.stack([image.channels[name] for name in "RGB"], axis=-1)
        colour = pixels / np.iinfo(pixels.dtype).max
    else:
        developed = tone_map(image.colour, source.exposure, source.reinhard)
        colour = np.asarray(encode_srgb(developed), np.float64)
    depth = image.channels.get("Z")
    normals = _normals(path.parent / NORMALS / f"{path.stem}.exr")
    return Pictures(colour, None if depth is None else depth.astype(np.float64), normals)


def regions(source: Source, view: View, counted: Bools, depth: Floats | None) -> dict[str, Bools]:
    """Return the parts (h, w) of a view in which errors are counted, by their names.

    ``counted`` is what a mask leaves. ``centre`` and ``rim`` divide the lens at half its largest
    angle; with ``depth``, as the dataset has it, ``edges`` are where the distance jumps, and
    ``background`` is where nothing was hit.
    """
    valid, rays = source.valid(view), source.lens.pixel_rays()
    every = counted & valid
    angle = np.arccos(np.clip(-rays[..., 2], -1, 1))
    inner = angle < np.nanmax(angle) / 2
    found = {"all": every, "centre": every & inner, "rim": every & ~inner}
    if depth is not None:
        # Towards the rim of a wide lens Z falls on any surface.
        distance = distance_from_z(depth, rays) if source.lightfield.depth == "z" else depth
        known = np.where(np.isfinite(distance), distance, 1e9)
        near = minimum_filter(np.where(valid, known, np.inf), EDGE_PIXELS)
        far = maximum_filter(np.where(valid, known, 0), EDGE_PIXELS)
        found["edges"] = every & (far > (1 + EDGE) * near)
        found["background"] = every & np.isposinf(depth)
    return {name: region for name, region in found.items() if region.any()}


def errors(
    shown: Pictures, true: Pictures, parts: Mapping[str, Bools]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the errors of each region: a mean over its pixels, None where something is missing.

    psnr in decibel (inf if equal), ssim (1 if equal), flip (0 if equal), depth as
    `metrics.depth_error`, normal as the mean angle in degrees. What lies outside the region
    "all" is black to both pictures.
    """
    every = parts["all"][..., np.newaxis]
    one, other = np.where(every, true.colour, 0), np.where(every, shown.colour, 0)
    squares = ((one - other) ** 2).mean(axis=-1)
    similarity = metrics.ssim_map(one, other)
    flip = metrics.flip_map(one, other)
    for name, region in parts.items():
        mean_square = float(squares[region].mean())
        yield (
            name,
            {
                "pixels": int(region.sum()),
                "psnr": -10 * math.log10(mean_square) if mean_square else math.inf,
                "ssim": float(similarity[region].mean()),
                "flip": float(flip[region].mean()),
                "depth": None
                if shown.depth is None or true.depth is None
                else metrics.depth_error(shown.depth[region], true.depth[region]),
                "normal": None
                if shown.normals is None or true.normals is None
                else _angle(shown.normals[region], true.normals[region]),
            },
        )


def means(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each region with the means over the views; a PSNR of inf is the mean's."""
    found = []
    for region in dict.fromkeys(row["region"] for row in rows):
        own = [row for row in rows if row["region"] == region]
        mean: dict[str, Any] = {"view": "mean", "region": region}
        for name in list(own[0])[2:]:
            values = [row[name] for row in own if row[name] is not None]
            mean[name] = sum(values) / len(values) if values else None
        found.append(mean)
    return found


def _normals(path: Path) -> Floats | None:
    if not path.is_file():
        return None
    return images.read_image(path, "RGB").colour.astype(np.float64)


def _angle(normals: Floats, truth: Floats) -> float | None:
    """Return the mean angle in degrees between normals (n, 3) where the truth has one."""
    known = np.linalg.norm(truth, axis=-1) > 0.5
    if not known.any():
        return None
    lengths = np.linalg.norm(normals[known], axis=-1)
    cosine = (normals[known] * truth[known]).sum(axis=-1) / np.maximum(lengths, 1e-12)
    sine = np.linalg.norm(np.cross(normals[known], truth[known]), axis=-1)
    return float(np.degrees(np.arctan2(sine / np.maximum(lengths, 1e-12), cosine)).mean())
