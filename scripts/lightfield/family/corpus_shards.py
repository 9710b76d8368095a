"""Writes all views of a corpus as WebDataset shards, in a folder for each part of the split.

Each view is a sample, as `lightfield.publishing.shards` writes it. All views of a member are in one
part. `INDEX` says which shard has which view. It also keeps the order of the views: new ones go
into the last shard of their part while it has space, and then into further shards. So all shards
before it keep their bytes. A shard that loses views is written again without them.
"""

import csv
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from lightfield.configuration.corpus import SHARDS
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, read_text, sha256, write_csv
from lightfield.core.names import PARTS, Part
from lightfield.core.progress import Progress
from lightfield.engine import receipts
from lightfield.publishing import shards
from lightfield.publishing.shards import INDEX, Sample
from lightfield.reading.files import members_of
from lightfield.stages.family import CorpusSettings
from lightfield.workflow.member_record import MemberRecord

Row = Mapping[str, Any]
"""A row of the index: a view and its shard."""


class _View(NamedTuple):
    """A view for the shards: its sample's key, where it is from, and its size in a tar.

    ``sample_sha256`` is of the sample's JSON. It has the checksum of each picture, so it stands for
    the whole sample.
    """

    key: str
    member: str
    rig: str
    name: str
    sample_sha256: str
    tar_bytes: int

    def row(self, part: Part, shard: str) -> Row:
        """Return the view's row of the index."""
        return {
            "sample": self.key,
            "member": self.member,
            "rig": self.rig,
            "view": self.name,
            "split": part,
            "shard": shard,
            "sample_sha256": self.sample_sha256,
        }


@dataclass(frozen=True)
class _Family:
    """The folder of a family, its corpus's settings, and its valid members by name."""

    folder: Path
    settings: CorpusSettings
    members: Mapping[str, MemberRecord]

    def views(self, part: Part) -> Iterator[_View]:
        """Yield the views of a part, one member after the other."""
        for member in self.members.values():
            if self.settings.splits.part_of(member.name) == part:
                for rig in sorted(member.datasets):
                    for sample in self.samples(member.name, rig):
                        digest = hashlib.sha256(sample.text).hexdigest()
                        name = sample.content["view"]
                        yield _View(sample.key, member.name, rig, name, digest, sample.tar_bytes)

    def samples(self, name: str, rig: str) -> Iterator[Sample]:
        """Yield the samples of a member's dataset."""
        member = self.members[name]
        for sample in shards.read_dataset(self.folder, self.folder / name / rig).samples:
            sample.content |= {
                # The part of the view within its member's own rigs.
                "view_split": sample.split,
                "split": self.settings.splits.part_of(name),
                "member": name,
                "rig": rig,
                "values": member.values,
            }
            yield sample

    def tar_members(self, views: Iterable[_View]) -> Iterator[tuple[str, Path | bytes]]:
        """Yield what a tar of these views has: names, and files or contents."""
        for (name, rig), of_dataset in groupby(views, lambda view: (view.member, view.rig)):
            samples = {sample.key: sample for sample in self.samples(name, rig)}
            for view in of_dataset:
                yield from samples[view.key].members


def write(
    folder: Path,
    settings: CorpusSettings,
    members: Sequence[MemberRecord],
    sums: Mapping[str, str],
) -> None:
    """Write the shards of the valid members, if the settings ask for them. Remove all others.

    ``folder`` is the family's, and ``sums`` are the SHA-256 of its files in its earlier list. A
    shard with its earlier sum is kept if it has the right views.
    """
    home = folder / SHARDS
    before = _rows(home)
    rows: list[Row] = []
    if settings.shards:
        valid = {member.name: member for member in members if member.is_valid}
        family = _Family(folder, settings, valid)
        progress = Progress(sum(member.views for member in valid.values()), "shards")
        keys: set[str] = set()
        for part in PARTS:
            views = [*family.views(part)]
            _check_keys(home, views, keys)
            earlier = [of_shard for of_shard in before.values() if of_shard[0]["split"] == part]
            most = settings.shard_gigabytes * 1e9
            for number, shard in enumerate(_arranged(views, earlier, most)):
                name = f"{part}/{settings.family}-{part}-{number:05}.tar"
                of_shard = [view.row(part, name) for view in shard]
                if not _keeps(home / name, of_shard == before.get(name), sums):
                    shards.write_tar(home / name, family.tar_members(shard))
                rows += of_shard
                progress.done(len(shard))
    written = {home / row["shard"] for row in rows}
    for path in home.glob("*/*.tar"):
        if path not in written:
            path.unlink()
    if rows:
        write_csv(home / INDEX, rows)
    else:
        (home / INDEX).unlink(missing_ok=True)


def _rows(home: Path) -> dict[str, list[Row]]:
    """Return the rows of the index, by their shards.

    If there is no index, as in corpora of older versions, the shards tell the order of the views.
    """
    rows: Iterable[Row] = ()
    with suppress(UserError):
        rows = [*csv.DictReader(read_text(home / INDEX).splitlines())]
    by_shard: dict[str, list[Row]] = {}
    for row in rows or _rows_of_tars(home):
        by_shard.setdefault(row["shard"], []).append(row)
    return by_shard


def _rows_of_tars(home: Path) -> Iterator[Row]:
    """Yield a row for each view in the shards that are there. Leaves out damaged shards."""
    for path in sorted(home.glob("*/*.tar")):
        names: list[str] = []
        with suppress(UserError, *DAMAGE):
            names = [*members_of(path)]
        for name in names:
            key, _, suffix = name.partition(".")
            if suffix == "json":
                shard = path.relative_to(home).as_posix()
                yield {"sample": key, "split": path.parent.name, "shard": shard}


def _arranged(
    views: Iterable[_View], earlier: Iterable[Iterable[Row]], most: float
) -> list[list[_View]]:
    """Return the views of each shard of a part. A shard has at most ``most`` bytes, or one view.

    ``earlier`` has the rows of its shards so far. Views stay in their shards. If a shard has become
    too large, its last views count as new. A shard without a view is left out.
    """
    new = {view.key: view for view in views}
    arranged = []
    for rows in earlier:
        present = [new[row["sample"]] for row in rows if row["sample"] in new]
        if shard := next(shards.parts(present, most), None):
            arranged.append(shard)
            for view in shard:
                del new[view.key]
    last = arranged.pop() if arranged else []
    return [*arranged, *shards.parts([*last, *new.values()], most)]


def _keeps(path: Path, has_its_views: bool, sums: Mapping[str, str]) -> bool:
    """Return whether a shard is whole, and has the right views. Note it in the job's receipt."""
    name = f"{SHARDS}/{path.parent.name}/{path.name}"
    if not (has_its_views and path.is_file() and sums.get(name) == sha256(path)):
        return False
    if receipt := receipts.current():
        receipt.note_kept(path)
    return True


def _check_keys(home: Path, views: Iterable[_View], keys: set[str]) -> None:
    """Add the keys of views to ``keys``. Raises `UserError` if one is there already."""
    for view in views:
        if view.key in keys:
            raise UserError(
                f"{home}: two views have the key {view.key}; rename the member {view.member}"
            )
        keys.add(view.key)


def files(folder: Path) -> list[str]:
    """Return the shards and their index, if they exist, by their paths in a family's ``folder``."""
    paths = [*folder.glob(f"{SHARDS}/*/*.tar"), *folder.glob(f"{SHARDS}/{INDEX}")]
    return sorted(path.relative_to(folder).as_posix() for path in paths)
