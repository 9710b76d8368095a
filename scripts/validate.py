"""Check a dataset whole: its files, its pixels, and that its views see the same world.

Writes validation.json and, if the dataset is valid, sha256sums.txt, which
`sha256sum -c sha256sums.txt` in the dataset's folder accepts. An invalid dataset gives one line a
failure and exit status 1. What a killed run left half-written in the dataset (hidden *.tmp files)
is removed first.
"""

import argparse
import sys
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, sha256, write_json
from lightfield.validation.validation import REPORT, validate

# A check that fails in more places than this is told by its first ones; validation.json has all.
_LINES_A_CHECK = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--output", required=True, type=Path, help="validation.json to write")
    parser.add_argument("--sums", required=True, type=Path, help="sha256sums.txt to write")
    parser.add_argument(
        "--records",
        type=Path,
        nargs="*",
        default=[],
        help="JSON of the sizes and checksums with which images were written",
    )
    parser.add_argument("--clearance", type=Path, help="JSON of what surrounds each camera")
    parser.add_argument(
        "--reprojection",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME",
        help="folders of the dataset that hold a reprojection",
    )
    parser.add_argument("--processes", type=int, default=1, help="worker processes (default: 1)")
    arguments = parser.parse_args()

    dataset: Path = arguments.dataset
    for leftover in dataset.rglob(".*.tmp.*"):
        if leftover.relative_to(dataset).parts[0] != REPORT:
            leftover.unlink()
    arguments.sums.unlink(missing_ok=True)
    result = validate(
        dataset,
        arguments.reprojection,
        arguments.records,
        arguments.clearance,
        arguments.processes,
    )
    write_json(arguments.output, result.to_json())
    print(result.summary())
    if not result.valid:
        for check in result.checks:
            lines = check.problems[:_LINES_A_CHECK]
            if len(check.problems) > len(lines):
                lines.append(f"… and {len(check.problems) - len(lines)} more")
            for line in lines:
                print(f"{result.dataset}: {check.name}: {line}", file=sys.stderr)
        raise UserError(f"{result.dataset} is not valid: {arguments.output} says why")
    sums = dict(result.checksums)
    if arguments.output.resolve().is_relative_to(dataset.resolve()):
        inside = arguments.output.resolve().relative_to(dataset.resolve()).as_posix()
        sums[inside] = sha256(arguments.output)
    with atomic_path(arguments.sums) as temporary:
        text = "".join(f"{digest}  {path}\n" for path, digest in sorted(sums.items()))
        temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    run(main)
