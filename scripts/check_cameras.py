"""Find cameras of a dataset that are inside geometry, or that would show it wrongly.

The workflow runs this before it renders.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json of the dataset"
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene"
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for it.
    from lightfield.rendering import camera_files

    camera_files.write_clearance(
        arguments.blend, arguments.lightfield, arguments.inventory, arguments.output
    )


if __name__ == "__main__":
    run(main)
