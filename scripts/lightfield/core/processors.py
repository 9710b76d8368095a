"""Counts the processors that this process may use, and limits the threads of libraries."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

# On macOS no process can choose its processors.
_HAS_AFFINITY = hasattr(os, "sched_getaffinity")


def available() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if _HAS_AFFINITY else os.cpu_count() or 1


@contextmanager
def only(count: int) -> Iterator[None]:
    """Make a library that is imported in this context start at most ``count`` threads.

    Blender and OpenImageDenoise use TBB's threads beside Cycles' own. When TBB is loaded, it starts
    a thread for each processor that it may use. Idle threads keep asking for work, and take a tenth
    of each processor from the renders of other shards. Does nothing on systems where a process
    cannot choose its processors.
    """
    if not _HAS_AFFINITY:
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed)[:count])
    try:
        yield
    finally:
        # Afterwards all threads may use all processors, including the threads that were just
        # started.
        for thread in Path("/proc/self/task").iterdir():
            # The thread may have ended in the meantime.
            with suppress(ProcessLookupError):
                os.sched_setaffinity(int(thread.name), allowed)
