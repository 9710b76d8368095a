"""The ledger: what each job of the workflow made, and from what.

work/ledger.txt has one line for each finished job: the SHA-256 of the rest of the line, a blank,
and a JSON mapping:

- ``outputs``: the paths that the job's rule declares;
- ``files``: a `Stamp` for each file that the job wrote: its outputs, and what they list;
- ``history``: the same for files that only grow, such as journals; no job can make them again;
- ``inputs``: a `Stamp` for each file that the job read, taken before it started.

A line counts until a later line names the same outputs. A line with a wrong SHA-256 does not count.
So the ledger knows what every file was made from, even without Snakemake's own notes. The plan of a
run uses it to detect damaged files, and files that were made from other inputs.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self

from lightfield.core.errors import UserError
from lightfield.core.files import (
    DAMAGE,
    atomic_path,
    broken,
    locked,
    read_problem,
    sha256,
    unreadable,
    writing,
)

NAME = "ledger.txt"
# The ledger is written anew when more than this part of its lines no longer counts.
_OBSOLETE_PART = 0.5


class Stamp(NamedTuple):
    """A file's SHA-256, size and times, which show whether the file has changed.

    ``changed_ns`` is the inode's change time, which no program can set back. As in Git, a file with
    the same size and times counts as unchanged.
    """

    sha256: str
    bytes: int
    modified_ns: int
    changed_ns: int

    @classmethod
    def of(cls, path: str | Path, digest: str | None = None) -> Self:
        """Return the stamp of a file. Computes the SHA-256 unless ``digest`` is given."""
        status = os.stat(path)  # noqa: PTH116, a `Path` is slow for 100,000 files
        digest = digest or sha256(path)
        return cls(digest, status.st_size, status.st_mtime_ns, status.st_ctime_ns)

    def is_current(self, path: str | Path) -> bool:
        """Return whether a file has this size and these times."""
        try:
            status = os.stat(path)  # noqa: PTH116, as above
        except OSError:
            return False
        return (status.st_size, status.st_mtime_ns, status.st_ctime_ns) == self[1:]


class Job(NamedTuple):
    """One line of the ledger; see the module's docstring."""

    outputs: list[str]
    files: dict[str, Stamp]
    history: dict[str, Stamp]
    inputs: dict[str, Stamp]


class Ledger:
    """The ledger at ``path``, as it was when it was opened, with the jobs that ``note`` added.

    ``is_current`` says whether the present configuration has an output. The files of other jobs
    are not checked for damage.
    """

    def __init__(self, path: Path, is_current: Callable[[str], bool] = lambda _: True) -> None:
        self._path = path
        # The SHA-256 of each output.
        self.sums: dict[str, str] = {}
        # The stamps of the inputs that each output was made from.
        self._inputs: dict[str, dict[str, Stamp]] = {}
        # Jobs with a file whose size or times differ from its stamp.
        self._suspects: list[Job] = []
        # The latest stamp of each file, by any job. Shards with other bounds make the same views.
        self._latest: dict[str, Stamp] = {}
        line_count = 0
        obsolete_count = 0
        for job in jobs(path):
            line_count += 1
            for name, stamp in job.files.items():
                self._latest.setdefault(name, stamp)
            if all(name in self._inputs for name in job.outputs):
                obsolete_count += 1
                continue
            self._add_unless_known(job)
            if not any(map(is_current, job.outputs)):
                continue
            if not all(stamp.is_current(name) for name, stamp in job.files.items()):
                self._suspects.append(job)
        self.is_cluttered = obsolete_count > _OBSOLETE_PART * line_count

    def _add_unless_known(self, job: Job) -> None:
        """Add the outputs of a job that no later job has made."""
        for name in job.outputs:
            if name not in self._inputs:
                self._inputs[name] = job.inputs
                if name in job.files:
                    self.sums[name] = job.files[name].sha256

    def __contains__(self, output: str) -> bool:
        return output in self._inputs

    def note(self, job: Job) -> None:
        """Add the line of a job that has just finished."""
        _append(self._path, job)
        for name in job.outputs:
            self._inputs[name] = job.inputs
            self.sums.pop(name, None)
            if name in job.files:
                self.sums[name] = job.files[name].sha256

    @cached_property
    def damage(self) -> dict[str, tuple[str, list[str]]]:
        """For each damaged path: what is wrong with it, and the outputs of the job that made it.

        A file with other times is compared by its SHA-256. If a job's outputs are all missing, they
        do not count, because Snakemake detects them. A file that a later job replaced is not
        damaged: see `replaced`.
        """
        damage = {}
        for job in self._suspects:
            has_output = any(map(os.path.lexists, job.outputs))
            for name, stamp in job.files.items():
                is_left_to_snakemake = name in job.outputs and not has_output
                if is_left_to_snakemake or stamp.is_current(name) or name in self.replaced:
                    continue
                if problem := _problem(name, stamp):
                    damage[name] = (problem, job.outputs)
        return damage

    @cached_property
    def replaced(self) -> dict[str, list[str]]:
        """For each file that a later job replaced: the outputs of an earlier job that lists it.

        These outputs are outdated, but the file is as the later job wrote it.
        """
        replaced = {}
        for job in self._suspects:
            for name, stamp in job.files.items():
                latest = self._latest[name]
                if latest.sha256 != stamp.sha256 and _problem(name, latest) is None:
                    replaced[name] = job.outputs
        return replaced

    def refresh(self) -> None:
        """Note the present times of files that have new times, but the same content."""
        for job in self._suspects:
            if not (self.damage.keys() | self.replaced.keys()) & job.files.keys():
                files = {
                    name: Stamp.of(name, stamp.sha256)
                    for name, stamp in job.files.items()
                    if Path(name).exists()
                }
                _append(self._path, job._replace(files=files))

    def outdated_outputs(self) -> Iterator[str]:
        """Yield the outputs that were made from other content than their inputs have now."""
        return (output for output in self._inputs if self.changed_input(output) is not None)

    def has_other_inputs(self, output: str, names: set[str], *, may_lack: bool = False) -> bool:
        """Return whether an output was made from other paths than ``names``. Ignores their content.

        With ``may_lack``, the ledger may lack some of ``names``.
        """
        noted = self._inputs.get(output)
        if noted is None:
            return False
        return not noted.keys() <= names if may_lack else noted.keys() != names

    def changed_input(self, output: str) -> str | None:
        """Return an input that has changed since an output was made from it, or None.

        Ignores an input that no longer exists, because Snakemake handles it.
        """
        for name, stamp in self._inputs[output].items():
            if name in self.sums:
                if self.sums[name] != stamp.sha256:
                    return name
            elif not stamp.is_current(name) and _has_changed(name, stamp):
                return name
        return None

    def last_read(self, name: str, digest: str) -> int | None:
        """Return the time in nanoseconds of an input with this SHA-256. None if no job read it."""
        for inputs in self._inputs.values():
            if name in inputs and inputs[name].sha256 == digest:
                return inputs[name].modified_ns
        return None

    def input_stamps(self, names: Iterable[str]) -> dict[str, Stamp]:
        """Return the stamps of a job's inputs, before it starts. Skips files that do not exist."""
        stamps = {}
        for name in names:
            if Path(name).is_file():
                stamps[name] = Stamp.of(name, self._trusted_sum(name) or _digest_now(name))
        return stamps

    def _trusted_sum(self, name: str) -> str | None:
        """Return the noted SHA-256 of an undamaged file. None if it is damaged or unknown."""
        return None if name in self.damage else self.sums.get(name)

    def compact(self) -> None:
        """Write the ledger without the lines that no longer count."""
        with locked(self._path):
            current_jobs: list[Job] = []
            outputs: set[str] = set()
            for job in jobs(self._path):
                if not outputs.issuperset(job.outputs):
                    outputs.update(job.outputs)
                    current_jobs.append(job)
            _write(self._path, current_jobs)


def jobs(path: Path) -> Iterator[Job]:
    """Yield the jobs of a ledger, the latest first. Skips damaged lines.

    Yields nothing if there is no ledger.
    """
    for line in reversed(_lines(path)):
        job = _parse(line)
        if job is not None:
            yield job


def damaged_lines(path: Path) -> list[int]:
    """Return the numbers, from 1 on, of the damaged lines."""
    return [number for number, line in enumerate(_lines(path), 1) if _parse(line) is None]


def read(path: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in the ledger, also of history, by its path."""
    digests: dict[str, str] = {}
    for job in jobs(path):
        for name, stamp in (*job.files.items(), *job.history.items()):
            digests.setdefault(name, stamp.sha256)
    return digests


def forget(path: Path, name: str) -> None:
    """Remove a file of history from every line."""
    with locked(path):
        changed_jobs = []
        for job in jobs(path):
            history = {other: stamp for other, stamp in job.history.items() if other != name}
            changed_jobs.append(job._replace(history=history))
        _write(path, changed_jobs)


def _write(path: Path, latest_first: list[Job]) -> None:
    """Replace a ledger by the lines of these jobs."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(b"".join(map(_line, reversed(latest_first))))


def _has_changed(name: str, stamp: Stamp) -> bool:
    """Return whether a file has other bytes than its stamp. False for a missing file."""
    try:
        return _digest_now(name) != stamp.sha256
    except OSError:
        return False


def _digest_now(name: str) -> str:
    """Return the SHA-256 of a file. Reads it once: thousands of shards may depend on one .blend."""
    status = os.stat(name)  # noqa: PTH116, as above
    return _digest(name, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


@lru_cache(maxsize=64)
def _digest(name: str, _bytes: int, _modified_ns: int, _changed_ns: int) -> str:
    return sha256(name)


def _problem(name: str, stamp: Stamp) -> str | None:
    """Return what is wrong with a file. None if it has the bytes of its stamp."""
    if not os.path.lexists(name):
        return "is missing"
    if problem := broken(Path(name)):
        return problem
    try:
        is_same = sha256(name) == stamp.sha256
    except OSError as error:
        return f"cannot be read: {read_problem(error)}"
    return None if is_same else f"its sha256 is not the one in {NAME}"


def _lines(path: Path) -> list[bytes]:
    if unreadable(path) or not path.exists():
        return []
    try:
        return path.read_bytes().splitlines()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None


def _parse(line: bytes) -> Job | None:
    digest, _, text = line.partition(b" ")
    if digest.decode(errors="replace") != hashlib.sha256(text).hexdigest():
        return None
    try:
        content = json.loads(text)
        return Job(
            [_checked(name, str) for name in _checked(content["outputs"], list)],
            _stamps(content["files"]),
            _stamps(content["history"]),
            _stamps(content["inputs"]),
        )
    except DAMAGE:
        return None


def _stamps(entries: Mapping[str, Any]) -> dict[str, Stamp]:
    return {name: _stamp(*entry) for name, entry in entries.items()}


def _stamp(digest: Any, *numbers: Any) -> Stamp:
    return Stamp(_checked(digest, str), *(_checked(number, int) for number in numbers))


def _checked(value: Any, kind: type) -> Any:
    """Return a value of a type. Raises TypeError for a value of another type."""
    if not isinstance(value, kind):
        raise TypeError(f"is not a {kind.__name__}")
    return value


def _line(job: Job) -> bytes:
    text = json.dumps(job._asdict(), separators=(",", ":")).encode()
    return hashlib.sha256(text).hexdigest().encode() + b" " + text + b"\n"


def _append(path: Path, job: Job) -> None:
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        line = _line(job)
        with locked(path), path.open("a+b") as file:
            if file.tell():
                # A kill or a full disk may have cut the last line short.
                file.seek(-1, os.SEEK_END)
                line = line if file.read() == b"\n" else b"\n" + line
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
