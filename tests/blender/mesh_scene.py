"""Writes scene.blend with every kind of object that a mesh may or may not show.

Run as `mesh_scene.py FOLDER`. The objects that cameras see stand in rows on a floor, in front of a
camera at the origin that looks along +Y. Those that must not be in a mesh are in front of them, or
behind the camera if a render shows them.
"""

import sys
from pathlib import Path

import bpy

from lightfield.rendering.scenes import blend_file

BEHIND = (0, -5, 0)


def add(name, kind="cube", collection=None, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    obj = bpy.context.object
    obj.name = name
    # An instance has a number in the id passes only if it has a material.
    obj.data.materials.append(grey)
    if collection:
        for old in obj.users_collection:
            old.objects.unlink(obj)
        collection.objects.link(obj)
    return obj


def new_collection(name, linked=True):
    collection = bpy.data.collections.new(name)
    if linked:
        bpy.context.scene.collection.children.link(collection)
    return collection


def modified():
    add("floor", "plane", size=30, location=(0, 8, -1))
    smooth = add("smooth", size=0.8, location=(-2.4, 6, -0.5)).modifiers.new("smooth", "SUBSURF")
    smooth.levels = 0
    smooth.render_levels = 3
    row = add("row", size=0.3, location=(-1.4, 6, -0.6)).modifiers.new("row", "ARRAY")
    row.count = 3
    row.relative_offset_displace = (0, 0, 1.2)
    moving = add("moving", "cone", location=(0, 3, 5), radius1=0.4, depth=0.8)
    moving.keyframe_insert("location", frame=1)
    moving.location = (-0.4, 6, -0.5)
    moving.keyframe_insert("location", frame=2)


def placed():
    props = new_collection("props", linked=False)
    add("prop", "torus", props, location=(0, 0, 0), major_radius=0.3, minor_radius=0.1)
    add("other prop", "cone", props, location=(0.2, 0, 0.4), radius1=0.2, depth=0.4)
    for name, place, scale in (
        ("left", (0.6, 6, -0.6), (1, 1, 1)),
        ("right", (1.6, 6, 0), (-1, 1, 2)),
    ):
        empty = bpy.data.objects.new(name, None)
        empty.instance_type = "COLLECTION"
        empty.instance_collection = props
        empty.location = place
        empty.scale = scale
        empty.rotation_euler = (0.4, 0.2, 0.3)
        bpy.context.collection.objects.link(empty)
    parent = bpy.data.objects.new("squeezed", None)
    parent.location = (2.6, 6, -0.4)
    # It also mirrors.
    parent.scale = (1, 1, -0.4)
    bpy.context.collection.objects.link(parent)
    sheared = add("sheared", size=0.6, location=(0, 0, 0))
    sheared.parent = parent
    sheared.rotation_euler = (0, 0.6, 0.3)


def without_a_mesh_of_their_own():
    bpy.ops.object.text_add(location=(-2.6, 7, 0.6), rotation=(1.57, 0, 0))
    text = bpy.context.object
    text.name = "text"
    text.data.extrude = 0.1
    text.data.materials.append(grey)
    bpy.ops.curve.primitive_bezier_circle_add(location=(-0.4, 7, 1), radius=0.5)
    bpy.context.object.name = "ring"
    bpy.context.object.data.bevel_depth = 0.08
    bpy.context.object.data.materials.append(grey)
    bpy.ops.object.metaball_add(location=(1, 7, 1), radius=0.6)
    bpy.context.object.name = "drop"
    bpy.context.object.data.materials.append(grey)
    points = add("points", "plane", size=0.8, location=(2.4, 7, 1))
    stone = add("stone", "ico_sphere", radius=0.15, subdivisions=1, location=(0, -50, 0))
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start = tree.nodes.new("NodeGroupInput")
    end = tree.nodes.new("NodeGroupOutput")
    scatter = tree.nodes.new("GeometryNodeInstanceOnPoints")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = stone
    info.inputs["As Instance"].default_value = True
    tree.links.new(start.outputs[0], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], end.inputs[0])
    points.modifiers.new("scatter", "NODES").node_group = tree


def unseen():
    add("hidden", size=0.5, location=(-1, 3, -0.3)).hide_render = True
    add("no camera rays", size=0.5, location=(0, 3, -0.3)).visible_camera = False
    excluded = new_collection("excluded")
    add("excluded", size=0.5, collection=excluded, location=(1, 3, -0.3))
    indirect = new_collection("indirect")
    add("indirect", size=0.5, collection=indirect, location=(-0.5, 3, 0.4))
    layers = bpy.context.view_layer.layer_collection.children
    layers["excluded"].exclude = True
    layers["indirect"].indirect_only = True
    emitter = add("emitter", size=0.5, location=(0.5, 3, 0.4))
    emitter.modifiers.new("dots", "PARTICLE_SYSTEM")
    emitter.particle_systems[0].settings.render_type = "NONE"
    emitter.show_instancer_for_render = False
    # Nothing is behind it, so that a pixel of it is empty whether it is there or not.
    add("holdout", size=0.6, location=(0, 7, 2.6)).is_holdout = True


def cannot_be_a_mesh():
    fog = bpy.data.materials.new("fog")
    nodes = fog.node_tree.nodes
    scatter = nodes.new("ShaderNodeVolumeScatter")
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    fog.node_tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    for link in [link for link in fog.node_tree.links if link.to_socket.name == "Surface"]:
        fog.node_tree.links.remove(link)
    add("fog", size=0.5, location=(0.6, 4, 0)).data.materials[0] = fog
    for name, data in (
        ("smoke", bpy.data.volumes.new("smoke")),
        ("strands", bpy.data.hair_curves.new("strands")),
        ("dust", bpy.data.pointclouds.new("dust")),
    ):
        obj = bpy.data.objects.new(name, data)
        obj.location = BEHIND
        bpy.context.collection.objects.link(obj)
    bpy.data.objects["strands"].data.add_curves([4])
    furry = add("furry", "uv_sphere", location=BEHIND)
    furry.modifiers.new("fur", "PARTICLE_SYSTEM")
    furry.particle_systems[0].settings.type = "HAIR"


blend_file.new_scene()
grey = bpy.data.materials.new("grey")
bpy.context.scene.world = bpy.data.worlds.new("world")
for part in (modified, placed, without_a_mesh_of_their_own, unseen, cannot_be_a_mesh):
    part()
bpy.ops.object.light_add(type="SUN")
bpy.context.scene.frame_set(1)
blend_file.save_scene(Path(sys.argv[1]) / "scene.blend")
