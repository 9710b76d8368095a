"""Downloads large files over HTTP. An interrupted download continues where it stopped.

The package pooch cannot replace this. It gives its downloader an empty temporary file for each
attempt, and deletes the file when an attempt fails. A downloader for pooch would still need the
partial file, Range and If-Range, and the answers 206 and 416. It would save about seven lines of
`fetch`: the check of the SHA-256, and the renaming.
"""

import http.client
import math
import re
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.core.progress import Progress

_CHUNK = 1 << 20
_TIMEOUT_SECONDS = 60


def fetch(url: str, target: Path, expected: str | None, origin: str) -> None:
    """Download ``url`` to ``target``. The file is complete with the right SHA-256, or absent.

    ``<target>.part`` holds the received bytes, which are not requested again (RFC 9110, section
    14). The download starts anew if the server serves no ranges, or if its file has changed. A
    broken transfer continues as long as each attempt receives something. ``expected`` is the
    SHA-256 or None, and ``origin`` says where it is written. Raises `UserError`.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{target.name}.part")
    while True:
        before = _size(part)
        problem = _attempt(url, part)
        if problem is None:
            break
        if _size(part) <= before:
            raise UserError(
                f"{url}: {problem}; {units.size(_size(part))} are kept in {part}, "
                "and the same command goes on from there"
            )
    digest = sha256(part)
    _version_file(part).unlink(missing_ok=True)
    if expected is not None and digest != expected:
        part.unlink()
        raise UserError(f"{url}: its sha256 is {digest}, but {origin} says {expected}")
    part.replace(target)


def _attempt(url: str, part: Path) -> str | None:
    """Request the missing bytes of ``part`` once. Return the problem, or None if it is complete."""
    received = _size(part)
    request = urllib.request.Request(url)
    # The server's name for this version of its file. Only this shows whether the file has changed.
    version = None
    if received and _version_file(part).exists():
        version = read_json(_version_file(part))["version"]
    if version:
        request.add_header("Range", f"bytes={received}-")
        request.add_header("If-Range", version)
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT_SECONDS) as answer:
            if answer.status != http.HTTPStatus.PARTIAL_CONTENT:
                return _receive(answer, part, 0)
            if not version:
                return "the server answers with a part, but the whole file was requested"
            if _version(answer) == version and _first_byte(answer) == received:
                return _receive(answer, part, received)
            part.unlink()
            return _attempt(url, part)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            # The server has no more bytes. Either the file is complete, or it is another file.
            if error.headers.get("Content-Range") == f"bytes */{received}":
                return None
            part.unlink()
            return _attempt(url, part)
        return f"the server answers {error.code} {error.reason}"
    except (OSError, http.client.HTTPException) as error:
        return str(getattr(error, "reason", None) or error) or type(error).__name__


def _receive(answer: Any, part: Path, received: int) -> str | None:
    """Write an answer's body after the first ``received`` bytes of ``part``."""
    length = answer.headers.get("Content-Length")
    total = None if length is None else received + int(length)
    progress = Progress(math.ceil((total or _CHUNK) / _CHUNK), f"download {part.stem}", "MiB")
    progress.count = received // _CHUNK
    with part.open("r+b" if received else "wb") as file:
        # Now the file holds no bytes of another version.
        write_json(_version_file(part), {"version": _version(answer)})
        file.seek(received)
        while chunk := answer.read(_CHUNK):
            file.write(chunk)
            if total is not None:
                progress.done()
    if total is not None and _size(part) < total:
        return f"the transfer broke off at {units.size(_size(part))} of {units.size(total)}"
    return None


def _first_byte(answer: Any) -> int | None:
    """Return the position in the file of a partial answer's first byte. None if it is missing."""
    match = re.match(r"bytes (\d+)-", answer.headers.get("Content-Range") or "")
    return int(match[1]) if match else None


def _version(answer: Any) -> str | None:
    """Return the value for If-Range: a strong ETag, or the date of the last change."""
    tag: str | None = answer.headers.get("ETag")
    date: str | None = answer.headers.get("Last-Modified")
    return tag if tag and tag.startswith('"') else date


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _version_file(part: Path) -> Path:
    """Return the file beside a partial file that names the version of the server's file."""
    return part.with_name(f"{part.name}.json")
