"""Make a dataset's page: one file that shows what it looks like, how good it is, what it cost.

Everything is in the file, pictures too, so that it can be read without a network, kept and sent.
What is not there (measurements that were not asked for, depth, costs) is left out, and is no error.
"""

import argparse
import json
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import read_text
from lightfield.dataset.inventory import read_inventory
from lightfield.geometry import rigs
from lightfield.report import dataset_page


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--name", required=True, help="how it is called: scene/rig")
    parser.add_argument("--rig", required=True, type=json.loads, help="the scene YAML's rig, JSON")
    parser.add_argument("--yaml", required=True, type=Path, help="the scene YAML, to be shown")
    parser.add_argument("--command", required=True, help="what rebuilds the dataset, to be shown")
    parser.add_argument(
        "--panorama",
        nargs="?",
        help="what the overview was made of, where it is not the view in the rig's middle",
    )
    parser.add_argument(
        "--measurements",
        type=Path,
        nargs="*",
        default=[],
        help="files that the measurements wrote: .csv, .json, and plots .svg or .png",
    )
    parser.add_argument("--inventory", type=Path, help="JSON of what the scene's .blend says")
    parser.add_argument("--output", required=True, type=Path, help="HTML file to write")
    arguments = parser.parse_args()
    origin = dataset_page.Origin(
        rig=rigs.from_settings(arguments.rig),
        yaml=read_text(arguments.yaml),
        command=arguments.command,
        has_panorama=bool(arguments.panorama),
        measurements=arguments.measurements,
        inventory=read_inventory(arguments.inventory, "blend", "missing")
        if arguments.inventory
        else None,
    )
    dataset_page.write(arguments.output, arguments.dataset, arguments.name, origin)


if __name__ == "__main__":
    run(main)
