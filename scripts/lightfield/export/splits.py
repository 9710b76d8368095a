"""Which views are to train on, for validation, and to test with."""

from collections.abc import Sequence
from typing import NamedTuple

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField, View
from lightfield.geometry.rigs.split import PARTS

# Where the rig has no split of its own: the test views of most trainers' own examples.
EVERY = 8


class Splits(NamedTuple):
    """Without views for ``validation``, those to ``test`` with are for it too."""

    train: Sequence[View]
    validation: Sequence[View]
    test: Sequence[View]


def splits(lightfield: LightField) -> Splits:
    """Return the views of each part: by the scene's split, or else every eighth to test with.

    Raises `UserError` if there is none to train on, or none to test with.
    """
    views = lightfield.views
    if any(view.split for view in views):
        part = {view.name: view.split for view in views}
    else:
        tests = {*sorted(view.name for view in views)[::EVERY]}
        part = {view.name: "test" if view.name in tests else "train" for view in views}
    train, validation, test = (
        [view for view in views if part[view.name] == name] for name in PARTS
    )
    if not (train and test):
        missing = "test" if train else "train"
        raise UserError(f"{lightfield.path}: frames: none is there to {missing}")
    return Splits(train, validation or test, test)
