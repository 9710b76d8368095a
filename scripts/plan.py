"""Tell what the chosen datasets will take on this machine: views, hours and gigabytes.

Reads what scripts/probe.py has measured. Hours are those of one processor core, or of the graphics
card where that renders; gigabytes are those of the rendered views.
"""

import argparse
import math
import statistics
from pathlib import Path
from typing import Any

from lightfield.core import processors
from lightfield.core.cli import run
from lightfield.core.files import atomic_path, read_json

HEAD = "| dataset | views | resolution | samples | s a view | hours | GB |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--dataset",
        action="append",
        nargs=3,
        required=True,
        metavar=("NAME", "FRAMES", "PROBE"),
        help="scene/rig, how many frames it has, and its probe's JSON",
    )
    parser.add_argument("--output", required=True, type=Path, help="Markdown to write")
    arguments = parser.parse_args()
    text = table(
        [(name, int(frames), read_json(probe)) for name, frames, probe in arguments.dataset]
    )
    with atomic_path(arguments.output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(text, end="")


def table(datasets: list[tuple[str, int, dict[str, Any]]]) -> str:
    """Return the table of (name, frames, probe), with the sums below."""
    lines = ["# What it will take", "", HEAD, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"]
    total_views, total_hours, total_bytes, variance = 0, 0.0, 0.0, 0.0
    for name, frames, probe in datasets:
        views = probe["views"] * frames
        seconds = probe["view_seconds"]
        mean = statistics.mean(seconds)
        error = statistics.stdev(seconds) / math.sqrt(len(seconds)) if len(seconds) > 1 else 0.0
        hours = views * mean / 3600
        size = views * statistics.mean(probe["view_bytes"])
        width, height = probe["resolution"]
        lines.append(
            f"| {name} | {views} | {width} × {height} | {probe['samples']} "
            f"| {mean:.0f} ± {error:.0f} | {hours:.0f} | {size / 1e9:.1f} |"
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


if __name__ == "__main__":
    run(main)
