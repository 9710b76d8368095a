# The terminal's display: the progress of a run, and the forecast of a dry run.
import logging

from lightfield.core.progress import duration
from lightfield.core.run_display import RunDisplay, Task
from lightfield.dataset.estimate import START_UP_SECONDS
from lightfield.measurement.forecast import Work, calibration_seconds, forecast

# For more datasets than this, only the page of all datasets is named.
MOST_PAGES = 12
# The phase of a rule, or of all rules in a file. Other rules have their file's name as the phase.
PHASES = {
    "measure_error": "measurement",
    "try_changes": "measurement",
    "rig": "cameras",
    "render": "views",
    "error": "calibration",
    "reproject": "reprojections",
    "export": "exports",
    "validate": "validation",
    "costs": "report",
}


def rendering(job):
    """Return how many views of a dataset a job renders, and its estimated seconds of one core."""
    if job.rule.name == RENDER:
        views = int(job.wildcards.end) - int(job.wildcards.first)
        seconds = dataset_of(job.wildcards).estimate.view_seconds
        return views, START_UP_SECONDS + views * seconds
    if job.rule.name == RENDER_PANORAMA:
        return 0, dataset_of(job.wildcards).estimate.panorama_seconds
    if job.rule.name == CALIBRATE:
        dataset = first_dataset(job.wildcards.scene)
        target, most = map(dataset.render.get, ("target_error", "most_samples"))
        if target is None:
            return 0, 0.0
        size = min(dataset.rig.camera.resolution)
        return 0, calibration_seconds(target, size, most)
    return 0, 0.0


def task_of(job):
    """Return the display's task for a job."""
    stem = Path(job.rule.snakefile).stem
    views, seconds = rendering(job)
    return Task(
        job.rule.name,
        str(Path(job.log[0]).relative_to(stored(f"{WORK}/logs")).with_suffix("")),
        PHASES.get(job.rule.name, PHASES.get(stem, stem)),
        Path(job.log[0]),
        views=views,
        seconds=seconds,
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

    With --quiet progress, it prints only warnings. It skips Snakemake's message on a failed job,
    which is the whole command, because the display says why the job failed.
    """
    if is_quiet_about("PROGRESS"):
        failed_job = record.getMessage().startswith("RuleException")
        if record.levelno < logging.WARNING or failed_job:
            return False
    DISPLAY.clear()
    return True


def begin_display():
    """Show the progress of the run from now on."""
    note_failures()
    for handler in logging.getLogger("snakemake.logging").handlers:
        # Snakemake's own log file gets all records.
        if not isinstance(handler, logging.FileHandler):
            handler.addFilter(passes)
    # A job without output takes seconds, and its log is printed at the end.
    jobs = [job for job in needed_jobs() if job.log and job.output]
    if jobs and not is_quiet_about("ALL"):
        announce_calibrations(jobs)
        TASKS.update({job: task_of(job) for job in jobs})
        DISPLAY.begin(TASKS, workflow.cores or 1)
        DISPLAY.start()
        # This runs even if the run fails.
        atexit.register(DISPLAY.stop)


def announce_calibrations(jobs):
    """Print the estimated time of each calibration, and of the datasets that depend on it."""
    for job in jobs:
        if job.rule.name == CALIBRATE:
            scene = job.wildcards.scene
            renders = [each for each in jobs if each.rule.name == RENDER]
            render_seconds = sum(
                rendering(render)[1]
                for render in renders
                if render.wildcards.scene == scene
            )
            print(
                f"calibrating {scene} takes some {duration(rendering(job)[1])} of a core,"
                f" and rendering it then some {duration(render_seconds)}",
                file=sys.stderr,
            )


def end_display():
    """Stop the display, and print the logs of jobs without output."""
    DISPLAY.stop()
    for job in needed_jobs():
        if job.log and not job.output and Path(job.log[0]).exists():
            print(Path(job.log[0]).read_text(), end="", flush=True)


def print_pages():
    """Print the paths of the pages of this run's datasets, which are all valid."""
    outputs = all_outputs()
    prefix = f"{STORE}/" if STORE else ""
    pages = []
    for dataset in DATASETS.values():
        if stored(f"{dataset.folder}/sha256sums.txt") in outputs:
            pages.append(f"{prefix}{dataset.page}")
    if len(pages) > MOST_PAGES:
        pages = [f"{len(pages)} datasets: {prefix}{RESULTS}/index.html"]
    for page in pages:
        print(f"valid: {page}", file=sys.stderr)


def print_forecast():
    """Print the number of jobs and the estimated rendering time at the end of a dry run."""
    if not is_planned_dry_run():
        return
    announce_damage()
    announce_refusals()
    works = {}
    for job in needed_jobs():
        views, seconds = rendering(job)
        if seconds:
            if job.rule.name == CALIBRATE:
                name = f"calibration of {job.wildcards.scene}"
                size = 0.0
            else:
                dataset = dataset_of(job.wildcards)
                name = f"{dataset.scene_folder}/{dataset.rig_name}"
                size = views * dataset.estimate.all_view_bytes
            work = works.get(name, Work(name, 0, 0.0))
            works[name] = Work(
                name, work.views + views, work.seconds + seconds, work.size + size
            )
    if is_quiet_about("PROGRESS"):
        print(job_table())
    if works:
        print(forecast([works[name] for name in sorted(works)]))


atexit.register(print_forecast)
