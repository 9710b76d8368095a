"""Bundles: archives with which files reach jobs without a common folder, in a storage.

Snakemake moves the files that rules declare. No rule can declare the views of a shard, because an
output cannot be a function of wildcards. The same holds for the files of an export, and for the
members of a batch. So a job packs the files in its receipt that no flag names. The bundle lies
beside the receipt. A job that reads the receipt, or a file of that job, unpacks the bundle first.
"""

import os
import shutil
import tarfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, sha256
from lightfield.core.paths import check_inside
from lightfield.engine import receipts

# The environment variable with which the workflow tells its programs where the storage is.
VARIABLE = "PLENOFORGE_STORE"
SUFFIX = ".tar"


def are_used() -> bool:
    """Return whether jobs share no folder."""
    return bool(os.environ.get(VARIABLE))


def bundle_of(receipt: Path) -> Path:
    """Return the path of the bundle of a receipt's job."""
    return receipt.with_suffix(SUFFIX)


def pack(receipt_path: Path, named: Iterable[Path], others: Iterable[Path] = ()) -> None:
    """Pack the files of a receipt, but not those that a rule declares because a flag has ``named``.

    Also pack the existing ones of ``others``. Does nothing if all machines share a folder.
    """
    receipt = receipts.read(receipt_path)
    if not receipt or not are_used():
        return
    declared = {receipts.name_of(path) for path in named}
    names = [*receipt.outputs, *map(receipts.name_of, others)]
    with (
        atomic_path(bundle_of(receipt_path)) as temporary,
        tarfile.open(temporary, "w", dereference=True) as archive,
    ):
        for name in names:
            if name not in declared and Path(name).is_file():
                archive.add(name)


def unpack(receipt_path: Path) -> None:
    """Write the files of a bundle, unless they exist. Does nothing without a bundle.

    A file that the receipt does not have as an output is written only if it is missing: it may be
    the user's own, and newer. Raises `UserError` for bytes that are not as in the receipt.
    """
    receipt = receipts.read(receipt_path)
    bundle = bundle_of(receipt_path)
    if not receipt or not bundle.is_file():
        return
    for name in receipt.outputs:
        check_inside(name, f"{receipt_path}: file")
    outputs = {
        name: output.stamp
        for name, output in receipt.outputs.items()
        if not output.stamp.matches(name)
    }
    sums: dict[str, str | None] = {name: stamp.sha256 for name, stamp in outputs.items()}
    for name in names_in(bundle):
        if name not in receipt.outputs and not os.path.lexists(name):
            sums[name] = receipt.inputs.get(name)
    damaged = extract(bundle, sums)
    if damaged:
        raise UserError(
            f"{damaged[0]}: the storage does not have the bytes that its job made; remove {bundle} "
            "there, so that the next run makes it again"
        )
    for name, stamp in outputs.items():
        if Path(name).is_file():
            os.utime(name, ns=(stamp.modified_ns, stamp.modified_ns))


def names_in(bundle: Path) -> list[str]:
    """Return the paths of the files in a bundle. Raises `UserError` if it cannot be read."""
    with _opened(bundle) as archive:
        return archive.getnames()


class _OtherBytesError(Exception):
    """A file in a bundle does not have its sum."""


def extract(bundle: Path, sums: Mapping[str, str | None]) -> list[str]:
    """Write the files of a bundle that are in ``sums``. Return the paths of those with other bytes.

    A file whose sum is None may have any bytes. Raises `UserError` for a damaged bundle.
    """
    damaged = []
    with _opened(bundle) as archive:
        for member in archive if sums else ():
            if member.name not in sums:
                continue
            check_inside(member.name, f"{bundle}: a name")
            damaged.append(member.name)
            # A link could lead to another file, and no job packs one.
            content = archive.extractfile(member) if member.isreg() else None
            if content is None:
                continue
            with suppress(_OtherBytesError), atomic_path(member.name) as temporary:
                with temporary.open("wb") as file:
                    shutil.copyfileobj(content, file)
                if sums[member.name] not in (None, sha256(temporary)):
                    raise _OtherBytesError
                damaged.pop()
    return damaged


@contextmanager
def _opened(bundle: Path) -> Iterator[tarfile.TarFile]:
    try:
        with tarfile.open(bundle) as archive:
            yield archive
    except tarfile.TarError as error:
        raise UserError(f"{bundle}: is damaged: {error}") from None
