"""Rigs that see nothing of the scene: warned of before the render, and not valid after it."""

import json

import numpy as np
import pytest
from conftest import BLENDER
from scipy.spatial.transform import Rotation
from test_users_scenes import write_lightfield

from lightfield.formats.lightfield import LightField
from lightfield.geometry import framing, lenses

LENSES = [
    {"lens": "rectilinear", "fov": 60, "resolution": [40, 20]},
    {"lens": "equidistant", "fov": 180, "resolution": [32, 32]},
    {"lens": "equidistant", "fov": 360, "resolution": [32, 32]},
    {"lens": "equirectangular", "resolution": [64, 32]},
]
BOX = np.array([[-0.2, -0.1, 0], [0.2, 0.1, 0.5]])


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera["lens"])
def test_a_camera_that_sees_a_point_of_a_box_is_never_said_to_miss_it(camera):
    lens = lenses.from_camera(camera)
    random = np.random.default_rng(1)
    cameras = np.tile(np.eye(4), (500, 1, 1))
    cameras[:, :3, :3] = Rotation.random(500, random_state=1).as_matrix()
    cameras[:, :3, 3] = random.normal(size=(500, 3)) * random.choice([0.3, 2, 30], (500, 1))
    points = BOX[0] + random.random((200, 3)) * (BOX[1] - BOX[0])
    seen = []
    for pose in cameras:
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        seen.append(bool(lens.in_frame(lens.pixels(local)).any()))
    may_see = framing.may_see(lens, cameras, BOX)
    assert not (np.array(seen) & ~may_see).any()
    # Few of the cameras that see nothing are taken for some that do.
    if camera["lens"] == "rectilinear":
        assert (~may_see).sum() > 0.8 * (~np.array(seen)).sum()


@pytest.fixture(scope="module")
def folder(run_program, tmp_path_factory):
    """A folder with the .blend of each scene."""
    folder = tmp_path_factory.mktemp("users")
    run_program(BLENDER / "users_scenes.py", folder)
    return folder


def checked(folder, run_program, blend, places, output):
    """Check cameras that look along y. Return the warnings, and write cameras.json beside."""
    write_lightfield(output / "lightfield.json", "flat", places, passes=[])
    arguments = ("--blend", folder / f"{blend}.blend", "--lightfield", output / "lightfield.json")
    result = run_program("check_cameras.py", *arguments, "--output", output.parent / "cameras.json")
    return result.stderr.splitlines()


def validated(folder, run_program, blend, output):
    """Render the views of a light field, and return the validation's status and messages."""
    arguments = ("--blend", folder / f"{blend}.blend", "--lightfield", output / "lightfield.json")
    run_program("render_shard.py", *arguments, "--output", output / "exr")
    clearance = ("--clearance", output.parent / "cameras.json")
    result = run_program("validate.py", output, *clearance, check=False)
    return result.returncode, result.stderr


FAR = [(0, 50, 0), (0.1, 50, 0)]


@pytest.mark.slow
def test_a_rig_far_away_is_warned_of_and_its_dataset_is_not_valid(folder, run_program, tmp_path):
    (warning,) = checked(folder, run_program, "box", FAR, tmp_path / "far")
    assert "2 of 2 cameras look past the scene: view_0000f, view_0001f: " in warning
    assert "it reaches from (-1, -1, -1) to (1, 1, 1) m" in warning
    assert "the cameras are 50 m from its middle; move the rig" in warning
    status, said = validated(folder, run_program, "box", tmp_path / "far")
    assert status == 1
    assert "surfaces: lightfield.json: no view shows a surface or a light: the scene" in said
    assert "(-1, -1, -1) to (1, 1, 1) m, and the cameras are 50 m from its middle" in said
    assert "brighter" not in said


@pytest.mark.slow
def test_a_view_without_anything_is_named_beside_views_of_the_scene(folder, run_program, tmp_path):
    """The cameras look along y: from the second, the box is behind."""
    places = [(0, -5, 0), (0, 5, 0)]
    (before,) = checked(folder, run_program, "box", places, tmp_path / "half")
    assert "1 of 2 cameras look past the scene: view_0001f: it reaches" in before
    status, said = validated(folder, run_program, "box", tmp_path / "half")
    assert status == 0, said
    assert "warning: 1 of 2 views show no surface: view_0001f: the scene reaches from (-1" in said


@pytest.mark.slow
def test_a_transparent_dataset_without_a_pixel_is_not_valid_also_without_depth(
    folder, run_program, tmp_path
):
    checked(folder, run_program, "box", FAR, tmp_path / "far")
    path = tmp_path / "far" / "lightfield.json"
    content = json.loads(path.read_text())
    content["depth"] = None
    content["render"] |= {"transparent": True, "passes": []}
    path.write_text(json.dumps(content))
    status, said = validated(folder, run_program, "box", tmp_path / "far")
    assert status == 1
    assert "surfaces: lightfield.json: no view shows anything: the scene reaches" in said


@pytest.mark.slow
def test_a_lamp_that_no_pixel_shows_makes_no_dataset_valid(folder, run_program, tmp_path):
    """The lamp "seen" is in the frame, but a camera that is hidden from it shows one colour."""
    blend = tmp_path / "lamp.blend"
    run_program(BLENDER / "lamp_scene.py", folder / "box.blend", blend)
    places = [(0, 50, 8), (0.1, 50, 8)]
    checked(tmp_path, run_program, "lamp", places, tmp_path / "far")
    cameras = json.loads((tmp_path / "cameras.json").read_text())
    (tmp_path / "cameras.json").write_text(json.dumps(cameras | {"without_depth": ["seen"]}))
    status, said = validated(tmp_path, run_program, "lamp", tmp_path / "far")
    assert status == 1
    assert "surfaces: lightfield.json: no view shows anything: the scene reaches" in said


def test_views_that_cut_a_model_are_those_that_miss_one_of_its_points():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [40, 20]})
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-0.1, 0.1) for z in (0, 0.5)])
    # Looking along −z from above: half a width of 1 is in 60° from a distance of 1.73.
    cameras = np.tile(np.eye(4), (3, 1, 1))
    cameras[:, 2, 3] = [0.5 + 1.7, 0.5 + 1.76, 0.4]
    assert framing.cuts(lens, cameras, points).tolist() == [True, False, True]


@pytest.mark.slow
@pytest.mark.parametrize("size, is_cut", [(1.6, True), (6, False)])
def test_a_model_that_most_views_cut_is_warned_of(run_program, tmp_path, size, is_cut):
    """A slim column, in a box of 0.2 × 0.2 × 1 m, and its ground, which views may cut."""
    model = tmp_path / "column.obj"
    corners = [(x, y, z) for x in (0, 2) for z in (0, 2) for y in (0, 10)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    faces = ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    model.write_text("\n".join([*lines, *faces, ""]))
    blend, record = tmp_path / "column.blend", tmp_path / "column.json"
    arguments = ("--model", model, "--ground", "--output", blend, "--record", record)
    run_program("import_model.py", *arguments)
    rig = {"type": "ring", "count": 4, "elevation": 5, "size": size}
    camera = {"lens": "rectilinear", "fov": 40, "resolution": [64, 64]}
    scene = {"name": "column", "unit": "box", "fingerprint": "0"}
    made = lenses.from_camera(camera)
    keys = {"depth": "z", "frame": 1, "scene": scene, "render": {"samples": 1}}
    LightField.from_rig(rig, made, **keys).write(tmp_path / "lightfield.json")
    arguments = ("--blend", blend, "--lightfield", tmp_path / "lightfield.json")
    result = run_program("check_cameras.py", *arguments, "--output", tmp_path / "cameras.json")
    warning = (
        "4 of 4 views cut the model: view_0000f, view_0001f, view_0002f, view_0003f: it reaches "
        "from (-0.1, -0.1, -0.5) to (0.1, 0.1, 0.5) m, and the cameras are 0.8 m from its middle"
    )
    assert (warning in result.stderr) == is_cut
    assert ("cut" in result.stderr) == is_cut


@pytest.mark.slow
def test_a_lamp_in_view_is_something_to_see(folder, run_program, tmp_path):
    blend = tmp_path / "lamp.blend"
    run_program(BLENDER / "lamp_scene.py", folder / "box.blend", blend)
    checked(tmp_path, run_program, "lamp", FAR, tmp_path / "far")
    assert json.loads((tmp_path / "cameras.json").read_text())["without_depth"] == ["seen"]
    status, said = validated(tmp_path, run_program, "lamp", tmp_path / "far")
    assert status == 0
    assert "warning: no view shows a surface, but maybe seen: the scene reaches" in said


@pytest.mark.slow
def test_a_scene_that_is_too_small_is_warned_of(folder, run_program, tmp_path):
    places = [(0, -800, 0), (1, -800, 0)]
    (warning,) = checked(folder, run_program, "box", places, tmp_path / "small")
    assert "the scene covers at most" in warning and "800 m from its middle" in warning


@pytest.mark.slow
def test_a_camera_is_as_clear_as_its_nearest_surface_is_far():
    """A hollow ball around all has a box that holds the cameras, too."""
    import bpy

    from lightfield.rendering.inspection import clearance
    from lightfield.rendering.scenes import blend_file

    blend_file.new_scene()
    for name, radius in (("a", 3), ("b", 0.5), ("c", 4)):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=radius)
        bpy.context.object.name = name
    bpy.context.view_layer.update()
    found = clearance.surroundings(np.array([[0.9, 0, 0], [0, 0, 2.8], [0, 3.6, 0]]), 10.0)
    assert found.distances == pytest.approx([0.4, 0.2, 0.4], abs=0.02)
    assert found.box == pytest.approx(np.array([[-4] * 3, [4] * 3]), abs=0.02)
