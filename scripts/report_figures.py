"""Draw a dataset's pictures: an overview, the contact sheet, its rig in 3D, depth and noise.

Writes overview.png, contact_sheet.png, and rig, depth and noise as .svg and .png, into --output.
A settings file is JSON: {"rig": {"type": "plane", "cameras": [2, 2], …}}, as in the scene YAML.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--panorama",
        nargs="?",
        type=Path,
        help="EXR of a panorama from the rig's centre, for the overview (default: the view in the "
        "rig's middle)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import FiguresSettings
    from lightfield.core.settings import read_settings
    from lightfield.report import figures

    settings = read_settings(FiguresSettings, arguments.settings)
    figures.draw(arguments.dataset, settings.rig, arguments.panorama, arguments.output)


if __name__ == "__main__":
    run(main)
