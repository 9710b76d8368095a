"""Renders one smooth room from one place through several lenses with Cycles.

Runs in a process of its own, because bpy keeps one global state. Input: JSON on standard input, a
list of {"name", "resolution", "camera": attributes of Blender's camera, "rotation": (3, 3) of the
camera in the world, "seed", "samples"}. Output: an .npz file with the mean colour over each pixel
("<name>.color"), and the distance pass at the pixels' centres ("<name>.depth").
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from lightfield.imaging import images

POSITION = (1, 2, -1.5)
HALF_SIZE = 10


def build() -> None:
    """Fill the scene with a cube whose walls glow in slow waves, so that renders have no noise."""
    bpy.ops.mesh.primitive_cube_add(size=2 * HALF_SIZE)
    material = bpy.data.materials.new("waves")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    emission = nodes.new("ShaderNodeEmission")
    geometry = nodes.new("ShaderNodeNewGeometry")
    sine = nodes.new("ShaderNodeVectorMath")
    sine.operation = "SINE"
    raise_ = nodes.new("ShaderNodeVectorMath")
    raise_.operation = "ADD"
    raise_.inputs[1].default_value = (1.5, 1.5, 1.5)
    links.new(geometry.outputs["Position"], sine.inputs[0])
    links.new(sine.outputs["Vector"], raise_.inputs[0])
    links.new(raise_.outputs["Vector"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], output.inputs["Surface"])
    bpy.context.object.data.materials.append(material)


def main(output: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.render.use_persistent_data = True
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(output.with_suffix(".exr"))
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_layers[0].use_pass_z = True
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    layer = scene.view_layers[0].name
    results = {}
    for case in json.load(sys.stdin):
        scene.render.resolution_x, scene.render.resolution_y = case["resolution"]
        for key, value in case["camera"].items():
            setattr(data, key, value)
        camera.matrix_world = Matrix.Translation(POSITION) @ Matrix(case["rotation"]).to_4x4()
        scene.cycles.seed = case["seed"]
        for kind, samples, width in (("color", case["samples"], 1.0), ("depth", 1, 0.01)):
            scene.cycles.samples, scene.cycles.filter_width = samples, width
            bpy.ops.render.render(write_still=True)
            channels = images.read_image(scene.render.filepath).channels
            names = {"color": "Combined.R", "depth": "Depth.Z"}
            results[f"{case['name']}.{kind}"] = channels[f"{layer}.{names[kind]}"]
    np.savez(output, **results)


main(Path(sys.argv[1]))
