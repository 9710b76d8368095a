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

# These environment variables tell CUDA, OptiX and HIP which GPUs a process sees.
CUDA = "CUDA_VISIBLE_DEVICES"
HIP = "HIP_VISIBLE_DEVICES"
_KFD = Path("/sys/class/kfd/kfd/topology/nodes")


@dataclass(frozen=True)
class Gpu:
    """A GPU by its id. A process whose environment ``variable`` is that id sees only this GPU."""

    variable: str
    id: str


def visible(environment: Mapping[str, str] = os.environ) -> list[Gpu]:
    """Return the GPUs that this process sees: all, or only the GPUs that its environment allows."""
    gpus = []
    for variable, all_ids in ((CUDA, _nvidia), (HIP, _amd)):
        allowed = environment.get(variable)
        ids = all_ids() if allowed is None else [name.strip() for name in allowed.split(",")]
        gpus += [Gpu(variable, name) for name in ids if name and name != "-1"]
    return gpus


def _nvidia() -> list[str]:
    """Return the UUIDs of NVIDIA's GPUs, as their driver lists them."""
    try:
        command = ["nvidia-smi", "--query-gpu=uuid", "--format=csv,noheader"]
        output = subprocess.run(
            command, capture_output=True, encoding="utf-8", check=True, timeout=30
        )
    except (OSError, subprocess.SubprocessError):
        return []
    return [line for line in output.stdout.split() if line.startswith("GPU-")]


def _amd() -> list[str]:
    """Return the numbers of AMD's GPUs. The driver also lists processors, whose id is 0."""
    ids = [path.read_text(encoding="utf-8").strip() for path in _KFD.glob("*/gpu_id")]
    gpu_count = len([name for name in ids if name != "0"])
    return [str(number) for number in range(gpu_count)]


def take(gpus: Sequence[Gpu], folder: Path | None = None) -> tuple[Gpu, BinaryIO]:
    """Wait until one of several GPUs is free, and return it with its lock.

    The GPU is taken until the lock is closed, or this process ends in any way. The lock files are
    empty. They lie in ``folder``, by default the machine's folder of temporary files.
    """
    folder = folder or Path(tempfile.gettempdir())
    waited = False
    while True:
        for gpu in gpus:
            name = re.sub(r"\W", "_", f"{gpu.variable}-{gpu.id}")
            path = folder / f"plenoforge-{name}.lock"
            lock = os.fdopen(_open_lock(path), "rb")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return gpu, lock
            except BlockingIOError:
                lock.close()
        if not waited:
            print(f"waiting for one of {len(gpus)} GPUs to be free", file=sys.stderr, flush=True)
        waited = True
        time.sleep(0.5)


def _open_lock(path: Path) -> int:
    """Open a lock file, or create it. Another user may own it, and forbid writing.

    Opens for writing if possible, because NFS locks no other files. Never follows a link: anybody
    may have put it into a folder of all users. Raises `UserError` for a link.
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
                # Override the umask: another user's process must be able to lock the file.
                os.fchmod(file, 0o666)
                return file
        except OSError as error:
            raise UserError(f"{path}: cannot be locked: {error.strerror}; remove it") from None


# The lock of this process's GPU. It stays open until the process ends.
_locks: list[BinaryIO] = []


def use_one() -> None:
    """Let this process see only one GPU, which no other process takes before this one ends.

    Does nothing if the process sees a single GPU, for example one from a batch system.
    """
    gpus = visible()
    if len(gpus) < 2 or _locks:
        return
    gpu, lock = take(gpus)
    _locks.append(lock)
    variables = {visible_gpu.variable for visible_gpu in gpus}
    for variable in variables:
        os.environ[variable] = gpu.id if variable == gpu.variable else "-1"
