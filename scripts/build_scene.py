"""Build a scene with one of the builders in scripts/scenes/ and save it as a .blend."""

import argparse
import importlib
import json
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import atomic_path
from lightfield.core.settings import checked
from lightfield.dataset import config
from lightfield.rendering import blend_file

# isort: split
from pydantic import TypeAdapter


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--builder", required=True, choices=config.builders())
    parser.add_argument(
        "--parameters",
        type=json.loads,
        default={},
        help="JSON: seed (default: 0) and detail (default: 1, full)",
    )
    parser.add_argument("--output", required=True, type=Path, help=".blend to write")
    arguments = parser.parse_args()

    parameters = checked(TypeAdapter(config.Parameters), arguments.parameters, "--parameters")
    builder = importlib.import_module(f"scenes.{arguments.builder}")
    blend_file.new_scene()
    builder.build(parameters.model_dump())
    with atomic_path(arguments.output) as temporary:
        blend_file.save_scene(temporary)


if __name__ == "__main__":
    run(main)
