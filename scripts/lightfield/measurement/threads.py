"""Compares many processes of one thread each with fewer processes of more threads.

Pictures do not change with the threads, so there is no reference here. Views are rendered as in a
shard, in processes of their own. Only their times are compared.
"""

from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.failures import LESS_MEMORY
from lightfield.core.leftovers import temporary_folder
from lightfield.core.memory import available
from lightfield.core.progress import Progress
from lightfield.dataset import journal, memory
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.lightfield import LightField
from lightfield.rendering import probe

# The longer side of the views, and the samples of a pixel. A view takes a few seconds, with little
# overhead.
SIZE = 256
SAMPLES = 16
# Each process renders this many views. The first one does not count as a later view.
VIEWS = 3


def measure(
    lightfield: LightField, blend: Path, inventory: Path, device: str, cores: int, name: str
) -> list[dict[str, Any]]:
    """Render views on all ``cores``: each process with one thread, with two, and so on to all.

    Returns an entry for each number of ``threads``:

    - ``processes``: how many ran at once.
    - ``memory_bytes``: their memory together.
    - ``view_core_seconds``: the seconds of a core that a view took.
    - ``start_up_core_seconds``: those until a process had its first view.

    Idle threads count. Leaves out numbers of processes that do not fit into memory. Returns nothing
    on one core, and on a GPU, which has one process. Raises `UserError` if a process is killed.
    """
    probes = small_views(lightfield)
    scene = read_inventory(inventory, "memory_bytes")["memory_bytes"]
    pixels = probes.lens.width * probes.lens.height
    need = memory.needed(scene, pixels, probes.render["denoise"])
    fewest = memory.threads(cores, cores, need, available())
    counts = [n for n in range(fewest, cores + 1) if cores % n == 0]
    if len(counts) < 2:
        return []
    progress = Progress(len(counts), f"{name}: threads a process", "numbers")
    entries = []
    # Begin with one process: if it renders on a GPU, start no more.
    for threads in reversed(counts):
        runs = rendered_at_once(probes, blend, inventory, device, threads, cores // threads, name)
        if runs[0].start["device"] != "CPU":
            return []
        entries.append(core_seconds(runs, threads))
        progress.done()
    return entries[::-1]


def small_views(lightfield: LightField) -> LightField:
    """Return some small views of a dataset, with few samples."""
    render = {**lightfield.render, "samples": SAMPLES, "adaptive_threshold": 0}
    views = lightfield.views[:: max(1, len(lightfield.views) // VIEWS)][:VIEWS]
    return lightfield.changed(lens=lightfield.lens.fitted(SIZE), views=views, render=render)


def rendered_at_once(
    probes: LightField,
    blend: Path,
    inventory: Path,
    device: str,
    threads: int,
    processes: int,
    name: str,
) -> list[journal.Run]:
    """Render the views in several processes at once. Return the run of each from its journal."""
    with (
        temporary_folder() as temporary,
        ProcessPoolExecutor(processes, get_context("spawn")) as pool,
    ):
        started = [
            pool.submit(
                probe.rendered, probes, blend, inventory, device, threads, temporary / str(number)
            )
            for number in range(processes)
        ]
        try:
            return [run.result() for run in started]
        except BrokenProcessPool:
            raise UserError(
                f"{name}: one of {processes} process(es) that render it was killed; "
                f"most likely memory ran out: {LESS_MEMORY}"
            ) from None


def core_seconds(runs: list[journal.Run], threads: int) -> dict[str, Any]:
    """Return the entry of processes that ran at once with ``threads`` threads each."""
    views = [view["wall_seconds"] for run in runs for view in run.later_views]
    starts = [run.start["start_up_seconds"] + run.views[0]["wall_seconds"] for run in runs]
    return {
        "threads": threads,
        "processes": len(runs),
        "view_core_seconds": threads * fmean(views),
        "start_up_core_seconds": threads * fmean(starts),
        "memory_bytes": sum(run.peak_memory_bytes for run in runs),
    }
