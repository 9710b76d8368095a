"""Estimates the cost of the chosen datasets on this machine: views, time and disk space."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.configuration.config_file import Energy
from lightfield.core import processors, units
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_text
from lightfield.measurement import metrics
from lightfield.planning.cost import Cost, ProbedViews, kwh, read_probe
from lightfield.planning.sampling import DENOISED, TRACED
from lightfield.stages.measurement import Plan

COLUMNS = (
    "dataset",
    "views",
    "resolution",
    "samples",
    "s a view",
    "time",
    "denoised",
    "calibrated",
    "size",
)

# The calibrated time is the time to this error.
_TARGET_ERROR = 0.01
# A method that takes this many times as long as plain path tracing does not reach its error.
_OUT_OF_REACH = 1e4

# The formulas of the columns, printed below the table.
FORMULAS = f"""\
- time = views × s a view
- s a view = mean over the probes of seconds of the probe × pixels of a view / pixels of the \
probe, ± its standard error
- denoised = time × (seconds of denoised views) / (seconds of views without denoising), both with \
the same error
- calibrated = time × (seconds to the error {_TARGET_ERROR:g}, denoised or not, whichever is \
cheaper) / (seconds of the samples in the YAML)
- size = views × mean over the probes of bytes of the probe × pixels of a view / pixels of the \
probe
"""


@dataclass(frozen=True)
class Expected:
    """The estimate of one dataset of so many frames. Seconds count for one core or for the GPU.

    ``parts`` is the result of `cheaper_parts`.
    """

    name: str
    frames: int
    probe: ProbedViews
    parts: tuple[float | None, float | None]

    @property
    def views(self) -> int:
        """The views of all frames."""
        return self.frames * self.probe.views

    @property
    def cost(self) -> Cost:
        """The cost of all views."""
        return self.views * self.probe.view_cost

    @property
    def cheaper_seconds(self) -> list[float | None]:
        """The seconds of all views denoised and calibrated. None if unknown."""
        return [None if part is None else part * self.cost.seconds for part in self.parts]

    @property
    def row(self) -> str:
        """The dataset's row of the table."""
        probe = self.probe
        width, height = probe.resolution
        return (
            f"| {self.name} | {self.views} | {width} × {height} | {probe.samples} "
            f"| {probe.view_cost.seconds:.3g} ± {probe.view_error:.1g} "
            f"| {units.duration(self.cost.seconds)} | {_times(self.cheaper_seconds)} "
            f"| {units.size(self.cost.disk_bytes)} |"
        )


def write(job: Plan) -> None:
    """Write and print the table of the chosen datasets. Raises `UserError` if none is rendered."""
    for name in job.family:
        print(f"{name}: its members are not probed; snakemake -n estimates them")
    if job.family and not job.dataset:
        return
    if not job.dataset:
        raise UserError("the views of all chosen datasets exist already: nothing is rendered")
    probes = [(name, frames, read_probe(probe)) for name, frames, probe in job.dataset]
    advice = {
        name: read_keys(path, "error_vs_time.py", "changes")["changes"] for name, path in job.advice
    }
    energy = Energy(watts=job.watts, cores=job.cores or "auto")
    text = table(probes, advice, energy)
    write_text(job.output, text)
    print(text, end="")


def table(
    datasets: Sequence[tuple[str, int, ProbedViews]], advice: Mapping[str, Any], energy: Energy
) -> str:
    """Return the table of (name, frames, probe), with the sums and the formulas below.

    ``advice`` has the results of `lightfield.measurement.advice`, by the datasets' names.
    """
    expected = [
        Expected(name, frames, probe, cheaper_parts(probe.samples, advice.get(name)))
        for name, frames, probe in datasets
    ]
    lines = [
        "# What it will take",
        "",
        f"| {' | '.join(COLUMNS)} |",
        "| --- " + "| ---: " * (len(COLUMNS) - 1) + "|",
        *(dataset.row for dataset in expected),
        _sums_row(expected),
        "",
        _device_of(expected, energy),
        "",
        FORMULAS,
        "Probes are a few small views with all their samples. The seconds to an error follow from",
        "what the target `error_vs_time` measured. The error is a power of the samples, and the",
        "seconds are a line over them. — means that it has not run, or that no number of samples",
        "is enough.",
        "",
    ]
    return "\n".join(lines)


def _sums_row(expected: Sequence[Expected]) -> str:
    """Return the table's last row: the sums over all datasets.

    Times of a core and of a graphics card have no sum.
    """
    views = sum(dataset.views for dataset in expected)
    total = sum((dataset.cost for dataset in expected), Cost())
    size = units.size(total.disk_bytes)
    if 0 < len(on_card(expected)) < len(expected):
        return f"| all | {views} | | | | — | {_times([None, None])} | {size} |"
    error = math.hypot(*(dataset.views * dataset.probe.view_error for dataset in expected))
    columns = zip(*(dataset.cheaper_seconds for dataset in expected), strict=True)
    cheaper = [None if None in column else sum(column) for column in columns]
    return (
        f"| all | {views} | | | | {units.duration(total.seconds)} ± {units.duration(error)} "
        f"| {_times(cheaper)} | {size} |"
    )


def on_card(expected: Sequence[Expected]) -> list[str]:
    """Return the names of the datasets whose probes a graphics card rendered."""
    return [dataset.name for dataset in expected if dataset.probe.device != "CPU"]


def _device_of(expected: Sequence[Expected], energy: Energy) -> str:
    """Return the device of the times, how long this machine takes, and its energy."""
    names = on_card(expected)
    if 0 < len(names) < len(expected):
        return (
            f"Times of the graphics card for {', '.join(names)}, and of one processor core for "
            "the others. They have no sum."
        )
    seconds = sum(dataset.cost.seconds for dataset in expected)
    machine_seconds = seconds if names else seconds / energy.core_count
    used = units.energy(kwh(machine_seconds, energy.watts))
    if names:
        return f"Times of the graphics card, with {used} together."
    cores = processors.available()
    run_time = units.duration(seconds / cores)
    return f"Times of one processor core; this machine's {cores} take {run_time} and {used}."


def cheaper_parts(
    samples: int, advice: Mapping[str, Any] | None
) -> tuple[float | None, float | None]:
    """Return the times of denoised and of calibrated views, over the time of plain path tracing.

    Plain path tracing takes ``samples`` a pixel. According to ``advice``, the error is a power of
    the samples, and the seconds are a line over them, from one sample on. A part is None if the
    advice does not fit, as for a scene without noise. It is also None if no number of samples is
    enough, as for a denoiser whose error is all bias.
    """
    if not advice or advice["own"] != {"samples": samples, "denoise": False}:
        return None, None
    laws = {}
    for method, points in advice["unchanged"].items():
        counts = [point["samples"] for point in points]
        errors = metrics.fit(counts, [point["error"] for point in points])
        if errors is None:
            return None, None
        slope, intercept = np.polyfit(counts, [point["seconds"] for point in points], 1)
        if slope <= 0:
            return None, None
        laws[method] = errors, max(0.0, float(intercept)), float(slope)

    def seconds_to(error: float, method: str) -> float:
        errors, overhead, sample_seconds = laws[method]
        # A rounding error must not add a sample.
        needed = math.ceil(round(errors.inverse(error), 6))
        return overhead + sample_seconds * max(1.0, needed)

    errors, overhead, sample_seconds = laws[TRACED]
    plain = overhead + sample_seconds * samples
    denoised = seconds_to(errors.at(samples), DENOISED) / plain
    calibrated = min(seconds_to(_TARGET_ERROR, method) for method in laws) / plain
    return (
        denoised if denoised < _OUT_OF_REACH else None,
        calibrated if calibrated < _OUT_OF_REACH else None,
    )


def _times(values: Sequence[float | None]) -> str:
    return " | ".join("—" if value is None else units.duration(value) for value in values)
