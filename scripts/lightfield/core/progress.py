"""Prints the progress of long work: pieces done, seconds a piece, and time left."""

import re
import sys
import time
from dataclasses import dataclass

# Seconds between two lines.
INTERVAL = 5.0

_BEGIN = re.compile(r".*: (\d+) \w+ to do(?:, (\d+) already done)?")
_NOW = re.compile(r".*: (\d+) of (\d+) \w+, ([\d.e+-]+) s each")


def duration(seconds: float) -> str:
    """Return a duration as a person reads it: ``42 s``, ``3 min 05 s``, ``2 h 07 min``."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 100:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


@dataclass(frozen=True)
class Said:
    """What a line of `Progress` says: pieces ``done`` of ``total``, and seconds for ``each``.

    Only the first line says how many were ``already`` done before. It says no seconds.
    """

    done: int
    total: int
    already: int | None = None
    each: float | None = None


def read(line: str) -> Said | None:
    """Return what a line of `Progress` says, or None if it is none."""
    if found := _BEGIN.fullmatch(line):
        return Said(0, int(found[1]), int(found[2] or 0))
    if found := _NOW.match(line):
        return Said(int(found[1]), int(found[2]), each=float(found[3]))
    return None


class Progress:
    """Counts finished pieces of work and prints a line from time to time, the first at once.

    Whole lines, never carriage returns, so that several shards can share one log. The lines come
    every `INTERVAL`, and more rarely, down to one a minute, the longer the work takes.
    ``already`` pieces were finished before; ``total`` are to do.
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
        if now - self.printed < max(INTERVAL, min(elapsed / 20, 60)) and self.count < self.total:
            return
        self.printed = now
        # The first piece often takes longer, because it prepares the others.
        counted, since = self.first if self.count > self.first[0] else (0, 0.0)
        each = (elapsed - since) / (self.count - counted)
        left = each * (self.total - self.count)
        self._print(
            f"{self.count} of {self.total} {self.unit}, {each:.3g} s each, "
            + (f"{duration(left)} left" if left else f"done in {duration(elapsed)}")
        )

    def _print(self, text: str) -> None:
        print(f"{self.label}: {text}", file=sys.stderr, flush=True)
