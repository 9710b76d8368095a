"""Check a whole dataset: its files, its pixels, and that its views see the same world.

Prints a line for each failure. The exit status is then 1.

With --output and --sums, which the workflow gives, the exit status is 0 even for an invalid
dataset. The program then writes validation.json, and the checksums of all files that the dataset
publishes. scripts/publish_checksums.py makes them the sha256sums.txt of a valid dataset. Removes an
earlier sha256sums.txt first, and the hidden *.tmp files that a killed run has left.

A settings file is JSON: {"reprojections": ["perspective"], "exports": [], "records": []}, for the
flags --reprojection, --exports and --records.
"""

import argparse
import sys
from os.path import normpath
from pathlib import Path

from lightfield.core import leftovers
from lightfield.core.cli import check_settings, positive, run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.workflow import ledger


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("dataset", type=Path, help="folder of the dataset")
    add("--settings", type=Path, metavar="JSON", help="settings file")
    add("--output", type=Path, help="validation.json to write, with --sums")
    add("--sums", type=Path, help="list of checksums to write, with --output")
    add("--clearance", type=Path, help="JSON that scripts/check_cameras.py wrote for the dataset")
    add("--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene")
    add("--splits", type=Path, help="splits.json of the scene")
    add("--ledger", type=Path, help="the workflow's ledger, which lists what its jobs made")
    add(
        "--removed",
        type=Path,
        help="folder to which files that do not belong to the dataset are moved",
    )
    add("--processes", type=positive, default=1, help="number of worker processes (default: 1)")
    add_settings_flags(parser)
    arguments = parser.parse_args()
    if (arguments.output is None) != (arguments.sums is None):
        raise UserError("--output, --sums: go together")
    if not arguments.dataset.is_dir():
        raise UserError(f"{arguments.dataset}: no such folder")

    check_settings(arguments, add_settings_flags)
    check(arguments)


def check(arguments: argparse.Namespace) -> None:
    """Check the dataset. Raises `UserError` if it is not valid and no --output says so."""
    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import ValidationSettings
    from lightfield.core.settings import read_settings
    from lightfield.export import MANIFESTS
    from lightfield.formats.layout import REPORT, SUMS, write_sums
    from lightfield.formats.lightfield import NAME
    from lightfield.validation.files import remove_strays
    from lightfield.validation.validate import validate

    if arguments.settings:
        settings = read_settings(ValidationSettings, arguments.settings)
    else:
        settings = ValidationSettings.of(
            reprojections=arguments.reprojection,
            exports=arguments.exports,
            records=arguments.records,
        )
    reprojections = [normpath(name) for name in settings.reprojections]
    if arguments.output:
        (arguments.dataset / SUMS).unlink(missing_ok=True)
        # The report is made meanwhile.
        leftovers.remove_unfinished(arguments.dataset, age=0, excluded=REPORT)
    elif not reprojections:
        lightfields = sorted(arguments.dataset.glob(f"*/{NAME}"))
        reprojections = [path.parent.name for path in lightfields]
    wanted = settings.exports and [Path(path).resolve() for path in settings.exports]
    if arguments.removed:
        remove_strays(arguments.dataset, reprojections, MANIFESTS, arguments.removed, wanted)
    result = validate(
        arguments.dataset,
        reprojections,
        [Path(record) for record in settings.records],
        arguments.clearance,
        arguments.inventory,
        arguments.processes,
        MANIFESTS,
        arguments.splits,
        wanted,
        noted_sums(arguments.ledger, arguments.dataset) if arguments.ledger else None,
    )
    print(result.summary())
    for line in result.failures():
        print(line, file=sys.stderr)
    if arguments.output:
        write_json(arguments.output, result.to_json())
        write_sums(arguments.sums, result.checksums, arguments.dataset, arguments.output)
    elif not result.valid:
        raise UserError(f"{arguments.dataset}: is not valid")


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    add = flags.add_argument
    records = "records with the sizes and checksums with which images were written"
    add("--records", nargs="*", default=[], help=records)
    folders = "reprojections, by their folders in the dataset (default without --output: all)"
    add("--reprojection", action="extend", nargs="+", default=[], help=folders)
    lists = (
        "export.json or transforms.json of each export that the dataset must have (default: any)"
    )
    add("--exports", nargs="*", help=lists)


def noted_sums(path: Path, dataset: Path) -> dict[str, str]:
    """Return the SHA-256 that the ledger has of the dataset's files, by their path in it."""
    prefix = f"{dataset}/"
    return {
        name.removeprefix(prefix): digest
        for name, digest in ledger.read(path).items()
        if name.startswith(prefix)
    }


if __name__ == "__main__":
    run(main)
