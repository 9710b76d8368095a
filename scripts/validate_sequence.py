"""Check the exports of a whole sequence: that each frame has its own cameras, depth and time.

Prints a line for each failure. The exit status is then 1. For a valid sequence, --output writes
validation.json, and --sums the checksums of the exports. The frames are datasets of their own,
which validate.py checks.

A settings file is JSON: {"frames": ["f00001", "f00002"], "exports": []}. Its paths are those of the
working folder.
"""

import argparse
import sys
from pathlib import Path

from lightfield.core.cli import check_settings, run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("rig", type=Path, help="folder of the rig, which holds the folders of the frames")
    add("--settings", type=Path, metavar="JSON", help="settings file")
    add("--output", type=Path, help="validation.json to write, with --sums")
    add("--sums", type=Path, help="sha256sums.txt to write, with --output")
    add(
        "--removed",
        type=Path,
        help="folder to which files that do not belong to the sequence are moved",
    )
    add_settings_flags(parser)
    arguments = parser.parse_args()
    if (arguments.output is None) != (arguments.sums is None):
        raise UserError("--output, --sums: go together")
    if not arguments.rig.is_dir():
        raise UserError(f"{arguments.rig}: no such folder")
    check_settings(arguments, add_settings_flags)

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import SequenceValidationSettings
    from lightfield.core.settings import read_settings
    from lightfield.export import IN_FOLDERS
    from lightfield.formats.layout import write_sums
    from lightfield.validation.sequence import (
        export_lists,
        frame_folders,
        remove_strays,
        validate_sequence,
    )

    if arguments.settings:
        settings = read_settings(SequenceValidationSettings, arguments.settings)
    else:
        settings = SequenceValidationSettings.of(exports=arguments.exports)
    frames = settings.frames or frame_folders(arguments.rig)
    lists = export_lists(arguments.rig)
    if settings.exports is not None:
        lists = [Path(path) for path in settings.exports]
    sequence = (arguments.rig, frames, lists, IN_FOLDERS)
    if arguments.removed:
        remove_strays(*sequence, arguments.removed)
    result = validate_sequence(*sequence)
    print(result.summary())
    for line in result.failures():
        print(line, file=sys.stderr)
    if not result.valid:
        raise UserError(f"{arguments.rig}: the exports of its sequence are not valid")
    if arguments.output:
        write_json(arguments.output, result.to_json())
        write_sums(arguments.sums, result.checksums, arguments.rig, arguments.output)


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    lists = "export.json of each export that the sequence must have (default: any)"
    flags.add_argument("--exports", nargs="*", help=lists)


if __name__ == "__main__":
    run(main)
