"""Check a dataset whole: its files, its pixels, and that its views see the same world.

Writes validation.json, whatever comes out, and the checksums of all that the dataset publishes;
scripts/publish_checksums.py makes them its sha256sums.txt if it is valid. What an invalid dataset
fails in is printed, a line a failure. What a killed run left half-written in the dataset (hidden
*.tmp files), and the sha256sums.txt of an earlier validation, are removed first.
"""

import argparse
import sys
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import atomic_path, sha256, write_json
from lightfield.validation.validation import REPORT, SUMS, validate

# A check that fails in more places than this is told by its first ones; validation.json has all.
_LINES_A_CHECK = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--output", required=True, type=Path, help="validation.json to write")
    parser.add_argument("--sums", required=True, type=Path, help="checksums to write")
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
    (dataset / SUMS).unlink(missing_ok=True)
    result = validate(
        dataset,
        arguments.reprojection,
        arguments.records,
        arguments.clearance,
        arguments.processes,
    )
    write_json(arguments.output, result.to_json())
    print(result.summary())
    for check in result.checks:
        lines = check.problems[:_LINES_A_CHECK]
        if len(check.problems) > len(lines):
            lines.append(f"… and {len(check.problems) - len(lines)} more")
        for line in lines:
            print(f"{result.dataset}: {check.name}: {line}", file=sys.stderr)
    sums = dict(result.checksums)
    if arguments.output.resolve().is_relative_to(dataset.resolve()):
        inside = arguments.output.resolve().relative_to(dataset.resolve()).as_posix()
        sums[inside] = sha256(arguments.output)
    with atomic_path(arguments.sums) as temporary:
        text = "".join(f"{digest}  {path}\n" for path, digest in sorted(sums.items()))
        temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    run(main)
