"""The barbershop: the same from the same seed, rich, closed, and clear of every camera."""

from pathlib import Path

import bpy
import numpy as np
import pytest
import yaml
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from lightfield.geometry.rigs import from_settings
from scenes import barbershop

ROOT = Path(__file__).resolve().parents[1]
RIGS = yaml.safe_load((ROOT / "configs/scenes/barbershop.yaml").read_text())["rigs"]
CLEARANCE = 0.05  # metres that every camera must have around it
REACH = 0.4  # metres; the nearest furniture is nearer than this to some camera


@pytest.fixture(scope="module")
def scene():
    """The scene at full detail, as an evaluated dependency graph."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    barbershop.build({"seed": 1, "detail": 1.0})
    return bpy.context.evaluated_depsgraph_get()


def counts(scene):
    """Objects and triangles counting instances, and the triangles that are in memory."""
    objects, seen, stored = 0, 0, {}
    for instance in scene.object_instances:
        if instance.object.type == "MESH":
            data = instance.object.data
            if data.name not in stored:
                data.calc_loop_triangles()
                stored[data.name] = len(data.loop_triangles)
            objects += 1
            seen += stored[data.name]
    return objects, seen, sum(stored.values())


def test_objects_triangles_and_instancing(scene):
    objects, seen, stored = counts(scene)
    assert objects >= 500
    assert seen >= 300_000
    assert stored < seen / 2


def test_cameras_keep_clear(scene):
    """No camera of any rig has geometry within 5 cm, by BVHs of the evaluated meshes."""
    cameras = np.concatenate(
        [[pose.position for pose in from_settings(rig).poses()] for rig in RIGS.values()]
    )
    nearest = np.inf
    for instance in scene.object_instances:
        thing, matrix = instance.object, instance.matrix_world
        if thing.type != "MESH":
            continue
        box = np.array([matrix @ Vector(corner) for corner in thing.bound_box])
        inside = (cameras > box.min(0) - REACH) & (cameras < box.max(0) + REACH)
        close = cameras[inside.all(1)]
        if len(close):
            vertices = [matrix @ vertex.co for vertex in thing.data.vertices]
            tree = BVHTree.FromPolygons(vertices, [tuple(f.vertices) for f in thing.data.polygons])
            for camera in close:
                distance = tree.find_nearest(Vector(camera))[3]
                assert distance >= CLEARANCE, (thing.name, camera)
                nearest = min(nearest, distance)
    assert nearest < REACH  # something was measured


def test_closed_and_rich_on_every_side(scene):
    """From the middle every ray meets the room or its window, and many surfaces on each side."""
    met, objects = {}, set()
    for ray in np.random.default_rng(7).normal(size=(3000, 3)):
        hit, place, _, face, thing, _ = bpy.context.scene.ray_cast(
            scene, Vector((0, 0, 1.05)), Vector(ray)
        )
        assert hit, ray
        assert (np.abs(place) <= (2.501, 3.85, 3.001)).all() and place.z > -0.03, (place, thing)
        axis = int(np.abs(ray).argmax())
        surface = thing.name, thing.data.polygons[face].material_index
        met.setdefault((axis, bool(ray[axis] > 0)), set()).add(surface)
        objects.add(thing.name)
    assert len(objects) >= 200
    assert len(met) == 6 and min(len(surfaces) for surfaces in met.values()) >= 12, met


def test_file_is_small_and_self_contained(scene, tmp_path):
    """Less than 60 MB, nothing from outside, no drivers, no camera, a material on every face."""
    assert not [image for image in bpy.data.images if image.source == "FILE"]
    assert not bpy.data.cameras and not bpy.data.libraries
    for thing in bpy.data.objects:
        assert not thing.animation_data
    for data in bpy.data.meshes:
        assert data.users and data.materials and all(data.materials), data.name
        corners = np.empty(3 * len(data.vertices), np.float32)
        slots = np.empty(len(data.polygons), np.int32)
        data.vertices.foreach_get("co", corners)
        data.polygons.foreach_get("material_index", slots)
        assert np.isfinite(corners).all() and slots.max() < len(data.materials), data.name
    path = tmp_path / "barbershop.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    assert path.stat().st_size < 60e6


def test_less_detail_is_less(scene):
    full = counts(scene)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    barbershop.build({"seed": 1, "detail": 0.05})
    small = counts(bpy.context.evaluated_depsgraph_get())
    assert small[0] < 0.8 * full[0] and small[1] < 0.25 * full[1] and small[2] < 0.5 * full[2], (
        small
    )
