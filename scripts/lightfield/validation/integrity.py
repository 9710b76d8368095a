"""Checks that a dataset's files, and its intermediate files, are as they were written.

A file's checksum may be in three places. The first of them counts:

- the workflow's ledger, if a job declares the file as an output;
- a shard's record, if the file is a view;
- the dataset's sha256sums.txt, if the file is published. A copy of a dataset has only this one.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import (
    absolute_path,
    broken,
    read_json,
    read_problem,
    set_aside,
    sha256,
)
from lightfield.core.names import SPLITS
from lightfield.core.paths import files_below, kept_behind_link, link_above, stray_places
from lightfield.formats.export_lists import MANIFEST
from lightfield.formats.layout import CARD, IMAGES, README, REPORT, SUMS, read_sums
from lightfield.formats.lightfield import NAME, LightField
from lightfield.workflow import ledger, shard_files
from lightfield.workflow.shard_files import JOURNAL_SUFFIX, LOG_SUFFIX

# The folder of a sequence's frame.
_FRAME = re.compile(r"f\d{5,7}")
# Records of past work. Nothing can make them again, and no dataset needs them.
_HISTORY = (JOURNAL_SUFFIX, ".tsv")


@dataclass(frozen=True)
class Fault:
    """A file that is not as it was written, and why."""

    path: Path
    problem: str

    def __str__(self) -> str:
        return f"{self.path}: {self.problem}"


def file_problem(path: Path, digest: str, source: str) -> str | None:
    """Return what is wrong with a file that must have a SHA-256. ``source`` gave the SHA-256."""
    if not os.path.lexists(path):
        return "is missing"
    problem = broken(path)
    if problem:
        return problem
    try:
        actual = sha256(path)
    except OSError as error:
        return f"cannot be read: {read_problem(error)}"
    return None if actual == digest else f"its sha256 is {actual}, but {source} says {digest}"


def _is_below(path: Path, folder: Path) -> bool:
    """Return what `Path.is_relative_to` does, in a tenth of its time. Both paths are relative."""
    return path.parts[: len(folder.parts)] == folder.parts


class Integrity:
    """Checks the files of a dataset. With the folder ``work``, also checks its intermediate files.

    The folder may also be a sequence's. Then only the exports of the whole sequence count, because
    each frame is a dataset of its own.
    """

    def __init__(self, dataset: Path, work: Path | None = None) -> None:
        # The ledger has paths as the configuration gives them, most of them relative.
        self.dataset = Path(os.path.relpath(dataset))
        self.work = Path(os.path.relpath(work)) if work else None
        # A sequence's datasets lie a folder deeper, one for each frame.
        folder = absolute_path(dataset)
        depth = 3 if _FRAME.fullmatch(folder.name) else 2
        self._name = "/".join(folder.parts[-depth:])
        self._scene = folder.parts[-depth]
        # These files lie beside the folders of the scene's rigs.
        self._splits = Path(os.path.relpath(folder.parents[depth - 2] / SPLITS))

    @property
    def frames(self) -> list[Path]:
        """The folders of a sequence's frames. Empty for a dataset."""
        if _FRAME.fullmatch(self.dataset.name) or (self.dataset / NAME).exists():
            return []
        folders = sorted(path.parent for path in self.dataset.glob(f"f[0-9]*/{NAME}"))
        return [folder for folder in folders if _FRAME.fullmatch(folder.name)]

    @property
    def is_sequence(self) -> bool:
        """Whether the folder holds a sequence."""
        return bool(self.frames)

    def faults(self) -> Iterator[Fault]:
        """Yield every fault, one for each file."""
        expected = self._expected
        if self.work:
            yield from self._ledger_faults(self.work / ledger.NAME)
        problems = {path: file_problem(path, *sums) for path, sums in expected.items()}
        for path, problem in problems.items():
            if problem:
                yield Fault(path, problem)
        # Look for these files even if all lists with checksums are damaged.
        was_finished = self._published or self._is_noted(self.dataset / SUMS)
        present = set(self._present()) if was_finished else set()
        for path in self._strays(present, expected):
            name = path.relative_to(self.dataset).as_posix()
            problem = "is not a file of this dataset, or has no checksum"
            yield Fault(path, f"{problem}{kept_behind_link(self.dataset, name)}")
        for path in sorted(self._required_views(present) - expected.keys() - present):
            yield Fault(path, "is missing")
        wrong = {path for path, problem in problems.items() if problem}
        # Damaged lists do not tell which files must exist.
        if wrong.isdisjoint((self.dataset / NAME, self.dataset / "validation.json")):
            yield from (fault for fault in self._contents(expected) if fault.path not in wrong)

    def _strays(self, present: set[Path], expected: Mapping[Path, Any]) -> list[Path]:
        """Return the files that the dataset must not have. A foreign link stands for its files."""
        own_files = [
            path.relative_to(self.dataset).as_posix()
            for path in expected
            if _is_below(path, self.dataset)
        ]
        strays = sorted(present - expected.keys())
        names = [path.relative_to(self.dataset).as_posix() for path in strays]
        return [self.dataset / name for name in stray_places(self.dataset, names, own_files)]

    def _ledger_faults(self, path: Path) -> Iterator[Fault]:
        damaged = ledger.damaged_lines(path)
        if damaged:
            numbers = ", ".join(map(str, damaged[:8]))
            yield Fault(path, f"lines that are damaged: {numbers}; their files are made again")
        elif not self._ledger:
            yield Fault(path, "is missing: the next run makes files without a checksum again")

    def mend(self, fault: Fault) -> None:
        """Set a faulty file aside, with all files that the next run must make again for it."""
        assert self.work
        ledger_path = self.work / ledger.NAME
        if fault.path == ledger_path:
            if ledger_path.exists():
                ledger.Ledger(ledger_path).compact()
            return
        for path in (fault.path, *self._followers(fault.path)):
            if os.path.lexists(path) and not self._is_kept(path):
                set_aside(path, self.work / "removed")
        if fault.path.name.endswith(_HISTORY):
            for name in ledger.read(ledger_path):
                if os.path.relpath(name) == str(fault.path):
                    ledger.forget(ledger_path, name)

    def _is_kept(self, path: Path) -> bool:
        """Return whether a file is not the dataset's own, but lies behind a link."""
        if path in self._expected or not _is_below(path, self.dataset):
            return False
        return link_above(self.dataset, path.relative_to(self.dataset).as_posix()) is not None

    def _followers(self, path: Path) -> Iterator[Path]:
        """Yield the declared output of the job that made ``path``, if that is another file."""
        if path.name.endswith(LOG_SUFFIX):
            yield path.with_name(path.name.replace(LOG_SUFFIX, ".json"))
        is_listed = path in self._published or not self._published
        if is_listed and path not in self._recorded and not self._is_noted(path):
            # The file belongs to an export, whose list or transforms.json is the declared output.
            for folder in path.relative_to(self.dataset).parents:
                for name in (MANIFEST, "transforms.json"):
                    if (self.dataset / folder / name).is_file():
                        yield self.dataset / folder / name
                        return

    def _is_sound(self, path: Path) -> bool:
        """Return whether a file is as the ledger says. True without a ledger, as in a copy."""
        entry = self._ledger.get(str(path))
        if entry is None:
            return not self._ledger
        return file_problem(path, entry, "the ledger") is None

    def _is_noted(self, path: Path) -> bool:
        return str(path) in self._ledger

    @cached_property
    def _ledger(self) -> dict[str, str]:
        files = ledger.read(self.work / ledger.NAME) if self.work else {}
        return {os.path.relpath(name): digest for name, digest in files.items()}

    @cached_property
    def _recorded(self) -> dict[Path, str]:
        """The SHA-256 of each view by its path, from the records of shards.

        A shard's log replaces a damaged record. The last line about a file counts.
        """
        digests: dict[Path, str] = {}
        for path in map(Path, self._ledger):
            if not (re.fullmatch(r"\d+-\d+\.json", path.name) and self._belongs_here(path)):
                continue
            for file, digest in self._shard_sums(path).items():
                # Records of shards with other bounds may name views that no longer exist.
                if not self._published or self.dataset / file in self._published:
                    digests[self.dataset / file] = digest
        return digests

    def _shard_sums(self, record: Path) -> dict[str, str]:
        """Return the SHA-256 of a shard's files. Empty if both record and log are damaged."""
        if self._is_sound(record):
            return {file: digest for file, (_, digest) in shard_files.read_record(record).items()}
        log = record.with_name(f"{record.stem}{LOG_SUFFIX}")
        if not self._is_sound(log):
            return {}
        return {line["file"]: line["sha256"] for line in shard_files.logged_lines(log)}

    @cached_property
    def _published(self) -> dict[Path, str]:
        """The SHA-256 of each published file by its path, from sha256sums.txt.

        The copy in the folder ``work`` replaces a damaged file. Empty if both are damaged.
        """
        candidates = [self.dataset / SUMS]
        if self.work:
            candidates.append(self.work / self._name / "checksums.txt")
        sound = (path for path in candidates if self._is_sound(path))
        try:
            sums = read_sums(next(sound))
        except (StopIteration, OSError, UnicodeDecodeError):
            return {}
        return {self.dataset / name: digest for name, digest in sums.items()}

    @cached_property
    def _expected(self) -> dict[Path, tuple[str, str]]:
        """The SHA-256 that each file must have, and the name of the list that says so."""
        sums = {path: (digest, SUMS) for path, digest in self._published.items()}
        sums |= {path: (digest, "its record") for path, digest in self._recorded.items()}
        for name, digest in self._ledger.items():
            path = Path(name)
            if self._belongs_here(path):
                sums[path] = (digest, f"{self.work}/{ledger.NAME}")
        return dict(sorted(sums.items()))

    def _belongs_here(self, path: Path) -> bool:
        """Return whether a file of the ledger belongs to the dataset, or to its scene."""
        if _is_below(path, self.dataset) or path == self._splits:
            return not self._is_of_frame(path, self.dataset)
        if not self.work or not _is_below(path, self.work):
            return False
        inside = path.relative_to(self.work).as_posix()
        scene, _, name_in_scene = inside.partition("/")
        is_of_scene = "/" not in name_in_scene and f"{self._scene}_".startswith(f"{scene}_")
        for folder in (self.work / self._name, self.work / "benchmarks" / self._name):
            if self._is_of_frame(path, folder):
                return False
        return is_of_scene or inside.startswith((f"{self._name}/", f"benchmarks/{self._name}/"))

    def _is_of_frame(self, path: Path, folder: Path) -> bool:
        """Return whether a file belongs to a frame, if ``folder`` holds a sequence."""
        if not _is_below(path, folder) or path == folder:
            return False
        return bool(_FRAME.fullmatch(path.parts[len(folder.parts)]))

    def _present(self) -> Iterator[Path]:
        """Yield the dataset's files. The report's files count only if the ledger lists them."""
        pictures = chain(self.dataset.glob("*/*.exr"), self.dataset.glob("*/*.png"))
        # A folder may have taken a picture's place.
        folders = (path for path in pictures if path.is_dir())
        for path in chain(files_below(self.dataset), folders):
            parts = path.relative_to(self.dataset).parts
            is_addition = parts in ((SUMS,), (CARD,), (README,))
            is_own = not _FRAME.fullmatch(parts[0]) and (self._ledger or parts[0] != REPORT)
            if is_own and not is_addition:
                yield path

    def _required_views(self, present: set[Path]) -> set[Path]:
        """Return the views that lightfield.json names, in each format that any of them has."""
        views = set()
        for path in {self.dataset / NAME, *self.dataset.glob(f"*/{NAME}")}:
            if self._is_noted(path) and self._is_sound(path):
                folder = self.dataset / IMAGES if path.parent == self.dataset else path.parent
                names = {view.name for view in LightField.read(path).views}
                suffixes = set()
                for file in present:
                    if file.parent == folder and file.stem in names:
                        suffixes.add(file.suffix)
                views |= {folder / f"{name}{suffix}" for name in names for suffix in suffixes}
        return views

    def _contents(self, expected: Mapping[Path, tuple[str, str]]) -> Iterator[Fault]:
        """Check that sums, validation and lightfield.json agree on which files exist."""
        sums = self.dataset / SUMS
        validation = self.dataset / "validation.json"
        if self.is_sequence and not expected and not any(self._present()):
            return  # The sequence has no exports.
        if self._ledger and not self._published:
            return  # The build is unfinished, or both lists of sums are damaged: already reported.
        if not self._published:
            yield Fault(
                sums, broken(sums) or ("has no checksum" if sums.exists() else "is missing")
            )
            return
        required = [validation] if self.is_sequence else [validation, self.dataset / NAME]
        for path in required:
            if path not in expected:
                yield Fault(sums, f"has no checksum of {path.name}")
                return
        try:
            views = [] if self.is_sequence else LightField.read(self.dataset / NAME).views
            if not read_json(validation).get("valid"):
                yield Fault(validation, "says that the dataset is not valid")
        except UserError:
            return  # Its checksum does not hold: already reported.
        for view in views:
            if self.dataset / IMAGES / f"{view.name}.exr" not in self._published:
                yield Fault(sums, f"has no checksum of {IMAGES}/{view.name}.exr")
                return
