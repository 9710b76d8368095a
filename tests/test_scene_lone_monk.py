"""The cloister: the same from the same seed, rich enough, and clear of every camera."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from lightfield.geometry.rigs import from_settings
from scenes import lone_monk

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
CLEARANCE = 0.05  # metres that every camera must have around it
REACH = 0.25  # metres; geometry farther than this from every camera is not looked at

RIGS = {
    "LFCuboid_4mx4mx3m": {
        "type": "cuboid",
        "cameras": [21, 21, 16],
        "size": [4, 4, 3],
        "center": [0, 0, 2.2],
    },
    "LFSphere_e220cm_d400cm": {
        "type": "sphere",
        "subdivisions": 4,
        "size": 4.0,
        "center": [0, 0, 2.2],
    },
    "LFSphere_e160cm_d220cm": {
        "type": "sphere",
        "subdivisions": 2,
        "size": 2.2,
        "center": [0, 0, 1.6],
    },
}


@pytest.fixture(scope="module")
def scene():
    """The scene at full detail, as an evaluated dependency graph."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    lone_monk.build({"seed": 1, "detail": 1.0})
    return bpy.context.evaluated_depsgraph_get()


def test_triangles_and_instancing(scene):
    """At least 300,000 triangles in view, made of few meshes that are placed again and again."""
    triangles = {}
    total = 0
    for instance in scene.object_instances:
        if instance.object.type == "MESH":
            data = instance.object.data
            if data.name not in triangles:
                data.calc_loop_triangles()
                triangles[data.name] = len(data.loop_triangles)
            total += triangles[data.name]
    assert total >= 300_000
    assert sum(triangles.values()) < total / 3


def test_cameras_keep_clear(scene):
    """No camera of any rig has geometry within 5 cm, by BVHs of the evaluated meshes."""
    cameras = np.concatenate(
        [[p.position for p in from_settings(rig).poses()] for rig in RIGS.values()]
    )
    nearest = REACH
    for instance in scene.object_instances:
        thing = instance.object
        if thing.type != "MESH":
            continue
        matrix = instance.matrix_world
        box = np.array([matrix @ Vector(corner) for corner in thing.bound_box])
        low, high = box.min(0) - REACH, box.max(0) + REACH
        close = cameras[((cameras > low) & (cameras < high)).all(1)]
        if not len(close):
            continue
        vertices = [matrix @ vertex.co for vertex in thing.data.vertices]
        faces = [tuple(face.vertices) for face in thing.data.polygons]
        tree = BVHTree.FromPolygons(vertices, faces)
        for camera in close:
            distance = tree.find_nearest(Vector(camera), REACH)[3]
            if distance is not None:
                assert distance >= CLEARANCE, (thing.name, camera)
                nearest = min(nearest, distance)
    assert nearest < REACH  # the lowest cameras are 20 cm above the lawn


def test_no_direction_is_bare(scene):
    """Seen from the rig's middle: masonry all round, ground below, and sky above the roofs."""
    middle = Vector((0, 0, 2.2))

    def distance(azimuth, elevation):
        ring = np.cos(elevation)
        ray = (ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(elevation))
        hit, place, *_ = bpy.context.scene.ray_cast(scene, middle, Vector(ray))
        return (place - middle).length if hit else np.inf

    for azimuth in np.linspace(0, 2 * np.pi, 72, endpoint=False):
        for elevation in np.radians([-85, -60, -35, -15, -5, 0, 5, 8]):
            assert distance(azimuth, elevation) < 20, (azimuth, elevation)
        assert distance(azimuth, np.radians(60)) > 5
    assert np.isinf(distance(0, np.radians(80)))


def test_file_is_self_contained(scene):
    """Nothing from outside, no drivers, no camera, and a material on every mesh that is used."""
    assert not [image for image in bpy.data.images if image.source == "FILE"]
    assert not bpy.data.cameras and not bpy.data.libraries
    for thing in bpy.data.objects:
        assert not thing.animation_data or not thing.animation_data.drivers
        if thing.type == "MESH":
            assert thing.data.materials and all(thing.data.materials), thing.name
            corners = np.empty(len(thing.data.vertices) * 3, np.float32)
            thing.data.vertices.foreach_get("co", corners)
            assert np.isfinite(corners).all(), thing.name
            used = np.empty(len(thing.data.polygons), np.int32)
            thing.data.polygons.foreach_get("material_index", used)
            assert used.max() < len(thing.data.materials), thing.name
