"""Renders a scene with a bit of everything, through several lenses, with all passes.

Runs in a process of its own, because bpy keeps one global state. The argument is a folder. For each
lens it writes there a dataset <lens>/, and its receipt receipts/<lens>.jsonl. In
objects.npz, <lens> holds the name of the object that Blender's own ray casts hit behind each pixel
of the first view. "plain" is the perspective without passes, "without_variance" with all other
passes, "denoised" with some passes. "transparent" is the fisheye. matte.exr is the wall's matte,
which Blender's compositor reads from the perspective's Cryptomatte.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
import one_shard
from mathutils import Vector

from lightfield.formats.lightfield import OMNIDIRECTIONAL, LightField
from lightfield.formats.passes import PASSES, VARIANCE
from lightfield.geometry import lenses
from lightfield.rendering.scenes import blend_file

# The wall's places at the frames 1, 2 and 3. Frame 2 is rendered.
WALL = [(-0.1, 2.8, 0), (0, 3, 0), (0.25, 3.1, 0.05)]
SIZE = 32
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [SIZE, SIZE]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [SIZE, SIZE]},
    "panorama": {"lens": "equirectangular", "resolution": [2 * SIZE, SIZE]},
}
RENDER = {
    "samples": 8,
    "adaptive_threshold": 0,
    "denoise": False,
    "seed": 0,
    "max_bounces": 4,
    "depth_precision": "float",
    "passes": list(PASSES),
}


def lightfield(camera, pair=None, **render):
    lens = lenses.from_camera(LENSES[camera])
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.3, "center": [0.2, -0.4, 1.1]}
    rig["rotation"] = [8, -5, 12]
    depth = "z" if lens.has_z_depth else "distance"
    keys = {"depth": depth, "frame": 2, "scene": {"fingerprint": "0"}}
    if pair:
        rig |= {"cameras": [1, 1, 1], **pair}
        keys |= {"depth": None, OMNIDIRECTIONAL: pair["stereo"]["distance"]}
    return LightField.from_rig(rig, lens, **keys, render={**RENDER, **render})


def material(name, **inputs):
    created = bpy.data.materials.new(name)
    created.use_nodes = True
    for key, value in inputs.items():
        created.node_tree.nodes["Principled BSDF"].inputs[
            key.replace("_", " ")
        ].default_value = value
    return created


def add(name, kind, surface, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    obj = bpy.context.object
    obj.name = name
    obj.data.materials.append(surface)
    return obj


def build():
    bpy.context.scene.render.views["right"].name = "the artist's own name"
    upright = (np.pi / 2, 0, 0)
    add("floor", "plane", material("grey"), size=40)
    wall = add("wall", "plane", material("red", Base_Color=(0.8, 0.1, 0.1, 1)), size=40)
    wall.rotation_euler = upright
    for frame, place in enumerate(WALL, 1):
        wall.location = place
        wall.keyframe_insert("location", frame=frame)
    glass = material("glass", Transmission_Weight=1.0, Roughness=0.0)
    add("ball", "uv_sphere", glass, radius=0.5, location=(-0.8, 1.5, 0.8))
    add("metal", "cube", material("metal", Metallic=1.0), size=0.8, location=(1, 1.6, 0.4))
    glowing = material("glow", Emission_Strength=2.0, Emission_Color=(1, 0.5, 0.2, 1))
    glow = add("glow", "cube", glowing, size=0.3, location=(0.2, 1.4, 1.6))
    twin = bpy.data.objects.new("twin", glow.data)
    twin.location = (1.2, 1.4, 1.9)
    bpy.context.collection.objects.link(twin)
    hidden = add("a hidden one", "cube", material("b"), size=1)
    hidden.hide_render = hidden.hide_viewport = True
    fog = material("fog")
    nodes, links = fog.node_tree.nodes, fog.node_tree.links
    scatter = nodes.new("ShaderNodeVolumeScatter")
    links.new(scatter.outputs[0], nodes["Material Output"].inputs["Volume"])
    nodes.remove(nodes["Principled BSDF"])
    add("fog", "cube", fog, size=0.6, location=(-0.1, 1, 0.7))
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.5, 0.9, 1)
    bpy.context.scene.world = world
    bpy.ops.object.light_add(type="POINT", location=(0, 0, 3))
    bpy.context.object.data.energy = 200


def cast(content, number=0, aside=0.0):
    """Return the name of the object behind each pixel (h, w) of a view.

    Rays start ``aside`` metres beside the camera, to the right of their own direction.
    """
    view, scene = content.views[number], bpy.context.scene
    rays = content.lens.pixel_rays()
    level = np.linalg.norm(rays[..., ::2], axis=-1, keepdims=True)
    right = np.stack([-rays[..., 2], 0 * rays[..., 0], rays[..., 0]], axis=-1) / level
    starts = view.position + aside * right @ view.world_from_camera[:3, :3].T
    rays = rays @ view.world_from_camera[:3, :3].T
    depsgraph = bpy.context.evaluated_depsgraph_get()
    names = np.full(rays.shape[:2], "", dtype="U8")
    for pixel in zip(*np.nonzero(np.isfinite(rays[..., 0])), strict=True):
        origin, direction, name = Vector(starts[pixel]), Vector(rays[pixel]), "fog"
        while name == "fog":
            hit, origin, _, _, obj, _ = scene.ray_cast(depsgraph, origin, direction)
            origin = origin + 1e-4 * direction
            name = obj.name if hit else ""
        names[pixel] = name
    return names


def build_instances():
    """Add balls that collections and geometry nodes repeat, each behind a transparent card."""
    paint = material("paint")
    invisible = material("invisible", Alpha=0.0)
    ball = add("ball", "uv_sphere", paint, radius=0.3, location=(0, 3, 0.6))
    # This surface has no material.
    bare = add("bare", "uv_sphere", paint, radius=0.3, location=(-1, 3, 1.6))
    bare.data.materials.clear()
    card = add("card", "plane", invisible, size=1.2, location=(0, 2, 0.6), rotation=(1.5, 0, 0))
    group = bpy.data.collections.new("group")
    for obj in (ball, card):
        group.objects.link(obj)
        bpy.context.scene.collection.objects.unlink(obj)
    for number, place in enumerate([(-1.2, 0, 0), (0, 0.5, 0.2), (1.2, 0, 0)]):
        empty = bpy.data.objects.new(f"place {number}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        empty.location = place
        bpy.context.scene.collection.objects.link(empty)
    tree = bpy.data.node_groups.new("row", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    line = tree.nodes.new("GeometryNodeMeshLine")
    line.inputs["Count"].default_value, line.inputs["Offset"].default_value = 3, (0.7, 0, 0)
    object_info = tree.nodes.new("GeometryNodeObjectInfo")
    object_info.inputs["Object"].default_value, object_info.inputs["As Instance"].default_value = (
        ball,
        True,
    )
    instances = tree.nodes.new("GeometryNodeInstanceOnPoints")
    tree.links.new(line.outputs[0], instances.inputs["Points"])
    tree.links.new(object_info.outputs["Geometry"], instances.inputs["Instance"])
    tree.links.new(instances.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    row = bpy.data.objects.new("row", bpy.data.meshes.new("row"))
    row.location = (-0.5, 3.5, 1.8)
    row.modifiers.new("row", "NODES").node_group = tree
    bpy.context.scene.collection.objects.link(row)
    rough = material("rough")
    nodes, link = rough.node_tree.nodes, rough.node_tree.links.new
    bump = nodes.new("ShaderNodeBump")
    link(nodes.new("ShaderNodeTexNoise").outputs[0], bump.inputs["Height"])
    link(bump.outputs[0], nodes["Principled BSDF"].inputs["Normal"])
    add("floor", "plane", rough, size=40)


def cast_instances(content):
    """Return the name of the instance behind each pixel (h, w) of the first view.

    Instances are told apart by their places.
    """
    view, depsgraph = content.views[0], bpy.context.evaluated_depsgraph_get()
    names = {}
    for entry in depsgraph.object_instances:
        name = entry.object.name
        if entry.is_instance:
            places = " ".join(str(place) for place in entry.persistent_id if place < 2**31 - 1)
            name = f"{entry.parent.name} > {name} {places}"
        names[entry.object.name, tuple(np.round(entry.matrix_world.translation, 3).tolist())] = name
    rays = content.lens.pixel_rays() @ view.world_from_camera[:3, :3].T
    names_of_pixels = np.full(rays.shape[:2], "", dtype="U24")
    for pixel in zip(*np.nonzero(np.isfinite(rays[..., 0])), strict=True):
        origin, direction, obj = Vector(view.position), Vector(rays[pixel]), None
        while obj is None or obj.name == "card":
            hit, origin, _, _, obj, matrix = bpy.context.scene.ray_cast(
                depsgraph, origin, direction
            )
            if not hit:
                names_of_pixels[pixel] = ""
                break
            origin = origin + 1e-4 * direction
            place = tuple(np.round(matrix.translation, 3).tolist())
            names_of_pixels[pixel] = names[obj.name, place]
    return names_of_pixels


def read_matte(path, name, target):
    """Read a file with Blender's own Cryptomatte node, and write the matte of an object."""
    blend_file.new_scene()
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    tree = bpy.data.node_groups.new("matte", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    reader = tree.nodes.new("CompositorNodeCryptomatteV2")
    reader.source, reader.image, reader.matte_id = "IMAGE", bpy.data.images.load(str(path)), name
    tree.links.new(reader.outputs["Matte"], tree.nodes.new("NodeGroupOutput").inputs[0])
    scene.compositing_node_group = tree
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(target)
    bpy.ops.render.render(write_still=True)


def main(folder: Path) -> None:
    blend = folder / "everything.blend"
    blend_file.new_scene()
    build()
    blend_file.save_scene(blend)

    def render(name, content, views=":"):
        receipt = folder / f"receipts/{name}.jsonl"
        one_shard.render(content, folder / name, blend, views=views, receipt=receipt)

    objects = {}
    for name in LENSES:
        render(name, lightfield(name))
        objects[name] = cast(lightfield(name))
    pair = {"stereo": {"distance": 0.4, "omnidirectional": True}, "center": [0.2, -0.4, 1.1]}
    render("eyes", lightfield("panorama", pair, depth="none", passes=["object"]))
    for number, side in enumerate((-0.2, 0.2)):
        objects[f"eye {number}"] = cast(lightfield("panorama", pair), number, side)
    np.savez(folder / "objects.npz", **objects)
    render("transparent", lightfield("fisheye", transparent=True), "0:1")
    names = ["normal", "object", "material", "cryptomatte"]
    render("denoised", lightfield("perspective", passes=names, denoise=True))
    bare = lightfield("perspective")
    settings = {key: value for key, value in RENDER.items() if key != "passes"}
    render("plain", bare.changed(render=settings), "0:1")
    # The variance changes last digits of the colour.
    names = [name for name in PASSES if name != VARIANCE]
    render("without_variance", lightfield("perspective", passes=names), "0:1")
    # Rendering again must replace a missing file of a view, and a missing list of names.
    files = ["normal/view_0001f.exr", "object/names.json"]
    first_bytes = {file: (folder / "perspective" / file).read_bytes() for file in files}
    for file in files:
        (folder / "perspective" / file).unlink()
    render("perspective", lightfield("perspective"))
    same = {
        file: (folder / "perspective" / file).read_bytes() == first_bytes[file] for file in files
    }
    (folder / "again.json").write_text(json.dumps(same))
    blend_file.new_scene()
    build_instances()
    blend = folder / "instances.blend"
    blend_file.save_scene(blend)
    for name in ("fisheye", "perspective"):
        content = lightfield(name, passes=["normal", "object", "instance"])
        render(f"instances_{name}", content)
        np.save(folder / f"instances_{name}.npy", cast_instances(content))
    bare = content.changed(render=content.render.without_passes.to_json())
    render("instances_plain", bare, "0:1")
    read_matte(folder / "perspective/cryptomatte/view_0000f.exr", "wall", folder / "matte.exr")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
