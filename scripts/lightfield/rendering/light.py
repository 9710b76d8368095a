"""Tells whether a scene has any light. Without light every view is black."""

from typing import Any

import bpy
import numpy as np

from lightfield.rendering import animation
from lightfield.rendering.inventory import contributing, rendered_materials

# The inputs of shader nodes that emit light if none of them is 0: colour and strength.
_EMISSIONS: dict[str, list[tuple[str, ...]]] = {
    "ShaderNodeEmission": [("Color", "Strength")],
    "ShaderNodeBackground": [("Color", "Strength")],
    "ShaderNodeBsdfPrincipled": [("Emission Color", "Emission Strength")],
    "ShaderNodeVolumePrincipled": [
        ("Emission Color", "Emission Strength"),
        ("Blackbody Tint", "Blackbody Intensity"),
    ],
    "ShaderNodeVolumeCoefficients": [("Emission Coefficients",)],
}


def may_be_lit() -> bool:
    """Return whether the open scene may have light at some frame.

    It has light from lamps, from emitting materials and from the world. Drawings with Grease Pencil
    need none. An input counts as light if a link, keyframes or a driver may change it.
    """
    scene = bpy.context.scene
    objects = bpy.data.objects
    if any(obj.type == "GREASEPENCIL" or _is_shining_lamp(obj) for obj in objects):
        return True
    shaders = [scene.world, *rendered_materials()]
    for layer in scene.view_layers:
        shaders += [layer.world_override, layer.material_override]
    return any(_emits(shader) for shader in shaders if shader)


def _is_shining_lamp(obj: Any) -> bool:
    if obj.type != "LIGHT":
        return False
    lamp = obj.data
    return animation.is_animated(lamp) or bool(lamp.energy and any(lamp.color))


def _emits(shader: Any) -> bool:
    """Return whether a material or a world may emit light."""
    tree = shader.node_tree
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None:
        return False
    return any(_is_emitting(node) for node in contributing(output))


def _is_emitting(node: Any) -> bool:
    if node.bl_idname == "ShaderNodeScript":
        return True
    # Cycles treats a colour in place of a shader as emission.
    shaders = [socket for socket in node.inputs if socket.type == "SHADER"]
    if any(link.from_socket.type != "SHADER" for socket in shaders for link in socket.links):
        return True
    for names in _EMISSIONS.get(node.bl_idname, ()):
        if all(_may_be_bright(node.inputs[name]) for name in names):
            return True
    return False


def _may_be_bright(socket: Any) -> bool:
    """Return whether a node's input may be a number or colour other than 0."""
    if socket.is_linked or animation.is_animated(socket.id_data):
        return True
    return bool(np.any(np.ravel(socket.default_value)[:3]))
