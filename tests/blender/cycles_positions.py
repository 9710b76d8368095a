"""Renders Cycles' Position pass for cameras given as JSON on standard input.

Runs in a process of its own, because bpy keeps one global state. Input: a list of
{"name", "resolution", "camera": attributes of Blender's camera}. Output: an .npz file. For each
name it has the unit rays to the points that Cycles hit, in camera coordinates. They are NaN without
a hit. It also has the points' distance from the camera, the Depth pass, and Blender's own
projection matrix.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio


def main(output: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.render.use_persistent_data = True
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(output.with_suffix(".exr"))
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = 0
    scene.cycles.filter_width = 0.01
    scene.view_layers[0].use_pass_position = True
    scene.view_layers[0].use_pass_z = True
    # The camera is off the centre of a closed cube and turned, so that no axis is special.
    bpy.ops.mesh.primitive_cube_add(size=20)
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    camera.location = (1, 2, -1.5)
    camera.rotation_euler = (0.3, 1.1, -0.7)
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    world = np.array(camera.matrix_world)
    results = {}
    for case in json.load(sys.stdin):
        width, height = case["resolution"]
        scene.render.resolution_x, scene.render.resolution_y = width, height
        data.shift_x = data.shift_y = 0
        for key, value in case["camera"].items():
            setattr(data, key, value)
        bpy.ops.render.render(write_still=True)
        passes = read_passes(scene.render.filepath)
        offset = passes["Position"] - world[:3, 3]
        offset[passes["Depth"][..., 0] > 1e9] = np.nan
        distance = np.linalg.norm(offset, axis=-1)
        results[case["name"] + ".rays"] = (offset / distance[..., None]) @ world[:3, :3]
        results[case["name"] + ".distance"] = distance
        results[case["name"] + ".depth"] = passes["Depth"][..., 0]
        results[case["name"] + ".matrix"] = np.array(
            camera.calc_matrix_camera(
                bpy.context.evaluated_depsgraph_get(), x=width, y=height, scale_x=1, scale_y=1
            )
        )
    np.savez(output, **results)


def read_passes(path: str) -> dict[str, np.ndarray]:
    """Return the passes of a multi-part EXR by their last name, in float64."""
    passes: dict[str, np.ndarray] = {}
    file = oiio.ImageInput.open(path)
    part = 0
    while file.seek_subimage(part, 0):
        name = file.spec().channelnames[0].split(".")[-2]
        pixels = file.read_image(part, 0, 0, file.spec().nchannels, "float")
        passes[name] = np.asarray(pixels, np.float64)
        part += 1
    file.close()
    return passes


main(Path(sys.argv[1]))
