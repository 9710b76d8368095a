"""Snakemake's logger `plenoforge`: tells the display of the workflow what Snakemake does.

The display is `lightfield.workflow.run_display`. `lightfield.workflow.handlers` sets it.
`make` copies this folder into the environment, because Snakemake finds logger plugins only there.
"""

import builtins
import logging
import os
import re
import sys

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

# Messages that say less than the display does.
REPLACED = (
    "RuleException",
    "Cannot restore",
    "Error in group",
    "Assuming unrestricted shared",
    "Config file",
    "Singularity containers: ignored",
    "Restored previous version",
    "Exiting because a job execution failed",
    "WorkflowError:\nAt least one job",
)
# What --printshellcmds shows as Snakemake itself does: jobs, with the reason for each.
OF_JOBS = (LogEvent.RUN_INFO, LogEvent.JOB_INFO, LogEvent.SHELLCMD)

# How Slurm's executor says under which name it submits jobs, and that it has submitted one.
SLURM_RUN = re.compile(r"SLURM run ID: (\S+)")
SUBMITTED = re.compile(r"Job (\d+) has been submitted with SLURM jobid ")

# None until the Snakefile is read, and in other workflows.
display = None
# Whether Snakemake uses this plugin.
is_used = False


class LogHandler(LogHandlerBase):
    """Passes events to the display, and prints warnings and errors."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self):
        global is_used
        is_used = True
        self.quiet = {choice.name for choice in self.common_settings.quiet or ()}
        self.has_started = False
        self.submission = None
        # The number in the batch system of the group whose jobs' errors follow.
        self.batch_job = None

    def emit(self, record):
        """Show what one record says."""
        try:
            event = getattr(record, "event", None)
            if event == LogEvent.WORKFLOW_STARTED:
                self.has_started = True
            if display:
                self.tell(event, record)
            if "ALL" in self.quiet and not self.common_settings.dryrun:
                return
            is_of_jobs = event in OF_JOBS and self.common_settings.printshellcmds
            is_message = event in (None, LogEvent.ERROR)
            if refusal := refusal_of(record):
                self.say(refusal)
            elif is_of_jobs or (is_message and self.is_worth_a_line(record)):
                self.say(self.format(record))
        except Exception:
            self.handleError(record)

    def tell(self, event, record):
        """Tell the display what happens to jobs."""
        if event == LogEvent.RUN_INFO:
            is_shown = not self.quiet & {"ALL", "PROGRESS"}
            display.planned(is_dry_run=self.common_settings.dryrun, is_shown=is_shown)
        elif event == LogEvent.GROUP_INFO:
            self.submission = display.submission(record.group_id)
        elif event is None and (told := SLURM_RUN.match(record.getMessage())):
            # Nothing else tells which executor runs the jobs.
            display.slurm_run = told[1]
        elif event is None and (told := SUBMITTED.match(record.getMessage())):
            display.submitted(int(told[1]))
        elif event == LogEvent.JOB_INFO and self.common_settings.dryrun:
            resources = dict(record.resources.items())
            display.requested(record.rule_name, paths(record.log), record.threads, resources)
        elif event == LogEvent.JOB_INFO:
            # Jobs of a group are indented, and follow their group.
            submission = self.submission if record.indent else display.submission()
            display.started(
                record.jobid,
                record.rule_name,
                paths(record.log),
                paths(record.output),
                submission,
                record.threads,
                dict(record.resources.items()),
            )
        elif event == LogEvent.JOB_FINISHED:
            display.finished(record.job_id)
        elif event == LogEvent.GROUP_ERROR:
            self.batch_job = getattr(record, "external_jobid", None)
        elif event == LogEvent.JOB_ERROR:
            batch_job = self.batch_job if record.indent else record.aux.get("external_jobid")
            display.failed(record.jobid, record.rule_msg, batch_job)

    def is_worth_a_line(self, record):
        """Return whether to print a plain message. Before a run, all of them, as of --lint."""
        message = record.getMessage()
        if message.startswith(REPLACED):
            return False
        is_needed = record.levelno >= logging.WARNING or message.startswith("Nothing to be done")
        return is_needed or not self.has_started

    def say(self, text):
        """Print a text above the display."""
        if display:
            display.say(text)
        else:
            print(text, file=sys.stderr, flush=True)

    def close(self):
        """End the display: Snakemake has said everything. A dry run may end with an error."""
        try:
            if display:
                display.close()
        finally:
            super().close()


def refusal_of(record):
    """Return in one line what the system has refused to Snakemake. None for other messages."""
    kind = getattr(builtins, str(getattr(record, "exception", None)), None)
    cause = re.search(r"\[Errno \d+\] (.+)", record.getMessage())
    if not (isinstance(kind, type) and issubclass(kind, OSError) and cause):
        return None
    caches = (os.environ.get("XDG_CACHE_HOME"), "/.cache")
    is_cache = any(cache and cache in cause[1] for cache in caches)
    hint = ": set XDG_CACHE_HOME to a folder that you may write in" if is_cache else ""
    return f"error: {cause[1]}{hint}"


def paths(files):
    """Return files as the rules have them. Snakemake adds words such as "(update)"."""
    return [file.partition(" (")[0] for file in files]
