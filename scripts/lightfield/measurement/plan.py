"""What the chosen datasets will take on this machine: views, hours and gigabytes."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from scipy.stats import linregress

from lightfield.core import processors
from lightfield.core.files import read_keys, reading
from lightfield.measurement import metrics
from lightfield.measurement.forecast import figure
from lightfield.measurement.sampling import DENOISED, TRACED, standard_error

HEAD = "| dataset | views | resolution | samples | s a view | hours | denoised | calibrated | GB |"

# What `table` reads of a probe.
PROBED = ("views", "resolution", "samples", "device", "view_seconds", "view_bytes")

# The target error that the calibrated hours are for.
TARGET_ERROR = 0.01
# Times as long as plain path tracing.
OUT_OF_REACH = 1e4


def read_probe(path: Path | str) -> dict[str, Any]:
    """Return what scripts/probe.py has measured. Raises `UserError` if the file is damaged."""
    probe = read_keys(path, "probe.py", *PROBED)
    with reading(path, "probe"):
        width, height = probe["resolution"]
        numbers = [*probe["view_seconds"], *probe["view_bytes"]]
        counts = [probe["views"], probe["samples"], width, height]
        if not all(0 <= number < 1e18 for number in [*numbers, *counts]):
            raise ValueError("a number is below 0, or far too large")
        if not all(isinstance(count, int) and count < 2**31 for count in counts):
            raise ValueError("a count is no whole number")
        if not (probe["view_seconds"] and probe["view_bytes"]):
            raise ValueError("no view was measured")
    return probe


def table(datasets: list[tuple[str, int, dict[str, Any]]], advice: Mapping[str, Any]) -> str:
    """Return the table of (name, frames, probe), with the sums below.

    ``advice`` is what `lightfield.measurement.advice` has found of datasets, by their names.
    """
    lines = ["# What it will take", "", HEAD, "| --- " + "| ---: " * (HEAD.count("|") - 2) + "|"]
    total_views = 0
    total_hours = 0.0
    total_bytes = 0.0
    variance = 0.0
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

    ``samples`` are those of a pixel. Errors and seconds follow ``advice``: a power law and a line
    over samples, and fewer than one sample there are not. None where it is not known, as of a scene
    without noise, or no number of samples would be enough, as where a denoiser's error is nothing
    but bias.
    """
    if not advice or advice["own"] != {"samples": samples, "denoise": False}:
        return None, None
    ways = {}
    for way, points in advice["unchanged"].items():
        counts = [point["samples"] for point in points]
        errors = metrics.fit(counts, [point["error"] for point in points])
        seconds = linregress(counts, [point["seconds"] for point in points])
        if errors is None or seconds.slope <= 0:
            return None, None
        ways[way] = errors, max(0.0, float(seconds.intercept)), float(seconds.slope)

    def seconds_to(error: float, way: str) -> float:
        errors, overhead, each = ways[way]
        return overhead + each * max(1.0, math.ceil(errors.inverse(error)))

    errors, overhead, each = ways[TRACED]
    plain = overhead + each * samples
    denoised = seconds_to(errors.at(samples), DENOISED) / plain
    calibrated = min(seconds_to(TARGET_ERROR, way) for way in ways) / plain
    return (
        denoised if denoised < OUT_OF_REACH else None,
        calibrated if calibrated < OUT_OF_REACH else None,
    )


def _hours(values: Sequence[float | None]) -> str:
    return " | ".join("—" if value is None else figure(value) for value in values)
