"""The Blender extension: it draws the cameras where the workflow puts them, and writes YAMLs."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from checkouts import checkout
from conftest import BLENDER, ROOT
from geometry.test_rigs import EACH as OF_CAMERAS
from geometry.test_rigs import registered

from lightfield.configuration.scene_yaml import read_scene
from lightfield.formats.lightfield import LightField

SCENES = ROOT / "configs" / "scenes"
# How far a coordinate in 32 bits may be from the dataset's.
ROUNDING = 2e-6


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """The extension's zip, without the packages that the environment has."""
    spec = importlib.util.spec_from_file_location("build", ROOT / "extension" / "build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    return build.write(tmp_path_factory.mktemp("extension"), [])


@pytest.fixture(scope="session")
def extension(archive, tmp_path_factory):
    """A folder in which the zip is unpacked."""
    folder = tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(archive) as content:
        content.extractall(folder / "plenoforge_rigs")
    return folder


@pytest.fixture
def blender(extension, run_program, tmp_path):
    """Do some steps of `rigs_in_viewport` in Blender. Return what they return."""

    def run(*steps):
        plain = [(step, (), {}) if isinstance(step, str) else (*step, {})[:3] for step in steps]
        (tmp_path / "steps.json").write_text(json.dumps(plain))
        output = tmp_path / "output.json"
        arguments = (extension, tmp_path / "steps.json", output)
        run_program(BLENDER / "rigs_in_viewport.py", *arguments)
        return json.loads(output.read_text())

    return run


def opened(path):
    return ["press", ["open"], {"filepath": str(path)}]


def written(path=None):
    return ["press", ["write"], {"filepath": str(path)} if path else {}]


def cameras(points, count):
    """Return the places (n, 3) of drawn cameras, and the middles (n, 3) of what they see."""
    array = np.reshape(points, (count, -1, 3)) if count else np.empty((0, 2, 3))
    return array[:, 0], array[:, 1]


@pytest.fixture
def project(tmp_path):
    """A user's folder with a .blend, and the YAML of its rigs."""
    scenes = tmp_path / "project" / "configs" / "scenes"
    scenes.mkdir(parents=True)
    (scenes / "mine.yaml").write_text(
        """# My scene.
scene: {blend: mine.blend}

render:
  samples: 16   # enough

rigs:
  # Around the table.
  around:
    type: sphere
    subdivisions: 2
    size: 1   # metres
    camera: &lens {lens: equidistant, fov: 200, resolution: [64, 64]}
  wall:
    type: plane
    cameras: [3, 2]
    center: [0.1, 2, 1.05]
    rotation: [0, 0, 30]
    camera: {lens: rectilinear, fov: 60, resolution: [64, 48]}

  # Not to be changed.
  walk: {type: path, count: 4, keys: [{position: [0, 0, 1]}, {position: [1, 0, 1]}], camera: *lens}

reprojections:
  flat: {camera: {lens: rectilinear, fov: 90, resolution: [32, 32]}, rigs: [wall], format: png}
"""
    )
    return tmp_path / "project"


@pytest.mark.parametrize("scene", ["smoke", "garden", "barbershop"])
def test_cameras_are_drawn_where_the_dataset_has_them(scene, blender, run_program, tmp_path):
    *_, shown = blender("register", opened(SCENES / f"{scene}.yaml"), "rigs")
    assert shown.keys() == read_scene(SCENES / f"{scene}.yaml").rigs.keys()
    for name, parts in shown.items():
        output = tmp_path / f"{name}.json"
        program = ("make_lightfield.py", "--scene", scene, "--rig", name, "--output", output)
        run_program(*program)
        views = LightField.read(output).world_from_cameras
        places, ahead = cameras(parts["cameras"], len(views))
        np.testing.assert_allclose(places, views[:, :3, 3], atol=ROUNDING)
        looks = ahead - places
        looks /= np.linalg.norm(looks, axis=1, keepdims=True)
        np.testing.assert_allclose(looks, -views[:, :3, 2], atol=1e-4)


def test_cameras_look_through_their_lens_as_blenders_own(blender, project):
    """The corners of a perspective camera are those of Blender's camera with the same lens."""
    *_, shown, frame = blender(
        "register",
        opened(project / "configs/scenes/mine.yaml"),
        "rigs",
        ("view_frame", ["wall", 60, 64, 48]),
    )
    camera = np.reshape(shown["wall"]["cameras"], (6, -1, 3))[0]
    rays = camera[1:] - camera[0]
    for corner in np.array(frame):
        cosines = rays @ corner / np.linalg.norm(rays, axis=1) / np.linalg.norm(corner)
        assert cosines.max() > 1 - 1e-6


def test_a_fisheye_beyond_180_degrees_ends_behind_its_camera(blender, project):
    *_, shown = blender("register", opened(project / "configs/scenes/mine.yaml"), "rigs")
    camera = np.reshape(shown["around"]["cameras"], (42, -1, 3))[0]
    rays = camera[1:] - camera[0]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.degrees(np.arccos(rays @ rays[0])).max() == pytest.approx(100, abs=0.01)


def test_cameras_inside_objects_are_those_that_the_workflow_finds(
    blender, project, run_program, tmp_path
):
    """One camera is in a ball, and one is in a ball that renders do not show."""
    path = project / "configs/scenes/mine.yaml"
    saved = str(project / "mine.blend")
    *_, shown, lines = blender(
        ("ball", [[0, 0, -0.5], {"hide_render": False}]),
        ("ball", [[0, 0, 0.5], {"hide_render": True}]),
        "register",
        opened(path),
        ("save", [saved]),
        written(),
        "rigs",
        ("facts", ["around"]),
    )
    inventory = tmp_path / "inventory.json"
    program = ("inventory.py", "--scene", "mine", "--blend", saved, "--output", inventory)
    run_program(*program, cwd=project)
    lightfield = tmp_path / "lightfield.json"
    program = ("make_lightfield.py", "--scene", "mine", "--rig", "around")
    run_program(*program, "--inventory", inventory, "--output", lightfield, cwd=project)
    output = tmp_path / "clearance.json"
    checked = ("--blend", saved, "--lightfield", lightfield, "--output", output)
    message = run_program("check_cameras.py", *checked, check=False).stderr
    assert "1 of 42 cameras are inside" in message
    views = LightField.read(lightfield).views
    found = [view.position for view in views if view.name in message]
    places, _ = cameras(shown["around"]["inside"], 1)
    np.testing.assert_allclose(places, found, atol=ROUNDING)
    assert len(cameras(shown["around"]["cameras"], 41)[0]) == 41
    assert "Inside objects: 1" in lines


def test_handles_and_the_panel_change_the_yaml_and_nothing_else(blender, project):
    path = project / "configs/scenes/mine.yaml"
    before = path.read_text()
    *_, refused, shown = blender(
        "register",
        opened(path),
        ("change", ["around"], {"location": [1, 2, 3.25], "scale": [2, 2, 2]}),
        ("change", ["around"], {"plenoforge__count_0": 3}),
        ("change", ["wall"], {"rotation_mode": "QUATERNION"}),
        ("change", ["wall"], {"rotation_quaternion": [0.5, 0.5, 0.5, 0.5], "scale": [3, 1, 2]}),
        ("change", ["walk"], {"location": [5, 5, 5]}),
        written(),
        "rigs",
    )
    assert refused is None
    after = path.read_text().splitlines()
    assert [line for line in before.splitlines() if line not in after] == [
        "    subdivisions: 2",
        "    size: 1   # metres",
        "    rotation: [0, 0, 30]",
    ]
    assert [line for line in after if line not in before.splitlines()] == [
        "    subdivisions: 3",
        "    size: 2   # metres",
        "    center: [1, 2, 3.25]",
        "    rotation: [90, 0, 90]",
        "    size: [3, 1, 2]",
    ]
    rigs = read_scene(path).rigs
    for name, parts in shown.items():
        poses = np.array([pose.world_from_camera() for pose in rigs[name].poses()])
        places, ahead = cameras(parts["cameras"], len(poses))
        np.testing.assert_allclose(places, poses[:, :3, 3], atol=ROUNDING)
        cosines = ((ahead - places) * -poses[:, :3, 2]).sum(axis=1)
        np.testing.assert_allclose(cosines, np.linalg.norm(ahead - places, axis=1), atol=1e-5)


# A rig of each type, by its keys in a scene YAML beside the type.
EACH_TYPE = {
    **OF_CAMERAS,
    "poses": {"file": "poses.csv"},
    "blend_camera": {"frames": {"first": 1, "last": 3}},
}
PERSPECTIVE = {"lens": "rectilinear", "fov": 60, "resolution": [32, 24]}


@pytest.mark.parametrize("lens", [PERSPECTIVE, {"lens": "file", "resolution": [32, 24]}])
def test_a_rig_of_each_type_is_opened_and_checked(lens, blender, tmp_path):
    """Only a build knows the places of some cameras. The panel says so, and checks the others."""
    assert EACH_TYPE.keys() == registered()
    (tmp_path / "poses.csv").write_text("name,x,y,z,rx,ry,rz\na,0,0,1,0,0,0\n")
    of_file = lens["lens"] == "file"
    rigs = {
        name: {"type": name, **keys, "camera": lens}
        for name, keys in EACH_TYPE.items()
        if name == "blend_camera" or not of_file
    }
    content = {"scene": {"blend": "mine.blend"}, "render": {"samples": 1}, "rigs": rigs}
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    steps = [step for name in rigs for step in (["select", [name]], ["facts", [name]], "panel")]
    _, refused, again, *shown = blender("register", opened(path), ["press", ["check"]], *steps)
    assert (refused, again) == (None, None)
    for number, name in enumerate(rigs):
        facts, panel = shown[3 * number + 1 : 3 * number + 3]
        assert {*facts} <= {*panel}
        if name in ("blend_camera", "random"):
            assert {"Cameras: known after the build", "Inside objects: not checked"} <= {*facts}
        else:
            assert "Inside objects: 0" in facts


def test_a_rig_that_fits_the_scene_is_drawn_around_it_and_stays_so(blender, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "scene: {blend: mine.blend}\nrender: {samples: 1}\nrigs:\n"
        "  around: {type: ring, count: 5, size: fit, center: fit, camera: "
        "{lens: rectilinear, fov: 60, resolution: [32, 32]}}\n"
    )
    before = path.read_text()
    middle = [3, -2, 1]
    steps = (["ball", [middle, {}]], "register", opened(path), "rigs", written(path))
    *_, shown, refused, moved, refused_again = blender(
        *steps, ["change", ["around"], {"location__x": 4}], written(path)
    )
    assert (refused, moved, refused_again) == (None, None, None)
    places, _ = cameras(shown["around"]["cameras"], 5)
    distances = np.linalg.norm(places - middle, axis=1)
    # The sphere around the ball's box has a radius of 0.173 m, and is in 60° from twice of it.
    np.testing.assert_allclose(distances, 1.05 * 2 * 0.1 * 3**0.5, rtol=1e-3)
    after = path.read_text()
    assert after == before.replace("center: fit", "center: [4, -2, 1]")


def test_the_panel_shows_the_active_rig(blender, project):
    path = project / "configs/scenes/mine.yaml"
    *_, nothing, _, _, texts = blender(
        "register", "panel", opened(path), ("select", ["wall"]), "panel"
    )
    assert nothing == ["Open scene YAML", "Add rig", "Remove", "Check cameras", "Write YAML"]
    assert texts == [
        "Open scene YAML",
        "mine.yaml",
        *("around", "wall", "walk"),
        *("Add rig", "Remove"),
        *("wall", "3", "Cameras", "2", "Cameras"),
        "Type: plane",
        "Cameras: 6",
        "Size: 1 × 1 × 1 m",
        "Spacing: 0.5 m",
        "Lens: rectilinear, 31.18 mm",
        "Resolution: 64 × 48",
        "Inside objects: 0",
        *("Check cameras", "Write YAML"),
        # The folder is no checkout, so the panel asks for one.
        *("", "tiny", "", "Build", "Cancel"),
    ]


def test_the_panel_names_a_count_as_the_yaml_does(blender, project):
    path = project / "configs/scenes/mine.yaml"
    *_, texts = blender("register", opened(path), ("select", ["around"]), "panel")
    assert texts[texts.index("Type: sphere") - 2 :][:4] == [
        *("2", "Subdivisions"),
        *("Type: sphere", "Cameras: 42"),
    ]


def test_a_rig_is_added_below_the_last_one(blender, project):
    """The last line may be that of a rig, with or without a line break."""
    path = project / "configs/scenes/mine.yaml"
    text = path.read_text().partition("\nreprojections:")[0].rstrip("\n")
    path.write_text(text)
    assert (
        blender("register", opened(path), ("press", ["add"], {"type": "ring"}), written())[-1]
        is None
    )
    assert path.read_text().startswith(f"{text}\n  ring_1:\n    type: ring\n")


ROOM = """
scene: {builder: room}
render: {samples: 1}
rigs:
  Other: {type: ring, count: 900, size: 1, center: [0, 0, 1.2], camera: &lens {lens: equidistant,
    fov: 180, resolution: [16, 16]}}
  View: {type: ring, count: 3, size: 1, center: [0, 0, 1.2], camera: *lens}
"""


@pytest.fixture
def built_checkout(tmp_path):
    """A checkout whose environment is the tests' own."""
    gone = ROOM.replace("builder: room", "blend: gone.blend")
    folder = checkout(tmp_path / "plenoforge", mine=ROOM, gone=gone)
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


def test_the_panel_builds_the_chosen_rig_and_shows_its_page(blender, built_checkout):
    yaml_path = built_checkout / "configs/scenes/mine.yaml"
    *_, before, seconds, during, states, after, _, again = blender(
        *("register", opened(yaml_path), ["select", ["View"]], "panel"),
        *(["pressed_for", ["build"]], "panel", ["build_of", [300]], "panel"),
        *(["pressed_for", ["build"]], ["build_of", [120]]),
    )
    assert "Build" in before and "Cancel" in before
    assert seconds < 2
    assert "mine, View, tiny" in during
    assert states[-1] == again[-1] == "valid"
    assert {"valid", "Open its page"} <= {*after}
    results = built_checkout / "results/mine_tiny"
    assert [path.name for path in results.iterdir()] == ["View"]
    assert json.loads((results / "View/validation.json").read_text())["valid"]
    assert len(list((results / "View/exr").iterdir())) == 3


def test_the_panel_shows_the_line_of_the_error(blender, built_checkout):
    yaml_path = built_checkout / "configs/scenes/gone.yaml"
    steps = ("register", opened(yaml_path), ["select", ["View"]], ["pressed_for", ["build"]])
    *_, states, texts = blender(*steps, ["build_of", [120]], "panel")
    assert "gone.blend" in states[-1] and "Traceback" not in states[-1]
    assert "gone.blend" in " ".join(texts)


def is_of_group(stat, group):
    """Return whether a process of /proc works in a process group."""
    try:
        state, _, process_group, *_ = stat.read_text().rpartition(")")[2].split()
    except OSError:
        return False
    return int(process_group) == group and state != "Z"


def test_a_cancelled_build_leaves_no_process(blender, built_checkout):
    yaml_path = built_checkout / "configs/scenes/mine.yaml"
    *_, process, _, states = blender(
        *("register", opened(yaml_path), ["select", ["Other"]]),
        *(["set_scene", [], {"plenoforge_preset": "preview"}], ["pressed_for", ["build"]]),
        *(["started", [120]], ["pressed_for", ["cancel_build"]], ["build_of", [60]]),
    )
    assert states[-1] == "cancelled"
    assert not [path for path in Path("/proc").glob("[0-9]*/stat") if is_of_group(path, process)]


def test_a_build_is_refused_until_the_yaml_has_the_rig_as_drawn(blender, project, tmp_path):
    yaml_path = project / "configs/scenes/mine.yaml"
    *_, no_checkout, _, moved = blender(
        *("register", opened(yaml_path), ["select", ["wall"]], ["press", ["build"]]),
        *(["change", ["wall"], {"location__x": 5}], ["press", ["build"]]),
    )
    assert "is no checkout of Plenoforge; choose it in the panel" in no_checkout
    assert "wall: is not in mine.yaml as it is drawn; press Write YAML" in moved


def test_opening_and_writing_leaves_every_scene_yaml_as_it_is(blender, tmp_path):
    for path in SCENES.glob("*.yaml"):
        shutil.copy(path, tmp_path)
    scenes = [tmp_path / path.name for path in SCENES.glob("*.yaml")]
    steps = [step for path in scenes for step in (opened(path), written())]
    assert blender("register", *steps)[1:] == [None] * len(steps)
    for path in scenes:
        assert path.read_text() == (SCENES / path.name).read_text()


def test_a_rig_with_a_head_stays_in_the_yaml_as_it_is(blender, project):
    path = project / "configs/scenes/mine.yaml"
    text = path.read_text()
    camera = "{lens: rectilinear, fov: 60, resolution: [16, 16]}"
    head = f"head: {{left: {{camera: {camera}}}, right: {{camera: {camera}, position: [1, 0, 0]}}}}"
    text = text.replace("rigs:\n", f"rigs:\n  pair: {{type: plane, cameras: [2, 1], {head}}}\n", 1)
    path.write_text(text)
    *_, drawn, _ = blender("register", opened(path), "rigs", written())
    assert drawn.keys() == read_scene(path).rigs.keys() - {"pair_left", "pair_right"}
    assert path.read_text() == text


def test_rigs_are_added_removed_copied_and_renamed(blender, project):
    path = project / "configs/scenes/mine.yaml"
    results = blender(
        "register",
        opened(path),
        ("duplicate", ["wall"]),
        ("press", ["add"], {"type": "ring"}),
        ("change", ["ring_1"], {"plenoforge__title": "circle"}),
        ("delete", ["walk"]),
        written(),
        "rigs",
    )
    assert None is results[-2]
    rigs = read_scene(path).rigs
    assert rigs.keys() == {"around", "wall", "wall_2", "circle"}
    assert rigs["wall_2"].center == (5.1, 2, 1.05)
    assert results[-1].keys() == rigs.keys()


def test_undo_brings_the_drawing_back(blender, project):
    path = project / "configs/scenes/mine.yaml"
    *_, before, _, after, _, _, undone, _, undone_again = blender(
        "register",
        opened(path),
        ("push", ["opened"]),
        "rigs",
        ("type_location", ["around", [1, 0, 0]]),
        "rigs",
        ("type_location", ["around", [2, 0, 0]]),
        "undo",
        "rigs",
        "undo",
        "rigs",
    )
    assert before["around"] != after["around"]
    assert undone == after
    assert undone_again == before


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([("parent", ["around"])], "around: a parent, a constraint or a delta transform moves its"),
        ([("change", ["around"], {"scale": [1, -1, 1]})], "around: its Empty has a negative scale"),
        ([("change", ["wall"], {"plenoforge__title": "a b"})], "rigs: 'a b' is not a name"),
        ([("delete", ["around"])], "rigs: cannot be changed alone"),
        ([("delete", ["wall"])], "reprojections.flat.rigs: there is no rig"),
    ],
)
def test_what_no_yaml_can_say_is_refused_in_one_line(steps, message, blender, project):
    path = project / "configs/scenes/mine.yaml"
    before = path.read_text()
    *_, refused = blender("register", opened(path), *steps, written())
    assert message in refused and "\n" not in refused
    assert path.read_text() == before


def test_the_lock_records_the_saved_blend(blender, project):
    path = project / "configs/scenes/mine.yaml"
    lock = path.with_suffix(".lock.json")
    blend = project / "mine.blend"
    save = ("save", [str(blend)])
    *_, unsaved = blender("register", save, opened(path), ("push", ["opened"]), written())
    assert unsaved == "mine.blend: has changes that are not saved; save it first"
    assert not lock.exists()
    assert blender("register", save, opened(path), save, written())[-1] is None
    sha256 = subprocess.run(["sha256sum", blend], capture_output=True, text=True).stdout.split()[0]
    assert json.loads(lock.read_text()) == {"blend": "mine.blend", "sha256": sha256}


def test_an_undo_after_saving_is_a_change(blender, project):
    """The .blend's file has what was undone. With windows, Blender calls the .blend saved then."""
    blend = str(project / "mine.blend")
    path = project / "configs/scenes/mine.yaml"
    moved = ("type_location", ["around", [1, 0, 0]])
    *_, saved, _, undone, _, saved_again, _, _, _, opened_again = blender(
        *("register", opened(path), ("push", ["opened"]), moved),
        *(("save", [blend]), "is_undone", "undo", "is_undone", ("save", [blend]), "is_undone"),
        *(moved, "undo", ("open_blend", [blend]), "is_undone"),
    )
    assert (saved, undone, saved_again, opened_again) == (False, True, False, False)


def test_a_blend_without_a_yaml_gets_one(blender, tmp_path):
    blend = tmp_path / "character.blend"
    path = tmp_path / "configs/scenes/character.yaml"
    add = ("press", ["add"], {"type": "hemisphere"})
    *_, refused = blender("register", add, written(path))
    assert refused == "the .blend has no file yet; save it, or open a scene YAML"
    save = ("save", [str(blend)])
    assert blender("register", add, save, written(path))[-1] is None
    assert yaml.safe_load(path.read_text())["scene"] == {"blend": "character.blend"}
    assert path.with_suffix(".lock.json").exists()
    assert read_scene(path).rigs["hemisphere_1"].view_count == 50


def test_a_new_yaml_in_the_repository_tells_editors_the_schema(blender, tmp_path):
    schema = tmp_path / "configs/schema/scene.schema.json"
    schema.parent.mkdir(parents=True)
    schema.write_text("{}")
    path = tmp_path / "configs/scenes/character.yaml"
    add = ("press", ["add"], {"type": "hemisphere"})
    save = ("save", [str(tmp_path / "character.blend")])
    assert blender("register", add, save, written(path))[-1] is None
    first_line = path.read_text().splitlines()[0]
    named = first_line.removeprefix("# yaml-language-server: $schema=")
    assert (path.parent / named).resolve() == schema


def test_blender_itself_has_the_looks_of_its_python_module(tmp_path):
    """Blender has its package bpy in scripts/modules, beside its data."""
    package = Path(importlib.util.find_spec("bpy").origin).parent
    (version,) = package.glob("[0-9]*")
    modules = tmp_path / version.name / "scripts" / "modules"
    (modules / "bpy").mkdir(parents=True)
    (modules / "bpy" / "__init__.py").touch()
    for name in ("datafiles", "python"):
        (tmp_path / version.name / name).symlink_to(version / name)
    (tmp_path / "lib").symlink_to(package / "lib")
    code = "from lightfield.imaging import blender_looks; print(blender_looks.looks('AgX'))"
    looks = [
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([*folders, str(ROOT / "scripts")])},
        ).stdout
        for folders in ([], [str(modules)])
    ]
    assert "AgX - Punchy" in looks[0]
    assert looks[1] == looks[0]


def test_light_fields_of_silvrs_addon_become_rigs(blender, run_program, tmp_path):
    """The add-on is not installed when the .blend is read."""
    blend = tmp_path / "old.blend"
    run_program(BLENDER / "silvr_light_fields.py", blend)
    path = tmp_path / "configs/scenes/old.yaml"
    reading = (("open_blend", [str(blend)]), ("press", ["read_silvr"]), ("save", [str(blend)]))
    assert blender("register", *reading, written(path))[1:] == [None] * 4
    fisheye = {"lens": "equidistant", "sensor_size": [36.0, 36.0], "fov": 180.0}
    assert yaml.safe_load(path.read_text())["rigs"] == {
        "LFCuboid": {
            "type": "cuboid",
            "cameras": [10, 30, 10],
            "camera": {**fisheye, "resolution": [2048, 2048]},
            "center": [0, 0, 1.05],
            "rotation": [0, 0, 45],
            "size": [1, 3, 1],
        },
        "LFSphere": {
            "type": "sphere",
            "subdivisions": 4,
            "frames": {"first": 1, "last": 9, "step": 2},
            "camera": {**fisheye, "resolution": [1024, 1024]},
            "center": [0, 0, 1.05],
            "size": 1.45,
        },
        "LFCylinder": {
            "type": "cylinder",
            "cameras": [12, 3],
            "face_inside": True,
            "camera": {
                "lens": "rectilinear",
                "focal_length": 18.0,
                "resolution": [640, 480],
                "sensor_size": [36.0, 27.0],
            },
            "center": [1, 2, 3],
            "size": 2,
        },
        "Wall_of_mine": {
            "type": "plane",
            "cameras": [3, 3],
            "camera": {
                "lens": "rectilinear",
                "focal_length": 18.0,
                "resolution": [1024, 1024],
                "sensor_size": [36.0, 36.0],
            },
        },
    }
    assert {*read_scene(path).rigs} == {"LFCuboid", "LFSphere", "LFCylinder", "Wall_of_mine"}


def test_blender_installs_the_zip_and_nothing_stays(archive, run_program, tmp_path):
    command = BLENDER / "rigs_in_viewport.py"
    steps = [("install", [str(archive)], {})]
    (tmp_path / "steps.json").write_text(json.dumps(steps))
    output = tmp_path / "output.json"
    subprocess.run(
        [sys.executable, command, tmp_path, tmp_path / "steps.json", output],
        check=True,
        env=os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path / "user")},
    )
    (names,) = json.loads(output.read_text())
    assert {"VIEW3D_PT_plenoforge", "Scene.plenoforge", "handler", "plenoforge"} <= {*names}


def test_unregistering_leaves_nothing(blender, project):
    before, *_, after = blender(
        "traces", "register", opened(project / "configs/scenes/mine.yaml"), "unregister"
    )
    assert before == after == []


def test_a_later_version_replaces_all_code_without_a_restart(blender):
    """Blender reloads the first file alone."""
    assert blender("register", "unregister", "reload")[-1] == []
