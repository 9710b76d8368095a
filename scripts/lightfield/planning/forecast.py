"""Writes the forecast of a run, which a dry run prints at its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lightfield.core import units
from lightfield.planning import cost
from lightfield.planning.cost import Cost
from lightfield.planning.estimate import Estimate
from lightfield.planning.phases import SENSOR_PHASE
from lightfield.planning.sampling import DENOISING_SAMPLES

# The part of the formulas for the phase of sensors.
_SENSOR_FORMULA = f"""\
A sensor adds {1e6 * cost.SENSOR_SECONDS:g} µs a pixel, or {1e6 * cost.BRACKET_SECONDS:g} µs for \
a bracket with its mask and weights."""

# The formulas of the columns, printed below the table.
_FORMULAS = f"""\
CPU time = rendered pixels × (samples + {DENOISING_SAMPLES} if denoised) \
× {1e6 * cost.SAMPLE_SECONDS:g} µs + reprojected pixels × {1e6 * cost.REPROJECTION_SECONDS:g} µs
+ pixels × {1e6 * cost.CHECK_SECONDS:g} µs for the validation and each export \
+ shown pixels × {2e6 * cost.REPORT_SECONDS:g} µs
+ jobs × {cost.JOB_SECONDS:g} s, with Blender {cost.START_UP_SECONDS:g} s.
Size = views × pixels × bytes of a pixel × {cost.COMPRESSED:g}.
Measured views replace these guesses: the lines above say which. The target `plan` measures some."""


@dataclass(frozen=True)
class Work:
    """The work of a job: its phase, the views that it renders, and its cost.

    ``dataset`` is the name of its dataset. It is None if the job belongs to none. An ``estimate``
    says how long its views take, if it renders any of a dataset.
    """

    phase: str
    dataset: str | None
    views: int
    cost: Cost
    estimate: Estimate | None = None


@dataclass(frozen=True)
class Request:
    """What a job requests of a cluster: its cores, and Snakemake's resources by their names."""

    rule: str
    cores: int
    resources: Mapping[str, Any]


# The columns of the table of requests, and how a request says each.
_REQUESTED: dict[str, Callable[[Request], Any]] = {
    "CPUs": lambda request: request.cores,
    "mem_mb": lambda request: request.resources.get("mem_mb"),
    "runtime": lambda request: request.resources.get("runtime"),
    "slurm_partition": lambda request: request.resources.get("slurm_partition"),
    "gpu": lambda request: request.resources.get("gpu") or None,
}


def requests_table(requests: Sequence[Request]) -> str:
    """Return a table of what the jobs of each rule request of a cluster, in the order given.

    Jobs that request several amounts have the least and the largest.
    """
    rules: dict[str, list[Request]] = {}
    for request in requests:
        rules.setdefault(request.rule, []).append(request)
    rows = [("rule", "jobs", *_REQUESTED)]
    for rule, jobs in rules.items():
        amounts = [_range({of(job) for job in jobs}) for of in _REQUESTED.values()]
        rows.append((rule, f"{len(jobs):,}", *amounts))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    )


def _range(amounts: set[Any]) -> str:
    """Return an amount, or the least and the largest. A dash stands for the cluster's default."""
    numbers = sorted(amount for amount in amounts if isinstance(amount, int | float))
    if numbers and len(numbers) == len(amounts):
        ends = dict.fromkeys((numbers[0], numbers[-1]))
        return " to ".join(f"{number:,}" for number in ends)
    return ", ".join(sorted(str(amount) for amount in amounts if amount is not None)) or "–"


def forecast(works: Sequence[Work]) -> str:
    """Return the tables that end a dry run, what estimates the views, and the formulas below.

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
    if lines := _estimate_lines(works):
        tables.append("\n".join(lines))
    formulas = f"{_FORMULAS}\n{_SENSOR_FORMULA}" if SENSOR_PHASE in phases else _FORMULAS
    return "\n\n".join([*tables, formulas])


def _estimate_lines(works: Sequence[Work]) -> list[str]:
    """Return a line for each dataset, or sequence, whose views are rendered."""
    views: dict[tuple[str, Estimate], int] = {}
    for work in works:
        if work.estimate and work.dataset:
            key = (work.dataset, work.estimate)
            views[key] = views.get(key, 0) + work.views
    return [estimate.line(name, count) for (name, estimate), count in views.items()]


def _table(title: str, groups: Mapping[str, Sequence[Work]]) -> str:
    """Return a table with a row for the sum of each group, by its name.

    It has a column for the time of a GPU if a group takes any.
    """
    has_gpu = any(work.cost.gpu_seconds for works in groups.values() for work in works)
    gpu_title = "GPU time" if has_gpu else ""
    rows = [(title, "jobs", "views", "CPU time", gpu_title, "size")]
    for name, works in groups.items():
        views = sum(work.views for work in works)
        total = sum((work.cost for work in works), Cost())
        rows.append(
            (
                name,
                f"{len(works):,}",
                f"{views:,}" if views else "",
                units.duration(total.seconds),
                units.duration(total.gpu_seconds) if total.gpu_seconds else "",
                units.size(total.disk_bytes) if total.disk_bytes else "",
            )
        )
    return "\n".join(
        f"{name:<40} {jobs:>8} {views:>8} {seconds:>10}{gpu:>{11 * has_gpu}} {size:>8}".rstrip()
        for name, jobs, views, seconds, gpu, size in rows
    )
