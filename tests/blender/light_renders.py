"""Makes scenes with and without light, and renders a panorama of each.

Run by test_light.py in a process of its own, because bpy has one scene at a time:
light_renders.py FOLDER writes a .blend of each scene, saved at frame 1, and FOLDER/results.json.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.rendering.inspection import inventory, light
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
from lightfield.rendering.views.colour_pass import render_colour

FOLDER = Path(sys.argv[1])
FRAME = 5
RENDER = {"samples": 16, "adaptive_threshold": 0, "denoise": False, "seed": 0}


def lamp(energy=100.0, colour=(1, 1, 1)):
    data = bpy.data.lights.new("lamp", "POINT")
    data.energy, data.color = energy, colour
    obj = bpy.data.objects.new("lamp", data)
    obj.location = (0, 0, 2)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def world(colour=(0.2, 0.3, 0.5, 1), strength=1.0):
    sky = bpy.data.worlds.new("sky")
    bpy.context.scene.world = sky
    background = sky.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = colour
    background.inputs["Strength"].default_value = strength
    return sky


def painted(kind, output="Surface", **inputs):
    """Paint the cube with one shader node. Return its node tree and the node."""
    material = bpy.data.materials.new("paint")
    tree = material.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs[output])
    bpy.data.objects["cube"].data.materials.append(material)
    return tree, node


def nothing():
    """Leave the cube alone."""


def black_world():
    world(colour=(0, 0, 0, 1))


def world_without_strength():
    world(strength=0)


def world_without_nodes():
    world().node_tree.nodes.clear()


def lamp_without_power():
    lamp(energy=0)


def black_lamp():
    lamp(colour=(0, 0, 0))


def hidden_lamp():
    lamp().hide_render = True


def lamp_in_an_excluded_collection():
    obj = lamp()
    collection = bpy.data.collections.new("off")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(obj)
    bpy.context.scene.collection.objects.unlink(obj)
    bpy.context.view_layer.layer_collection.children["off"].exclude = True


def emission_without_strength():
    painted("ShaderNodeEmission", Strength=0.0)


def black_emission():
    painted("ShaderNodeEmission", Color=(0, 0, 0, 1))


def plain_paint():
    painted("ShaderNodeBsdfPrincipled")


def emitting_material_of_no_object():
    painted("ShaderNodeEmission")
    bpy.data.objects["cube"].data.materials.clear()
    bpy.data.materials["paint"].use_fake_user = True


def shining_lamp():
    lamp()


def lamp_that_keyframes_turn_on():
    data = lamp().data
    for frame, energy in ((1, 0), (FRAME, 100)):
        data.energy = energy
        data.keyframe_insert("energy", frame=frame)


def lamp_that_keyframes_show():
    obj = lamp()
    for frame, hidden in ((1, True), (FRAME, False)):
        obj.hide_render = hidden
        obj.keyframe_insert("hide_render", frame=frame)


def blue_world():
    world()


def world_that_a_driver_lights():
    socket = world(strength=0).node_tree.nodes["Background"].inputs["Strength"]
    socket.driver_add("default_value").driver.expression = "frame / 5"


def world_of_a_colour_without_shader():
    tree = world().node_tree
    tree.nodes.remove(tree.nodes["Background"])
    colour = tree.nodes.new("ShaderNodeRGB")
    tree.links.new(colour.outputs[0], tree.nodes["World Output"].inputs[0])


def emission():
    painted("ShaderNodeEmission")


def emission_in_a_group():
    group = bpy.data.node_groups.new("glow", "ShaderNodeTree")
    group.interface.new_socket("Glow", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside = group.nodes.new("ShaderNodeEmission")
    group.links.new(inside.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    tree, node = painted("ShaderNodeEmission", Strength=0.0)
    outside = tree.nodes.new("ShaderNodeGroup")
    outside.node_tree = group
    tree.links.new(outside.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    tree.nodes.remove(node)


def emission_of_the_principled_shader():
    painted("ShaderNodeBsdfPrincipled", Emission_Strength=1.0)


def fire():
    painted("ShaderNodeVolumePrincipled", "Volume", Blackbody_Intensity=1.0, Temperature=2000.0)


def glowing_fog():
    painted("ShaderNodeVolumePrincipled", "Volume", Emission_Strength=1.0)


def picture():
    """Make a picture of one colour, packed into the .blend."""
    image = bpy.data.images.new("picture", 4, 4)
    image.pixels = [0.5, 0.4, 0.3, 1] * 16
    image.pack()
    return image


def world_of_a_picture():
    sky = world(colour=(0, 0, 0, 1))
    # By this map Cycles sends rays to the bright parts of the sky. By default it is large.
    sky.cycles.sampling_method, sky.cycles.sample_map_resolution = "MANUAL", 16
    tree = sky.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = picture()
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def emission_of_a_picture():
    tree, emission = painted("ShaderNodeEmission", Color=(0, 0, 0, 1))
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture()
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])


def emission_that_keyframes_turn_on():
    _, emission = painted("ShaderNodeEmission")
    for frame, strength in ((1, 0), (FRAME, 1)):
        emission.inputs["Strength"].default_value = strength
        emission.inputs["Strength"].keyframe_insert("default_value", frame=frame)


def emission_that_a_modifier_gives():
    """Let a geometry nodes modifier set the cube's material from its input."""
    painted("ShaderNodeEmission")
    cube = bpy.data.objects["cube"]
    cube.data.materials.clear()
    tree = bpy.data.node_groups.new("paints", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Mesh", in_out=direction, socket_type="NodeSocketGeometry")
    paint = tree.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketMaterial")
    first, give, last = (
        tree.nodes.new(name)
        for name in ("NodeGroupInput", "GeometryNodeSetMaterial", "NodeGroupOutput")
    )
    tree.links.new(first.outputs["Mesh"], give.inputs["Geometry"])
    tree.links.new(first.outputs["Paint"], give.inputs["Material"])
    tree.links.new(give.outputs[0], last.inputs[0])
    modifier = cube.modifiers.new("paints", "NODES")
    modifier.node_group = tree
    # Blender 5.2 keeps the inputs of modifiers elsewhere.
    inputs = getattr(modifier, "properties", None)
    if inputs:
        getattr(inputs.inputs, paint.identifier).value = bpy.data.materials["paint"]
    else:
        modifier[paint.identifier] = bpy.data.materials["paint"]


def lamp_of_a_light_group():
    bpy.context.view_layer.lightgroups.add(name="key light")
    lamp().lightgroup = "key light"


def lamp_of_a_library():
    """Link the only lamp from another .blend, as an instance of a collection."""
    library = FOLDER / "library.blend"
    collection = bpy.data.collections.new("lamps")
    obj = lamp()
    collection.objects.link(obj)
    bpy.data.libraries.write(str(library), {collection})
    for block in (obj, obj.data, collection):
        bpy.data.batch_remove([block])
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["lamps"]
    instance = bpy.data.objects.new("lamps", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", wanted.collections[0]
    bpy.context.scene.collection.objects.link(instance)


CASES = {
    False: [
        nothing,
        black_world,
        world_without_strength,
        world_without_nodes,
        lamp_without_power,
        black_lamp,
        hidden_lamp,
        lamp_in_an_excluded_collection,
        emission_without_strength,
        black_emission,
        plain_paint,
        emitting_material_of_no_object,
    ],
    True: [
        shining_lamp,
        lamp_that_keyframes_turn_on,
        lamp_that_keyframes_show,
        blue_world,
        world_that_a_driver_lights,
        world_of_a_colour_without_shader,
        emission,
        emission_in_a_group,
        emission_of_the_principled_shader,
        fire,
        glowing_fog,
        world_of_a_picture,
        emission_of_a_picture,
        emission_that_keyframes_turn_on,
        emission_that_a_modifier_gives,
        lamp_of_a_light_group,
        lamp_of_a_library,
    ],
}


def rendered(path):
    """Return the brightest value of a panorama at `FRAME`."""
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [16, 8]})
    rig = {"type": "lattice", "cameras": [1, 1, 1], "center": [0, -2, 1.5]}
    lightfield = LightField.from_rig(rig, lens, depth=None, frame=FRAME, render=RENDER)
    opened = cycles.set_up(path, None, lightfield, "cpu", 1)
    pose = lightfield.views[0].world_from_camera
    return float(render_colour(opened, pose, 1).pixels.max())


def main():
    results = {}
    for make in CASES[False] + CASES[True]:
        path = FOLDER / f"{make.__name__}.blend"
        blend_file.new_scene()
        bpy.ops.mesh.primitive_cube_add()
        bpy.context.object.name = "cube"
        make()
        bpy.context.scene.frame_set(1)
        blend_file.save_scene(path)
        brightest = rendered(path)
        blend_file.open_scene(path)
        inventory.inventory([FRAME])
        results[make.__name__] = {"brightest": brightest, "may_be_lit": light.may_be_lit()}
    assert np.isfinite([result["brightest"] for result in results.values()]).all()
    (FOLDER / "results.json").write_text(json.dumps(results))


if __name__ == "__main__":
    main()
