"""Writes three .blend files as artists leave them, and the files that they read.

Run as `artists.py FOLDER`.

- interior.blend: a room with a chair from a linked library, a poster whose texture is missing, a
  compositor, and the file's own view exposure.
- character.blend: an animated character (armature, hair curves) and its stage in two view layers.
  Markers choose between two cameras. Saved at frame 24, with motion blur on.
- product.blend: a bottle with its label, film transparent, depth of field, view exposure +1.5,
  and a camera that clips.
"""

import sys
from pathlib import Path

import bpy

FOLDER = Path(sys.argv[1]).resolve()


def new(samples):
    """Start a new file. Return its scene, set up for Cycles."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.world = bpy.data.worlds.new("Sky")
    nodes = scene.world.node_tree.nodes
    if not nodes:
        background = nodes.new("ShaderNodeBackground")
        output = nodes.new("ShaderNodeOutputWorld")
        scene.world.node_tree.links.new(background.outputs[0], output.inputs[0])
    next(n for n in nodes if n.bl_idname == "ShaderNodeBackground").inputs[0].default_value = (
        0.2,
        0.3,
        0.6,
        1,
    )
    return scene


def put(name, data, collection, location=(0, 0, 0), rotation=(0, 0, 0)):
    """Place data in the scene as an object."""
    obj = bpy.data.objects.new(name, data)
    obj.location, obj.rotation_euler = location, rotation
    collection.objects.link(obj)
    return obj


def box(name, size, colour=(0.8, 0.8, 0.8, 1), texture=None):
    """Return the mesh of a box on the ground, with its material."""
    x, y, z = (side / 2 for side in size)
    corners = [(a, b, c + z) for a in (-x, x) for b in (-y, y) for c in (-z, z)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.uv_layers.new()
    for loop, uv in enumerate(mesh.uv_layers[0].data):
        uv.uv = ((0, 0), (1, 0), (1, 1), (0, 1))[loop % 4]
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = colour
    if texture:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = texture
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.append(material)
    return mesh


def lamp(collection, location, watts):
    light = bpy.data.lights.new("Lamp", "POINT")
    light.energy, light.shadow_soft_size = watts, 0.3
    return put("Lamp", light, collection, location)


def camera(name, collection, location, rotation, lens):
    data = bpy.data.cameras.new(name)
    data.lens = lens
    return put(name, data, collection, location, rotation)


def image(name, colour):
    """Save a picture beside the .blend files. Return it as a texture."""
    picture = bpy.data.images.new(name, 8, 8)
    picture.pixels = list(colour) * 64
    picture.filepath_raw, picture.file_format = str(FOLDER / f"{name}.png"), "PNG"
    picture.save()
    picture.source = "FILE"
    return picture


def save(name):
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{name}.blend"), relative_remap=True)


def interior():
    new(4096)
    chair = put("Chair", box("Chair", (0.5, 0.5, 0.9), (0.7, 0.1, 0.1, 1)), bpy.context.collection)
    bpy.data.libraries.write(str(FOLDER / "furniture.blend"), {chair})

    scene = new(4096)
    root = scene.collection
    put("Room", box("Room", (4, 4, 2.6), (0.8, 0.75, 0.6, 1)), root)
    poster = box("Poster", (1, 0.02, 1), texture=image("poster", (0.1, 0.8, 0.1, 1)))
    put("Poster", poster, root, (0, 1.9, 0.8))
    with bpy.data.libraries.load(str(FOLDER / "furniture.blend"), link=True) as (_, wanted):
        wanted.objects = ["Chair"]
    root.objects.link(wanted.objects[0])
    lamp(root, (0, 0, 2.3), 60)
    tree = bpy.data.node_groups.new("Grading", "CompositorNodeTree")
    tree.nodes.new("CompositorNodeRLayers")
    scene.compositing_node_group = tree
    scene.camera = camera("Corner", root, (-1.5, -1.5, 1.5), (1.4, 0, -0.8), 24)
    save("interior")
    (FOLDER / "poster.png").unlink()


def character():
    scene = new(256)
    scene.frame_start, scene.frame_end = 1, 48
    root = scene.collection
    parts = {}
    for name in ("Actor", "Set"):
        parts[name] = bpy.data.collections.new(name)
        root.children.link(parts[name])
    scene.view_layers[0].name = "Main"
    scene.view_layers.new("Stage")
    scene.view_layers["Main"].layer_collection.children["Set"].exclude = True
    scene.view_layers["Stage"].layer_collection.children["Actor"].exclude = True

    skeleton = bpy.data.armatures.new("Skeleton")
    rig = put("Rig", skeleton, parts["Actor"])
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = skeleton.edit_bones.new("Spine")
    bone.tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    body = put("Body", box("Body", (0.5, 0.3, 1.2), (0.1, 0.5, 0.2, 1)), parts["Actor"])
    body.vertex_groups.new(name="Spine").add(range(8), 1, "REPLACE")
    body.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Spine"]
    for frame, across in ((1, -0.8), (48, 0.8)):
        pose.location = (across, 0, 0)
        pose.keyframe_insert("location", frame=frame)

    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([4] * 60)
    points = []
    for curve in range(60):
        x = (curve % 10) / 20 - 0.225
        y = (curve // 10) / 20 - 0.125
        points += [(x, y, 1.2), (x, y, 1.35), (1.1 * x, y - 0.05, 1.5), (1.3 * x, y - 0.1, 1.6)]
    hair.position_data.foreach_set("vector", [value for point in points for value in point])
    brown = box("Brown", (1, 1, 1), (0.3, 0.1, 0.02, 1)).materials[0]
    hair.materials.append(brown)
    put("Hair", hair, parts["Actor"]).parent = body

    put("Floor", box("Floor", (6, 6, 0.1), (0.6, 0.6, 0.6, 1)), parts["Set"], (0, 0, -0.1))
    lamp(root, (2, -2, 3), 400)
    for name, frame, x in (("Wide", 1, 0), ("Close", 40, 1)):
        shot = camera(name, root, (x, -5, 1), (1.5708, 0, 0), 35)
        shot.keyframe_insert("location", frame=1)
        shot.location.x += 1
        shot.keyframe_insert("location", frame=48)
        scene.timeline_markers.new(name, frame=frame).camera = shot
    scene.render.use_motion_blur = True
    scene.frame_set(24)
    save("character")


def product():
    scene = new(4)
    root = scene.collection
    put("Bottle", box("Bottle", (0.3, 0.3, 0.8), (0.05, 0.2, 0.4, 1)), root)
    label = box("Label", (0.31, 0.31, 0.3), texture=image("label", (0.9, 0.7, 0.1, 1)))
    put("Label", label, root, (0, 0, 0.2))
    put("Table", box("Table", (3, 3, 0.1), (0.5, 0.5, 0.5, 1)), root, (0, 0, -0.1))
    put("Behind", box("Behind", (0.3, 0.3, 1.5), (0.8, 0.1, 0.1, 1)), root, (0.5, 3, 0))
    lamp(root, (1, -2, 2), 80)
    shot = camera("Hero", root, (0, -2, 0.4), (1.5708, 0, 0), 50)
    shot.data.dof.use_dof, shot.data.dof.aperture_fstop = True, 0.2
    shot.data.dof.focus_object = bpy.data.objects["Bottle"]
    shot.data.shift_y, shot.data.clip_start = 0.1, 1
    scene.camera = shot
    scene.render.film_transparent = True
    scene.view_settings.exposure = 1.5
    save("product")


if __name__ == "__main__":
    interior()
    character()
    product()
