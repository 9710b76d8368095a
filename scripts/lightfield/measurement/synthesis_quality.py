"""What a light field is worth: views that were held out, synthesised from the others, against them.

Each variant changes one thing: how many views there are, of how many a picture is made, their
resolution, the precision of their depth. Two controls say what is owed to the method: the nearest
view as it stands, without its depth, and depth that belongs to other views.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.dataset.lightfield import LightField, View
from lightfield.export.source import Source
from lightfield.geometry.depth import with_precision
from lightfield.geometry.lenses import Array, Lens
from lightfield.imaging import images, pictures, plots
from lightfield.imaging.tonemap import encode_srgb, tone_map
from lightfield.measurement import metrics
from lightfield.synthesis.view import BEST, Sources, reader

MEANS = ("psnr", "ssim", "flip", "holes", "source_bytes")
# At the rig's centre a picture is inside, and towards the edge beyond this part of the radius.
INNER = 0.5


@dataclass(frozen=True)
class Variant:
    """``name`` says what is changed, ``value`` to what; ``size`` is the bytes of what is read."""

    name: str
    value: str
    sources: Sources
    best: int
    size: int


def variants(source: Source, views: Sequence[View]) -> Iterator[Variant]:
    """Yield the variants and controls of the ``views`` of a dataset, the plain one first."""
    lens, read = source.lens, reader(source)
    sizes = {view.name: source.path(view).stat().st_size for view in views}
    size = sum(sizes.values())
    whole = Sources(lens, views, read)
    yield Variant("all", str(len(views)), whole, BEST, size)
    for step in (2, 4, 8):
        some = views[::step]
        if len(some) >= 4:
            fewer = Sources(lens, some, read)
            yield Variant("views", str(len(some)), fewer, BEST, sum(sizes[v.name] for v in some))
    for best in (1, 2, 4, 8):
        yield Variant("best", str(best), whole, best, size)
    for part in (2, 4):
        small = lens.resized(lens.width // part, lens.height // part)

        def shrunk(view: View, small: Lens = small, part: int = part) -> tuple[Array, Array]:
            colour, distance = read(view)
            first = part // 2
            return pictures.shrunk(np.nan_to_num(colour), small.width, small.height), distance[
                first::part, first::part
            ][: small.height, : small.width]

        coarse = Sources(small, views, shrunk)
        yield Variant(
            "resolution", f"{small.width} × {small.height}", coarse, BEST, size // part**2
        )
    for precision in ("rounded", "half"):

        def held(view: View, precision: str = precision) -> tuple[Array, Array]:
            colour, distance = read(view)
            return colour, with_precision(distance, precision)

        yield Variant("depth", precision, Sources(lens, views, held), BEST, size)

    def flat(view: View) -> tuple[Array, Array]:
        colour, distance = read(view)
        return colour, np.where(np.isnan(distance), np.nan, np.inf)

    nearest = Sources(lens, views, flat)
    nearest.distances = whole.distances
    yield Variant("control", "nearest view alone", nearest, 1, size)
    after = dict(zip([view.name for view in views], [*views[1:], views[0]], strict=True))

    def mixed(view: View) -> tuple[Array, Array]:
        return read(view)[0], read(after[view.name])[1]

    yield Variant("control", "shuffled depth", Sources(lens, views, mixed), BEST, size)


def compare(
    variant: Variant, targets: LightField, truth: Source, exposure: float
) -> Iterator[dict[str, Any]]:
    """Yield a row for each view of ``targets``: psnr in decibel, ssim, flip, and part of holes.

    Holes are black in the picture and count as what they are. ``place`` says whether the view is
    well inside the cameras or towards their edge.
    """
    places = variant.sources.matrices[:, :3, 3]
    middle = places.mean(axis=0)
    radius = np.median(np.linalg.norm(places - middle, axis=-1))
    rays = targets.lens.pixel_rays()
    outside = np.isnan(rays[..., 0])
    for view in targets.views:
        made = variant.sources.synthesise(view.matrix, targets.lens, variant.best)
        true = images.read_image(truth.path(view), "RGB").colour
        one, other = (_developed(colour, exposure, outside) for colour in (true, made.colour))
        error = float(((one - other)[~outside] ** 2).mean())
        away = np.linalg.norm(view.matrix[:3, 3] - middle)
        yield {
            "variant": variant.name,
            "value": variant.value,
            "view": view.name,
            "place": "inside" if away <= INNER * radius else "edge",
            "psnr": -10 * float(np.log10(max(error, 1e-10))),
            "ssim": float(metrics.ssim_map(one, other)[~outside].mean()),
            "flip": float(metrics.flip_map(one, other)[~outside].mean()),
            "holes": made.hole_fraction(rays),
            "source_bytes": variant.size,
        }


def means(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row for each variant: the means over its views, of numbers or their texts."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["variant"], row["value"]), []).append(row)
    return [
        {"variant": variant, "value": value}
        | {name: float(np.mean([float(row[name]) for row in group])) for name in MEANS}
        for (variant, value), group in groups.items()
    ]


def draw(rows: Sequence[Mapping[str, Any]], stem: Path) -> None:
    """Plot the `means`: quality against the size of what it is made of, and of how many views."""
    by_name: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_name.setdefault(row["variant"], []).append(row)
    plain = by_name["all"]
    with plots.plot(stem, 1, 2, (10, 4)) as (size, best):
        for name, colour in (("views", plots.BLUE), ("resolution", plots.ORANGE)):
            line = sorted([*plain, *by_name.get(name, [])], key=lambda row: row["source_bytes"])
            values = [row["source_bytes"] / 1e6 for row in line]
            size.plot(values, [row["psnr"] for row in line], "o-", color=colour, label=name)
        size.set(xscale="log", xlabel="views that are used, MB", ylabel="PSNR, dB (sRGB)")
        line = by_name["best"]
        counts = [int(row["value"]) for row in line]
        best.plot(counts, [row["psnr"] for row in line], "o-", color=plots.BLUE)
        best.set(xlabel="views that a picture is made of", ylabel="PSNR, dB (sRGB)")
        for row, colour in zip(by_name["control"], (plots.GREY, plots.VERMILION), strict=True):
            for axes in (size, best):
                axes.axhline(row["psnr"], color=colour, linestyle="--", label=row["value"])
        size.legend()


def _developed(colour: Array, exposure: float, outside: Array) -> Array:
    shown = encode_srgb(tone_map(np.nan_to_num(colour), exposure, pictures.WHITE))
    shown[outside] = 0
    return np.asarray(shown, np.float64)
