"""Forecasts the cost of a run, which a dry run prints at its end, before anything is measured.

Every job reads this file with the rules, so it must import nothing that takes long.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lightfield.core import units
from lightfield.planning.sampling import (
    FEWEST_SEEDS,
    MOST_SEEDS,
    PLAIN_SAMPLES,
    PROBES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
    WINDOW_SIZE,
)
from lightfield.planning.unit_costs import (
    BRACKET_SECONDS,
    CHECK_SECONDS,
    COMPRESSED,
    DENOISING_SAMPLES,
    JOB_SECONDS,
    REPORT_SECONDS,
    REPROJECTION_SECONDS,
    SECONDS_PER_SAMPLE,
    SENSOR_SECONDS,
    START_UP_SECONDS,
)

# These three were measured in the courtyard. A calibration's search renders each window this often.
_SEARCH_RENDERS = 9
# Together these renders take this many times the samples that the target needs.
_SEARCH_PART = 2.5
# A render takes this many seconds beside its samples.
_WINDOW_SECONDS = 0.07

# The formulas of the columns, printed below the table.
FORMULAS = f"""\
CPU time = rendered pixels × (samples + {DENOISING_SAMPLES} if denoised) \
× {1e6 * SECONDS_PER_SAMPLE:g} µs + reprojected pixels × {1e6 * REPROJECTION_SECONDS:g} µs
+ pixels × {1e6 * CHECK_SECONDS:g} µs for the validation and each export \
+ shown pixels × {2e6 * REPORT_SECONDS:g} µs
+ jobs × {JOB_SECONDS:g} s, with Blender {START_UP_SECONDS:g} s.
Size = views × pixels × bytes of a pixel × {COMPRESSED:g}, with the reprojections.
After the target `plan`, the seconds and bytes of a view are those that its probes measured."""

# The phase of the jobs that develop views as a sensor sees them, and their part of the formulas.
SENSOR_PHASE = "sensor"
_SENSOR_FORMULA = f"""\
A sensor adds {1e6 * SENSOR_SECONDS:g} µs a pixel, or {1e6 * BRACKET_SECONDS:g} µs for a bracket \
with its mask and weights."""


@dataclass(frozen=True)
class Work:
    """The work of a job: the views that it renders, its seconds on one core, and their bytes.

    ``dataset`` is the name of its dataset. It is None if the job belongs to none.
    """

    phase: str
    dataset: str | None
    views: int
    seconds: float
    size: float


def forecast(works: Sequence[Work]) -> str:
    """Return the tables that end a dry run, and the formulas below.

    The first table has a row for each phase, in the order of ``works``, and their sum. Several
    datasets have a table of their own.
    """
    phases: dict[str, list[Work]] = {}
    datasets: dict[str, list[Work]] = {}
    for work in works:
        phases.setdefault(work.phase, []).append(work)
        if work.dataset:
            datasets.setdefault(work.dataset, []).append(work)
    tables = [_table("phase", {**phases, "all": works})]
    if len(datasets) > 1:
        tables.append(_table("dataset", dict(sorted(datasets.items()))))
    formulas = f"{FORMULAS}\n{_SENSOR_FORMULA}" if SENSOR_PHASE in phases else FORMULAS
    return "\n\n".join([*tables, formulas])


def _table(title: str, groups: Mapping[str, Sequence[Work]]) -> str:
    """Return a table with a row for the sum of each group, by its name."""
    rows = [(title, "jobs", "views", "CPU time", "size")]
    for name, works in groups.items():
        views = sum(work.views for work in works)
        seconds = sum(work.seconds for work in works)
        size = sum(work.size for work in works)
        rows.append(
            (
                name,
                f"{len(works):,}",
                f"{views:,}" if views else "",
                units.duration(seconds),
                units.size(size) if size else "",
            )
        )
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
    search_samples = sum(PLAIN_SAMPLES) + _SEARCH_PART * min(needed, most or needed)
    samples = 2 * seeds * REFERENCE_SAMPLES + search_samples
    renders = 2 * seeds + _SEARCH_RENDERS
    pixels = min(size, WINDOW_SIZE) ** 2
    window = renders * _WINDOW_SECONDS + pixels * samples * SECONDS_PER_SAMPLE
    return START_UP_SECONDS + PROBES * window
