"""Checks that all files of a corpus are as they were written, down to the views of its members.

The sums over a corpus have the sum of each dataset's own list of sums.
"""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from lightfield.configuration.corpus import CORPUS, SHARDS, THUMBNAILS
from lightfield.configuration.family import RECORD
from lightfield.core.files import broken, read_json, reading, set_aside
from lightfield.core.paths import check_inside
from lightfield.formats.layout import SUMS, read_sums
from lightfield.validation.integrity import Fault, Integrity, file_problem


def is_corpus(folder: Path) -> bool:
    """Return whether a folder holds a family with a corpus. The corpus may lack a file."""
    names = (CORPUS, SUMS)
    return any((folder / name).exists() for name in names) and any(folder.glob(f"*/{RECORD}"))


def corpus_faults(folder: Path) -> Iterator[Fault]:
    """Yield every fault of the corpus in the family's ``folder``, one for each file."""
    path = folder / SUMS
    problem = broken(path) if path.exists() else "is missing; the next run makes it"
    if problem:
        yield Fault(path, problem)
        return
    try:
        sums = read_sums(path)
    except UnicodeDecodeError:
        yield Fault(path, "is not text in UTF-8")
        return
    faulty = set()
    for name, digest in sums.items():
        problem = file_problem(folder / name, digest, str(path))
        if problem:
            faulty.add(name)
            yield Fault(folder / name, problem)
    for name in sums:
        if name.endswith(f"/{SUMS}") and name not in faulty:
            yield from Integrity((folder / name).parent).faults()
    for name in sorted(_required(folder, sums) - sums.keys() - faulty):
        yield Fault(folder / name, f"has no checksum in {path}")
    for pattern in (f"{THUMBNAILS}/*", f"{SHARDS}/*/*"):
        for extra in sorted(folder.glob(pattern)):
            if extra.relative_to(folder).as_posix() not in sums:
                yield Fault(extra, "is not a file of this corpus, or has no checksum")


def mend(folder: Path, fault: Fault, work: Path) -> None:
    """Set a faulty file of a corpus aside, with the lists of sums that the next run must renew.

    A batch of members runs again if a list of sums or a record of its members is missing.
    """
    parts = Path(os.path.relpath(fault.path, folder)).parts
    lists = [folder / SUMS]
    if len(parts) > 2 and parts[0] not in (THUMBNAILS, SHARDS):
        lists.append(folder / parts[0] / parts[1] / SUMS)
    for path in (fault.path, *lists):
        if os.path.lexists(path):
            set_aside(path, work / "removed")


def _required(folder: Path, sums: Mapping[str, str]) -> set[str]:
    """Return corpus.json and, if its checksum holds, the lists of sums of the datasets in it."""
    if file_problem(folder / CORPUS, sums.get(CORPUS, ""), SUMS):
        return {CORPUS}
    with reading(folder / CORPUS, "corpus"):
        members = read_json(folder / CORPUS)["members"]
        lists = {
            f"{member['name']}/{rig}/{SUMS}"
            for member in members
            for rig in member.get("datasets", {})
        }
    for name in lists:
        check_inside(name, f"{folder / CORPUS}: members")
    return {CORPUS, *lists}
