"""How well somebody's views of a dataset are those that were rendered: view by view, by region.

A render is ``<view>.png``, sRGB, or ``<view>.exr``, linear, whose channel Z is depth as the
dataset's; normals are ``normal/<view>.exr``, as the dataset's pass of that name. Each may have the
rig's name before the view's, as exports of several rigs have: ``spiral_view_0000f.png``. What is
compared is the developed picture, and one with alpha is composited over a background. LPIPS is not
among the metrics: no package of this environment holds the weights of its network.
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
from lightfield.core.files import absolute_path
from lightfield.dataset.lightfield import View
from lightfield.export.source import Bools, Floats, SourceDataset, check_size
from lightfield.geometry.depth import stored_distance
from lightfield.imaging import images
from lightfield.imaging.tonemap import decode_srgb, encode_srgb, tone_map
from lightfield.measurement import metrics

# Neighbouring depths of different surfaces differ by more than this part.
EDGE = 0.1
EDGE_PIXELS = 5  # the width of what counts as an edge
NORMALS = "normal"
# A render's alpha is another than the truth's where they differ by more than this, in more than
# this part of the pixels: at silhouettes they always differ somewhat.
ALPHA_STEP = 0.1
ALPHA_PART = 0.01


@dataclass(frozen=True)
class Pictures:
    """What one view is compared by: sRGB-encoded colour (h, w, 3), depth (h, w), normals.

    The colour is composited over the background; ``alpha`` (h, w) is how much of a pixel covers it.
    """

    colour: Floats
    alpha: Floats | None
    depth: Floats | None
    normals: Floats | None


def find(
    folder: Path, source: SourceDataset, view: View, suffixes: Sequence[str] = (".exr", ".png")
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


def _rig_names(source: SourceDataset) -> list[str]:
    """Return what the rig of a dataset's folder may be called, the whole folder's name first.

    The folder of a frame lies in the rig's. A package unfolds to <scene>_<rig>, where a preset may
    stand between.
    """
    folder = absolute_path(source.dataset)
    if re.fullmatch(r"f\d{5,}", folder.name):
        folder = folder.parent
    lightfield = source.lightfield
    scene = lightfield.scene.get("name") if "scene" in lightfield.content else None
    if not folder.name.startswith(f"{scene}_"):
        return [folder.name]
    parts = folder.name.split("_")
    return ["_".join(parts[first:]) for first in range(len(parts))]


def mask(path: Path, source: SourceDataset) -> Bools:
    """Return where a grey picture is not 0; raises `UserError` for one of another size or kind."""
    pixels = images.read_image(path, ["Y"]).channels["Y"]
    check_size(path, source.lightfield, pixels)
    return np.asarray(pixels > 0)


def truth(source: SourceDataset, view: View, like: Path, background: Floats) -> Pictures:
    """Return a dataset's own view over a background (3,) in sRGB, 0 to 1.

    It is as coarse as a PNG if what it is compared with is ``like``.
    """
    transparent = source.lightfield.transparent
    if like.suffix == ".png":
        alpha = source.alpha(view) / 255 if transparent else None
        colour = _on_background(source.colour(view) / 255, alpha, background, 255)
    else:
        image = images.read_image(source.path(view))
        check_size(source.path(view), source.lightfield, image.channels["R"])
        # Of views that are not transparent it says where another lens saw nothing.
        alpha = _alpha(image) if transparent else None
        colour = _developed(image, alpha, source, background)
    has_depth = source.suffix == ".exr" and source.lightfield.depth
    return Pictures(
        colour,
        alpha,
        source.depth(view, source.lightfield.depth or "") if has_depth else None,
        _normals(source.dataset / source.name / NORMALS / f"{view.name}.exr"),
    )


def rendered(path: Path, source: SourceDataset, background: Floats) -> Pictures:
    """Return somebody's view over a background (3,) in sRGB, 0 to 1.

    Raises `UserError` where it has no colour, or another size than the dataset's.
    """
    image = images.read_image(path)
    if not {*"RGB"} <= image.channels.keys():
        raise UserError(f"{path}: has the channels {', '.join(image.channels)}; must have RGB")
    check_size(path, source.lightfield, image.channels["R"])
    alpha = _alpha(image)
    colour = _developed(image, alpha, source, background)
    depth = image.channels.get("Z")
    normals = _normals(path.parent / NORMALS / f"{path.stem}.exr")
    return Pictures(colour, alpha, None if depth is None else depth.astype(np.float64), normals)


def _alpha(image: images.Image) -> Floats | None:
    """Return a picture's alpha (h, w), 0 to 1; None if it has none."""
    alpha = image.channels.get("A")
    if alpha is None:
        return None
    largest = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
    return alpha.astype(np.float64) / largest


def _developed(
    image: images.Image, alpha: Floats | None, source: SourceDataset, background: Floats
) -> Floats:
    """Return a picture's sRGB colour (h, w, 3) over a background.

    An EXR's colour is multiplied by alpha, and the background is added as light. A PNG's is not,
    and sRGB values are blended, as trainers blend those of RGBA pictures.
    """
    if image.channels["R"].dtype.kind == "u":
        pixels = np.stack([image.channels[name] for name in "RGB"], axis=-1)
        largest = np.iinfo(pixels.dtype).max
        return _on_background(pixels / largest, alpha, background, largest)
    light = tone_map(image.colour, source.exposure, source.reinhard)
    if alpha is not None:
        light = light + (1 - alpha[..., np.newaxis]) * decode_srgb(background)
    return np.asarray(encode_srgb(light), np.float64)


def _on_background(
    colour: Floats, alpha: Floats | None, background: Floats, largest: int
) -> Floats:
    """Blend sRGB colour (h, w, 3) with a background, in steps of 1 / ``largest``."""
    if alpha is None:
        return colour
    covered = alpha[..., np.newaxis]
    blended = covered * colour + (1 - covered) * background
    return np.asarray(np.rint(largest * blended) / largest)


def background_problem(
    shown: Pictures, true: Pictures, counted: Bools, background: Floats
) -> str | None:
    """Say how a render's alpha or background is not the truth's; None if they agree.

    A render without alpha must have the ``background`` where the truth is transparent.
    """
    if shown.alpha is None:
        if true.alpha is None or not (empty := counted & (true.alpha == 0)).any():
            return None
        colour = np.median(shown.colour[empty], axis=0)
        if np.abs(colour - background).max() <= ALPHA_STEP:
            return None
        return (
            f"has no alpha, and is {hexadecimal(colour)} where the truth is transparent, instead "
            f"of {hexadecimal(background)}; give its background by --background"
        )
    true_alpha = np.ones(counted.shape) if true.alpha is None else true.alpha
    part = float((np.abs(shown.alpha - true_alpha)[counted] > ALPHA_STEP).mean())
    if part <= ALPHA_PART:
        return None
    return f"has another alpha than the truth in {part:.0%} of its pixels"


def hexadecimal(colour: Floats) -> str:
    """Return an sRGB colour (3,), 0 to 1, as #rrggbb."""
    return "#" + "".join(f"{round(255 * value):02x}" for value in colour.tolist())


def regions(
    source: SourceDataset, view: View, counted: Bools, depth: Floats | None
) -> dict[str, Bools]:
    """Return the parts (h, w) of a view in which errors are counted, by their names.

    ``counted`` is what a mask leaves. ``centre`` and ``rim`` divide the lens at half its largest
    angle; with ``depth``, as the dataset has it, ``edges`` are where the distance jumps, and
    ``background`` is where nothing was hit.
    """
    valid = source.valid(view)
    rays = source.lens.pixel_rays()
    every = counted & valid
    angle = np.arccos(np.clip(-rays[..., 2], -1, 1))
    inner = angle < np.nanmax(angle) / 2
    found = {"all": every, "centre": every & inner, "rim": every & ~inner}
    if depth is not None:
        # Towards the rim of a wide lens Z falls on any surface.
        distance = stored_distance(depth, rays, source.lightfield.depth)
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
    one = np.where(every, true.colour, 0)
    other = np.where(every, shown.colour, 0)
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
