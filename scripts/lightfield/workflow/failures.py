"""Says why a run failed, and which log has the details."""

import itertools
import signal
from collections.abc import Iterable
from pathlib import Path

from lightfield.core.errors import LESS_MEMORY

# The likely cause when a signal ended a program.
_SIGNALS = {
    "SIGKILL": f"most likely memory ran out: {LESS_MEMORY}",
    "SIGABRT": f"most likely memory ran out: {LESS_MEMORY}",
    "SIGSEGV": f"Blender crashed, as it does if it gets no memory: {LESS_MEMORY}",
    "SIGBUS": "most likely a temporary folder is full: free some space in /dev/shm and TMPDIR",
    "SIGALRM": "a view took far longer than expected: it hung",
    "SIGTERM": "it was cancelled, or exceeded its time limit",
}

# Lines that tar prints after the cause.
_AFTER_THE_CAUSE = ("tar: Exiting with failure status", "tar: Error is not recoverable")


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
    likely_reason = _SIGNALS.get(last_line.removeprefix("error: killed by "))
    return f"{last_line}: {likely_reason}" if likely_reason else last_line


def signal_cause(number: int) -> str:
    """Return that a signal ended a process, and the likely reason."""
    name = signal.Signals(number).name
    reason = _SIGNALS.get(name)
    return f"killed by {name}: {reason}" if reason else f"killed by {name}"


def first_sentence(message: str) -> str:
    """Return an executor's message about a job, without the command that it quotes below."""
    lines = itertools.takewhile(lambda line: not line.startswith(" "), message.splitlines())
    return " ".join(lines).strip().rstrip(":")


def failure_report(jobs: Iterable[tuple[str, str, Path]]) -> str:
    """Return each cause of failed jobs with one of its logs. Each job is a rule, cause and log."""
    logs: dict[tuple[str, str], list[Path]] = {}
    for rule, why, log in jobs:
        logs.setdefault((rule, why), []).append(log)
    paragraphs = []
    for (rule, why), paths in logs.items():
        paragraph = f"{rule} failed: {why}\n  log: {paths[0]}"
        if len(paths) > 1:
            paragraph += f" (and {len(paths) - 1} more with the same cause)"
        paragraphs.append(paragraph)
    return "\n".join(paragraphs)


def is_newer(path: Path, time: float) -> bool:
    """Return whether a file exists, and was written after ``time``, in seconds since 1970."""
    return path.is_file() and path.stat().st_mtime >= time


def batch_log(name: str, since: float) -> Path | None:
    """Return the newest log that a batch system wrote for a job or group, or None.

    Looks in the folders that the profiles give Slurm. The log must be newer than ``since``, in
    seconds since 1970.
    """
    folder = Path(".snakemake")
    logs = [*folder.glob(f"slurm_logs/*_{name}/**/*.log"), *folder.glob(f"{name}-*.log")]
    new_logs = [log for log in logs if is_newer(log, since)]
    return max(new_logs, key=lambda log: log.stat().st_mtime, default=None)
