"""The corpus of a family: its settings, its members' records, and the split of the members."""

import hashlib
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.settings import Settings, checked
from lightfield.geometry.rigs.split_setting import Part

CORPUS = "corpus.json"
RECORD = "member.json"
# The folders of a corpus beside those of its members. No member may have such a name.
THUMBNAILS = "thumbnails"
SHARDS = "shards"


class Shares(Settings):
    """The shares of the members that validate and test. All others train."""

    validation: float = Field(0.1, ge=0, le=1, description="Share of the members that validate.")
    test: float = Field(0.1, ge=0, le=1, description="Share of the members that test.")

    @model_validator(mode="after")
    def _some_train(self) -> Self:
        if self.validation + self.test > 1:
            raise ValueError(
                f"validation and test are {self.validation:g} and {self.test:g}; their sum must "
                "be at most 1"
            )
        return self

    def part_of(self, name: str) -> Part:
        """Return the part of a member. It depends on the name alone, so new members change none."""
        # Evenly spread from 0 to 1.
        position = int.from_bytes(hashlib.sha256(name.encode()).digest()[:6]) / 2**48
        if position < self.test:
            return "test"
        return "validation" if position < self.test + self.validation else "train"


class CorpusOptions(Settings):
    """The key `corpus` of a family."""

    splits: Shares = Field(Shares(), description="How the members are split.")
    shards: bool = Field(False, description="Whether to write the views as WebDataset shards too.")
    shard_gigabytes: float = Field(
        1, gt=0, description="Size of a shard, at most.", json_schema_extra={"unit": "GB"}
    )


class CorpusSettings(CorpusOptions):
    """The settings of scripts/corpus.py."""

    family: str = Field(description="The name of the corpus.")
    members: list[str] | None = Field(
        None, description="The family's members. Without this key, all that have a record."
    )


class _Record(BaseModel):
    """A part of a member.json. Unlike settings, it may have keys that the corpus does not read."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore")


class MemberDataset(_Record):
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


class Member(_Record):
    """A member of a family, as its member.json says.

    ``values`` were drawn for it, by the keys of the scene YAML. ``datasets`` have the folders of
    their rigs as keys.
    """

    name: str
    seed: int | None = None
    model: str | None = None
    values: dict[str, Any] = {}
    state: Literal["valid", "failed"]
    datasets: dict[str, MemberDataset] = {}
    failure: Failure | None = None

    @model_validator(mode="after")
    def _has_what_its_state_needs(self) -> Self:
        if self.state == "failed" and self.failure is None:
            raise ValueError("failure: is missing, although state is failed")
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


_MEMBER = TypeAdapter(Member)


def read_members(folder: Path, names: list[str] | None = None) -> list[Member]:
    """Read the records of a family's members, in the order of their names.

    ``folder`` is the family's. ``names`` are its members, or None for all that have a record.
    Raises `UserError` for a record that is missing or damaged.
    """
    if names is None:
        names = [path.parent.name for path in folder.glob(f"*/{RECORD}")]
    return [read_member(folder / name) for name in sorted(names)]


def read_member(folder: Path) -> Member:
    """Read the record in a member's folder. Raises `UserError` if it is missing or damaged."""
    path = folder / RECORD
    member = checked(_MEMBER, read_json(path), str(path))
    if member.name != folder.name:
        raise UserError(f"{path}: name: is {member.name!r}; must be that of its folder")
    return member
