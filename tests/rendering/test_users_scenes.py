"""Scenes of users that Cycles renders incorrectly without an error: each is reported once."""

import numpy as np
import pytest
from conftest import BLENDER

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.validation.validate import validate


@pytest.fixture(scope="module")
def folder(run_program, tmp_path_factory):
    """A folder with the .blend of each scene."""
    folder = tmp_path_factory.mktemp("users")
    run_program(BLENDER / "users_scenes.py", folder)
    return folder


LENSES = {
    "flat": {"lens": "rectilinear", "fov": 60, "resolution": [32, 32]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [32, 32]},
}


def write_lightfield(path, lens, places, **more):
    """Write a light field of cameras that look along y."""
    keys = [{"position": place} for place in places]
    rig = {"type": "path", "count": len(places), "keys": keys, "look_at": [0, 1e6, 0]}
    render = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    render |= {"depth_precision": "float", "passes": ["object", "emission"]}
    render |= more
    made = lenses.from_camera(LENSES[lens])
    LightField.from_rig(rig, made, depth="z", frame=1, render=render).write(path)


def checked(folder, run_program, blend, places):
    """Return the status of the check of cameras, and its warnings or error."""
    write_lightfield(folder / "checked.json", "flat", places)
    arguments = ("--blend", folder / f"{blend}.blend", "--lightfield", folder / "checked.json")
    output = ("--output", folder / "cameras.json")
    result = run_program("check_cameras.py", *arguments, *output, check=False)
    return result.returncode, result.stderr.splitlines()


def rendered(folder, run_program, blend, lens):
    """Return the channels of a view, and of its pass object."""
    output = folder / f"{blend}_{lens}"
    write_lightfield(output / "lightfield.json", lens, [(0, -4, 0), (0.1, -4, 0)])
    arguments = ("--blend", folder / f"{blend}.blend", "--lightfield", output / "lightfield.json")
    run_program("render_shard.py", *arguments, "--views", "0:1", "--output", output / "exr")
    view = images.read_image(output / "exr/view_0000f.exr").channels
    view |= images.read_image(output / "object/view_0000f.exr").channels
    return {name: pixels.astype(float) for name, pixels in view.items()}


def test_grease_pencil_is_left_out_of_a_fisheye(folder, run_program):
    plain, drawn = (rendered(folder, run_program, each, "fisheye") for each in ("wall", "pencil"))
    for name, pixels in plain.items():
        np.testing.assert_array_equal(drawn[name], pixels, err_msg=name)


def test_only_perspective_views_show_grease_pencil_and_only_in_their_colour(folder, run_program):
    plain, drawn = (rendered(folder, run_program, each, "flat") for each in ("wall", "pencil"))
    for name in "ZY":
        np.testing.assert_array_equal(drawn[name], plain[name], err_msg=name)
    differs = np.abs(drawn["R"] - plain["R"]) > 0.01
    assert differs[12:20, 12:20].mean() > 0.5
    # Behind the wall, this would be visible.
    assert not differs[:4].any() and not differs[:, :4].any()


@pytest.mark.parametrize(
    ("lens", "said"), [("fisheye", "is left out"), ("flat", "no depth and no pass")]
)
def test_missing_grease_pencil_is_reported(lens, said, folder, run_program):
    write_lightfield(folder / "lightfield.json", lens, [(0, -4, 0), (0.1, -4, 0)])
    arguments = ("--lightfield", folder / "lightfield.json", "--output", folder / "cameras.json")
    result = run_program("check_cameras.py", "--blend", folder / "pencil.blend", *arguments)
    (warning,) = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    assert said in warning
    assert "behind, drawing" in warning


BOTH_INSIDE = [(0, 0, 0), (0.2, 0, 0)]
# The second camera looks at the box.
ONE_INSIDE = [(0, 0, 0), (0, -30, 0)]


@pytest.mark.parametrize(
    ("blend", "places", "said"),
    [
        ("open_box", ONE_INSIDE, "1 of 2 cameras are inside an open mesh: box: "),
        ("open_box", BOTH_INSIDE, "2 of 2 cameras are inside an open mesh: box: "),
        ("backdrop", BOTH_INSIDE, "2 of 2 cameras are inside an open mesh: backdrop: "),
        ("dome", BOTH_INSIDE, "2 of 2 cameras are inside an open mesh: dome: "),
    ],
)
def test_cameras_inside_an_open_mesh_are_reported(blend, places, said, folder, run_program):
    status, (warning,) = checked(folder, run_program, blend, places)
    assert status == 0
    assert warning.startswith(f"warning: {said}")


@pytest.mark.parametrize("blend", ["box", "split_box"])
def test_a_camera_inside_a_closed_mesh_is_refused(blend, folder, run_program):
    status, (error,) = checked(folder, run_program, blend, ONE_INSIDE)
    assert status == 1
    assert "1 of 2 cameras are inside box: view_0000f;" in error


def test_a_whole_rig_inside_a_closed_dark_object_is_said_before_a_render(folder, run_program):
    status, (warning,) = checked(folder, run_program, "box", BOTH_INSIDE)
    assert status == 0
    assert warning.startswith("warning: 2 of 2 cameras are inside box, a closed object that ")
    assert "reaches from (-1, -1, -1) to (1, 1, 1) m" in warning
    assert "no lamp and no glowing surface is in it, so all views may be black" in warning


@pytest.mark.parametrize("blend", ["lit_box", "glowing_box", "box_with_glow"])
def test_a_closed_room_with_light_in_it_is_no_mistake(blend, folder, run_program):
    assert checked(folder, run_program, blend, BOTH_INSIDE) == (0, [])


@pytest.mark.parametrize("blend", ["open_room", "leaves", "floor"])
def test_cameras_that_see_fronts_or_a_plane_are_not_inside(blend, folder, run_program):
    assert checked(folder, run_program, blend, BOTH_INSIDE) == (0, [])


def listed(folder, run_program, blend, frame):
    """Return the warnings of the inventory of a .blend for a frame."""
    scenes = folder / "configs/scenes"
    scenes.mkdir(parents=True, exist_ok=True)
    text = SIMULATED.format(blend=blend, frame=frame)
    (scenes / f"{blend}.yaml").write_text(text)
    arguments = ("--scene", blend, "--blend", f"{blend}.blend", "--output", "inventory.json")
    result = run_program("inventory.py", *arguments, cwd=folder, check=False)
    messages = [
        line for line in result.stderr.splitlines() if line.startswith(("warning: ", "error"))
    ]
    return result.returncode, messages


SIMULATED = """
scene: {{blend: {blend}.blend, frame: {frame}}}
render: {{samples: 1}}
rigs:
  View:
    type: lattice
    cameras: [2, 1, 1]
    camera: {{lens: equirectangular, resolution: [16, 8]}}
"""


def test_unbaked_simulations_are_named_with_a_remedy(folder, run_program):
    status, (warning,) = listed(folder, run_program, "simulations", 20)
    assert status == 0
    named = ("flag", "jelly", "stone", "sparks", "crawler")
    still = ("hidden stone", "rock", "confetti", "grass", "seed")
    assert [name for name in (*named, *still) if f"{name} (" in warning] == list(named)
    assert "bake them in Blender" in warning


def test_simulations_need_no_bake_at_their_first_frame(folder, run_program):
    assert listed(folder, run_program, "simulations", 1) == (0, [])


def test_baked_simulations_are_not_warned_of(folder, run_program):
    assert listed(folder, run_program, "baked", 20) == (0, [])


def test_a_fluid_that_is_not_baked_is_refused_by_name(folder, run_program):
    status, (error,) = listed(folder, run_program, "fluid", 20)
    assert status == 1
    assert error.startswith("error: fluid.blend: water: ") and "bake" in error


@pytest.mark.parametrize("lens", LENSES)
def test_a_transparent_view_of_nothing_is_valid(lens, folder, run_program):
    output = folder / f"nothing_{lens}"
    # The box is behind the first camera, and in front of the second.
    places = [(0, 5, 0), (0, -5, 0)]
    more = {"passes": [], "transparent": True}
    write_lightfield(output / "lightfield.json", lens, places, **more)
    arguments = ("--blend", folder / "box.blend", "--lightfield", output / "lightfield.json")
    run_program("render_shard.py", *arguments, "--output", output / "exr")
    covered = [
        images.read_image(output / f"exr/view_{view}f.exr").channels["A"][16, 16]
        for view in ("0000", "0001")
    ]
    assert covered == [0, 1]
    faults = [check.name for check in validate(output).checks if check.passed is False]
    assert faults == []


ASPECT = """
scene: {blend: aspect.blend}
render: {samples: 1}
rigs:
  View:
    type: blend_camera
    camera: {lens: file, resolution: [32, 32]}
"""


def test_a_pixel_aspect_is_reported_as_ignored_and_pixels_are_square(folder, run_program):
    (folder / "configs/scenes").mkdir(parents=True, exist_ok=True)
    (folder / "configs/scenes/aspect.yaml").write_text(ASPECT)
    blend = ("--scene", "aspect", "--blend", "aspect.blend")
    run_program("check_blend.py", *blend, "--output", "blend.json", cwd=folder)
    said = run_program("inventory.py", *blend, "--output", "inventory.json", cwd=folder).stdout
    (note,) = [line for line in said.splitlines() if line.startswith("note: ")]
    assert "pixel aspect 2 ignored" in note
    arguments = ("--scene", "aspect", "--rig", "View", "--inventory", "inventory.json")
    run_program("make_lightfield.py", *arguments, "--output", "View/lightfield.json", cwd=folder)
    arguments = ("--blend", "aspect.blend", "--lightfield", "View/lightfield.json")
    run_program("render_shard.py", *arguments, "--output", "View/exr", cwd=folder)
    depth = images.read_image(folder / "View/exr/view_0001f.exr").channels["Z"]
    seen = np.isfinite(depth)
    assert 4 < seen.any(axis=0).sum() == seen.any(axis=1).sum() < 32
