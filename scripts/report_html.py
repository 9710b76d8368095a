"""Make a dataset's page: one file that shows its views, their quality, and their cost.

The file contains everything, also the pictures. So you can read it offline, keep it, and send it.
Missing parts (measurements, depth, costs) are left out without an error. A settings file is JSON
with these keys: `rig`, as in the scene YAML; `yaml`, that file's text; `command`, which builds the
dataset again; `panorama`, whether the overview is a panorama; `measurements`, a list of {"file":
…}, the .csv, .json, .svg and .png that measurements wrote.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--name", required=True, help="name of the dataset, scene/rig")
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene"
    )
    parser.add_argument("--output", required=True, type=Path, help="HTML file to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import PageSettings
    from lightfield.core.settings import read_settings
    from lightfield.formats.inventory import read_inventory
    from lightfield.report import dataset_page

    settings = read_settings(PageSettings, arguments.settings)
    origin = dataset_page.Origin(
        rig=settings.rig,
        yaml=settings.yaml,
        command=settings.command,
        has_panorama=settings.panorama,
        measurements=[Path(measurement.file) for measurement in settings.measurements],
        inventory=read_inventory(arguments.inventory, "blend", "missing")
        if arguments.inventory
        else None,
    )
    dataset_page.write(arguments.output, arguments.dataset, arguments.name, origin)


if __name__ == "__main__":
    run(main)
