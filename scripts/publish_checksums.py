"""Publish the checksums of a valid dataset. Fail with the first reasons if it is not valid.

The checksums of an invalid dataset are removed, so that the next run validates it again.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_bytes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--validation", required=True, type=Path, help="validation.json of the dataset"
    )
    parser.add_argument(
        "--page", required=True, type=Path, help="page of the dataset, to name in the error message"
    )
    parser.add_argument(
        "--sums", required=True, type=Path, help="checksums that scripts/validate.py wrote"
    )
    parser.add_argument("--output", required=True, type=Path, help="sha256sums.txt to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for it.
    from lightfield.validation.result import causes

    validation = read_keys(arguments.validation, "validate.py", "valid", "dataset", "checks")
    if not validation["valid"]:
        arguments.sums.unlink()
        raise UserError(
            f"{validation['dataset']} is not valid: {causes(validation)}: see {arguments.page}"
        )
    write_bytes(arguments.output, arguments.sums.read_bytes())


if __name__ == "__main__":
    run(main)
