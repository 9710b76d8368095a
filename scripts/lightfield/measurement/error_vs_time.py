"""Measures the error of renders against their time: plain, adaptive, guided and denoised sampling.

An `Experiment` renders windows of the dataset's views with every method. A seed's time is Cycles'
own for rendering, with denoising. A window counts with the median of its seeds. The times are right
only if nothing else runs on the same core.

The slope of a method is the slope of its error over its time, both in logarithms. Plain path
tracing has −1 over samples, also with clamped indirect light, because Cycles clamps samples, not
pixels. Two effects bend the line. In smooth light, Cycles' Sobol points converge faster than
independent points. In rare bright light, leaving out the worst thousandth of pixels hides more
light at few samples than at many. There the slope of all pixels, which is reported too, stays at
−1, with a larger standard error. Adaptive sampling and denoising are biased: their slopes are
flatter.
"""

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import write_csv, write_json, write_text
from lightfield.core.units import duration
from lightfield.formats.render_block import RenderBlock
from lightfield.imaging import plots
from lightfield.measurement import advice, metrics, strata, trials
from lightfield.measurement.effort import Line, effort_within, fit, interpolated
from lightfield.measurement.experiment import (
    WHOLE_VIEWS,
    Experiment,
    Method,
    Renders,
    mean_own_error,
    over_views,
    samples_of_reference,
)
from lightfield.measurement.summaries import strata_table
from lightfield.measurement.trials import Trial, Trials, both_see, nearest_view
from lightfield.planning.sampling import DENOISED, standard_error
from lightfield.planning.sampling import PLAIN as PLAIN_SAMPLING
from lightfield.stages.measurement import ErrorVsTime, ErrorVsTimeSettings

PLAIN = "plain"
ADAPTIVE = "adaptive"
BOTH = "adaptive + denoised"
_GUIDED = "path guiding"
SCENE_SETTINGS = "this scene's settings"

# Thresholds above 0.2 have no effect: adaptive sampling takes its fewest samples.
_THRESHOLDS = (0.2, 0.1, 0.05, 0.02, 0.01)

# The figures of a point that are means over the errors of its renders.
_COMPARED = (
    "relative_mse",
    "relative_mse_whole",
    "relative_mse_unexposed",
    "mrse",
    "psnr",
    "ssim",
    "flip",
)

# The figures of a point that have a column in its table.
_FIGURES = (
    "samples",
    "seconds",
    "relative_mse",
    "relative_mse_whole",
    "bias",
    "variance",
    "mse_seconds",
    "relative_mse_unexposed",
    "mrse",
    "psnr",
    "ssim",
    "flip",
)

# The figures of `Denoising` that have a column in its table.
_DENOISING = ("side", "seconds", "in_windows")

# The keys of a point that name its method. All others are figures.
_METHOD_KEYS = ("method", "settings")


@dataclass(frozen=True)
class Point:
    """The figures of one method: means over windows and seeds.

    - ``samples``: the mean number of samples that a pixel took.
    - ``seconds``: the time that one core, or the GPU, takes for a megapixel.
    - ``standard_error``: the standard error of ``relative_mse`` over seeds.
    - ``resolved``: whether the error is above the references' own error. Points below it are
      neither drawn nor fitted.
    - ``bias`` (squared) and ``variance``: they add up to ``relative_mse_whole``.
    - ``mse_seconds``: ``relative_mse_whole`` times ``seconds``. Without bias, it does not
      depend on the number of samples.
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
        """Return all figures for JSON, with null for the infinite psnr of an exact render."""
        return {**asdict(self), "psnr": self.psnr if math.isfinite(self.psnr) else None}


def make(job: ErrorVsTime) -> None:
    """Measure every method on a scene, and write the figures, tables and plots."""
    lightfield, renderer = trials.of_calibrated(job)
    write(job.output, measure(renderer, lightfield.render, job.settings, job.output.name))


def measure(
    renderer: Trials,
    render: RenderBlock,
    settings: ErrorVsTimeSettings,
    name: str,
) -> dict[str, Any]:
    """Measure every method on windows of each stratum.

    One more window shows the same place in the first one's neighbouring view. ``render`` is the
    scene's own block. Sample counts are 1 to 2^octaves, each rendered with several seeds. Errors of
    whole views are the mean of the strata's, weighted by their areas. Then try changes of the
    settings on the same windows. ``name`` starts the progress lines.
    """
    chosen, areas = strata.choose(renderer, settings.size, settings.probes)
    neighbour = nearest_view(renderer.lightfield.views, chosen[0].view)
    if neighbour:
        chosen.insert(1, replace(chosen[0], view=neighbour))
    experiment = Experiment.stratified(renderer, chosen, areas, settings.reference, name)
    on_cpu = experiment.device == "CPU"
    methods = _all_methods(render, settings.octaves, guiding=on_cpu)
    experiment.run(methods, range(1, 1 + settings.seeds), f"{name}: trials")
    points = {
        stratum: [
            measured_point(
                method, [experiment.renders(method)[n] for n in references], references.values()
            )
            for method in methods
        ]
        for stratum, references in experiment.strata.items()
    }
    changes = advice.measure(experiment, render, renderer.inventory, name)
    return {
        "measured_on": {
            **experiment.described(),
            "seeds": settings.seeds,
            "reference_samples": samples_of_reference(settings.reference),
            "device": experiment.device,
            "path_guiding": "measured" if on_cpu else "Cycles has it only on processors",
        },
        **evaluated(_points_of_whole_views(points, experiment), experiment.reference_error),
        "strata": {
            stratum: {
                "area": areas[stratum],
                "pixels": sum(int(reference.counted.sum()) for reference in references.values()),
                **evaluated(points[stratum], mean_own_error(references.values())),
            }
            for stratum, references in experiment.strata.items()
        },
        "neighbouring_views": _neighbour_disagreements(experiment, methods) if neighbour else [],
        "changes": changes,
    }


def _all_methods(render: RenderBlock, octaves: int, guiding: bool) -> list[Method]:
    """Return all methods to measure. The scene's own settings come last."""
    counts = [2**octave for octave in range(octaves + 1)]
    methods: list[Method] = []
    for denoise, by_count, by_threshold in ((False, PLAIN, ADAPTIVE), (True, DENOISED, BOTH)):
        methods += [Method(by_count, {"samples": n, "denoise": denoise}) for n in counts]
        for threshold in _THRESHOLDS:
            settings = {"samples": counts[-1], "adaptive_threshold": threshold, "denoise": denoise}
            methods.append(Method(by_threshold, settings))
    # In all other methods guiding stays as the .blend has it, which is usually off.
    if guiding:
        methods += [Method(_GUIDED, {"samples": n, "guiding": True}) for n in counts]
    own_settings = {
        "samples": render.samples,
        "adaptive_threshold": render.adaptive_threshold,
        "denoise": render.denoise,
    }
    return [*methods, Method(SCENE_SETTINGS, own_settings)]


def measured_point(
    method: Method, renders: Renders, references: Collection[metrics.Reference]
) -> Point:
    """Compare a method's renders, by window and seed, with the windows' references."""
    errors = [
        [metrics.compare(trial.colour, trial.depth, reference) for trial in trials]
        for trials, reference in zip(renders, references, strict=True)
    ]
    all_errors = [error for of_window in errors for error in of_window]
    means = {name: fmean(getattr(error, name) for error in all_errors) for name in _COMPARED}
    parts = [
        metrics.bias_and_variance([trial.colour for trial in trials], reference)
        for trials, reference in zip(renders, references, strict=True)
    ]
    pixels = renders[0][0].colour[..., 0].size
    seconds = fmean(median(trial.seconds for trial in trials) for trials in renders)
    seconds *= 1e6 / pixels
    depths = [error.depth for error in all_errors if error.depth is not None]
    errors_of_seeds = [
        fmean(error.relative_mse for error in of_seed) for of_seed in zip(*errors, strict=True)
    ]
    return Point(
        method=method.name,
        settings=method.settings,
        samples=fmean(trial.samples for trials in renders for trial in trials),
        seconds=seconds,
        **means,
        bias=fmean(bias for bias, _ in parts),
        variance=fmean(variance for _, variance in parts),
        mse_seconds=means["relative_mse_whole"] * seconds,
        standard_error=standard_error(errors_of_seeds),
        resolved=means["relative_mse"] > mean_own_error(references),
        depth_error=fmean(depths) if depths else None,
    )


def _points_of_whole_views(
    points: Mapping[str, Sequence[Point]], experiment: Experiment
) -> list[Point]:
    """Return each method's point of whole views, from its points in the strata."""
    return [
        whole_views_point(
            dict(zip(points, of_method, strict=True)),
            experiment.areas,
            experiment.reference_error,
        )
        for of_method in zip(*points.values(), strict=True)
    ]


def whole_views_point(
    points: Mapping[str, Point], areas: Mapping[str, float], reference_error: float
) -> Point:
    """Return a method's point of whole views: the strata's points, weighted by their areas.

    ``reference_error`` is the references' own error in whole views.
    """
    names = ("samples", "seconds", *_COMPARED, "bias", "variance")
    means = {
        name: over_views({s: getattr(point, name) for s, point in points.items()}, areas)
        for name in names
    }
    total = sum(areas[stratum] for stratum in points)
    errors = [areas[s] * point.standard_error / total for s, point in points.items()]
    depths = {s: p.depth_error for s, p in points.items() if p.depth_error is not None}
    first = next(iter(points.values()))
    return Point(
        method=first.method,
        settings=first.settings,
        **means,
        mse_seconds=means["relative_mse_whole"] * means["seconds"],
        standard_error=math.hypot(*errors),
        resolved=means["relative_mse"] > reference_error,
        depth_error=over_views(depths, areas) if depths else None,
    )


def evaluated(points: Sequence[Point], reference_error: float) -> dict[str, Any]:
    """Return the slopes, the Pareto front, and the savings of each method, from the points.

    ``reference_error`` is the references' own error. Only ``points`` and ``settings`` include
    points below it.
    """
    resolved = [point for point in points if point.resolved]
    lines = {
        method: fitted([point for point in resolved if point.method == method])
        for method in dict.fromkeys(point.method for point in points)
    }
    front = metrics.pareto([p.seconds for p in resolved], [p.relative_mse for p in resolved])
    return {
        "reference_error": reference_error,
        "slopes": {
            method: {name: asdict(line) for name, line in fits.items()}
            for method, fits in lines.items()
            if fits
        },
        "methods": by_method(resolved, 0.5),
        "methods_at_most_samples": by_method(resolved, 1),
        "pareto_front": [resolved[index].figures() for index in front],
        "against_plain_at_equal_error": savings(resolved, lines[PLAIN]),
        "settings": [point.figures() for point in points if point.method == SCENE_SETTINGS],
        "points": [point.figures() for point in points],
    }


def savings(points: Sequence[Point], plain: Mapping[str, Line]) -> list[dict[str, Any]]:
    """Return how many times less time and samples each point takes than plain path tracing.

    ``plain`` has the lines of `fitted` of plain path tracing. Without lines the result is empty.
    """
    if not plain:
        return []
    return [
        {
            "method": point.method,
            "settings": point.settings,
            "relative_mse": point.relative_mse,
            "times_faster": plain["over_time"].inverse(point.relative_mse) / point.seconds,
            "times_fewer_samples": plain["over_samples"].inverse(point.relative_mse)
            / point.samples,
        }
        for point in points
        if point.method != PLAIN
    ]


def by_method(points: Sequence[Point], part: float) -> list[dict[str, Any]]:
    """Return each method's error at equal time, and its time at equal error.

    One of plain path tracing's points sets the equal time and the equal error. With ``part`` 0.5 it
    is the middle point, with 1 the point of most samples. The error at equal time is interpolated
    between a method's own points, and None beyond them. `effort_within` gives the time.
    """
    plain = sorted((p for p in points if p.method == PLAIN), key=lambda p: p.seconds)
    if not plain:
        return []
    equal = plain[int(part * (len(plain) - 1) + 0.5)]
    rows = []
    for method in dict.fromkeys(p.method for p in points if p.method != SCENE_SETTINGS):
        line = sorted((p for p in points if p.method == method), key=lambda p: p.seconds)
        curve = [(p.seconds, p.relative_mse) for p in line]
        seconds = effort_within(equal.relative_mse, curve)
        rows.append(
            {
                "method": method,
                "seconds": equal.seconds,
                "error": interpolated(equal.seconds, curve),
                "equal_error": equal.relative_mse,
                "seconds_at_equal_error": seconds,
                "times_faster": seconds and equal.seconds / seconds,
                "nearest": min(line, key=lambda p: abs(p.seconds - equal.seconds)).figures(),
            }
        )
    return rows


def fitted(points: Sequence[Point]) -> dict[str, Line]:
    """Fit the errors of a method's points over time and over samples. Empty for too few points."""
    lines: dict[str, Line] = {}
    for prefix, error in (("", "relative_mse"), ("of_all_pixels_", "relative_mse_whole")):
        # If a few pixels dominate an error, it may be below 0 by chance.
        positive = [point for point in points if getattr(point, error) > 0]
        errors = [getattr(point, error) for point in positive]
        by_time = fit([point.seconds for point in positive], errors)
        by_samples = fit([point.samples for point in positive], errors)
        if by_time and by_samples:
            lines[f"{prefix}over_time"] = by_time
            lines[f"{prefix}over_samples"] = by_samples
        elif not prefix:
            break
    return lines


def _neighbour_disagreements(
    experiment: Experiment, methods: Sequence[Method]
) -> list[dict[str, Any]]:
    """Return how the first two windows, of neighbouring views, disagree under each method.

    Each entry has the keys of `metrics.Disagreement`, as means over the seeds. It also has
    ``bias_correlation``, how far the views' biases agree, from the renders of all seeds. Without
    depth there is no entry. Without a surface that both views see, an entry has no figures.
    """
    references = (experiment.references[0], experiment.references[1])
    if references[0].depth is None:
        return []
    windows = (experiment.windows[0], experiment.windows[1])
    cameras = (
        experiment.renderer.camera(windows[0].view),
        experiment.renderer.camera(windows[1].view),
    )
    common_pixels = both_see(cameras, windows, references)
    entries = []
    for method in methods:
        entry: dict[str, Any] = {"method": method.name, "settings": method.settings}
        if len(common_pixels[0]):
            renders = experiment.renders(method)
            entry |= disagreement((renders[0], renders[1]), references, common_pixels)
        entries.append(entry)
    return entries


def disagreement(
    renders: tuple[Sequence[Trial], Sequence[Trial]],
    references: tuple[metrics.Reference, metrics.Reference],
    common_pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> dict[str, float | None]:
    """Return how two windows' renders of the same seeds disagree at their common pixels."""
    by_seed = [
        asdict(metrics.disagreement((first.colour, second.colour), references, common_pixels))
        for first, second in zip(*renders, strict=True)
    ]
    means: dict[str, float | None] = {
        name: fmean(figures[name] for figures in by_seed) for name in by_seed[0]
    }
    colours = [trial.colour for trial in renders[0]], [trial.colour for trial in renders[1]]
    means["bias_correlation"] = metrics.bias_correlation(colours, references, common_pixels)
    return means


def write(stem: Path, content: Mapping[str, Any]) -> None:
    """Write the points as ``stem``.csv, a plot as .svg and .png, tables as .md, all as .json."""
    write_csv(stem.with_name(stem.name + ".csv"), _csv_rows(content))
    draw(stem, content)
    write_text(stem.with_name(stem.name + ".md"), tables(stem.name, content))
    write_json(stem.with_name(stem.name + ".json"), content)


def _csv_rows(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a row for each point of whole views and of each stratum."""
    rows = []
    for stratum, measured in {WHOLE_VIEWS: content, **content["strata"]}.items():
        for point in measured["points"]:
            settings = {**PLAIN_SAMPLING, **point["settings"]}
            rows.append(
                {
                    "stratum": stratum,
                    "method": point["method"],
                    "most_samples": settings["samples"],
                    "adaptive_threshold": settings["adaptive_threshold"],
                    "denoise": settings["denoise"],
                    **{name: value for name, value in point.items() if name not in _METHOD_KEYS},
                    "pareto": point in measured["pareto_front"],
                }
            )
    return rows


def tables(name: str, content: Mapping[str, Any]) -> str:
    """Return the methods at equal time and at equal error, all figures, and advice, in Markdown."""
    if content["methods"]:
        lines = [
            *_equal_table(name, content),
            *_figures_table(content),
            *_strata_table(content),
            *_denoising_table(content),
        ]
    else:
        lines = [
            f"# {name}",
            "",
            "No point of plain path tracing is above the references' own error.",
        ]
    return "\n".join([*lines, *advice.table(content["changes"]), ""])


def _equal_table(name: str, content: Mapping[str, Any]) -> list[str]:
    methods = content["methods"]
    seconds = methods[0]["seconds"]
    error = methods[0]["equal_error"]
    return [
        f"# {name}: methods at equal time and at equal error",
        "",
        "The error is the relative mean squared error of all but the worst thousandth of pixels.",
        "Seconds count for a megapixel. — is outside the measured range.",
        "",
        f"| method | error at {duration(seconds)} | seconds at error {error:.2g} | times faster |",
        "| --- | ---: | ---: | ---: |",
        *(
            _row(m["method"], m["error"], m["seconds_at_equal_error"], m["times_faster"])
            for m in methods
        ),
    ]


def _figures_table(content: Mapping[str, Any]) -> list[str]:
    bias_correlations = {
        (pair["method"], json.dumps(pair["settings"])): pair.get("bias_correlation")
        for pair in content["neighbouring_views"]
    }
    lines = [
        "",
        f"Each method's point nearest to {duration(content['methods'][0]['seconds'])}.",
        "Bias (squared) and variance add",
        "up to the error of all pixels. × s is that error times the seconds. A bias below 0 is",
        "within the noise of 0. In common is the correlation of the bias with the neighbouring",
        "view's. Texture has 1.",
        "",
        "| method | samples | s | error | of all pixels | bias | variance | × s | unexposed "
        "| MRSE | PSNR | SSIM | FLIP | in common |",
        "| --- " + "| ---: " * 13 + "|",
    ]
    for method in content["methods"]:
        point = method["nearest"]
        key = (point["method"], json.dumps(point["settings"]))
        figures = [point[figure] for figure in _FIGURES]
        lines.append(_row(point["method"], *figures, bias_correlations.get(key)))
    return lines


def _strata_table(content: Mapping[str, Any]) -> list[str]:
    columns, rows = strata_table(content)
    return [
        "",
        "The strata are what pixels show. The columns are a stratum's part of the views, and the",
        "slope of a method's error over time. The middle point of plain path tracing sets the",
        "equal time and the equal error. Then come the seconds to that error, how many times",
        "faster a method is there, and at the error of plain path tracing with most samples.",
        "",
        f"| {' | '.join(columns)} |",
        "| --- | ---: | --- " + "| ---: " * (len(columns) - 3) + "|",
        *(_row(*row) for row in rows),
    ]


def _denoising_table(content: Mapping[str, Any]) -> list[str]:
    """Return the denoiser's time in the windows, which is not counted, and in a larger one."""
    measured_on = content["measured_on"]
    side = measured_on["size"]
    return [
        "",
        f"Denoising a megapixel takes longer in windows of {side}² than in a view. So all times",
        "count it as in a larger window:",
        "",
        f"| denoiser | side of the larger window | its s a megapixel | s in windows of {side}² |",
        "| --- | ---: | ---: | ---: |",
        *(
            _row(
                f"`{advice.yaml_of(measured['settings'])}`", *(measured[key] for key in _DENOISING)
            )
            for measured in content["measured_on"]["denoising"]
        ),
    ]


def _row(*cells: str | float | None) -> str:
    texts = [
        "—" if cell is None else cell if isinstance(cell, str) else f"{cell:.3g}" for cell in cells
    ]
    return f"| {' | '.join(texts)} |"


def draw(stem: Path, content: Mapping[str, Any]) -> None:
    """Draw error over time as ``stem``.svg and .png: by method, and beside it by stratum."""
    unit = "core" if content["measured_on"]["device"] == "CPU" else "GPU"
    with plots.plot(stem, 1, 2, size=(14, 8.4)) as (by_method_axes, by_stratum_axes):
        _draw_methods(by_method_axes, content)
        by_method_axes.set_title(f"{stem.name}: error against render time")
        _draw_strata(by_stratum_axes, content)
        by_stratum_axes.set_title("by what pixels show")
        for axes in (by_method_axes, by_stratum_axes):
            if axes.has_data():
                # Put the legend below the axes: it would hide curves.
                axes.legend(loc="upper left", bbox_to_anchor=(0, -0.12), fontsize=9)
            else:
                # A logarithmic axis without data has no limits.
                axes.set(xlim=(1, 100), ylim=(1e-3, 1))
                axes.text(2, 0.03, "No error is above the references' own.")
            axes.set(
                xscale="log",
                yscale="log",
                xlabel=f"render time, {unit} seconds per megapixel",
                ylabel="relative mean squared error\nof all but the worst thousandth of pixels",
            )
            axes.xaxis.set_minor_formatter("")


def _draw_methods(axes: Any, content: Mapping[str, Any]) -> None:
    """Draw the methods, the Pareto front, the scene's own settings, and the references' error."""
    methods = dict.fromkeys(p["method"] for p in content["points"] if p["method"] != SCENE_SETTINGS)
    for method, colour, marker in zip(methods, plots.COLOURS, plots.MARKERS, strict=False):
        points = [p for p in content["points"] if p["method"] == method and p["resolved"]]
        if not points:
            continue
        axes.errorbar(
            _column("seconds", points),
            _column("relative_mse", points),
            _column("standard_error", points),
            color=colour,
            marker=marker,
            linewidth=1,
            label=method + _slopes(content["slopes"].get(method, {})),
        )
    if content["pareto_front"]:
        axes.plot(
            _column("seconds", content["pareto_front"]),
            _column("relative_mse", content["pareto_front"]),
            color=plots.GREY,
            linewidth=6,
            alpha=0.3,
            label="Pareto front",
        )
    own_points = [point for point in content["settings"] if point["resolved"]]
    if own_points:
        axes.plot(
            _column("seconds", own_points),
            _column("relative_mse", own_points),
            marker="*",
            markersize=15,
            linestyle="none",
            color="black",
            markerfacecolor="none",
            label=SCENE_SETTINGS,
        )
    # A logarithmic axis has no place for references without noise.
    if content["pareto_front"] and content["reference_error"] > 0:
        axes.axhline(
            content["reference_error"],
            color="black",
            linestyle=":",
            linewidth=1,
            label="the references' own error (subtracted)",
        )


def _draw_strata(axes: Any, content: Mapping[str, Any]) -> None:
    """Draw each stratum's plain path tracing as a full line, and its denoised renders dotted."""
    strata_and_styles = zip(content["strata"].items(), plots.COLOURS, plots.MARKERS, strict=False)
    for (stratum, measured), colour, marker in strata_and_styles:
        for method, line in ((PLAIN, "-"), (DENOISED, ":")):
            points = [p for p in measured["points"] if p["method"] == method and p["resolved"]]
            if not points:
                continue
            axes.plot(
                _column("seconds", points),
                _column("relative_mse", points),
                color=colour,
                marker=marker,
                linestyle=line,
                linewidth=1,
                label=f"{stratum}, {measured['area']:.1%} of the views, {method}"
                + _slopes(measured["slopes"].get(method, {})),
            )


def _column(name: str, points: Sequence[Mapping[str, Any]]) -> list[float]:
    return [point[name] for point in points]


def _slopes(lines: Mapping[str, Mapping[str, float]]) -> str:
    """Return the slopes over time with their standard errors, as text. Empty without slopes."""
    text = ""
    for name, form in (
        ("over_time", ", slope {}"),
        ("of_all_pixels_over_time", " (all pixels {})"),
    ):
        if name in lines:
            slope = f"{lines[name]['slope']:z.2f} ± {lines[name]['slope_error']:.2f}"
            text += form.format(slope.replace("-", "−"))
    return text
