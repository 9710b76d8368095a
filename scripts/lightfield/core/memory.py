"""Measures how much memory processes may use on this machine, and how much this one has used."""

import resource
import sys
from pathlib import Path

import psutil

# The folder of the control groups, and the file with the groups of this process.
CONTROL_GROUPS = Path("/sys/fs/cgroup")
OWN_GROUPS = Path("/proc/self/cgroup")


def available() -> int:
    """Return how many bytes all processes here may use: the machine's memory, or a lower limit.

    Batch systems and containers set limits by control groups. A group limits all groups inside it.
    """
    limits: list[int] = [psutil.virtual_memory().total]
    for file in _limit_files():
        text = file.read_text(encoding="utf-8").strip()
        if text.isdecimal():
            limits.append(int(text))
    return min(limits)


def _limit_files() -> list[Path]:
    """Return the files that may hold a limit, of control groups in version 1 and 2."""
    files = []
    for line in OWN_GROUPS.read_text(encoding="utf-8").splitlines() if OWN_GROUPS.exists() else ():
        _, controllers, path = line.split(":", 2)
        if controllers in ("", "memory"):
            name = "memory.limit_in_bytes" if controllers else "memory.max"
            root = CONTROL_GROUPS / controllers
            group = root / path.lstrip("/")
            files += [folder / name for folder in (group, *group.parents)]
    return [file for file in files if file.is_file()]


def peak() -> int:
    """Return the most bytes of memory that this process has used at once.

    Reads /proc: getrusage also counts the process that started this one.
    """
    try:
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    # getrusage counts in KiB, but in bytes on macOS.
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
