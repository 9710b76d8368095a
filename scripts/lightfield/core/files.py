"""Files that are either whole or absent, and their checksums."""

import csv
import hashlib
import json
import os
import shutil
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lightfield.core.disk_space import write_problem
from lightfield.core.errors import UserError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError into a `UserError` that names ``path``, the cause, and what to do."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {write_problem(path, error)}") from None


def read_problem(error: OSError) -> str:
    """Return why a file cannot be read, from what the system said of it, and what to do."""
    if isinstance(error, PermissionError):
        return "you may not read it: change its permissions (chmod u+r)"
    return error.strerror or str(error)


def check_readable(path: Path | str) -> None:
    """Raise `UserError` for a file that is missing, or that may not be read.

    Libraries say of both that it is none of theirs.
    """
    try:
        Path(path).open("rb").close()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None


@contextmanager
def atomic_path(target: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside ``target``; on success it is flushed to disk and renamed.

    The temporary name keeps the target's suffix, because image writers choose the format by it. It
    holds a random number: in containers several processes may have one number.
    On any error the temporary file is removed and the target is left as it was; an OSError, and an
    empty file, become a `UserError`. Python reports every byte that it cannot write. A library
    that may not must be checked by whoever calls it: it raises an OSError for a file cut short.
    """
    target = Path(target)
    number = int.from_bytes(os.urandom(4))
    temporary = target.parent / f".{target.stem}.{number}.tmp{target.suffix}"
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            # For reading: it may be a second name of a file that nobody may write.
            with temporary.open("rb") as file:
                if not file.seek(0, os.SEEK_END):
                    raise OSError("the file is empty")
                os.fsync(file.fileno())
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)


def second_name(file: Path, target: Path) -> None:
    """Make ``target`` a hard link to a file, or a copy where the file system has no links."""
    with atomic_path(target) as temporary:
        try:
            # Not of a link, as git-annex has them: Linux would take over the link itself.
            os.link(file.resolve(), temporary)
        except OSError:
            shutil.copyfile(file, temporary)


def sha256(path: Path | str) -> str:
    """Return the SHA-256 of a file as 64 hexadecimal digits."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_bytes(path: Path | str, content: bytes) -> None:
    """Write ``content``, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path | str, text: str) -> None:
    """Write ``text`` in UTF-8, atomically."""
    write_bytes(path, text.encode())


def write_json(path: Path | str, content: Any) -> None:
    """Write ``content`` as JSON, atomically; NaN and infinities are refused (ValueError)."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_json_if_changed(path: Path, content: Any) -> bool:
    """Write ``content`` as JSON, atomically, unless the file holds just that; return if it did."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    try:
        if path.read_text(encoding="utf-8") == text:
            return False
    except (OSError, UnicodeDecodeError):
        pass
    write_text(path, text)
    return True


def write_csv(path: Path | str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of the same columns as CSV, atomically, the first line their names."""
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def append_json_line(path: Path, entry: Mapping[str, Any]) -> None:
    """Add ``entry`` to a file of one JSON object a line, at once and flushed to disk.

    A last line that a kill or a full disk cut short is ended first.
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
    """Return the objects of such a file, in their order; what is not one is left out."""
    entries = []
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None
    for line in content.splitlines():
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(entry, dict):
            entries.append(entry)
    return entries


def unreadable(path: Path | str) -> str | None:
    """Say why what lies at a path cannot be read as a file; None if it can, or nothing is there."""
    if os.path.isdir(path):  # noqa: PTH112, a `Path` for each of a hundred thousand is slow
        return "is a folder"
    if os.path.lexists(path) and not os.access(path, os.R_OK):
        if not os.path.exists(path):  # noqa: PTH110
            return "is a link that leads to no file"
        return "cannot be read: Permission denied"
    return None


def broken(path: Path) -> str | None:
    """Say what is wrong with a file that a program wrote; None if nothing is, or it is not there.

    Every JSON of a dataset is a mapping.
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


def whole(path: Path) -> Path:
    """Return a path from / on, without ``.`` and ``..``: it and all folders above it have names.

    Links stay what they are, for what is on another disk may have another name there.
    """
    return Path(os.path.normpath(path.absolute()))


def keep_apart(flag: str, written: Path, *read: Path | None) -> None:
    """Raise `UserError` where what the ``flag`` has written is a file or folder that is read."""
    if any(path is not None and path.resolve() == written.resolve() for path in read):
        raise UserError(f"{flag} {written}: is what is read, and would be lost; give another")


def set_aside(path: Path, folder: Path) -> Path:
    """Move a file or folder into ``folder``, under its own path; return where it is now.

    That is from the present folder, or from / of what is not in it. What lies there already keeps
    its name, and the new one gets a number behind its own.
    """
    inside = Path(os.path.normpath(path))
    if inside.is_absolute() or ".." in inside.parts:
        inside = whole(path).relative_to(path.absolute().anchor)
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
    """Read a text in UTF-8; one that is missing, or something else, is a `UserError`."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {read_problem(error)}") from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: is no text in UTF-8") from None


def read_keys(path: Path | str, program: str, *keys: str) -> dict[str, Any]:
    """Read the JSON mapping that a program of scripts/ writes.

    Raises `UserError` as `read_json` does, and for one that lacks one of the ``keys``.
    """
    content = read_json(path)
    for key in keys:
        if not isinstance(content, dict) or key not in content:
            raise UserError(f"{path}: {key}: is missing; scripts/{program} writes it")
    found: dict[str, Any] = content
    return found


# The exceptions that the content of a damaged file may raise in the program that uses it.
DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


@contextmanager
def reading(place: Path | str, kind: str) -> Iterator[None]:
    """Raise a `UserError` where a file, or a place in one, cannot be read as its ``kind``."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{place}: cannot be read: {read_problem(error)}") from None
    except KeyError as error:
        raise UserError(f"{place}: {error.args[0]}: is missing") from None
    except DAMAGE as error:
        raise UserError(f"{place}: is no {kind}: {error}") from None
    except struct.error:
        raise UserError(f"{place}: is no {kind}: it is cut short") from None


def read_json(path: Path | str) -> Any:
    """Read a JSON file; a missing or malformed one is a `UserError` that names it."""
    try:
        return json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is not JSON: {error}") from None
