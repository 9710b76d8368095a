"""Measure the error of renders against their time: sampling plain, adaptive, guided, denoised.

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

import argparse
import csv
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, read_json, write_json
from lightfield.core.progress import Progress
from lightfield.dataset.lightfield import LightField
from lightfield.imaging import plots
from lightfield.measurement import metrics, trials
from lightfield.measurement.calibration import calibrated

PLAIN, ADAPTIVE, DENOISED = "plain", "adaptive", "denoised"
BOTH, GUIDED, OWN = "adaptive + denoised", "path guiding", "this scene's settings"

# Above 0.2, the fewest samples that adaptive sampling takes decide.
THRESHOLDS = (0.2, 0.1, 0.05, 0.02, 0.01)

# A reference's samples are split among so many seeds, whose differences tell its own error.
REFERENCE_SEEDS = 8


@dataclass(frozen=True)
class Point:
    """One way to render, measured: means over views and seeds.

    ``samples`` is the mean number that a pixel took; ``seconds`` are of one core, or of the GPU, a
    megapixel; ``standard_error`` is that of ``relative_mse``, over views and seeds. ``resolved``
    says whether the error is above the references' own, below which nothing is drawn or fitted.
    """

    method: str
    settings: Mapping[str, Any]
    samples: float
    seconds: float
    relative_mse: float
    relative_mse_whole: float
    standard_error: float
    resolved: bool
    psnr: float
    ssim: float
    flip: float
    depth_error: float | None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--inventory", required=True, type=Path, help="what the scene contains")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument(
        "--calibration", type=Path, help="what scripts/calibrate.py chose for a target error"
    )
    parser.add_argument(
        "--probes",
        type=int,
        default=3,
        help="windows of views to render, beside that of the first one's neighbour (default: 3)",
    )
    parser.add_argument("--size", type=int, default=64, help="of their sides (default: 64)")
    parser.add_argument(
        "--octaves", type=int, default=8, help="of sample counts, beginning at 1 (default: 8)"
    )
    parser.add_argument(
        "--reference", type=int, default=2048, help="samples of a reference (default: 2048)"
    )
    parser.add_argument("--seeds", type=int, default=2, help="renders of each way (default: 2)")
    parser.add_argument("--device", default="auto", help="what Cycles renders on (default: auto)")
    parser.add_argument("--threads", type=int, default=1, help="CPU threads (default: 1)")
    parser.add_argument("--cache", required=True, type=Path, help="folder of what was rendered")
    parser.add_argument(
        "--output", required=True, type=Path, help="stem of the .csv, .json, .svg and .png to write"
    )
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    if arguments.calibration:
        render = calibrated(lightfield.render, read_json(arguments.calibration))
        lightfield = lightfield.changed(render=render)
    elif "samples" not in lightfield.render:
        raise UserError(
            f"{arguments.lightfield}: render has a target error and no samples; "
            "give --calibration, what scripts/calibrate.py chose for it"
        )
    maker = trials.Trials(
        arguments.blend,
        arguments.inventory,
        lightfield,
        arguments.device,
        arguments.threads,
        arguments.cache,
    )
    probes = maker.probes(arguments.size, arguments.probes)
    near = trials.neighbour(lightfield.views, probes[0].view)
    if near:
        probes.insert(1, replace(probes[0], view=near))
    progress = Progress(len(probes), f"{arguments.output.name}: references")
    made = []
    for probe in probes:
        made.append(maker.reference(probe, REFERENCE_SEEDS, arguments.reference // REFERENCE_SEEDS))
        progress.done()
    references = metrics.exposed_alike(made)

    seeds = range(1, arguments.seeds + 1)
    on_cpu = maker.render(probes[0], seeds[0], {"samples": 1}).device == "CPU"
    ways = all_ways(lightfield.render, arguments.octaves, guiding=on_cpu)
    progress = Progress(
        len(ways) * len(probes) * len(seeds), f"{arguments.output.name}: trials", "renders"
    )
    points, pairs = [], []
    for method, settings in ways:
        renders = []
        for probe in probes:
            renders.append([maker.render(probe, seed, settings) for seed in seeds])
            progress.done(len(seeds))
        points.append(measured(method, settings, renders, references))
        if near and references[0].depth is not None:
            pairs.append(
                {
                    "method": method,
                    "settings": settings,
                    **neighbours(maker, probes, references, renders),
                }
            )

    content = {
        "measured_on": {
            "probes": [probe.name for probe in probes],
            "size": arguments.size,
            "resolution": [maker.lens.width, maker.lens.height],
            "seeds": len(seeds),
            "reference_samples": arguments.reference,
            "device": "CPU" if on_cpu else "GPU",
            "path_guiding": "measured" if on_cpu else "Cycles has it only on processors",
        },
        **evaluated(points, references),
        "neighbouring_views": pairs,
    }
    write_table(arguments.output.with_name(arguments.output.name + ".csv"), points, content)
    draw(arguments.output, points, content)
    write_json(arguments.output.with_name(arguments.output.name + ".json"), content)


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


def measured(
    method: str,
    settings: Mapping[str, Any],
    renders: Sequence[Sequence[trials.Trial]],
    references: Sequence[metrics.Reference],
) -> Point:
    """Compare the ``renders`` of one way, by view and seed, with the views' references."""
    errors = [
        [metrics.compare(render.colour, render.depth, reference) for render in views]
        for views, reference in zip(renders, references, strict=True)
    ]
    flat = [error for views in errors for error in views]
    mean = {
        name: statistics.fmean(getattr(error, name) for error in flat)
        for name in ("relative_mse", "relative_mse_whole", "psnr", "ssim", "flip")
    }
    height, width = references[0].mask.shape
    by_seed = [
        statistics.fmean(views[seed].relative_mse for views in errors)
        for seed in range(len(errors[0]))
    ]
    spread = statistics.stdev(by_seed) / math.sqrt(len(by_seed)) if len(by_seed) > 1 else 0.0
    own = statistics.fmean(reference.own_error for reference in references)
    depths = [error.depth for error in flat if error.depth is not None]
    return Point(
        method=method,
        settings=settings,
        samples=statistics.fmean(render.samples for views in renders for render in views),
        seconds=statistics.fmean(
            statistics.median(render.seconds for render in views) for views in renders
        )
        * 1e6
        / (width * height),
        **mean,
        standard_error=spread,
        resolved=mean["relative_mse"] > own,
        depth_error=statistics.fmean(depths) if depths else None,
    )


def evaluated(points: Sequence[Point], references: Sequence[metrics.Reference]) -> dict[str, Any]:
    """Return what follows from the points: slopes, the Pareto front, and what each way saves."""
    seen = [point for point in points if point.resolved]
    slopes: dict[str, Any] = {}
    for method in dict.fromkeys(point.method for point in points):
        own = [point for point in seen if point.method == method]
        lines, of_all_pixels = (
            fitted(own, error) for error in ("relative_mse", "relative_mse_whole")
        )
        if lines:
            slopes[method] = {over: asdict(line) for over, line in lines.items()}
            slopes[method] |= {
                f"of_all_pixels_{over}": asdict(line) for over, line in of_all_pixels.items()
            }
    plain = fitted([point for point in seen if point.method == PLAIN], "relative_mse")
    front = metrics.pareto([p.seconds for p in seen], [p.relative_mse for p in seen])
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
    return {
        "reference_error": statistics.fmean(reference.own_error for reference in references),
        "slopes": slopes,
        "pareto_front": [asdict(seen[index]) for index in front],
        "against_plain_at_equal_error": saved,
        "settings": [asdict(point) for point in points if point.method == OWN],
        "points": [asdict(point) for point in points],
    }


def fitted(points: Sequence[Point], error: str) -> dict[str, metrics.Line]:
    """Fit one kind of error of some points over time and over samples; nothing if too few."""
    # Where it is nearly all in a few pixels, it may be below 0 by chance.
    known = [point for point in points if getattr(point, error) > 0]
    errors = [getattr(point, error) for point in known]
    by_time = metrics.fit([point.seconds for point in known], errors)
    by_samples = metrics.fit([point.samples for point in known], errors)
    return {"over_time": by_time, "over_samples": by_samples} if by_time and by_samples else {}


def neighbours(
    maker: trials.Trials,
    probes: Sequence[trials.Probe],
    references: Sequence[metrics.Reference],
    renders: Sequence[Sequence[trials.Trial]],
) -> dict[str, float]:
    """Return how the first two views disagree, as `metrics.Disagreement`, the mean over seeds."""
    pair, windows = (references[0], references[1]), (probes[0], probes[1])
    cameras = maker.camera(probes[0].view), maker.camera(probes[1].view)
    seen = trials.both_see(cameras, windows, pair)
    if not len(seen[0]):
        return {}
    found = [
        asdict(metrics.disagreement((first.colour, second.colour), pair, seen))
        for first, second in zip(renders[0], renders[1], strict=True)
    ]
    return {name: statistics.fmean(entry[name] for entry in found) for name in found[0]}


def write_table(path: Path, points: Sequence[Point], content: Mapping[str, Any]) -> None:
    """Write the points as CSV, one row each."""
    front = [(entry["method"], entry["settings"]) for entry in content["pareto_front"]]
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        names = [name for name in asdict(points[0]) if name not in ("method", "settings")]
        table.writerow(
            ["method", "most_samples", "adaptive_threshold", "denoise", *names, "pareto"]
        )
        for point in points:
            settings = {**trials.PLAIN, **point.settings}
            table.writerow(
                [point.method, *(settings[k] for k in ("samples", "adaptive_threshold", "denoise"))]
                + [getattr(point, name) for name in names]
                + [(point.method, point.settings) in front]
            )


def draw(stem: Path, points: Sequence[Point], content: Mapping[str, Any]) -> None:
    """Draw error over time, with slopes, the Pareto front, and where the scene's settings lie."""
    seen = [point for point in points if point.resolved]
    with plots.plot(stem, size=(8, 5.5)) as axes:
        methods = [m for m in dict.fromkeys(point.method for point in points) if m != OWN]
        for method, colour, marker in zip(methods, plots.COLOURS, plots.MARKERS, strict=False):
            own = [point for point in seen if point.method == method]
            line = content["slopes"].get(method)
            told = ""
            if line:
                told = f", slope {slope_told(line['over_time'])}"
                if "of_all_pixels_over_time" in line:
                    told += f" (all pixels {slope_told(line['of_all_pixels_over_time'])})"
            axes.errorbar(
                [point.seconds for point in own],
                [point.relative_mse for point in own],
                [point.standard_error for point in own],
                color=colour,
                marker=marker,
                linewidth=1,
                label=method + told,
            )
        front = content["pareto_front"]
        axes.plot(
            [point["seconds"] for point in front],
            [point["relative_mse"] for point in front],
            color=plots.GREY,
            linewidth=6,
            alpha=0.3,
            label="Pareto front",
        )
        for point in seen:
            if point.method == OWN:
                axes.plot(
                    *(point.seconds, point.relative_mse),
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
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(f"{stem.name}: error against render time")
        unit = "core" if content["measured_on"]["device"] == "CPU" else "GPU"
        axes.set_xlabel(f"render time, {unit} seconds per megapixel")
        axes.set_ylabel("relative mean squared error")
        axes.legend(fontsize=8)


def slope_told(line: Mapping[str, float]) -> str:
    """Return a slope and its standard error as text."""
    return f"{line['slope']:.2f} ± {line['slope_error']:.2f}".replace("-", "−")


if __name__ == "__main__":
    run(main)
