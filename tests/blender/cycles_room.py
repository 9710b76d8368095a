"""Renders the views of a lightfield.json (Z-depth, fisheye) with Cycles.

Runs in a process of its own, because bpy keeps one global state. The scene is hard to look through:
hundreds of thin stalks and leaves, a fence, spheres, and a wall, on a ground under open sky.
"""

import json
import random
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
from lightfield.imaging import images


def build() -> None:
    draw = random.Random(3)
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, ...]] = []
    for _ in range(400):
        x, y = draw.uniform(-5, 5), draw.uniform(-5, 5)
        if x * x + y * y < 2:
            continue
        width, lean, height = (
            draw.uniform(0.005, 0.03),
            draw.uniform(-0.4, 0.4),
            draw.uniform(0.3, 2),
        )
        first = len(vertices)
        vertices += [(x, y, 0), (x + width, y, 0), (x + width + lean, y + lean, height)]
        vertices += [(x + lean, y + lean, height), (x + lean - 0.1, y + lean + 0.1, height + 0.1)]
        faces += [tuple(range(first, first + 4)), (first + 2, first + 3, first + 4)]
    grass = bpy.data.meshes.new("grass")
    grass.from_pydata(vertices, [], faces)
    bpy.context.collection.objects.link(bpy.data.objects.new("grass", grass))
    bpy.ops.mesh.primitive_plane_add(size=40)
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 4, 1), scale=(6, 0.2, 2))
    for post in range(9):
        bpy.ops.mesh.primitive_cylinder_add(radius=0.04, depth=2, location=(3, post - 4, 1))
    for x, y, z, radius in (
        (-2, 1, 0.6, 0.6),
        (1.5, -2, 1, 0.5),
        (-1.5, -2.5, 2.5, 0.7),
        (0, 2.5, 0.3, 0.5),
        (-0.5, -2, -0.1, 0.6),
        (1.8, 0.4, 0.2, 0.4),
    ):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=(x, y, z))


def main(dataset: Path) -> None:
    content = json.loads((dataset / "lightfield.json").read_text())
    width, height = content["resolution"]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("sky")
    scene.world.color = (0.4, 0.5, 0.7)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0.4, 0))
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.render.use_persistent_data = True
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(dataset.parent / "passes.exr")
    scene.cycles.samples = 4
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = 1
    scene.view_layers[0].use_pass_z = True
    data = bpy.data.cameras.new("camera")
    data.type = "PANO"
    data.panorama_type = "FISHEYE_EQUIDISTANT"
    data.fisheye_fov = content["camera"]["fisheye_fov"]
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera

    # In an equidistant fisheye of 180 degrees, θ grows to 90 degrees at the image's edge.
    y, x = np.mgrid[:height, :width] + 0.5
    angle = np.hypot(x - width / 2, y - height / 2) / (width / 2) * np.pi / 2
    cosine = np.where(angle <= np.pi / 2, np.cos(angle), np.nan)
    for number, frame in enumerate(content["frames"]):
        camera.matrix_world = Matrix(frame["world_matrix"])
        scene.cycles.seed = number
        bpy.ops.render.render(write_still=True)
        passes = images.read_image(scene.render.filepath).channels
        distance = next(pixels for name, pixels in passes.items() if name.endswith("Depth.Z"))
        z = np.where((distance >= 1e10) | np.isnan(cosine), np.inf, distance * cosine)
        channels = {
            channel: next(
                pixels for name, pixels in passes.items() if name.endswith(f"ed.{channel}")
            )
            .clip(0, 60000)
            .astype(np.float16)
            for channel in "RGB"
        }
        channels["Z"] = z.astype(np.float32)
        images.write_exr(dataset / "exr" / f"{frame['name']}.exr", channels)
    Path(scene.render.filepath).unlink()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
