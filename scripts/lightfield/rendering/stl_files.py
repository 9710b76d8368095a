"""Gives the mesh of an STL the colours of its facets, which Blender does not read."""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.rendering import model_paint
from lightfield.rendering.second_readers import stl


def complete(path: Path, mesh: Any) -> tuple[bool, list[str]]:
    """Give a mesh the colours of the facets of its STL.

    Return whether there are any, and which it cannot have, because Blender has left out facets.
    """
    facets, colours = stl.read_facets(path)
    if colours is None:
        return False, []
    if len(mesh.polygons) != len(facets):
        return True, ["the colours of facets, because Blender leaves out some of them"]
    model_paint.give_colours(mesh, np.repeat(colours, 3, axis=0))
    return True, []
