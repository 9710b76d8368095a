"""A logger plugin for Snakemake: one line of JSON on stderr for each job that is planned."""

import json
import sys
from logging import LogRecord

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

FILES = ("input", "output", "log")
# Snakemake adds this to the name of an output that is not deleted before its job.
UPDATED = " (update)"


class LogHandler(LogHandlerBase):
    writes_to_stream = True
    writes_to_file = False
    # It shows all events, whatever --quiet says.
    has_filter = True
    has_formatter = False
    needs_rulegraph = False

    def emit(self, record: LogRecord) -> None:
        if getattr(record, "event", None) != LogEvent.JOB_INFO:
            return
        job = {"rule": record.rule_name, "reason": record.reason, "cpus": record.threads}
        for name in FILES:
            job[name] = [str(file).removesuffix(UPDATED) for file in getattr(record, name)]
        job["command"] = record.shellcmd
        for name in ("mem_mb", "runtime", "gpu", "slurm_extra"):
            job[name] = record.resources.get(name)
        print(json.dumps(job), file=sys.stderr)
