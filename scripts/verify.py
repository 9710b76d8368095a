"""Check every byte of datasets against the checksums of their files.

Prints a line for each damaged file, with what is wrong. The exit status is then 1. For a copy of a
dataset, DATASET is enough. The folder of a sequence stands for all its frames and their exports.
--work also checks the files that the dataset was made from.
"""

import argparse
import os
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", nargs="+", type=Path, help="folder of a dataset")
    parser.add_argument("--work", type=Path, help="the workflow's folder of intermediate files")
    parser.add_argument(
        "--mend",
        action="store_true",
        help="move damaged files to WORK/removed, so that the next run makes them again",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.validation.integrity import Integrity

    if arguments.mend and not arguments.work:
        raise UserError("--mend: needs --work: a dataset can only be mended where it is built")

    folders: list[Path] = []
    for folder in arguments.dataset:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder")
        folders += [*Integrity(folder).frames, folder]
    problems: dict[Path, str] = {}
    for folder in dict.fromkeys(map(Path, map(os.path.relpath, folders))):
        integrity = Integrity(folder, arguments.work)
        # All datasets of a scene share its files. Name them once.
        faults = [fault for fault in integrity.faults() if fault.path not in problems]
        problems |= {fault.path: fault.problem for fault in faults}
        for fault in faults:
            print(fault, flush=True)
        if arguments.mend:
            for fault in faults:
                integrity.mend(fault)
    names = ", ".join(map(str, arguments.dataset))
    if problems:
        mended = "; the next run makes them again" if arguments.mend else ""
        raise UserError(f"{len(problems)} faults in {names}{mended}")
    print(f"no fault in {names}")


if __name__ == "__main__":
    run(main)
