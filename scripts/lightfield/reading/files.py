"""The files of a dataset, wherever they lie: in a folder, or in tars, which are not unpacked."""

import tarfile
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable, open_file
from lightfield.formats.lightfield import NAME


class Files(ABC):
    """The files of a dataset, in a folder or in tars. Their names have slashes.

    - ``path``: what the user opened.
    """

    path: Path

    @abstractmethod
    def has(self, name: str) -> bool:
        """Return whether there is a file of this name."""

    @abstractmethod
    def datasets_in(self, folder: str, pattern: str = "*") -> list[str]:
        """Return the names of the folders in ``folder`` that have a lightfield.json."""

    @abstractmethod
    def on_disk(self, name: str) -> AbstractContextManager[Path]:
        """Yield a path from which a library can read the file, until the context ends."""

    @abstractmethod
    def place(self, name: str) -> Path:
        """Return how messages name a file."""


@dataclass(frozen=True)
class Folder(Files):
    """The files in a folder."""

    path: Path

    def has(self, name: str) -> bool:
        return (self.path / name).is_file()

    def datasets_in(self, folder: str, pattern: str = "*") -> list[str]:
        files = (self.path / folder).glob(f"{pattern}/{NAME}")
        return sorted(file.parent.name for file in files)

    @contextmanager
    def on_disk(self, name: str) -> Iterator[Path]:
        yield self.path / name

    def place(self, name: str) -> Path:
        return self.path / name


@dataclass(frozen=True)
class PackedFile:
    """The place of a file in a tar, which stores its bytes as they are."""

    archive: Path
    offset: int
    size: int

    def read(self) -> bytes:
        """Return the file's bytes."""
        with open_file(self.archive) as file:
            file.seek(self.offset)
            return file.read(self.size)


@dataclass(frozen=True)
class Packed(Files):
    """The files in tars. ``contents`` has the place of each, or its bytes."""

    path: Path
    contents: Mapping[str, PackedFile | bytes] = field(repr=False)

    def has(self, name: str) -> bool:
        return name in self.contents

    def datasets_in(self, folder: str, pattern: str = "*") -> list[str]:
        files = (PurePosixPath(name) for name in self.contents if name.endswith(f"/{NAME}"))
        parents = [file.parent for file in files if file.parent.parent == PurePosixPath(folder)]
        return sorted(parent.name for parent in parents if parent.match(pattern))

    @contextmanager
    def on_disk(self, name: str) -> Iterator[Path]:
        if name not in self.contents:
            raise UserError(f"{self.place(name)}: is not there")
        content = self.contents[name]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / PurePosixPath(name).name
            file.write_bytes(content.read() if isinstance(content, PackedFile) else content)
            try:
                yield file
            except UserError as error:
                raise UserError(str(error).replace(str(file), str(self.place(name)))) from None

    def place(self, name: str) -> Path:
        content = self.contents.get(name)
        archive = content.archive if isinstance(content, PackedFile) else self.path
        return archive / name


def members_of(archive: Path) -> dict[str, PackedFile]:
    """Return the files in a tar. Raises `UserError` if it is cut short, or no plain tar."""
    check_readable(archive)
    try:
        with tarfile.open(archive, "r:") as tar:
            entries = [entry for entry in tar if entry.isfile()]
    except tarfile.TarError as error:
        raise UserError(f"{archive}: is not a whole, uncompressed tar: {error}") from None
    members = {entry.name: PackedFile(archive, entry.offset_data, entry.size) for entry in entries}
    end = max((member.offset + member.size for member in members.values()), default=0)
    # Two blocks of zeros end a tar.
    if archive.stat().st_size < end + 2 * tarfile.BLOCKSIZE:
        raise UserError(f"{archive}: is not a whole tar: it is cut short; copy it again")
    return members
