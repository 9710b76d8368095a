"""Gives meshes the materials and colours that Blender's importers do not give them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.imaging.images import is_transparent

# The opacities of a USD's mesh without material.
_OPACITY = "displayOpacity"


def give_material() -> None:
    """Give meshes without a material one: of their own colours, or else grey."""
    given: dict[tuple[str | None, bool], Any] = {}
    for mesh in bpy.data.meshes:
        if any(mesh.materials):
            continue
        mesh.materials.clear()
        colours = mesh.color_attributes.active_color
        key = (colours and colours.name, _OPACITY in mesh.attributes)
        if key not in given:
            given[key] = bpy.data.materials.new("coloured" if colours else "plain")
            paint(given[key], *key)
        mesh.materials.append(given[key])


def paint(material: Any, attribute: str | None = None, has_opacity: bool = False) -> Any:
    """Make a material matt, and grey or of the colours of an attribute. Return its shader.

    Its opacity may be the opacity of a mesh in USD.
    """
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    if attribute:
        colours = tree.nodes.new("ShaderNodeAttribute")
        colours.attribute_name = attribute
        tree.links.new(colours.outputs["Color"], shader.inputs["Base Color"])
    if has_opacity:
        opacity = tree.nodes.new("ShaderNodeAttribute")
        opacity.attribute_name = _OPACITY
        tree.links.new(opacity.outputs["Fac"], shader.inputs["Alpha"])
    return shader


def give_colours(mesh: Any, colours: NDArray[np.floating[Any]]) -> None:
    """Give a mesh the linear ``colours`` (C, 3) of its corners."""
    attribute = mesh.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
    opaque = np.ones((len(colours), 4), np.float32)
    opaque[:, :3] = colours
    attribute.data.foreach_set("color", opaque.ravel())
    mesh.color_attributes.active_color = attribute


def give_textures(
    mesh: Any, textures: Sequence[Path], uvs: NDArray[np.floating[Any]], of_face: Any
) -> None:
    """Give a mesh a material for each texture.

    ``uvs`` (C, 2) are the places of corners in it, and ``of_face`` (F,) the numbers of faces'
    textures, or None if all have the first. A missing texture is magenta.
    """
    layer = mesh.uv_layers.active or mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", np.ascontiguousarray(uvs, np.float32).ravel())
    for path in textures:
        material = bpy.data.materials.new(path.name)
        shader = paint(material)
        picture = material.node_tree.nodes.new("ShaderNodeTexImage")
        picture.image = _picture(path)
        material.node_tree.links.new(picture.outputs["Color"], shader.inputs["Base Color"])
        mesh.materials.append(material)
    if of_face is not None:
        mesh.polygons.foreach_set("material_index", np.clip(of_face, 0, len(textures) - 1))


def _picture(path: Path) -> Any:
    """Return a picture from a file, which may be missing."""
    if path.is_file():
        return bpy.data.images.load(str(path.absolute()), check_existing=True)
    picture = bpy.data.images.new(path.name, 1, 1)
    picture.source = "FILE"
    picture.filepath = str(path.absolute())
    return picture


def show_luminance() -> bool:
    """Let the luminance of each opaque picture of an alpha be the alpha, as in an OBJ's `map_d`.

    Blender takes the alpha of the picture, which is 1. Return whether there is such a picture.
    """
    is_changed = False
    for material in bpy.data.materials:
        for node in list(material.node_tree.nodes):
            for link in list(node.outputs["Alpha"].links) if _is_opaque_picture(node) else ():
                material.node_tree.links.new(node.outputs["Color"], link.to_socket)
                if node.image.users > 1:
                    node.image = node.image.copy()
                node.image.colorspace_settings.name = "Non-Color"
                is_changed = True
    return is_changed


def _is_opaque_picture(node: Any) -> bool:
    if node.bl_idname != "ShaderNodeTexImage" or node.image is None:
        return False
    return bool(node.outputs["Alpha"].links) and not is_transparent(
        bpy.path.abspath(node.image.filepath)
    )
