"""What the terminal shows of a run: its start, its progress, its ends, and a dry run's forecast."""

import os
import resource
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from lightfield.configuration.dataset import SPEED_OF_GPU, Dataset
from lightfield.core.terminal import was_interrupted
from lightfield.core.units import count, duration
from lightfield.planning.cost import JOB, Cost, estimate_of, rendering
from lightfield.planning.estimate import Estimate
from lightfield.planning.forecast import Request, Work, forecast, requests_table
from lightfield.planning.phases import SENSOR_PHASE
from lightfield.workflow import run_lock
from lightfield.workflow.job_plan import JobPlan, PlannedJob
from lightfield.workflow.jobs import (
    BUILD_MEMBERS,
    CALIBRATE,
    COUNT_MEMBERS,
    INDEX,
    ORDER,
    PACK,
    PAGE,
    RENDER,
    SEQUENCE_PAGE,
    Job,
)
from lightfield.workflow.known_times import time_files
from lightfield.workflow.run_config import ending_run
from lightfield.workflow.run_display import RunDisplay, Task
from lightfield.workflow.slurm import Watch, interrupt
from lightfield.workflow.start import StartChecks, explain_full_disk
from lightfield.workflow.unfinished_views import unfinished_views

# For more datasets than this, only the page of all datasets is named.
MOST_PAGES = 12
# A note names at most so many folders that a family no longer has.
MOST_PLACES = 5
# What stands below the table of what jobs request of a cluster.
REQUESTS_NOTE = (
    "mem_mb is the memory of a job in MB, and runtime its time limit in minutes. – is the "
    "cluster's default.\n"
    "A limit is several times the expected time. Jobs of seconds, and of pages, run beside "
    "Snakemake, and are not listed.\n"
    "To change one: --set-resources render:mem_mb=16000. See docs/how-to/tune-a-cluster.md."
)
# What stands below it if jobs request a GPU.
GPU_NOTE = (
    f"GPU: taken as {SPEED_OF_GPU} cores in the run times and the numbers of jobs, not measured. "
    "CPU time is a core's."
)
# The message if a run ends early, and no job has failed.
UNFINISHED = "error: the run was stopped before its last job: the same command goes on"

IsLeft = Callable[[str], bool]
"""Whether the job of a receipt, or a job before it, must still run."""


class Handlers:
    """What the Snakefile calls when a run starts, and when it ends.

    Snakemake's logger plugin tells ``display`` what Snakemake does.
    """

    def __init__(self, plan: JobPlan) -> None:
        self._plan = plan
        self._run = plan.run
        self._checks = StartChecks(plan)
        # By the names of datasets.
        self._estimates: dict[str, Estimate] = {}
        self.display = RunDisplay(self._print_forecast, plan.find_log)
        if self._run.is_main:
            self._use_plugin()

    def _use_plugin(self) -> None:
        """Let the logger plugin tell the display. Without it, Snakemake shows the run itself."""
        with suppress(ImportError):
            import snakemake_logger_plugin_plenoforge as plugin

            plugin.display = self.display
            self.display.is_told = plugin.is_used

    # What Snakemake calls.

    def start(self) -> None:
        """Check and note what must be before the first job. End the run if it cannot work."""
        plan = self._plan
        with ending_run():
            plan.announce_changes()
            plan.make_ways()
            run_lock.take(plan.scene_folders())
            self.display.at_close(explain_full_disk)
            self._checks.check(self.display.slurm_run is not None)
            plan.write_new_settings()
            self._checks.remove_leftovers()
            self._begin_display()
            announce_stop()
            self._watch_slurm()

    def _watch_slurm(self) -> None:
        """End the run if it waits for jobs that Slurm does not have any more."""
        display = self.display
        if display.slurm_run:
            Watch(display.slurm_run, display.on_cluster, display.say, self._end).start()

    def _end(self, why: str) -> None:
        """End the run from outside Snakemake, and print why."""
        self.display.end = why
        interrupt()

    def succeed(self) -> None:
        """Print the end of a run that made all that it should."""
        self.display.at_close(self._print_results)

    def fail(self) -> None:
        """Print the end of a run that did not make all that it should."""
        self.display.at_close(self._print_failures)

    # The progress.

    def _begin_display(self) -> None:
        """Show the progress of the run from now on."""
        self._announce_calibrations()
        tasks = [self._task_of(planned) for planned in self._plan.planned_jobs()]
        self.display.begin({task.log: task for task in tasks}, self._run.cores)
        self.display.start()

    def _announce_calibrations(self) -> None:
        """Print the estimated time of each calibration, and of the datasets that depend on it."""
        seconds: dict[str, dict[Job, float]] = {}
        for planned in self._plan.planned_jobs():
            if planned.job in (CALIBRATE, RENDER):
                costs = seconds.setdefault(planned.names["scene"], {CALIBRATE: 0.0, RENDER: 0.0})
                costs[planned.job] += (self._cost_of(planned) or Cost()).all_seconds
        for scene, costs in seconds.items():
            if costs[CALIBRATE]:
                print(
                    f"calibrating {scene} takes some {duration(costs[CALIBRATE])} of a core,"
                    f" and rendering it then some {duration(costs[RENDER])}",
                    file=sys.stderr,
                )

    def _task_of(self, planned: PlannedJob) -> Task:
        """Return the display's task for a job."""
        expected = self._cost_of(planned)
        # The display counts only the dataset's own views.
        views = 0 if "batch" in planned.names else self._rendered_views(planned)
        return Task(
            planned.name,
            self._phase_of(planned),
            Path(self._run.log_of(planned.name)),
            views=views,
            seconds=expected.all_seconds if expected else None,
        )

    def _phase_of(self, planned: PlannedJob) -> str:
        """Return the phase of a job."""
        if "reprojection" in planned.names:
            reprojection = self._run.asked(self._run.build.reprojection, planned.names)
            if reprojection and reprojection.sensor:
                return SENSOR_PHASE
        return planned.job.phase

    def _rendered_views(self, planned: PlannedJob) -> int:
        """Return the number of the dataset's views that a job renders."""
        job, names = planned
        if job is BUILD_MEMBERS:
            return self._run.asked(self._run.build.batch_views, names)
        return int(names["end"]) - int(names["first"]) if job is RENDER else 0

    def _cost_of(self, planned: PlannedJob) -> Cost | None:
        """Return the cost of a job. None if it is unknown."""
        job, names = planned
        if job.cost is None:
            return None
        if estimate := self._estimate_of(planned):
            dataset = self._run.asked(self._run.build.dataset, names)
            return rendering(dataset, self._rendered_views(planned), estimate)
        return self._run.asked(partial(job.cost, self._run.build), names)

    def _estimate_of(self, planned: PlannedJob) -> Estimate | None:
        """Return how long a view of a job takes by all that is known. None if it renders none."""
        if planned.job is not RENDER:
            return None
        dataset = self._run.asked(self._run.build.dataset, planned.names)
        if dataset.imported:
            return None
        if dataset.name not in self._estimates:
            known = time_files(dataset, self._run.settings).read()
            self._estimates[dataset.name] = estimate_of(dataset, known, bool(self._run.gpus))
        return self._estimates[dataset.name]

    # The ends.

    def _print_results(self) -> None:
        """Print what the run took, and what it has finished.

        A run with --until or --touch leaves jobs out, and ends without an error, too.
        """
        self._print_summary()
        is_left = self._plan.left_out()
        self._print_pages(is_left)
        self._print_packages(is_left)
        self._print_families(is_left)
        self._print_former_places()

    def _print_failures(self) -> None:
        """Print what the run took, and why it ended."""
        self._print_summary()
        failures = "" if was_interrupted() else self.display.failures()
        self._print_former_places()
        print(self.display.end or failures or UNFINISHED, file=sys.stderr, flush=True)

    def _print_summary(self) -> None:
        """Print what the run took."""
        if summary := self.display.summary(self._cpu_seconds()):
            print(summary, file=sys.stderr)

    def _cpu_seconds(self) -> float | None:
        """Return the CPU seconds of all jobs. None on a cluster, or on a graphics card."""
        if not self._run.runs_here or self._run.gpus:
            return None
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    def _print_pages(self, is_left: IsLeft) -> None:
        """Print the pages of the datasets that this run has finished, and the folders of others."""
        plan = self._plan
        ends: dict[str, list[str]] = {"valid": [], "not valid": [], "not finished": []}
        for dataset in self._run.build.datasets.values():
            receipt = plan.receipt_path(PAGE.name_of(dataset))
            if receipt in plan.asked and is_left(receipt):
                ends["not finished"].append(plan.shown(dataset.paths.folder))
            elif receipt in plan.asked:
                ends[self._validity(dataset)].append(plan.shown(self._page_of(dataset, is_left)))
        for state, pages in ends.items():
            paths = list(dict.fromkeys(pages))
            if len(paths) > MOST_PAGES:
                index = "" if is_left(plan.receipt_path(INDEX.name)) else "/index.html"
                all_of_them = plan.shown(f"{self._run.results}{index}")
                paths = [f"{count(len(paths), 'dataset')}: {all_of_them}"]
            for path in paths:
                print(f"{state}: {path}", file=sys.stderr)

    def _page_of(self, dataset: Dataset, is_left: IsLeft) -> str:
        """Return the page of a dataset. For a valid frame, this is the page of its sequence."""
        sequence = {"scene": dataset.scene_folder, "rig": dataset.rig_name}
        receipt = self._plan.receipt_path(SEQUENCE_PAGE.name.format(**sequence))
        is_made = receipt in self._plan.asked and not is_left(receipt)
        if dataset.sequence_page and is_made and self._plan.is_valid(dataset):
            return dataset.sequence_page
        return dataset.paths.page

    def _validity(self, dataset: Dataset) -> str:
        return "valid" if self._plan.is_valid(dataset) else "not valid"

    def _print_packages(self, is_left: IsLeft) -> None:
        """Print the paths of the first archives of this run's packages."""
        for receipt, (job, names) in self._plan.asked.items():
            if job is PACK:
                state = "not packed" if is_left(receipt) else "packed"
                archive = self._run.paths.package.format(**names)
                print(f"{state}: {self._plan.shown(archive)}", file=sys.stderr)

    def _print_families(self, is_left: IsLeft) -> None:
        """Print how many members of each family are built, if this run has counted them."""
        for receipt, planned in self._plan.asked.items():
            is_count = planned.job is COUNT_MEMBERS
            if is_count and self._plan.check.will_run(receipt) and not is_left(receipt):
                log = Path(self._run.log_of(planned.name))
                print(log.read_text(encoding="utf-8").strip(), file=sys.stderr)

    def _print_former_places(self) -> None:
        """Print which folders are of members or datasets that the chosen families lack now."""
        for folder in self._run.build.family_names:
            if places := self._plan.former_places(folder):
                more = f" and {len(places) - MOST_PLACES:,} more" if places[MOST_PLACES:] else ""
                print(
                    f"note: {self._run.results}/{folder} has what the family no longer has: "
                    f"{', '.join(places[:MOST_PLACES])}{more}; snakemake --cores 1 prune removes "
                    "it",
                    file=sys.stderr,
                )

    # The forecast of a dry run.

    def _print_forecast(self) -> None:
        """Print the jobs, views, CPU time and size of a dry run's phases and datasets.

        Exit with an error if the run would be refused.
        """
        self._plan.announce_changes()
        is_refused = self._checks.announce_refusals()
        jobs = self._jobs_of_dry_run()
        print(forecast([self._work_of(planned) for planned in jobs]))
        if self._run.cluster:
            self._print_requests(jobs)
        if self._request_of("prune"):
            self._print_removals()
        else:
            self._print_former_places()
        if is_refused:
            sys.exit(1)

    def _jobs_of_dry_run(self) -> list[PlannedJob]:
        """Return the jobs that Snakemake would run, in the order of the work.

        With --until these are fewer than the jobs that must run.
        """
        jobs = [each for each in self._plan.planned_jobs() if self._request_of(each.name)]
        return sorted(jobs, key=lambda planned: ORDER[planned.job])

    def _request_of(self, name: str) -> Request | None:
        """Return what a job would request, by its name. None if Snakemake would not run it."""
        return self.display.requests.get(self._plan.shown(self._run.log_of(name)))

    def _work_of(self, planned: PlannedJob) -> Work:
        """Return a job's part of the forecast. Views that earlier runs finished do not count."""
        rest = planned
        if planned.job is RENDER:
            end = int(planned.names["first"]) + unfinished_views(self._plan, planned)
            rest = PlannedJob(RENDER, {**planned.names, "end": str(end)})
        views = self._rendered_views(rest)
        # A job without a view to render does not start Blender.
        is_finished = rest.job is RENDER and not views
        cost = JOB if is_finished else self._cost_of(rest) or Cost()
        return Work(
            self._phase_of(planned),
            self._dataset_name_of(planned),
            views,
            cost,
            self._estimate_of(planned),
        )

    def _dataset_name_of(self, planned: PlannedJob) -> str | None:
        """Return the scene and rig of a job, as in its path. None if it belongs to no rig."""
        names, datasets = planned.names, self._run.build.datasets
        if "rig" not in names:
            return None
        name = f"{names['scene']}/{names['rig']}"
        return datasets[name].sequence_name if name in datasets else name

    def _print_removals(self) -> None:
        """Print each folder that a run with `prune` would remove."""
        for folder in self._run.build.family_names:
            for place in self._plan.former_places(folder):
                print(f"would be removed: {self._run.results}/{folder}/{place}", file=sys.stderr)

    def _print_requests(self, jobs: list[PlannedJob]) -> None:
        """Print what the jobs of a dry run would request of the cluster."""
        requests = [self._request_of(each.name) for each in jobs if not each.job.is_local]
        if found := [request for request in requests if request]:
            print(f"\n{requests_table(found)}\n\n{REQUESTS_NOTE}")
            if self._run.gpus:
                print(GPU_NOTE)


def announce_stop() -> None:
    """Print a message at SIGTERM, because Snakemake is quiet while it waits for its jobs."""
    stop: Any = signal.getsignal(signal.SIGTERM)

    def stop_and_say_so(number: int, frame: FrameType | None) -> None:
        # The signal may interrupt a print(), in which print() cannot be called.
        os.write(2, b"stopping after SIGTERM: the jobs that run are finished first\n")
        stop(number, frame)

    signal.signal(signal.SIGTERM, stop_and_say_so)
