"""Write a dataset's lightfield.json: its lens, the poses of its views, and how it is rendered.

The workflow gives the settings file of a dataset, in which the limits of the preset are applied. By
hand, --scene and --rig name a dataset at full size.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.core.cli import check_settings, run
from lightfield.core.errors import UserError


def main() -> None:
    arguments = parse()

    # Only now, so that --help need not wait for these.
    from lightfield.core import machine
    from lightfield.core.settings import read_settings
    from lightfield.dataset import passes
    from lightfield.dataset.capture import LightfieldSettings, panorama_rig
    from lightfield.dataset.lightfield import MACHINE, LightField
    from lightfield.dataset.loading import rig_dataset
    from lightfield.geometry import rigs
    from lightfield.measurement.sampling import calibrated

    if arguments.settings:
        settings = read_settings(LightfieldSettings, arguments.settings)
    else:
        dataset = rig_dataset(arguments.scene, arguments.rig)
        settings = LightfieldSettings.of_capture(dataset, flow=bool(dataset.flow))
    capture = settings.capture
    if arguments.inventory:
        capture = capture.resolved(arguments.inventory)
    elif capture.source.blend:
        raise UserError("--inventory: is missing; scripts/inventory.py writes it for a .blend")
    if arguments.model:
        capture = capture.of_model(arguments.model)
    elif capture.source.model:
        raise UserError("--model: is missing; scripts/import_model.py writes it")
    render = capture.render
    if settings.panorama_width:
        capture = replace(capture, rig=panorama_rig(capture.rig, settings.panorama_width))
        render = passes.without(render)
    else:
        render = with_groups(render, arguments.inventory)
    if isinstance(capture.rig, rigs.Random):
        if arguments.places is None:
            raise UserError("--places: is missing; scripts/free_places.py writes it")
        capture = replace(capture, rig=capture.rig.placed(arguments.places))
    if arguments.calibration:
        render = calibrated(render, arguments.calibration)
    keys = capture.origin(render)
    # Imported views were rendered on another machine.
    if not capture.imported:
        keys[MACHINE] = machine.describe(render["denoise"])
    lightfield = LightField.from_rig(capture.rig, capture.rig.camera.make(), **keys)
    if settings.flow:
        lightfield = lightfield.with_flow()
    if "camera_motion" in lightfield.render:
        lightfield = lightfield.with_exposure()
    lightfield.write(arguments.output)


def with_groups(render: dict[str, Any], inventory: Path | None) -> dict[str, Any]:
    """Return a ``render`` block with the emitters of each light group, by the scene's inventory."""
    from lightfield.dataset import light_groups
    from lightfield.dataset.inventory import read_inventory

    if "light_groups" not in render:
        return render
    if inventory is None:
        raise UserError("--inventory: is missing; scripts/inventory.py names the light groups")
    emitters = read_inventory(inventory, "emitters")["emitters"]
    return {**render, "light_groups": light_groups.resolved(render["light_groups"], emitters)}


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument(
        "--calibration",
        type=Path,
        help="JSON of scripts/calibrate.py, for a scene with target_error",
    )
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON of scripts/inventory.py, for a user's .blend, and for light_groups",
    )
    parser.add_argument("--model", type=Path, help="JSON of scripts/import_model.py, for a model")
    parser.add_argument(
        "--places", type=Path, help="JSON of scripts/free_places.py, for a random rig"
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
        help="name of a rig in the scene YAML; for a frame of a sequence with /f00001 behind it "
        "(default: the first)",
    )


if __name__ == "__main__":
    run(main)
