"""Copy finished datasets from the storage of their jobs.

Each file is compared with the dataset's sha256sums.txt. Files that exist already with the same
bytes stay. The dataset's page is copied, too.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.dataset.view_store import ViewStore


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", nargs="+", type=Path, help="such as results/scene/rig")
    parser.add_argument("--store", required=True, help="URL or folder of the storage")
    arguments = parser.parse_args()
    store = ViewStore(arguments.store)
    for dataset in arguments.datasets:
        take(store, dataset)


def take(store: ViewStore, dataset: Path) -> None:
    """Copy all files of a dataset. Raises `UserError` if one is not in the storage."""
    # Only now, so that --help need not wait for it.
    from lightfield.validation.files import REPORT, SUMS, read_sums

    for name in store.names(f"{dataset}/{REPORT}"):
        store.bring(f"{dataset}/{REPORT}/{name}")
    sums = dataset / SUMS
    if not store.bring(str(sums)):
        raise UserError(f"{sums}: is not in {store.url}: no run has finished this dataset there")
    published = read_sums(sums)
    progress = Progress(len(published), "take", "files")
    lost_files = []
    for name, digest in published.items():
        # The storage has views under their checksums, and other files under their paths.
        path = dataset / name
        has_file = store.take(digest, path) or (store.bring(str(path)) and sha256(path) == digest)
        if not has_file:
            lost_files.append(path)
        progress.done()
    if lost_files:
        raise UserError(
            f"{len(lost_files)} files are not in {store.url} as {sums} has them, as "
            f"{lost_files[0]}; `snakemake verify` with the storage names them, and --mend makes "
            "them again"
        )


if __name__ == "__main__":
    run(main)
