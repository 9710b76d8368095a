"""Datasets of rigs that fit the scene: built, valid, and where the scene is."""

import itertools
import json

import numpy as np
import pytest
from checkouts import checkout, snakemake

from lightfield.formats.lightfield import LightField

pytestmark = pytest.mark.slow

MODEL = """
scene: {model: models/column.obj, unit: metres, ground: true}
render: {samples: 1, transparent: true}
rigs:
  around: {type: ring, count: 3, size: fit, center: fit, camera: &lens {lens: rectilinear, fov: 40,
    resolution: [32, 32]}}
  wall: {type: plane, cameras: [2, 2], size: fit, center: fit, camera: *lens}
exports: {nerf_synthetic: {sources: [views]}}
"""
ROOM = """
scene: {blend: room.blend}
render: {samples: 1}
rigs:
  around: {type: sphere, subdivisions: 1, size: fit, center: fit, camera: {lens: equidistant,
    fov: 180, resolution: [16, 16]}}
  places: {type: random, count: 3, size: fit, center: fit, camera: {lens: rectilinear, fov: 60,
    resolution: [16, 16]}}
"""


def built(folder, scene):
    result = snakemake(folder, "--config", f"scenes={scene}", "preset=full")
    assert result.returncode == 0, result.stdout + result.stderr
    for path in (folder / "results" / scene).glob("*/validation.json"):
        assert json.loads(path.read_text())["valid"]
    return result.stdout + result.stderr


def test_rigs_around_a_model_fit_its_box_without_its_ground(tmp_path):
    """The model is 2 × 2 × 10 m, and stands at x = 100 m."""
    folder = checkout(tmp_path / "plenoforge", column=MODEL)
    corners = list(itertools.product((100, 102), (0, 10), (0, 2)))
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (folder / "models").mkdir()
    (folder / "models" / "column.obj").write_text("\n".join([*lines, ""]))
    said = built(folder, "column")
    assert "note: the ring fits the box of column: size: 31.9043, center: [101, -1, 5]" in said
    assert "cut the model" not in said
    box = np.array([[100, -2, 0], [102, 0, 10]])
    for rig in ("around", "wall"):
        lightfield = LightField.read(folder / "results/column" / rig / "lightfield.json")
        points = np.array(list(itertools.product(*box.T)), float)
        for pose in lightfield.world_from_cameras:
            pixels = lightfield.lens.pixels((points - pose[:3, 3]) @ pose[:3, :3])
            assert lightfield.lens.in_frame(pixels).all()
    place = json.loads((folder / "results/column/around/lightfield.json").read_text())["rig_fit"]
    assert place["center"] == [101, -1, 5]
    page = (folder / "results/column/around/report/index.html").read_text()
    assert f"ring, ⌀ {place['size']:g} m" in page


def test_rigs_in_a_room_fit_it(tmp_path):
    import bpy

    from lightfield.rendering.scenes import blend_file

    folder = checkout(tmp_path / "plenoforge", room=ROOM)
    blend_file.new_scene()
    bpy.ops.mesh.primitive_cube_add(size=2, location=(7, 0, 1.5), scale=(2, 3, 1.5))
    bpy.context.object.data.flip_normals()
    bpy.ops.object.light_add(type="POINT", location=(7, 0, 2.5))
    blend_file.save_scene(folder / "room.blend")
    built(folder, "room")
    around = LightField.read(folder / "results/room/around/lightfield.json").world_from_cameras
    distances = np.linalg.norm(around[:, :3, 3] - (7, 0, 1.5), axis=1)
    # A quarter of the room's height. The icosahedron's coordinates are rounded.
    np.testing.assert_allclose(distances, 0.75, rtol=1e-4)
    places = LightField.read(folder / "results/room/places/lightfield.json").world_from_cameras
    low, high = np.array([[6, -1.5, 0.75], [8, 1.5, 2.25]])
    assert ((places[:, :3, 3] >= low) & (places[:, :3, 3] <= high)).all()


def test_a_scene_without_a_surface_has_no_box_to_fit(tmp_path):
    import bpy

    from lightfield.rendering.scenes import blend_file

    folder = checkout(tmp_path / "plenoforge", room=ROOM)
    blend_file.new_scene()
    bpy.ops.object.light_add(type="POINT", location=(7, 0, 2.5))
    blend_file.save_scene(folder / "room.blend")
    result = snakemake(folder, "--config", "scenes=room", "preset=full")
    assert result.returncode != 0
    message = "work/room/inventory.json: box: the scene has none, because it shows no surface"
    assert message in result.stdout + result.stderr
