"""Makes scenes that change from frame 1 to frame 5, and renders each unpruned and pruned at both.

Run by test_frames.py in a process of its own, because bpy has one scene at a time:
animated_renders.py FOLDER writes FOLDER/results.json. Each file is saved at frame 1.
"""

import json
import sys
from hashlib import sha256
from pathlib import Path

import bpy
import numpy as np
from pruned_renders import add, rendered, shader

from lightfield.rendering.inspection import inventory
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import pruning
from scenes import room

FOLDER = Path(sys.argv[1])
FRAMES = (1, 5)
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def switched(owner, path, first, then, index=-1):
    """Give a property one value at frame 1, and another from frame 5 on."""
    changing(owner, path, first, then, index)
    data = owner.id_data.animation_data
    for curve in data.action.layers[0].strips[0].channelbags[0].fcurves:
        for point in curve.keyframe_points:
            point.interpolation = "CONSTANT"


def changing(owner, path, first, then, index=-1):
    """Change a property linearly from one value at frame 1 to another at frame 5."""
    for frame, value in zip(FRAMES, (first, then), strict=True):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)


def driven(owner, path, expression, *variables, index=-1):
    """Drive a property by an expression of variables: (name, block, path within the block)."""
    driver = owner.driver_add(path, index).driver
    driver.expression = expression
    for name, block, source in variables:
        variable = driver.variables.new()
        variable.name = name
        variable.targets[0].id_type = "SCENE" if block == bpy.context.scene else "OBJECT"
        variable.targets[0].id = block
        variable.targets[0].data_path = source


def new_cube(name="late", **settings):
    return add("cube", **{"size": 0.8, "location": (0, 1.5, 1), **settings}, name=name)


def empty(name, location=(0, 0, 0)):
    obj = bpy.data.objects.new(name, None)
    obj.location = location
    bpy.context.scene.collection.objects.link(obj)
    return obj


def moved_to_collection(name, *objs, exclude=False):
    """Move objects into a new collection of the scene."""
    scene = bpy.context.scene
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    for obj in objs:
        collection.objects.link(obj)
        scene.collection.objects.unlink(obj)
    bpy.context.view_layer.layer_collection.children[name].exclude = exclude
    return collection


def only_in_scene(name, obj):
    """Move an object to another scene of the file. Return that scene."""
    other = bpy.data.scenes.new(name)
    other.collection.objects.link(obj)
    bpy.context.scene.collection.objects.unlink(obj)
    return other


def with_nodes(obj, make):
    """Give an object geometry nodes. ``make`` returns the socket for the output node."""
    tree = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("G", in_out=direction, socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(make(tree, start.outputs[0]), end.inputs[0])
    obj.modifiers.new("nodes", "NODES").node_group = tree


def blurred(position="CENTER"):
    render = bpy.context.scene.render
    render.use_motion_blur, render.motion_blur_position = True, position


def object_named(name):
    return bpy.data.objects[name]


# Visibility.


def keyed_visibility():
    switched(new_cube(), "hide_render", True, False)


def keyed_visibility_that_the_viewport_never_shows():
    cube = new_cube()
    cube.hide_viewport = True
    switched(cube, "hide_render", True, False)


def visibility_keyed_for_viewport_and_render():
    cube = new_cube()
    switched(cube, "hide_viewport", True, False)
    switched(cube, "hide_render", True, False)


def visibility_driven_by_the_frame():
    driven(new_cube(), "hide_render", "frame < 5")


def visibility_driven_by_an_object():
    cube, control = new_cube(), new_cube("control", location=(0, 0, 0), size=0.1)
    control.hide_render = True
    changing(control, "location", 0, 1, index=2)
    driven(cube, "hide_render", "height < 0.5", ("height", control, "location[2]"))


def visibility_driven_by_the_viewport():
    driven(
        object_named("torus"),
        "hide_render",
        "hidden",
        ("hidden", object_named("cone"), "hide_viewport"),
    )
    changing(object_named("box"), "location", 0.35, 1, index=2)


def visibility_in_an_nla_track():
    cube = new_cube()
    switched(cube, "hide_render", True, False)
    data = cube.animation_data
    data.nla_tracks.new().strips.new("late", 1, data.action)
    data.action = None


def keyed_rays():
    cube = new_cube()
    for kind in RAYS:
        switched(cube, f"visible_{kind}", False, True)


# Collections and instances. Blender keys neither the visibility of a collection nor its exclusion.


def keyed_instancer():
    instancer = empty("instancer", (0, 1, 1))
    cube = new_cube("part", size=0.4, location=(0, 0, 0))
    instancer.instance_type = "COLLECTION"
    instancer.instance_collection = moved_to_collection("parts", cube, exclude=True)
    switched(instancer, "hide_render", True, False)


def keyed_part_of_an_instanced_collection():
    instancer = empty("instancer", (0, 1, 1))
    cube = new_cube("part", size=0.4, location=(0, 0, 0))
    switched(cube, "hide_render", True, False)
    instancer.instance_type = "COLLECTION"
    instancer.instance_collection = moved_to_collection("parts", cube, exclude=True)


def keyed_part_of_a_collection_that_nodes_place():
    cube, other = new_cube(), new_cube("other", location=(0.6, 0.5, 1), size=0.4)
    switched(cube, "hide_render", True, False)
    parts = moved_to_collection("parts", cube, other, exclude=True)

    def place(tree, _):
        node = tree.nodes.new("GeometryNodeCollectionInfo")
        node.inputs["Collection"].default_value = parts
        return node.outputs[0]

    with_nodes(object_named("box"), place)


def keyed_switch_of_nodes():
    cube = new_cube()
    cube.hide_render = True

    def switch(tree, geometry):
        node, other = (tree.nodes.new(f"GeometryNode{kind}") for kind in ("Switch", "ObjectInfo"))
        node.input_type = "GEOMETRY"
        other.inputs["Object"].default_value = cube
        tree.links.new(geometry, node.inputs["False"])
        tree.links.new(other.outputs["Geometry"], node.inputs["True"])
        switched(node.inputs["Switch"], "default_value", False, True)
        return node.outputs[0]

    with_nodes(object_named("cone"), switch)


def particles_from_a_keyed_emitter():
    emitter = add("plane", size=0.2, location=(-1, 1, 1))
    changing(emitter, "location", -1, 1, index=0)
    emitter.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_end, settings.lifetime = 60, 20, 50
    settings.display_percentage = 0
    settings.render_type, settings.particle_size = "OBJECT", 0.3
    grain = new_cube("grain", location=(0, 0, -20))
    grain.data.materials.append(bpy.data.materials["cone"])
    grain.hide_render = True
    settings.instance_object = grain


def keyed_object_of_a_linked_collection():
    hidden, cube = new_cube("hidden", size=0.2), new_cube()
    hidden.hide_render = True
    switched(cube, "hide_render", True, False)
    parts = moved_to_collection("parts", hidden, cube)
    bpy.data.libraries.write(str(FOLDER / "library.blend"), {parts})
    for part in (hidden, cube):
        bpy.data.objects.remove(part)
    bpy.data.collections.remove(parts)
    with bpy.data.libraries.load(str(FOLDER / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["parts"]
    bpy.context.scene.collection.children.link(wanted.collections[0])


# Other properties with keyframes.


def keyed_material():
    inputs = shader("sphere").inputs
    switched(inputs["Alpha"], "default_value", 1, 0.2)
    switched(inputs["Transmission Weight"], "default_value", 0, 0.9)
    glow = shader("torus").inputs
    glow["Emission Color"].default_value = (1, 1, 1, 1)
    switched(glow["Emission Strength"], "default_value", 0, 5)


def keyed_modifier():
    cutter = new_cube("cutter", location=(2, 0.8, 0.6))
    cutter.hide_render = True
    modifier = object_named("sphere").modifiers.new("cut", "BOOLEAN")
    modifier.object = cutter
    switched(modifier, "show_render", False, True)


def keyed_constraint():
    target = new_cube("target", size=0.1)
    target.hide_render = True
    constraint = object_named("cone").constraints.new("COPY_LOCATION")
    constraint.target = target
    switched(constraint, "influence", 0, 1)


def keyed_bone():
    skeleton = bpy.data.armatures.new("skeleton")
    rig = bpy.data.objects.new("rig", skeleton)
    bpy.context.scene.collection.objects.link(rig)
    rig.hide_render = True
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    skeleton.edit_bones.new("bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    cone = object_named("cone")
    cone.vertex_groups.new(name="bone").add(range(len(cone.data.vertices)), 1, "REPLACE")
    cone.modifiers.new("skin", "ARMATURE").object = rig
    changing(rig.pose.bones["bone"], "location", 0, 1, index=1)


def keyed_world():
    bpy.data.objects.remove(object_named("room"))
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    tree = world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs[0])
    switched(background.inputs["Strength"], "default_value", 0, 2)


def keyed_light():
    switched(object_named("lamp").data, "energy", 300, 100)


def keyed_samples():
    scene = bpy.context.scene
    switched(scene.cycles, "samples", 4, 9)
    switched(object_named("lamp").data, "energy", 300, 100)


def keyed_simplification():
    scene = bpy.context.scene
    scene.render.use_simplify = True
    levels = object_named("cone").modifiers.new("levels", "SUBSURF")
    levels.levels, levels.render_levels = 0, 3
    switched(scene.render, "simplify_subdivision_render", 0, 3)


def keyed_number():
    switched(object_named("torus"), "pass_index", 0, 99)
    switched(object_named("lamp").data, "energy", 300, 100)


def keyed_view_layer():
    switched(bpy.context.view_layer, "use", True, False)
    switched(object_named("lamp").data, "energy", 300, 100)


# Motion blur.


def blur_across_a_change_of_visibility():
    blurred()
    bpy.context.scene.render.motion_blur_shutter = 2
    keyed_visibility()
    changing(object_named("cone"), "location", 0, 1, index=2)


def blur_of_a_light_that_changes():
    blurred("START")
    changing(object_named("lamp").data, "energy", 0, 600)


def blur_by_a_target_in_another_scene():
    blurred()
    target = new_cube("target", size=0.1)
    only_in_scene("rig", target)
    object_named("cone").constraints.new("COPY_LOCATION").target = target
    changing(target, "location", 0, 2, index=2)


def blur_by_a_sequence_of_images():
    blurred()
    bpy.context.scene.render.motion_blur_shutter = 2
    for number in range(1, 9):
        image = bpy.data.images.new("height", 4, 4)
        image.pixels = [number / 8] * 64
        image.filepath_raw, image.file_format = str(FOLDER / f"height_{number:04d}.png"), "PNG"
        image.save()
        bpy.data.images.remove(image)
    texture = bpy.data.textures.new("height", "IMAGE")
    texture.image = bpy.data.images.load(str(FOLDER / "height_0001.png"))
    texture.image.source = "SEQUENCE"
    texture.image_user.frame_duration, texture.image_user.use_auto_refresh = 8, True
    object_named("cone").modifiers.new("height", "DISPLACE").texture = texture


def blur_by_velocities():
    blurred()
    velocities = object_named("cone").data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    for entry in velocities.data:
        entry.vector = (10, 0, 0)


def blur_by_velocities_from_nodes():
    blurred()

    def store(tree, geometry):
        node = tree.nodes.new("GeometryNodeStoreNamedAttribute")
        node.data_type = "FLOAT_VECTOR"
        node.inputs["Name"].default_value = "velocity"
        node.inputs["Value"].default_value = (10, 0, 0)
        tree.links.new(geometry, node.inputs[0])
        return node.outputs[0]

    with_nodes(object_named("cone"), store)


# What drivers and background scenes refer to.


def background_that_shows_what_the_scene_excludes():
    cube = new_cube()
    background = bpy.data.scenes.new("background")
    background.collection.objects.link(cube)
    moved_to_collection("off", cube, exclude=True)
    bpy.context.scene.background_set = background
    switched(object_named("lamp").data, "energy", 300, 100)


def driver_that_finds_a_hidden_object_by_the_scene():
    new_cube().hide_render = True
    place = ("place", bpy.context.scene, 'objects["late"].location[1]')
    driven(object_named("cone"), "location", "place * frame / 3", place, index=1)


def driver_that_follows_the_camera():
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    place = ("place", bpy.context.scene, "camera.location[0]")
    driven(object_named("cone"), "location", "place * frame", place, index=2)


def driver_of_what_a_render_has_in_more_detail():
    ball = add("ico_sphere", subdivisions=1, radius=0.8, location=(0, 1.5, 1))
    levels = ball.modifiers.new("levels", "SUBSURF")
    levels.levels, levels.render_levels = 0, 3
    probe = empty("probe", (0.3, 0, 1.4))
    probe.constraints.new("SHRINKWRAP").target = ball
    driver = object_named("cone").driver_add("location", 0).driver
    driver.expression = "place * frame"
    variable = driver.variables.new()
    variable.name, variable.type = "place", "TRANSFORMS"
    variable.targets[0].id = probe
    variable.targets[0].transform_type = "LOC_X"


CASES = [
    keyed_visibility,
    keyed_visibility_that_the_viewport_never_shows,
    visibility_keyed_for_viewport_and_render,
    visibility_driven_by_the_frame,
    visibility_driven_by_an_object,
    visibility_driven_by_the_viewport,
    visibility_in_an_nla_track,
    keyed_rays,
    keyed_instancer,
    keyed_part_of_an_instanced_collection,
    keyed_part_of_a_collection_that_nodes_place,
    keyed_switch_of_nodes,
    particles_from_a_keyed_emitter,
    keyed_object_of_a_linked_collection,
    keyed_material,
    keyed_modifier,
    keyed_constraint,
    keyed_bone,
    keyed_world,
    keyed_light,
    keyed_samples,
    keyed_simplification,
    keyed_number,
    keyed_view_layer,
    blur_across_a_change_of_visibility,
    blur_of_a_light_that_changes,
    blur_by_a_target_in_another_scene,
    blur_by_a_sequence_of_images,
    blur_by_velocities,
    blur_by_velocities_from_nodes,
    background_that_shows_what_the_scene_excludes,
    driver_that_finds_a_hidden_object_by_the_scene,
    driver_that_follows_the_camera,
    driver_of_what_a_render_has_in_more_detail,
]


def main():
    results = {}
    for make in CASES:
        path = FOLDER / f"{make.__name__}.blend"
        blend_file.new_scene()
        room.build({})
        make()
        bpy.context.scene.frame_set(1)
        blend_file.save_scene(path)
        blend_file.open_scene(path)
        scene_inventory = inventory.inventory(FRAMES)
        # Something that is missing changes many pixels, so one sample of few pixels shows it.
        size = {"samples": 1, "height": 20}
        unpruned = [rendered(path, frame=frame, **size) for frame in FRAMES]
        pruned = [rendered(path, scene_inventory, frame, **size) for frame in FRAMES]
        results[make.__name__] = {
            "same": [
                bool(np.array_equal(*pair, equal_nan=True))
                for pair in zip(unpruned, pruned, strict=True)
            ],
            "changes": not np.array_equal(*unpruned, equal_nan=True),
            "pixels": [sha256(view.tobytes()).hexdigest() for view in unpruned],
            "left_out": pruning.left_out(scene_inventory),
            "inventory": scene_inventory,
        }
    (FOLDER / "results.json").write_text(json.dumps(results))


if __name__ == "__main__":
    main()
