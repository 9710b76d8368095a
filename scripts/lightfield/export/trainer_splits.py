"""Chooses the views for training, validation and testing."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.names import PARTS
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.spread import spread

# Most trainers' own examples test with an eighth of the views. Used for rigs without a split.
EVERY = 8


class TrainerSplits(NamedTuple):
    """The views of each part. Without views for validation, ``validation`` has the test views."""

    train: Sequence[View]
    validation: Sequence[View]
    test: Sequence[View]


def splits(lightfield: LightField) -> TrainerSplits:
    """Return the views of each part of the rig's split. Without a split, an eighth tests.

    Raises `UserError` if no view trains, or no view tests.
    """
    views = lightfield.views
    if any(view.split for view in views):
        part = {view.name: view.split for view in views}
    else:
        by_name = sorted(views, key=lambda view: view.name)
        poses = np.array([view.world_from_camera for view in by_name])
        tests = {*spread(poses[:, :3, 3], poses[:, :3, 2], EVERY)}
        part = {
            view.name: "test" if number in tests else "train" for number, view in enumerate(by_name)
        }
    train, validation, test = (
        [view for view in views if part[view.name] == name] for name in PARTS
    )
    if not (train and test):
        missing = "test" if train else "train"
        raise UserError(f"{lightfield.path}: frames: no view is left to {missing}")
    return TrainerSplits(train, validation or test, test)
