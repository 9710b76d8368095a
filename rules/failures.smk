# The causes of failed jobs, for the end of a run.
import logging
import os
import signal
from pathlib import Path

from snakemake_interface_logger_plugins.common import LogEvent

from lightfield.core.disk_space import obstacle
from lightfield.workflow.failures import batch_log, cause, first_sentence, is_newer
from lightfield.workflow.view_store import ViewStore

# The executor's messages on failed jobs, such as that a job was refused, by the jobs' numbers.
EXECUTOR_MESSAGES = {}
# The message if a run ends early, and no job has failed.
UNFINISHED = "error: the run was stopped before its last job: the same command goes on"


def announce_stop():
    """Print a message at SIGTERM, because Snakemake is quiet while it waits for its jobs."""
    stop = signal.getsignal(signal.SIGTERM)

    def stop_and_say_so(*arguments):
        # The signal may interrupt a print(), in which print() cannot be called.
        os.write(2, b"stopping after SIGTERM: the jobs that run are finished first\n")
        stop(*arguments)

    signal.signal(signal.SIGTERM, stop_and_say_so)


class NotesOfFailures(logging.Handler):
    """Notes the executor's messages on failed jobs. For groups, Snakemake logs none."""

    def emit(self, record):
        if getattr(record, "event", None) is LogEvent.JOB_ERROR and record.rule_msg:
            EXECUTOR_MESSAGES[record.jobid] = first_sentence(record.rule_msg)


def full_cause(log):
    """Return why a job failed, by its log, or by the full disk that cut its log short."""
    why = cause(log)
    if why and why.startswith("error: "):
        return why
    return obstacle(log) or why


def failed_jobs(entries):
    """Return rule, cause and log of each failed job. The entries are jobs, or groups of jobs."""
    causes = []
    for entry in entries:
        jobs = failed_jobs_of(entry)
        logged_causes = []
        for job in jobs:
            why, log = cause_by_log(job)
            if why:
                logged_causes.append((job.rule.name, why, log))
        if jobs and not logged_causes:
            causes.append(cause_without_log(entry, jobs))
        causes += logged_causes
    return sorted(causes)


def failed_jobs_of(entry):
    """Return the failed jobs of these rules in an entry, which is a job or a group."""
    if not entry.is_group():
        return own_jobs([entry])
    return [
        job for job in own_jobs(entry.jobs) if not all(map(os.path.exists, job.output))
    ]


def cause_by_log(job):
    """Return why a job failed, and its log. The cause is None if this run wrote no log."""
    log = Path(job.log[0])
    if STORE:
        name = os.path.relpath(log, stored(WORK))
        ViewStore(STORE).bring(f"{WORK}/{name}")
    # The clocks of nodes differ.
    is_of_this_run = is_newer(log, start_of_run() - 5)
    return (full_cause(log) if is_of_this_run else None), log


def cause_without_log(entry, jobs):
    """Return rule, cause and log of an entry whose jobs wrote no log, as if they never began.

    The cause is in the batch system's log, or in the executor's message.
    """
    name, log = min((job.rule.name, Path(job.log[0])) for job in jobs)
    batch = batch_log(entry.name, start_of_run() - 5)
    messages = [
        EXECUTOR_MESSAGES[job.jobid] for job in jobs if job.jobid in EXECUTOR_MESSAGES
    ]
    why = (batch and cause(batch)) or "; ".join(messages)
    # A full disk takes no log at all.
    why = why or obstacle(log) or "it said nothing"
    return name, why, batch or log
