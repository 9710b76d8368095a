"""The history in receipts: lines that say what each process of a job did, and how fast.

Every process that works on a shard notes at once what it has done. So the history holds all the
time that was spent, even by killed processes. Times of day are seconds since 1970. The lines of a
process are in this order:

- ``started``, ``host``, ``pid``: when and where it began;
- ``start_up_seconds``, ``start_up_cpu_seconds``, ``device``, ``threads``: the scene is open.
  On a GPU also ``waited_seconds`` for it and for its kernels, which are in no other time;
- for each image ``view``, ``finished``, ``wall_seconds`` and ``cpu_seconds``, which count from the
  end of the image before, because a view is written while the next is rendered. A rendered view
  also has Cycles' own ``render_seconds`` and ``synchronization_seconds``, ``memory_bytes``, and
  ``geometry_seconds``, which its depth and passes of geometry took;
- ``ended``, ``wall_seconds``, ``cpu_seconds``, ``peak_memory_bytes``: the totals of the process. A
  killed process lacks this line.
"""

import os
import socket
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import psutil

from lightfield.core import memory
from lightfield.engine.receipts import PART_SUFFIX, SUFFIX, history, is_shard
from lightfield.workflow.shard_log import log

# A view is suspect if it took less than this part of the median time of its shard's views.
_SUSPECT_PART = 0.02
# This needs at least this many other views.
_SUSPECT_AFTER = 3

# The keys of each kind of line. The first key shows the kind.
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


class History:
    """Notes the beginning and the end of this process."""

    def __init__(self) -> None:
        # Python's imports are over here. They took about as long as their CPU time.
        self.started = round(time.time() - time.process_time(), 3)
        log({"started": self.started, "host": socket.gethostname(), "pid": os.getpid()})

    def end(self) -> None:
        """Note that this process has done all its work."""
        now = time.time()
        log(
            {
                "ended": round(now, 3),
                "wall_seconds": round(now - self.started, 4),
                "cpu_seconds": round(time.process_time(), 4),
                "peak_memory_bytes": memory.peak(),
            }
        )


@dataclass
class ProcessHistory:
    """What one process did: its start, its images, and its end if it was not killed."""

    start: dict[str, Any]
    views: list[dict[str, Any]] = field(default_factory=list)
    end: dict[str, Any] | None = None

    @property
    def later_views(self) -> list[dict[str, Any]]:
        """All views but the first, whose time includes some of the start-up. Or the only view."""
        return self.views[1:] or self.views

    @property
    def last_heard(self) -> float:
        """The time of its last line, in seconds since 1970."""
        if self.end:
            return float(self.end["ended"])
        if self.views:
            return float(self.views[-1]["finished"])
        start_up = float(self.start.get("start_up_seconds", 0))
        return float(self.start["started"]) + self.waited_seconds + start_up

    @property
    def waited_seconds(self) -> float:
        """The time for which it waited for a GPU, or for the compilation of Cycles' kernels."""
        return float(self.start.get("waited_seconds", 0))

    @property
    def wall_seconds(self) -> float:
        """Its working time until its last line. A killed process may have worked longer."""
        return round(self.last_heard - float(self.start["started"]) - self.waited_seconds, 3)

    @property
    def cpu_seconds(self) -> float:
        """Its processor time until its last line."""
        if self.end:
            return float(self.end["cpu_seconds"])
        start_up = float(self.start.get("start_up_cpu_seconds", 0))
        return start_up + sum(float(view["cpu_seconds"]) for view in self.views)

    @property
    def peak_memory_bytes(self) -> int:
        """The most memory in its lines."""
        if self.end:
            return int(self.end["peak_memory_bytes"])
        return max((view.get("memory_bytes", 0) for view in self.views), default=0)

    def is_running(self) -> bool | None:
        """Return whether it works now. None if it is on another machine."""
        if self.end:
            return False
        if self.start["host"] != socket.gethostname():
            return None
        try:
            # A later process may have the same number. These times are exact to about 1 s.
            created = psutil.Process(self.start["pid"]).create_time()
            return bool(created < self.start["started"] + 2)
        except psutil.NoSuchProcess:
            return False


def shards(folder: Path) -> list[Path]:
    """Return the receipts of the shards in a folder, also of shards that were never finished."""
    files = [*folder.glob(f"*{SUFFIX}"), *folder.glob(f"*{PART_SUFFIX}")]
    return sorted({path.with_suffix(SUFFIX) for path in files if is_shard(path)})


def read(path: Path) -> list[ProcessHistory]:
    """Return the runs in the history of a receipt, in their order."""
    return runs_in(history(path))


def runs_in(entries: Iterable[dict[str, Any]]) -> list[ProcessHistory]:
    """Return the runs in a history, in their order.

    Leaves out damaged lines, lines that a kill cut short, and lines before the first start.
    """
    runs: list[ProcessHistory] = []
    for entry in entries:
        if not _is_sound(entry):
            continue
        if "started" in entry:
            runs.append(ProcessHistory(entry))
        elif not runs:
            continue
        elif "start_up_seconds" in entry:
            runs[-1].start |= entry
        elif "ended" in entry:
            runs[-1].end = entry
        else:
            runs[-1].views.append(entry)
    return runs


def is_suspect(seconds: float, other_seconds: Sequence[float]) -> bool:
    """Return whether a view was implausibly fast, compared with its shard's other views."""
    return len(other_seconds) >= _SUSPECT_AFTER and seconds < _SUSPECT_PART * median(other_seconds)


def _is_sound(entry: dict[str, Any]) -> bool:
    """Return whether an entry is a line of history with all its keys."""
    kind = next((kind for kind in _LINES if kind in entry), None)
    if kind is None:
        return False
    return all(_has_type(entry.get(key), expected) for key, expected in _LINES[kind].items())


def _has_type(value: Any, expected: type) -> bool:
    """Return whether a value of a line is plausible. A whole number may stand for a float."""
    if expected is str:
        return isinstance(value, str)
    numbers = (int, float) if expected is float else (int,)
    # No time or memory is larger. NaN fails this comparison, too.
    return isinstance(value, numbers) and abs(value) < 1e18
