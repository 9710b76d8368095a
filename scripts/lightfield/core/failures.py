"""What a run that failed says last: why, and where the whole of it can be read."""

from collections.abc import Iterable
from pathlib import Path

# What tar says after the cause.
_AFTER_THE_CAUSE = ("tar: Exiting with failure status", "tar: Error is not recoverable")


def cause(log: Path) -> str | None:
    """Return the line of a program's log that says why it failed; None if the log has no line.

    That is its last ``error: …``; of a program that did not get so far, its last line.
    """
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith(_AFTER_THE_CAUSE)]
    errors = [line for line in lines if line.startswith("error: ")]
    said = errors or lines
    return said[-1] if said else None


def failure_report(jobs: Iterable[tuple[str, Path]]) -> str:
    """Return each cause and a log that has it, of failed jobs given by rule and log."""
    logs: dict[tuple[str, str], list[Path]] = {}
    for rule, log in jobs:
        logs.setdefault((rule, cause(log) or "it said nothing"), []).append(log)
    return "\n".join(
        f"{rule} failed: {why}\n  log: {paths[0]}"
        + (f" (and {len(paths) - 1} more with the same cause)" if paths[1:] else "")
        for (rule, why), paths in logs.items()
    )
