"""Pack a finished dataset as tar archives with a card: the same bytes whoever packs it."""

import argparse
from pathlib import Path

from lightfield.core.cli import above_zero, run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.dataset.config import load_scene
from lightfield.report import package


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="name of a file in configs/scenes/")
    parser.add_argument("--folder", type=Path, required=True, help="of the rig's dataset, or more")
    parser.add_argument(
        "--gigabytes", type=above_zero, help="size of a part, at most (default: one)"
    )
    parser.add_argument("--output", type=Path, required=True, help="<scene>_<rig>.tar, and .json")
    arguments = parser.parse_args()
    if arguments.output.suffix != ".tar":
        raise UserError(f"--output {arguments.output}: must end in .tar; .json lies beside it")
    if arguments.output.resolve().is_relative_to(arguments.folder.resolve()):
        raise UserError(f"--output {arguments.output}: must not be in what it packs")
    card = package.card(arguments.folder, arguments.output.stem, load_scene(arguments.scene))
    most = arguments.gigabytes and arguments.gigabytes * 1e9
    parts = package.listed(package.pack(arguments.folder, card, arguments.output, most))
    write_json(arguments.output.with_suffix(".json"), {**card, "parts": parts})
    print(f"{arguments.output}: {len(parts)} parts, {sum(p['bytes'] for p in parts) / 1e9:.3g} GB")


if __name__ == "__main__":
    run(main)
