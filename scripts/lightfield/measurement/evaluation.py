"""Compares renders of a dataset's views with the dataset's own, view by view, by region.

A render is ``<view>.png``, sRGB, or ``<view>.exr``, linear, with the dataset's kind of depth in
channel Z. Normals are ``normal/<view>.exr``, like the dataset's pass. The rig's name may precede
the view's, as in exports of several rigs: ``spiral_view_0000f.png``. The developed pictures are
compared. Pictures with alpha are composited over a background.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path
from lightfield.export.source import Bools, Floats, SourceDataset
from lightfield.export.splat_drawing import draw
from lightfield.formats.depth import check_size
from lightfield.formats.gaussians import Gaussians
from lightfield.formats.lightfield import View
from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.visibility import ONE_SURFACE
from lightfield.imaging import images
from lightfield.imaging.alpha import divisor
from lightfield.imaging.tonemap import decode_srgb, encode_srgb, to_16_bit, tone_map
from lightfield.measurement.lpips import Lpips
from lightfield.measurement.picture_difference import (
    depth_error,
    flip_map,
    iv_psnr,
    normal_error,
    psnr,
    solid_angles,
    ssim_map,
    ws_psnr,
)

# The width of an edge in pixels.
_EDGE_PIXELS = 5
_NORMALS = "normal"
# A render's alpha differs from the truth's if more than ALPHA_PART of the pixels are off by more
# than ALPHA_STEP. At silhouettes they always differ somewhat.
_ALPHA_STEP = 0.1
_ALPHA_PART = 0.01


@dataclass(frozen=True)
class Pictures:
    """The pictures of one view: sRGB-encoded colour (h, w, 3), depth (h, w), normals (h, w, 3).

    The colour is composited over the background. ``alpha`` (h, w) is the part that it covers.
    """

    colour: Floats
    alpha: Floats | None
    depth: Floats | None
    normals: Floats | None


@dataclass(frozen=True)
class ShownRender:
    """A picture to compare with a view.

    - ``name``: for messages and errors.
    - ``largest``: the largest value of a PNG: 255 or 65535. None for an EXR.
    """

    name: str
    pictures: Pictures
    largest: int | None


def find(
    folder: Path, source: SourceDataset, view: View, suffixes: Sequence[str] = (".exr", ".png")
) -> Path:
    """Return the picture of a view in a folder. Raises `UserError` if there is none.

    Names with the rig's name come first, because a view's name alone may belong to another rig.
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
        "it must have every test view"
    )


def _rig_names(source: SourceDataset) -> list[str]:
    """Return the names that a dataset's rig may have, beginning with the name of its folder.

    The folder of a frame lies in the rig's. A package unpacks to <scene>_<rig>, or to
    <scene>_<preset>_<rig>.
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
    """Return where a grey picture is not 0. Raises `UserError` for a wrong size or kind."""
    pixels = images.read_image(path, ["Y"]).channels["Y"]
    check_size(path, source.lightfield, pixels)
    return np.asarray(pixels > 0)


def truth(source: SourceDataset, view: View, largest: int | None, background: Floats) -> Pictures:
    """Return a dataset's own view over a background (3,) in sRGB, 0 to 1.

    With the ``largest`` value of a PNG, the view is rounded as in such a PNG, and composited in
    sRGB. Without it, the view is composited as light, as an EXR is.
    """
    transparent = source.lightfield.transparent
    if largest:
        colour, alpha = _rounded(source, view, largest)
        colour = _on_background(colour, alpha, background, largest)
    else:
        image = source.view(view).image()
        # In views that are not transparent, alpha marks where another lens saw nothing.
        alpha = _alpha(image) if transparent else None
        if alpha is not None and source.suffix == ".png":
            light = decode_srgb(image.encoded) * alpha[..., np.newaxis]
            colour = encode_srgb(_with_background(light, alpha, background))
        else:
            colour = _developed(image, alpha, source, background)
    has_depth = source.suffix == ".exr" and source.lightfield.depth
    return Pictures(
        colour,
        alpha,
        source.depth(view, source.lightfield.depth or "") if has_depth else None,
        _normals(source.view(view).pass_path(_NORMALS), source),
    )


def rendered(path: Path, source: SourceDataset, background: Floats) -> ShownRender:
    """Return the render in a file, over a background (3,) in sRGB, 0 to 1.

    Raises `UserError` if it has no colour, or another size than the dataset's.
    """
    image = images.read_image(path)
    if not {*"RGB"} <= image.channels.keys():
        raise UserError(f"{path}: has the channels {', '.join(image.channels)}; must have RGB")
    check_size(path, source.lightfield, image.channels["R"])
    alpha = _alpha(image)
    colour = _developed(image, alpha, source, background)
    depth = image.channels.get("Z")
    normals = _normals(path.parent / _NORMALS / f"{path.stem}.exr", source)
    kind = image.channels["R"].dtype
    return ShownRender(
        str(path),
        Pictures(colour, alpha, None if depth is None else depth.astype(np.float64), normals),
        np.iinfo(kind).max if path.suffix == ".png" else None,
    )


def drawn(
    splat: Gaussians, name: str, source: SourceDataset, view: View, background: Floats
) -> ShownRender:
    """Return what a Gaussian splat shows in a view, over a background (3,) in sRGB, 0 to 1.

    Its depth is infinite where the view's is: Gaussians of a sky are somewhere.
    """
    picture = draw(splat, view, source.lens)
    through = (1 - picture.coverage)[..., np.newaxis]
    colour = (picture.colour + through * background).clip(0, 1)
    depth = None
    kind = source.lightfield.depth
    if source.has_depth and kind:
        drawn_depth = converted(picture.distance, source.lens.pixel_rays(), "distance", kind)
        depth = np.where(np.isposinf(source.depth(view, kind)), np.inf, drawn_depth)
    return ShownRender(f"{name}: {view.name}", Pictures(colour, None, depth, None), 255)


def _rounded(source: SourceDataset, view: View, largest: int) -> tuple[Floats, Floats | None]:
    """Return a dataset's view as a PNG whose values end at ``largest``: sRGB colour and alpha.

    Both are 0 to 1, the colour (h, w, 3) without background, the alpha (h, w). The alpha is None if
    the dataset is not transparent.
    """
    transparent = source.lightfield.transparent
    if largest == 255:
        return source.colour(view) / 255, source.alpha(view) / 255 if transparent else None
    image = source.view(view).image()
    alpha = _alpha(image) if transparent else None
    if image.channels["R"].dtype.kind == "u":
        return image.encoded, alpha
    light = image.colour
    if alpha is not None:
        alpha = np.rint(alpha * largest) / largest
        light = image.straight
    if source.look:
        return source.look.to_pixels(light, 16, _covered(alpha)) / largest, alpha
    return to_16_bit(tone_map(light, source.exposure, source.reinhard)) / largest, alpha


def _covered(alpha: Floats | None) -> Floats | None:
    """Return alpha (h, w, 1) by which colour can be divided. None without alpha."""
    return None if alpha is None else divisor(alpha)[..., np.newaxis]


def _alpha(image: images.Image) -> Floats | None:
    """Return a picture's alpha (h, w), 0 to 1. None if it has none."""
    return image.alpha if "A" in image.channels else None


def _developed(
    image: images.Image, alpha: Floats | None, source: SourceDataset, background: Floats
) -> Floats:
    """Return a picture's sRGB colour (h, w, 3) over a background.

    An EXR's colour is premultiplied by alpha, so the background is added as light. A PNG's colour
    is not. Its sRGB values are blended, as trainers do with RGBA pictures.
    """
    if image.channels["R"].dtype.kind == "u":
        largest = np.iinfo(image.channels["R"].dtype).max
        return _on_background(image.encoded, alpha, background, largest)
    if source.look:
        covered = _covered(alpha)
        straight = image.colour if covered is None else image.colour / covered
        light = np.asarray(decode_srgb(source.look.developed(straight, covered)))
        light = light if alpha is None else light * alpha[..., np.newaxis]
    else:
        light = tone_map(image.colour, source.exposure, source.reinhard)
    if alpha is not None:
        light = _with_background(light, alpha, background)
    return np.asarray(encode_srgb(light), np.float64)


def _with_background(light: Floats, alpha: Floats, background: Floats) -> Floats:
    """Return light (h, w, 3), premultiplied by ``alpha`` (h, w), over an sRGB background."""
    shown: Floats = light + (1 - alpha[..., np.newaxis]) * np.asarray(decode_srgb(background))
    return shown


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
    """Return how a render's alpha or background differs from the truth's. None if they agree.

    A render without alpha must show the ``background`` where the truth is transparent.
    """
    if shown.alpha is None:
        if true.alpha is None:
            return None
        empty = counted & (true.alpha == 0)
        if not empty.any():
            return None
        colour = np.median(shown.colour[empty], axis=0)
        if np.abs(colour - background).max() <= _ALPHA_STEP:
            return None
        return (
            f"has no alpha, and is {hexadecimal(colour)} where the truth is transparent, instead "
            f"of {hexadecimal(background)}; give its background by --background"
        )
    true_alpha = np.ones(counted.shape) if true.alpha is None else true.alpha
    part = float((np.abs(shown.alpha - true_alpha)[counted] > _ALPHA_STEP).mean())
    if part <= _ALPHA_PART:
        return None
    return f"has another alpha than the truth in {part:.0%} of its pixels"


def hexadecimal(colour: Floats) -> str:
    """Return an sRGB colour (3,), 0 to 1, as #rrggbb."""
    return "#" + "".join(f"{round(255 * value):02x}" for value in colour.tolist())


def regions(
    source: SourceDataset, view: View, counted: Bools, depth: Floats | None
) -> dict[str, Bools]:
    """Return the regions (h, w) of a view in which errors are counted, by their names.

    ``counted`` are the pixels that a mask leaves. ``centre`` and ``rim`` divide the lens at half
    its largest angle. If there is ``depth``, of the dataset's kind, ``edges`` are where the
    distance jumps. ``background`` is where nothing was hit.
    """
    valid = source.valid(view)
    rays = source.lens.pixel_rays()
    compared = counted & valid
    angle = np.arccos(np.clip(-rays[..., 2], -1, 1))
    inner = angle < np.nanmax(angle) / 2
    by_name = {"all": compared, "centre": compared & inner, "rim": compared & ~inner}
    if depth is not None:
        # Compare distances: towards the rim of a wide lens, Z decreases on any surface.
        distance = converted(depth, rays, source.lightfield.depth, "distance")
        finite_distance = np.where(np.isfinite(distance), distance, 1e9)
        near = minimum_filter(np.where(valid, finite_distance, np.inf), _EDGE_PIXELS)
        far = maximum_filter(np.where(valid, finite_distance, 0), _EDGE_PIXELS)
        by_name["edges"] = compared & (far > (1 + ONE_SURFACE) * near)
        by_name["background"] = compared & np.isposinf(depth)
    return {name: region for name, region in by_name.items() if region.any()}


def errors(
    shown: Pictures,
    true: Pictures,
    parts: Mapping[str, Bools],
    lens: Lens,
    network: Lpips | None = None,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the errors of each region: means over its pixels, None without depth or normals.

    They are psnr in decibel, ws_psnr, iv_psnr, ssim, flip and lpips. Equal pictures have inf, 100,
    100, 1, 0 and 0. Depth is as in `depth_error`, and normal as in `normal_error`.
    Only the region "all" has iv_psnr, because a match may lie in another region, and lpips, of the
    whole picture. lpips is None without a ``network``. Outside the region "all" both pictures count
    as black.
    """
    compared = parts["all"][..., np.newaxis]
    true_colour = np.where(compared, true.colour, 0)
    shown_colour = np.where(compared, shown.colour, 0)
    squares = ((true_colour - shown_colour) ** 2).mean(axis=-1)
    # A pixel that is cut by the lens's border has no solid angle, but its centre has a ray.
    angles = np.maximum(solid_angles(lens), 1e-12)
    weights = angles if isinstance(lens, Equirectangular) else None
    similarity = ssim_map(true_colour, shown_colour)
    flip = flip_map(true_colour, shown_colour)
    for name, region in parts.items():
        mean_square = float(squares[region].mean())
        yield (
            name,
            {
                "pixels": int(region.sum()),
                "psnr": psnr(mean_square),
                "ws_psnr": ws_psnr(true_colour, shown_colour, np.where(region, angles, 0)),
                "iv_psnr": iv_psnr(true_colour, shown_colour, region, weights)
                if name == "all"
                else None,
                "ssim": float(similarity[region].mean()),
                "flip": float(flip[region].mean()),
                "lpips": network.distance(true_colour, shown_colour)
                if network and name == "all"
                else None,
                "depth": None
                if shown.depth is None or true.depth is None
                else depth_error(shown.depth[region], true.depth[region]),
                "normal": None
                if shown.normals is None or true.normals is None
                else normal_error(shown.normals[region], true.normals[region]),
            },
        )


def means(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row of means over the views for each region. A PSNR of inf makes the mean inf."""
    mean_rows = []
    for region in dict.fromkeys(row["region"] for row in rows):
        of_region = [row for row in rows if row["region"] == region]
        mean: dict[str, Any] = {"view": "mean", "region": region}
        for name in list(of_region[0])[2:]:
            values = [row[name] for row in of_region if row[name] is not None]
            mean[name] = sum(values) / len(values) if values else None
        mean_rows.append(mean)
    return mean_rows


def _normals(path: Path, source: SourceDataset) -> Floats | None:
    """Return the normals (h, w, 3) in a file. None without the file."""
    if not path.is_file():
        return None
    normals = images.read_image(path, "RGB").colour.astype(np.float64)
    check_size(path, source.lightfield, normals)
    return normals
