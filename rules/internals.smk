# The only file that reaches inside Snakemake, for what has no public interface. Each piece says why.
import atexit
import contextlib
import functools
import inspect
from pathlib import Path

from snakemake.io import _IOFile

# Each job on a cluster reads the Snakefile again. These say which process reads it.
IS_MAIN_PROCESS = workflow.is_main_process
RUNS_ELSEWHERE = workflow.remote_exec

# Settings of the command line and the profile. A Snakefile gets only the configuration.
STORE = workflow.storage_settings.default_storage_prefix or ""
SHARES_FILES = SharedFSUsage.INPUT_OUTPUT in workflow.storage_settings.shared_fs_usage
NODES = workflow.resource_settings.nodes
# `workflow.local_exec` is true until the plan is made. Only an executor of nodes has --jobs.
RUNS_HERE = not NODES
CORES = workflow.resource_settings.cores
QUIET_ABOUT = {choice.name for choice in workflow.output_settings.quiet or ()}
USES_CONTAINERS = "APPTAINER" in {
    method.name for method in workflow.deployment_settings.deployment_method
}
ASKS_FOR_GPUS = "gpu" in (workflow.resource_settings.default_resources or ())


def limit_resource(name, amount):
    """Limit a resource that jobs share, as --resources does, unless the command line does so."""
    if name not in workflow.global_resources:
        workflow.register_resource(name, amount)


def stored(path):
    """Return the path of Snakemake's copy of a file or folder. Without a store, the same path."""
    return str(workflow.modifier.path_modifier.apply_default_storage(path))


def unstored(file):
    """Return the path of an input or output as the rules have it, without Snakemake's storage."""
    return str(file).removeprefix(stored(WORK).removesuffix(WORK))


def of_each_shard(function):
    """Return an input or params function with its signature.

    Otherwise Snakemake inspects the function several times for each shard. This saves a second in a
    plan of 2,000 shards.
    """
    function.__signature__ = inspect.signature(function)
    return function


def rerun(outputs):
    """Make Snakemake run the jobs of these outputs, although it sees no reason.

    --forcerun is the public way, but it also makes the outputs targets.
    """
    workflow.dag.forcefiles.update(map(stored, outputs))


def before_jobs_are_chosen(mark):
    """Call ``mark`` when all jobs are known, before Snakemake chooses those that must run.

    At that time, all input functions have written their settings.
    """
    choose = workflow.dag.update_needrun
    mark_once = functools.cache(mark)

    async def mark_and_choose(*arguments, **options):
        mark_once()
        await choose(*arguments, **options)

    workflow.dag.update_needrun = mark_and_choose


def take_as_missing(is_damaged):
    """Make Snakemake treat damaged files as missing. They are set aside before the first job.

    Otherwise it would fail at a link that leads nowhere, or at a file without permissions.
    """
    exists_local = _IOFile.exists_local

    async def exists_and_is_sound(file):
        return not is_damaged(unstored(file)) and await exists_local(file)

    _IOFile.exists_local = exists_and_is_sound


def tell_of_new_file(path):
    """Tell Snakemake that a file exists that an input function wrote.

    Otherwise the file is missing if Snakemake listed its folder before, for another target.
    """
    workflow.iocache.exists_local[path] = True


def before_lock(take_folder, begin_dry_run):
    """Call ``take_folder`` when a real run is planned, before Snakemake locks its files.

    Snakemake's hooks come later. If a killed run has left locks, Snakemake ends before `onstart`.
    A dry run has no hooks: call ``begin_dry_run`` instead.
    """
    build_dag = workflow._build_dag

    def build_dag_and_take_folder():
        build_dag()
        if workflow.executor_plugin is None or not workflow.execution_settings.lock:
            return
        if workflow.dryrun:
            # A dry run locks nothing, but it would warn of another run, even of a killed one.
            workflow.persistence.lock = workflow.persistence.noop
            begin_dry_run()
        else:
            take_folder()

    workflow._build_dag = build_dag_and_take_folder


def remove_locks():
    """Remove all locks of the folder, as --unlock does."""
    workflow.persistence.cleanup_locks()


def files_are_locked():
    """Return whether another run has locked files that this one reads or makes."""
    return workflow.persistence.locked


def keep_locks_of_others():
    """Make Snakemake remove only its own locks at its end, and not those of other live runs."""
    persistence = workflow.persistence

    def unlock():
        for file in getattr(persistence, "_lockfile", {}).values():
            Path(file).unlink(missing_ok=True)

    if hasattr(persistence, "_lockfile"):
        persistence.unlock = unlock


# Rules see one job at a time. The display, the ledger and the first checks need all jobs.


def own_jobs(jobs):
    """Return the jobs of these rules. A workflow that uses them as a module may have others."""
    jobs = [job for job in jobs if not job.is_group()]
    return [job for job in jobs if Path(job.rule.snakefile).is_relative_to(FOLDER)]


def needed_jobs():
    """Return the jobs of these rules that this run needs, also those that are finished."""
    return own_jobs(workflow.dag.needrun_jobs(exclude_finished=False))


def all_jobs():
    """Return the jobs of these rules that lead to the targets, also those with nothing to do."""
    return own_jobs(workflow.dag.jobs)


def all_outputs():
    """Return the outputs of all jobs that lead to the targets, also of those with nothing to do."""
    return {str(file) for job in workflow.dag.jobs for file in job.output}


def is_finished(job):
    """Return whether a job of this run is finished."""
    return workflow.dag.finished(job)


def running_jobs():
    """Return the jobs and groups that run now."""
    return list(workflow.scheduler.running)


def failed_entries():
    """Return the jobs and groups that have failed."""
    return list(workflow.scheduler.failed)


def is_planned_dry_run():
    """Return whether this is a dry run that got as far as a plan with jobs."""
    return workflow.dryrun and workflow.scheduler and len(workflow.dag)


# With --directory, Snakemake works in another folder than the one that it started in.
RUN_FOLDER = Path.cwd()


def at_exit(action):
    """Call ``action`` when the process ends, in the run's folder, which Snakemake has then left."""

    def act():
        with contextlib.chdir(RUN_FOLDER):
            action()

    atexit.register(act)


def start_of_run():
    """Return the time at which this run began, in seconds since 1970."""
    return workflow.start_time.timestamp()
