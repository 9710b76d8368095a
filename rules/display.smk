# What the terminal shows: how far a run is, and what a dry run would do.
import logging

from lightfield.core.progress import duration
from lightfield.core.run_display import RunDisplay, Task
from lightfield.dataset.estimate import START_UP_SECONDS
from lightfield.measurement.forecast import Work, calibration_seconds, forecast

# Of more datasets than this the page of all is named instead of each one's own.
MOST_PAGES = 12
# What the rules of a file are called, where that is not the file's name, and some by their own.
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
    """Return how many views of a dataset a job renders, and for how long, in seconds of a core."""
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
    """Return what the display has to know of a job."""
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


def jobs_of(found):
    """Return the jobs of what Snakemake's scheduler lists: jobs, and groups of them."""
    return {one for job in found for one in (job.jobs if job.is_group() else [job])}


TASKS = {}


def look():
    """Return the jobs that are running, finished and failed."""
    finished = filter(is_finished, TASKS)
    return jobs_of(running_jobs()), finished, jobs_of(failed_entries())


def explain(jobs):
    """Return why these jobs failed, and their groups."""
    failed = [entry for entry in failed_entries() if jobs & jobs_of([entry])]
    return failure_report(failed_jobs(failed))


DISPLAY = RunDisplay(look, explain)


def is_quiet_about(kind):
    """Whether --quiet names a kind of output: ALL, PROGRESS, …"""
    return kind in QUIET_ABOUT


def passes(record):
    """Let Snakemake's warnings be logged under a display, and more only where it is not quiet.

    Its own words for a job that failed are the whole command; why is said without them.
    """
    if is_quiet_about("PROGRESS"):
        failed_job = record.getMessage().startswith("RuleException")
        if record.levelno < logging.WARNING or failed_job:
            return False
    DISPLAY.clear()
    return True


def begin_display():
    """Show how far the run is, from now on."""
    note_failures()
    for handler in logging.getLogger("snakemake.logging").handlers:
        # Snakemake's own log file is for itself.
        if not isinstance(handler, logging.FileHandler):
            handler.addFilter(passes)
    # What has no output is asked for to be read, and takes seconds.
    jobs = [job for job in needed_jobs() if job.log and job.output]
    if jobs and not is_quiet_about("ALL"):
        announce_calibrations(jobs)
        TASKS.update({job: task_of(job) for job in jobs})
        DISPLAY.begin(TASKS, workflow.cores or 1)
        DISPLAY.start()
        # However the run ends.
        atexit.register(DISPLAY.stop)


def announce_calibrations(jobs):
    """Print what each calibration is expected to cost, and what the datasets that it is for."""
    for job in jobs:
        if job.rule.name == CALIBRATE:
            datasets = [
                rendering(other)[1]
                for other in jobs
                if other.rule.name == RENDER
                and other.wildcards.scene == job.wildcards.scene
            ]
            print(
                f"calibrating {job.wildcards.scene} takes some"
                f" {duration(rendering(job)[1])} of a core, and rendering it then some"
                f" {duration(sum(datasets))}",
                file=sys.stderr,
            )


def end_display():
    """Show no more how far the run is, but what jobs without output say: they are asked to."""
    DISPLAY.stop()
    for job in needed_jobs():
        if job.log and not job.output and Path(job.log[0]).exists():
            print(Path(job.log[0]).read_text(), end="", flush=True)


def print_pages():
    """Print where the pages are of the datasets that are valid: all that this run was for."""
    made = all_outputs()
    valid = [
        d for d in DATASETS.values() if stored(f"{d.folder}/sha256sums.txt") in made
    ]
    where = f"{STORE}/" if STORE else ""
    pages = [f"{where}{dataset.page}" for dataset in valid]
    if len(pages) > MOST_PAGES:
        pages = [f"{len(pages)} datasets: {where}{RESULTS}/index.html"]
    for page in pages:
        print(f"valid: {page}", file=sys.stderr)


def print_forecast():
    """Print at the end of a dry run how many jobs there are, and what rendering will take."""
    if not is_planned_dry_run():
        return
    announce_damage()
    announce_refusals()
    works = {}
    for job in needed_jobs():
        views, seconds = rendering(job)
        if seconds:
            name, size = f"calibration of {job.wildcards.scene}", 0.0
            if job.rule.name != CALIBRATE:
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
