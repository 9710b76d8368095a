"""Checks every byte of datasets, sequences and families.

A file's SHA-256 may be in two places. The receipt of the job that made the file counts first.
Receipts also have the files of reports, and intermediate files. The list sha256sums.txt in the
folder of a dataset has its published files. A copy has only this list. The list of a corpus has the
lists of its datasets.
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from lightfield.configuration.corpus import SHARDS, THUMBNAILS
from lightfield.configuration.family import RECORD
from lightfield.core.errors import UserError
from lightfield.core.files import (
    DAMAGE,
    absolute_path,
    broken,
    read_json,
    read_problem,
    set_aside,
    sha256,
)
from lightfield.core.names import CORPUS
from lightfield.core.paths import (
    files_below,
    kept_behind_link,
    leads_inside,
    lies_below,
    link_above,
    stray_places,
)
from lightfield.engine import receipts
from lightfield.formats.layout import IMAGES, PACKAGED, REPORT, SUMS, VALIDATION, read_sums
from lightfield.formats.lightfield import NAME, LightField
from lightfield.stages.checks import Verify

CHANGED = "has changed since a job read it"
STRAY = "is not a file of this dataset, or has no checksum"
FORMER = f"is not in {CORPUS} any more; snakemake prune removes it where the family is built"


def verify(job: Verify) -> None:
    """Print a line for each fault of a job's folders. Raises `UserError` if there is one."""
    if job.mend and not job.work:
        raise UserError("--mend: needs --work: a dataset can only be mended where it is built")
    problems: dict[str, str] = {}
    for folder in job.dataset:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder")
        # All datasets of a scene share its files. Name them once.
        for path, problem in faults(folder, job.work).items():
            if path not in problems:
                problems[path] = problem
                print(f"{path}: {problem}", flush=True)
                if job.mend and job.work:
                    _mend(path, problem, folder, job.work)
    names = ", ".join(map(str, job.dataset))
    if problems:
        mended = "; the next run makes them again" if job.mend else ""
        raise UserError(f"{len(problems)} faults in {names}{mended}")
    print(f"no fault in {names}")


def faults(folder: Path, work: Path | None = None) -> dict[str, str]:
    """Return what is wrong with the files of a dataset, a sequence or a family, by their paths.

    ``work`` is the workflow's folder of intermediate files. A copy has none.
    """
    work = Path(receipts.name_of(work)) if work else None
    verification = _Verification(Path(receipts.name_of(folder)), work)
    verification.check()
    return dict(sorted(verification.problems.items()))


class _Verification:
    """The check of a folder. ``problems`` are the faults, by the paths of the files."""

    def __init__(self, folder: Path, work: Path | None) -> None:
        self.folder = folder
        self.work = work
        # The folders above this one, up to the folder of all results.
        self.parents = [*folder.parents][: _depth(folder, work)] if work else []
        self.problems: dict[str, str] = {}
        # The SHA-256 that files may have, each with the receipt that says so.
        self.made: dict[str, dict[str, str]] = {}
        # The SHA-256 with which users' files were read, each with a receipt that says so.
        self.read: dict[str, tuple[str, str]] = {}
        # The SHA-256 of published files, and the list that says so.
        self.listed: dict[str, tuple[str, str]] = {}
        # The folders that have a list, or must have one. Outer folders come first.
        self.homes: list[Path] = []

    def check(self) -> None:
        """Find all faults."""
        if self.work:
            self._read_receipts(self.work)
        present = [str(path) for path in files_below(self.folder)]
        self.homes = _homes(self.folder, present)
        read_homes = [home for home in self.homes if self._read_list(home)]
        for path in {**self.listed, **self.made}:
            self._check_file(path)
        for path in self.read if self.made else ():
            self._check_users_file(path)
        self._check_strays(present, read_homes)
        # A list is older than the receipts if the dataset is not finished.
        for home in read_homes if not self.made else ():
            self._check_contents(home)

    def _read_receipts(self, work: Path) -> None:
        """Read the receipts of the folder, and of the jobs before them."""
        pending = set(_receipts(self.folder, work, len(self.parents)))
        read = set()
        built = [*self.parents[-1:], work]
        strays: list[tuple[Path, str]] = []
        while pending:
            path = pending.pop()
            read.add(path)
            receipt = receipts.read(path)
            outputs = receipts.read_part(path)[0]
            if receipt:
                outputs = {**receipt.outputs, **outputs}
                pending |= {*_makers(receipt, work)} - read
                strays += [(path, name) for name in receipt.outputs if not lies_below(name, built)]
                for name, digest in receipt.inputs.items():
                    is_made = receipts.is_receipt(name) or receipts.find_output(name, work)
                    if digest and not is_made:
                        self.read[name] = digest, str(path)
            elif os.path.lexists(path):
                self.problems[str(path)] = broken(path) or "is damaged"
            for name, output in outputs.items():
                if self._concerns(name):
                    self.made.setdefault(name, {})[output.stamp.sha256] = str(path)
        if not any(_is_below(name, self.folder) for name in self.made):
            # The folder is a copy, or older than receipts.
            self.made = {}
        for path, name in strays if self.made else ():
            problem = f"names {name}, which no job of this build makes"
            self.problems.setdefault(str(path), problem)

    def _concerns(self, path: str) -> bool:
        """Return whether a file is one of the folder, of work, or of the folder's scene."""
        is_of_scene = Path(path).parent in self.parents[:-1]
        return is_of_scene or _is_below(path, self.folder) or _is_below(path, self.work)

    def _read_list(self, home: Path) -> bool:
        """Read the list of a folder. Return whether it is there and undamaged."""
        path = str(home / SUMS)
        if not os.path.lexists(path):
            if path in self.made or not self.made:
                self.problems[path] = "is missing"
            return False  # Without a fault, the dataset is not finished.
        if problem := broken(home / SUMS):
            self.problems[path] = problem
        elif path in self.made or path in self.listed:
            self._check_file(path)
        if path in self.problems:
            return False
        try:
            sums = read_sums(home / SUMS)
        except UnicodeDecodeError:
            sums = {}
        if not sums:
            self.problems[path] = "has no checksum"
        self.listed |= {str(home / name): (digest, path) for name, digest in sums.items()}
        return bool(sums)

    def _check_file(self, path: str) -> None:
        """Compare a file with its receipts. Without one, compare it with its list."""
        listed, list_path = self.listed.get(path, ("", ""))
        made = self.made.get(path) or {listed: list_path}
        if not os.path.lexists(path):
            if listed or self._is_missed(path):
                self.problems[path] = "is missing"
            return
        try:
            digest = sha256(path)
        except OSError as error:
            self.problems[path] = broken(Path(path)) or f"cannot be read: {read_problem(error)}"
            return
        if digest in made:
            return
        expected, source = next(iter(made.items()))
        if digest == listed:
            self.problems[source] = f"is damaged: {list_path} has another sha256 of {path}"
        else:
            problem = f"its sha256 is {digest}, but {source} says {expected}"
            self.problems[path] = broken(Path(path)) or problem

    def _check_users_file(self, path: str) -> None:
        """Compare a user's file with the receipt of a job that read it. It may be gone since."""
        digest, source = self.read[path]
        if Path(path).is_file() and sha256(path) != digest:
            self.problems[path] = (
                f"{CHANGED} ({source}); the next run makes again what depends on it"
            )

    def _is_missed(self, path: str) -> bool:
        """Return whether a missing file that no list has is a fault.

        A receipt may name files that the dataset no longer has, such as files of a former export.
        """
        parts = Path(path).parts
        return REPORT in parts or SUMS in parts or _is_below(path, self.work)

    def _check_contents(self, home: Path) -> None:
        """Check that the list of a copy has what a corpus or a valid dataset must have."""
        sums, validation, lightfield = home / SUMS, home / VALIDATION, home / NAME
        if self._is_corpus(home):
            self._check_members(home)
            return
        # A sequence has no light field of its own.
        required = [validation, *([lightfield] if lightfield.exists() else [])]
        if self._are_listed(required, sums) and self.problems.keys().isdisjoint(map(str, required)):
            if not read_json(validation).get("valid"):
                self.problems[str(validation)] = "says that the dataset is not valid"
            views = LightField.read(lightfield).views if lightfield in required else []
            self._are_listed([home / IMAGES / f"{view.name}.exr" for view in views], sums)

    def _check_members(self, home: Path) -> None:
        """Check that the list of a corpus has all datasets. Name what is no part of it any more."""
        members = _members_of_corpus(home)
        for dataset in self.homes[1:]:
            name, *rig = dataset.relative_to(home).parts
            sums = str(dataset / SUMS)
            member = members.get(name, {})
            if members and not member:
                self.problems[str(home / name)] = FORMER
            elif member.get("state") == "failed" and not os.path.lexists(sums):
                # It keeps its whole files, so that a later run need not make them again.
                self.problems.pop(sums, None)
            elif member and "/".join(rig) not in member.get("datasets", {}):
                self.problems[str(dataset)] = FORMER
            elif sums not in self.listed:
                self.problems[sums] = f"has no checksum in {home / SUMS}"

    def _are_listed(self, required: Iterable[Path], sums: Path) -> bool:
        """Return whether files are in a list. The first that is not is a fault of the list."""
        for path in required:
            if str(path) not in self.listed:
                self.problems[str(sums)] = f"has no checksum of {path.relative_to(sums.parent)}"
                return False
        return True

    def _check_strays(self, present: Iterable[str], read_homes: Iterable[Path]) -> None:
        """Find the files without a checksum in the folders whose lists were read."""
        strays: dict[Path, list[str]] = {home: [] for home in read_homes}
        known_homes = {*self.homes}
        for path in present:
            home = next((each for each in Path(path).parents if each in known_homes), None)
            if home in strays and path not in self.made and path not in self.listed:
                name = Path(path).relative_to(home).as_posix()
                if self._needs_checksum(home, name):
                    strays[home].append(name)
        for home, names in strays.items():
            own = [path for path in self.listed if names and _is_below(path, home)]
            own_files = [Path(path).relative_to(home).as_posix() for path in own]
            for name in stray_places(home, names, own_files):
                self.problems[str(home / name)] = f"{STRAY}{kept_behind_link(home, name)}"

    def _needs_checksum(self, home: Path, name: str) -> bool:
        """Return whether a file of a finished dataset or corpus must have a checksum."""
        top = name.partition("/")[0]
        if self._is_corpus(home):
            return top in (THUMBNAILS, SHARDS)
        return top not in (SUMS, REPORT, *PACKAGED)

    def _is_corpus(self, home: Path) -> bool:
        return str(home / CORPUS) in self.listed or (home / CORPUS).exists()


def _members_of_corpus(home: Path) -> dict[str, dict[str, Any]]:
    """Return the members in corpus.json by name. Empty if it is missing or damaged."""
    with suppress(UserError, *DAMAGE):
        return {member["name"]: member for member in read_json(home / CORPUS)["members"]}
    return {}


def _homes(folder: Path, present: Iterable[str]) -> list[Path]:
    """Return the folders that have a list, or must have one. Outer folders come first."""
    homes = set()
    for path in map(Path, present):
        is_dataset = path.name == NAME and (path.parent / IMAGES).is_dir()
        if is_dataset or path.name in (SUMS, CORPUS):
            homes.add(path.parent)
    return sorted(homes, key=lambda home: len(home.parts)) or [folder]


def _is_below(path: str, folder: Path | None) -> bool:
    """Return whether a path leads into a folder. Faster than `Path` for many files."""
    return folder is not None and path.startswith(f"{folder}/")


def _depth(folder: Path, work: Path) -> int:
    """Return how many folders lead from the folder of all results to a folder of a build.

    0 if there are no receipts of it.
    """
    parts = absolute_path(folder).parts
    # The folder of a frame lies in the folder of a rig, and this in the folder of a scene.
    for count in (3, 2, 1):
        if work.joinpath(receipts.FOLDER, *parts[-count:]).is_dir():
            return count
    return 0


def _receipts(folder: Path, work: Path, depth: int) -> Iterator[Path]:
    """Yield the receipts of a dataset, a sequence or a family, and of its scene."""
    root = work / receipts.FOLDER
    home = root.joinpath(*absolute_path(folder).parts[-depth:])
    of_scene = (parent.glob("*") for parent in home.parents if root in parent.parents)
    for path in chain(home.rglob("*"), *of_scene) if depth else ():
        if path.suffix in (receipts.SUFFIX, receipts.PART_SUFFIX):
            yield path.with_suffix(receipts.SUFFIX)


def _makers(receipt: receipts.Receipt, work: Path) -> Iterator[Path]:
    """Yield the receipts of the jobs that made the inputs of a job."""
    for name in receipt.inputs:
        if receipts.is_receipt(name):
            if lies_below(name, [work / receipts.FOLDER]):
                yield Path(name)
        elif maker := receipts.find_output(name, work):
            yield maker[0]


def _mend(path: str, problem: str, folder: Path, work: Path) -> None:
    """Move a faulty file away, so that the next run makes it again. A user's file stays.

    The next run goes on with a family if it lacks a list of checksums.
    """
    inside = os.path.relpath(path, folder)
    if problem.startswith(CHANGED) or (problem.startswith(STRAY) and link_above(folder, inside)):
        return
    places = [Path(path)]
    if leads_inside(inside) and any(folder.glob(f"*/{RECORD}")):
        places += [folder / parent / SUMS for parent in Path(inside).parents]
    for place in places:
        if os.path.lexists(place):
            set_aside(place, work / receipts.REMOVED)
