"""Add up what a dataset has cost, and what the full one would: report/costs.json."""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.settings import read_settings
from lightfield.dataset.config import FILE
from lightfield.dataset.inventory import read_inventory
from lightfield.measurement import costs


def main() -> None:
    parser = argparse.ArgumentParser(
        description=costs.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--journals", required=True, type=Path, help="folder of its journals")
    parser.add_argument(
        "--benchmarks", required=True, type=Path, help="folder of its jobs' benchmark files"
    )
    parser.add_argument(
        "--scene-benchmarks",
        required=True,
        nargs="+",
        type=Path,
        help="folders of the benchmark files of the scene's jobs",
    )
    parser.add_argument("--blend", type=Path, help="the scene, if there is one")
    parser.add_argument(
        "--settings",
        required=True,
        type=Path,
        metavar="JSON",
        help="energy (watts, price_per_kwh, currency and cores), full (views and resolution of the "
        "full dataset, and samples and denoise if they differ), and names of reprojections",
    )
    parser.add_argument("--inventory", type=Path, help="JSON of the scene's contents")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()
    settings = read_settings(costs.CostSettings, arguments.settings)
    full = settings.full.model_dump()
    if full["samples"] == FILE:
        if arguments.inventory is None:
            raise UserError("--inventory: is missing; it has the samples of the .blend")
        full["samples"] = read_inventory(arguments.inventory, "blend")["blend"]["samples"]
    content = costs.costs(
        arguments.dataset,
        arguments.blend,
        arguments.journals,
        arguments.benchmarks,
        arguments.scene_benchmarks,
        costs.Tariff.read(settings.energy.model_dump()),
        full,
        settings.reprojections,
    )
    write_json(arguments.output, content)


if __name__ == "__main__":
    run(main)
