"""What the chosen datasets will take on this machine: views, hours and gigabytes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from scipy.stats import linregress

from lightfield.core import processors
from lightfield.dataset.dataset import SECONDS_PER_SAMPLE, START_UP_SECONDS
from lightfield.measurement import metrics
from lightfield.measurement.calibration import (
    FEWEST_SEEDS,
    MOST_SEEDS,
    PLAIN_SAMPLES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
)
from lightfield.measurement.sampling import DENOISED, PROBES, TRACED, WINDOW_SIZE, standard_error

# Measured in the courtyard: how many renders a calibration's search makes of each window, how many
# of the samples that the target needs, and what a render of a window takes beside its samples.
SEARCH_RENDERS, SEARCH_PART, WINDOW_SECONDS = 9, 2.5, 0.07

HEAD = "| dataset | views | resolution | samples | s a view | hours | denoised | calibrated | GB |"

# The target error that the calibrated hours are for.
TARGET_ERROR = 0.01
# Times as long as plain path tracing.
OUT_OF_REACH = 1e4


def table(datasets: list[tuple[str, int, dict[str, Any]]], advice: Mapping[str, Any]) -> str:
    """Return the table of (name, frames, probe), with the sums below.

    ``advice`` is what `lightfield.measurement.advice` has found of datasets, by their names.
    """
    lines = ["# What it will take", "", HEAD, "| --- " + "| ---: " * (HEAD.count("|") - 2) + "|"]
    total_views, total_hours, total_bytes, variance = 0, 0.0, 0.0, 0.0
    cheaper: list[list[float | None]] = []
    for name, frames, probe in datasets:
        views = probe["views"] * frames
        seconds = probe["view_seconds"]
        error = standard_error(seconds)
        hours = views * fmean(seconds) / 3600
        size = views * fmean(probe["view_bytes"])
        width, height = probe["resolution"]
        parts = cheaper_parts(probe["samples"], advice.get(name))
        cheaper.append([part and part * hours for part in parts])
        lines.append(
            f"| {name} | {views} | {width} × {height} | {probe['samples']} "
            f"| {fmean(seconds):.0f} ± {error:.0f} | {hours:.0f} | {_hours(cheaper[-1])} "
            f"| {size / 1e9:.1f} |"
        )
        total_views += views
        total_hours += hours
        total_bytes += size
        variance += (views * error / 3600) ** 2
    sums = [None if None in column else sum(column) for column in zip(*cheaper, strict=True)]
    lines.append(
        f"| all | {total_views} | | | | {total_hours:.0f} ± {math.sqrt(variance):.0f} "
        f"| {_hours(sums)} | {total_bytes / 1e9:.0f} |"
    )
    cores = processors.available()
    if all(probe["device"] == "CPU" for _, _, probe in datasets):
        days = total_hours / cores / 24
        lines += ["", f"Hours of one processor core; this machine's {cores} take {days:.1f} days."]
    else:
        lines += ["", "Hours of the graphics card."]
    lines += [
        "Measured on small views, with all their samples; ± is the standard error over these.",
        "Denoised: to the same error by fewer samples and the denoiser. Calibrated: to the error "
        f"{TARGET_ERROR:g}, by the cheaper of both. By `snakemake advise`; — where it has not run, "
        "or no number of samples is enough.",
        "",
    ]
    return "\n".join(lines)


def cheaper_parts(
    samples: int, advice: Mapping[str, Any] | None
) -> tuple[float | None, float | None]:
    """Return the parts of the time of plain path tracing that denoised and calibrated views take.

    ``samples`` are those of a pixel. Errors and seconds follow ``advice``: power laws of samples,
    and fewer than one sample there are not. None where it is not known, or no number of samples
    would be enough, as where a denoiser's error is nothing but bias.
    """
    if not advice or advice["own"] != {"samples": samples, "denoise": False}:
        return None, None
    ways = {}
    for way, points in advice["unchanged"].items():
        counts = [point["samples"] for point in points]
        errors = metrics.fit(counts, [point["error"] for point in points])
        assert errors is not None
        seconds = linregress(counts, [point["seconds"] for point in points])
        ways[way] = errors, seconds

    def seconds_to(error: float, way: str) -> float:
        errors, seconds = ways[way]
        return float(seconds.intercept + seconds.slope * max(1.0, math.ceil(errors.inverse(error))))

    errors, seconds = ways[TRACED]
    plain = float(seconds.intercept + seconds.slope * samples)
    denoised = seconds_to(errors.at(samples), DENOISED) / plain
    calibrated = min(seconds_to(TARGET_ERROR, way) for way in ways) / plain
    return (
        denoised if denoised < OUT_OF_REACH else None,
        calibrated if calibrated < OUT_OF_REACH else None,
    )


def _hours(values: Sequence[float | None]) -> str:
    return " | ".join("—" if value is None else _figure(value) for value in values)


@dataclass(frozen=True)
class Work:
    """What a run will do of one rig, or to calibrate: views, seconds of one core, and bytes."""

    name: str
    views: int
    seconds: float
    size: float = 0.0


def forecast(works: Sequence[Work]) -> str:
    """Return the table that a dry run ends with, sums below."""
    total = Work(
        "all",
        sum(work.views for work in works),
        sum(work.seconds for work in works),
        sum(work.size for work in works),
    )
    rows = [
        f"{work.name:<40} {work.views or '':>8} {_figure(work.seconds / 3600):>10} "
        f"{_figure(work.size / 1e9) if work.size else '':>8}"
        for work in [*works, *([total] if len(works) > 1 else [])]
    ]
    head = f"{'to render':<40} {'views':>8} {'CPU hours':>10} {'GB':>8}"
    return "\n".join([head, *rows, "Expected from pixels and samples, or from probes: see `plan`."])


def calibration_seconds(target: float, size: int, most: int | None = None) -> float:
    """Estimate how long one core calibrates for a ``target`` error with views of ``size``².

    Path tracing of N samples a pixel has an error of about 1 / N (0.4 / N in the courtyard, 1.4 / N
    in the barbershop, 2.6 / N in the garden), and a preset may allow no more than ``most`` samples.
    """
    needed, seeds = 1 / target, FEWEST_SEEDS
    while seeds < MOST_SEEDS and seeds * REFERENCE_SAMPLES * REFERENCE_PART < needed:
        seeds *= 2
    # References for the windows and for those held out, plain path tracing, and what else is tried.
    tried = sum(PLAIN_SAMPLES) + SEARCH_PART * min(needed, most or needed)
    samples = 2 * seeds * REFERENCE_SAMPLES + tried
    renders = 2 * seeds + SEARCH_RENDERS
    pixels = min(size, WINDOW_SIZE) ** 2
    window = renders * WINDOW_SECONDS + pixels * samples * SECONDS_PER_SAMPLE
    return START_UP_SECONDS + PROBES * window


def _figure(value: float) -> str:
    return f"{value:.2g}" if value < 10 else f"{value:,.0f}"
