"""Heads: several cameras with fixed poses on one body, each a rig of its own."""

import json
import math

import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy.spatial.transform import Rotation

from lightfield.configuration import scene_yaml
from lightfield.configuration.heads import with_cameras
from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry.rigs import as_written, from_settings
from lightfield.planning.loading import scene_datasets
from lightfield.settings.base import checked

WIDE = {"lens": "equidistant", "fov": 200, "resolution": [16, 16]}
NARROW = {"lens": "rectilinear", "fov": 60, "resolution": [24, 16]}
BACK_TO_BACK = {
    "front": {"camera": WIDE, "position": [0, 0, -0.02]},
    "back": {"camera": WIDE, "position": [0, 0, 0.02], "rotation": [0, 180, 0]},
}
PAIR = {
    "left": {"camera": NARROW, "position": [-0.06, 0, 0], "rotation": [0, -2, 0]},
    "right": {"camera": WIDE, "position": [0.07, 0.01, -0.02], "rotation": [3, 1.5, -0.5]},
}
BODIES = {
    "path": {
        "type": "path",
        "count": 5,
        "keys": [
            {"position": [0, 0, 1], "rotation": [80, 0, 10]},
            {"position": [1, 2, 1.5], "rotation": [100, 10, 70]},
            {"position": [3, 2, 1], "rotation": [90, -20, 170]},
        ],
    },
    "sphere": {"type": "sphere", "subdivisions": 1, "size": 2, "rotation": [10, 20, 30]},
    "plane": {"type": "plane", "cameras": [3, 2], "look_at": [0.3, 4, 1], "face_inside": False},
}


def cameras_of(body, head, name="car"):
    """Return the rigs of a head's cameras by the cameras' names."""
    expanded = with_cameras({name: from_settings({**body, "head": head})})
    assert [*expanded] == [f"{name}_{camera}" for camera in head]
    return dict(zip(head, expanded.values(), strict=True))


def placed(settings):
    """Return the matrix that a camera's position and rotation in the body's axes give."""
    matrix = np.eye(4)
    angles = settings.get("rotation", [0, 0, 0])
    matrix[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    matrix[:3, 3] = settings.get("position", [0, 0, 0])
    return matrix


def lightfield_of(rig):
    return LightField.from_rig(rig, rig.camera.make())


@pytest.mark.parametrize("head", [BACK_TO_BACK, PAIR], ids=["back to back", "pair"])
@pytest.mark.parametrize("body", BODIES.values(), ids=[*BODIES])
def test_cameras_of_a_head_have_their_poses_on_the_body_at_each_place(body, head):
    bodies = from_settings(body).poses()
    for name, rig in cameras_of(body, head).items():
        lightfield = lightfield_of(rig)
        assert [view.name for view in lightfield.views] == [pose.name for pose in bodies]
        for view, pose in zip(lightfield.views, bodies, strict=True):
            expected = pose.world_from_camera() @ placed(head[name])
            np.testing.assert_allclose(view.world_from_camera, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("head", [BACK_TO_BACK, PAIR], ids=["back to back", "pair"])
def test_lightfield_json_has_the_pose_on_the_body_exactly(head, tmp_path):
    for name, rig in cameras_of(BODIES["path"], head).items():
        lightfield_of(rig).write(tmp_path / "lightfield.json")
        camera = LightField.read(tmp_path / "lightfield.json").head
        assert (camera.head, camera.name) == ("car", name)
        np.testing.assert_allclose(camera.body_from_camera, placed(head[name]), rtol=0, atol=1e-15)


def test_a_rig_without_a_head_says_nothing_of_one():
    assert "head" not in lightfield_of(from_settings({**BODIES["plane"], "camera": WIDE})).content


def test_a_settings_file_keeps_the_place_of_a_camera():
    rig = cameras_of(BODIES["path"], PAIR)["right"]
    assert from_settings(json.loads(json.dumps(as_written(rig)))).poses() == rig.poses()


def test_a_split_takes_the_same_places_for_all_cameras():
    body = {**BODIES["sphere"], "split": {"every": 4}}
    front, back = cameras_of(body, BACK_TO_BACK).values()
    parts = [pose.split for pose in front.poses()]
    assert parts == [pose.split for pose in back.poses()]
    assert parts.count("test") == 3


def test_a_body_that_turns_at_one_place_moves_its_cameras(tmp_path):
    file = tmp_path / "turning.csv"
    file.write_text("name,x,y,z,rx,ry,rz\na,0,0,1,1.5,0,0\nb,0,0,1,1.5,0,1\n")
    body = {"type": "poses", "file": str(file)}
    assert from_settings(body).is_at_one_place()
    assert not cameras_of(body, PAIR)["left"].is_at_one_place()


def test_cameras_move_with_the_body_while_the_shutter_is_open():
    """The body travels ahead and turns. So the one that looks back travels backwards."""
    motion = {"travel": [0, 0, -0.4], "turn": [0, 30, 0]}
    rendered = {"render": {"samples": 1, "camera_motion": motion}}
    body = BODIES["plane"]
    views = {
        name: LightField.from_rig(rig, rig.camera.make(), **rendered).with_exposure().views[0]
        for name, rig in cameras_of(body, BACK_TO_BACK).items()
    }
    middle = from_settings(body).poses()[0].world_from_camera()
    ends = {}
    for time, end in ((-0.5, 0), (0.5, 1)):
        turned = Rotation.from_rotvec([0, math.radians(30) * time, 0]).as_matrix()
        pose = middle.copy()
        pose[:3, 3] += middle[:3, :3] @ [0, 0, -0.4 * time]
        pose[:3, :3] = middle[:3, :3] @ turned
        ends[end] = pose
    for name, view in views.items():
        for end, pose in ends.items():
            expected = pose @ placed(BACK_TO_BACK[name])
            np.testing.assert_allclose(view.exposure[end], expected, atol=1e-10)


# ---- scene YAMLs ----------------------------------------------------------------------------

SCENE = {
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {"car": {"type": "plane", "cameras": [2, 1], "head": PAIR}},
}


def test_each_camera_is_a_dataset(tmp_path, monkeypatch):
    (tmp_path / "heads.yaml").write_text(json.dumps(SCENE))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    monkeypatch.chdir(tmp_path)
    left, right = scene_datasets("heads")
    assert (left.name, right.name) == ("heads/car_left", "heads/car_right")
    assert left.heads == right.heads == "results/heads/heads.json"
    assert left.heads in left.files
    assert (left.rig.camera.lens, right.rig.camera.lens) == ("rectilinear", "equidistant")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"rigs": SCENE["rigs"] | {"car_left": {"type": "plane", "cameras": [1, 1]}}},
            "rigs.car.head.left: becomes the rig car_left, which is there, too",
        ),
        (
            {"exports": {"colmap": {"sources": ["views"], "together": ["car_left", "car_side"]}}},
            "exports.colmap.together: there is no rig 'car_side'",
        ),
        (
            {"exports": {"colmap": {"sources": ["views"], "rigs": ["car"]}}},
            "there is no rig 'car'; it is a head, whose rigs are car_left, car_right",
        ),
        (
            {
                "exports": {
                    "nerf_synthetic": {"sources": ["views"], "together": ["car_left", "car_right"]}
                }
            },
            "rigs.car.head.right.camera: must be as in car_left; see exports.nerf_synthetic",
        ),
        (
            {"exports": {"kalibr": {"sources": ["views"]}}},
            "exports.kalibr.sources: views: the rig car_right sees 200 degrees",
        ),
        (
            {
                "rigs": {"car": {"type": "plane", "cameras": [2, 1], "camera": NARROW}},
                "exports": {"kalibr": {"sources": ["views"], "together": ["car", "cat"]}},
            },
            "exports.kalibr.together: there is no rig 'cat'",
        ),
        (
            {"rigs": {"a": {"type": "plane", "cameras": [2, 1], "camera": NARROW, "mount": {}}}},
            "rigs.a.mount",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_key(changes, expected, tmp_path):
    path = tmp_path / "heads.yaml"
    path.write_text(json.dumps(SCENE | changes))
    with pytest.raises(UserError) as caught:
        scene_yaml.read_scene(path)
    assert expected in str(caught.value)


def test_rigs_of_no_head_have_no_camchain():
    rig = {"type": "plane", "cameras": [2, 1], "camera": NARROW}
    content = SCENE | {
        "rigs": {"a": rig, "b": rig},
        "exports": {"kalibr": {"sources": ["views"], "together": ["a", "b"]}},
    }
    with pytest.raises(UserError, match="the rig a is no camera of a head"):
        checked(TypeAdapter(scene_yaml.Scene), content, "heads.yaml")
