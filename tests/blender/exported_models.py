"""Exports a model with Blender to six formats, imports each again, and renders it.

Runs in a process of its own, because bpy keeps one global state. The argument is a folder. It gets
the models. It also gets the records of all imports by name in records.json, and pictures
(32, 32, 4) by name in pictures.npz. The model is a slab with a cone on its right end, textured red,
2 × 1 × 3 m in size.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.rendering.imports import model
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.scenes.quiet import quiet
from lightfield.rendering.setup import cycles
from lightfield.stages.scene import ImportSettings
from scenes.library.scene import Scene
from scenes.library.shapes import box, transform

RED = (0.9, 0.1, 0.05, 1)
FILES = ("shape.fbx", "shape.glb", "shape.gltf", "shape.obj", "shape.ply", "shape.stl")
FILES += ("shape.usda", "shape.usdc", "shape.usdz")
# Imports of which the tests need only the record.
NOT_SHOWN = ("metres", "turned", "city", "first frame", "glowing.fbx", "glowing.glb")
NOT_SHOWN += ("glowing.obj",)


def textured(path):
    """Make the material "red" of a texture, which is written to ``path``."""
    image = bpy.data.images.new("red", 4, 4)
    image.pixels = RED * 16
    image.filepath_raw = str(path)
    image.file_format = "PNG"
    image.save()
    material = bpy.data.materials.new("red")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(path))
    colour = nodes["Principled BSDF"].inputs["Base Color"]
    material.node_tree.links.new(texture.outputs["Color"], colour)


def build(folder):
    """Fill the empty scene with the model, a lamp and a camera."""
    blend_file.new_scene()
    textured(folder / "red.png")
    scene = Scene(0, 1.0)
    cone = scene.lathe([(0.5, 0), (0, 2.5)], 24)
    parts = [("slab", box((2, 1, 0.5)), (0, 0, 0.25)), ("cone", cone, (0.5, 0, 0.5))]
    for name, shape, place in parts:
        obj = scene.add(name, shape, "red", matrix=transform(place), smooth=False)
        obj.data.uv_layers.new(name="UVMap")
    for name, data in (
        ("lamp", bpy.data.lights.new("lamp", "POINT")),
        ("camera", bpy.data.cameras.new("camera")),
    ):
        obj = bpy.data.objects.new(name, data)
        obj.location = (50, 0, 50)
        bpy.context.scene.collection.objects.link(obj)


def export(folder):
    paths = {file: str(folder / file) for file in FILES}
    bpy.ops.export_scene.fbx(filepath=paths["shape.fbx"], path_mode="RELATIVE")
    bpy.ops.export_scene.gltf(filepath=paths["shape.glb"], export_lights=True, export_cameras=True)
    bpy.ops.export_scene.gltf(filepath=paths["shape.gltf"], export_format="GLTF_SEPARATE")
    bpy.ops.wm.obj_export(filepath=paths["shape.obj"], path_mode="RELATIVE")
    bpy.ops.wm.ply_export(filepath=paths["shape.ply"])
    bpy.ops.wm.stl_export(filepath=paths["shape.stl"])
    for file in FILES[-3:]:
        bpy.ops.wm.usd_export(filepath=paths[file])


def export_others(folder):
    """Export the model with a red that glows. Then with a moving cone, and a mirrored slab."""
    shader = bpy.data.materials["red"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Emission Color"].default_value = RED
    shader.inputs["Emission Strength"].default_value = 1
    bpy.ops.export_scene.fbx(filepath=str(folder / "glowing.fbx"))
    bpy.ops.export_scene.gltf(filepath=str(folder / "glowing.glb"))
    bpy.ops.wm.obj_export(filepath=str(folder / "glowing.obj"))
    shader.inputs["Emission Strength"].default_value = 0
    cone = bpy.data.objects["cone"]
    cone.keyframe_insert("location", index=0, frame=1)
    cone.location.x -= 4
    cone.keyframe_insert("location", index=0, frame=11)
    bpy.data.objects["slab"].scale = (-1, 1, 1)
    bpy.context.scene.frame_end = 11
    bpy.ops.export_scene.fbx(filepath=str(folder / "moving.fbx"))
    bpy.ops.export_scene.gltf(filepath=str(folder / "moving.glb"))
    bpy.ops.wm.usd_export(filepath=str(folder / "moving.usdc"), export_animation=True)


def picture(elevation):
    """Render the open scene from the front, from −Y. Returns the pixels (32, 32, 4)."""
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("front")
    camera.type = "ORTHO"
    camera.ortho_scale = 1.25
    scene.camera = bpy.data.objects.new("front", camera)
    scene.collection.objects.link(scene.camera)
    angle = np.radians(elevation)
    scene.camera.location = (0, -3 * np.cos(angle), 3 * np.sin(angle))
    scene.camera.rotation_euler = (np.pi / 2 - angle, 0, 0)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 8
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(Path(bpy.app.tempdir) / "picture.exr")
    with quiet():
        bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    pixels = np.array(image.pixels[:]).reshape(32, 32, 4)[::-1]
    bpy.data.images.remove(image)
    return pixels


def main():
    folder = Path(sys.argv[1])
    build(folder)
    export(folder)
    export_others(folder)
    records, pictures = {}, {}
    imports = [(file, {"model": str(folder / file)}) for file in FILES]
    moving = {"model": str(folder / "moving.glb")}
    imports += [
        ("metres", {"model": str(folder / "shape.glb"), "unit": "metres"}),
        ("turned", {"model": str(folder / "shape.ply"), "up": "y"}),
        ("from above", {"model": str(folder / "shape.glb")}),
        ("from above, with ground", {"model": str(folder / "shape.glb"), "ground": True}),
        ("city", {"model": str(folder / "shape.glb"), "light": "city"}),
        ("first frame", moving),
        ("last frame", moving | {"frame": 11}),
        ("moving.fbx", {"model": str(folder / "moving.fbx"), "frame": 11}),
        ("moving.usdc", {"model": str(folder / "moving.usdc"), "frame": 11}),
        ("glowing.fbx", {"model": str(folder / "glowing.fbx")}),
        ("glowing.glb", {"model": str(folder / "glowing.glb")}),
        ("glowing.obj", {"model": str(folder / "glowing.obj")}),
    ]
    for name, content in imports:
        record = model.make_scene(ImportSettings(**content), folder)
        # As the other programs do, read the scene from its file.
        blend_file.save_scene(folder / "scene.blend")
        blend_file.open_scene(folder / "scene.blend")
        bpy.context.scene.frame_set(content.get("frame", 1))
        record["kinds"] = sorted({obj.type for obj in bpy.data.objects})
        record["sampling"] = cycles.sampling()
        record["packed"] = all(
            image.packed_file and str(folder) not in image.filepath
            for image in bpy.data.images
            if image.source == "FILE"
        )
        records[name] = record
        if name not in NOT_SHOWN:
            pictures[name] = picture(30 if name.startswith("from above") else 0)
    (folder / "records.json").write_text(json.dumps(records))
    np.savez(folder / "pictures.npz", **pictures)


main()
