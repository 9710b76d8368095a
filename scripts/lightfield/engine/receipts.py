"""Receipts: what each job read, with which settings, and what it made.

A receipt is a file with one JSON object a line. The job writes it last, in one step:

- the first line has ``job``, the path of the receipt in `FOLDER` without its suffix, so that a
  copy in another place is no receipt. It also has ``stage``, ``version`` and ``settings`` of the
  job, and ``inputs``: the SHA-256 of each file that it read, by path. An input that is itself a
  receipt has `Receipt.sum`, and stands for the files that its job made;
- a line for each file that it made: ``file``, ``sha256``, ``bytes``, ``modified_ns``, and for views
  ``key``, the hash of all that decides their bytes;
- lines of history: what the processes of the job did, and how fast (`lightfield.workflow.history`).

While the job works, it appends lines to the file ``.part`` beside the receipt, and holds a lock on
it. The kernel frees the lock when the process ends. After a kill, the next try goes on from these
lines. Paths are relative to the folder in which the workflow runs.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import IO, Any, NamedTuple

from lightfield.core.errors import OutsideError, UserError
from lightfield.core.files import (
    DAMAGE,
    Stamp,
    append_json_line,
    atomic_path,
    file_watchers,
    read_bytes,
    read_error,
    read_json_lines,
    read_watchers,
    set_aside,
    unreadable,
    writing,
)
from lightfield.core.locks import lock
from lightfield.core.paths import is_normal
from lightfield.engine.read_files import ReadFiles, changed_since_plan

FOLDER = "receipts"
"""The folder of all receipts, in the workflow's folder of intermediate files."""
SUFFIX = ".jsonl"
PART_SUFFIX = ".part"
REMOVED = "removed"
"""The folder beside `FOLDER` to which damaged files are moved."""

# The receipt of a shard has the numbers of its first view and of the view after its last.
SHARD = re.compile(r"(\d+)-(\d+)\.(?:jsonl|part)")


class Output(NamedTuple):
    """A file that a job made: its stamp before it was renamed, and the key of its content."""

    stamp: Stamp
    key: str | None = None

    def is_intact(self, path: str | Path) -> bool:
        """Return whether a file is as it was made. Reads it only if its size or time differs."""
        return self.stamp.matches(path) or self.has_bytes(path)

    def has_bytes(self, path: str | Path) -> bool:
        """Return whether a file has the bytes that were made. Reads it."""
        try:
            return Stamp.of(path).sha256 == self.stamp.sha256
        except (OSError, ValueError):
            return False


@dataclass(frozen=True)
class Receipt:
    """What a finished job read and made. Paths are its keys."""

    stage: str
    version: int | None
    settings: Mapping[str, Any]
    inputs: Mapping[str, str | None]
    outputs: Mapping[str, Output]
    history: list[dict[str, Any]] = field(default_factory=list)

    @cached_property
    def sum(self) -> str:
        """The SHA-256 of what the job made. It has no times: an equal remake has an equal sum."""
        lines = [f"{path} {output.stamp.sha256}\n" for path, output in sorted(self.outputs.items())]
        return hashlib.sha256("".join(lines).encode(errors="surrogatepass")).hexdigest()


def read(path: str | Path) -> Receipt | None:
    """Return a receipt. None if there is none, if it is damaged, or if it is of another job."""
    try:
        text = read_bytes(path)
        # One text of JSON is read faster than many.
        header, *lines = json.loads(b"[%s]" % b",".join(text.splitlines()))
        # Receipts of before 29 November 2026 name no job.
        if header.get("job", job_of(path)) != job_of(path):
            return None
        outputs, history = _sorted(lines)
        return Receipt(
            _checked(header["stage"], str),
            header["version"],
            _checked(header["settings"], dict),
            _checked(header["inputs"], dict),
            outputs,
            history,
        )
    except (OSError, *DAMAGE):
        return None


def read_part(path: Path) -> tuple[dict[str, Output], list[dict[str, Any]]]:
    """Return the outputs and the history of an unfinished receipt. Skips damaged lines.

    ``path`` is the path of the receipt.
    """
    outputs: dict[str, Output] = {}
    history: list[dict[str, Any]] = []
    with suppress(UserError):
        for line in read_json_lines(path.with_suffix(PART_SUFFIX)):
            with suppress(*DAMAGE):
                more_outputs, more_history = _sorted([line])
                outputs |= more_outputs
                history += more_history
    return outputs, history


def noted(path: Path) -> tuple[dict[str, Output], list[dict[str, Any]]]:
    """Return the outputs and the history of a job, finished or not.

    ``path`` is the path of its receipt. The history is in the order of time, and has killed
    processes.
    """
    receipt = read(path)
    outputs, history = read_part(path)
    if receipt is None:
        return outputs, history
    return {**receipt.outputs, **outputs}, [*receipt.history, *history]


def history(path: Path) -> list[dict[str, Any]]:
    """Return the history of a job, finished or not."""
    return noted(path)[1]


def _sorted(lines: Iterable[dict[str, Any]]) -> tuple[dict[str, Output], list[dict[str, Any]]]:
    """Return outputs and history of a receipt's lines."""
    outputs: dict[str, Output] = {}
    history: list[dict[str, Any]] = []
    for line in lines:
        if "file" in line:
            stamp = Stamp(
                _checked(line["sha256"], str),
                _checked(line["bytes"], int),
                _checked(line["modified_ns"], int),
            )
            if not is_normal(line["file"]):
                raise ValueError("is not a path in normal form")
            outputs[line["file"]] = Output(stamp, line.get("key"))
        else:
            history.append(line)
    return outputs, history


def _checked(value: Any, kind: type) -> Any:
    """Return a value of a type. Raises TypeError for a value of another type."""
    if not isinstance(value, kind):
        raise TypeError(f"is not a {kind.__name__}")
    return value


def _line(path: str, output: Output) -> dict[str, Any]:
    line: dict[str, Any] = {"file": path, **output.stamp._asdict()}
    return line if output.key is None else line | {"key": output.key}


def job_of(path: str | Path) -> str:
    """Return the name of a receipt's job: its path in `FOLDER`, without its suffix."""
    _, _, job = f"/{Path(path).with_suffix('').as_posix()}".rpartition(f"/{FOLDER}/")
    return job


def is_receipt(path: str | Path) -> bool:
    """Return whether a path leads to a receipt."""
    return str(path).endswith(SUFFIX) and FOLDER in Path(path).parts


def is_shard(path: Path) -> bool:
    """Return whether a receipt is of a shard of views."""
    return bool(SHARD.fullmatch(path.name))


def input_sum(path: str | Path) -> str | None:
    """Return what a receipt says of an input: a SHA-256, or the sum of a receipt.

    None if there is no such file.
    """
    if is_receipt(path):
        receipt = read(path)
        return receipt.sum if receipt else None
    try:
        return Stamp.of(path).sha256
    except OSError:
        return None


def find_output(path: str | Path, work: str | Path) -> tuple[Path, Output] | None:
    """Return the receipt of the job that made a file, and its line of the file. None without one.

    The receipt of a file in results/garden or work/garden lies in work/receipts/garden, or in the
    folder of one of its subfolders there. Views have none here, because their shards are known.
    """
    parts = Path(path).parts[:-1]
    for start in range(len(parts) + 1):
        for end in range(len(parts), start - 1, -1):
            folder = os.path.join(work, FOLDER, *parts[start:end])  # noqa: PTH118, for many files
            found = _made_by(folder, _time(folder)).get(str(path))
            if found:
                return found
    return None


def _time(folder: str) -> int:
    """Return when a receipt was last added to a folder. 0 for a folder that does not exist."""
    try:
        return os.stat(folder).st_mtime_ns  # noqa: PTH116, for many files
    except OSError:
        return 0


@lru_cache(maxsize=1000)
def _made_by(folder: str, time: int) -> dict[str, tuple[Path, Output]]:
    """Return the receipt and its line for each file of the receipts in a folder, but of shards."""
    found = {}
    for receipt_path in sorted(Path(folder).glob(f"*{SUFFIX}")) if time else ():
        receipt = None if is_shard(receipt_path) else read(receipt_path)
        for path, output in receipt.outputs.items() if receipt else ():
            found[path] = (receipt_path, output)
    return found


def made_in(folder: Path, inputs: Iterable[str | Path], work: Path | None) -> dict[str, Output]:
    """Return the outputs of jobs in a folder, by their paths in it.

    The jobs are those that made the ``inputs``, and the job that works in this process. ``inputs``
    may be the receipts of shards. ``work`` is the workflow's folder of intermediate files.
    """
    outputs = dict(_open_receipts[-1].outputs) if _open_receipts else {}
    for path in inputs:
        receipt_path: str | Path | None = path
        if not is_receipt(path):
            found = find_output(path, work) if work else None
            receipt_path = found[0] if found else None
        receipt = read(receipt_path) if receipt_path else None
        if receipt:
            outputs |= receipt.outputs
    beginning = f"{name_of(folder)}/"
    return {
        path.removeprefix(beginning): output
        for path, output in outputs.items()
        if path.startswith(beginning)
    }


class OpenReceipt:
    """The receipt of a job that works now.

    It keeps finished files, notes those that the job makes, and is written when all are made. Its
    lock keeps other processes away from them. ``made`` are the paths that the job makes: files, or
    folders of files. Other files that its process writes are not its outputs.
    """

    def __init__(self, path: Path, header: Mapping[str, Any], made: Iterable[Path]) -> None:
        self.path = path
        self.work = work_of(path)
        self._header = header
        made = [*made]
        self._files = [path for path in made if path.suffix]
        # How the paths of made files begin, absolute and without links, and in the receipt.
        self._beginnings = {}
        for each in made:
            for form in (each.resolve(), each.absolute()):
                self._beginnings[_stem(form)] = _stem(each)
        self._part = path.with_suffix(PART_SUFFIX)
        self._threads = threading.Lock()
        self.inputs: dict[str, str | None] = {}
        self.outputs: dict[str, Output] = {}
        self._read = ReadFiles()
        self._shared: set[str] = set()
        # The SHA-256 of files that other jobs made, and of files that the makers of inputs read.
        self._made_files: dict[str, str | None] = {}
        self._read_before: dict[str, str | None] = {}
        self._makers: set[Path] = set()
        self._lock = _locked(self._part)
        self._earlier = earlier = read(path)
        self._known = {**(earlier.outputs if earlier else {}), **read_part(path)[0]}

    def add_input(self, path: str | Path) -> None:
        """Note a file that the job reads, before it reads it.

        Raises `UserError` for a file of another job that is not as that job made it, and for a
        user's file that has changed since a job read it that made another input.
        """
        name = name_of(path)
        if name in self.inputs:
            return
        if is_receipt(name):
            if (receipt := read(name)) is None:
                raise OutsideError(f"{name}: is missing or damaged; the next run makes it again")
            self.inputs[name] = receipt.sum
            for made, output in receipt.outputs.items():
                self._made_files[made] = output.stamp.sha256
            return
        # Compare only what is new, or many inputs would take the square of their number.
        compared = [name, *self._note_maker(name)]
        self.inputs[name] = self._sum_of_input(name)
        for each in compared:
            if each not in self.inputs or each not in self._read_before:
                continue
            is_of_user = not is_receipt(each) and self._made(each) is None
            if is_of_user and self.inputs[each] != self._read_before[each]:
                raise changed_since_plan(each)

    def _note_maker(self, name: str) -> Iterable[str]:
        """Note what the job read that made an input. Return these files if they are new."""
        found = find_output(name, self.work)
        if found is None or found[0] in self._makers:
            return ()
        self._makers.add(found[0])
        maker = read(found[0])
        inputs = maker.inputs if maker else {}
        self._read_before |= inputs
        return inputs.keys()

    def _sum_of_input(self, name: str) -> str | None:
        """Return the SHA-256 of an input. None if it is missing, because scenes may lack files.

        The job runs again when it appears.
        """
        if not os.path.isfile(name):  # noqa: PTH113, a `Path` raises for names that are too long
            return None
        try:
            return self._read.read(name, self._made(name))
        except OSError as error:
            raise read_error(name, error) from None

    def add_shared_input(self, path: str | Path) -> None:
        """Note a file that the job reads, and that another run may replace meanwhile.

        The job need not fail then, because that run does this job again.
        """
        name = name_of(path)
        self._shared.add(name)
        self.inputs[name] = input_sum(name)

    def watch(self, path: str | Path) -> str | None:
        """Compare a file that is about to be read with its maker's receipt. Return its SHA-256.

        Returns None for a file that is not compared: without a maker, or of this job itself.
        Raises `UserError` for a damaged one.
        """
        name = name_of(path)
        digest = self._read.read_made(name, self._made(name))
        if name in self.outputs:
            # The job itself may write its file again, or remove it.
            self._read.forget(name)
        return digest

    def _made(self, name: str) -> str | None:
        """Return the SHA-256 with which a job made a file. None for a file without a maker."""
        if name in self._shared or is_receipt(name):
            return None
        if output := self.outputs.get(name):
            return output.stamp.sha256
        if name not in self._made_files:
            found = find_output(name, self.work)
            # A job may make its own files again.
            is_of_other = found and found[0] != self.path
            self._made_files[name] = found[1].stamp.sha256 if found and is_of_other else None
        return self._made_files[name]

    def still_holds(self) -> bool:
        """Return whether the job was finished before, with equal settings and inputs.

        So it is if Snakemake starts a job that was killed after its receipt was written, or a job
        after one whose outputs were made again with equal bytes.
        """
        earlier = self._earlier
        if earlier is None:
            return False
        header = {"stage": earlier.stage, "version": earlier.version, "settings": earlier.settings}
        return (
            header == self._header
            # Another program wrote the line of a file that the job does not make.
            and all(self._own_name(path) == path for path in earlier.outputs)
            and self.inputs.items() <= earlier.inputs.items()
            and all(
                name in self.inputs or input_sum(name) == digest
                for name, digest in earlier.inputs.items()
            )
            and all(output.is_intact(path) for path, output in earlier.outputs.items())
        )

    def keep(self) -> None:
        """Keep the earlier receipt."""
        self._part.unlink()

    def is_finished(self, file: Path, key: str) -> bool:
        """Return whether a file has the bytes that the settings of ``key`` made.

        Moves a damaged file aside. A file of another key stays until it is overwritten.
        """
        path = name_of(file)
        output = self._known.get(path) or self._made_elsewhere(path)
        if output and output.key == key and output.is_intact(path):
            with self._threads:
                self.outputs[path] = output
            return True
        if (output and output.key == key) or unreadable(path):
            self._set_aside(file)
        return False

    def add(self, file: Path, key: str) -> None:
        """Note the key of a file that was just written, so that a kill does not lose it."""
        path = name_of(file)
        with self._threads:
            output = self.outputs[path]._replace(key=key)
            self.outputs[path] = output
            append_json_line(self._part, _line(path, output))

    def log(self, entry: Mapping[str, Any]) -> None:
        """Add a line of history, at once."""
        with self._threads:
            append_json_line(self._part, entry)

    def note_written(self, path: Path, stamp: Stamp) -> None:
        """Note a file that `atomic_path` writes, if the job makes it."""
        if name := self._own_name(path):
            with self._threads:
                self.outputs[name] = Output(stamp)

    def _own_name(self, path: str | Path) -> str | None:
        """Return how the receipt names a file that the job makes. None for another file."""
        text = os.path.abspath(path)  # noqa: PTH100, it removes ..
        for beginning, name in self._beginnings.items():
            if text.startswith(beginning):
                return name_of(name + text.removeprefix(beginning))
        return None

    def note_kept(self, file: Path) -> None:
        """Note a file of an earlier job, which this job would make equal."""
        with self._threads:
            self.outputs[name_of(file)] = Output(Stamp.of(file))

    def knows(self, file: Path) -> bool:
        """Return whether this job or another shard has noted a file."""
        path = name_of(file)
        return path in self._known or self._made_elsewhere(path) is not None

    def adopt(self, file: Path, key: str) -> None:
        """Note a file that an older version of this program made."""
        path = name_of(file)
        output = Output(Stamp.of(file), key)
        with self._threads:
            self._known[path] = output
            append_json_line(self._part, _line(path, output))

    def set_damaged_aside(self) -> None:
        """Move the job's files aside that were made without a key, and are damaged now.

        A receipt that names other files is no reason to move them.
        """
        for path, output in self._known.items():
            is_own = output.key is None and self._own_name(path) and os.path.lexists(path)
            if is_own and not output.is_intact(path):
                self._set_aside(Path(path))
        for file in self._files:
            if unreadable(file):
                self._set_aside(file)

    def set_all_damaged_aside(self) -> list[str]:
        """Move each damaged file aside that this job or an earlier try made. Reads all of them.

        Returns the paths of these files, and of files that this job has made and that are gone.
        """
        damaged_files = []
        for path, output in {**self._known, **self.outputs}.items():
            must_be_there = path in self.outputs or os.path.lexists(path)
            if must_be_there and self._own_name(path) and not output.has_bytes(path):
                self._set_aside(Path(path))
                damaged_files.append(path)
        return damaged_files

    def keep_intact_files(self) -> None:
        """Note all files that an earlier try made, and that still have their bytes."""
        for path, output in self._known.items():
            if path not in self.outputs and self._own_name(path) and output.has_bytes(path):
                self.outputs[path] = output

    def check_inputs(self) -> None:
        """Raise `UserError` if a file that was read has or had other bytes than it must have."""
        self._read.check()

    def seal(self) -> None:
        """Write the receipt."""
        if unreadable(self.path):
            self._set_aside(self.path)
        earlier_history = self._earlier.history if self._earlier else []
        history = [*earlier_history, *read_part(self.path)[1]]
        # A file that the job itself has removed again is no output.
        made = {path: output for path, output in self.outputs.items() if os.path.lexists(path)}
        outputs = [_line(path, output) for path, output in sorted(made.items())]
        header = {"job": job_of(self.path), **self._header, "inputs": self.inputs}
        lines = [json.dumps(line) + "\n" for line in (header, *outputs, *history)]
        with atomic_path(self.path) as temporary:
            temporary.write_text("".join(lines), encoding="utf-8")
        self._part.unlink()

    def close(self) -> None:
        """Free the lock."""
        self._lock.close()

    def _set_aside(self, path: Path) -> None:
        if os.path.lexists(path):
            moved = set_aside(path, self.work / REMOVED)
            print(f"{path}: is damaged; it was moved to {moved} and is made again", flush=True)

    def _made_elsewhere(self, path: str) -> Output | None:
        """Return the output of another shard, which had other bounds."""
        return self._elsewhere.get(path) if is_shard(self.path) else None

    @cached_property
    def _elsewhere(self) -> dict[str, Output]:
        """The outputs of the other shards beside this one."""
        outputs: dict[str, Output] = {}
        shards = {path.with_suffix(SUFFIX) for path in self.path.parent.iterdir()}
        for shard in sorted(shards - {self.path}):
            outputs |= noted(shard)[0]
        return outputs


def _stem(path: Path) -> str:
    """Return how the paths of made files begin.

    lens_map.npy also stands for lens_map_front.npy, and error_vs_time/smoke for smoke.json.
    """
    return str(path.with_suffix(""))


def name_of(path: str | Path) -> str:
    """Return a path as receipts have it: relative, if it is below the present folder."""
    name = os.path.normpath(path)
    here = f"{Path.cwd()}/"
    return name.removeprefix(here)


def work_of(path: Path) -> Path:
    """Return the workflow's folder of intermediate files, in which a receipt lies."""
    return Path(*path.parts[: path.parts.index(FOLDER)])


def make_way(path: Path, work: Path) -> None:
    """Move away a link, or what is no file, from the place of a file that is about to be changed.

    A link would lead the change to another file. ``work`` is the folder of intermediate files.
    """
    if path.is_symlink() or unreadable(path):
        set_aside(path, work / REMOVED)


def _locked(part: Path) -> IO[bytes]:
    """Return the open, locked file of an unfinished receipt.

    Waits for another process that makes the same files: of a killed run, or of a run of another
    scene that also lists all datasets.
    """
    make_way(part, work_of(part))
    part.parent.mkdir(parents=True, exist_ok=True)
    while True:
        with writing(part):
            file = part.open("ab")
        try:
            lock(file, "a process of another run that makes the same files")
        except OSError as error:
            print(f"warning: {part}: cannot be locked: {error.strerror}", file=sys.stderr)
        # The process that held the lock may have removed the file.
        if part.exists() and os.path.samestat(os.fstat(file.fileno()), part.stat()):
            return file
        file.close()


# The receipts of the jobs that work in this process. A batch of members has jobs in a job.
_open_receipts: list[OpenReceipt] = []


def current() -> OpenReceipt | None:
    """Return the receipt of the job that works in this process. None without a receipt."""
    return _open_receipts[-1] if _open_receipts else None


def note_inputs(paths: Iterable[str | Path]) -> None:
    """Note files that the job at work is about to read, if the job has a receipt."""
    if receipt := current():
        for path in paths:
            receipt.add_input(path)


def note_shared_inputs(paths: Iterable[str | Path]) -> None:
    """Note files as `note_inputs` does. Another run may replace them while the job reads them."""
    if receipt := current():
        for path in paths:
            receipt.add_shared_input(path)


@contextmanager
def opened(path: Path, header: Mapping[str, Any], made: Iterable[Path]) -> Iterator[OpenReceipt]:
    """Open the receipt of a job. Whoever opens it seals it, or keeps the earlier one."""
    receipt = OpenReceipt(path, header, made)
    receipt.set_damaged_aside()
    _open_receipts.append(receipt)
    file_watchers.append(receipt.note_written)
    read_watchers.append(receipt.watch)
    try:
        yield receipt
    finally:
        read_watchers.pop()
        file_watchers.pop()
        _open_receipts.pop()
        receipt.close()
