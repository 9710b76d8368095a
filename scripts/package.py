"""Pack a finished dataset as tar archives with a card. The same files give the same bytes.

A settings file is JSON: {"gigabytes": 4, "scene": {"licence": "CC0-1.0"}}. `gigabytes` is the
largest size of a part. `scene` has the keys description, licence and credit of the scene YAML.
"""

import argparse
from pathlib import Path

from lightfield.core import units
from lightfield.core.cli import above_zero, check_settings, run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.paths import place_in


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument(
        "--folder", type=Path, required=True, help="folder of a rig, with one or more datasets"
    )
    parser.add_argument(
        "--output",
        type=Path,
        required=True,
        help="archive to write, <scene>_<rig>.tar; a .json is written beside it",
    )
    add_settings_flags(parser)
    arguments = parser.parse_args()
    if arguments.output.suffix != ".tar":
        raise UserError(f"--output {arguments.output}: must end in .tar; .json lies beside it")
    if place_in(arguments.folder, arguments.output):
        raise UserError(f"--output {arguments.output}: must not be in what it packs")
    check_settings(arguments, add_settings_flags, "scene")

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import PackSettings
    from lightfield.report import package
    from lightfield.workflow.view_store import ViewStore

    settings = PackSettings.given(arguments.settings, arguments.scene, arguments.gigabytes)
    card = package.card(arguments.folder, arguments.output.stem, settings.scene)
    written = package.pack(arguments.folder, card, arguments.output, settings.most_bytes)
    parts = package.listed(written)
    card_path = arguments.output.with_suffix(".json")
    write_json(card_path, {**card, "parts": parts})
    store = ViewStore.configured()
    if store:
        # The job declares the first part alone.
        store.put_list(card_path, written[1:])
    size = sum(part["bytes"] for part in parts)
    print(f"{arguments.output}: {units.count(len(parts), 'part')}, {units.size(size)}")


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument(
        "--scene", help="name of the file in configs/scenes/ that gives the licence and credit"
    )
    flags.add_argument(
        "--gigabytes", type=above_zero, help="largest size of a part (default: no limit, one part)"
    )


if __name__ == "__main__":
    run(main)
