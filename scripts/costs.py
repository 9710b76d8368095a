"""Add up what a dataset has cost, and estimate what it costs at full size: report/costs.json.

Times are in seconds, memory and sizes in bytes, and energy in kWh. Wall and processor time of the
views come from the history in the receipts of their shards. It survives kills, so it holds all the
time that was spent, also on views that were lost or rendered again. Any other job counts with the
time and memory of its last run, as Snakemake measured them. Snakemake measures every half second,
and after a while every 30 s. So the processor time may be too short by that much. A job that ends
before the first measurement counts as busy throughout.

    {
      "stages": [{"stage", "jobs", "wall_seconds", "cpu_seconds", "peak_memory_bytes", "bytes"}],
      "shards": [{"shard", "views", "wall_seconds", "cpu_seconds", "peak_memory_bytes",
                  "path_tracing_seconds",   Cycles' own render time of all its renderings
                  "overhead_seconds",       the rest of wall_seconds
                  "views_rendered",         renderings, repeated ones counted
                  "runs",                   processes that worked on it
                  "killed_runs",            runs among them that did not end by themselves
                  "repeated_seconds"}],     spent again: views rendered again, later start-ups
      "path_tracing_seconds", "overhead_seconds", "repeated_seconds",   of all shards
      "device", "cores", "watts", "energy_kwh", "attribution",
      "extrapolation": {"views", "resolution", "samples", "core_hours", "rendering_hours",
                        "core_hours_uncertainty", "energy_kwh", "energy_kwh_uncertainty",
                        "gigabytes", "rendering", "basis"}
    }

Energy is the machine's wattage, times the wall time, times the busy part of its cores. The busy
part is processor time over wall time and number of cores. While a graphics card renders, the whole
machine counts. Waiting and idle time do not count.

The hours of rendering come from the sharpest measurement that is known: finished views of the full
dataset, its probe, a GPU check, or the views of this dataset (see `lightfield.planning.estimate`).
"rendering" says which. Views of another size count in proportion to pixels and samples. Denoising
counts as samples. The uncertainty is the standard error of the mean over the views. It has the
correction for a finite number of views, sqrt(1 - n / N). It is null for a single view. The rest of
each view's time (reprojection, validation) is proportional to views and pixels. Everything else
stays as it was. The first view of each process prepares the scene for Cycles, so it counts for
neither. Gigabytes are the size of the rendered views, in proportion to their pixels. They are an
upper estimate, because larger views compress better. "device" and "extrapolation" are null if no
receipt has a rendered view. That happens if the working folder was deleted and the views were kept.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import Costs

if __name__ == "__main__":
    program(Costs, __doc__)
