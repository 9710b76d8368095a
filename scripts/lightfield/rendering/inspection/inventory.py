"""Lists what a scene contains: geometry, materials, textures, animation, and external files."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from lightfield.rendering.inspection.external_files import Missing, external_files, problems
from lightfield.rendering.scenes import animation, frames, modifiers
from lightfield.rendering.scenes.node_trees import contributing
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.setup import cycles, motion_blur, pruning

# The feature that a shader node gives a material. The Principled BSDF gives them by its inputs.
_SHADERS = {
    "ShaderNodeBsdfGlass": "transmission",
    "ShaderNodeBsdfRefraction": "transmission",
    "ShaderNodeBsdfTranslucent": "translucency",
    "ShaderNodeSubsurfaceScattering": "subsurface",
    "ShaderNodeBsdfHair": "hair",
    "ShaderNodeBsdfHairPrincipled": "hair",
    "ShaderNodeEmission": "emission",
    "ShaderNodeBsdfTransparent": "transparency",
    **dict.fromkeys(
        (f"ShaderNodeTex{name}" for name in ("Gabor", "Magic", "Noise", "Voronoi", "Wave")),
        "procedural",
    ),
}
_PRINCIPLED_INPUTS = {
    "Transmission Weight": ("transmission", 0.0),
    "Subsurface Weight": ("subsurface", 0.0),
    "Emission Strength": ("emission", 0.0),
    "Alpha": ("transparency", 1.0),
}
_OUTPUT_INPUTS = {"Volume": "volumes", "Displacement": "displacement"}
FEATURES = sorted(
    {
        *_SHADERS.values(),
        *_OUTPUT_INPUTS.values(),
        *(name for name, _ in _PRINCIPLED_INPUTS.values()),
    }
)
_IMAGE_NODES = ("ShaderNodeTexImage", "ShaderNodeTexEnvironment")
# Triangles are counted in at most this many frames.
MOST_FRAMES = 8


def inventory(
    rendered_frames: Sequence[float], refuse: Callable[[Sequence[Missing]], None] | None = None
) -> dict[str, Any]:
    """Return what the open scene contains at any frame. Removes all else from the open file.

    Objects and triangles are counted at the ``rendered_frames``. If files are missing or cannot be
    read, ``refuse`` gets them before Blender evaluates the scene with them.
    """
    # Objects of other scenes may move the objects of this scene.
    changing = {
        "animated": sorted({str(owner.name_full) for owner, _ in animation.animated()}),
        "simulated": animation.simulated(),
        "uses_visibility": animation.uses_visibility(),
    }
    hidden = _remove_hidden()
    modifiers.refuse_too_many_faces()
    shaders = _shaders()
    missing = problems(shaders, rendered_frames)
    if missing and refuse:
        refuse(missing)
    objects = list(bpy.data.objects)
    lights = {shader for shader in shaders if isinstance(shader, bpy.types.Light)}
    features: dict[str, set[str]] = {name: set() for name in FEATURES}
    images = set()
    for shader in shaders:
        for feature, image in surface_features(shader):
            # A light always emits, so its nodes' features do not count.
            if feature and shader not in lights:
                features[feature].add(shader.name_full)
            if image:
                images.add(image)
    if any(obj.type == "CURVES" for obj in objects) or any(
        system.settings.type == "HAIR" for obj in objects for system in obj.particle_systems
    ):
        features["hair"].add("objects")
    features["volumes"] |= {obj.name_full for obj in objects if obj.type == "VOLUME"}
    return {
        "frames": list(rendered_frames),
        **_fullest(rendered_frames),
        "lights": sorted(light.name_full for light in lights),
        **{name: sorted(features[name]) for name in FEATURES},
        "sampling": cycles.sampling(),
        "textures": sorted(image.name_full for image in images),
        "hidden": hidden,
        **changing,
        "motion_blur": motion_blur.is_on(),
        "external_files": external_files(),
        "missing": missing,
    }


def missing_files(rendered_frames: Sequence[float]) -> list[Missing]:
    """Return the files that the open scene's render lacks. Removes all else from the open file."""
    _remove_hidden()
    return problems(_shaders(), rendered_frames)


def _remove_hidden() -> list[str]:
    """Remove the other scenes and all hidden objects. Return the names of these objects."""
    scene = bpy.context.scene
    hidden = pruning.removable_objects()
    shown = {scene, *pruning.background_scenes(scene)}
    others = [other for other in bpy.data.scenes if other not in shown]
    for other in others:
        bpy.data.scenes.remove(other)
    if others:
        pruning.remove_unused()
    pruning.remove_objects(hidden)
    return hidden


def _shaders() -> list[Any]:
    """Return the materials, worlds and lights of the open scene's objects."""
    worlds = {bpy.context.scene.world, bpy.context.view_layer.world_override} - {None}
    lights = {obj.data for obj in bpy.data.objects if obj.type == "LIGHT"}
    return [*rendered_materials(), *worlds, *lights]


def _fullest(rendered_frames: Sequence[float]) -> dict[str, Any]:
    """Return the frame with most triangles as ``fullest_frame``, and its counts.

    Evaluates at most `MOST_FRAMES` frames, because each takes time.
    """
    counts = []
    last = len(rendered_frames) - 1
    for place in np.linspace(0, last, min(last + 1, MOST_FRAMES)):
        frame = rendered_frames[round(place)]
        frames.go_to(frame)
        counts.append({"fullest_frame": frame, **in_render(_triangles)})
    return max(counts, key=lambda count: count["triangles"])


def _triangles(depsgraph: Any) -> dict[str, int]:
    """Count objects and triangles, as a render has them."""
    meshes: dict[Any, int] = {}
    total = count = 0
    for instance in depsgraph.object_instances:
        if instance.object.type != "MESH" or not instance.show_self:
            continue
        mesh = instance.object.data
        meshes[mesh] = len(mesh.loops) - 2 * len(mesh.polygons)
        total += meshes[mesh]
        count += 1
    return {
        "objects": count,
        "triangles": sum(meshes.values()),
        "triangles_with_instances": total,
    }


def rendered_materials() -> list[Any]:
    """Return the materials of all objects, by name. A view layer may override them."""
    slots = [slot for obj in bpy.data.objects for slot in obj.material_slots]
    materials = {slot.material for slot in slots if slot.material} | _set_by_nodes()
    override = bpy.context.view_layer.material_override
    if override:
        materials.add(override)
    return sorted(materials, key=lambda material: str(material.name_full))


def _set_by_nodes() -> set[Any]:
    """Return the materials that geometry nodes, or their modifiers' inputs, give to objects."""
    users = bpy.data.user_map(subset=list(bpy.data.materials))
    kinds = (bpy.types.GeometryNodeTree, bpy.types.Object)
    return {material for material in users if any(isinstance(u, kinds) for u in users[material])}


def surface_features(shader: Any) -> Iterator[tuple[str | None, Any]]:
    """Yield each feature that a material, world or light has, and each image that it reads."""
    tree = shader.node_tree
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None:
        return
    for name, feature in _OUTPUT_INPUTS.items():
        if name in output.inputs and output.inputs[name].is_linked:
            yield feature, None
    for node in contributing(output):
        if node.bl_idname in _SHADERS:
            yield _SHADERS[node.bl_idname], None
        elif node.bl_idname == "ShaderNodeBackground":
            yield "emission", None
        elif node.bl_idname in _IMAGE_NODES and node.image:
            yield None, node.image
        elif node.bl_idname == "ShaderNodeBsdfPrincipled":
            for name, (feature, without) in _PRINCIPLED_INPUTS.items():
                socket = node.inputs[name]
                if socket.is_linked or socket.default_value != without or _is_animated(socket):
                    yield feature, None


def _is_animated(socket: Any) -> bool:
    """Return whether the value of a node's input has keyframes or a driver."""
    return f"{socket.path_from_id()}.default_value" in animation.paths(socket.id_data)
