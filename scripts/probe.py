"""Estimate the time and size of a dataset's views from a few small views with all samples."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.core.files import write_json


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--inventory",
        required=True,
        type=Path,
        help="JSON that scripts/inventory.py wrote for the scene",
    )
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json of the dataset"
    )
    parser.add_argument(
        "--views", type=positive, default=3, help="number of views to render (default: 3)"
    )
    parser.add_argument(
        "--size",
        type=positive,
        default=48,
        help="longer side of these views, in pixels (default: 48)",
    )
    parser.add_argument(
        "--device", default="auto", help="device on which Cycles renders (default: auto)"
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.formats.lightfield import LightField
    from lightfield.rendering import probe

    measured = probe.measure(
        LightField.read(arguments.lightfield),
        arguments.views,
        arguments.size,
        arguments.blend,
        arguments.inventory,
        arguments.device,
    )
    write_json(arguments.output, measured)


if __name__ == "__main__":
    run(main)
