"""Publish a dataset's checksums if its validation found it valid; else fail with the first causes.

Of a dataset that is not valid the checksums are removed: they are of what has to be mended, and
the next run, which misses them, validates again.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_bytes

# So many failed checks are named, each by the first thing that is wrong.
CAUSES = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--validation", required=True, type=Path, help="validation.json")
    parser.add_argument("--page", required=True, type=Path, help="the dataset's page, to be named")
    parser.add_argument("--sums", required=True, type=Path, help="checksums that validation wrote")
    parser.add_argument("--output", required=True, type=Path, help="sha256sums.txt to write")
    arguments = parser.parse_args()

    validation = read_keys(arguments.validation, "validate.py", "valid", "dataset", "checks")
    if not validation["valid"]:
        arguments.sums.unlink()
        raise UserError(
            f"{validation['dataset']} is not valid: {causes(validation)}: see {arguments.page}"
        )
    write_bytes(arguments.output, arguments.sums.read_bytes())


def causes(validation: Mapping[str, Any]) -> str:
    """Return the first problem of the first failed checks, and how many more there are."""
    failed = [check for check in validation["checks"] if check["passed"] is False]
    named = [f"{check['name']}: {check['problems'][0]}" for check in failed[:CAUSES]]
    more = sum(len(check["problems"]) for check in failed) - len(named)
    return "; ".join([*named, f"and {more} more"] if more else named)


if __name__ == "__main__":
    run(main)
