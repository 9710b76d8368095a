"""Copy files from the view store: the views of shards, and the files of exports.

The arguments are lists that name the files: the records of shards, and the lists of exports. Each
file goes into the dataset of its list. Files that exist already with the same bytes stay. Arguments
that are not lists are ignored.
"""

import argparse
import re
from collections.abc import Iterable
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.paths import place_in
from lightfield.core.progress import Progress
from lightfield.workflow import shard_files
from lightfield.workflow.view_store import VARIABLE, ViewStore


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "lists", nargs="+", type=Path, help="records of shards, and lists of exports"
    )
    parser.add_argument("--store", help=f"URL or folder of the store (default: ${VARIABLE})")
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument(
        "--work", required=True, type=Path, help="folder of intermediate files, with the records"
    )
    parser.add_argument(
        "--mend",
        action="store_true",
        help="remove lists of lost files from the storage, so that the next run makes these files "
        "again",
    )
    arguments = parser.parse_args()
    store = ViewStore(arguments.store) if arguments.store else ViewStore.configured()
    if store is None:
        raise UserError(f"--store: is not given, and ${VARIABLE} is not set")
    # The SHA-256 and the list of each file.
    listed_files: dict[Path, tuple[str, Path]] = {}
    for path in arguments.lists:
        for target, digest in _listed(store, path, arguments.results, arguments.work):
            listed_files[target] = (digest, path)
    progress = Progress(len(listed_files), "take", "files")
    # The list of each file that the store lacks.
    lost_files: dict[Path, Path] = {}
    for target, (digest, path) in listed_files.items():
        if not store.take(digest, target):
            lost_files[target] = path
        progress.done()
    if lost_files:
        remedy = "--mend lets a run make them"
        if arguments.mend:
            remedy = "the next run makes them again"
            for path in set(lost_files.values()):
                store.remove(_stored(path, arguments.results, arguments.work))
        raise UserError(
            f"{len(lost_files)} files are not in the view store {store.url}, such as "
            f"{min(lost_files)}; {remedy}"
        )


def _stored(path: Path, results: Path, work: Path) -> str:
    """Return the path of a list in Snakemake's storage. ``path`` is the list's copy here."""
    for folder in (results, work):
        if place := place_in(folder, path):
            return str(folder / place)
    raise UserError(f"{path}: must be in {results} or {work}")


def _listed(store: ViewStore, path: Path, results: Path, work: Path) -> Iterable[tuple[Path, str]]:
    """Return each file that a list names, and its SHA-256."""
    if re.fullmatch(r"\d+-\d+\.json", path.name):
        place = place_in(work, path)
        if place is None:
            raise UserError(f"{path}: must be in {work}")
        dataset = results / place.parent.parent
        files = shard_files.read_record(path).items()
        return [(dataset / name, digest) for name, (_, digest) in files]
    return [(path.parent / name, digest) for name, digest in store.listed(sha256(path))]


if __name__ == "__main__":
    run(main)
