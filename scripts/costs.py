"""Add up what a dataset has cost, and estimate what it costs at full size: report/costs.json.

Times are in seconds, memory and sizes in bytes, and energy in kWh. Wall and processor time of the
views come from the journals of their shards. Journals survive kills. So they hold all the time that
was spent, also on views that were lost or rendered again. Any other job counts with the time and
memory of its last run, as Snakemake measured them. Snakemake measures every half second, and after
a while every 30 s. So the processor time may be too short by that much. A job that ends before the
first measurement counts as busy throughout.

    {
      "stages": [{"stage", "jobs", "wall_seconds", "cpu_seconds", "peak_memory_bytes", "bytes"}],
      "shards": [{"shard", "views", "wall_seconds", "cpu_seconds", "peak_memory_bytes",
                  "path_tracing_seconds",   Cycles' own render time of all its renderings
                  "overhead_seconds",       the rest of wall_seconds
                  "views_rendered",         renderings, repeated ones counted
                  "runs",                   processes that worked on it
                  "killed_runs",            those of them that did not end by themselves
                  "repeated_seconds"}],     spent again: views rendered again, later start-ups
      "path_tracing_seconds", "overhead_seconds", "repeated_seconds",   of all shards
      "device", "cores", "watts", "energy_kwh", "attribution",
      "extrapolation": {"views", "resolution", "samples", "core_hours", "core_hours_uncertainty",
                        "energy_kwh", "energy_kwh_uncertainty", "gigabytes", "basis"}
    }

Energy is the machine's wattage, times the wall time, times the busy part of its cores. The busy
part is processor time over wall time and number of cores. While a graphics card renders, the whole
machine counts. Waiting and idle time do not count.

The extrapolation multiplies each view's path-tracing time by the ratio of pixels and the ratio of
samples, and takes the mean. It assumes that the time is proportional to both. Denoising counts as
samples (see `lightfield.planning.sampling`). The uncertainty is the standard error of that mean
over the views. It has the correction for a finite number of views, sqrt(1 - n / N). It is null for
a single view. The rest of each view's time (writing, reprojection, validation) is proportional to
views and pixels. Everything else stays as it was. The first view of each process prepares the scene
for Cycles, so it counts for neither. Gigabytes are those of the rendered views, in proportion to
their pixels. They are an upper estimate, because larger views compress better. "device" and
"extrapolation" are null if no journal has a rendered view. That happens if the working folder was
deleted and the views were kept.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument(
        "--journals", required=True, type=Path, help="folder of the journals of its shards"
    )
    parser.add_argument(
        "--benchmarks",
        required=True,
        type=Path,
        help="folder of the benchmark files that Snakemake wrote for its jobs",
    )
    parser.add_argument(
        "--scene-benchmarks",
        required=True,
        nargs="+",
        type=Path,
        help="folders of the benchmark files that Snakemake wrote for the scene's jobs",
    )
    parser.add_argument("--blend", type=Path, help="the scene's .blend, if there is one")
    parser.add_argument(
        "--settings",
        required=True,
        type=Path,
        metavar="JSON",
        help="settings file with the keys energy (watts and cores), full "
        "(views and resolution of the full dataset, and samples and denoise if they differ), and "
        "reprojections (their names)",
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene"
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.scene_source import FILE
    from lightfield.core.settings import read_settings
    from lightfield.formats.inventory import read_inventory
    from lightfield.measurement import costs

    settings = read_settings(costs.CostSettings, arguments.settings)
    full = settings.full.model_dump()
    if full["samples"] == FILE:
        if arguments.inventory is None:
            raise UserError("--inventory: is missing; it has the samples of the .blend")
        full["samples"] = read_inventory(arguments.inventory, "blend")["blend"]["samples"]
    content = costs.costs(
        arguments.dataset,
        arguments.blend,
        arguments.journals,
        arguments.benchmarks,
        arguments.scene_benchmarks,
        costs.Power.read(settings.energy.model_dump()),
        full,
        settings.reprojections,
    )
    write_json(arguments.output, content)


if __name__ == "__main__":
    run(main)
