"""Estimates the cost of a dataset's views from probes: a few small views with all their samples.

The time of a sample hardly depends on the resolution. So the time of a full view follows from the
number of pixels. The size of its file follows likewise, as an upper estimate: smaller views have
more detail in a pixel, and compress worse.
"""

from pathlib import Path
from typing import Any

from lightfield.core.files import write_json
from lightfield.core.leftovers import temporary_folder
from lightfield.formats.lightfield import LightField
from lightfield.stages.measurement import Probe
from lightfield.stages.views import RenderShard
from lightfield.workflow import history


def write(job: Probe) -> None:
    """Write the estimate of a dataset's views."""
    write_json(job.output, _measured(job))


def _measured(job: Probe) -> dict[str, Any]:
    """Render the probes on one core, or on the device.

    Returns the dataset's ``views``, ``resolution``, ``samples`` and ``denoise``, and the
    ``device``, CPU or GPU.
    ``view_seconds`` and ``view_bytes`` are what each probe's view would take at full size.
    """
    lightfield = LightField.read(job.lightfield)
    views = lightfield.views
    lens = lightfield.lens
    small = lens.fitted(job.settings.size)
    count = job.settings.views
    # Render one more than are counted: the first is left out.
    step = max(1, len(views) // (count + 1))
    probes = lightfield.changed(lens=small, views=views[::step][: count + 1])
    with temporary_folder() as temporary:
        run = rendered(probes, job.blend, job.inventory, job.device, 1, temporary)
        sizes = []
        for view in run.later_views:
            files = temporary.rglob(f"{view['view']}.exr")
            sizes.append(sum(file.stat().st_size for file in files))
    # On a CPU count processor time, which does not depend on other processes.
    time_key = "cpu_seconds" if run.start["device"] == "CPU" else "render_seconds"
    factor = lens.width * lens.height / (small.width * small.height)
    return {
        "views": len(views),
        "resolution": [lens.width, lens.height],
        "samples": lightfield.render.samples,
        "denoise": lightfield.render.denoise,
        "device": run.start["device"],
        "view_seconds": [view[time_key] * factor for view in run.later_views],
        "view_bytes": [size * factor for size in sizes],
    }


def rendered(
    lightfield: LightField, blend: Path, inventory: Path, device: str, threads: int, folder: Path
) -> history.ProcessHistory:
    """Render a dataset into a new ``folder``. Return its run."""
    path = folder / "lightfield.json"
    lightfield.write(path)
    receipt = folder / "receipts/probe.jsonl"
    RenderShard(
        blend=blend,
        lightfield=path,
        inventory=inventory,
        output=folder / "exr",
        receipt=receipt,
        device=device,
        threads=threads,
    ).run()
    (run,) = history.read(receipt)
    return run
