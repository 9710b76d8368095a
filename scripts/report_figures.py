"""Draw a dataset's pictures: an overview, the contact sheet, its rig in 3D, depth and noise.

Writes overview.png, contact_sheet.png, and rig, depth and noise as .svg and .png, into --output.
"""

import argparse
import json
from pathlib import Path

from lightfield.core.cli import run
from lightfield.geometry import rigs
from lightfield.report import figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--rig", required=True, type=json.loads, help="the scene YAML's rig, JSON")
    parser.add_argument(
        "--panorama",
        nargs="?",
        type=Path,
        help="EXR seen from the rig's centre (default: the view in its middle is the overview)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder to write to")
    arguments = parser.parse_args()
    rig = rigs.from_settings(arguments.rig)
    figures.draw(arguments.dataset, rig, arguments.panorama, arguments.output)


if __name__ == "__main__":
    run(main)
