"""Build a scene with one of the builders in scripts/scenes/ and save it as a .blend."""

import argparse
import importlib
import json
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import atomic_path
from lightfield.dataset import config
from lightfield.rendering import blend_file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--builder", required=True, choices=config.builders())
    parser.add_argument(
        "--parameters",
        type=json.loads,
        default='{"seed": 0, "detail": 1.0}',
        help="JSON: seed, detail (1 is full) and the builder's own (default: %(default)s)",
    )
    parser.add_argument("--output", required=True, type=Path, help=".blend to write")
    arguments = parser.parse_args()

    builder = importlib.import_module(f"scenes.{arguments.builder}")
    blend_file.new_scene()
    builder.build(arguments.parameters)
    with atomic_path(arguments.output) as temporary:
        blend_file.save_scene(temporary)


if __name__ == "__main__":
    run(main)
