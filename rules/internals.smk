# What no public interface of Snakemake gives. This is the only file that reaches inside Snakemake;
# each piece says why.
import functools
import inspect
import threading

from snakemake.io import _IOFile
from snakemake.scheduling.job_scheduler import JobScheduler
from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo

from lightfield.core import processors

# A Snakefile is read again by each job on a cluster: these say who reads it, and to what end.
IS_MAIN_PROCESS = workflow.is_main_process
RUNS_ELSEWHERE = workflow.remote_exec

# What the command line and the profile say: a Snakefile is given only the configuration.
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

# Without --cores and --jobs Snakemake refuses to run. `cores: all` in a profile takes the cores of
# the machine, where a container may have fewer.
if (CORES, NODES) == (None, None):
    workflow.resource_settings.cores = processors.available()
    workflow.register_resource("_cores", processors.available())


def limit_resource(name, amount):
    """Have jobs share a resource, as --resources does, unless the command line limits it."""
    if name not in workflow.global_resources:
        workflow.register_resource(name, amount)


def given_slurm_extra():
    """Return what the user's profile gives Slurm beside our own: a rule's value replaces it."""
    given = workflow.resource_settings._parsed_default_resources.get("slurm_extra")
    # Snakemake has an entry without a text where none is given.
    return given.raw.strip("'\"") if given and given.raw else ""


def rule_name(name):
    """Return what a rule of ours is called, where we are a module of another workflow."""
    return workflow.modifier.modify_rulename(name)


def stored(path):
    """Return where Snakemake has its copy of a file or folder; without a store that is itself."""
    return str(workflow.modifier.path_modifier.apply_default_storage(path))


def unstored(file):
    """Return the path of an input or output as the rules have it, without Snakemake's storage."""
    return str(file).removeprefix(stored(WORK).removesuffix(WORK))


def of_each_shard(function):
    """Return an input or params function whose signature Snakemake need not work out each time.

    It does so several times for each shard: a plan of 2,000 shards takes a second less.
    """
    function.__signature__ = inspect.signature(function)
    return function


def rerun(outputs):
    """Have Snakemake run the jobs of these outputs, although it sees no reason.

    --forcerun is the public way, but what it names becomes a target, too.
    """
    workflow.dag.forcefiles.update(map(stored, outputs))


def before_jobs_are_chosen(mark):
    """Call ``mark`` once all jobs are known, and so all settings written, and none is chosen yet.

    An input function runs while those of other jobs have still to write their settings.
    """
    dag = workflow.dag
    choose = dag.update_needrun
    search = dag.bfs
    mark_once = functools.cache(mark)

    def readers_of_content(_, *jobs):
        return search(ReadersOfContent(dag.depending), *jobs)

    async def mark_and_choose(*arguments, **options):
        mark_once()
        dag.bfs = readers_of_content
        try:
            await choose(*arguments, **options)
        finally:
            dag.bfs = search

    dag.update_needrun = mark_and_choose


class ReadersOfContent:
    """By job: the jobs that read what it makes, without those for which it need only be there.

    Snakemake looks for no reason in what follows from a job that runs, and so overlooks those jobs:
    they follow from it, but do not run because of it.
    """

    def __init__(self, depending):
        self._depending = depending

    def __getitem__(self, job):
        return {
            reader: files
            for reader, files in self._depending[job].items()
            if not all(map(is_ancient, files))
        }


def take_as_missing(is_damaged):
    """Have Snakemake take damaged files as missing: they are set aside before the first job.

    It refuses to plan with a link that leads nowhere, or to replace a file without permissions.
    """
    exists_local = _IOFile.exists_local

    async def exists_and_is_sound(file):
        return not is_damaged(unstored(file)) and await exists_local(file)

    _IOFile.exists_local = exists_and_is_sound


def before_lock(take_folder):
    """Call ``take_folder`` when a real run is planned, before Snakemake locks its files.

    Snakemake's hooks come later: where a killed run has left locks, it ends before `onstart`.
    """
    build_dag = workflow._build_dag

    def build_dag_and_take_folder():
        build_dag()
        if workflow.executor_plugin is None or not workflow.execution_settings.lock:
            return
        if workflow.dryrun:
            # It would warn of another run, also of one that was killed, and locks nothing.
            workflow.persistence.lock = workflow.persistence.noop
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
    """Have Snakemake remove its own locks in the end: it removes those of all runs that live."""
    persistence = workflow.persistence

    def unlock():
        for file in getattr(persistence, "_lockfile", {}).values():
            Path(file).unlink(missing_ok=True)

    if hasattr(persistence, "_lockfile"):
        persistence.unlock = unlock


def look_for_jobs_once_a_second():
    """Let Snakemake's scheduler have one timer at a time for its next look at the ready jobs.

    It looks when a job has finished, and a second after each look. Each of these looks starts a
    timer of its own. After some dozen jobs Snakemake would look without a pause, and take a core
    from the jobs until the run ends.
    """
    is_waiting = threading.Lock()

    def look_later(scheduler, seconds):
        def look():
            is_waiting.release()
            scheduler._open_jobs.release()

        if is_waiting.acquire(blocking=False):
            threading.Timer(seconds, look).start()

    JobScheduler._schedule_reevalutation = look_later


look_for_jobs_once_a_second()


def is_ancient(file):
    """Return whether an input is declared as ``ancient``, so that its content does not matter."""
    return file.is_ancient


# Rules see one job at a time. The display, the ledger and the checks before the first job need all.


def own_jobs(jobs):
    """Return those jobs that are of these rules: another workflow may have some of its own."""
    jobs = [job for job in jobs if not job.is_group()]
    return [job for job in jobs if Path(job.rule.snakefile).is_relative_to(FOLDER)]


def needed_jobs():
    """Return the jobs of these rules that this run needs, those that are finished too."""
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


def job_table():
    """Return Snakemake's table of how many jobs of each rule there are."""
    return workflow.dag.stats()[0]


def start_of_run():
    """Return when this run began, in seconds since 1970."""
    return workflow.start_time.timestamp()


def hear_executor(note):
    """Call ``note`` with each failed job and what the executor says of it.

    Snakemake keeps that from a group's log. For a group that it cannot even submit, as with an
    account that does not exist, Slurm's executor reports nothing, and Snakemake waits for ever.
    """
    executor = workflow.scheduler._executor
    report_job_error, run_job = executor.report_job_error, executor.run_job

    def report_and_note(job_info, msg=None, **details):
        note(job_info.job, msg)
        report_job_error(job_info, msg=msg, **details)

    def run_or_report(job):
        try:
            run_job(job)
        except AttributeError as error:
            if not (job.is_group() and error.__context__):
                raise
            report_and_note(
                SubmittedJobInfo(job), f"not submitted: {error.__context__}"
            )

    executor.report_job_error = report_and_note
    executor.run_job = run_or_report
