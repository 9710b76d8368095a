"""Publish the checksums of a valid dataset. Fail with the first causes if it is not valid.

The checksums of an invalid dataset are removed, so that the next run validates it again.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_bytes

# So many failed checks are named, each with its first problem.
CAUSES = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--validation", required=True, type=Path, help="validation.json")
    parser.add_argument(
        "--page", required=True, type=Path, help="the dataset's page, for the message"
    )
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
    """Return the first problem of the first failed checks, and the number of other problems."""
    failed_checks = [check for check in validation["checks"] if check["passed"] is False]
    parts = [f"{check['name']}: {check['problems'][0]}" for check in failed_checks[:CAUSES]]
    other_problems = sum(len(check["problems"]) for check in failed_checks) - len(parts)
    if other_problems:
        parts.append(f"and {other_problems} more")
    return "; ".join(parts)


if __name__ == "__main__":
    run(main)
