"""Checks every byte of datasets and families, and sets damaged files aside."""

import os
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.stages.checks import Verify
from lightfield.validation.corpus_integrity import corpus_faults, is_corpus
from lightfield.validation.corpus_integrity import mend as mend_corpus
from lightfield.validation.integrity import Fault, Integrity
from lightfield.workflow.member_record import read_members


def verify(job: Verify) -> None:
    """Print a line for each fault of a job's folders. Raises `UserError` if there is one."""
    if job.mend and not job.work:
        raise UserError("--mend: needs --work: a dataset can only be mended where it is built")
    for folder in job.dataset:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder")
    faulty_paths: set[Path] = set()
    corpora = [folder for folder in job.dataset if is_corpus(folder)]
    for folder in corpora:
        faulty_paths |= _verify_corpus(job, folder)
    folders = [folder for folder in job.dataset if folder not in corpora]
    # A family has no corpus before its first run has ended.
    members = {_relative(path) for folder in folders for path in _member_datasets(folder)}
    for folder in dict.fromkeys([*_datasets(folders), *sorted(members)]):
        faulty_paths |= _verify_dataset(job, folder, folder in members, faulty_paths)
    names = ", ".join(map(str, job.dataset))
    if faulty_paths:
        mended = "; the next run makes them again" if job.mend else ""
        raise UserError(f"{len(faulty_paths)} faults in {names}{mended}")
    print(f"no fault in {names}")


def _verify_corpus(job: Verify, folder: Path) -> set[Path]:
    """Verify a family with a corpus. Return the paths with faults."""
    # Find all faults before mending the first: mending moves files.
    faults = [*corpus_faults(folder)]
    for fault in faults:
        print(fault, flush=True)
        if job.mend and job.work:
            mend_corpus(folder, fault, job.work)
    return {fault.path for fault in faults}


def _verify_dataset(
    job: Verify, folder: Path, is_of_member: bool, faulty_paths: set[Path]
) -> set[Path]:
    """Verify a dataset. Return the paths with faults, but for ``faulty_paths``."""
    # The checksums of a member's dataset are beside its files.
    integrity = Integrity(folder, None if is_of_member else job.work)
    # All datasets of a scene share its files. Name them once.
    faults = [fault for fault in integrity.faults() if fault.path not in faulty_paths]
    for fault in faults:
        print(fault, flush=True)
    if job.mend:
        _mend(folder, is_of_member, integrity, faults)
    return {fault.path for fault in faults}


def _mend(folder: Path, is_of_member: bool, integrity: Integrity, faults: list[Fault]) -> None:
    """Set damaged files aside, so that the next run makes them again."""
    if is_of_member and faults:
        # Without the member's record, the next run makes its damaged files again.
        (folder.parent / "member.json").unlink(missing_ok=True)
    elif not is_of_member:
        for fault in faults:
            integrity.mend(fault)


def _datasets(folders: list[Path]) -> list[Path]:
    """Return the datasets in the folders of datasets and sequences. Families have none."""
    datasets: list[Path] = []
    for folder in folders:
        if not any(folder.glob("*/member.json")):
            datasets += [*Integrity(folder).frames, folder]
    return [_relative(path) for path in datasets]


def _member_datasets(folder: Path) -> list[Path]:
    """Return the datasets of the members of a family in ``folder``. Empty for a dataset."""
    return [
        folder / member.name / rig for member in read_members(folder) for rig in member.datasets
    ]


def _relative(path: Path) -> Path:
    return Path(os.path.relpath(path))
