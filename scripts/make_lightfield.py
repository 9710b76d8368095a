"""Write a dataset's lightfield.json: its lens, the poses of its views, and how it is rendered."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

from lightfield.core import machine
from lightfield.core.cli import positive, run
from lightfield.core.errors import UserError
from lightfield.core.settings import checked
from lightfield.dataset import passes
from lightfield.dataset.config import Preset
from lightfield.dataset.dataset import Dataset
from lightfield.dataset.lightfield import MACHINE, LightField
from lightfield.dataset.loading import scene_datasets
from lightfield.geometry import rigs
from lightfield.measurement.sampling import calibrated

# isort: split
from pydantic import TypeAdapter


def main() -> None:
    arguments = parse()
    dataset = chosen_dataset(arguments)
    render = dataset.render
    if arguments.panorama:
        dataset = replace(dataset, rig=panorama_rig(dataset.rig, arguments.panorama))
        render = passes.without(render)
    elif isinstance(dataset.rig, rigs.Random):
        if arguments.places is None:
            raise UserError("--places: is missing; scripts/free_places.py writes it")
        dataset = replace(dataset, rig=dataset.rig.placed(arguments.places))
    if arguments.calibration:
        render = calibrated(render, arguments.calibration)
    keys = dataset.origin(render)
    # Imported views were rendered on another machine.
    if not dataset.imported:
        keys[MACHINE] = machine.describe(render["denoise"])
    lightfield = LightField.from_rig(dataset.rig, dataset.rig.camera.make(), **keys)
    if dataset.flow and not arguments.panorama:
        lightfield = lightfield.with_flow()
    lightfield.write(arguments.output)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="name of a file in configs/scenes/")
    parser.add_argument(
        "--rig",
        help="name of a rig in the scene YAML; /f00001 after it chooses a frame of a sequence "
        "(default: the first)",
    )
    parser.add_argument(
        "--limits",
        type=json.loads,
        default={},
        help="JSON of a preset's limits, as in config.yaml (default: none, the full size)",
    )
    parser.add_argument(
        "--panorama",
        type=positive,
        metavar="WIDTH",
        help="instead of the rig, one equirectangular view from its centre, WIDTH pixels wide",
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        help="JSON of scripts/calibrate.py, for a scene with target_error",
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON of scripts/inventory.py, for a user's .blend"
    )
    parser.add_argument(
        "--places", type=Path, help="JSON of scripts/free_places.py, for a random rig"
    )
    parser.add_argument("--output", required=True, type=Path, help="lightfield.json to write")
    return parser.parse_args()


def chosen_dataset(arguments: argparse.Namespace) -> Dataset:
    """Return the dataset of --scene and --rig, with the values of a .blend from its inventory.

    Raises `UserError` for a rig that the scene lacks, and for a .blend without an inventory.
    """
    limits = checked(TypeAdapter(Preset), arguments.limits, "--limits")
    datasets = scene_datasets(arguments.scene, limits=limits)
    dataset = next((d for d in datasets if arguments.rig in (None, d.rig_folder)), None)
    if dataset is None:
        rig_names = ", ".join(d.rig_folder for d in datasets)
        raise UserError(f"--rig: is {arguments.rig!r}; must be one of {rig_names}")
    if arguments.inventory:
        return dataset.resolved(arguments.inventory)
    if dataset.source.blend:
        raise UserError("--inventory: is missing; scripts/inventory.py writes it for a .blend")
    return dataset


def panorama_rig(rig: rigs.Rig, width: int) -> rigs.Rig:
    """Return a rig of one full equirectangular view, level, at the centre of ``rig``."""
    return rigs.from_settings(
        {
            "type": "lattice",
            "cameras": [1, 1, 1],
            "center": rig.center,
            "camera": {"lens": "equirectangular", "resolution": [width, width // 2]},
        }
    )


if __name__ == "__main__":
    run(main)
