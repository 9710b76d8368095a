"""splits.json: what the views of a scene's rigs are for: training, validation, or a test.

A view is named by its path in the scene's folder, without ``exr/`` and suffix: LFSphere/view_0000f.
"""

from collections.abc import Mapping, Sequence

from lightfield.dataset.lightfield import LightField
from lightfield.geometry.rigs.split import PARTS

SPLITS = "splits.json"


def listed(lightfields: Mapping[str, LightField]) -> dict[str, Sequence[str]]:
    """Return the content of splits.json for the light fields of a scene, by their folders."""
    return {
        part: [
            f"{folder}/{view.name}"
            for folder, lightfield in lightfields.items()
            for view in lightfield.views
            if view.split == part
        ]
        for part in PARTS
    }
