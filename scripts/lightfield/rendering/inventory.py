"""What a scene contains: geometry, materials, textures, what moves, and which files it reads."""

from collections.abc import Iterator
from typing import Any

import bpy

from lightfield.rendering import cycles, pruning
from lightfield.rendering.external_files import external_files, problems

# Shader nodes by the feature that they give a material; the Principled BSDF by its inputs.
SHADERS = {
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
PRINCIPLED_INPUTS = {
    "Transmission Weight": ("transmission", 0.0),
    "Subsurface Weight": ("subsurface", 0.0),
    "Emission Strength": ("emission", 0.0),
    "Alpha": ("transparency", 1.0),
}
OUTPUT_INPUTS = {"Volume": "volumes", "Displacement": "displacement"}
FEATURES = sorted(
    {*SHADERS.values(), *OUTPUT_INPUTS.values(), *(name for name, _ in PRINCIPLED_INPUTS.values())}
)
IMAGE_NODES = ("ShaderNodeTexImage", "ShaderNodeTexEnvironment")
# Modifiers whose result depends on time by itself.
SIMULATIONS = {
    *("CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "OCEAN"),
    *("PARTICLE_INSTANCE", "PARTICLE_SYSTEM", "SOFT_BODY", "WAVE", "BUILD"),
}


def inventory() -> dict[str, Any]:
    """Return what the open scene contains; the file is left with that alone."""
    scene = bpy.context.scene
    others = [other for other in bpy.data.scenes if other not in (scene, scene.background_set)]
    for other in others:
        bpy.data.scenes.remove(other)
    if others:
        pruning.remove_unused()
    hidden = pruning.removable_objects()
    pruning.remove_objects(hidden)
    objects = list(bpy.data.objects)
    materials = sorted(
        {slot.material for thing in objects for slot in thing.material_slots if slot.material}
        | set_by_nodes(),
        key=lambda material: material.name_full,
    )
    lights = {thing.data for thing in objects if thing.type == "LIGHT"}
    features: dict[str, set[str]] = {name: set() for name in FEATURES}
    images = set()
    for shader in (*materials, *([scene.world] if scene.world else []), *lights):
        for feature, image in surface_features(shader):
            # A light emits by nature, whether it has nodes (as each has since Blender 5.2) or not.
            if feature and shader not in lights:
                features[feature].add(shader.name_full)
            if image:
                images.add(image)
    if any(thing.type == "CURVES" for thing in objects) or any(
        system.settings.type == "HAIR" for thing in objects for system in thing.particle_systems
    ):
        features["hair"].add("objects")
    features["volumes"] |= {thing.name_full for thing in objects if thing.type == "VOLUME"}
    return {
        **triangles(),
        "lights": sorted(light.name_full for light in lights),
        **{name: sorted(features[name]) for name in FEATURES},
        "sampling": cycles.sampling(),
        "textures": sorted(image.name_full for image in images),
        "hidden": hidden,
        "animated": sorted(owner.name_full for owner, _ in pruning.animated()),
        "moving": moving(objects),
        "motion_blur": bool(scene.render.use_motion_blur),
        "external_files": external_files(),
        "missing": problems(images),
    }


def triangles() -> dict[str, int]:
    """Count objects and triangles, as the viewport's levels of detail have them."""
    for thing in bpy.context.scene.objects:
        thing.hide_viewport = False
    meshes: dict[Any, int] = {}
    total = count = 0
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type != "MESH":
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


def set_by_nodes() -> set[Any]:
    """Return the materials that geometry nodes give to what they make."""
    users = bpy.data.user_map(subset=list(bpy.data.materials))
    kind = bpy.types.GeometryNodeTree
    return {material for material in users if any(isinstance(u, kind) for u in users[material])}


def surface_features(shader: Any) -> Iterator[tuple[str | None, Any]]:
    """Yield each feature that a material, world or light has, and each image that it reads."""
    tree = shader.node_tree
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None:
        return
    for name, feature in OUTPUT_INPUTS.items():
        if name in output.inputs and output.inputs[name].is_linked:
            yield feature, None
    for node in contributing(output):
        if node.bl_idname in SHADERS:
            yield SHADERS[node.bl_idname], None
        elif node.bl_idname == "ShaderNodeBackground":
            yield "emission", None
        elif node.bl_idname in IMAGE_NODES and node.image:
            yield None, node.image
        elif node.bl_idname == "ShaderNodeBsdfPrincipled":
            for name, (feature, without) in PRINCIPLED_INPUTS.items():
                socket = node.inputs[name]
                if socket.is_linked or socket.default_value != without:
                    yield feature, None


def contributing(node: Any) -> Iterator[Any]:
    """Yield every node whose result can reach ``node``, those inside groups too."""
    seen = set()
    waiting = [node]
    while waiting:
        node = waiting.pop()
        if node in seen:
            continue
        seen.add(node)
        yield node
        waiting += [link.from_node for socket in node.inputs for link in socket.links]
        if getattr(node, "node_tree", None):
            waiting += [n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput"]


def moving(objects: list[Any]) -> list[str]:
    """Return what may change its shape or place with time."""
    shading = (bpy.types.Material, bpy.types.World, bpy.types.Light, bpy.types.ShaderNodeTree)
    found = {owner.name_full for owner, _ in pruning.animated() if not isinstance(owner, shading)}
    for thing in objects:
        if thing.rigid_body or any(
            modifier.type in SIMULATIONS or (modifier.type == "NODES" and keeps_time(modifier))
            for modifier in thing.modifiers
        ):
            found.add(thing.name_full)
    return sorted(found)


def keeps_time(modifier: Any) -> bool:
    """Return whether a geometry nodes modifier asks for the time or simulates."""
    timed = ("GeometryNodeInputSceneTime", "GeometryNodeSimulationOutput")
    return modifier.node_group is not None and any(
        node.bl_idname in timed
        for node in modifier.node_group.nodes
        for node in (contributing(node) if node.bl_idname == "NodeGroupOutput" else ())
    )
