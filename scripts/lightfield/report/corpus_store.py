"""Brings a corpus' members from the storage, and sends the files there that Snakemake does not.

Without a shared folder, members lie in the storage under their own paths.
"""

from pathlib import Path

from lightfield.configuration.corpus import SHARDS, THUMBNAILS
from lightfield.configuration.family import RECORD
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.formats.layout import SUMS, read_sums
from lightfield.formats.lightfield import NAME, LightField
from lightfield.report.corpus_looks import chosen_views
from lightfield.stages.family import CorpusSettings
from lightfield.workflow.member_record import read_member
from lightfield.workflow.view_store import ViewStore


def bring(folder: Path, settings: CorpusSettings, store: ViewStore) -> None:
    """Bring each member's record and sums, and the views that the corpus reads.

    Shards need all files of a dataset. Raises `UserError` for a file that the storage lacks.
    """
    for name in settings.members or ():
        # The storage has the latest one.
        _take(folder / name / RECORD, store)
        for rig, entry in read_member(folder / name).datasets.items():
            dataset = folder / name / rig
            _bring(dataset / SUMS, entry.sha256sums, store)
            sums = read_sums(dataset / SUMS)
            _bring(dataset / NAME, sums[NAME], store)
            if settings.shards:
                files = [dataset / file for file in sums]
            else:
                files = chosen_views(dataset, LightField.read(dataset / NAME))
            for path in files:
                _bring(path, sums[path.relative_to(dataset).as_posix()], store)


def _bring(path: Path, digest: str, store: ViewStore) -> None:
    """Bring a file, unless it is here with a SHA-256."""
    if not path.is_file() or sha256(path) != digest:
        _take(path, store)


def _take(path: Path, store: ViewStore) -> None:
    if not store.bring(str(path)):
        raise UserError(f"{path}: is missing in the storage; build its member again")


def send(folder: Path, store: ViewStore) -> None:
    """Send the thumbnails and shards. Snakemake sends the other files."""
    for pattern in (f"{THUMBNAILS}/*.webp", f"{SHARDS}/*/*.tar"):
        for path in sorted(folder.glob(pattern)):
            store.send(str(path))
