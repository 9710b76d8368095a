"""What the chosen datasets will take on this machine: views, hours and gigabytes."""

import math
from statistics import fmean
from typing import Any

from lightfield.core import processors
from lightfield.measurement.sampling import standard_error

HEAD = "| dataset | views | resolution | samples | s a view | hours | GB |"


def table(datasets: list[tuple[str, int, dict[str, Any]]]) -> str:
    """Return the table of (name, frames, probe), with the sums below."""
    lines = ["# What it will take", "", HEAD, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"]
    total_views, total_hours, total_bytes, variance = 0, 0.0, 0.0, 0.0
    for name, frames, probe in datasets:
        views = probe["views"] * frames
        seconds = probe["view_seconds"]
        error = standard_error(seconds)
        hours = views * fmean(seconds) / 3600
        size = views * fmean(probe["view_bytes"])
        width, height = probe["resolution"]
        lines.append(
            f"| {name} | {views} | {width} × {height} | {probe['samples']} "
            f"| {fmean(seconds):.0f} ± {error:.0f} | {hours:.0f} | {size / 1e9:.1f} |"
        )
        total_views += views
        total_hours += hours
        total_bytes += size
        variance += (views * error / 3600) ** 2
    lines.append(
        f"| all | {total_views} | | | | {total_hours:.0f} ± {math.sqrt(variance):.0f} "
        f"| {total_bytes / 1e9:.0f} |"
    )
    cores = processors.available()
    if all(probe["device"] == "CPU" for _, _, probe in datasets):
        days = total_hours / cores / 24
        lines += ["", f"Hours of one processor core; this machine's {cores} take {days:.1f} days."]
    else:
        lines += ["", "Hours of the graphics card."]
    lines += [
        "Measured on small views, with all their samples; ± is the standard error over these.",
        "",
    ]
    return "\n".join(lines)
