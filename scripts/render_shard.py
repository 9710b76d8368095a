"""Render a run of a dataset's views in one process, keeping every view that is already right."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.dataset.lightfield import LightField
from lightfield.rendering import shard


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON of what the scene contains: leaves out what its pixels do not depend on",
    )
    parser.add_argument(
        "--views",
        metavar="FIRST:END",
        default=":",
        help="a slice of lightfield.json's frames (default: all of them)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder of the views")
    parser.add_argument("--record", type=Path, help="JSON of the views' sizes and checksums")
    parser.add_argument("--journal", type=Path, help="JSON lines of what was rendered and how fast")
    parser.add_argument(
        "--device",
        default="auto",
        choices=["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="what Cycles renders on (default: auto)",
    )
    parser.add_argument("--threads", type=positive, help="CPU threads (default: all cores)")
    parser.add_argument(
        "--stall", type=int, default=0, metavar="S", help="seconds for a view, or it is killed"
    )
    arguments = parser.parse_args()
    shard.render(
        LightField.read(arguments.lightfield),
        arguments.views,
        arguments.output,
        blend=arguments.blend,
        inventory=arguments.inventory,
        device=arguments.device,
        threads=arguments.threads,
        record=arguments.record,
        journal=arguments.journal,
        stall=arguments.stall,
    )


if __name__ == "__main__":
    run(main)
