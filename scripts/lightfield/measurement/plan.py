"""Estimates the cost of the chosen datasets on this machine: views, time and disk space."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from lightfield.configuration.config_file import Energy
from lightfield.core import processors, units
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_text
from lightfield.measurement.equal_error import EqualError, of_calibration, of_measurement
from lightfield.planning import cost
from lightfield.planning.cost import Cost, kwh
from lightfield.planning.estimate import Estimate, Known, ProbedViews, read_probe
from lightfield.stages.measurement import Plan
from lightfield.workflow.known_times import finished_of, read_known

COLUMNS = (
    "dataset",
    "views",
    "resolution",
    "samples",
    "s a view",
    "time",
    "plain",
    "equal error",
    "bias",
    "shared",
    "size",
)

# The formulas of the columns, printed below the table.
FORMULAS = """\
- time = views × s a view
- s a view = mean over the probes of seconds of the probe × pixels of a view / pixels of the \
probe, ± its standard error, or the mean over finished views of the same size
- plain = time of views without denoising
- equal error = time of the cheapest setting with the same error, which is usually denoised
- bias = bias² / error of all pixels, both at equal error
- shared = correlation of that bias between neighbouring views, where both see the same surface
- size = views × mean over the probes of bytes of the probe × pixels of a view / pixels of the \
probe
"""


@dataclass(frozen=True)
class Expected:
    """The estimate of one dataset of so many frames. Seconds count for one core or for the GPU.

    ``choices`` compares plain path tracing with the cheapest setting of the same error. ``known``
    says more of the views' time than the probe.
    """

    name: str
    frames: int
    probe: ProbedViews
    choices: EqualError
    known: Known

    @property
    def estimate(self) -> Estimate:
        """The estimate of a view on the probe's device."""
        known = replace(self.known, probe=self.probe)
        estimate = known.estimate(self.probe.size, self.probe.on_gpu)
        assert estimate
        return estimate

    @property
    def views(self) -> int:
        """The views of all frames."""
        return self.frames * self.probe.views

    @property
    def cost(self) -> Cost:
        """The cost of all views."""
        return self.views * Cost(self.estimate.view_seconds, disk_bytes=self.probe.view_bytes)

    @property
    def seconds_of_choices(self) -> list[float | None]:
        """The seconds of all views, plain and with the cheapest setting. None if unknown."""
        parts = (self.choices.plain, self.choices.cheapest)
        return [None if part is None else part * self.cost.seconds for part in parts]

    @property
    def row(self) -> str:
        """The dataset's row of the table."""
        probe, estimate = self.probe, self.estimate
        width, height = probe.resolution
        return (
            f"| {self.name} | {self.views} | {width} × {height} | {probe.samples} "
            f"| {estimate.view_seconds:.3g} ± {estimate.view_error or 0:.1g} "
            f"| {units.duration(self.cost.seconds)} | {_times(self.seconds_of_choices)} "
            f"| {_figure(self.choices.bias, '.0%')} | {_figure(self.choices.correlation, '.2f')} "
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
    choices = {}
    advice = dict(job.advice)
    calibrations = {name: files for name, *files in job.calibration}
    for name, _, probe in probes:
        if name in calibrations:
            choices[name] = of_calibration(*calibrations[name])
        elif name in advice:
            keys = ("changes", "points", "neighbouring_views")
            choices[name] = of_measurement(
                probe, read_keys(advice[name], "error_vs_time.py", *keys)
            )
    energy = Energy(watts=job.watts, cores=job.cores or "auto")
    known = {name: read_known(None, None, finished_of(job.finished, name)) for name, _, _ in probes}
    text = table(probes, choices, energy, known)
    write_text(job.output, text)
    print(text, end="")


def table(
    datasets: Sequence[tuple[str, int, ProbedViews]],
    choices: Mapping[str, EqualError],
    energy: Energy,
    known: Mapping[str, Known],
) -> str:
    """Return the table of (name, frames, probe), with the sums and the formulas below.

    ``choices`` has what was measured of a dataset's scene, by the datasets' names. ``known`` has
    what else says how long its views take.
    """
    expected = [
        Expected(
            name,
            frames,
            probe,
            choices.get(name) or of_measurement(probe, None),
            known.get(name, Known()),
        )
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
        *(f"- {dataset.estimate.line(dataset.name, dataset.views)}" for dataset in expected),
        "",
        FORMULAS,
        "Probes are a few small views with all their samples. — is not known.",
        *_how_to_learn(expected),
        "",
    ]
    return "\n".join(lines)


def _how_to_learn(expected: Sequence[Expected]) -> list[str]:
    """Return how to learn the time at equal error, and how to ask for it. Empty if that is done."""
    plain = [dataset for dataset in expected if dataset.choices.is_plain]
    lines = []
    if any(dataset.choices.cheapest is None for dataset in plain):
        lines.append(
            "`snakemake --cores 2 error_vs_time` with the same --config measures the time at equal "
            "error. It takes about twenty minutes a scene on an idle core."
        )
    if plain:
        probe = plain[0].probe
        calibration = cost.calibration_of_samples(probe.samples, probe.resolution)
        lines.append(
            f"To ask for it, write `target_error: {{of_samples: {probe.samples}}}` in place of "
            f"`samples: {probe.samples}`. A scene's calibration takes about "
            f"{units.duration(calibration.seconds)} of a core."
        )
    return lines


def _sums_row(expected: Sequence[Expected]) -> str:
    """Return the table's last row: the sums over all datasets.

    Times of a core and of a graphics card have no sum.
    """
    views = sum(dataset.views for dataset in expected)
    total = sum((dataset.cost for dataset in expected), Cost())
    size = units.size(total.disk_bytes)
    if 0 < len(on_card(expected)) < len(expected):
        return f"| all | {views} | | | | — | {_times([None, None])} | | | {size} |"
    errors = [dataset.views * (dataset.estimate.view_error or 0) for dataset in expected]
    error = math.hypot(*errors)
    columns = zip(*(dataset.seconds_of_choices for dataset in expected), strict=True)
    of_choices = [None if None in column else sum(column) for column in columns]
    return (
        f"| all | {views} | | | | {units.duration(total.seconds)} ± {units.duration(error)} "
        f"| {_times(of_choices)} | | | {size} |"
    )


def on_card(expected: Sequence[Expected]) -> list[str]:
    """Return the names of the datasets whose probes a graphics card rendered."""
    return [dataset.name for dataset in expected if dataset.probe.on_gpu]


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


def _times(values: Sequence[float | None]) -> str:
    return " | ".join("—" if value is None else units.duration(value) for value in values)


def _figure(value: float | None, form: str) -> str:
    return "—" if value is None else format(value, form)
