"""The error of renders against their time: sampling plain, adaptive, guided, denoised.

Windows of the dataset's views are rendered in every way and compared with references of other seeds
(`lightfield.measurement.metrics` says how). What is rendered is kept with its time: killed and
started again, this goes on where it was. The time is Cycles' own for rendering, denoising included,
of one render the median over its seeds; it is right only where nothing else runs on the same core.

The slope of a method is that of its error over its time, both in logarithms. Plain path tracing's
is −1 over samples, whether indirect light is clamped or not: samples are clamped, not pixels. Two
things bend it. Where light is smooth, Cycles' Sobol points converge faster than independent ones
would; and where paths are rare and bright, leaving out the worst thousandth of pixels hides more of
them at few samples than at many. So the slope of all pixels is told too, which is −1 there, with
larger errors. Adaptive sampling and denoising are biased, so theirs are flatter.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean, median
from typing import Any

from lightfield.core.files import write_csv, write_json, write_text
from lightfield.core.progress import Progress
from lightfield.imaging import plots
from lightfield.measurement import metrics, strata
from lightfield.measurement.sampling import PLAIN as PLAIN_SAMPLING
from lightfield.measurement.sampling import standard_error
from lightfield.measurement.summaries import strata_table
from lightfield.measurement.trials import Trial, Trials, Window, both_see, nearest_view

PLAIN = "plain"
ADAPTIVE = "adaptive"
DENOISED = "denoised"
BOTH = "adaptive + denoised"
GUIDED = "path guiding"
OWN = "this scene's settings"

# Above 0.2, the fewest samples that adaptive sampling takes decide.
THRESHOLDS = (0.2, 0.1, 0.05, 0.02, 0.01)

# A reference's samples are split among so many seeds, whose differences tell its own error.
REFERENCE_SEEDS = 8

# Of a point's figures, those that are means over its renders' errors.
COMPARED = (
    "relative_mse",
    "relative_mse_whole",
    "relative_mse_unexposed",
    "mrse",
    "psnr",
    "ssim",
    "flip",
)

# Of a point's figures, the columns of its table.
FIGURES = (
    *("samples", "seconds", "relative_mse", "relative_mse_whole", "bias", "variance"),
    *("mse_seconds", "relative_mse_unexposed", "mrse", "psnr", "ssim", "flip"),
)

# What says which way a point is of.
WAY = ("method", "settings")

# The renders of one way, by window and seed.
Renders = Sequence[Sequence[Trial]]


@dataclass(frozen=True)
class Point:
    """One way to render, measured: means over windows and seeds.

    ``samples`` is the mean number that a pixel took; ``seconds`` are of one core, or of the GPU, a
    megapixel; ``standard_error`` is that of ``relative_mse``, over seeds. ``resolved``
    says whether the error is above the references' own, below which nothing is drawn or fitted.
    ``bias`` (squared) and ``variance`` add up to ``relative_mse_whole``; ``mse_seconds`` is that
    times ``seconds``, which is the same for any number of samples as long as nothing is biased.
    """

    method: str
    settings: Mapping[str, Any]
    samples: float
    seconds: float
    relative_mse: float
    relative_mse_whole: float
    relative_mse_unexposed: float
    mrse: float
    bias: float
    variance: float
    mse_seconds: float
    standard_error: float
    resolved: bool
    psnr: float
    ssim: float
    flip: float
    depth_error: float | None

    def figures(self) -> dict[str, Any]:
        """Return all figures as JSON can have them: no psnr of what is equal to its reference."""
        return {**asdict(self), "psnr": self.psnr if math.isfinite(self.psnr) else None}


def measure(
    maker: Trials,
    render: Mapping[str, Any],
    *,
    size: int,
    windows: int,
    octaves: int,
    reference_samples: int,
    seeds: int,
    name: str,
) -> dict[str, Any]:
    """Measure every way at so many ``windows`` of ``size``² pixels of each stratum.

    And at that of the first one's neighbour. Errors of whole views are those of the strata,
    weighted by their parts of the views. ``render`` is the scene's own. Sample counts are 1 to
    2^``octaves``, each rendered with ``seeds`` seeds; ``name`` is for the progress that is printed.
    """
    chosen, areas = strata.choose(maker, size, windows)
    near = nearest_view(maker.lightfield.views, chosen[0].view)
    if near:
        chosen.insert(1, replace(chosen[0], view=near))
    references, parts = referenced(maker, chosen, areas, reference_samples, name)
    own = weighted({s: own_error(list(places.values())) for s, places in parts.items()}, areas)

    on_cpu = maker.render(chosen[0], 1, {"samples": 1}).device == "CPU"
    ways = all_ways(render, octaves, guiding=on_cpu)
    progress = Progress(len(ways) * len(chosen) * seeds, f"{name}: trials", "renders")
    points: list[Point] = []
    by_stratum: dict[str, list[Point]] = {stratum: [] for stratum in parts}
    pairs = []
    for method, settings in ways:
        renders = []
        for window in chosen:
            renders.append([maker.render(window, 1 + seed, settings) for seed in range(seeds)])
            progress.done(seeds)
        for stratum, places in parts.items():
            inside = [renders[index] for index in places]
            by_stratum[stratum].append(compared(method, settings, inside, list(places.values())))
        points.append(together({s: found[-1] for s, found in by_stratum.items()}, areas, own))
        if near and references[0].depth is not None:
            apart = disagreement(maker, chosen, references, renders)
            pairs.append({"method": method, "settings": settings, **apart})
    return {
        "measured_on": {
            "probes": [window.name for window in chosen],
            "size": size,
            "resolution": [maker.lens.width, maker.lens.height],
            "seeds": seeds,
            "reference_samples": reference_samples,
            "device": "CPU" if on_cpu else "GPU",
            "path_guiding": "measured" if on_cpu else "Cycles has it only on processors",
        },
        **evaluated(points, own),
        "strata": {
            stratum: {
                "area": areas[stratum],
                "pixels": sum(int(place.counted.sum()) for place in places.values()),
                **evaluated(by_stratum[stratum], own_error(list(places.values()))),
            }
            for stratum, places in parts.items()
        },
        "neighbouring_views": pairs,
    }


def all_ways(
    render: Mapping[str, Any], octaves: int, guiding: bool
) -> list[tuple[str, dict[str, Any]]]:
    """Return (method, settings) of all that is measured; the scene's own settings come last."""
    counts = [2**octave for octave in range(octaves + 1)]
    ways: list[tuple[str, dict[str, Any]]] = []
    for denoise, by_count, by_threshold in ((False, PLAIN, ADAPTIVE), (True, DENOISED, BOTH)):
        ways += [(by_count, {"samples": n, "denoise": denoise}) for n in counts]
        ways += [
            (by_threshold, {"samples": counts[-1], "adaptive_threshold": t, "denoise": denoise})
            for t in THRESHOLDS
        ]
    # Elsewhere guiding stays as the .blend has it, off unless an artist turned it on.
    if guiding:
        ways += [(GUIDED, {"samples": n, "guiding": True}) for n in counts]
    own = {key: render[key] for key in ("samples", "adaptive_threshold", "denoise")}
    return [*ways, (OWN, own)]


def compared(
    method: str,
    settings: Mapping[str, Any],
    renders: Renders,
    references: Sequence[metrics.Reference],
) -> Point:
    """Compare the renders of one way with the windows' references."""
    errors = [
        [metrics.compare(render.colour, render.depth, reference) for render in seeds]
        for seeds, reference in zip(renders, references, strict=True)
    ]
    flat = [error for seeds in errors for error in seeds]
    mean = {name: fmean(getattr(error, name) for error in flat) for name in COMPARED}
    parts = [
        metrics.bias_and_variance([render.colour for render in seeds], reference)
        for seeds, reference in zip(renders, references, strict=True)
    ]
    height, width = references[0].mask.shape
    seconds = fmean(median(render.seconds for render in seeds) for seeds in renders)
    seconds *= 1e6 / (width * height)
    depths = [error.depth for error in flat if error.depth is not None]
    return Point(
        method=method,
        settings=settings,
        samples=fmean(render.samples for seeds in renders for render in seeds),
        seconds=seconds,
        **mean,
        bias=fmean(bias for bias, _ in parts),
        variance=fmean(variance for _, variance in parts),
        mse_seconds=mean["relative_mse_whole"] * seconds,
        standard_error=standard_error(
            [fmean(error.relative_mse for error in seed) for seed in zip(*errors, strict=True)]
        ),
        resolved=mean["relative_mse"] > own_error(references),
        depth_error=fmean(depths) if depths else None,
    )


def referenced(
    maker: Trials, windows: Sequence[Window], areas: Mapping[str, float], samples: int, name: str
) -> tuple[list[metrics.Reference], dict[str, dict[int, metrics.Reference]]]:
    """Return the windows' references, of so many ``samples``, and by stratum as `parted` does."""
    # Before all others: Cycles is set up for the parts of light.
    pilot = maker.pilot()
    kinds = [strata.classes(pilot, window)[0] for window in windows]
    progress = Progress(len(windows), f"{name}: references")
    made = []
    for window in windows:
        made.append(maker.reference(window, REFERENCE_SEEDS, samples // REFERENCE_SEEDS))
        progress.done()
    references = metrics.exposed_alike(made)
    return references, parted(references, kinds, areas)


def parted(
    references: Sequence[metrics.Reference],
    kinds: Sequence[strata.Classes],
    areas: Mapping[str, float],
) -> dict[str, dict[int, metrics.Reference]]:
    """Return for each stratum the windows' references, by number, of which its pixels count."""
    found = {}
    for stratum in areas:
        masks = [kind == strata.STRATA.index(stratum) for kind in kinds]
        places = {
            index: replace(reference, part=mask)
            for index, (reference, mask) in enumerate(zip(references, masks, strict=True))
            if (reference.mask & mask).sum() >= strata.FEWEST_PIXELS
        }
        if places:
            found[stratum] = places
    return found


def weighted(values: Mapping[str, float], areas: Mapping[str, float]) -> float:
    """Return the mean of the strata's values, by their parts of the whole views."""
    return sum(areas[s] * value for s, value in values.items()) / sum(areas[s] for s in values)


def together(points: Mapping[str, Point], areas: Mapping[str, float], own: float) -> Point:
    """Return what one way gives in whole views, of its points in the strata.

    ``own`` is the references' own error.
    """
    names = ("samples", "seconds", *COMPARED, "bias", "variance")
    mean = {
        name: weighted({s: getattr(point, name) for s, point in points.items()}, areas)
        for name in names
    }
    total = sum(areas[s] for s in points)
    errors = [areas[s] * point.standard_error / total for s, point in points.items()]
    depths = {s: p.depth_error for s, p in points.items() if p.depth_error is not None}
    one = next(iter(points.values()))
    return Point(
        method=one.method,
        settings=one.settings,
        **mean,
        mse_seconds=mean["relative_mse_whole"] * mean["seconds"],
        standard_error=math.hypot(*errors),
        resolved=mean["relative_mse"] > own,
        depth_error=weighted(depths, areas) if depths else None,
    )


def own_error(references: Sequence[metrics.Reference]) -> float:
    return fmean(reference.own_error for reference in references)


def evaluated(points: Sequence[Point], own: float) -> dict[str, Any]:
    """Return what follows from the points: slopes, the Pareto front, and what each way saves.

    ``own`` is the references' own error.
    """
    seen = [point for point in points if point.resolved]
    lines = {
        method: fitted([point for point in seen if point.method == method])
        for method in dict.fromkeys(point.method for point in points)
    }
    plain = lines[PLAIN]
    saved = []
    if plain:
        saved = [
            {
                "method": point.method,
                "settings": point.settings,
                "relative_mse": point.relative_mse,
                "times_faster": plain["over_time"].inverse(point.relative_mse) / point.seconds,
                "times_fewer_samples": plain["over_samples"].inverse(point.relative_mse)
                / point.samples,
            }
            for point in seen
            if point.method != PLAIN
        ]
    front = metrics.pareto([p.seconds for p in seen], [p.relative_mse for p in seen])
    return {
        "reference_error": own,
        "slopes": {
            method: {name: asdict(line) for name, line in found.items()}
            for method, found in lines.items()
            if found
        },
        "methods": by_method(seen, 0.5),
        "methods_at_most_samples": by_method(seen, 1),
        "pareto_front": [seen[index].figures() for index in front],
        "against_plain_at_equal_error": saved,
        "settings": [point.figures() for point in points if point.method == OWN],
        "points": [point.figures() for point in points],
    }


def by_method(points: Sequence[Point], part: float) -> list[dict[str, Any]]:
    """Return each method's error at equal time, and its time at equal error.

    Equal to those of plain path tracing at one of its points: with 0.5 as ``part`` that in the
    middle, with 1 that of most samples. Interpolated between a method's own points, and None where
    these do not reach so far; where its cheapest point has less error already, it is that one's
    time.
    """
    plain = sorted((p for p in points if p.method == PLAIN), key=lambda p: p.seconds)
    if not plain:
        return []
    equal = plain[int(part * (len(plain) - 1) + 0.5)]
    found = []
    for method in dict.fromkeys(p.method for p in points if p.method != OWN):
        own = sorted((p for p in points if p.method == method), key=lambda p: p.seconds)
        seconds = metrics.interpolated(
            equal.relative_mse, [(p.relative_mse, p.seconds) for p in own]
        )
        if seconds is None and own[0].relative_mse <= equal.relative_mse:
            seconds = own[0].seconds
        found.append(
            {
                "method": method,
                "seconds": equal.seconds,
                "error": metrics.interpolated(
                    equal.seconds, [(p.seconds, p.relative_mse) for p in own]
                ),
                "equal_error": equal.relative_mse,
                "seconds_at_equal_error": seconds,
                "times_faster": seconds and equal.seconds / seconds,
                "nearest": min(own, key=lambda p: abs(p.seconds - equal.seconds)).figures(),
            }
        )
    return found


def fitted(points: Sequence[Point]) -> dict[str, metrics.Line]:
    """Fit the error of some points over time and over samples; nothing if they are too few."""
    lines: dict[str, metrics.Line] = {}
    for prefix, error in (("", "relative_mse"), ("of_all_pixels_", "relative_mse_whole")):
        # Where it is nearly all in a few pixels, it may be below 0 by chance.
        known = [point for point in points if getattr(point, error) > 0]
        errors = [getattr(point, error) for point in known]
        by_time = metrics.fit([point.seconds for point in known], errors)
        by_samples = metrics.fit([point.samples for point in known], errors)
        if by_time and by_samples:
            lines |= {f"{prefix}over_time": by_time, f"{prefix}over_samples": by_samples}
        elif not prefix:
            break
    return lines


def disagreement(
    maker: Trials,
    windows: Sequence[Window],
    references: Sequence[metrics.Reference],
    renders: Renders,
) -> dict[str, float | None]:
    """Return how the first two views disagree, as `metrics.Disagreement`, the mean over seeds.

    And how far their biases agree, of the renders of all seeds.
    """
    pair, places = (references[0], references[1]), (windows[0], windows[1])
    seen = both_see((maker.camera(places[0].view), maker.camera(places[1].view)), places, pair)
    if not len(seen[0]):
        return {}
    found = [
        asdict(metrics.disagreement((first.colour, second.colour), pair, seen))
        for first, second in zip(renders[0], renders[1], strict=True)
    ]
    colours = [render.colour for render in renders[0]], [render.colour for render in renders[1]]
    means: dict[str, float | None] = {
        name: fmean(entry[name] for entry in found) for name in found[0]
    }
    return means | {"bias_correlation": metrics.bias_correlation(colours, pair, seen)}


def write(stem: Path, content: Mapping[str, Any]) -> None:
    """Write the points as ``stem``.csv, a plot as .svg and .png, tables as .md, all as .json."""
    rows = []
    for stratum, measured in {"whole views": content, **content["strata"]}.items():
        for point in measured["points"]:
            settings = {**PLAIN_SAMPLING, **point["settings"]}
            limits = {"most_samples": settings["samples"]}
            limits |= {name: settings[name] for name in ("adaptive_threshold", "denoise")}
            figures = {name: value for name, value in point.items() if name not in WAY}
            way = {"stratum": stratum, "method": point["method"], **limits}
            rows.append({**way, **figures, "pareto": point in measured["pareto_front"]})
    write_csv(stem.with_name(stem.name + ".csv"), rows)
    _draw(stem, content)
    write_text(stem.with_name(stem.name + ".md"), tables(stem.name, content))
    write_json(stem.with_name(stem.name + ".json"), content)


def tables(name: str, content: Mapping[str, Any]) -> str:
    """Return the methods at equal time and at equal error, and all figures, in Markdown."""
    methods = content["methods"]
    if not methods:
        return f"# {name}\n\nNo point of plain path tracing is above the references' own error.\n"
    seconds, error = methods[0]["seconds"], methods[0]["equal_error"]
    common = {
        (pair["method"], json.dumps(pair["settings"])): pair.get("bias_correlation")
        for pair in content["neighbouring_views"]
    }
    lines = [
        f"# {name}: methods at equal time and at equal error",
        "",
        "The error is the relative mean squared error of all but the worst thousandth of pixels;",
        "seconds are those of a megapixel; — is outside what was measured.",
        "",
        f"| method | error at {seconds:.3g} s | seconds at error {error:.2g} | times faster |",
        "| --- | ---: | ---: | ---: |",
        *(
            _row(m["method"], m["error"], m["seconds_at_equal_error"], m["times_faster"])
            for m in methods
        ),
        "",
        f"Of each method what was measured nearest to {seconds:.3g} s. Bias (squared) and variance",
        "add up to the error of all pixels, and × s is that times the seconds; a bias below 0 is",
        "within the noise of 0. In common is the correlation of the bias with the neighbouring",
        "view's; texture has 1.",
        "",
        "| method | samples | s | error | of all pixels | bias | variance | × s | unexposed "
        "| MRSE | PSNR | SSIM | FLIP | in common |",
        "| --- " + "| ---: " * 13 + "|",
    ]
    for method in methods:
        point = method["nearest"]
        figures = [point[figure] for figure in FIGURES]
        key = (point["method"], json.dumps(point["settings"]))
        lines.append(_row(point["method"], *figures, common.get(key)))
    columns, rows = strata_table(content)
    lines += [
        "",
        "By stratum, what pixels show, which is a part of the views: the slope of a method's error",
        "over time, its error in the time of plain path tracing in the middle of its points, its",
        "seconds to the error of that, and how many times faster it is there, and at the error of",
        "plain path tracing with most samples.",
        "",
        f"| {' | '.join(columns)} |",
        "| --- | ---: | --- " + "| ---: " * (len(columns) - 3) + "|",
        *(_row(*row) for row in rows),
    ]
    return "\n".join([*lines, ""])


def _row(*cells: str | float | None) -> str:
    texts = [
        "—" if cell is None else cell if isinstance(cell, str) else f"{cell:.3g}" for cell in cells
    ]
    return f"| {' | '.join(texts)} |"


def _draw(stem: Path, content: Mapping[str, Any]) -> None:
    """Draw error over time, with slopes, the Pareto front, and where the scene's settings lie."""

    def figures(name: str, points: Sequence[Mapping[str, Any]]) -> list[float]:
        return [point[name] for point in points]

    with plots.plot(stem, 1, 2, size=(18, 5.5)) as (axes, beside):
        methods = dict.fromkeys(p["method"] for p in content["points"] if p["method"] != OWN)
        for method, colour, marker in zip(methods, plots.COLOURS, plots.MARKERS, strict=False):
            own = [p for p in content["points"] if p["method"] == method and p["resolved"]]
            axes.errorbar(
                *(figures(name, own) for name in ("seconds", "relative_mse", "standard_error")),
                color=colour,
                marker=marker,
                linewidth=1,
                label=method + _slopes(content["slopes"].get(method, {})),
            )
        front = content["pareto_front"]
        axes.plot(
            *(figures(name, front) for name in ("seconds", "relative_mse")),
            color=plots.GREY,
            linewidth=6,
            alpha=0.3,
            label="Pareto front",
        )
        own = [point for point in content["settings"] if point["resolved"]]
        if own:
            axes.plot(
                *(figures(name, own) for name in ("seconds", "relative_mse")),
                marker="*",
                markersize=15,
                linestyle="none",
                color="black",
                markerfacecolor="none",
                label=OWN,
            )
        axes.axhline(
            content["reference_error"],
            color="black",
            linestyle=":",
            linewidth=1,
            label="the references' own error (subtracted)",
        )
        unit = "core" if content["measured_on"]["device"] == "CPU" else "GPU"
        axes.set(
            xscale="log",
            yscale="log",
            title=f"{stem.name}: error against render time",
            xlabel=f"render time, {unit} seconds per megapixel",
            ylabel="relative mean squared error of all but the worst thousandth of pixels",
        )
        axes.legend(fontsize=8)
        strata_and_looks = zip(
            content["strata"].items(), plots.COLOURS, plots.MARKERS, strict=False
        )
        for (stratum, found), colour, marker in strata_and_looks:
            for method, line in ((PLAIN, "-"), (DENOISED, ":")):
                own = [p for p in found["points"] if p["method"] == method and p["resolved"]]
                beside.plot(
                    *(figures(name, own) for name in ("seconds", "relative_mse")),
                    color=colour,
                    marker=marker,
                    linestyle=line,
                    linewidth=1,
                    label=f"{stratum}, {found['area']:.1%} of the views, {method}"
                    + _slopes(found["slopes"].get(method, {})),
                )
        beside.set(
            xscale="log",
            yscale="log",
            title="by what pixels show",
            xlabel=axes.get_xlabel(),
        )
        beside.xaxis.set_minor_formatter("")
        # Beside the axes: of seven strata it would hide the curves.
        beside.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))


def _slopes(lines: Mapping[str, Mapping[str, float]]) -> str:
    """Return the slopes over time, each ± its standard error, as text; nothing without them."""
    text = ""
    for name, form in (
        ("over_time", ", slope {}"),
        ("of_all_pixels_over_time", " (all pixels {})"),
    ):
        if name in lines:
            slope = f"{lines[name]['slope']:.2f} ± {lines[name]['slope_error']:.2f}"
            text += form.format(slope.replace("-", "−"))
    return text
