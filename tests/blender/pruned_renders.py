"""Makes scenes with and without features that matter to pruning, and renders each both ways.

Run by test_inventory.py in a process of its own, because bpy has one scene at a time:
pruned_renders.py FOLDER writes FOLDER/results.json.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.rendering.inspection import inventory
from lightfield.rendering.scenes import animation, blend_file
from lightfield.rendering.setup import cycles, pruning
from lightfield.rendering.views.colour_pass import render_colour
from lightfield.rendering.views.geometry_pass import render_geometry
from scenes import room

RENDER = {"adaptive_threshold": 0, "denoise": False, "seed": 0}
FRAME = 7
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def add(kind, name=None, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    bpy.context.object.name = name or kind
    return bpy.context.object


def keyed(owner, path, values, index=-1):
    for frame, value in zip((1, 20), values, strict=True):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, index=index, frame=frame)


def shader(name, material_name="Principled BSDF"):
    return bpy.data.materials[name].node_tree.nodes[material_name]


def meet_only(obj, *kinds):
    """Make an object visible to these kinds of rays only."""
    for kind in RAYS:
        setattr(obj, f"visible_{kind}", kind in kinds)


def plain():
    """Nothing to leave out."""


def left_behind():
    """Leftovers of artists: hidden objects, motion blur, passes, materials of no object."""
    scene = bpy.context.scene
    scene.render.use_motion_blur = True
    layer = scene.view_layers[0]
    layer.use_pass_normal = layer.use_pass_cryptomatte_object = True
    layer.aovs.add().name = "own"
    add("uv_sphere", location=(0, 2, 1), segments=256, ring_count=128).hide_render = True
    bpy.context.object.name = "hidden"
    bpy.data.objects["hidden"].data.materials.append(bpy.data.materials.new("only hidden"))
    for name, hide in (("excluded", False), ("off", True)):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        obj = add("cube", location=(1, 2, 1))
        obj.name = f"in {name}"
        collection.objects.link(obj)
        scene.collection.objects.unlink(obj)
        collection.hide_render = hide
    layer.layer_collection.children["excluded"].exclude = True
    unseen = add("cube", location=(0, -2, 1), size=0.5)
    unseen.name = "unseen"
    meet_only(unseen)
    # Only the shadow, the reflection or the scattered light of these shows in the picture.
    for number, kind in enumerate(RAYS):
        obj = add("cube", location=(number - 2, -1, 1), size=0.3)
        obj.name = f"only {kind}"
        meet_only(obj, kind)
    # These are hidden, but needed all the same.
    cutter = add("cube", size=0.8, location=(2, 0.8, 0.6))
    cutter.name = "cutter"
    cutter.hide_render = True
    modifier = bpy.data.objects["sphere"].modifiers.new("cut", "BOOLEAN")
    modifier.object = cutter
    instanced = bpy.data.collections.new("instanced")
    scene.collection.children.link(instanced)
    obj = add("cube", size=0.3, location=(0, 1, 0))
    obj.name = "instanced"
    instanced.objects.link(obj)
    scene.collection.objects.unlink(obj)
    layer.layer_collection.children["instanced"].exclude = True
    empty = bpy.data.objects.new("instancer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", instanced
    empty.location = (0.5, 1, 1)
    scene.collection.objects.link(empty)


def animated():
    """An object, a material and a shape change with time. A driver moves another object."""
    keyed(bpy.data.objects["cone"], "location", (0.0, 1.5), 2)
    keyed(shader("sphere").inputs["Roughness"], "default_value", (0.1, 0.9))
    box = bpy.data.objects["box"]
    box.shape_key_add(name="Basis")
    key = box.shape_key_add(name="taller")
    for point in key.data:
        point.co.z *= 2
    keyed(key, "value", (0.0, 1.0))
    driver = bpy.data.objects["pillar"].driver_add("location", 0).driver
    driver.expression = "-2 + frame / 10"
    # This is rendered, although the artist has hidden it in the viewport.
    torus = bpy.data.objects["torus"]
    keyed(torus, "location", (1.0, 2.5), 2)
    torus.hide_viewport = True


def blurred():
    """Something moves while the shutter is open."""
    keyed(bpy.data.objects["cone"], "location", (0.0, 4.0), 2)
    bpy.context.scene.render.use_motion_blur = True


def features():
    """Every kind of light transport that the inventory tells apart."""
    shader("sphere").inputs["Transmission Weight"].default_value = 1
    shader("cone").inputs["Subsurface Weight"].default_value = 0.5
    shader("box").inputs["Alpha"].default_value = 0.5
    torus = bpy.data.materials["torus"].node_tree
    volume = torus.nodes.new("ShaderNodeVolumePrincipled")
    torus.links.new(volume.outputs[0], torus.nodes["Material Output"].inputs["Volume"])
    pillar = bpy.data.materials["pillar"].node_tree
    height = pillar.nodes.new("ShaderNodeDisplacement")
    pillar.links.new(height.outputs[0], pillar.nodes["Material Output"].inputs["Displacement"])
    walls = bpy.data.materials["walls"].node_tree
    group = bpy.data.node_groups.new("glow", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    end = group.nodes.new("NodeGroupOutput")
    group.links.new(group.nodes.new("ShaderNodeEmission").outputs[0], end.inputs[0])
    node = walls.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    mix = walls.nodes.new("ShaderNodeMixShader")
    walls.links.new(node.outputs[0], mix.inputs[1])
    walls.links.new(mix.outputs[0], walls.nodes["Material Output"].inputs["Surface"])


def rendered(path, scene_inventory=None, frame=FRAME, seeds=((0, 1), (1, 1)), samples=4, height=32):
    """Return colours and depths of a scene's views. Prunes the scene if its inventory is given.

    ``seeds`` are the rendered views: the number of a camera, and the noise's seed. ``height`` is
    in pixels.
    """
    render = RENDER | {"samples": samples}
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [2 * height, height]})
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.4, "center": [0.2, 0.1, 1.4]}
    lightfield = LightField.from_rig(rig, lens, depth="distance", frame=frame, render=render)
    if scene_inventory:
        scene_inventory = scene_inventory | {"left_out": pruning.left_out(scene_inventory)}
    opened = cycles.set_up(path, scene_inventory, lightfield, "cpu", 1)
    poses = [(lightfield.views[number].world_from_camera, seed) for number, seed in seeds]
    views = [
        (render_colour(opened, pose, seed), render_geometry(opened, pose)) for pose, seed in poses
    ]
    return np.stack([np.dstack([colour.pixels, geometry.depth]) for colour, geometry in views])


def main():
    folder = Path(sys.argv[1])
    results = {}
    for make in (plain, left_behind, animated, blurred, features):
        path = folder / f"{make.__name__}.blend"
        blend_file.new_scene()
        room.build({})
        make()
        blend_file.save_scene(path)
        blend_file.open_scene(path)
        scene_inventory = inventory.inventory([FRAME])
        # The last view repeats the first pose, and so shows changes that earlier views left behind.
        seeds = ((0, 1), (1, 1), (0, 2))
        unpruned = rendered(path, seeds=seeds)
        pruned = rendered(path, scene_inventory, seeds=seeds)
        results[make.__name__] = {
            "inventory": scene_inventory,
            "left_out": pruning.left_out(scene_inventory),
            "same": bool(np.array_equal(unpruned, pruned, equal_nan=True)),
            "objects": len(bpy.data.objects),
            "materials": [material.name for material in bpy.data.materials],
            "animated": [owner.name for owner, _ in animation.animated()],
        }
    (folder / "results.json").write_text(json.dumps(results))


if __name__ == "__main__":
    main()
