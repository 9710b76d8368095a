"""Adds up the cost of a dataset, and extrapolates to the full dataset, for scripts/costs.py."""

import csv
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from io import StringIO
from pathlib import Path
from statistics import mean
from typing import Any

from lightfield.configuration.config_file import Energy
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_text, write_json
from lightfield.core.names import FILE, RENDERED
from lightfield.core.paths import files_below
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import NAME, LightField
from lightfield.formats.passes import FLOW, GROUP_PREFIX, PASSES
from lightfield.planning.cost import DENOISING_SAMPLES, Rate, cost_in_samples, kwh
from lightfield.planning.sampling import standard_error
from lightfield.stages import measurement
from lightfield.workflow import history

# The kinds of jobs that every dataset has, in the order of the work: the folders of their times.
# Other kinds come between. Each reprojection is one.
_FIRST_KINDS = ("scene", "cameras", RENDERED)
_LAST_KINDS = ("export", "validate", "report")
# The file and the folder that exporters write beside the views.
_EXPORTED = ("transforms.json", "exports")
# The files and folders of a kind. Without an entry, the folder has the kind's name.
_PATHS_OF_KIND = {
    "cameras": ("lightfield.json",),
    RENDERED: ("exr", *PASSES, f"{GROUP_PREFIX}*"),
    # Exports of reprojected views lie in the reprojection's folder.
    "export": (*_EXPORTED, *(f"*/{name}" for name in _EXPORTED)),
    "validate": ("validation.json",),
}
# Files of the report that differ from build to build do not count.
_NOT_COUNTED = ("costs.json", "index.html")


@dataclass
class KindCost:
    """The sums over the jobs of one kind. The peak memory is the largest job's."""

    jobs: int = 0
    wall_seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_memory_bytes: int = 0


def _shard_costs(name: str, runs: Sequence[history.ProcessHistory]) -> dict[str, Any]:
    """Add up all processes that worked on one shard."""
    first, end = map(int, name.split("-"))
    views = [view for run in runs for view in run.views]
    latest = {view["view"]: view["wall_seconds"] for view in views}
    wall = sum(run.wall_seconds for run in runs)
    path_tracing = sum(view["render_seconds"] for view in views)
    rendered_again = sum(view["wall_seconds"] for view in views) - sum(latest.values())
    return _rounded(
        {
            "shard": name,
            "views": end - first,
            "wall_seconds": wall,
            "cpu_seconds": sum(run.cpu_seconds for run in runs),
            "peak_memory_bytes": max(run.peak_memory_bytes for run in runs),
            "path_tracing_seconds": path_tracing,
            "overhead_seconds": wall - path_tracing,
            "views_rendered": len(views),
            "runs": len(runs),
            "killed_runs": sum(run.end is None for run in runs),
            "repeated_seconds": rendered_again
            + sum(run.start.get("start_up_seconds", 0.0) for run in runs[1:]),
        }
    )


def _rounded(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures, with seconds rounded to milliseconds."""
    return {k: round(v, 3) if isinstance(v, float) else v for k, v in figures.items()}


def _costs_of_kinds(dataset: Path, scene: Iterable[Path]) -> dict[str, KindCost]:
    """Add up the jobs' TSVs by kind: the name of a TSV's folder, or else its own name.

    Leaves out the TSVs of shards, because they hold only a shard's last run. Warns about a TSV that
    cannot be read, and leaves it out.
    """
    kinds: dict[str, KindCost] = {}
    tables = [("scene", path) for folder in scene for path in folder.glob("*.tsv")]
    tables += [
        (path.relative_to(dataset).parts[0].removesuffix(".tsv"), path)
        for path in files_below(dataset)
        if path.suffix == ".tsv"
    ]
    for name, path in tables:
        if name == RENDERED:
            continue
        try:
            wall, cpu, memory = job_times(path)
        except (OSError, ValueError, LookupError, TypeError, StopIteration):
            print(f"{path}: is not a table of a job's time; the job is left out", file=sys.stderr)
            continue
        kind = kinds.setdefault(name, KindCost())
        kind.jobs += 1
        kind.wall_seconds += wall
        kind.cpu_seconds += cpu
        kind.peak_memory_bytes = max(kind.peak_memory_bytes, memory)
    return kinds


def job_times(path: Path) -> tuple[float, float, int]:
    """Return a job's wall and processor time in seconds, and its memory in bytes, from its TSV."""
    row = next(csv.DictReader(StringIO(read_text(path)), delimiter="\t"))
    wall = float(row["s"])
    cpu = wall if row["cpu_time"] == "NA" else float(row["cpu_time"])
    memory = 0 if row["max_rss"] == "NA" else round(float(row["max_rss"]) * 2**20)
    return wall, cpu, memory


def _bytes_of_kinds(kinds: Iterable[str], dataset: Path, blend: Path | None) -> dict[str, int]:
    """Return the size of the files of each kind. 0 for a kind without files in the dataset.

    A file that exports link to takes no more space there. It counts in the first of its kinds.
    """
    sizes = {}
    counted: set[tuple[int, int]] = set()
    for kind in kinds:
        sizes[kind] = 0
        for file in _files_of_kind(kind, dataset, blend):
            status = file.stat()
            if (status.st_dev, status.st_ino) not in counted:
                counted.add((status.st_dev, status.st_ino))
                sizes[kind] += status.st_size
    return sizes


def _files_of_kind(kind: str, dataset: Path, blend: Path | None) -> list[Path]:
    """Return the files of a kind that count, in the folder ``dataset``."""
    if kind == "scene":
        return [blend] if blend else []
    files = []
    for name in _PATHS_OF_KIND.get(kind, (kind,)):
        for path in dataset.glob(name):
            inside = [path] if path.is_file() else files_below(path)
            files += [file for file in inside if file.name not in _NOT_COUNTED]
    if kind == "export":
        return files
    exported = [dataset / kind / name for name in _EXPORTED]
    return [file for file in files if not any(file.is_relative_to(path) for path in exported)]


@dataclass(frozen=True)
class RenderedView:
    """The time of one view: path tracing, the rest, and when it was finished.

    Times are seconds of one core, or of the whole machine if a graphics card renders.
    """

    view: str
    finished: float
    path_tracing: float
    rest: float
    # Whether it is its process's first view, which pays for the scene's acceleration structures.
    first: bool


def renderings(run: history.ProcessHistory) -> Iterator[RenderedView]:
    """Split the time of each view that a process rendered.

    While Cycles traces paths, all threads are busy. The rest takes one thread. The view's processor
    time is divided in these proportions, because wall time includes the work of other programs.
    """
    for index, view in enumerate(run.views):
        traced = view["render_seconds"]
        rest = max(0.0, view["wall_seconds"] - traced)
        if _on_processor(run):
            busy = run.start["threads"] * traced
            traced = view["cpu_seconds"] * busy / (busy + rest)
            rest = view["cpu_seconds"] - traced
        yield RenderedView(view["view"], view["finished"], traced, rest, first=index == 0)


def _on_processor(run: history.ProcessHistory) -> bool:
    """Return whether a process rendered on the processor's cores."""
    return bool(run.start["device"] == "CPU")


def on_card(run: history.ProcessHistory) -> bool:
    """Return whether a process rendered views on a graphics card."""
    return bool(run.views) and not _on_processor(run)


def _latest_device(runs: Sequence[history.ProcessHistory]) -> str | None:
    """Return the device that rendered the latest view. None without a rendered view."""
    rendered = [run for run in runs if run.views]
    if not rendered:
        return None
    latest = max(rendered, key=lambda run: run.views[-1]["finished"])
    return str(latest.start["device"])


def write(job: measurement.Costs) -> None:
    """Write the costs.json of a dataset."""
    write_json(job.output, costs(job))


def _full_size(job: measurement.Costs) -> measurement.FullSize:
    """Return the size of the full dataset, with the samples of its .blend."""
    full = job.settings.full
    if full.samples != FILE:
        return full
    if job.inventory is None:
        raise UserError("--inventory: is missing; it has the samples of the .blend")
    inventory = read_inventory(job.inventory, "blend")
    return full.model_copy(update={"samples": inventory["blend"]["samples"]})


def costs(job: measurement.Costs) -> dict[str, Any]:
    """Return the content of a dataset's costs.json."""
    energy = job.settings.energy
    full = _full_size(job)
    histories = {path.stem: history.read(path) for path in history.shards(job.receipts)}
    # Imported views have none.
    by_shard = {name: runs for name, runs in histories.items() if runs}
    runs = [run for runs_of_shard in by_shard.values() for run in runs_of_shard]
    shards = [_shard_costs(name, runs_of_shard) for name, runs_of_shard in by_shard.items()]
    shards.sort(key=lambda shard: [int(number) for number in shard["shard"].split("-")])
    kinds = in_order(
        _costs_of_kinds(job.benchmarks, job.scene_benchmarks) | {RENDERED: _cost_of_views(shards)}
    )
    sizes = _bytes_of_kinds(kinds, job.dataset, job.blend)
    device = _latest_device(runs)
    totals = ("path_tracing_seconds", "overhead_seconds", "repeated_seconds")
    return {
        # The file has another word for the kinds, so that those who read it need not change.
        "stages": [
            {"stage": name, **_rounded(asdict(kind)), "bytes": sizes[name]}
            for name, kind in kinds.items()
        ],
        "shards": shards,
        **{name: round(sum(shard[name] for shard in shards), 3) for name in totals},
        "device": device,
        "cores": energy.core_count,
        "watts": energy.watts,
        "energy_kwh": kwh(_machine_seconds(kinds, runs, energy.core_count), energy.watts),
        "attribution": (
            f"{energy.watts:g} W, the whole machine's, times wall time, times the part of its "
            f"{energy.core_count} cores that was busy"
            + ("; all of it while a graphics card renders" if any(map(on_card, runs)) else "")
        ),
        "extrapolation": extrapolation(
            runs,
            kinds,
            sizes[RENDERED],
            LightField.read(job.dataset / NAME),
            energy,
            full,
            job.settings.reprojections,
        ),
    }


def _cost_of_views(shards: Sequence[Mapping[str, Any]]) -> KindCost:
    """Return the sums over the jobs of all shards."""
    return KindCost(
        jobs=len(shards),
        wall_seconds=sum(shard["wall_seconds"] for shard in shards),
        cpu_seconds=sum(shard["cpu_seconds"] for shard in shards),
        peak_memory_bytes=max((shard["peak_memory_bytes"] for shard in shards), default=0),
    )


def in_order(kinds: Mapping[str, KindCost]) -> dict[str, KindCost]:
    """Return the kinds of jobs in the order of the work."""
    between = sorted(kinds.keys() - {*_FIRST_KINDS, *_LAST_KINDS})
    names = [*_FIRST_KINDS, *between, *_LAST_KINDS]
    return {name: kinds[name] for name in names if name in kinds}


def _machine_seconds(
    kinds: Mapping[str, KindCost], runs: Sequence[history.ProcessHistory], cores: int
) -> float:
    """Return the seconds of the whole machine that the work took.

    Work on processors takes its part of the ``cores``. A run on a graphics card takes the machine.
    """
    other_kinds = sum(kind.cpu_seconds / cores for name, kind in kinds.items() if name != RENDERED)
    rendering = sum(run.wall_seconds if on_card(run) else run.cpu_seconds / cores for run in runs)
    return other_kinds + rendering


@dataclass(frozen=True)
class Scale:
    """The size of the full dataset beside this one's: the pixels of a view, and a pixel's cost.

    The cost counts in samples. Denoising counts as samples, too.
    """

    views: int
    samples: int
    full_pixels: int
    full_cost: float
    pixels_here: int
    cost_here: float

    @property
    def pixels(self) -> float:
        """The pixels of a full view, over a view's here."""
        return self.full_pixels / self.pixels_here

    @property
    def effort(self) -> float:
        """The cost of a pixel of a full view, over a pixel's here."""
        return self.full_cost / self.cost_here

    @classmethod
    def of(cls, full: measurement.FullSize, lightfield: LightField) -> "Scale":
        """Return the scale of a full dataset over this one."""
        render = lightfield.render
        lens = lightfield.lens
        assert isinstance(render.samples, int)
        samples = full.samples or render.samples
        assert isinstance(samples, int)
        # If a target error decides, both are unknown until then.
        denoise = render.denoise if full.denoise is None else full.denoise
        return cls(
            views=full.views,
            samples=samples,
            full_pixels=math.prod(full.resolution),
            full_cost=cost_in_samples(samples, denoise),
            pixels_here=lens.width * lens.height,
            cost_here=cost_in_samples(render.samples, render.denoise),
        )


def extrapolation(
    runs: Sequence[history.ProcessHistory],
    kinds: Mapping[str, KindCost],
    view_bytes: int,
    lightfield: LightField,
    energy: Energy,
    full: measurement.FullSize,
    reprojections: Iterable[str],
) -> dict[str, Any] | None:
    """Return the cost of the full dataset, from the views of this one. None without views.

    If both processors and graphics cards rendered, only views of the latest device count: times of
    a core and of a whole machine have no mean.
    """
    by_processor = _latest_device(runs) == "CPU"
    runs = [run for run in runs if not run.views or _on_processor(run) == by_processor]
    # Receipts may have views that the dataset had under earlier settings.
    names = {view.name for view in lightfield.views}
    all_renderings = [
        rendering for run in runs for rendering in renderings(run) if rendering.view in names
    ]
    if not all_renderings:
        return None
    latest = _latest_renderings(all_renderings)
    scale = Scale.of(full, lightfield)
    times = [view.path_tracing for view in latest]
    error = None
    if len(times) > 1:
        missing_part = max(0.0, 1 - len(times) / scale.views)
        a_view = standard_error(times) * scale.pixels * scale.effort
        error = scale.views * a_view * math.sqrt(missing_part)
    # Beside a graphics card, a core's time is only a part of the machine's.
    part = 1 if by_processor else 1 / energy.core_count
    growing_kinds = {"validate", FLOW.name, *reprojections}
    each_view = mean(view.rest for view in latest) + part / len(lightfield.views) * sum(
        kind.cpu_seconds for name, kind in kinds.items() if name in growing_kinds
    )
    start_ups = sum(run.start.get("start_up_cpu_seconds", 0.0) for run in runs)
    fixed_kinds = sum(
        kind.cpu_seconds for name, kind in kinds.items() if name not in {RENDERED, *growing_kinds}
    )
    first_views = sum(rendering.rest for rendering in all_renderings if rendering.first)
    once = first_views + part * (start_ups + fixed_kinds)
    rate = Rate(
        sample_seconds=mean(times) / (scale.pixels_here * scale.cost_here),
        pixel_seconds=each_view / scale.pixels_here,
    )
    seconds = scale.views * rate.view_seconds(scale.full_pixels, scale.full_cost) + once
    machine = seconds / energy.core_count if by_processor else seconds
    return {
        "views": scale.views,
        "resolution": full.resolution,
        "samples": scale.samples,
        "core_hours": seconds / 3600,
        "core_hours_uncertainty": None if error is None else error / 3600,
        "energy_kwh": kwh(machine, energy.watts),
        "energy_kwh_uncertainty": (
            None if error is None else kwh(error * machine / seconds, energy.watts)
        ),
        "gigabytes": view_bytes / len(lightfield.views) * scale.views * scale.pixels / 1e9,
        "basis": basis(len(times), lightfield, scale, by_processor),
    }


def _latest_renderings(all_renderings: Sequence[RenderedView]) -> list[RenderedView]:
    """Return the latest rendering of each view, without the first views of processes.

    First views do not represent the others. They count only if there are no others.
    """
    by_finish = sorted(all_renderings, key=lambda rendering: rendering.finished)
    by_view = {rendering.view: rendering for rendering in by_finish}
    latest = list(by_view.values())
    return [rendering for rendering in latest if not rendering.first] or latest


def basis(count: int, lightfield: LightField, scale: Scale, by_processor: bool) -> str:
    """Describe the basis of an extrapolation from ``count`` views, and how far it reaches."""
    lens = lightfield.lens
    render = lightfield.render
    denoising = f", and denoising, which counts as {DENOISING_SAMPLES}" if render.denoise else ""
    device = "the processor" if by_processor else "a graphics card: hours are the machine's"
    text = (
        f"path tracing of {units.count(count, 'view')}: {lens.width} × {lens.height} pixels, "
        f"{render.samples} samples{denoising}; in proportion to pixels and samples; "
        f"on {device}; all else as measured, the part that every view needs in proportion to "
        "views and pixels"
    )
    factor = scale.pixels * scale.effort
    if factor != 1:
        text += (
            f"; a full view is {factor:.2g} times the path tracing of one here, "
            "and the farther from 1, the less certain"
        )
    return text
