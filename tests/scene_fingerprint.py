"""Prints the SHA-256 of everything that builders make, and on request that of a small render.

Run as `python scene_fingerprint.py SCENES`. SCENES is JSON: [builder, seed, with_pixels] of each
scene. One process builds all scenes, because a start of Blender takes long.
"""

import hashlib
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]


def fingerprints(scenes, hash_seed):
    """Build scenes in a new process, which hashes sets and dictionaries with ``hash_seed``.

    Each scene is (builder, seed, whether to render it). Return the fingerprints in the same order.
    """
    result = subprocess.run(
        [sys.executable, __file__, json.dumps(scenes)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT / "scripts"), "PYTHONHASHSEED": hash_seed},
    )
    lines = result.stdout.splitlines()
    return [line.split()[1:] for line in lines if line.startswith("fingerprint ")]


def rendered():
    """Return the pixels of a panorama from 1 m above the origin."""
    import bpy
    import numpy as np

    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 1), (1.5, 0, 0)
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 48, 24
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 2, False, 3
    # By this map Cycles sends rays to the bright parts of the sky. By default it is large.
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", 128
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.image_settings.file_format = "OPEN_EXR"
    with TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/image.exr"
        bpy.ops.render.render(write_still=True)
        return np.array(bpy.data.images.load(scene.render.filepath).pixels[:], np.float32).tobytes()


def print_fingerprint(builder, seed, with_pixels):
    """Build a scene in place of the last one, and print its fingerprint."""
    import bpy
    import numpy as np

    def values(collection, name, size, kind):
        array = np.empty(size * len(collection), kind)
        collection.foreach_get(name, array)
        return array.tobytes()

    bpy.ops.wm.read_factory_settings(use_empty=True)
    importlib.import_module(f"scenes.{builder}").build({"seed": seed, "detail": 0.05})
    digest = hashlib.sha256()
    for obj in sorted(bpy.data.objects, key=lambda each: each.name):
        digest.update(obj.name.encode() + np.array(obj.matrix_world).tobytes())
        if obj.type == "MESH":
            digest.update(values(obj.data.vertices, "co", 3, np.float32))
            digest.update(values(obj.data.loops, "vertex_index", 1, np.int32))
            digest.update(values(obj.data.polygons, "material_index", 1, np.int32))
        elif obj.type == "CURVES":
            digest.update(values(obj.data.points, "position", 3, np.float32))
    digests = [digest.hexdigest()]
    if with_pixels:
        digests.append(hashlib.sha256(rendered()).hexdigest())
    print("fingerprint", *digests)


def main():
    for builder, seed, with_pixels in json.loads(sys.argv[1]):
        print_fingerprint(builder, seed, with_pixels)


if __name__ == "__main__":
    main()
