"""Prints the progress of long work: pieces done, seconds a piece, and time left."""

import re
import sys
import time
from dataclasses import dataclass

from lightfield.core.units import duration

# The beginnings of the lines before and after a job compiles, which is no part of its pieces.
COMPILING = "compiling "
COMPILED = "compiled "

# Seconds between two lines.
_INTERVAL = 5.0

_BEGIN = re.compile(r".*: (\d+) \w+ to do(?:, (\d+) already done)?")
_NOW = re.compile(r".*: (\d+) of (\d+) \w+, ([\d.e+-]+) s each")


@dataclass(frozen=True)
class ProgressLine:
    """The content of a line of `Progress`: pieces ``done`` of ``total``, and seconds for ``each``.

    Only the first line says how many were ``already`` done before. It has no seconds.
    """

    done: int
    total: int
    already: int | None = None
    each: float | None = None


def read(line: str) -> ProgressLine | None:
    """Return the content of a line of `Progress`. None for other lines."""
    if match := _BEGIN.fullmatch(line):
        total, already = match.groups()
        return ProgressLine(0, int(total), int(already or 0))
    if match := _NOW.match(line):
        done, total, each = match.groups()
        return ProgressLine(int(done), int(total), each=float(each))
    return None


class Progress:
    """Counts finished pieces of work and prints a line from time to time, the first at once.

    It prints complete lines without carriage returns, so that several shards can share one log.
    A line comes every `_INTERVAL`, and down to once a minute the longer the work takes.
    ``already`` pieces were finished before, and ``total`` are to do.
    """

    def __init__(self, total: int, label: str, unit: str = "views", already: int = 0) -> None:
        self.total = total
        self.label = label
        self.unit = unit
        self.count = 0
        self._print(f"{total} {unit} to do" + (f", {already} already done" if already else ""))
        self.begin()

    def begin(self) -> None:
        """Start the clock. Call it again after preparations that are not part of the pieces."""
        self.started = self.printed = time.monotonic()
        self.first: tuple[int, float] | None = None

    def done(self, count: int = 1) -> None:
        """Count ``count`` more pieces as finished."""
        self.count += count
        if not self.count:
            return
        now = time.monotonic()
        elapsed = now - self.started
        if self.first is None:
            self.first = (self.count, elapsed)
        if now - self.printed < max(_INTERVAL, min(elapsed / 20, 60)) and self.count < self.total:
            return
        self.printed = now
        # The first piece often takes longer, because it prepares the others.
        counted, since = self.first if self.count > self.first[0] else (0, 0.0)
        each = (elapsed - since) / (self.count - counted)
        remaining = each * (self.total - self.count)
        self._print(
            f"{self.count} of {self.total} {self.unit}, {each:.3g} s each, "
            + (f"{duration(remaining)} left" if remaining else f"done in {duration(elapsed)}")
        )

    def _print(self, text: str) -> None:
        print(f"{self.label}: {text}", file=sys.stderr, flush=True)
