"""The storage of jobs without a common folder, in which Snakemake keeps what the rules declare.

It is at a URL such as s3://bucket/name, or in a folder. Each file lies there under its own path.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path


class Storage:
    """The storage at a URL or in a folder. Each method raises `UserError` if the storage fails."""

    def __init__(self, url: str) -> None:
        self.url = url

    def _place(self, path: str) -> Any:
        """Return the place of a file in the storage. It has a path's methods."""
        if "://" not in self.url:
            return Path(self.url, path)
        from upath import UPath

        return UPath(self.url, use_listings_cache=False) / path

    def read(self, path: str) -> bytes | None:
        """Return the content of a file. None if the storage does not have it."""
        with self._answering():
            try:
                return bytes(self._place(path).read_bytes())
            except FileNotFoundError:
                return None

    def bring(self, path: str, target: Path | None = None) -> bool:
        """Copy a file to the same path here, or to a ``target``, with its time.

        Returns False, and changes nothing, if the stored file is missing, or empty as a log may be.
        """
        with self._answering():
            place = self._place(path)
            try:
                status = place.stat()
                if not status.st_size:
                    return False
                with place.open("rb") as content, atomic_path(target or path) as temporary:
                    with temporary.open("wb") as file:
                        shutil.copyfileobj(content, file)
                    os.utime(temporary, (status.st_mtime, status.st_mtime))
            except (FileNotFoundError, NotADirectoryError):
                return False
        return True

    def names(self, folder: str) -> list[str]:
        """Return the names of the files and folders in a folder."""
        with self._answering():
            try:
                return sorted(entry.name for entry in self._place(folder).iterdir())
            except (FileNotFoundError, NotADirectoryError):
                return []

    def below(self, folder: str, suffix: str) -> list[str]:
        """Return the paths of all files below a folder that end in ``suffix``."""
        with self._answering():
            root = self._place("")
            files = self._place(folder).glob(f"**/*{suffix}")
            return sorted(file.relative_to(root).as_posix() for file in files)

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
            raise UserError(f"{self.url}: the storage cannot be used: {error}") from None
