"""splits.json: which views of a scene's rigs train, validate and test.

It names a view by rig and view, without ``exr/`` and suffix: LFSphere/view_0000f.
"""

from collections.abc import Mapping, Sequence

from lightfield.dataset.lightfield import LightField
from lightfield.geometry.rigs.split_setting import PARTS

SPLITS = "splits.json"


def splits_content(lightfields: Mapping[str, LightField]) -> dict[str, Sequence[str]]:
    """Return what splits.json says of a scene: the names of the views of each part.

    ``lightfields`` maps the rigs' folders to their light fields.
    """
    return {
        part: [
            f"{folder}/{view.name}"
            for folder, lightfield in lightfields.items()
            for view in lightfield.views
            if view.split == part
        ]
        for part in PARTS
    }
