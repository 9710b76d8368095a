"""Render some views of a dataset in one process. Keep every view that is finished."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json of the dataset"
    )
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON that scripts/inventory.py wrote for the scene, which lists what rendering can "
        "leave out",
    )
    parser.add_argument(
        "--views",
        metavar="FIRST:END",
        default=":",
        help="which frames of lightfield.json, as a slice from 0, END excluded (default: all)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder to write the views to")
    parser.add_argument(
        "--record", type=Path, help="JSON to write: the sizes and checksums of the views"
    )
    parser.add_argument(
        "--journal",
        type=Path,
        help="file to which a JSON line is added for each view, with its time",
    )
    parser.add_argument(
        "--device",
        default="auto",
        choices=["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="device on which Cycles renders (default: auto)",
    )
    parser.add_argument("--threads", type=positive, help="CPU threads (default: all cores)")
    parser.add_argument(
        "--stall",
        type=int,
        default=0,
        metavar="S",
        help="seconds after which a view counts as hung and the process ends (default: 0, never)",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.formats.lightfield import LightField
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
