"""The still life: the same from the same seed, whole, clear of every camera, and modest."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from lightfield.dataset import config
from scenes import still_life

ROOT = Path(__file__).resolve().parents[1]
# The nearest that anything of it comes to a camera, in metres.
CLEARANCE = 0.5


def built(detail):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    still_life.build({"seed": 1, "detail": detail})
    return {thing.name: thing for thing in bpy.data.objects}


def world_points(thing):
    """Return the places (n, 3) of a mesh's vertices or of curves' points, in the world."""
    places, name = (
        (thing.data.vertices, "co") if thing.type == "MESH" else (thing.data.points, "position")
    )
    values = np.empty(3 * len(places), np.float32)
    places.foreach_get(name, values)
    matrix = np.array(thing.matrix_world)
    return values.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def triangles(things):
    meshes = {thing.data for thing in things.values() if thing.type == "MESH"}
    return sum(len(face.vertices) - 2 for data in meshes for face in data.polygons)


@pytest.fixture(scope="module")
def things():
    return built(1.0)


def test_all_of_it_is_on_the_board_and_clear_of_the_cameras(things):
    whole = np.concatenate(
        [world_points(thing) for thing in things.values() if thing.type in ("MESH", "CURVES")]
    )
    assert np.isfinite(whole).all()
    assert np.hypot(*whole[:, :2].T).max() < 0.36
    assert -0.4 < whole[:, 2].min() < -0.1 and 0.2 < whole[:, 2].max() < 0.25
    standing = [name for name in things if things[name].type == "MESH" and name != "Cloth"]
    for name in set(standing) - {"Board"}:
        assert world_points(things[name])[:, 2].min() > -1e-3, name
    reach = np.linalg.norm(whole - [0, 0, 0.05], axis=-1).max()
    for rig in config.load_scene("object").rigs.values():
        cameras = np.array([pose.position for pose in rig.poses()])
        assert np.linalg.norm(cameras - [0, 0, 0.05], axis=-1).min() > reach + CLEARANCE


def test_it_is_of_many_materials_and_of_hair(things):
    kinds = {node.bl_idname for m in bpy.data.materials for node in m.node_tree.nodes}
    assert "ShaderNodeBsdfHairPrincipled" in kinds
    principled = [
        node.inputs
        for material in bpy.data.materials
        for node in material.node_tree.nodes
        if node.bl_idname == "ShaderNodeBsdfPrincipled"
    ]
    for name in ("Metallic", "Transmission Weight", "Subsurface Weight", "Sheen Weight"):
        assert any(inputs[name].default_value > 0.3 for inputs in principled), name
    used = {s.material for t in things.values() if t.type != "LIGHT" for s in t.material_slots}
    assert None not in used and len(used) >= 20
    assert len(things["Down"].data.curves) > 10_000
    assert 100_000 < triangles(things) < 300_000


def test_file_is_small_and_self_contained(things, tmp_path):
    assert all(image.packed_file for image in bpy.data.images if image.source == "FILE")
    assert not bpy.data.cameras and not bpy.data.libraries
    path = tmp_path / "still_life.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    assert path.stat().st_size < 40e6


def test_less_detail_is_less():
    small = built(0.05)
    assert triangles(small) < 40_000
    assert len(small["Down"].data.curves) < 2_000
