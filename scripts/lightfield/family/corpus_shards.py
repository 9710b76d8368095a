"""Writes all views of a corpus as WebDataset shards, in a folder for each part of the split.

Each view is a sample, as `lightfield.publishing.shards` writes it. All views of a member are in one
part. Equal members give equal bytes.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from lightfield.configuration.corpus import SHARDS
from lightfield.core.errors import UserError
from lightfield.core.names import PARTS, Part
from lightfield.core.progress import Progress
from lightfield.publishing import shards
from lightfield.stages.family import CorpusSettings
from lightfield.workflow.member_record import MemberRecord


def write(folder: Path, settings: CorpusSettings, members: Sequence[MemberRecord]) -> None:
    """Write the shards of the valid members, if the settings ask for them. Remove all others."""
    written = set()
    keys: set[str] = set()
    if settings.shards:
        valid = [member for member in members if member.is_valid]
        progress = Progress(sum(member.views for member in valid), "shards")
        for part in PARTS:
            of_part = [each for each in valid if settings.splits.part_of(each.name) == part]
            samples = _samples(folder, of_part, part)
            for number, run in enumerate(shards.parts(samples, settings.shard_gigabytes * 1e9)):
                path = folder / SHARDS / part / f"{settings.family}-{part}-{number:05}.tar"
                _check_keys(folder, run, keys)
                shards.write_tar(path, (member for sample in run for member in sample.members))
                written.add(path)
                progress.done(len(run))
    for path in folder.glob(f"{SHARDS}/*/*.tar"):
        if path not in written:
            path.unlink()


def _check_keys(folder: Path, samples: Sequence[shards.Sample], keys: set[str]) -> None:
    """Add the keys of samples to ``keys``. Raises `UserError` if one is there already."""
    for sample in samples:
        if sample.key in keys:
            raise UserError(
                f"{folder / SHARDS}: two views have the key {sample.key}; rename the member "
                f"{sample.content['member']}"
            )
        keys.add(sample.key)


def _samples(folder: Path, members: Sequence[MemberRecord], part: Part) -> Iterator[shards.Sample]:
    """Yield the samples of members, one member after the other: there may be very many."""
    for member in members:
        for rig in sorted(member.datasets):
            for sample in shards.read_dataset(folder, folder / member.name / rig).samples:
                sample.content |= {
                    # The part of the view within its member's own rigs.
                    "view_split": sample.split,
                    "split": part,
                    "member": member.name,
                    "rig": rig,
                    "values": member.values,
                }
                yield sample


def files(folder: Path) -> list[str]:
    """Return the shards that exist, by their paths in the family's ``folder``."""
    paths = folder.glob(f"{SHARDS}/*/*.tar")
    return sorted(path.relative_to(folder).as_posix() for path in paths)
