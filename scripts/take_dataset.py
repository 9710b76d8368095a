"""Take finished datasets from the storage in which their jobs have put them.

Each file is compared with the dataset's sha256sums.txt. What is there already, with the same bytes,
is left as it is. The dataset's page is taken, too.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.dataset.view_store import ViewStore
from lightfield.validation.files import REPORT, SUMS, read_sums


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", nargs="+", type=Path, help="such as results/scene/rig")
    parser.add_argument("--store", required=True, help="URL or folder of the storage")
    arguments = parser.parse_args()
    store = ViewStore(arguments.store)
    for dataset in arguments.datasets:
        take(store, dataset)


def take(store: ViewStore, dataset: Path) -> None:
    """Take all files of a dataset; raises `UserError` where one is not in the storage."""
    for name in store.names(f"{dataset}/{REPORT}"):
        store.bring(f"{dataset}/{REPORT}/{name}")
    sums = dataset / SUMS
    if not store.bring(str(sums)):
        raise UserError(f"{sums}: is not in {store.url}: no run has finished this dataset there")
    published = read_sums(sums)
    progress = Progress(len(published), "take", "files")
    lost = []
    for name, digest in published.items():
        # Views lie under their checksums, all else under its path.
        path = dataset / name
        is_there = store.take(digest, path) or (store.bring(str(path)) and sha256(path) == digest)
        if not is_there:
            lost.append(path)
        progress.done()
    if lost:
        raise UserError(
            f"{len(lost)} files are not in {store.url} as {sums} has them, as {lost[0]}; "
            "`snakemake verify` with the storage names them, and --mend has them made again"
        )


if __name__ == "__main__":
    run(main)
