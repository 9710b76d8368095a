"""Silences Blender, whose messages on standard output concern no user."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lightfield.workflow.failures import HAS_READ, MOST_MINUTES, READS


@contextmanager
def quiet() -> Iterator[None]:
    """Drop what Blender itself prints to standard output."""
    sys.stdout.flush()
    saved = os.dup(1)
    with Path(os.devnull).open("wb") as file:
        os.dup2(file.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(saved, 1)
            os.close(saved)


@contextmanager
def reading_quietly(path: Path) -> Iterator[None]:
    """Drop what Blender prints while it reads a file, and limit its time.

    The log has the name of the file before Blender begins: a crash ends the process at once.
    """
    print(f"{READS}{path}", flush=True)
    # Python cannot end Blender itself, so the alarm ends the process.
    signal.alarm(60 * MOST_MINUTES)
    try:
        with quiet():
            yield
    finally:
        signal.alarm(0)
    print(f"{HAS_READ}{path}", flush=True)
