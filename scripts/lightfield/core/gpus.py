"""Gives each process a GPU that no other process renders on at the same time."""

import os
import re
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from lightfield.core.errors import OutsideError
from lightfield.core.locks import tell_waiting, try_lock

# These environment variables tell CUDA, OptiX and HIP which GPUs a process sees.
CUDA = "CUDA_VISIBLE_DEVICES"
HIP = "HIP_VISIBLE_DEVICES"
_ANY = (CUDA, HIP)
_VARIABLES = {"cuda": (CUDA,), "optix": (CUDA,), "hip": (HIP,), "auto": _ANY, "gpu": _ANY}
_KFD = Path("/sys/class/kfd/kfd/topology/nodes")


@dataclass(frozen=True)
class Gpu:
    """A GPU by its id. A process whose environment ``variable`` is that id sees only this GPU.

    The id of an NVIDIA GPU is its UUID. A number is only unique in one environment.
    """

    variable: str
    id: str


def visible(device: str, environment: Mapping[str, str] = os.environ) -> list[Gpu]:
    """Return the GPUs on which a process renders that uses a ``device``, all of one maker.

    "auto" and "gpu" mean NVIDIA's GPUs, or AMD's if there are none. The ``environment`` may allow
    only some of them.
    """
    ids_of = {CUDA: _nvidia_ids, HIP: _amd_ids}
    for variable in _VARIABLES.get(device, ()):
        ids = ids_of[variable](environment)
        if gpus := [Gpu(variable, name) for name in ids if name and name != "-1"]:
            return gpus
    return []


def nvidia(*fields: str) -> list[list[str]]:
    """Return these ``fields`` of each NVIDIA GPU, as the driver's nvidia-smi lists them.

    Empty if the driver is missing, or does not know a field.
    """
    command = ["nvidia-smi", f"--query-gpu={','.join(fields)}", "--format=csv,noheader"]
    try:
        output = subprocess.run(
            command, capture_output=True, encoding="utf-8", check=True, timeout=30
        )
    except (OSError, subprocess.SubprocessError):
        return []
    rows = [line.split(", ") for line in output.stdout.splitlines()]
    return [row for row in rows if len(row) == len(fields)]


def _nvidia_ids(environment: Mapping[str, str]) -> list[str]:
    """Return the UUIDs of the NVIDIA GPUs that the environment allows.

    A batch system may give each job the number 0 for another GPU, so locks need UUIDs.
    """
    gpus = nvidia("index", "uuid", "name")
    allowed = environment.get(CUDA)
    if allowed is None:
        return [uuid for _, uuid, _ in gpus]
    # CUDA numbers GPUs of several models by their speed, and nvidia-smi by their slots.
    models = {name for *_, name in gpus}
    has_slot_order = environment.get("CUDA_DEVICE_ORDER") == "PCI_BUS_ID"
    uuids = {}
    if len(models) == 1 or has_slot_order:
        uuids = {index: uuid for index, uuid, _ in gpus}
    names = [name.strip() for name in allowed.split(",")]
    return [uuids.get(name, name) for name in names]


def _amd_ids(environment: Mapping[str, str]) -> list[str]:
    """Return the numbers of the AMD GPUs that the environment allows."""
    allowed = environment.get(HIP)
    if allowed is not None:
        return [name.strip() for name in allowed.split(",")]
    # The driver also lists processors, whose id is 0.
    ids = [path.read_text(encoding="utf-8").strip() for path in _KFD.glob("*/gpu_id")]
    gpu_count = len([name for name in ids if name != "0"])
    return [str(number) for number in range(gpu_count)]


def take(gpus: Sequence[Gpu], folder: Path | None = None) -> tuple[Gpu, BinaryIO]:
    """Wait until one of several GPUs is free, and return it with its lock.

    The GPU is taken until the lock is closed, or this process ends in any way. The lock files are
    empty. They lie in ``folder``, by default the machine's folder of temporary files.
    """
    folder = folder or Path(tempfile.gettempdir())
    has_told = False
    while True:
        with ExitStack() as stack:
            taken: list[BinaryIO] = []
            for gpu in gpus:
                name = re.sub(r"\W", "_", f"{gpu.variable}-{gpu.id}")
                path = folder / f"plenoforge-{name}.lock"
                lock = os.fdopen(_open_lock(path), "rb")
                if try_lock(lock):
                    return gpu, lock
                taken.append(stack.enter_context(lock))
            if not has_told:
                awaited = "the GPU" if len(gpus) == 1 else f"one of {len(gpus)} GPUs"
                tell_waiting(f"{awaited}: others render", taken)
            has_told = True
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
            raise OutsideError(f"{path}: cannot be locked: {error.strerror}; remove it") from None


# The lock of this process's GPU, which stays open until the process ends, and the seconds for which
# this process waited for it.
_locks: list[BinaryIO] = []
_waits: list[float] = []


def use_one(gpus: Sequence[Gpu]) -> None:
    """Take one of the ``gpus`` that no other process uses, until this process ends. May wait.

    CUDA and HIP see only this GPU from now on, if they have not looked for GPUs before. Does
    nothing if this process has taken one, or if its environment gave it a single GPU by a number,
    which may mean another GPU in another job.
    """
    if not gpus or _locks:
        return
    is_given = gpus[0].variable in os.environ
    if len(gpus) == 1 and is_given and gpus[0].id.isdecimal():
        return
    began = time.monotonic()
    gpu, lock = take(gpus)
    _waits.append(time.monotonic() - began)
    _locks.append(lock)
    os.environ[gpu.variable] = gpu.id


def waited_seconds() -> float:
    """Return for how long this process has waited for its GPU."""
    return sum(_waits)
