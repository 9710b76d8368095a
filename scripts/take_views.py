"""Take from the view store the views of shards, by their records, and what exports wrote.

Each file goes where its list says, into the dataset that the list belongs to. What is there
already, with the same bytes, is left as it is. Files that are no lists are left out.
"""

import argparse
import re
from collections.abc import Iterable
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.dataset import shard_files
from lightfield.dataset.view_store import VARIABLE, ViewStore


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lists", nargs="+", type=Path, help="files that list others")
    parser.add_argument("--store", help=f"URL or folder of the store (default: ${VARIABLE})")
    parser.add_argument("--results", required=True, type=Path, help="folder of all datasets")
    parser.add_argument("--work", required=True, type=Path, help="folder of their records")
    parser.add_argument(
        "--mend",
        action="store_true",
        help="remove from the storage what lists a file that is lost, for the next run to make it",
    )
    arguments = parser.parse_args()
    store = ViewStore(arguments.store) if arguments.store else ViewStore.configured()
    if store is None:
        raise UserError(f"--store: is not given, and ${VARIABLE} is not set")
    wanted = {
        target: (digest, path)
        for path in arguments.lists
        for target, digest in _listed(store, path, arguments.results, arguments.work)
    }
    progress = Progress(len(wanted), "take", "files")
    lost: dict[Path, Path] = {}
    for target, (digest, path) in wanted.items():
        if not store.take(digest, target):
            lost[target] = path
        progress.done()
    if lost:
        for path in set(lost.values()) if arguments.mend else ():
            store.remove(_stored(path, arguments.results, arguments.work))
        raise UserError(
            f"{len(lost)} files are not in the view store {store.url}, as {min(lost)}; "
            + ("the next run makes them again" if arguments.mend else "--mend lets a run make them")
        )


def _stored(path: Path, results: Path, work: Path) -> str:
    """Return under which path Snakemake has stored a list, of which ``path`` is its copy here."""
    for folder in (results, work):
        if path.resolve().is_relative_to(folder.resolve()):
            return str(folder / path.resolve().relative_to(folder.resolve()))
    raise UserError(f"{path}: must be in {results} or {work}")


def _listed(store: ViewStore, path: Path, results: Path, work: Path) -> Iterable[tuple[Path, str]]:
    """Yield each file that a list names, and its SHA-256."""
    if re.fullmatch(r"\d+-\d+\.json", path.name):
        if not path.resolve().is_relative_to(work.resolve()):
            raise UserError(f"{path}: must be in {work}")
        stage = path.resolve().parent.relative_to(work.resolve())
        files = shard_files.read_record(path).items()
        return [(results / stage.parent / name, digest) for name, (_, digest) in files]
    return [(path.parent / name, digest) for name, digest in store.listed(sha256(path))]


if __name__ == "__main__":
    run(main)
