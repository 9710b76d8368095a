"""The settings of a family's corpus, and the split of its members."""

import hashlib
from typing import Self

from pydantic import Field, model_validator

from lightfield.core.names import CORPUS, Part
from lightfield.settings.base import Settings

PAGE = "index.html"
# The list of members with their times and errors.
MEMBERS = "report/members.jsonl"
# The files of a corpus that every family has.
CORPUS_FILES = (CORPUS, PAGE, MEMBERS, "sha256sums.txt")
# A corpus has these folders beside its members' folders. No member may have such a name.
THUMBNAILS = "thumbnails"
SHARDS = "shards"


def evenly_spread(text: str) -> float:
    """Return a number from 0 to below 1 that follows from a text. Texts spread evenly."""
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6]) / 2**48


class Shares(Settings):
    """Shares of the members for validation and testing. All other members are for training."""

    validation: float = Field(
        0.1, ge=0, le=1, description="Share of the members that are for validation."
    )
    test: float = Field(0.1, ge=0, le=1, description="Share of the members that are for testing.")

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
        position = evenly_spread(name)
        if position < self.test:
            return "test"
        return "validation" if position < self.test + self.validation else "train"


class CorpusOptions(Settings):
    """How the members of a family form one corpus."""

    splits: Shares = Field(
        Shares(), description="Shares of the members that are for validation and for testing."
    )
    shards: bool = Field(False, description="Whether to also write the views as WebDataset shards.")
    shard_gigabytes: float = Field(
        1, gt=0, description="Largest size of a shard.", json_schema_extra={"unit": "GB"}
    )
