"""Write a dataset's lightfield.json: its lens, the poses of its views, and how it is rendered.

The workflow gives a settings file, in which the limits of the preset are already applied. By hand,
give --scene and --rig instead, for a dataset at full size.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import check_settings, run


def main() -> None:
    arguments = parse()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.capture import LightfieldSettings
    from lightfield.core.settings import read_settings
    from lightfield.planning.sampling import calibrated
    from lightfield.workflow import lightfield_file
    from lightfield.workflow.loading import rig_dataset

    if arguments.settings:
        settings = read_settings(LightfieldSettings, arguments.settings)
    else:
        dataset = rig_dataset(arguments.scene, arguments.rig)
        settings = LightfieldSettings.of_capture(dataset, flow=bool(dataset.flow))
    if arguments.calibration:
        render = calibrated(settings.render, arguments.calibration)
        settings = settings.model_copy(update={"render": render})
    lightfield = lightfield_file.from_settings(
        settings, arguments.inventory, arguments.model, arguments.places
    )
    lightfield.write(arguments.output)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument(
        "--calibration",
        type=Path,
        help="JSON that scripts/calibrate.py wrote, for a scene with target_error",
    )
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON that scripts/inventory.py wrote, for a user's .blend and for light_groups",
    )
    parser.add_argument(
        "--model", type=Path, help="JSON that scripts/import_model.py wrote, for a model"
    )
    parser.add_argument(
        "--places", type=Path, help="JSON that scripts/free_places.py wrote, for a random rig"
    )
    parser.add_argument("--output", required=True, type=Path, help="lightfield.json to write")
    add_settings_flags(parser)
    arguments = parser.parse_args()
    check_settings(arguments, add_settings_flags, "scene")
    return arguments


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument("--scene", help="name of a file in configs/scenes/")
    flags.add_argument(
        "--rig",
        help="name of a rig in the scene YAML (default: the first rig); for a frame of a sequence, "
        "add its folder, as in rig/f00001",
    )


if __name__ == "__main__":
    run(main)
