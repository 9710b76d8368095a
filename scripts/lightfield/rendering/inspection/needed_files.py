"""Finds out which of a .blend's files a render reads, and in which format."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy

from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes.node_trees import contributing

# The nodes that import geometry, by the beginning of their type.
_IMPORTS = "GeometryNodeImport"
# Users of textures that change nothing in a render without its compositor.
_SHOW_NOTHING = (bpy.types.Brush, bpy.types.FreestyleLineStyle, bpy.types.CompositorNodeTree)


class Needed:
    """What the render of the open scene reads.

    ``shaders`` are its materials, worlds and lights.
    """

    def __init__(self, shaders: Sequence[Any]) -> None:
        self._users = bpy.data.user_map()
        trees = [shader.node_tree for shader in shaders if shader.node_tree]
        outputs = [tree.get_output_node("CYCLES") for tree in trees]
        outputs += [
            node
            for obj in bpy.data.objects
            for modifier in shown_modifiers(obj, "NODES")
            for node in (modifier.node_group.nodes if modifier.node_group else ())
            if node.bl_idname == "NodeGroupOutput"
        ]
        self._nodes = {node for output in outputs if output for node in contributing(output)}
        self._images = {image for node in self._nodes for image in _images(node)}

    def includes(self, block: Any, path: str) -> bool:
        """Return whether the render reads the file at a ``path``, as the data-block has it."""
        match block:
            case bpy.types.Image():
                return block in self._images or any(map(self._reads_image, self._users[block]))
            case bpy.types.Library():
                return True
            case bpy.types.Object():
                return all(modifier is None or _reads(modifier) for modifier in _at(block, path))
            case bpy.types.CacheFile():
                return any(_reads_cache(user, block) for user in self._users[block])
        nodes = [node for node in _nodes_of(block) if path in paths_of(node)]
        if nodes:
            return any(node in self._nodes and _is_used(node) for node in nodes)
        return bool(block.users > block.use_fake_user)

    def image_users(self, image: Any) -> list[Any]:
        """Return the settings with which nodes and textures read an image. They choose frames."""
        readers = [*self._nodes, *self._users[image]]
        return [
            reader.image_user
            for reader in readers
            if hasattr(reader, "image_user") and reader.image == image
        ]

    def _reads_image(self, user: Any) -> bool:
        """Return whether a user of an image shows it, besides nodes."""
        if isinstance(user, bpy.types.Texture):
            return any(_reads_texture(each, user) for each in self._users[user])
        # The image is an input of geometry nodes.
        return isinstance(user, bpy.types.Object) and any(shown_modifiers(user, "NODES"))


def shown_modifiers(obj: Any, *kinds: str) -> Iterator[Any]:
    """Yield the modifiers of an object that a render may apply, of some kinds or of any."""
    for modifier in obj.modifiers:
        # Keyframes may turn it on.
        switch = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].show_render'
        if (not kinds or modifier.type in kinds) and (
            modifier.show_render or switch in animation.paths(obj)
        ):
            yield modifier


def format_of(block: Any, path: Path) -> str:
    """Return the format in which a data-block reads a file: its suffix, unless Blender knows it."""
    match block:
        case bpy.types.Image():
            return "movie" if block.source == "MOVIE" else "picture"
        case bpy.types.Volume():
            return "vdb"
        case bpy.types.VectorFont():
            return "font"
        case bpy.types.Object():
            for modifier in shown_modifiers(block, "MESH_CACHE"):
                if _absolute(block, modifier.filepath) == os.path.normpath(path):
                    return str(modifier.cache_format).lower()
    for node in _nodes_of(block):
        if any(_absolute(block, each) == os.path.normpath(path) for each in paths_of(node)):
            if node.bl_idname == "ShaderNodeTexIES":
                return "ies"
            if node.bl_idname.startswith(_IMPORTS):
                return str(node.bl_idname.removeprefix(_IMPORTS).lower())
    return path.suffix.lower().removeprefix(".")


def is_shader(block: Any, path: str) -> bool:
    """Return whether nodes of a data-block read an OSL shader at a path."""
    return any(
        node.bl_idname == "ShaderNodeScript" and path in paths_of(node) for node in _nodes_of(block)
    )


def paths_of(node: Any) -> list[str]:
    """Return the paths of files that a node itself has. A link may give it another."""
    if node.bl_idname in ("ShaderNodeTexIES", "ShaderNodeScript"):
        return [node.filepath] if node.mode == "EXTERNAL" else []
    return [
        socket.default_value
        for socket in node.inputs
        if socket.bl_idname == "NodeSocketStringFilePath"
        and not any(not link.is_muted for link in socket.links)
    ]


def paths_of_inputs(modifier: Any) -> Iterator[str]:
    """Yield the paths of files among the inputs of a modifier of geometry nodes."""
    tree = modifier.node_group
    # Blender 5.2 keeps the inputs in `properties`.
    inputs = getattr(modifier, "properties", None)
    for item in tree.interface.items_tree if tree else ():
        if getattr(item, "subtype", None) == "FILE_PATH":
            name = item.identifier
            path = getattr(inputs.inputs, name).value if inputs else modifier[name]
            if path:
                yield str(path)


def _absolute(block: Any, path: str) -> str:
    absolute: str = bpy.path.abspath(path, library=block.library)
    return os.path.normpath(absolute)


def _nodes_of(block: Any) -> list[Any]:
    tree = block if isinstance(block, bpy.types.NodeTree) else getattr(block, "node_tree", None)
    return list(tree.nodes) if tree else []


def _images(node: Any) -> Iterator[Any]:
    """Yield the images that a node reads itself, or by its inputs."""
    candidates = [getattr(node, "image", None)]
    candidates += [getattr(socket, "default_value", None) for socket in node.inputs]
    for candidate in candidates:
        if isinstance(candidate, bpy.types.Image):
            yield candidate


def _is_used(node: Any) -> bool:
    """Return whether Cycles runs a node. It runs OSL shaders only if the scene asks for OSL."""
    return node.bl_idname != "ShaderNodeScript" or bool(bpy.context.scene.cycles.shading_system)


def _at(obj: Any, path: str) -> list[Any]:
    """Return the modifiers of an object that have a path, or None in place of anything else."""
    owners = [modifier for modifier in obj.modifiers if path in _paths(modifier)]
    return owners or [None]


def _paths(modifier: Any) -> list[str]:
    match modifier.type:
        case "MESH_CACHE" | "OCEAN":
            return [modifier.filepath]
        case "FLUID" if modifier.fluid_type == "DOMAIN":
            return [modifier.domain_settings.cache_directory]
        case "NODES":
            return list(paths_of_inputs(modifier))
    return []


def _reads(modifier: Any) -> bool:
    """Return whether a render reads the file or the folder of a modifier."""
    is_shown = modifier in shown_modifiers(modifier.id_data)
    return is_shown and (modifier.type != "OCEAN" or bool(modifier.is_cached))


def _reads_cache(user: Any, cache: Any) -> bool:
    """Return whether an object takes its shape or its place from a cache's file."""
    if not isinstance(user, bpy.types.Object):
        return False
    caches = [modifier.cache_file for modifier in shown_modifiers(user, "MESH_SEQUENCE_CACHE")]
    caches += [
        constraint.cache_file
        for constraint in user.constraints
        if constraint.type == "TRANSFORM_CACHE"
        and (not constraint.mute or animation.is_animated(user))
    ]
    return cache in caches


def _reads_texture(user: Any, texture: Any) -> bool:
    """Return whether a user of a texture changes what a render shows."""
    if not isinstance(user, bpy.types.Object):
        return not isinstance(user, _SHOW_NOTHING)
    textures = [user.field.texture] if user.field else []
    for modifier in shown_modifiers(user):
        textures += [getattr(modifier, name, None) for name in ("texture", "mask_texture")]
    return texture in textures
