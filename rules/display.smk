# The terminal's display: the progress of a run, its failures, and the forecast of a dry run.
import os
import resource
import signal
import sys
from contextlib import suppress
from pathlib import Path

from lightfield.core.files import read_json
from lightfield.core.terminal import was_interrupted
from lightfield.core.units import duration
from lightfield.planning.cost import Cost, cost
from lightfield.planning.forecast import Work, forecast, requests_table
from lightfield.planning.phases import KINDS, ORDER, SENSOR_PHASE
from lightfield.workflow.run_display import RunDisplay, Task

# For more datasets than this, only the page of all datasets is named.
MOST_PAGES = 12
# What stands before a path of the results in a message.
STORE_PREFIX = f"{STORE}/" if STORE else ""
# What stands below the table of what jobs request of a cluster.
REQUESTS_NOTE = """\
mem_mb is the memory of a job in MB, and runtime its time limit in minutes. – is the cluster's default.
A limit is several times the expected time. Jobs of seconds run beside Snakemake, and are not listed.
To change one: --set-resources render:mem_mb=16000. See docs/how-to/tune-a-cluster.md."""
# The message if a run ends early, and no job has failed.
UNFINISHED = "error: the run was stopped before its last job: the same command goes on"


def phase_of(job, names):
    """Return the phase of a job."""
    if "reprojection" in names:
        reprojection = asked(BUILD.reprojection, names)
        if reprojection and reprojection.sensor:
            return SENSOR_PHASE
    return KINDS[job].phase


def rendered_views(job, names):
    """Return the number of the dataset's views that a job renders."""
    if KINDS[job].stage == "build_members":
        return asked(BUILD.batch_views, names)
    is_shard = KINDS[job].stage == "render"
    return int(names.end) - int(names.first) if is_shard else 0


def cost_of(job, names):
    """Return the cost of a job. None if it is unknown."""
    stage = KINDS[job].stage
    if stage is None:
        return None
    if stage == "calibrate":
        return cost(stage, BUILD.first_of_scene(names.scene))
    if stage == "build_members":
        return asked(BUILD.batch_cost, names)
    # Packing a sequence belongs to several datasets.
    if "rig" not in names or f"{names.scene}/{names.rig}" not in DATASETS:
        return cost(stage)
    if is_import(job, names):
        stage = "import_views"
    return cost_at(stage, names)


def task_of(job, names):
    """Return the display's task for a job."""
    name = job.format(**names)
    expected = cost_of(job, names)
    # The display counts only the dataset's own views.
    views = 0 if "batch" in names else rendered_views(job, names)
    return Task(
        name,
        phase_of(job, names),
        Path(log_of(name)),
        views=views,
        seconds=expected and expected.seconds,
    )


def find_log(shown):
    """Return the file of a log that Snakemake names. A storage has the logs of other machines."""
    if not STORE:
        return Path(shown)
    name = shown.removeprefix(f"{STORE}/")
    STORAGE.bring(name)
    return Path(name)


def begin_display():
    """Show the progress of the run from now on."""
    announce_calibrations()
    tasks = [task_of(job, names) for job, names in planned_jobs()]
    DISPLAY.begin({task.log: task for task in tasks}, ALL_CORES)
    DISPLAY.start()


def announce_calibrations():
    """Print the estimated time of each calibration, and of the datasets that depend on it."""
    seconds = {}
    for job, names in planned_jobs():
        if KINDS[job].stage in ("calibrate", "render"):
            costs = seconds.setdefault(names.scene, {"calibrate": 0.0, "render": 0.0})
            costs[KINDS[job].stage] += cost_of(job, names).seconds
    for scene, costs in seconds.items():
        if costs["calibrate"]:
            print(
                f"calibrating {scene} takes some {duration(costs['calibrate'])} of a core,"
                f" and rendering it then some {duration(costs['render'])}",
                file=sys.stderr,
            )


def announce_stop():
    """Print a message at SIGTERM, because Snakemake is quiet while it waits for its jobs."""
    stop = signal.getsignal(signal.SIGTERM)

    def stop_and_say_so(*arguments):
        # The signal may interrupt a print(), in which print() cannot be called.
        os.write(2, b"stopping after SIGTERM: the jobs that run are finished first\n")
        stop(*arguments)

    signal.signal(signal.SIGTERM, stop_and_say_so)


def cpu_seconds():
    """Return the CPU seconds of all jobs. None on a cluster, or on a graphics card."""
    if not RUNS_HERE or GPUS:
        return None
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def print_summary():
    """Print what the run took."""
    if summary := DISPLAY.summary(cpu_seconds()):
        print(summary, file=sys.stderr)


def print_results():
    """Print the end of a run that made all that it should."""
    print_summary()
    print_ends()


def print_failures():
    """Print the end of a run that did not make all that it should."""
    print_summary()
    failures = "" if was_interrupted() else DISPLAY.failures()
    print(failures or UNFINISHED, file=sys.stderr, flush=True)


def print_ends():
    """Print what this run has finished: pages of valid datasets, packages, and families.

    A run with --until or --touch leaves jobs out, and ends without an error, too.
    """
    is_left = left_out()
    print_pages(is_left)
    print_packages(is_left)
    print_families(is_left)


def left_out():
    """Return a function that says whether the job of a receipt, or a job before it, must still run.

    A storage has all receipts, which nobody looks at again.
    """
    if STORE:
        return lambda receipt: False
    check = JobCheck(Path(WORK), Path(RESULTS), wanted_settings, VERSIONS)
    check.sums = CHECK.sums
    return check.will_run


def print_pages(is_left):
    """Print the pages of the datasets that this run has finished, and the folders of others."""
    ends = {"valid": [], "not valid": [], "not finished": []}
    for dataset in DATASETS.values():
        receipt = f"{RECEIPTS}/{dataset.name}/page{SUFFIX}"
        if receipt in ASKED and is_left(receipt):
            ends["not finished"].append(f"{STORE_PREFIX}{dataset.paths.folder}")
        elif receipt in ASKED:
            ends[validity(dataset)].append(f"{STORE_PREFIX}{dataset.paths.page}")
    for state, paths in ends.items():
        if len(paths) > MOST_PAGES:
            paths = [f"{len(paths)} datasets: {STORE_PREFIX}{RESULTS}/index.html"]
        for path in paths:
            print(f"{state}: {path}", file=sys.stderr)


def validity(dataset):
    """Return whether the validation of a finished dataset says that it is valid.

    With a storage, the checksums that this run made say so.
    """
    is_valid = STORE or read_json(dataset.paths.validation)["valid"]
    return "valid" if is_valid else "not valid"


def print_packages(is_left):
    """Print the paths of the first archives of this run's packages."""
    for receipt, (job, names) in ASKED.items():
        if job == "{scene}/{rig}/package":
            state = "not packed" if is_left(receipt) else "packed"
            archive = PATHS.package.format(**names)
            print(f"{state}: {STORE_PREFIX}{archive}", file=sys.stderr)


def print_families(is_left):
    """Print how many members of each family are built, if this run has counted them."""
    for receipt, (job, names) in ASKED.items():
        is_planned = KINDS[job].stage == "count_members" and CHECK.will_run(receipt)
        if is_planned and not is_left(receipt):
            log = Path(log_of(job.format(**names)))
            print(log.read_text(encoding="utf-8").strip(), file=sys.stderr)


def dataset_name_of(names):
    """Return the scene and rig of a job, as in its path. None if it belongs to no rig."""
    if "rig" not in names:
        return None
    name = f"{names.scene}/{names.rig}"
    return DATASETS[name].sequence_name if name in DATASETS else name


def work_of(job, names):
    """Return a job's part of the forecast."""
    return Work(
        phase_of(job, names),
        dataset_name_of(names),
        rendered_views(job, names),
        cost_of(job, names) or Cost(),
    )


def print_forecast():
    """Print the jobs, views, CPU time and size of a dry run's phases and datasets at its end."""
    announce_changes()
    announce_refusals()
    jobs = sorted(planned_jobs(), key=lambda planned: ORDER[planned[0]])
    print(forecast([work_of(job, names) for job, names in jobs]))
    if CLUSTER:
        print_requests(jobs)


def print_requests(jobs):
    """Print what the jobs of a dry run would request of the cluster."""
    logs = [
        log_of(job.format(**names)) for job, names in jobs if not KINDS[job].is_local
    ]
    requests = [DISPLAY.requests[log] for log in logs if log in DISPLAY.requests]
    if requests:
        print(f"\n{requests_table(requests)}\n\n{REQUESTS_NOTE}")


# Snakemake's logger plugin tells it what Snakemake does.
DISPLAY = RunDisplay(print_forecast, find_log)
if IS_MAIN_PROCESS:
    # Without the plugin, Snakemake shows the run itself.
    with suppress(ImportError):
        import snakemake_logger_plugin_plenoforge as plugin

        plugin.display = DISPLAY
        DISPLAY.is_told = plugin.is_used
