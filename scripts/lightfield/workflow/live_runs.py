"""Finds out which runs work in a folder, and which of them were killed.

Each run leaves a note in the folder, and locks it as long as its process lives. A killed process
and a power cut leave the note without the lock. So the next run can tell a live run from a killed
one, which Snakemake's own locks do not show. The note's name holds all facts, because a power cut
may leave the file empty.
"""

import atexit
import fcntl
import os
import re
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

from lightfield.core.files import is_locked, locked_folder

# Jobs inherit this variable. They live on if only their run is killed.
VARIABLE = "PLENOFORGE_RUN"
_NAME = re.compile(r"(?P<pid>\d+)\.[0-9a-f]{8}@(?P<host>.+)\.(?P<place>here|cluster)")


@dataclass(frozen=True)
class LiveRun:
    """A run by its note: its process, its host's name, and whether its jobs run on a cluster."""

    note: Path
    pid: int
    host: str
    on_cluster: bool

    @property
    def is_killed(self) -> bool:
        """Whether the run and its jobs have certainly ended.

        Processes on another machine, and jobs on a cluster, may still live.
        """
        return self.host == socket.gethostname() and not self.on_cluster and _is_free(self.note)

    @property
    def jobs(self) -> list[int]:
        """The numbers of the processes of its jobs on this machine."""
        name = str(self.note.absolute())
        return sorted(
            process.pid
            for process in psutil.process_iter(["environ"])
            if (process.info["environ"] or {}).get(VARIABLE) == name and process.pid != os.getpid()
        )


def enter(folder: Path, on_cluster: bool, remove_locks: Callable[[], None]) -> list[LiveRun]:
    """Note that this run works in a folder. Return the other runs there that may live.

    If all of them were killed, ``remove_locks`` removes Snakemake's locks. Waits for jobs that
    have outlived their run. On network file systems without locks, this leaves no note and removes
    nothing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _wait_for_jobs(folder)
    try:
        with locked_folder(folder.parent):
            other_runs = _runs(folder)
            live_runs = [run for run in other_runs if not run.is_killed]
            if other_runs and not live_runs:
                remove_locks()
            for run in other_runs:
                if run not in live_runs:
                    run.note.unlink(missing_ok=True)
            folder.mkdir(exist_ok=True)
            _leave_note(folder, on_cluster)
    except OSError as error:
        print(f"warning: {folder}: no locks of files: {error.strerror}", file=sys.stderr)
        return []
    return live_runs


def refusal(live_runs: list[LiveRun]) -> str:
    """Return why a run cannot work on files that another run has locked, and what to do."""
    if not live_runs:
        return (
            "another run has locked these files and left no note of itself: wait for it; if "
            "no run is left: snakemake --unlock"
        )
    run = live_runs[0]
    if run.host != socket.gethostname():
        return (
            f"another run makes these files, process {run.pid} on {run.host}: wait for it; if "
            "it no longer runs: snakemake --unlock"
        )
    if _is_free(run.note):
        return (
            f"a run that was killed, process {run.pid}, may have left jobs on the cluster: wait "
            "for them or cancel them, then: snakemake --unlock"
        )
    return (
        f"another run makes these files, process {run.pid}: wait for it, or end it "
        f"(kill {run.pid}); snakemake --cores 1 status shows its progress"
    )


def _runs(folder: Path) -> list[LiveRun]:
    """Return the other runs that have left a note."""
    runs = []
    for path in sorted(folder.iterdir()):
        name = _NAME.fullmatch(path.name)
        if name and path not in _LOCKED_NOTES:
            runs.append(LiveRun(path, int(name["pid"]), name["host"], name["place"] == "cluster"))
    return runs


# The notes of this process, with the open files that hold their locks.
_LOCKED_NOTES: dict[Path, int] = {}


def _leave_note(folder: Path, on_cluster: bool) -> None:
    place = "cluster" if on_cluster else "here"
    unique = os.urandom(4).hex()
    note = folder / f"{os.getpid()}.{unique}@{socket.gethostname()}.{place}"
    # Open it for writing, because NFS locks no other files.
    file = os.open(note, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        note.unlink()
        raise
    _LOCKED_NOTES[note] = file
    os.environ[VARIABLE] = str(note.absolute())
    atexit.register(note.absolute().unlink, missing_ok=True)


def _is_free(note: Path) -> bool:
    """Return whether no process holds the lock of a note."""
    try:
        return not is_locked(note, os.O_RDWR)
    except FileNotFoundError:
        return True
    except OSError:
        return False


def _wait_for_jobs(folder: Path) -> None:
    """Wait for the jobs of killed runs, because they write the same files."""
    has_reported = False
    while jobs := [pid for run in _runs(folder) if run.is_killed for pid in run.jobs]:
        if not has_reported:
            numbers = " ".join(map(str, jobs))
            print(
                f"waiting for jobs that a killed run has left, processes {numbers} "
                f"(kill {numbers} ends them)",
                file=sys.stderr,
                flush=True,
            )
        has_reported = True
        time.sleep(0.5)
