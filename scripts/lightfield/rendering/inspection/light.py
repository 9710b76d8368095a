"""Finds the light of a scene. Without light every view is black."""

from typing import Any

import bpy
import numpy as np

from lightfield.formats.light_groups import WORLD
from lightfield.rendering.inspection.inventory import rendered_materials
from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.node_trees import contributing
from lightfield.rendering.scenes.render_graph import in_render

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
    shaders += [layer.world_override for layer in scene.view_layers]
    return any(_emits(shader) for shader in shaders if shader)


def emitters() -> list[str]:
    """Return the names of all that may emit light in the open scene, sorted, with the world first.

    These are the full names of lamps and of objects with a glowing material, and `WORLD`.
    """
    glowing = {material for material in bpy.data.materials if _emits(material)}
    objects = {obj for obj in bpy.data.objects if _is_shining_lamp(obj)}
    for obj in bpy.data.objects:
        if any(slot.material in glowing for slot in obj.material_slots):
            objects.add(obj)
    # Modifiers may give an object other materials.
    names = in_render(lambda depsgraph: _with_materials(depsgraph, glowing))
    names |= {str(obj.name_full) for obj in objects}
    scene = bpy.context.scene
    worlds = [scene.world, *(layer.world_override for layer in scene.view_layers)]
    has_sky = any(_emits(world) for world in worlds if world)
    # An object may have the world's name, and is then in its group.
    return [WORLD] * (has_sky or WORLD in names) + sorted(names - {WORLD})


def _with_materials(depsgraph: Any, materials: set[Any]) -> set[str]:
    """Return the full names of objects that have any of the ``materials`` when rendered."""
    names = set()
    for instance in depsgraph.object_instances:
        used = getattr(instance.object.data, "materials", None) or ()
        if any(material and material.original in materials for material in used):
            names.add(str(instance.object.original.name_full))
    return names


def _is_shining_lamp(obj: Any) -> bool:
    """Return whether an object is a lamp that may shine at some frame."""
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
