"""Copy finished datasets from the storage of their jobs.

A dataset is the folder of a rig, or of a frame. It may also be a folder of published files, or the
.json of an archive, which stands for the archive's parts. Each file is compared with its checksum.
Files that exist already with the same bytes stay. The dataset's page is copied, too.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading, sha256
from lightfield.core.paths import inside
from lightfield.core.progress import Progress
from lightfield.workflow.view_store import ViewStore


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "datasets", nargs="+", type=Path, help="folders to copy, such as results/scene/rig"
    )
    parser.add_argument("--store", required=True, help="URL or folder of the storage")
    arguments = parser.parse_args()
    store = ViewStore(arguments.store)
    for dataset in arguments.datasets:
        take(store, dataset)


def take(store: ViewStore, dataset: Path) -> None:
    """Copy all files of a dataset. Raises `UserError` if one is not in the storage."""
    # Only now, so that --help need not wait for it.
    from lightfield.formats.layout import REPORT

    report = dataset / REPORT
    for name in store.names(str(report)):
        store.bring(str(inside(report, name, f"{store.url}: {report}")))
    listing, sums = sums_of(store, dataset)
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


def sums_of(store: ViewStore, dataset: Path) -> tuple[Path, dict[Path, str]]:
    """Bring the list of a dataset's files. Return it, and the SHA-256 of each file."""
    from lightfield.formats.layout import SUMS, read_sums

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


if __name__ == "__main__":
    run(main)
