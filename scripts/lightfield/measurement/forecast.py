"""Forecasts the cost of a run, which a dry run prints at its end, before anything is measured.

Every job reads this file with the rules, so it must import nothing that takes long.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lightfield.dataset.unit_costs import (
    CHECK_SECONDS,
    COMPRESSED,
    DENOISING_SAMPLES,
    JOB_SECONDS,
    REPORT_SECONDS,
    REPROJECTION_SECONDS,
    SECONDS_PER_SAMPLE,
    START_UP_SECONDS,
)
from lightfield.measurement.sampling import (
    FEWEST_SEEDS,
    MOST_SEEDS,
    PLAIN_SAMPLES,
    PROBES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
    WINDOW_SIZE,
)

# These three were measured in the courtyard. A calibration's search renders each window this often.
SEARCH_RENDERS = 9
# Together these renders take this many times the samples that the target needs.
SEARCH_PART = 2.5
# A render takes this many seconds beside its samples.
WINDOW_SECONDS = 0.07

# The formulas of the columns, printed below the table.
FORMULAS = f"""\
CPU time = rendered pixels × (samples + {DENOISING_SAMPLES} if denoised) \
× {1e6 * SECONDS_PER_SAMPLE:g} µs + reprojected pixels × {1e6 * REPROJECTION_SECONDS:g} µs
+ pixels × {1e6 * CHECK_SECONDS:g} µs for the validation and each export \
+ shown pixels × {2e6 * REPORT_SECONDS:g} µs
+ jobs × {JOB_SECONDS:g} s, with Blender {START_UP_SECONDS:g} s.
Size = views × pixels × bytes of a pixel × {COMPRESSED:g}, with the reprojections.
After `snakemake plan`, the seconds and bytes of a view are those that its probes measured."""


@dataclass(frozen=True)
class Work:
    """Some jobs: their number, the views that they render, seconds of one core, and bytes."""

    name: str
    jobs: int
    views: int
    seconds: float
    size: float


def forecast(phases: Iterable[Work], datasets: Iterable[Work]) -> str:
    """Return the tables that end a dry run, with sums, and with the formulas below.

    Works of the same name become one row. Several datasets have a table of their own.
    """
    rows = _sums(phases)
    tables = [_table("phase", [*rows, _sum("all", rows)])]
    dataset_rows = _sums(datasets)
    if len(dataset_rows) > 1:
        tables.append(_table("dataset", dataset_rows))
    return "\n\n".join([*tables, FORMULAS])


def _sums(works: Iterable[Work]) -> list[Work]:
    """Return the sum of the works of each name, in the order of their first ones."""
    by_name: dict[str, list[Work]] = {}
    for work in works:
        by_name.setdefault(work.name, []).append(work)
    return [_sum(name, group) for name, group in by_name.items()]


def _sum(name: str, works: Sequence[Work]) -> Work:
    return Work(
        name,
        sum(work.jobs for work in works),
        sum(work.views for work in works),
        sum(work.seconds for work in works),
        sum(work.size for work in works),
    )


def _table(title: str, works: Sequence[Work]) -> str:
    rows = [(title, "jobs", "views", "CPU time", "size")]
    for work in works:
        views = f"{work.views:,}" if work.views else ""
        size = size_text(work.size) if work.size else ""
        rows.append((work.name, f"{work.jobs:,}", views, time_text(work.seconds), size))
    return "\n".join(
        f"{name:<40} {jobs:>8} {views:>8} {seconds:>10} {size:>8}".rstrip()
        for name, jobs, views, seconds, size in rows
    )


def calibration_seconds(target: float, size: int, most: int | None = None) -> float:
    """Estimate the seconds of a calibration on one core, for a ``target`` error and views of size².

    The estimate takes the error of N samples a pixel as 1 / N. It is 0.4 / N in the courtyard,
    1.4 / N in the barbershop, and 2.6 / N in the garden. A preset allows at most ``most`` samples.
    """
    needed = 1 / target
    seeds = FEWEST_SEEDS
    while seeds < MOST_SEEDS and seeds * REFERENCE_SAMPLES * REFERENCE_PART < needed:
        seeds *= 2
    # Windows and held-out windows have references. Plain path tracing and the search add samples.
    search_samples = sum(PLAIN_SAMPLES) + SEARCH_PART * min(needed, most or needed)
    samples = 2 * seeds * REFERENCE_SAMPLES + search_samples
    renders = 2 * seeds + SEARCH_RENDERS
    pixels = min(size, WINDOW_SIZE) ** 2
    window = renders * WINDOW_SECONDS + pixels * samples * SECONDS_PER_SAMPLE
    return START_UP_SECONDS + PROBES * window


def time_text(seconds: float) -> str:
    """Return a time as a person reads it: ``19 s``, ``4 min``, ``2.3 h``, or ``1,153 h``."""
    if seconds < 100:
        return f"{_figure(seconds)} s"
    if seconds < 6000:
        return f"{_figure(seconds / 60)} min"
    return f"{_figure(seconds / 3600)} h"


def size_text(size: float) -> str:
    """Return a number of bytes as a person reads it: ``73 kB``, ``5.1 MB``, or ``172 GB``."""
    for unit, bytes_of_unit in (("kB", 1e3), ("MB", 1e6)):
        if size < 999.5 * bytes_of_unit:
            return f"{_figure(size / bytes_of_unit)} {unit}"
    return f"{_figure(size / 1e9)} GB"


def _figure(value: float) -> str:
    """Return a number with two digits. From 10 on return a whole number with commas."""
    return f"{value:.2g}" if value < 9.95 else f"{value:,.0f}"
