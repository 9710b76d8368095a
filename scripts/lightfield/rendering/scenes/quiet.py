"""Silences Blender, whose messages on standard output concern no user."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lightfield.workflow.failures import HAS_READ, MOST_MINUTES, READS


@contextmanager
def quiet(printed: Path = Path(os.devnull)) -> Iterator[None]:
    """Write what Blender itself prints to standard output into the file ``printed``."""
    sys.stdout.flush()
    saved = os.dup(1)
    with printed.open("wb") as file:
        os.dup2(file.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(saved, 1)
            os.close(saved)


@contextmanager
def reading_quietly(path: Path, printed: Path = Path(os.devnull)) -> Iterator[None]:
    """Write what Blender prints while it reads a file into ``printed``, and limit its time.

    The log has the name of the file before Blender begins: a crash ends the process at once.
    """
    print(f"{READS}{path}", flush=True)
    # Python cannot end Blender itself, so the alarm ends the process.
    signal.alarm(60 * MOST_MINUTES)
    try:
        with quiet(printed):
            yield
    finally:
        signal.alarm(0)
    print(f"{HAS_READ}{path}", flush=True)
