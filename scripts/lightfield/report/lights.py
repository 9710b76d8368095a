"""Packs the light groups of a view, so that a page can relight it."""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import of_group
from lightfield.imaging import images, pictures
from lightfield.report.packing import light_scale, pack_light, webp

# The longer side of the pictures in pixels, at most. Smaller for more than MANY_GROUPS.
SIDE = 256
SMALLER_SIDE = 128
_MANY_GROUPS = 16


def collect(
    folder: Path, lightfield: LightField, view: View, exposure: float
) -> dict[str, Any] | None:
    """Return the pictures of a view's light groups. None without any that can be read.

    ``exposure`` in stops is that of the page.
    """
    names = lightfield.light_groups
    small = lightfield.lens.fitted(SIDE if len(names) <= _MANY_GROUPS else SMALLER_SIDE)
    groups = []
    for name in names:
        try:
            colour = images.read_image(of_group(name).path(folder, view.name), "RGB").colour
        except UserError:
            continue  # Validation reports it.
        colour = np.nan_to_num(colour, posinf=0, neginf=0)
        if colour.shape[:2] != (small.height, small.width):
            colour = pictures.shrunk(colour, small.width, small.height)
        scale = light_scale(colour)
        # Without loss: the sum of many groups would show what each has lost.
        picture = webp(pack_light(colour, scale))
        groups.append({"name": name, "scale": scale, "light": picture})
    if not groups:
        return None
    return {
        "view": view.name,
        "size": [small.width, small.height],
        "exposure": exposure,
        "groups": groups,
    }
