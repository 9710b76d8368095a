"""Scenes that change with time: the facts of one frame are not used for another."""

import json

import numpy as np
import pytest
from conftest import BLENDER

from lightfield.configuration import scene_yaml
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.planning.loading import rendered_frames, scene_datasets

RENDER = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}

CASES = [
    "keyed_visibility",
    "keyed_visibility_that_the_viewport_never_shows",
    "visibility_keyed_for_viewport_and_render",
    "visibility_driven_by_the_frame",
    "visibility_driven_by_an_object",
    "visibility_driven_by_the_viewport",
    "visibility_in_an_nla_track",
    "keyed_rays",
    "keyed_instancer",
    "keyed_part_of_an_instanced_collection",
    "keyed_part_of_a_collection_that_nodes_place",
    "keyed_switch_of_nodes",
    "particles_from_a_keyed_emitter",
    "keyed_object_of_a_linked_collection",
    "keyed_material",
    "keyed_modifier",
    "keyed_constraint",
    "keyed_bone",
    "keyed_world",
    "keyed_light",
    "keyed_samples",
    "keyed_simplification",
    "keyed_number",
    "keyed_view_layer",
    "blur_across_a_change_of_visibility",
    "blur_of_a_light_that_changes",
    "blur_by_a_target_in_another_scene",
    "blur_by_a_sequence_of_images",
    "background_that_shows_what_the_scene_excludes",
    "driver_that_finds_a_hidden_object_by_the_scene",
    "driver_that_follows_the_camera",
    "driver_of_what_a_render_has_in_more_detail",
]


@pytest.fixture(scope="module")
def folder(run_program, tmp_path_factory):
    """A folder with a .blend of each case, saved at frame 1, and the results of its renders."""
    folder = tmp_path_factory.mktemp("animated")
    run_program(BLENDER / "animated_renders.py", folder)
    return folder


@pytest.fixture(scope="module")
def scenes(folder):
    return json.loads((folder / "results.json").read_text())


@pytest.mark.parametrize("name", CASES)
def test_pruning_changes_no_pixel_at_any_frame(name, scenes):
    assert scenes[name]["same"] == [True, True]
    # The two frames differ, so pruning could lose something.
    assert scenes[name]["changes"]


@pytest.mark.parametrize("name", ["blur_by_velocities", "blur_by_velocities_from_nodes"])
def test_meshes_with_velocities_are_blurred_at_rest(name, scenes):
    assert scenes[name]["left_out"] == ["viewport"]


def test_keyframed_values_are_listed_completely(scenes):
    scene_inventory = scenes["keyed_material"]["inventory"]
    assert scene_inventory["transmission"] == scene_inventory["transparency"] == ["sphere"]
    assert scene_inventory["emission"] == ["torus"]


def test_objects_are_counted_at_the_frame_that_shows_most(scenes):
    scene_inventory = scenes["keyed_visibility"]["inventory"]
    assert scene_inventory["frames"] == [1, 5]
    assert scene_inventory["fullest_frame"] == 5
    # The room's six objects, and the cube.
    assert scene_inventory["objects"] == 7


@pytest.mark.parametrize("name", ["keyed_samples", "keyed_view_layer"])
def test_keyframes_do_not_override_the_yaml(name, scenes):
    assert scenes[name]["pixels"] == scenes["keyed_light"]["pixels"]


LATE = """
scene: {blend: keyed_visibility.blend, frame: 5}
render: {samples: 1}
rigs:
  View:
    type: plane
    cameras: [1, 1]
    center: [0, 0, 1]
    camera: {lens: rectilinear, fov: 60, resolution: [9, 9]}
"""


def test_a_cube_that_appears_at_the_yamls_frame_is_in_the_view(folder, run_program):
    for name in ("configs/scenes", "View"):
        (folder / name).mkdir(parents=True)
    (folder / "configs/scenes/late.yaml").write_text(LATE)
    blend = ("--blend", "keyed_visibility.blend")
    inventory = ("--inventory", "inventory.json")
    made = "View/lightfield.json"
    for program, *arguments in (
        ("check_blend.py", "--scene", "late", *blend, "--output", "blend.json"),
        ("inventory.py", "--scene", "late", *blend, "--output", "inventory.json"),
        ("make_lightfield.py", "--scene", "late", *inventory, "--output", made),
        ("render_shard.py", *blend, *inventory, "--lightfield", made, "--output", "View/exr"),
    ):
        run_program(program, *arguments, cwd=folder)
    scene_inventory = json.loads((folder / "inventory.json").read_text())
    assert scene_inventory["frames"] == [json.loads((folder / made).read_text())["frame"]] == [5]
    assert scene_inventory["hidden"] == []
    depth = images.read_image(folder / "View/exr/view_0000f.exr").channels["Z"]
    assert depth[4, 4] == pytest.approx(1.5 - 0.4, abs=1e-5)


def write_lightfield(path, frame, center=(0.5, 1.5, 1), **render):
    """Write a light field of two cameras: one at the cube's place at frame 5, one beside it."""
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [64, 32]})
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 1, "center": list(center)}
    LightField.from_rig(
        rig,
        lens,
        depth="distance",
        frame=frame,
        scene={"fingerprint": "0"},
        render={**RENDER, "depth_precision": "float", **render},
    ).write(path)


@pytest.mark.parametrize("name", CASES[:4])
def test_cameras_are_checked_against_their_frame(name, folder, run_program, tmp_path):
    def checked(frame):
        lightfield = tmp_path / f"{frame}.json"
        write_lightfield(lightfield, frame)
        arguments = ("--blend", folder / f"{name}.blend", "--lightfield", lightfield)
        return run_program(
            "check_cameras.py", *arguments, "--output", tmp_path / "out", check=False
        )

    assert checked(1).returncode == 0
    inside = checked(5)
    assert inside.returncode == 1
    assert "1 of 2 cameras are inside late: view_0000f" in inside.stderr


def test_a_camera_that_touches_the_floor_is_refused(room, run_program, tmp_path):
    rig = {"type": "lattice", "cameras": [1, 1, 2], "size": 1, "center": [0.2, 0.1, 0.5005]}
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [64, 32]})
    LightField.from_rig(rig, lens, depth="distance", frame=1).write(tmp_path / "lightfield.json")
    arguments = ("--blend", room, "--lightfield", tmp_path / "lightfield.json")
    output = ("--output", tmp_path / "cameras.json")
    result = run_program("check_cameras.py", *arguments, *output, check=False)
    assert result.returncode == 1
    # The floor is at z = 0, and the lower camera half a millimetre above it.
    assert (
        "1 of 2 cameras touch a surface, which is 0.5 mm away from the nearest: view"
        in result.stderr
    )
    assert "inside" not in result.stderr
    assert "smaller" not in result.stderr


def test_cameras_are_checked_against_particles(folder, run_program, tmp_path):
    # The first camera is at the emitter's place at frame 5. The grains themselves are hidden.
    write_lightfield(tmp_path / "lightfield.json", 5, center=[1.5, 1, 1.05])
    arguments = ("--blend", folder / "particles_from_a_keyed_emitter.blend")
    arguments += (
        "--lightfield",
        tmp_path / "lightfield.json",
        "--output",
        tmp_path / "cameras.json",
    )
    result = run_program("check_cameras.py", *arguments, check=False)
    assert "1 of 2 cameras are inside grain: view_0000f" in result.stderr


def test_keyframes_do_not_number_objects(folder, run_program, tmp_path):
    write_lightfield(tmp_path / "lightfield.json", 5, passes=["object"])
    arguments = ("--blend", folder / "keyed_number.blend", "--views", "1:2")
    arguments += ("--lightfield", tmp_path / "lightfield.json", "--output", tmp_path / "exr")
    run_program("render_shard.py", *arguments)
    names = json.loads((tmp_path / "object/names.json").read_text())
    assert names == {name: number for number, name in enumerate(sorted(names), 1)}
    (pixels,) = images.read_image(tmp_path / "object/view_0001f.exr").channels.values()
    assert names["torus"] in pixels


@pytest.mark.parametrize(
    ("blend", "shown"),
    [
        ("keyed_visibility_that_the_viewport_never_shows", "late"),
        ("particles_from_a_keyed_emitter", "plane > grain"),
    ],
)
def test_objects_that_only_a_render_shows_are_reported(blend, shown, folder, run_program, tmp_path):
    write_lightfield(tmp_path / "lightfield.json", 5, passes=["instance"])
    arguments = ("--blend", folder / f"{blend}.blend", "--views", "1:2")
    arguments += ("--lightfield", tmp_path / "lightfield.json", "--output", tmp_path / "exr")
    run_program("render_shard.py", *arguments)
    names = json.loads((tmp_path / "instance/names.json").read_text())
    numbers = [number for name, number in names.items() if name.startswith(shown)]
    (pixels,) = images.read_image(tmp_path / "instance/view_0001f.exr").channels.values()
    assert np.isin(pixels, numbers).any()


SEQUENCE = """
scene: {builder: garden, frame: 5}
render: {samples: 1}
rigs:
  Still:
    type: plane
    cameras: [2, 1]
    camera: {lens: rectilinear, fov: 60, resolution: [8, 8]}
  Sequence:
    type: plane
    cameras: [2, 1]
    frames: {first: 1, last: 9, step: 4}
    camera: {lens: rectilinear, fov: 60, resolution: [8, 8]}
"""


def test_the_frames_of_a_scene_are_those_of_all_its_rigs(tmp_path, monkeypatch):
    (tmp_path / "moving.yaml").write_text(SEQUENCE)
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    assert rendered_frames(scene_datasets("moving")) == [1, 5, 9]
    own_scene = SEQUENCE.replace("builder: garden, frame: 5", "blend: a.blend, frame: file")
    (tmp_path / "moving.yaml").write_text(own_scene)
    assert rendered_frames(scene_datasets("moving")) == [1, 5, 9, "file"]
