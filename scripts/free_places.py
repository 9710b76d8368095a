"""Find places for the cameras of a random rig that have free space around them.

A settings file is JSON: {"rig": {"type": "random", "count": 9, "clearance": 0.5, "size": 4}}. `rig`
has the keys of the scene YAML. `frame`, `scene_name` and `view_layers` are those of the scene
YAML's `scene`.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene"
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import FreePlacesSettings
    from lightfield.core.settings import read_settings
    from lightfield.rendering import camera_files

    settings = read_settings(FreePlacesSettings, arguments.settings)
    camera_files.write_places(arguments.blend, settings, arguments.inventory, arguments.output)


if __name__ == "__main__":
    run(main)
