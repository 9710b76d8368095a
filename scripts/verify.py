"""Check every byte of datasets against the checksums of their files.

Prints a line for each damaged file, with what is wrong. The exit status is then 1. For a copy of a
dataset, DATASET is enough. --work also checks the files that the dataset was made from. The folder
of a sequence stands for all its frames and their exports. The folder of a family stands for its
corpus: its page, its shards, and all datasets of its members.
"""

import argparse
import os
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "dataset", nargs="+", type=Path, help="folder of a dataset, or of a family of scenes"
    )
    parser.add_argument("--work", type=Path, help="the workflow's folder of intermediate files")
    parser.add_argument(
        "--mend",
        action="store_true",
        help="move damaged files to WORK/removed, so that the next run makes them again",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.validation.corpus_integrity import corpus_faults, is_corpus, mend
    from lightfield.validation.integrity import Integrity

    if arguments.mend and not arguments.work:
        raise UserError("--mend: needs --work: a dataset can only be mended where it is built")

    problems: dict[Path, str] = {}
    for folder in arguments.dataset:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder")
    corpora = [folder for folder in arguments.dataset if is_corpus(folder)]
    for folder in corpora:
        for fault in [*corpus_faults(folder)]:
            problems[fault.path] = fault.problem
            print(fault, flush=True)
            if arguments.mend:
                mend(folder, fault, arguments.work)
    others = [folder for folder in arguments.dataset if folder not in corpora]
    # A family has no corpus before its first run has ended.
    members = {Path(os.path.relpath(path)) for folder in others for path in member_datasets(folder)}
    datasets: list[Path] = []
    for folder in others:
        if not any(folder.glob("*/member.json")):
            datasets += [*Integrity(folder).frames, folder]
    for folder in dict.fromkeys(map(Path, map(os.path.relpath, [*datasets, *sorted(members)]))):
        is_of_member = folder in members
        # The checksums of a member's dataset are beside its files.
        integrity = Integrity(folder, None if is_of_member else arguments.work)
        # All datasets of a scene share its files. Name them once.
        faults = [fault for fault in integrity.faults() if fault.path not in problems]
        problems |= {fault.path: fault.problem for fault in faults}
        for fault in faults:
            print(fault, flush=True)
        if arguments.mend and is_of_member and faults:
            # Without its record, the next run makes what is damaged of the member.
            (folder.parent / "member.json").unlink(missing_ok=True)
        elif arguments.mend:
            for fault in faults:
                integrity.mend(fault)
    names = ", ".join(map(str, arguments.dataset))
    if problems:
        mended = "; the next run makes them again" if arguments.mend else ""
        raise UserError(f"{len(problems)} faults in {names}{mended}")
    print(f"no fault in {names}")


def member_datasets(folder: Path) -> list[Path]:
    """Return the datasets of the members of a family in ``folder``. Empty for a dataset."""
    from lightfield.workflow.member_record import read_members

    return [
        folder / member.name / rig for member in read_members(folder) for rig in member.datasets
    ]


if __name__ == "__main__":
    run(main)
