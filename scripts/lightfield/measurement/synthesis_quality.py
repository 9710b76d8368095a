"""Measures a light field's quality: synthesises held-out views from the others, and compares them.

Each variant changes one thing: the number of views, how many of them make a picture, their
resolution, or the precision of their depth. Two controls show what the synthesis itself
contributes: the nearest view without its depth, and views with the depth of other views.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import absolute_path, write_csv
from lightfield.core.progress import Progress
from lightfield.export.trainer_splits import splits
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import PARTS_OF_LIGHT
from lightfield.geometry.depth import with_precision
from lightfield.geometry.interpolation_volume import parts_to_edge
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.rigs.sphere import nested
from lightfield.imaging import pictures, plots
from lightfield.imaging.tonemap import encode_srgb, tone_map
from lightfield.measurement import summaries
from lightfield.measurement.picture_difference import (
    flip_map,
    iv_psnr,
    solid_angles,
    ssim_map,
    ws_psnr,
)
from lightfield.measurement.summaries import ALL_PIXELS, PLACES
from lightfield.reading.dataset import OpenDataset
from lightfield.stages.measurement import SynthesisQuality, SynthesisSettings
from lightfield.stages.synthesis import BEST
from lightfield.synthesis.view import Sources, reader

# True views, and the dataset that has them.
_Truth = tuple[OpenDataset, Sequence[View]]


@dataclass(frozen=True)
class _Variant:
    """One way to synthesise.

    - ``name``, ``value``: what it changes, and to which value.
    - ``best``: how many views make a picture.
    - ``size``: the bytes of all its views.
    """

    name: str
    value: str
    sources: Sources
    best: int
    size: int


def measure(job: SynthesisQuality) -> None:
    """Write and print the quality of a dataset's synthesised views."""
    source = _opened(job.dataset)
    views, truths = _views_and_truths(source, job.settings)
    exposure = _exposure(truths)
    all_variants = list(variants(source, views))
    progress = Progress(len(all_variants), "synthesis", "variants")
    rows: list[dict[str, Any]] = []
    for variant in all_variants:
        for truth, true_views in truths:
            rows += compare(variant, views, true_views, truth, exposure)
        progress.done()
    write_csv(job.output.with_name(f"{job.output.name}.csv"), rows)
    means = summaries.means(rows)
    draw(means, job.output)
    for row in means:
        print(_line(row))


def _opened(folder: Path) -> OpenDataset:
    dataset = OpenDataset.in_folder(folder)
    dataset.lightfield.require_centre()
    return dataset


def _views_and_truths(
    source: OpenDataset, settings: SynthesisSettings
) -> tuple[Sequence[View], list[_Truth]]:
    """Return the views to synthesise from, and those to compare with."""
    views: Sequence[View] = source.lightfield.views
    truths: list[_Truth]
    if settings.truth:
        datasets = [_opened(Path(folder)) for folder in settings.truth]
        truths = [(truth, truth.lightfield.views) for truth in datasets]
    else:
        views, _, tests = splits(source.lightfield)
        truths = [(source, tests)]
    return views, [
        (truth, true_views[:: -(-len(true_views) // settings.views)])
        for truth, true_views in truths
    ]


def _exposure(truths: Sequence[_Truth]) -> float:
    """Return the exposure that shows all true views well."""
    colours = [truth.views[view.name].rgb for truth, true_views in truths for view in true_views]
    return pictures.exposure_for(np.concatenate([colour.reshape(-1, 3) for colour in colours]))


def _line(row: Mapping[str, Any]) -> str:
    """Return a row of `summaries.means` as a line of text."""
    return (
        f"{row['truth']:<24} {row['variant']:>10} {row['value']:<18} PSNR {row['psnr']:5.2f} "
        f"dB, holes black {row['psnr_black']:5.2f}  WS-PSNR {row['ws_psnr']:5.2f}  "
        f"IV-PSNR {row['iv_psnr']:5.2f}  SSIM {row['ssim']:.3f}  FLIP {row['flip']:.3f}, "
        f"black {row['flip_black']:.3f}  holes {row['holes']:.2%}"
    )


def variants(source: OpenDataset, views: Sequence[View]) -> Iterator[_Variant]:
    """Yield the variants and controls of a dataset's ``views``, the unchanged one first."""
    lens = source.lens
    read = reader(source)
    sizes = {view.name: source.views[view.name].path.stat().st_size for view in views}
    size = sum(sizes.values())
    fills_holes = not source.lightfield.transparent
    make = partial(Sources, lens, fills_holes=fills_holes)
    all_views = make(views, read)
    yield _Variant("all", str(len(views)), all_views, BEST, size)
    for subset in _subsets(source.lightfield, views):
        fewer = make(subset, read)
        yield _Variant("views", str(len(subset)), fewer, BEST, sum(sizes[v.name] for v in subset))
    for best in (1, 2, 4, 8):
        if best <= len(views):
            yield _Variant("best", str(best), all_views, best, size)
    for part in (2, 4):
        if part > min(lens.width, lens.height):
            break
        small = lens.resized(lens.width // part, lens.height // part)

        def shrunk(view: View, small: Lens = small) -> tuple[Array, Array]:
            colour, distance = read(view)
            # The pixels in which the middles of the small pixels lie.
            rows = (2 * np.arange(small.height) + 1) * lens.height // (2 * small.height)
            columns = (2 * np.arange(small.width) + 1) * lens.width // (2 * small.width)
            small_colour = pictures.shrunk(np.nan_to_num(colour), small.width, small.height)
            return small_colour, distance[np.ix_(rows, columns)]

        coarse = Sources(small, views, shrunk, fills_holes=fills_holes)
        yield _Variant(
            "resolution", f"{small.width} × {small.height}", coarse, BEST, size // part**2
        )
    for precision in ("rounded", "half"):

        def with_depth(view: View, precision: str = precision) -> tuple[Array, Array]:
            colour, distance = read(view)
            return colour, with_precision(distance, precision)

        yield _Variant("depth", precision, make(views, with_depth), BEST, size)

    def flat(view: View) -> tuple[Array, Array]:
        colour, distance = read(view)
        return colour, np.where(np.isnan(distance), np.nan, np.inf)

    nearest = make(views, flat)
    nearest.distances = all_views.distances
    yield _Variant("control", "nearest view alone", nearest, 1, size)
    after = dict(zip([view.name for view in views], [*views[1:], views[0]], strict=True))

    def mixed(view: View) -> tuple[Array, Array]:
        return read(view)[0], read(after[view.name])[1]

    yield _Variant("control", "shuffled depth", make(views, mixed), BEST, size)


def _subsets(lightfield: LightField, views: Sequence[View]) -> Iterator[Sequence[View]]:
    """Yield smaller and smaller subsets of a dataset's ``views``.

    A sphere's subsets are the coarser spheres. Other rigs are halved.
    """
    coarser = nested(len(views)) if lightfield.content.get("lf_type") == "SPHERE" else []
    spheres: list[Sequence[View]] = [[views[number] for number in numbers] for numbers in coarser]
    yield from spheres or [views[::step] for step in (2, 4, 8) if len(views[::step]) >= 4]


def regions(truth: OpenDataset, view: View, inside: Array) -> dict[str, Array]:
    """Return the pixels (h, w) of each region of a true view, out of those ``inside`` the lens.

    If the view has the passes of all kinds of light, each kind has a region. Black pixels show
    none.
    """
    by_region = {ALL_PIXELS: inside}
    if {*PARTS_OF_LIGHT} <= {render_pass.name for render_pass in truth.lightfield.passes}:
        opened = truth.views[view.name]
        light = np.array([opened.read(name).mean(axis=-1) for name in PARTS_OF_LIGHT])
        most = light.argmax(axis=0)
        for number, name in enumerate(PARTS_OF_LIGHT):
            is_most = (most == number) & (light[number] > 0)
            by_region[name.removesuffix("_light")] = inside & is_most
    return {name: pixels for name, pixels in by_region.items() if pixels.any()}


def compare(
    variant: _Variant,
    around: Sequence[View],
    views: Sequence[View],
    truth: OpenDataset,
    exposure: float,
) -> Iterator[dict[str, Any]]:
    """Yield a row for each region of each of the ``views`` of the ``truth``.

    A row has psnr, ws_psnr and iv_psnr in decibel, ssim, flip and the part of holes. Holes count
    with their filling, but in psnr_black and flip_black they are black. ``part`` is the region's
    part of the picture. ``to_edge`` is the view's distance from the middle of the views ``around``
    it, over the distance to the edge of their volume.
    """
    inside = np.isfinite(truth.lens.pixel_rays()[..., 0])
    angles = solid_angles(truth.lens)
    weights = angles if isinstance(truth.lens, Equirectangular) else None
    cameras = np.array([view.world_from_camera for view in around])
    eyes = np.array([view.world_from_camera for view in views])
    parts = parts_to_edge(cameras, variant.sources.lens, eyes[:, :3, 3])
    for view, to_edge in zip(views, parts.tolist(), strict=True):
        synthesised = variant.sources.synthesise(view.world_from_camera, truth.lens, variant.best)
        true = truth.views[view.name].rgb
        true_picture = _developed(true, exposure, inside)
        picture = _developed(synthesised.colour, exposure, inside)
        black = np.where(synthesised.holes[..., None], 0, picture)
        similar = ssim_map(true_picture, picture)
        flips = flip_map(true_picture, picture)
        black_flips = flip_map(true_picture, black)
        for region, pixels in regions(truth, view, inside).items():
            yield {
                "variant": variant.name,
                "value": variant.value,
                "truth": absolute_path(truth.files.path).name,
                "view": view.name,
                "to_edge": to_edge,
                "place": next(name for name, most in PLACES.items() if to_edge <= most),
                "region": region,
                "part": float(pixels[inside].mean()),
                "psnr": ws_psnr(true_picture, picture, pixels),
                "psnr_black": ws_psnr(true_picture, black, pixels),
                "ws_psnr": ws_psnr(true_picture, picture, np.where(pixels, angles, 0)),
                "iv_psnr": iv_psnr(true_picture, picture, pixels, weights),
                "ssim": float(similar[pixels].mean()),
                "flip": float(flips[pixels].mean()),
                "flip_black": float(black_flips[pixels].mean()),
                "holes": float(synthesised.holes[pixels].mean()),
                "source_bytes": variant.size,
            }


def draw(rows: Sequence[Mapping[str, Any]], stem: Path) -> None:
    """Plot quality over bytes, over the number of views, and over how many make a picture.

    The rows come from `summaries.means`. Draws only the first of several truths.
    """
    by_name: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["truth"] == rows[0]["truth"]:
            by_name.setdefault(row["variant"], []).append(row)
    plain = by_name["all"]
    with plots.plot(stem, 1, 3, (14, 4)) as (size, number, best):
        for name, colour in (("views", plots.BLUE), ("resolution", plots.ORANGE)):
            line = sorted([*plain, *by_name.get(name, [])], key=lambda row: row["source_bytes"])
            values = [row["source_bytes"] / 1e6 for row in line]
            size.plot(values, [row["psnr"] for row in line], "o-", color=colour, label=name)
        size.set(xscale="log", xlabel="views that are used, MB", ylabel="PSNR, dB (sRGB)")
        line = sorted([*plain, *by_name.get("views", [])], key=lambda row: int(row["value"]))
        counts = [int(row["value"]) for row in line]
        number.plot(counts, [row["psnr"] for row in line], "o-", color=plots.BLUE)
        number.set(xscale="log", xlabel="views that are used", ylabel="PSNR, dB (sRGB)")
        number.set_xticks(counts, counts, minor=False)
        number.set_xticks([], minor=True)
        line = by_name["best"]
        counts = [int(row["value"]) for row in line]
        best.plot(counts, [row["psnr"] for row in line], "o-", color=plots.BLUE)
        best.set(xlabel="views that a picture is made of", ylabel="PSNR, dB (sRGB)")
        for row, colour in zip(by_name["control"], (plots.GREY, plots.VERMILION), strict=True):
            for axes in (size, number, best):
                axes.axhline(row["psnr"], color=colour, linestyle="--", label=row["value"])
        size.legend()


def _developed(colour: Array, exposure: float, inside: Array) -> Array:
    shown = encode_srgb(tone_map(np.nan_to_num(colour), exposure, pictures.WHITE))
    shown[~inside] = 0
    return np.asarray(shown, np.float64)
