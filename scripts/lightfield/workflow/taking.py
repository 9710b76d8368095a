"""Copies datasets from the storage of jobs without a common folder.

Each file is compared with its checksum.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from lightfield.configuration.dataset_paths import REPORT_FILES
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading, sha256
from lightfield.core.names import SEQUENCE_PAGE
from lightfield.core.paths import inside
from lightfield.core.progress import Progress
from lightfield.engine import bundles, receipts
from lightfield.formats.layout import REPORT, SUMS, read_sums
from lightfield.stages.publishing import TakeDataset
from lightfield.workflow.storage import Storage


def take_datasets(job: TakeDataset) -> None:
    """Copy all files of datasets. Raises `UserError` if one is not in the storage."""
    storage = Storage(job.store)
    for dataset in job.datasets:
        _take(storage, dataset, job.work)


def _take(storage: Storage, dataset: Path, work: str) -> None:
    """Copy all files of a dataset or a sequence, and its page."""
    report = dataset / REPORT
    for name in (*REPORT_FILES, SEQUENCE_PAGE):
        storage.bring(str(report / name))
    listing, sums = _sums_of(storage, dataset, work)
    progress = Progress(len(sums), "take", "files")
    lost_files = set(sums)
    for path, digest in sums.items():
        # A file that no rule declares is in a bundle.
        if storage.bring(path) and sha256(path) == digest:
            lost_files.discard(path)
            progress.done()
    for bundle, outputs in _bundles(storage, dataset, work) if lost_files else ():
        # The bundle of a batch has all files of its members, and its receipt has their lists.
        if str(listing) in outputs or not lost_files.isdisjoint(outputs):
            lost = _take_packed(storage, bundle, {path: sums[path] for path in lost_files})
            progress.done(len(lost_files) - len(lost))
            lost_files = lost
    if lost_files:
        raise UserError(
            f"{len(lost_files)} files are not in {storage.url} as {listing} has them, such as "
            f"{min(lost_files)}; remove the receipt of their job there, so that the next run makes "
            "them again"
        )


def _bundles(storage: Storage, dataset: Path, work: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the bundles of a scene, each with the SHA-256 of the files in its receipt, by path."""
    for part in Path(receipts.name_of(dataset)).parts[:-1]:
        for bundle in storage.below(f"{work}/{receipts.FOLDER}/{part}", bundles.SUFFIX):
            with tempfile.TemporaryDirectory() as folder:
                # A receipt names its own place.
                copy = Path(folder, bundle).with_suffix(receipts.SUFFIX)
                storage.bring(bundle.removesuffix(bundles.SUFFIX) + receipts.SUFFIX, copy)
                receipt = receipts.read(copy)
            outputs = receipt.outputs.items() if receipt else ()
            yield bundle, {path: output.stamp.sha256 for path, output in outputs}


def _take_listing(storage: Storage, dataset: Path, work: str, listing: str) -> bool:
    """Copy the list of the files of a member of a family. Return whether there is one."""
    for bundle, outputs in _bundles(storage, dataset, work):
        if listing in outputs:
            return not _take_packed(storage, bundle, {listing: outputs[listing]})
    return False


def _take_packed(storage: Storage, bundle: str, sums: dict[str, str]) -> set[str]:
    """Write files of a bundle. Return the paths of those that it does not have with their sums."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "bundle.tar")
        storage.bring(bundle, copy)
        others = set(bundles.extract(copy, sums))
    return others | {path for path in sums if not Path(path).exists()}


def _sums_of(storage: Storage, dataset: Path, work: str) -> tuple[Path, dict[str, str]]:
    """Bring the list of a dataset's files. Return it, and the SHA-256 of each file."""
    is_archive = dataset.suffix == ".json"
    listing = dataset if is_archive else dataset / SUMS
    if not (storage.bring(str(listing)) or _take_listing(storage, dataset, work, str(listing))):
        raise UserError(f"{listing}: is not in {storage.url}: no run has finished it there")
    if is_archive:
        entries = read_keys(listing, "package.py", "parts")["parts"]
        with reading(f"{listing}: parts", "list of files and their sha256"):
            sums = {str(entry["file"]): str(entry["sha256"]) for entry in entries}
    else:
        sums = read_sums(listing)
    folder = listing.parent
    paths = {name: inside(folder, name, str(listing)) for name in sums}
    return listing, {receipts.name_of(path): sums[name] for name, path in paths.items()}
