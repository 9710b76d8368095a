"""The Zen garden: the same every time, clear of its rigs, full all round, alive where it should."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from scenes import garden
from scenes.garden.trees import bamboo_culm
from scenes.library.scene import Scene

SCRIPTS = Path(__file__).parent.parent / "scripts"

# Builds a small garden in a process of its own, prints a hash of its geometry and one of a render.
FINGERPRINT = """
import hashlib, sys
from pathlib import Path
import bpy
import numpy as np
from scenes import garden

bpy.ops.wm.read_factory_settings(use_empty=True)
garden.build({"seed": int(sys.argv[1]), "detail": 0.02})
geometry = hashlib.sha256()
for thing in sorted(bpy.data.objects, key=lambda o: o.name):
    geometry.update(thing.name.encode() + np.array(thing.matrix_world).tobytes())
for data in sorted(bpy.data.meshes, key=lambda m: m.name):
    vertices = np.empty(3 * len(data.vertices), dtype=np.float32)
    corners = np.empty(len(data.loops), dtype=np.int32)
    data.vertices.foreach_get("co", vertices)
    data.loops.foreach_get("vertex_index", corners)
    geometry.update(data.name.encode() + vertices.tobytes() + corners.tobytes())

scene = bpy.context.scene
scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
scene.collection.objects.link(scene.camera)
scene.camera.location, scene.camera.rotation_euler = (0, 0, 1), (1.5, 0, 0)
scene.camera.data.type = "PANO"
scene.camera.data.panorama_type = "EQUIRECTANGULAR"
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = 48, 24
scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 2, False, 3
scene.render.threads_mode, scene.render.threads = "FIXED", 1
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.filepath = sys.argv[2]
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(sys.argv[2])
pixels = np.array(image.pixels[:], dtype=np.float32)
print("FINGERPRINT", geometry.hexdigest(), hashlib.sha256(pixels.tobytes()).hexdigest())
"""


def fingerprint(seed: int, image: Path, hash_seed: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", FINGERPRINT, str(seed), str(image)],
        env={**os.environ, "PYTHONPATH": str(SCRIPTS), "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("FINGERPRINT")]
    return lines[0].split()[1:]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_garden_and_pixels(tmp_path):
    first = fingerprint(7, tmp_path / "first.exr", "1")
    again = fingerprint(7, tmp_path / "again.exr", "2")
    assert first == again


@pytest.fixture(scope="module")
def scene():
    """The full garden."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    garden.build({"seed": 1, "detail": 1.0})
    bpy.context.scene.frame_set(1)
    return bpy.context.scene


def evaluated_meshes():
    """(object name, world vertices (n, 3), polygons) of each mesh object as it is rendered."""
    graph = bpy.context.evaluated_depsgraph_get()
    for instance in graph.object_instances:
        if instance.object.type == "MESH":
            yield instance.object.name, instance.object.data, np.array(instance.matrix_world)


def world_vertices(data, matrix):
    vertices = np.empty(3 * len(data.vertices), dtype=np.float32)
    data.vertices.foreach_get("co", vertices)
    return vertices.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.slow
def test_it_has_the_triangles_of_a_full_scene(scene):
    stored = sum(len(m.loops) - 2 * len(m.polygons) for m in bpy.data.meshes)
    assert stored >= 300_000


@pytest.mark.slow
def test_two_seeds_give_two_gardens(scene):
    def heights(seed):
        bamboo = bamboo_culm(Scene(seed, 0.1, {}), 0)
        return hashlib.sha256(bamboo.vertices.tobytes()).hexdigest()

    assert heights(1) != heights(2)


def rig_points():
    """Points on the cuboid of 2 × 2 × 1 m and on the spheres of 1.7 and 0.5 m, 1 m up."""
    line = np.linspace(-1, 1, 11)
    cube = np.array([(x, y, z) for x in line for y in line for z in line])
    cube = cube[np.abs(cube).max(axis=1) == 1] * (1.0, 1.0, 0.5)
    k = np.arange(642) + 0.5
    z, angle = 1 - 2 * k / 642, k * np.pi * (3 - 5**0.5)
    ball = np.stack([*(np.sqrt(1 - z * z) * (np.cos(angle), np.sin(angle))), z], axis=-1)
    return np.concatenate([cube, 0.85 * ball, 0.25 * ball]) + np.array([0, 0, 1])


@pytest.mark.slow
def test_no_camera_of_its_rigs_is_within_5_cm_of_anything(scene):
    vertices, polygons, start = [], [], 0
    for _, data, matrix in evaluated_meshes():
        world = world_vertices(data, matrix)
        if (world.min(0) > 2.0).any() or (world.max(0) < -2.0).any() or world.max(0)[2] < -0.2:
            continue
        faces = [tuple(i + start for i in p.vertices) for p in data.polygons]
        near = np.abs(world - (0, 0, 1)).max(axis=1) < 2.0
        polygons += [f for f in faces if near[[i - start for i in f]].any()]
        vertices.append(world)
        start += len(world)
    tree = BVHTree.FromPolygons(np.concatenate(vertices).tolist(), polygons)
    distances = [tree.find_nearest(Vector(point))[3] for point in rig_points()]
    assert min(distances) > 0.05


def test_the_rigs_are_inside_nothing(scene):
    """Rays from the rig's middle to all its cameras meet nothing on their way."""
    graph = bpy.context.evaluated_depsgraph_get()
    middle = Vector((0, 0, 1))
    for point in rig_points():
        ray = Vector(point) - middle
        assert not scene.ray_cast(graph, middle, ray.normalized(), distance=ray.length)[0]


def test_every_direction_has_something_to_see(scene):
    graph = bpy.context.evaluated_depsgraph_get()
    seen_by_sector = []
    for sector in range(12):
        seen = set()
        for azimuth in np.radians(np.arange(30 * sector, 30 * sector + 30, 3)):
            for height in np.tan(np.radians([-50, -35, -22, -12, -6, -3, 0, 2, 5, 9, 14, 20])):
                ray = Vector((np.cos(azimuth), np.sin(azimuth), height)).normalized()
                hit, _, _, _, thing, _ = scene.ray_cast(graph, Vector((0, 0, 1)), ray)
                assert hit or height > 0.03
                if hit:
                    seen.add(thing.name)
        seen_by_sector.append(len(seen))
    assert min(seen_by_sector) >= 8


def test_only_fire_and_water_move(scene):
    def state(frame):
        scene.frame_set(frame)
        shapes = {}
        for name, data, matrix in evaluated_meshes():
            world = world_vertices(data, matrix)
            shapes[name] = hashlib.sha256(world.tobytes()).hexdigest()
        return shapes

    before, after = state(1), state(3)
    scene.frame_set(1)
    moved = {name for name in before if before[name] != after[name]}
    assert moved == {name for name in before if name.startswith("Flame.")}
    animated = {m.name for m in bpy.data.materials if m.node_tree.animation_data}
    assert animated == {"Water"}


def test_the_ripples_run_on_for_ever(scene):
    tree = bpy.data.materials["Water"].node_tree
    ripples = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeTexNoise")
    phases = []
    for frame in (1, 100, 10_000):
        scene.frame_set(frame)
        phases.append(ripples.inputs["W"].default_value)
    scene.frame_set(1)
    rate = (phases[1] - phases[0]) / 99
    assert rate > 0
    assert phases[2] == pytest.approx(phases[0] + 9_999 * rate, rel=1e-4)


def test_the_blend_needs_nothing_else(scene, tmp_path):
    target = tmp_path / "garden.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(target), copy=True)
    assert target.stat().st_size < 60e6
    images = [i for i in bpy.data.images if i.source == "FILE"]
    assert images and all(i.packed_file for i in images)
    assert not bpy.data.libraries
    owners = [*bpy.data.objects, *bpy.data.meshes, *(m.node_tree for m in bpy.data.materials)]
    assert not any(o.animation_data and o.animation_data.drivers for o in owners)
