"""Gives each process a GPU that no other process renders on at the same time."""

import fcntl
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from lightfield.core.errors import UserError

# CUDA, OptiX and HIP read from these environment variables which GPUs a process sees.
CUDA, HIP = "CUDA_VISIBLE_DEVICES", "HIP_VISIBLE_DEVICES"
_KFD = Path("/sys/class/kfd/kfd/topology/nodes")


@dataclass(frozen=True)
class Gpu:
    """A GPU by its id. A process whose environment ``variable`` is that id sees only this GPU."""

    variable: str
    id: str


def visible(environment: Mapping[str, str] = os.environ) -> list[Gpu]:
    """Return the GPUs that this process sees: those that its environment allows, or all."""
    gpus = []
    for variable, every in ((CUDA, _nvidia), (HIP, _amd)):
        chosen = environment.get(variable)
        ids = every() if chosen is None else [name.strip() for name in chosen.split(",")]
        gpus += [Gpu(variable, name) for name in ids if name and name != "-1"]
    return gpus


def _nvidia() -> list[str]:
    """Return the UUIDs of NVIDIA's GPUs, as their driver lists them."""
    try:
        command = ["nvidia-smi", "--query-gpu=uuid", "--format=csv,noheader"]
        output = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
    except (OSError, subprocess.SubprocessError):
        return []
    return [line for line in output.stdout.split() if line.startswith("GPU-")]


def _amd() -> list[str]:
    """Return the numbers of AMD's GPUs. The driver also lists processors, whose id is 0."""
    ids = (path.read_text().strip() for path in sorted(_KFD.glob("*/gpu_id")))
    return [str(number) for number, _ in enumerate(name for name in ids if name != "0")]


def take(gpus: Sequence[Gpu], folder: Path | None = None) -> tuple[Gpu, BinaryIO]:
    """Wait until one of several GPUs is free, and return it with its lock.

    It is taken until the lock is closed, or this process ends, however it does. The lock files lie
    in ``folder``, by default where the machine has its temporary files, and hold nothing.
    """
    folder = folder or Path(tempfile.gettempdir())
    waited = False
    while True:
        for gpu in gpus:
            name = re.sub(r"\W", "_", f"{gpu.variable}-{gpu.id}")
            path = folder / f"plenoforge-{name}.lock"
            lock = os.fdopen(_opened(path), "rb")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return gpu, lock
            except BlockingIOError:
                lock.close()
        if not waited:
            print(f"waiting for one of {len(gpus)} GPUs to be free", file=sys.stderr, flush=True)
        waited = True
        time.sleep(0.5)


def _opened(path: Path) -> int:
    """Open a lock file, which may be another user's and not to be written, or create it.

    For writing if it can be, for NFS locks no others. A link is never followed: in a folder of all
    users it may be anybody's, and lead to a file of this user. Raises `UserError` for one.
    """
    # Do not wait for a pipe that somebody has put there.
    flags = os.O_NOFOLLOW | os.O_NONBLOCK
    while True:
        try:
            return os.open(path, os.O_RDWR | flags)
        except PermissionError:
            return os.open(path, os.O_RDONLY | flags)
        except FileNotFoundError:
            # Another process may have created it in the meantime.
            with suppress(FileExistsError):
                file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
                # Whatever the umask: another user's process must be able to lock it.
                os.fchmod(file, 0o666)
                return file
        except OSError as error:
            raise UserError(f"{path}: cannot be locked: {error.strerror}; remove it") from None


_taken: list[BinaryIO] = []


def use_one() -> None:
    """Let this process see one GPU only, which no other process takes before this one ends.

    A single one that is left to it, as by a batch system, is its own already.
    """
    gpus = visible()
    if len(gpus) < 2 or _taken:
        return
    gpu, lock = take(gpus)
    _taken.append(lock)
    for variable in {other.variable for other in gpus}:
        os.environ[variable] = gpu.id if variable == gpu.variable else "-1"
