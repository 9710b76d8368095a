"""Reads what a member of a family left: its state, its datasets, and why it failed."""

from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, TypeAdapter, model_validator

from lightfield.configuration.family import RECEIPT, RECORD
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.paths import leads_inside
from lightfield.formats.lightfield import NAME
from lightfield.settings.base import checked

# The key of the line of a member's history that says when it was built, and what that took.
BUILT = "built"


class _Record(BaseModel):
    """A part of a member.json. Unlike settings, it may have keys that the corpus does not read."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore")


class DatasetRecord(_Record):
    """A dataset of a member. ``sha256sums`` is the SHA-256 of its sha256sums.txt."""

    views: int
    bytes: int
    split: str | None = None
    sha256sums: str


class Failure(_Record):
    """At which stage a member failed, and why. ``log`` is the path of the stage's log."""

    stage: str
    cause: str
    log: str


class MemberRecord(_Record):
    """A member of a family, as its member.json says.

    ``values`` were drawn for it, by the keys of the scene YAML. ``datasets`` have the folders of
    their rigs as keys.
    """

    name: str
    seed: int | None = None
    model: str | None = None
    values: dict[str, Any] = {}
    state: Literal["valid", "failed"]
    datasets: dict[str, DatasetRecord] = {}
    failure: Failure | None = None

    @model_validator(mode="after")
    def _has_what_its_state_needs(self) -> Self:
        if self.state == "failed" and self.failure is None:
            raise ValueError("failure: is missing, although state is failed")
        return self

    @model_validator(mode="after")
    def _has_datasets_in_its_folder(self) -> Self:
        for rig in self.datasets:
            if not leads_inside(rig):
                raise ValueError(f"datasets: {rig!r} must be a folder in the member's folder")
        return self

    @property
    def is_valid(self) -> bool:
        return self.state == "valid"

    @property
    def views(self) -> int:
        return sum(dataset.views for dataset in self.datasets.values())

    @property
    def bytes(self) -> int:
        return sum(dataset.bytes for dataset in self.datasets.values())


_MEMBER: TypeAdapter[MemberRecord] = TypeAdapter(MemberRecord)


def read_members(folder: Path, names: list[str] | None = None) -> list[MemberRecord]:
    """Read the records of a family's members, in the order of their names.

    ``folder`` is the family's. ``names`` are its members, or None for all that have a record.
    Raises `UserError` for a record that is missing or damaged.
    """
    if names is None:
        names = [path.parent.name for path in folder.glob(f"*/{RECORD}")]
    return [read_member(folder / name) for name in sorted(names)]


def former_places(
    folder: Path, receipts: Path, names: Collection[str], rigs: Collection[str]
) -> list[str]:
    """Return the folders of members and datasets that a family has built, but no longer has.

    They are relative to ``folder``, the family's folder of results. ``receipts`` is its folder of
    receipts. ``names`` are the present members, and each has a dataset of each of the ``rigs``.
    """
    records = {path.parent.name for path in folder.glob(f"*/{RECORD}")}
    # A member that was killed while it was built has no record.
    begun = {path.parent.name for path in receipts.glob(f"*/{RECEIPT}.*")}
    datasets = {
        f"{path.parent.parent.name}/{path.parent.name}"
        for path in folder.glob(f"*/*/{NAME}")
        if path.parent.parent.name in names and path.parent.name not in rigs
    }
    return sorted((records | begun).difference(names) | datasets)


def read_member(folder: Path) -> MemberRecord:
    """Read the record in a member's folder. Raises `UserError` if it is missing or damaged."""
    path = folder / RECORD
    member = checked(_MEMBER, read_json(path), str(path))
    if member.name != folder.name:
        raise UserError(f"{path}: name: is {member.name!r}; must be the name of its folder")
    return member
