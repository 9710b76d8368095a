"""Says why a run failed, and which log has the details."""

import itertools
import signal
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lightfield.core.disk_space import obstacle
from lightfield.core.errors import LESS_MEMORY

# The likely cause when a signal ended a program.
_SIGNALS = {
    "SIGKILL": f"most likely memory ran out: {LESS_MEMORY}",
    "SIGABRT": f"most likely memory ran out: {LESS_MEMORY}",
    "SIGSEGV": f"Blender crashed, as it does if it gets no memory: {LESS_MEMORY}",
    "SIGBUS": "most likely a temporary folder is full: free some space in /dev/shm and TMPDIR",
    "SIGALRM": "a view took far longer than expected: it hung",
    "SIGINT": "it was interrupted, as by Ctrl-C",
    "SIGTERM": "it was cancelled, or exceeded its time limit",
}

# The same while Blender reads a file, as `lightfield.rendering.scenes.quiet` prints it.
READS = "Blender reads "
HAS_READ = "Blender has read "
MOST_MINUTES = 30
_BLENDER_CRASHED = (
    f"Blender crashed when it read this file, as it does if it gets no memory ({LESS_MEMORY}), or "
    "if the file is damaged: export it again"
)
_SIGNALS_OF_FILES = _SIGNALS | {
    "SIGABRT": _BLENDER_CRASHED,
    "SIGSEGV": _BLENDER_CRASHED,
    "SIGALRM": f"Blender has read this file for {MOST_MINUTES} minutes; a .blend that it links may "
    "be a FIFO",
}

# Lines that tar prints after the cause.
_AFTER_THE_CAUSE = ("tar: Exiting with failure status", "tar: Error is not recoverable")


# The clocks of nodes differ by at most this many seconds.
CLOCKS_DIFFER = 5


@dataclass
class StartedJob:
    """A job that runs or ran: its rule, log and outputs.

    ``began`` is in seconds since 1970. ``message`` is the executor's message on its failure.
    """

    rule: str
    log: Path | None
    outputs: Sequence[Path]
    began: float
    message: str = ""

    def cause(self) -> str | None:
        """Return why it failed, by its log, or by the full disk that cut the log short.

        Return None if it wrote no log.
        """
        if self.log is None or not is_newer(self.log, self.began):
            return None
        why = cause(self.log)
        if why and why.startswith("error: "):
            return why
        return obstacle(self.log) or why

    def is_finished(self) -> bool:
        """Return whether it has written all its outputs."""
        return all(is_newer(path, self.began) for path in self.outputs)


@dataclass
class Submission:
    """Jobs that run as one job: a single job, or a ``group`` of them by its name."""

    group: str | None = None
    jobs: list[StartedJob] = field(default_factory=list)

    def causes(self) -> list[tuple[str, str, Path | None]]:
        """Return the rule, cause and log of each of its jobs that failed."""
        # Snakemake says of each job of a group that it failed.
        failed = [job for job in self.jobs if self.group is None or not job.is_finished()]
        causes = [(job.rule, why, job.log) for job in failed if (why := job.cause())]
        return causes or [self._cause_without_logs(job) for job in failed[:1]]

    def _cause_without_logs(self, job: StartedJob) -> tuple[str, str, Path | None]:
        """Return the rule, cause and log of a job that wrote no log, as if it never began.

        The cause is in the batch system's log, or in the executor's message.
        """
        rules = "_".join(sorted({job.rule for job in self.jobs}))
        batch = batch_log(f"{self.group}_{rules}" if self.group else rules, job.began)
        # A full disk takes no log at all.
        why = (batch and cause(batch)) or job.message or (job.log and obstacle(job.log))
        return job.rule, why or "it said nothing", batch or job.log


def cause(log: Path) -> str | None:
    """Return the line of a program's log that says why it failed, or None for an empty log.

    That is its last ``error: …``, or its last line if the program wrote no error. For a signal, the
    likely reason is added.
    """
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith(_AFTER_THE_CAUSE)]
    errors = [line for line in lines if line.startswith("error: ")]
    if not lines:
        return None
    last_line = errors[-1] if errors else lines[-1]
    name = last_line.removeprefix("error: killed by ")
    if name != last_line and (file := _file_at_work(lines)):
        reason = _SIGNALS_OF_FILES.get(name)
        last_line = f"error: {file}: {last_line.removeprefix('error: ')}"
        said = [line.removeprefix("what():").strip() for line in lines if line.startswith("what()")]
        return ": ".join(filter(None, [last_line, *said[-1:], reason]))
    likely_reason = _SIGNALS.get(name)
    return f"{last_line}: {likely_reason}" if likely_reason else last_line


def _file_at_work(lines: Sequence[str]) -> str | None:
    """Return the file that Blender was reading when a log ended. None if it was reading none."""
    marks = [line for line in lines if line.startswith((READS, HAS_READ))]
    return marks[-1].removeprefix(READS) if marks and marks[-1].startswith(READS) else None


def signal_cause(number: int) -> str:
    """Return that a signal ended a process, and the likely reason."""
    name = signal.Signals(number).name
    reason = _SIGNALS.get(name)
    return f"killed by {name}: {reason}" if reason else f"killed by {name}"


def first_sentence(message: str) -> str:
    """Return an executor's message about a job, without the command that it quotes below."""
    lines = itertools.takewhile(lambda line: not line.startswith(" "), message.splitlines())
    return " ".join(lines).strip().rstrip(":")


def failure_report(jobs: Iterable[tuple[str, str, Path | None]]) -> str:
    """Return each cause of failed jobs with one of its logs. Each job is a rule, cause and log."""
    logs: dict[tuple[str, str], list[Path | None]] = {}
    for rule, why, log in jobs:
        logs.setdefault((rule, why), []).append(log)
    paragraphs = []
    for (rule, why), paths in logs.items():
        paragraph = f"{rule} failed: {why}"
        if paths[0]:
            paragraph += f"\n  log: {paths[0]}"
        if len(paths) > 1:
            paragraph += f" (and {len(paths) - 1} more with the same cause)"
        paragraphs.append(paragraph)
    return "\n".join(paragraphs)


def is_newer(path: Path, time: float) -> bool:
    """Return whether a file exists, and was written after ``time``, in seconds since 1970."""
    return path.is_file() and path.stat().st_mtime >= time - CLOCKS_DIFFER


def batch_log(name: str, since: float) -> Path | None:
    """Return the newest log that a batch system wrote for a job or group, or None.

    Looks in the folders that the profiles give Slurm. The log must be newer than ``since``, in
    seconds since 1970.
    """
    folder = Path(".snakemake")
    logs = [*folder.glob(f"slurm_logs/*_{name}/**/*.log"), *folder.glob(f"{name}-*.log")]
    new_logs = [log for log in logs if is_newer(log, since)]
    return max(new_logs, key=lambda log: log.stat().st_mtime, default=None)
