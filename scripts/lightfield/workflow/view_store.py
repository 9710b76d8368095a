"""The view store, which holds finished views for machines without a common folder.

Snakemake does not transfer a shard's views, because they are not among its outputs. So a program
puts each view here when it is finished, and any other program can take it. The store is at a URL
such as s3://bucket/name, or in a folder:

- ``views/sums/<SHA-256>`` is a file;
- ``views/keys/<render key>/<its path in the dataset, with @ for />@<SHA-256>`` is an empty note. It
  says that these settings made the file. It is written last, so that a noted file exists. For files
  of an export, the key is the SHA-256 of the file that lists them.

A file that is taken is compared with its checksum, so a file that was cut short does not count.
"""

import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, sha256
from lightfield.core.paths import check_inside

# The environment variable with which the workflow tells its programs where the store is.
VARIABLE = "PLENOFORGE_STORE"


class _OtherBytesError(Exception):
    """An object of the store is not the file that its name says."""


class ViewStore:
    """The store at a URL or in a folder. Each method raises `UserError` if the store fails."""

    def __init__(self, url: str) -> None:
        self.url = url

    @classmethod
    def configured(cls) -> Self | None:
        """Return the store in this process's environment. None if all machines share a folder."""
        url = os.environ.get(VARIABLE)
        return cls(url) if url else None

    def _place(self, name: str) -> Any:
        """Return the place of a name in the store. It has a path's methods."""
        if "://" not in self.url:
            return Path(self.url, name)
        from upath import UPath

        return UPath(self.url, use_listings_cache=False) / name

    @cached_property
    def _root(self) -> Any:
        return self._place("views")

    def check(self) -> None:
        """Raise `UserError` if the store cannot be read."""
        self.listed("")

    def bring(self, path: str) -> bool:
        """Copy a file that Snakemake has stored to the same path here, with its time.

        Returns False, and changes nothing, if the stored file is missing, or empty as a log may be.
        """
        with self._answering():
            stored = self._place(path)
            try:
                time = stored.stat().st_mtime
                content = stored.read_bytes()
            except FileNotFoundError:
                return False
            if not content:
                return False
            with atomic_path(path) as temporary:
                temporary.write_bytes(content)
            os.utime(path, (time, time))
        return True

    def names(self, folder: str) -> list[str]:
        """Return the names of the files that Snakemake has stored in a folder."""
        with self._answering():
            try:
                return sorted(entry.name for entry in self._place(folder).iterdir())
            except (FileNotFoundError, NotADirectoryError):
                return []

    def send(self, path: str) -> None:
        """Store a file under its path, as Snakemake does."""
        with self._answering():
            self._write(Path(path), self._place(path))

    def remove(self, path: str) -> None:
        """Remove the file that Snakemake has stored under a path."""
        with self._answering():
            self._place(path).unlink(missing_ok=True)

    def put(self, file: Path, digest: str) -> None:
        """Put a file with this SHA-256 into the store. Replaces a file that may be damaged."""
        with self._answering():
            self._write(file, self._root / "sums" / digest)

    def _write(self, file: Path, target: Any) -> None:
        """Write a file to a place of the store, where others see it complete or not at all.

        In a folder, the complete file is renamed. Object stores replace complete objects at once.
        """
        target.parent.mkdir(parents=True, exist_ok=True)
        if "://" in self.url:
            target.fs.put_file(str(file), target.path)
        else:
            with atomic_path(target) as temporary:
                shutil.copyfile(file, temporary)

    def put_view(self, file: Path, name: str, key: str, digest: str) -> None:
        """Put a dataset's file, and note that the settings of ``key`` made it under ``name``."""
        self.put(file, digest)
        with self._answering():
            note = self._root / "keys" / key / f"{name.replace('/', '@')}@{digest}"
            note.parent.mkdir(parents=True, exist_ok=True)
            note.write_bytes(b"")

    def put_list(self, listing: Path, files: Iterable[Path]) -> None:
        """Put the ``files`` that a job made, with the SHA-256 of their ``listing`` as the key."""
        key = sha256(listing)
        for file in files:
            name = os.path.relpath(file, listing.parent)
            self.put_view(file, name, key, sha256(file))

    def listed(self, key: str) -> list[tuple[str, str]]:
        """Return name and SHA-256 of each file that the settings of ``key`` have made.

        Raises `UserError` for a note whose name leads out of the folder of the files.
        """
        listed = []
        folder = f"views/keys/{key}"
        for note in self.names(folder):
            name, separator, digest = note.rpartition("@")
            if separator:
                name = name.replace("@", "/")
                check_inside(name, f"{self.url}: {folder}/{note}")
                listed.append((name, digest))
        return listed

    def has(self, digest: str, size: int) -> bool:
        """Return whether the store has a file of this SHA-256, by its name and size only."""
        with self._answering():
            try:
                return bool((self._root / "sums" / digest).stat().st_size == size)
            except FileNotFoundError:
                return False

    def take(self, digest: str, target: Path) -> bool:
        """Make ``target`` the file of a SHA-256, unless it is already. Return whether it exists."""
        if target.is_file() and sha256(target) == digest:
            return True
        with self._answering():
            try:
                stored = (self._root / "sums" / digest).open("rb")
            except FileNotFoundError:
                return False
            with stored, suppress(_OtherBytesError), atomic_path(target) as temporary:
                with temporary.open("wb") as file:
                    copied = hashlib.sha256()
                    while block := stored.read(1 << 20):
                        copied.update(block)
                        file.write(block)
                if copied.hexdigest() != digest:
                    raise _OtherBytesError
                return True
        return False

    @contextmanager
    def _answering(self) -> Iterator[None]:
        """Turn any exception of a storage's package into a `UserError`."""
        try:
            yield
        except UserError:
            raise
        except ImportError as error:
            raise UserError(
                f"{self.url}: needs the package {error.name}; run make .venv/complete-with-storage"
            ) from None
        except Exception as error:
            raise UserError(f"{self.url}: the view store cannot be used: {error}") from None
