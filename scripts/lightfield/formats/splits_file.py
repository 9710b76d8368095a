"""The content of splits.json: which views of a scene's rigs train, validate and test.

It names a view by rig and view, without ``exr/`` and suffix: LFSphere/view_0000f.
"""

from collections.abc import Mapping

from lightfield.core.names import PARTS
from lightfield.formats.lightfield import LightField


def splits_content(lightfields: Mapping[str, LightField]) -> dict[str, list[str]]:
    """Return the content of a scene's splits.json: the names of the views of each part.

    ``lightfields`` maps the rigs' folders to their light fields.
    """
    names: dict[str, list[str]] = {part: [] for part in PARTS}
    for folder, lightfield in lightfields.items():
        for view in lightfield.views:
            if view.split in names:
                names[view.split].append(f"{folder}/{view.name}")
    return names
