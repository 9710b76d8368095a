"""Checks, notes and removals before the first job."""

import functools
import math
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from lightfield.configuration.blend_lock import expected_blend
from lightfield.configuration.dataset import Dataset
from lightfield.core import disk_space, leftovers, units
from lightfield.core.disk_space import Need, check_folder
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.base import RadialLens
from lightfield.geometry.ray_table import ray_table
from lightfield.planning.cost import light_group_count, rendering, temporary_bytes, view_cost
from lightfield.planning.time_limits import limit_of_render
from lightfield.stages.measurement import RENDERS_ON
from lightfield.workflow import presence
from lightfield.workflow.build import Wildcards
from lightfield.workflow.job_plan import JobPlan, PlannedJob
from lightfield.workflow.job_requests import JobRequests
from lightfield.workflow.jobs import (
    BUILD_MEMBERS,
    CHECK_BLEND,
    GPU_CHECK,
    INVENTORY,
    RENDER,
    REPROJECT,
)
from lightfield.workflow.run import Run
from lightfield.workflow.run_config import NOTES
from lightfield.workflow.slurm import check_slurm

# With less address space, in bytes, the import of bpy crashes, or no thread starts.
LEAST_ADDRESS_SPACE = 1.5e9
# A built scene takes at most so many bytes.
BUILT_SCENE = 1e8


def is_import(run: Run, planned: PlannedJob) -> bool:
    """Return whether a job imports views instead of rendering them."""
    if planned.job is not RENDER:
        return False
    return run.asked(run.build.dataset, planned.names).imported is not None


class StartChecks:
    """What a run checks before its first job, and what a dry run says of it."""

    def __init__(self, plan: JobPlan) -> None:
        self._plan = plan
        self._run = plan.run

    def check(self, uses_slurm: bool) -> None:
        """Raise `UserError` for a run that cannot work, before the first job."""
        self._plan.check_folders()
        if uses_slurm:
            check_slurm()
        self._check_device()
        self._check_memory()
        self._check_disk_space()
        self._check_run_times()
        self._check_lenses()
        self._check_times()

    def announce_refusals(self) -> bool:
        """Print in a dry run what the real run would refuse. Return whether there is anything."""
        checks: list[Callable[[], None]] = [
            self._plan.check_folders,
            self._check_device,
            self._check_memory,
            self._check_disk_space,
            self._check_run_times,
            self._check_lenses,
            self._check_times,
        ]
        planned_jobs = self._plan.planned_jobs()
        checks += [functools.partial(self._check_input, planned) for planned in planned_jobs]
        problems: dict[str, None] = {}
        for check in checks:
            try:
                check()
            except UserError as error:
                problems[str(error)] = None
        for problem in problems:
            print(f"would be refused: {problem}", file=sys.stderr)
        return bool(problems)

    def _check_device(self) -> None:
        """Print on which GPU this machine renders. Raise `UserError` if the device is missing."""
        run = self._run
        jobs = [each.job for each in self._plan.planned_jobs() if not is_import(run, each)]
        device: str = run.settings.device
        if device == "auto" and GPU_CHECK in jobs:
            device = "gpu"
        renders = any(job.renders for job in jobs)
        if not (renders and run.runs_here and (run.gpus or device == "gpu")):
            return
        command = [sys.executable, str(run.folder / "scripts/check_device.py"), device]
        checked = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace")
        if checked.returncode:
            lines = checked.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(lines[-1].removeprefix("error: "))
        if device == run.settings.device:
            for line in checked.stdout.splitlines():
                if line.startswith(RENDERS_ON):
                    print(line, file=sys.stderr)

    def _check_memory(self) -> None:
        """Raise `UserError` for a limit of memory with which Blender cannot start."""
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if self._run.runs_here and 0 <= limit < LEAST_ADDRESS_SPACE:
            raise UserError(
                f"memory: a process may have {units.size(limit)} here, and Blender "
                f"needs at least {units.size(LEAST_ADDRESS_SPACE)}: raise the limit "
                "(ulimit -v unlimited)"
            )

    def _check_disk_space(self) -> None:
        """Warn of disks that this run nearly fills. Raise `UserError` for one that is too small."""
        for warning in disk_space.check(self._needs()):
            print(f"warning: {warning}", file=sys.stderr)

    def _needs(self) -> list[Need]:
        """Return the disk space that the jobs of this run need."""
        run, build = self._run, self._run.build
        jobs = self._plan.planned_jobs()
        renders = [names for job, names in jobs if job is RENDER]
        batches = [names for job, names in jobs if job is BUILD_MEMBERS]
        datasets = {
            d.paths.folder: d for d in (run.asked(build.dataset, names) for names in renders)
        }
        results, work = Path(run.results), Path(run.work)
        needs = []
        for dataset in datasets.values():
            views = presence.missing_views(dataset)
            needs.append(Need(results, views * view_cost(dataset).disk_bytes, views))
        for names in batches:
            size = run.asked(build.batch_cost, names).disk_bytes
            needs.append(Need(results, size, run.asked(build.batch_views, names)))
        for _ in {dataset.scene_name for dataset in datasets.values()}:
            needs.append(Need(work, BUILT_SCENE))
        if jobs:
            # Most jobs write one file beside the views. Each has a log and a receipt.
            needs.append(Need(results, 0, len(jobs)))
            needs.append(Need(work, 0, 2 * len(jobs)))
        if renders and run.runs_here:
            largest = max(
                temporary_bytes(d.pixels, light_group_count(d)) for d in datasets.values()
            )
            needs += self._needs_of_passes(renders, largest)
        return needs

    def _needs_of_passes(self, renders: list[Wildcards], view_bytes: float) -> list[Need]:
        """Return the space for the passes of the views that are rendered at once.

        Each render job writes a view's passes to memory, or to TMPDIR if memory is too small.
        """
        threads = JobRequests(self._run).threads_of_shard(renders[0])
        at_once = min(len(renders), max(1, self._run.cores // threads))
        size = at_once * view_bytes
        return [] if disk_space.fast_folder(size) else [Need(Path(tempfile.gettempdir()), size)]

    def _check_run_times(self) -> None:
        """Warn of views that take longer than the cluster's partition lets a job run."""
        run = self._run
        planned_jobs = self._plan.planned_jobs()
        renders = [p for p in planned_jobs if p.job is RENDER and not is_import(run, p)]
        datasets = (run.asked(run.build.dataset, planned.names) for planned in renders)
        # The frames of a sequence take about the same time.
        for name, dataset in {each.sequence_name: each for each in datasets}.items():
            if problem := too_short_partition(dataset):
                print(f"warning: {name}: {problem}", file=sys.stderr)

    def _check_lenses(self) -> None:
        """Warn of lenses whose equation ends inside the image.

        Raises `UserError` for a lens that would not be rendered exactly.
        """
        lenses, rendered = self._lenses()
        for name, lens in lenses.items():
            if lens.clipped:
                print(f"warning: {name}: {lens.clipped}", file=sys.stderr)
        for name in rendered:
            lens = lenses[name]
            if isinstance(lens, RadialLens) and not lens.in_cycles:
                try:
                    ray_table(lens)
                except UserError as error:
                    raise UserError(f"{name}: {error}") from None

    def _lenses(self) -> tuple[dict[str, Lens], set[str]]:
        """Return the lenses of the planned views, by the names of their datasets.

        Also returns the names of the datasets that are rendered. Reprojections through the rig's
        own lens are left out.
        """
        run, lenses, rendered = self._run, dict[str, Lens](), set[str]()
        for planned in self._plan.planned_jobs():
            if planned.job not in (RENDER, REPROJECT):
                continue
            dataset = run.asked(run.build.dataset, planned.names)
            lens = dataset.rig.camera.make()
            if planned.job is RENDER:
                lenses[dataset.sequence_name] = lens
                if not dataset.imported:
                    rendered.add(dataset.sequence_name)
            elif reprojection := run.asked(run.build.reprojection, planned.names):
                name = f"{dataset.sequence_name}/{planned.names['reprojection']}"
                target = reprojection.lens(lens)
                if target != lens:
                    lenses[name] = target
        return lenses, rendered

    def _check_times(self) -> None:
        """Raise `UserError` for a file that jobs read, and whose time is in the future.

        Snakemake would refuse what the job makes, because it is older.
        """
        run = self._run
        presence.check_times(self._plan.files_read(), [run.results, run.work])

    def _check_input(self, planned: PlannedJob) -> None:
        """Raise `UserError` for a user's file that a job would refuse."""
        run, names = self._run, planned.names
        if planned.job is CHECK_BLEND:
            source = run.asked(run.build.scene, names).written.scene
            blend = Path(str(source.blend))
            if blend.is_file():
                expected_blend(names["name"], source, blend, sha256(blend))
        elif planned.job is INVENTORY:
            presence.check_external_files(run.asked(run.build.scene, names))
        elif is_import(run, planned):
            presence.check_imported(run.asked(run.build.dataset, names))

    def remove_leftovers(self) -> None:
        """Remove what killed runs have left behind, and print how much."""
        removed = leftovers.remove(map(Path, (self._run.results, self._run.work)))
        if removed:
            print(
                f"removed {len(removed)} files and folders that killed runs have left",
                file=sys.stderr,
            )


def too_short_partition(dataset: Dataset) -> str | None:
    """Return a warning if a job of one view is expected to end at its time limit. None if not."""
    cluster, limit = dataset.cluster, limit_of_render(dataset)
    if cluster is None or limit is None:
        return None
    seconds = rendering(dataset, views=1).seconds
    least_cores = math.ceil(seconds / (60 * limit))
    if least_cores <= cluster.speed:
        return None
    more_cores = "" if cluster.has_gpus else f"more CPUs for each job (--cores {least_cores}), or "
    return (
        f"one view is expected to take {units.duration(seconds / cluster.speed)}, and a job that "
        f"renders may take {limit} min, so it would end before its first view: choose {more_cores}"
        "a longer partition (partition_minutes)"
    )


def explain_full_disk() -> None:
    """Explain that Snakemake cannot write its notes, if it ended because of that."""
    try:
        check_folder(NOTES)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
