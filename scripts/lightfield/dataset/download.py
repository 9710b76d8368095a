"""Download large files over HTTP; an interrupted download continues where it stopped.

pooch does not replace this: it gives its downloader an empty temporary file for each attempt and
deletes what has arrived when an attempt fails. A downloader of our own for pooch would still need
the kept part, Range and If-Range, and the answers 206 and 416. pooch would save only the check of
the SHA-256 and the renaming, about seven lines of `fetch`, for one more copy of the file.
"""

import http.client
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from lightfield.core.disk_space import gigabytes
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.core.progress import Progress

_CHUNK = 1 << 20
_TIMEOUT_SECONDS = 60


def fetch(url: str, target: Path, expected: str | None, origin: str) -> None:
    """Download ``url`` to ``target``, whole and with the right SHA-256, or not at all.

    What has arrived is kept in ``<target>.part`` and is asked for no more (RFC 9110, section 14),
    unless the server does not serve ranges or its file has changed meanwhile: then it starts
    anew. A transfer that breaks is taken up again as long as each attempt brings something.
    ``expected`` may be None; ``origin`` says where it comes from. Raises `UserError`.
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
                f"{url}: {problem}; {gigabytes(_size(part))} are kept in {part}, "
                "and the same command goes on from there"
            )
    found = sha256(part)
    _mark(part).unlink(missing_ok=True)
    if expected is not None and found != expected:
        part.unlink()
        raise UserError(f"{url}: its sha256 is {found}, but {origin} says {expected}")
    part.replace(target)


def _attempt(url: str, part: Path) -> str | None:
    """Ask once for what is missing of ``part``; return None if it is whole, else the problem."""
    have = _size(part)
    request = urllib.request.Request(url)
    # The server's name for this version of the file: without it, no one knows if it has changed.
    version = read_json(_mark(part))["version"] if have and _mark(part).exists() else None
    if version:
        request.add_header("Range", f"bytes={have}-")
        request.add_header("If-Range", version)
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT_SECONDS) as answer:
            if answer.status != http.HTTPStatus.PARTIAL_CONTENT:
                return _receive(answer, part, 0)
            if _version(answer) == version:
                return _receive(answer, part, have)
            part.unlink()
            return _attempt(url, part)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            # There is nothing behind what we have: it is whole, or it is not this file's.
            if error.headers.get("Content-Range") == f"bytes */{have}":
                return None
            part.unlink()
            return _attempt(url, part)
        return f"the server answers {error.code} {error.reason}"
    except (OSError, http.client.HTTPException) as error:
        return str(getattr(error, "reason", None) or error) or type(error).__name__


def _receive(answer: Any, part: Path, have: int) -> str | None:
    """Write an answer's body behind the first ``have`` bytes of ``part``."""
    length = answer.headers.get("Content-Length")
    total = None if length is None else have + int(length)
    progress = Progress(-(-(total or _CHUNK) // _CHUNK), f"download {part.stem}", "MiB")
    progress.count = have // _CHUNK
    with part.open("r+b" if have else "wb") as file:
        # Only now that nothing is left of another version.
        write_json(_mark(part), {"version": _version(answer)})
        file.seek(have)
        while chunk := answer.read(_CHUNK):
            file.write(chunk)
            if total is not None:
                progress.done()
    if total is not None and _size(part) < total:
        return f"the transfer broke off at {gigabytes(_size(part))} of {gigabytes(total)}"
    return None


def _version(answer: Any) -> str | None:
    """Return what If-Range takes: a strong ETag, or the date of the last change."""
    tag: str | None = answer.headers.get("ETag")
    date: str | None = answer.headers.get("Last-Modified")
    return tag if tag and tag.startswith('"') else date


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _mark(part: Path) -> Path:
    """Return the file beside a partial one that says which version of the server's file it is."""
    return part.with_name(f"{part.name}.json")
