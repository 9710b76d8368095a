"""How many threads a process: many processes of one thread each at once, or fewer of more."""

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
from lightfield.dataset import memory
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.lightfield import LightField
from lightfield.rendering import probe

# Of the longer side in pixels, and of a pixel: some seconds a view, of which little is overhead.
SIZE, SAMPLES = 256, 16
# Of each process; the first one is not counted beside others.
VIEWS = 3


def tried(
    lightfield: LightField, blend: Path, inventory: Path, device: str, cores: int, name: str
) -> list[dict[str, Any]]:
    """Render views on all ``cores``, each process with one thread, with two, and so on to all.

    Returns of each number of ``threads`` how many ``processes`` ran at once, the seconds of a core
    that a view took (``view_core_seconds``) and a process until its first view was done
    (``start_up_core_seconds``), idle threads counted, and their ``memory_bytes`` together. Nothing
    on a GPU, which one process has, and on one core; what does not fit into memory is left out.
    """
    small = lightfield.lens.fitted(SIZE)
    render = {**lightfield.render, "samples": SAMPLES, "adaptive_threshold": 0}
    views = lightfield.views[:: max(1, len(lightfield.views) // VIEWS)][:VIEWS]
    probes = lightfield.changed(lens=small, views=views, render=render)
    scene = read_inventory(inventory, "memory_bytes")["memory_bytes"]
    need = memory.needed(scene, small.width * small.height, render["denoise"])
    fewest = memory.threads(cores, cores, need, available())
    counts = [n for n in range(fewest, cores + 1) if cores % n == 0]
    if len(counts) < 2:
        return []
    progress = Progress(len(counts), f"{name}: threads a process", "numbers")
    found = []
    # One process first: where it finds itself on a GPU, no more are started there.
    for threads in reversed(counts):
        with (
            temporary_folder() as temporary,
            ProcessPoolExecutor(cores // threads, get_context("spawn")) as pool,
        ):
            words = (probes, blend, inventory, device, threads)
            started = [
                pool.submit(probe.rendered, *words, temporary / str(number))
                for number in range(cores // threads)
            ]
            try:
                runs = [run.result() for run in started]
            except BrokenProcessPool:
                raise UserError(
                    f"{name}: one of {len(started)} process(es) that render it was killed; "
                    f"most likely memory ran out: {LESS_MEMORY}"
                ) from None
        if runs[0].start["device"] != "CPU":
            return []
        seconds = [view["wall_seconds"] for run in runs for view in run.later_views]
        starts = [run.start["start_up_seconds"] + run.views[0]["wall_seconds"] for run in runs]
        found.append(
            {
                "threads": threads,
                "processes": len(runs),
                "view_core_seconds": threads * fmean(seconds),
                "start_up_core_seconds": threads * fmean(starts),
                "memory_bytes": sum(run.peak_memory_bytes for run in runs),
            }
        )
        progress.done()
    return found[::-1]
