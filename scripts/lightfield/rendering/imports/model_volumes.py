"""Corrects how the glass of an imported model absorbs light on its way through it."""

from typing import Any

import bpy
import numpy as np

# A colour of 0 would absorb without end.
_DARKEST = 1e-6


def volumes() -> list[Any]:
    """Return the shader nodes of all materials that absorb light."""
    return [
        node
        for material in bpy.data.materials
        for node in (material.node_tree.nodes if material.node_tree else ())
        if node.bl_idname == "ShaderNodeVolumeAbsorption"
    ]


def follow_gltf() -> None:
    """Let materials absorb as glTF says: their colour is left after the attenuation distance.

    The importer takes 1 - colour for the share that is lost in each short part of the distance.
    """
    for node in volumes():
        density, colour = node.inputs["Density"], node.inputs["Color"]
        lost = -np.log(np.maximum(colour.default_value[:3], _DARKEST))
        if most := float(lost.max()):
            density.default_value *= most
            colour.default_value = (*(1 - lost / most), 1)


def scale(factor: float) -> None:
    """Let light that goes through a model lose as much as before the model was scaled."""
    for node in volumes():
        # A density is so much in a metre.
        node.inputs["Density"].default_value /= factor
