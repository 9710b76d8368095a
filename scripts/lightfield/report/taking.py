"""Copies datasets, and the files that jobs read, from the storage of jobs without a common folder.

Each file is compared with its checksum.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading, sha256
from lightfield.core.paths import inside, place_in
from lightfield.core.progress import Progress
from lightfield.formats.layout import REPORT, SUMS, read_sums
from lightfield.stages.publishing import TakeDataset, TakeViews
from lightfield.workflow import shard_files
from lightfield.workflow.view_store import VARIABLE, ViewStore


def take_datasets(job: TakeDataset) -> None:
    """Copy all files of datasets. Raises `UserError` if one is not in the storage."""
    store = ViewStore(job.store)
    for dataset in job.datasets:
        _take(store, dataset)


def _take(store: ViewStore, dataset: Path) -> None:
    """Copy all files of a dataset, and its page."""
    report = dataset / REPORT
    for name in store.names(str(report)):
        store.bring(str(inside(report, name, f"{store.url}: {report}")))
    listing, sums = _sums_of(store, dataset)
    progress = Progress(len(sums), "take", "files")
    lost_files = []
    for path, digest in sums.items():
        # The storage has views under their checksums, and other files under their paths.
        has_file = store.take(digest, path) or (store.bring(str(path)) and sha256(path) == digest)
        if not has_file:
            lost_files.append(path)
        progress.done()
    if lost_files:
        raise UserError(
            f"{len(lost_files)} files are not in {store.url} as {listing} has them, such as "
            f"{lost_files[0]}; the target `verify` with the storage names them, and --mend makes "
            "them again"
        )


def _sums_of(store: ViewStore, dataset: Path) -> tuple[Path, dict[Path, str]]:
    """Bring the list of a dataset's files. Return it, and the SHA-256 of each file."""
    is_archive = dataset.suffix == ".json"
    listing = dataset if is_archive else dataset / SUMS
    if not store.bring(str(listing)):
        raise UserError(f"{listing}: is not in {store.url}: no run has finished it there")
    if is_archive:
        entries = read_keys(listing, "package.py", "parts")["parts"]
        with reading(f"{listing}: parts", "list of files and their sha256"):
            sums = {str(entry["file"]): str(entry["sha256"]) for entry in entries}
    else:
        sums = read_sums(listing)
    folder = listing.parent
    return listing, {inside(folder, name, str(listing)): digest for name, digest in sums.items()}


def take_views(job: TakeViews) -> None:
    """Copy the files that a job's lists name. Raises `UserError` if the store lacks one."""
    store = ViewStore(job.store) if job.store else ViewStore.configured()
    if store is None:
        raise UserError(f"--store: is not given, and ${VARIABLE} is not set")
    # The SHA-256 and the list of each file.
    listed_files = {
        target: (digest, path) for path in job.lists for target, digest in _listed(store, path, job)
    }
    progress = Progress(len(listed_files), "take", "files")
    # The list of each file that the store lacks.
    lost_files: dict[Path, Path] = {}
    for target, (digest, path) in listed_files.items():
        if not store.take(digest, target):
            lost_files[target] = path
        progress.done()
    if lost_files:
        remedy = "--mend lets a run make them"
        if job.mend:
            remedy = "the next run makes them again"
            for path in set(lost_files.values()):
                store.remove(_stored(path, job))
        raise UserError(
            f"{len(lost_files)} files are not in the view store {store.url}, such as "
            f"{min(lost_files)}; {remedy}"
        )


def _stored(path: Path, job: TakeViews) -> str:
    """Return the path of a list in Snakemake's storage. ``path`` is the list's copy here."""
    for folder in (job.results, job.work):
        if place := place_in(folder, path):
            return str(folder / place)
    raise UserError(f"{path}: must be in {job.results} or {job.work}")


def _listed(store: ViewStore, path: Path, job: TakeViews) -> Iterable[tuple[Path, str]]:
    """Return each file that a list names, and its SHA-256."""
    if re.fullmatch(r"\d+-\d+\.json", path.name):
        place = place_in(job.work, path)
        if place is None:
            raise UserError(f"{path}: must be in {job.work}")
        dataset = job.results / place.parent.parent
        files = shard_files.read_record(path).items()
        return [(dataset / name, digest) for name, (_, digest) in files]
    return [(path.parent / name, digest) for name, digest in store.listed(sha256(path))]
