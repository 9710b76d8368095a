"""Reads, writes and moves files. A file that this module writes is complete or absent."""

import csv
import hashlib
import json
import os
import shutil
import stat
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import Any, NamedTuple, Self

from lightfield.core.disk_space import write_problem
from lightfield.core.errors import OutsideError, UserError, is_outside

_SPECIAL_KINDS = {
    stat.S_IFIFO: "a FIFO",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def special_kind(path: Path | str) -> str | None:
    """Return what a path is that is neither a file nor a folder. None for all other paths.

    Nobody may open such a path: a FIFO waits for a writer, and a device may have no end.
    """
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116, a `Path` is slow for many files
    except (OSError, ValueError):
        return None
    return _SPECIAL_KINDS.get(stat.S_IFMT(mode))


# Called with the path of each file before it is read: the last of them. It may raise a `UserError`,
# and returns the file's SHA-256 if it knows it.
read_watchers: list[Callable[[Path | str], str | None]] = []


def open_file(path: Path | str) -> BufferedReader:
    """Open a file to read it. Raises OSError if it is missing, or if it is no file.

    Every file goes through here before a program or a library reads it, so that a job reads no
    damaged file: see `lightfield.engine.read_files`.
    """
    _watch(path)
    return _opened(path)


def _watch(path: Path | str) -> str | None:
    return read_watchers[-1](path) if read_watchers else None


def _opened(path: Path | str) -> BufferedReader:
    if kind := special_kind(path):
        raise OSError(f"it is {kind}, not a file")
    return Path(path).open("rb")


def read_bytes(path: Path | str) -> bytes:
    """Return the content of a file. Raises OSError as `open_file` does."""
    with open_file(path) as file:
        return file.read()


class Identity(NamedTuple):
    """What differs after a file was written. Times are in nanoseconds.

    Programs can set the time of modification, but not the time of change.
    """

    bytes: int
    modified_ns: int
    changed_ns: int
    inode: int
    links: int

    @classmethod
    def of(cls, path: str | Path) -> Self | None:
        """Return the identity of a file. None if there is no file."""
        try:
            # A `Path` is slow for many files.
            status = os.stat(path)  # noqa: PTH116
        except (OSError, ValueError):
            # No file has a name with such letters.
            return None
        return cls._of(status) if stat.S_ISREG(status.st_mode) else None

    @classmethod
    def _of(cls, status: os.stat_result) -> Self:
        times = (status.st_mtime_ns, status.st_ctime_ns)
        return cls(status.st_size, *times, status.st_ino, status.st_nlink)


def identity_and_sha256(path: str | Path) -> tuple[Identity, str]:
    """Return the identity of a file from before it was read, and its SHA-256. Raises OSError."""
    with _opened(path) as file:
        identity = Identity._of(os.fstat(file.fileno()))
        return identity, hashlib.file_digest(file, "sha256").hexdigest()


class Stamp(NamedTuple):
    """A file's SHA-256, size, and time of modification in nanoseconds."""

    sha256: str
    bytes: int
    modified_ns: int

    @classmethod
    def of(cls, path: str | Path) -> Self:
        """Return the stamp of a file. Reads it. Raises OSError if it is missing, or no file."""
        identity, digest = identity_and_sha256(path)
        return cls(digest, identity.bytes, identity.modified_ns)

    def matches(self, path: str | Path) -> bool:
        """Return whether a file has this size and time."""
        return size_and_time(path) == (self.bytes, self.modified_ns)


# Called with the path and the stamp of each file that `atomic_path` writes: the last of them.
file_watchers: list[Callable[[Path, Stamp], None]] = []


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError into an `OutsideError` that names ``path``, the cause, and what to do."""
    try:
        yield
    except OSError as error:
        raise OutsideError(f"{path}: cannot be written: {write_problem(path, error)}") from None


def read_problem(error: OSError) -> str:
    """Return why reading a file raised ``error``, and what to do."""
    if isinstance(error, PermissionError):
        return "you may not read it: change its permissions (chmod u+r)"
    return error.strerror or str(error)


def read_error(place: Path | str, error: OSError) -> UserError:
    """Return the error about a file, or a ``place`` in it, whose reading raised ``error``."""
    kind = OutsideError if is_outside(error) else UserError
    return kind(f"{place}: cannot be read: {read_problem(error)}")


def check_readable(path: Path | str) -> None:
    """Raise `UserError` for a file that is missing, no file, or one that the user may not read.

    Call this before a library reads the file: many libraries would report a wrong format.
    """
    try:
        open_file(path).close()
    except OSError as error:
        raise read_error(path, error) from None


@contextmanager
def atomic_path(target: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside ``target``. On success flush it to disk, and rename it.

    The temporary name keeps the target's suffix, because image writers choose the format by it. It
    has a random number, because processes in several containers may have the same process number.
    On any error the temporary file is removed, and the target stays as it was. An OSError, and an
    empty file, become a `UserError`. Python itself raises an error if it cannot write all bytes.
    Some libraries do not: then the caller must check the file, and raise an OSError.
    """
    target = Path(target)
    number = int.from_bytes(os.urandom(4))
    temporary = target.parent / f".{target.stem}.{number}.tmp{target.suffix}"
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            # Open it for reading: it may be a hard link to a file that nobody may write.
            with temporary.open("rb") as file:
                if not file.seek(0, os.SEEK_END):
                    raise OSError("the file is empty")
                os.fsync(file.fileno())
            # Nobody else has seen the file yet, so these are the bytes that were written.
            stamp = Stamp.of(temporary) if file_watchers else None
            temporary.replace(target)
            if stamp:
                file_watchers[-1](target, stamp)
        finally:
            temporary.unlink(missing_ok=True)


def link_or_copy(file: Path, target: Path) -> None:
    """Make ``target`` a hard link to ``file``, or a copy if the file system has no hard links.

    A copy has the file's time of modification, too.
    """
    check_readable(file)
    with atomic_path(target) as temporary:
        try:
            # Resolve symbolic links, as git-annex has. Linux would link the symbolic link itself.
            os.link(file.resolve(), temporary)
        except OSError:
            shutil.copyfile(file, temporary)
            status = file.stat()
            os.utime(temporary, ns=(status.st_atime_ns, status.st_mtime_ns))


def sha256(path: Path | str) -> str:
    """Return the SHA-256 of a file as 64 hexadecimal digits."""
    return _watch(path) or identity_and_sha256(path)[1]


def size_and_time(path: Path | str) -> tuple[int, int] | None:
    """Return a file's bytes and its time of modification in ns. None if there is no file."""
    identity = Identity.of(path)
    return (identity.bytes, identity.modified_ns) if identity else None


def listed(path: Path, home: Path) -> dict[str, Any]:
    """Return the entry of a file in a list: its path from ``home``, size, time and SHA-256.

    The last three are None if there is no file.
    """
    entry: dict[str, Any] = {"path": Path(os.path.relpath(path, home)).as_posix()}
    stamp = size_and_time(path)
    if stamp is None:
        return entry | dict.fromkeys(("bytes", "mtime_ns", "sha256"))
    return entry | {"bytes": stamp[0], "mtime_ns": stamp[1], "sha256": sha256(path)}


def write_bytes(path: Path | str, content: bytes) -> None:
    """Write ``content``, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path | str, text: str) -> None:
    """Write ``text`` in UTF-8, atomically."""
    write_bytes(path, text.encode())


def write_json(path: Path | str, content: Any) -> None:
    """Write ``content`` as JSON, atomically. Raises ValueError for NaN and infinities."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_csv(path: Path | str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows with the same columns as CSV, atomically. The first line names the columns."""
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def append_json_line(path: Path, entry: Mapping[str, Any]) -> None:
    """Append ``entry`` to a file with one JSON object a line, and flush it to disk.

    If a kill or a full disk cut the last line short, that line is ended first.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        line = json.dumps(entry).encode() + b"\n"
        with path.open("a+b") as file:
            if file.tell():
                file.seek(-1, os.SEEK_END)
                line = line if file.read() == b"\n" else b"\n" + line
            file.write(line)
            file.flush()
            os.fsync(file.fileno())


def read_json_lines(path: Path) -> list[dict[str, Any]]:
    """Return the objects of a file with one JSON object a line. Skips all other lines."""
    entries = []
    try:
        content = read_bytes(path)
    except OSError as error:
        raise read_error(path, error) from None
    for line in content.splitlines():
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(entry, dict):
            entries.append(entry)
    return entries


def unreadable(path: Path | str) -> str | None:
    """Return why a path cannot be read as a file. None if it can, or if nothing is there."""
    if os.path.isdir(path):  # noqa: PTH112, a `Path` is slow for 100,000 files
        return "is a folder"
    if kind := special_kind(path):
        return f"is {kind}, not a file"
    if os.path.lexists(path) and not os.access(path, os.R_OK):
        if not os.path.exists(path):  # noqa: PTH110
            return "is a link that leads to no file"
        return "cannot be read: Permission denied"
    return None


def broken(path: Path) -> str | None:
    """Return what is wrong with a file that a program wrote. None if nothing is, or it is missing.

    A JSON file of a dataset must hold a mapping.
    """
    if (problem := unreadable(path)) is not None:
        return problem
    try:
        if not path.stat().st_size:
            return "is empty"
        if path.suffix == ".json" and not isinstance(content := read_json(path), dict):
            return f"is a {type(content).__name__}, not a mapping"
        with path.open("rb"):
            return None
    except FileNotFoundError:
        return None
    except OSError as error:
        return f"cannot be read: {read_problem(error)}"
    except UserError as error:
        return str(error).removeprefix(f"{path}: ")


def absolute_path(path: Path) -> Path:
    """Return a path from the root, without ``.`` and ``..``, so that its name and parents show.

    Symbolic links are kept, because the names behind them may differ.
    """
    return Path(os.path.normpath(path.absolute()))


def keep_apart(flag: str, written: Path, *read: Path | None) -> None:
    """Raise `UserError` if a program's ``flag`` makes it write a path that it also reads."""
    if any(path is not None and path.resolve() == written.resolve() for path in read):
        raise UserError(f"{flag} {written}: is an input, which would be lost; give another path")


def set_aside(path: Path, folder: Path) -> Path:
    """Move a file or folder into ``folder``, under its own path, and return its new path.

    Its own path is relative to the current folder, or to the root if it lies outside. If the new
    path exists already, the moved file gets a number after its name.
    """
    inside = Path(os.path.normpath(path))
    if inside.is_absolute() or ".." in inside.parts:
        inside = absolute_path(path).relative_to(path.absolute().anchor)
    target = folder / inside
    number = 1
    while os.path.lexists(target):
        number += 1
        target = folder / inside.with_name(f"{path.name}.{number}")
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(path, target)
    return target


def read_text(path: Path | str) -> str:
    """Read a text in UTF-8. Raises `UserError` if it is missing, or not UTF-8."""
    try:
        # Some programs begin a file with a byte order mark.
        with TextIOWrapper(open_file(path), encoding="utf-8-sig") as file:
            return file.read()
    except OSError as error:
        raise read_error(path, error) from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: is not text in UTF-8") from None


def read_keys(path: Path | str, program: str, *keys: str) -> dict[str, Any]:
    """Read a JSON mapping that ``program`` of scripts/ writes.

    Raises `UserError` as `read_json` does, and if one of the ``keys`` is missing.
    """
    content = read_json(path)
    for key in keys:
        if not isinstance(content, dict) or key not in content:
            raise UserError(f"{path}: {key}: is missing; scripts/{program} writes it")
    mapping: dict[str, Any] = content
    return mapping


# The exceptions that a program may raise when it uses the content of a damaged file.
DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


@contextmanager
def reading(place: Path | str, kind: str) -> Iterator[None]:
    """Raise a `UserError` if a file, or a ``place`` in it, is not a valid ``kind`` of file."""
    try:
        yield
    except OSError as error:
        raise read_error(place, error) from None
    except KeyError as error:
        raise UserError(f"{place}: {error.args[0]}: is missing") from None
    except DAMAGE as error:
        raise UserError(f"{place}: is not a valid {kind}: {error}") from None
    except struct.error:
        raise UserError(f"{place}: is not a valid {kind}: it is cut short") from None


def read_json(path: Path | str) -> Any:
    """Read a JSON file. Raises a `UserError` that names the file if it is missing or malformed."""
    try:
        return json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is not JSON: {error}") from None
