"""Imports model files into the open scene, as scripts/import_model.py does."""

import pytest

from lightfield.core.errors import UserError
from lightfield.stages.scene import ImportSettings


def imported(path, **settings):
    """Import a model into the open scene, and return its record."""
    # Blender has one global state, so it is not imported with the module.
    from lightfield.rendering import model

    return model.make_scene(ImportSettings(model=str(path), **settings), path.parent)


def refusal(path, **settings):
    """Return the message with which the import of a model is refused."""
    with pytest.raises(UserError) as caught:
        imported(path, **settings)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and message.isprintable()
    return message
