"""Write a finished dataset as it is published: WebDataset shards, and descriptions of them.

The descriptions are a card for Hugging Face, and Croissant. The scene YAML's key
`publish` says what only the author knows. The same files give the same bytes.

A settings file is JSON with the same keys as that of package.py.
"""

import argparse
from pathlib import Path

from lightfield.core import units
from lightfield.core.cli import above_zero, check_settings, run
from lightfield.core.errors import UserError
from lightfield.core.paths import place_in


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument(
        "--folder", type=Path, required=True, help="folder of a rig, with one or more datasets"
    )
    parser.add_argument("--output", type=Path, required=True, help="folder to write")
    add_settings_flags(parser)
    arguments = parser.parse_args()
    if place_in(arguments.folder, arguments.output):
        raise UserError(f"--output {arguments.output}: must not be in what it publishes")
    check_settings(arguments, add_settings_flags, "scene")

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import PackSettings
    from lightfield.report.publish import publish

    settings = PackSettings.given(arguments.settings, arguments.scene, arguments.gigabytes)
    name = arguments.output.resolve().name
    published = publish(
        arguments.folder, name, settings.scene, arguments.output, settings.most_bytes
    )
    files = published.files
    size = sum(file["bytes"] for file in files)
    print(f"{arguments.output}: {units.count(len(files), 'file')}, {units.size(size)}")


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument(
        "--scene", help="name of the file in configs/scenes/ that has the key publish"
    )
    flags.add_argument("--gigabytes", type=above_zero, help="largest size of a shard (default: 1)")


if __name__ == "__main__":
    run(main)
