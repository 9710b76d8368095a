"""Which views are to train on, and which to test with."""

from collections.abc import Sequence

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField, View

# Where the rig has no split of its own: the test views of most trainers' own examples.
EVERY = 8


def splits(lightfield: LightField) -> tuple[Sequence[View], Sequence[View]]:
    """Return the views to train on and those to test with: the rig's split, or every eighth.

    Raises `UserError` if one of the two has no view.
    """
    views = lightfield.views
    if any(view.split for view in views):
        test = [view for view in views if view.split == "test"]
    else:
        test = sorted(views, key=lambda view: view.name)[::EVERY]
    kept = {view.name for view in test}
    train = [view for view in views if view.name not in kept]
    if not (train and test):
        part = "test" if train else "train"
        raise UserError(f"{lightfield.path}: frames: none is there to {part}")
    return train, test
