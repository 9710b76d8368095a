"""Render some views of a dataset in one process. Keep every view that is finished."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON of the scene's contents, to leave out what no pixel depends on",
    )
    parser.add_argument(
        "--views",
        metavar="FIRST:END",
        default=":",
        help="a slice of lightfield.json's frames (default: all of them)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder of the views")
    parser.add_argument("--record", type=Path, help="JSON of the views' sizes and checksums")
    parser.add_argument("--journal", type=Path, help="JSON lines with the time of each view")
    parser.add_argument(
        "--device",
        default="auto",
        choices=["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="device of Cycles (default: auto)",
    )
    parser.add_argument("--threads", type=positive, help="CPU threads (default: all cores)")
    parser.add_argument(
        "--stall",
        type=int,
        default=0,
        metavar="S",
        help="seconds after which a view counts as hung, and the process ends (default: 0, never)",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.dataset.lightfield import LightField
    from lightfield.rendering import shard

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
