# The terminal's display: the progress of a run, and the forecast of a dry run.
import atexit
import logging
import resource
import sys
from functools import cache
from pathlib import Path

from lightfield.core.units import duration
from lightfield.planning.cost import STAGES, Cost, cost
from lightfield.planning.forecast import SENSOR_PHASE, Work, forecast
from lightfield.workflow.failures import failure_report
from lightfield.workflow.run_display import RunDisplay, Task

# For more datasets than this, only the page of all datasets is named.
MOST_PAGES = 12
# The phase of all rules in a file. Other rules have their file's name as the phase.
PHASES = {
    "rig": "cameras",
    "render": "views",
    "error": "calibration",
    "reproject": "reprojections",
    "export": "exports",
    "mesh": "exports",
    "validate": "validation",
    "costs": "report",
}
# The phases of a dataset, in the order of the work. Other phases follow.
PHASE_ORDER = {
    phase: place
    for place, phase in enumerate(
        [
            "scene",
            "cameras",
            "calibration",
            "views",
            "flow",
            "reprojections",
            SENSOR_PHASE,
            "exports",
            "validation",
            "report",
        ]
    )
}
# The cost of jobs of these phases is unknown. Their logs say how long they take.
UNKNOWN_PHASES = ("measurement", "benchmark", "learn", "plan", "synthesis")


def rendered_views(job):
    """Return the number of the dataset's views that a job renders."""
    if not is_of(job, "render"):
        return 0
    return int(job.wildcards.end) - int(job.wildcards.first)


def is_of_sensor(job):
    """Return whether a job makes views as a sensor sees them."""
    if "reprojection" not in job.wildcards.keys():
        return False
    reprojection = asked(BUILD.reprojection, job.wildcards)
    return bool(reprojection and reprojection.sensor)


def phase_of(job):
    """Return the phase of a job."""
    if is_of_sensor(job):
        return SENSOR_PHASE
    if is_of(job, "measure_error"):
        return "measurement"
    stem = Path(job.rule.snakefile).stem
    return PHASES.get(stem, stem)


def is_of_dataset(job):
    """Return whether a job belongs to one dataset. Packing a sequence belongs to several."""
    wildcards = job.wildcards
    return (
        "rig" in wildcards.keys() and f"{wildcards.scene}/{wildcards.rig}" in DATASETS
    )


@cache
def stages():
    """Return the stages that have a cost, by the names of their rules, which a module may rename."""
    return {getattr(rules, stage).rule.name: stage for stage in STAGES}


def cost_of(job):
    """Return the cost of a job. None if it is unknown."""
    wildcards = job.wildcards
    if is_of(job, "calibrate"):
        return cost("calibrate", BUILD.first_of_scene(wildcards.scene))
    if phase_of(job) in UNKNOWN_PHASES:
        return None
    if is_of(job, "build_members"):
        return asked(BUILD.batch_cost, wildcards)
    stage = stages().get(job.rule.name, job.rule.name)
    return cost_at(stage, wildcards) if is_of_dataset(job) else cost(stage)


def task_of(job):
    """Return the display's task for a job."""
    expected = cost_of(job)
    return Task(
        job.rule.name,
        str(Path(job.log[0]).relative_to(stored(f"{WORK}/logs")).with_suffix("")),
        phase_of(job),
        Path(job.log[0]),
        views=rendered_views(job),
        seconds=expected and expected.seconds,
    )


def jobs_of(entries):
    """Return the jobs of Snakemake's entries, which are jobs or groups of jobs."""
    jobs = set()
    for entry in entries:
        jobs.update(entry.jobs if entry.is_group() else [entry])
    return jobs


TASKS = {}


def look():
    """Return the jobs that are running, finished and failed."""
    finished = filter(is_finished, TASKS)
    return jobs_of(running_jobs()), finished, jobs_of(failed_entries())


def explain(jobs):
    """Return why these jobs and their groups failed."""
    failed = [entry for entry in failed_entries() if jobs & jobs_of([entry])]
    return failure_report(failed_jobs(failed))


DISPLAY = RunDisplay(look, explain)


def is_quiet_about(kind):
    """Return whether --quiet names a kind of output: ALL, PROGRESS, …"""
    return kind in QUIET_ABOUT


def passes(record):
    """Return whether to print a record of Snakemake's log. If so, clear the line of progress.

    With --quiet progress, it prints only warnings, and that there is nothing to be done. It skips
    Snakemake's message on a failed job, which is the whole command, because the display says why
    the job failed.
    """
    if is_quiet_about("PROGRESS"):
        message = record.getMessage()
        if message.startswith("RuleException"):
            return False
        if record.levelno < logging.WARNING and not message.startswith("Nothing to be"):
            return False
    DISPLAY.clear()
    return True


def quiet_snakemake():
    """Let Snakemake print only what `passes`. Its log file and logger plugins get all records."""
    for handler in logging.getLogger("snakemake.logging").handlers:
        is_stream = isinstance(handler, logging.StreamHandler)
        if is_stream and not isinstance(handler, logging.FileHandler):
            handler.addFilter(passes)


def begin_display():
    """Show the progress of the run from now on."""
    logging.getLogger("snakemake.logging").addHandler(NotesOfFailures())
    quiet_snakemake()
    # A job without output takes seconds, and its log is printed at the end.
    jobs = [job for job in needed_jobs() if job.log and job.output]
    if jobs and not is_quiet_about("ALL"):
        announce_calibrations(jobs)
        TASKS.update({job: task_of(job) for job in jobs})
        DISPLAY.begin(TASKS, ALL_CORES)
        DISPLAY.start()
        # This runs even if the run fails.
        atexit.register(DISPLAY.stop)


def announce_calibrations(jobs):
    """Print the estimated time of each calibration, and of the datasets that depend on it."""
    for job in jobs:
        if is_of(job, "calibrate"):
            scene = job.wildcards.scene
            renders = [each for each in jobs if is_of(each, "render")]
            render_seconds = sum(
                cost_of(render).seconds
                for render in renders
                if render.wildcards.scene == scene
            )
            print(
                f"calibrating {scene} takes some {duration(cost_of(job).seconds)} of a core,"
                f" and rendering it then some {duration(render_seconds)}",
                file=sys.stderr,
            )


def cpu_seconds():
    """Return the CPU seconds of all jobs. None on a cluster, or on a graphics card."""
    if not RUNS_HERE or GPUS:
        return None
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def end_display():
    """Stop the display, print its summary, and print the logs of jobs without output."""
    DISPLAY.stop()
    if TASKS:
        print(DISPLAY.summary(cpu_seconds()), file=sys.stderr)
    for job in needed_jobs():
        if job.log and not job.output and Path(job.log[0]).exists():
            print(Path(job.log[0]).read_text(), end="", flush=True)


def print_pages():
    """Print the paths of the pages of this run's datasets, which are all valid."""
    outputs = all_outputs()
    prefix = f"{STORE}/" if STORE else ""
    pages = []
    for dataset in DATASETS.values():
        if stored(dataset.paths.sums) in outputs:
            pages.append(f"{prefix}{dataset.paths.page}")
    if len(pages) > MOST_PAGES:
        pages = [f"{len(pages)} datasets: {prefix}{RESULTS}/index.html"]
    for page in pages:
        print(f"valid: {page}", file=sys.stderr)


def print_families():
    """Print how many members of each family are built, if this run has counted them."""
    for job in needed_jobs():
        if is_of(job, "count_members"):
            print(Path(job.log[0]).read_text().strip(), file=sys.stderr)


def dataset_name_of(job):
    """Return the scene and rig of a job, as in its path. None if it belongs to no rig."""
    wildcards = job.wildcards
    if "rig" not in wildcards.keys():
        return None
    if not is_of_dataset(job):
        return f"{wildcards.scene}/{wildcards.rig}"
    return asked(BUILD.dataset, wildcards).sequence_name


def work_of(job):
    """Return a job's part of the forecast."""
    is_batch = is_of(job, "build_members")
    views = asked(BUILD.batch_views, job.wildcards) if is_batch else rendered_views(job)
    return Work(phase_of(job), dataset_name_of(job), views, cost_of(job) or Cost())


def print_forecast():
    """Print the jobs, views, CPU time and size of a dry run's phases and datasets at its end."""
    if not is_planned_dry_run():
        return
    announce_damage()
    announce_refusals()
    # Targets such as `all` have no program, and so no log.
    jobs = [job for job in needed_jobs() if job.log]
    jobs.sort(key=lambda job: PHASE_ORDER.get(phase_of(job), len(PHASE_ORDER)))
    print(forecast([work_of(job) for job in jobs]))


at_exit(print_forecast)
