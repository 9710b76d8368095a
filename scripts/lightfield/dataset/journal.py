"""Journals: what a shard's processes did and how fast, one JSON line each, kept through kills.

Every process that works on a shard appends to the shard's journal, so that it holds all the time
that was really spent. Times of day are seconds since 1970. A process's lines are in this order:

- ``started``, ``host``, ``pid``: when and where it began;
- ``start_up_seconds``, ``start_up_cpu_seconds``, ``device``, ``threads``: the scene is open;
- for each image ``view``, ``finished``, ``wall_seconds``, ``cpu_seconds`` and, of a rendered view,
  Cycles' own ``render_seconds`` and ``synchronization_seconds``, ``geometry_seconds``, the part of
  ``wall_seconds`` that depth took, and ``memory_bytes``;
- ``ended``, ``wall_seconds``, ``cpu_seconds``, ``peak_memory_bytes``: of the whole process. A
  process that was killed lacks this line.
"""

import os
import socket
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import psutil

from lightfield.core import memory
from lightfield.core.files import append_json_line, read_json_lines
from lightfield.dataset.shard_files import JOURNAL_SUFFIX

# Of all shards in a folder: 0-6.journal.jsonl is of the views from 0 to 5.
JOURNALS = f"[0-9]*-[0-9]*{JOURNAL_SUFFIX}"

# A machine that has failed so often, one time after the other, is avoided.
MOST_FAILURES = 3
# A view is suspect that was rendered in so small a part of the time of so many others at least.
SUSPECT_PART, SUSPECT_AFTER = 0.02, 3

# What every line of a kind has, after the key that says which kind it is.
_LINES: dict[str, dict[str, type]] = {
    "started": {"started": float, "host": str, "pid": int},
    "start_up_seconds": {"start_up_seconds": float, "device": str, "threads": int},
    "ended": {"ended": float, "cpu_seconds": float, "peak_memory_bytes": int},
    "view": {
        "view": str,
        "finished": float,
        "wall_seconds": float,
        "cpu_seconds": float,
        "render_seconds": float,
    },
}


class Journal:
    """Appends the lines of this process to a journal; with ``path`` None it writes nothing."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        # Until here Python read its modules, which takes hardly longer than its processor time.
        self.started = round(time.time() - time.process_time(), 3)
        self.append({"started": self.started, "host": socket.gethostname(), "pid": os.getpid()})

    def append(self, entry: Mapping[str, Any]) -> None:
        """Add one line, at once."""
        if self.path:
            append_json_line(self.path, entry)

    def end(self) -> None:
        """Add the line of a process that has done all its work."""
        now = time.time()
        self.append(
            {
                "ended": round(now, 3),
                "wall_seconds": round(now - self.started, 4),
                "cpu_seconds": round(time.process_time(), 4),
                "peak_memory_bytes": memory.peak(),
            }
        )


@dataclass
class Run:
    """One process's part of a journal: its first lines, its images, and whether it ended."""

    start: dict[str, Any]
    views: list[dict[str, Any]] = field(default_factory=list)
    end: dict[str, Any] | None = None

    @property
    def later_views(self) -> list[dict[str, Any]]:
        """All but the first, whose time holds some of the start-up; that one, if it is alone."""
        return self.views[1:] or self.views

    @property
    def last_heard(self) -> float:
        """When it last wrote, in seconds since 1970."""
        if self.end:
            return float(self.end["ended"])
        if self.views:
            return float(self.views[-1]["finished"])
        return float(self.start["started"]) + float(self.start.get("start_up_seconds", 0))

    @property
    def wall_seconds(self) -> float:
        """How long it is known to have worked; what a killed one had begun last is not known."""
        return round(self.last_heard - float(self.start["started"]), 3)

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the same."""
        if self.end:
            return float(self.end["cpu_seconds"])
        begun = float(self.start.get("start_up_cpu_seconds", 0))
        return begun + sum(float(view["cpu_seconds"]) for view in self.views)

    @property
    def peak_memory_bytes(self) -> int:
        """Most memory that it is known to have had."""
        if self.end:
            return int(self.end["peak_memory_bytes"])
        return max((view.get("memory_bytes", 0) for view in self.views), default=0)

    def is_running(self) -> bool | None:
        """Whether it is at work now; None if that cannot be seen, being on another machine."""
        if self.end:
            return False
        if self.start["host"] != socket.gethostname():
            return None
        try:
            # Another process may have got its number since; these times are good to 1 s or so.
            begun = psutil.Process(self.start["pid"]).create_time()
            return bool(begun < self.start["started"] + 2)
        except psutil.NoSuchProcess:
            return False


def read(path: Path) -> list[Run]:
    """Return the runs in a journal, in their order.

    A line that a kill cut short is left out, and so is one that was damaged since, and what stands
    before the first start.
    """
    runs: list[Run] = []
    for entry in read_json_lines(path):
        if not _is_sound(entry):
            continue
        if "started" in entry:
            runs.append(Run(entry))
        elif not runs:
            continue
        elif "start_up_seconds" in entry:
            runs[-1].start |= entry
        elif "ended" in entry:
            runs[-1].end = entry
        else:
            runs[-1].views.append(entry)
    return runs


def avoided(shard: Sequence[Run], others: Iterable[Sequence[Run]]) -> list[str]:
    """Return the hosts to avoid when a shard is submitted again, whose runs are all over.

    That is where it failed last, and where the last `MOST_FAILURES` runs of all failed. Of the
    ``others`` the last run may still be at work. No host is avoided while no other one has ended
    a run: it may be the only one.
    """
    over = [(run.start["started"], run.start["host"], bool(run.end)) for run in shard]
    for runs in others:
        known = [*runs[:-1], *(run for run in runs[-1:] if run.end)]
        over += [(run.start["started"], run.start["host"], bool(run.end)) for run in known]
    ended: dict[str, list[bool]] = defaultdict(list)
    for _, host, has_ended in sorted(over):
        ended[host].append(has_ended)
    failing = {host for host, past in ended.items() if not any(past[-MOST_FAILURES:])}
    found = {host for host in failing if len(ended[host]) >= MOST_FAILURES}
    found |= {run.start["host"] for run in shard[-1:] if not run.end}
    return sorted(found) if any(any(ended[host]) for host in ended.keys() - found) else []


def is_suspect(seconds: float, others: Sequence[float]) -> bool:
    """Whether a view took implausibly few seconds, beside the ``others`` of its shard."""
    return len(others) >= SUSPECT_AFTER and seconds < SUSPECT_PART * median(others)


def _is_sound(entry: dict[str, Any]) -> bool:
    """Whether an entry is a journal's line, with all that such a line has."""
    kind = next((kind for kind in _LINES if kind in entry), None)
    return kind is not None and all(
        isinstance(entry.get(key), (int, float) if expected is float else expected)
        # No time or memory is larger. NaN fails the comparison, too.
        and (expected is str or abs(entry[key]) < 1e18)
        for key, expected in _LINES[kind].items()
    )
