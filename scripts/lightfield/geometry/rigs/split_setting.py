"""The setting `split` of a rig: which of its views train, validate and test."""

from typing import Literal, Self

from pydantic import Field, model_validator

from lightfield.core.names import Part
from lightfield.settings.base import Settings


class Chosen(Settings):
    """Give `every`, or names of views. All other views are for training."""

    every: int | None = Field(
        None,
        ge=2,
        description="The views at one of n positions are test views: at every n-th position, or at "
        "positions that are spread better.",
    )
    validation: list[str] = Field([], description="Names of the validation views.")
    test: list[str] = Field([], description="Names of the test views.")

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.every is None) == (not self.names):
            raise ValueError("must have every, or test and validation with names of views")
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"must have each view once, but {name!r} occurs twice")
        return self

    @property
    def names(self) -> list[str]:
        return [*self.validation, *self.test]


Split = Literal["odd"] | Part | Chosen


def part_of(split: Split | None, name: str, number: int, is_spread: bool) -> Part | None:
    """Return the part of a view, from its name and its number.

    ``is_spread`` says whether its position is one of those that ``every`` chooses.
    """
    if split is None:
        return None
    if split == "odd":
        return "test" if number % 2 else "train"
    if not isinstance(split, Chosen):
        return split
    if name in split.validation:
        return "validation"
    return "test" if is_spread or name in split.test else "train"
