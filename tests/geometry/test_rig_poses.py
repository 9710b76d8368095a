"""Rigs with given poses: paths through keys, free places, stereo pairs, and formats of files."""

import json
import struct
import subprocess
from pathlib import Path

import forks
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.configuration import scene_yaml
from lightfield.core.errors import UserError
from lightfield.geometry import colmap
from lightfield.geometry.rigs import from_settings
from lightfield.geometry.rigs import poses as rig_of_poses
from lightfield.planning.loading import scene_datasets

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
CORNER = [[0, 0, 0], [1, 0, 0], [1, 2, 0.5], [-3, 2, 0.5]]


def places(rig):
    return np.array([pose.position for pose in rig.poses()])


def matrices(rig):
    return np.stack([pose.world_from_camera() for pose in rig.poses()])


def path(keys, count, **more):
    keys = [key if isinstance(key, dict) else {"position": key} for key in keys]
    return from_settings({"type": "path", "keys": keys, "count": count, **more})


# ---- path -----------------------------------------------------------------------------------


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("size", [1, [1, 3, 0.5]])
def test_cameras_are_evenly_spaced_along_a_path_through_its_keys(closed, size):
    many = places(path(CORNER, 20001, closed=closed, size=size))
    ends = np.vstack([many, many[:1]]) if closed else many
    steps = np.linalg.norm(np.diff(ends, axis=0), axis=-1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=1e-4)
    for key in np.array(CORNER) * size:
        assert np.linalg.norm(many - key, axis=-1).min() < steps.mean()
    few = places(path(CORNER, 6, closed=closed, size=size))
    index = np.arange(6) * (20001 / 6 if closed else 4000)
    np.testing.assert_allclose(few, many[np.round(index).astype(int)], atol=steps.mean())
    assert np.allclose(few[0], many[0])


@pytest.mark.parametrize("size", [1, [1, 3, 0.5]])
def test_a_path_is_the_same_from_either_end(size):
    forth, back = (places(path(keys, 41, size=size)) for keys in (CORNER, CORNER[::-1]))
    np.testing.assert_allclose(forth, back[::-1], atol=1e-5)
    assert np.allclose(forth[0], np.array(CORNER[0]) * size)
    assert np.allclose(forth[-1], np.array(CORNER[-1]) * size)


def test_without_rotations_cameras_look_along_the_path_upright():
    turns = matrices(path([[0, 0, 0], [3, 4, 0]], 4))[:, :3, :3]
    np.testing.assert_allclose(turns[:, :, 2], [[-0.6, -0.8, 0]] * 4, atol=1e-9)
    np.testing.assert_allclose(turns[:, :, 1], [[0, 0, 1]] * 4, atol=1e-9)
    curved = path(CORNER, 2001)
    forward = -matrices(curved)[:, :3, 2]
    steps = np.gradient(places(curved), axis=0)
    steps /= np.linalg.norm(steps, axis=-1, keepdims=True)
    np.testing.assert_allclose(forward[1:-1], steps[1:-1], atol=1e-4)
    assert np.allclose(-matrices(path(CORNER, 3, look_at=[9, 9, 9]))[0, :3, 2], 3**-0.5)


def test_rotations_turn_evenly_from_key_to_key():
    turned = {"position": [0, 4, 0], "quaternion_wxyz": [0.5**0.5, 0, 0, 0.5**0.5]}
    rig = path([{"position": [0, 0, 0], "rotation": [0, 0, 0]}, turned], 5)
    angles = np.degrees([pose.rotation for pose in rig.poses()])
    np.testing.assert_allclose(angles, [[0, 0, z] for z in (0, 22.5, 45, 67.5, 90)], atol=1e-9)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ([CORNER[0]], "keys: is .* at least 2"),
        ([CORNER[0], CORNER[0]], "keys: two consecutive keys have the same position"),
        ([CORNER[0], {"position": [1, 1, 1], "rotation": [0, 0, 0]}], "keys: must all have a rot"),
        ([CORNER[0], {"position": [1, 1, 1], "quaternion_wxyz": [0, 0, 0, 0]}], "have a length"),
        ([CORNER[0], {"position": [1, 1, 1], "quaternion_wxyz": [1e200, 0, 0, 0]}], "have a len"),
        ([CORNER[0], CORNER[1], CORNER[0]], "keys: the path turns back at a camera"),
        (
            [{"position": [1, 1, 1], "quaternion_wxyz": [1, 0, 0, 0], "rotation": [0, 0, 0]}] * 2,
            "quaternion_wxyz: does not go with rotation",
        ),
    ],
)
def test_an_invalid_path_is_refused(keys, expected):
    with pytest.raises(UserError, match=expected):
        path(keys, 3).poses()
    with pytest.raises(UserError, match="keys: two consecutive keys have the same position"):
        path(CORNER, 3, size=0)


# ---- random ---------------------------------------------------------------------------------

RANDOM = {"type": "random", "count": 40, "size": [5.8, 5.8, 2.8], "center": [0, 0, 1.5]}


def test_random_places_are_seeded_and_a_thinned_rig_has_the_first_of_them():
    rig = from_settings(RANDOM)
    assert rig.poses() == from_settings(RANDOM).poses()
    assert rig.thinned(7).poses() == rig.poses()[:7]
    assert not np.allclose(places(rig), places(from_settings(RANDOM | {"seed": 1})))
    assert (np.abs(places(rig) - [0, 0, 1.5]) <= [2.9, 2.9, 1.4]).all()
    assert np.ptp(places(rig), axis=0).min() > 2
    up = matrices(rig)[:, :3, 1]
    np.testing.assert_allclose(up, [[0, 0, 1]] * 40, atol=1e-9)
    # These places never change, because datasets are rendered again from them.
    pose = from_settings({"type": "random", "count": 2, "seed": 5}).poses()[1]
    np.testing.assert_allclose(pose.position, [-0.029277, 0.195880, 0.316538], atol=1e-6)
    assert pose.rotation == pytest.approx((np.pi / 2, 0, 4.864468), abs=1e-6)


def free_places(blend, rig, output):
    settings = output.with_name("free_places.json")
    settings.write_text(json.dumps({"rig": rig}))
    arguments = ["--blend", blend, "--settings", settings, "--output", output]
    return subprocess.run(
        [forks.python(), SCRIPTS / "free_places.py", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_free_places_are_in_the_room_and_clear_of_all_that_stands_in_it(room, tmp_path):
    output = tmp_path / "places.json"
    result = free_places(room, RANDOM | {"clearance": 0.6}, output)
    assert result.returncode == 0, result.stderr
    free = places(from_settings(RANDOM).placed(output))
    assert len(np.unique(free, axis=0)) == 40
    # Distances to walls, floor and ceiling, the ball, the ball in the box, and the pillar's axis.
    assert (np.abs(free - [0, 0, 1.5]) <= np.array([3, 3, 1.5]) - 0.6 + 1e-6).all()
    assert np.linalg.norm(free - [2, 1, 0.5], axis=-1).min() > 0.5 + 0.6 - 0.01
    assert np.linalg.norm(free - [2.2, -1.2, 0.35], axis=-1).min() > 0.35 + 0.6
    assert np.linalg.norm(free[:, :2] + 2, axis=-1).min() > 0.2 + 0.6 - 0.01
    # The scene's box lies in the rig's box, so no place has half a metre free.
    narrow = {"type": "random", "count": 3, "size": 0.6, "center": [2.2, -1.2, 0.35]}
    result = free_places(room, narrow | {"clearance": 0.5}, tmp_path / "none.json")
    assert result.returncode == 1
    assert "3 of 3 cameras found no place with 0.5 m of free space in 100 tries" in result.stderr
    assert not (tmp_path / "none.json").exists()


def test_a_random_rigs_places_are_a_file_of_its_dataset(tmp_path, monkeypatch):
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    rigs = {"somewhere": RANDOM | {"camera": camera}}
    content = {"scene": {"builder": "room"}, "render": {"samples": 1}, "rigs": rigs}
    (tmp_path / "somewhere.yaml").write_text(json.dumps(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    monkeypatch.chdir(tmp_path)
    (dataset,) = scene_datasets("somewhere")
    assert dataset.places == "work/somewhere/somewhere/places.json"
    assert dataset.places in dataset.intermediates
    with pytest.raises(UserError, match="frames: does not go with type random"):
        from_settings(RANDOM | {"frames": {"first": 1, "last": 2}})


# ---- stereo ---------------------------------------------------------------------------------


@pytest.mark.parametrize("more", [{}, {"rotation": [10, 20, 30]}, {"look_at": [5, 5, 5]}])
@pytest.mark.parametrize("kind", ["plane", "cylinder"])
def test_a_stereo_pair_stands_on_both_sides_of_its_position(kind, more):
    rig = {"type": kind, "cameras": [3, 2], "size": 2, **more}
    stereo_pair = from_settings(rig)
    pair = from_settings(rig | {"stereo": {"distance": 0.064}})
    assert pair.view_count == 12
    names = [pose.name for pose in pair.poses()]
    assert names == sorted(names)
    assert names[:2] == ["view_0000f_left", "view_0000f_right"]
    left, right = matrices(pair)[::2], matrices(pair)[1::2]
    np.testing.assert_allclose(left[:, :3, :3], matrices(stereo_pair)[:, :3, :3], atol=1e-9)
    np.testing.assert_array_equal(left[:, :3, :3], right[:, :3, :3])
    np.testing.assert_allclose((left + right)[:, :3, 3] / 2, places(stereo_pair), atol=1e-9)
    # In the camera's own axes, the right eye is on the right.
    apart = (right - left)[:, None, :3, 3] @ left[:, :3, :3]
    np.testing.assert_allclose(apart[:, 0], [[0.064, 0, 0]] * 6, atol=1e-9)
    assert len(pair.thinned(4).poses()) == 4


def test_a_stereo_pair_cannot_be_a_cube_map():
    with pytest.raises(UserError, match="stereo: does not go with cube_map"):
        from_settings(
            {"type": "plane", "cameras": [2, 2], "cube_map": True, "stereo": {"distance": 0.1}}
        )


# ---- files ----------------------------------------------------------------------------------

TURNS = Rotation.from_euler("xyz", [[90, 0, 0], [20, -30, 40], [180, 5, -170]], degrees=True)
POSES = np.tile(np.eye(4), (3, 1, 1))
POSES[:, :3, :3] = TURNS.as_matrix()
POSES[:, :3, 3] = [[0, 0, 1], [1.5, -2, 0.25], [-4, 3, 2]]
WXYZ = np.roll(TURNS.as_quat(), 1, axis=-1)


def _csv(folder):
    rows = [
        f"v{i}," + ",".join(map(str, [*POSES[i, :3, 3], *np.round(WXYZ[i], 6)])) for i in range(3)
    ]
    (folder / "poses.csv").write_text("\n".join(["name,x,y,z,qw,qx,qy,qz", *rows]))
    return "poses.csv"


def _transforms(folder, applied=None):
    moved = POSES if applied is None else np.vstack([applied, [0, 0, 0, 1]]) @ POSES
    frames = [
        {"file_path": f"./images/v{i}.png", "transform_matrix": moved[i].tolist()} for i in range(3)
    ]
    content = {"camera_angle_x": 0.7, "frames": frames}
    if applied is not None:
        content["applied_transform"] = applied
    (folder / "transforms.json").write_text(json.dumps(content))
    return "transforms.json"


TURNED = [[0, 1, 0, 2], [-1, 0, 0, 0], [0, 0, 1, -1]]
ENLARGED = [[0, 3, 0, 2], [-3, 0, 0, 0], [0, 0, 3, -1]]
MIRRORED = [[0, 1, 0, 2], [1, 0, 0, 0], [0, 0, 1, -1]]


STRETCHED = [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0]]


def _applied(folder):
    return _transforms(folder, TURNED)


def _changed(folder, applied=None, change=None, **keys):
    """Write a transforms.json, ``change`` each of its matrices, and add ``keys``."""
    file = folder / _transforms(folder, applied)
    content = json.loads(file.read_text())
    for frame in content["frames"]:
        matrix = np.array(frame["transform_matrix"])
        if change:
            change(matrix)
        frame["transform_matrix"] = matrix.tolist()
    file.write_text(json.dumps(content | keys))
    return file.name


def _scaled(folder):
    """nerfstudio scales what its applied_transform has made, and only places."""

    def scale(matrix):
        matrix[:3, 3] *= 0.25

    return _changed(folder, TURNED, scale, applied_scale=0.25)


def _enlarged_with_axes(folder):
    """An applied_transform may scale whole matrices, as nerfstudio's programs apply it."""
    return _changed(folder, ENLARGED)


def _enlarged(folder):
    """It may also scale only the places."""

    def normalise(matrix):
        matrix[:3, :3] /= 3

    return _changed(folder, ENLARGED, normalise)


def _mirrored(folder):
    return _changed(folder, MIRRORED)


def _opencv(folder):
    """MapAnything's cameras look along z, with y down."""

    def turn(matrix):
        matrix[:3, 1:3] *= -1

    return _changed(folder, None, turn, camera_convention="opencv")


def _with_keys_that_place_no_camera(folder):
    """These say how pictures are shown, where instant-ngp trains, and how nerfstudio centres."""
    return _changed(
        folder,
        scale=0.1,
        offset=[0.5, 0.5, 0.2],
        aabb_scale=16,
        aabb=[[0, 0, 0], [1, 1, 1]],
        up=[0, 1, 0],
        n_frames=2,
        orientation_override="none",
        from_mitsuba=False,
        camera_model="OPENCV",
        k1=0.1,
        integer_depth_scale=0.001,
        ply_file_path="points.ply",
    )


def _images():
    for index, matrix in enumerate(POSES):
        yield index + 1, *colmap.pose(matrix), f"folder/v{index}.jpg"


def _colmap_text(folder):
    lines = ["# Image list", ""]
    for number, quaternion, translation, name in _images():
        lines += [" ".join(map(str, [number, *quaternion, *translation, 1, name]))]
        lines += ["" if number == 2 else "1.5 2.5 -1 3.5 4.5 7"]
    (folder / "images.txt").write_text("\n".join(lines))
    return "images.txt"


def _marked(write):
    """Return a writer of the same file, which begins with a byte order mark."""

    def marked(folder):
        path = folder / write(folder)
        path.write_text(path.read_text(), encoding="utf-8-sig")
        return path.name

    return marked


def _colmap_text_without_points(folder):
    """Some programs that write only poses omit the line of an image's points."""
    text = (folder / _colmap_text(folder)).read_text()
    lines = [line for line in text.splitlines() if line and not line.startswith("1.5")]
    (folder / "images.txt").write_text("\n".join(lines))
    return "images.txt"


def _colmap_binary(folder):
    content = struct.pack("<Q", 3)
    for number, quaternion, translation, name in _images():
        content += struct.pack("<i7di", number, *quaternion, *translation, 1)
        content += name.encode() + b"\0" + struct.pack("<Q", number)
        content += struct.pack("<ddq", 1.5, 2.5, -1) * number
    (folder / "images.bin").write_bytes(content)
    return "images.bin"


@pytest.mark.parametrize(
    "write",
    [
        _csv,
        _transforms,
        _applied,
        _scaled,
        _enlarged,
        _enlarged_with_axes,
        _mirrored,
        _opencv,
        _with_keys_that_place_no_camera,
        _marked(_transforms),
        _colmap_text,
        _marked(_colmap_text),
        _colmap_text_without_points,
        _colmap_binary,
    ],
)
def test_poses_of_each_format_are_read(write, tmp_path):
    rig = from_settings({"type": "poses", "file": str(tmp_path / write(tmp_path))})
    assert [pose.name for pose in rig.poses()] == ["v0", "v1", "v2"]
    np.testing.assert_allclose(matrices(rig), POSES, atol=3e-6)


def _rotations(matrix):
    """Make the first 3 × 3 of a matrix a rotation, as programs do that know only rotations."""
    matrix[:3, :3] = np.eye(3)


# The axes of a camera of computer vision (x right, y down, z forward).
FORWARD = POSES @ np.diag([1, -1, -1, 1])


def _kitti():
    lines = [" ".join(f"{number:.6e}" for number in pose[:3].ravel()) for pose in FORWARD]
    return "poses.txt", "\n".join(lines), ["000000", "000001", "000002"]


def _tum():
    turns = Rotation.from_matrix(FORWARD[:, :3, :3]).as_quat()
    times = ["1305031102.1753", "1305031102.2112", "1305031102.2753"]
    lines = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    for time, pose, turn in zip(times, FORWARD, turns, strict=True):
        lines.append(" ".join([time, *(f"{number:.6f}" for number in (*pose[:3, 3], *turn))]))
    return "groundtruth.txt", "\n".join(lines), times


def _kubric():
    camera = {"focal_length": 35.0, "positions": POSES[:, :3, 3].tolist()}
    content = {"camera": camera | {"quaternions": WXYZ.tolist()}, "instances": []}
    return "metadata.json", json.dumps(content), ["rgba_00000", "rgba_00001", "rgba_00002"]


@pytest.mark.parametrize("made", [_kitti, _tum, _kubric])
def test_trajectories_of_data_sets_are_read_and_named_as_their_images(made, tmp_path):
    name, text, names = made()
    (tmp_path / name).write_text(text)
    rig = from_settings({"type": "poses", "file": str(tmp_path / name)})
    assert [pose.name for pose in rig.poses()] == names
    np.testing.assert_allclose(matrices(rig), POSES, atol=3e-6)


EUROC = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []\n1,2,3,4,5,6\n"
CAMERA_PATH = {"camera_path": [{"camera_to_world": list(range(16))}], "render_height": 9}


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("data.csv", EUROC, "is EuRoC's poses of a body and not of a camera"),
        ("a.csv", "#name,x,y,alt,heading,pitch,roll\n", "is a table of RealityScan"),
        ("camera_path.json", json.dumps(CAMERA_PATH), "is a camera path of nerfstudio"),
        ("1.json", '{"t_00": 1, "t_01": 0, "fx": 500}', "is one camera of Polycam"),
        ("other.json", '{"poses": []}', "frames: must be a list of views"),
        ("other.txt", "0 0 0\n", "image 0: must be IMAGE_ID"),
    ],
)
def test_other_formats_are_named_beside_the_formats_that_are_read(
    name, content, expected, tmp_path
):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError) as caught:
        from_settings({"type": "poses", "file": str(tmp_path / name)}).poses()
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / name}: ") and expected in message
    for readable in ("transforms.json", "images.bin", "KITTI", "TUM", "Kubric", "name,x,y,z"):
        assert readable in message


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0\n", "line 2: must be 12 finite numbers"),
        ("0 0 0 0 0 0 0 1\n\n1 0 0 0 0 0 1 1\n", "line 3: quaternion: has the length"),
    ],
)
def test_a_wrong_line_of_a_trajectory_is_named(text, expected, tmp_path):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(UserError, match=rf"a\.txt: {expected}"):
        from_settings({"type": "poses", "file": str(tmp_path / "a.txt")}).poses()


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (["cam0/0001.jpg", "cam1/0001.jpg"], ["cam0_0001", "cam1_0001"]),
        (["rig/a/x/1.png", "rig/b/x/1.png"], ["a_x_1", "b_x_1"]),
        ([r".\images\0001.jpg", r".\images\0002.jpg"], ["0001", "0002"]),
        ([r"..\left\1.jpg", r"..\right\1.jpg"], ["left_1", "right_1"]),
        (["deep/folder/a.png", "b.png"], ["a", "b"]),
    ],
)
def test_equal_file_names_get_as_many_folders_as_they_need(files, names, tmp_path):
    lines = [f"{number} 1 0 0 0 0 0 0 1 {file}\n\n" for number, file in enumerate(files, 1)]
    (tmp_path / "images.txt").write_text("".join(lines))
    frames = [{"file_path": file, "transform_matrix": np.eye(4).tolist()} for file in files]
    (tmp_path / "transforms.json").write_text(json.dumps({"frames": frames}))
    for file in ("images.txt", "transforms.json"):
        rig = from_settings({"type": "poses", "file": str(tmp_path / file)})
        assert [pose.name for pose in rig.poses()] == names


def test_an_image_that_is_listed_twice_is_refused(tmp_path):
    line = "1 1 0 0 0 0 0 0 1 cam0/0001.jpg\n\n"
    (tmp_path / "images.txt").write_text(2 * line)
    with pytest.raises(UserError, match="name: '0001' occurs twice"):
        from_settings({"type": "poses", "file": str(tmp_path / "images.txt")}).poses()


@pytest.mark.parametrize(("angle", "is_warned"), [(6.28, False), (-90, True), (7, True)])
def test_angles_beyond_a_turn_are_warned_of_as_degrees(angle, is_warned, tmp_path):
    (tmp_path / "poses.csv").write_text(f"name,x,y,z,rx,ry,rz\na,0,0,0,1.5,0,{angle}\n")
    rig = from_settings({"type": "poses", "file": str(tmp_path / "poses.csv")})
    warnings = list(rig.warnings())
    assert len(warnings) == is_warned
    if is_warned:
        assert f"poses.csv: its angles reach {abs(angle)}" in warnings[0]


@pytest.mark.parametrize(
    ("applied", "change", "keys", "expected"),
    [
        (STRETCHED, _rotations, {}, "applied_transform: its first 3 × 3 must be a rotation"),
        (MIRRORED, _rotations, {}, "applied_transform: its first 3 × 3 must be a rotation"),
        (np.zeros((3, 4)).tolist(), None, {}, "applied_transform: cannot be inverted"),
        (None, None, {"applied_scale": 0}, "applied_scale: is 0; must be above 0"),
        (None, None, {"applied_scale": [2]}, "applied_scale: must be a finite number"),
        (None, None, {"applied_scale": 1e-300}, r"frames\[0\]: position: must be within"),
        (None, None, {"from_mitsuba": True}, "from_mitsuba: has other axes"),
        (None, None, {"camera_convention": ["opencv"]}, "camera_convention: is .*; must be opengl"),
        (None, None, {"camera_convention": "blender"}, "camera_convention: is 'blender'; must be"),
    ],
)
def test_what_was_done_to_poses_is_named_if_it_cannot_be_undone(
    applied, change, keys, expected, tmp_path
):
    file = tmp_path / _changed(tmp_path, applied, change, **keys)
    with pytest.raises(UserError, match=rf"transforms\.json: {expected}") as error:
        from_settings({"type": "poses", "file": str(file)}).poses()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("more", [{}, {"transform_matrix": np.eye(4).tolist()}])
def test_a_camera_that_moves_while_it_exposes_is_refused(more, tmp_path):
    start = np.eye(4).tolist()
    frame = {"file_path": "a.png", "transform_matrix_start": start, "transform_matrix_end": start}
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps({"frames": [frame | more]}))
    with pytest.raises(UserError, match=r"frames\[0\]: transform_matrix_start: describes a camera"):
        from_settings({"type": "poses", "file": str(file)}).poses()


def test_colmaps_pose_puts_a_point_before_the_camera_that_sees_it():
    """By definition, a world point x is at R x + t, with x right, y down and z forward."""
    for matrix in POSES:
        (w, *xyz), translation = colmap.pose(matrix)
        world = (matrix @ [0.3, 0.2, -5, 1])[:3]
        seen = Rotation.from_quat([*xyz, w]).apply(world) + translation
        np.testing.assert_allclose(seen, [0.3, -0.2, 5], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.csv", "name,x,y,z,qx,qy,qz,qw\n", "row 1: must be .* or name,x,y,z,qw,qx,qy,qz, not"),
        ("a.csv", "name,x,y,z,qw,qx,qy,qz\nv,0,0,0,1,1,0,0", "row 2: quaternion: has the length"),
        ("a.json", '{"frames": [{"transform_matrix": [[1]]}]}', "transform_matrix: must be a list"),
        (
            "a.json",
            '{"frames": [{"file_path": "v", "transform_matrix": '
            "[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}",
            r"frames\[0\]: transform_matrix: its first 3 × 3 must be a rotation",
        ),
        (
            "a.json",
            '{"frames": [{"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}',
            r"frames\[0\]: file_path: must be a text",
        ),
        ("images.txt", "1 1 0 0 0 0 0\n", "image 1: must be IMAGE_ID, QW"),
        ("images.txt", "1 1 0 x 0 0 0 0 1 v.png\n", "image 1: must be a finite number"),
        ("images.bin", "\0" * 7, "is not COLMAP's images.bin, or is cut short"),
        ("images.bin", "\x02" + "\0" * 30, "is not COLMAP's images.bin, or is cut short"),
    ],
)
def test_an_invalid_file_of_poses_is_refused(name, content, expected, tmp_path):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=expected):
        from_settings({"type": "poses", "file": str(tmp_path / name)}).poses()


@pytest.mark.parametrize(
    ("change", "within", "beyond", "expected"),
    [
        (
            lambda pose, by: pose["world_matrix"][0].__setitem__(0, 1 + by),
            4e-5,
            6e-5,
            "without scale",
        ),
        (lambda pose, by: pose["world_matrix"][3].__setitem__(1, by), 9e-5, 1.1e-4, "its last row"),
        (lambda pose, by: pose["rotation"].__setitem__(2, by), 9e-5, 1.1e-4, "the same rotation"),
        (lambda pose, by: pose["position"].__setitem__(0, by), 9e-5, 1.1e-4, "the same place"),
        # Far away, the tolerance is proportional.
        (
            lambda pose, by: pose.update(
                world_matrix=[[1, 0, 0, 100], *np.eye(4)[1:].tolist()], position=[100 + by, 0, 0]
            ),
            9e-3,
            1.1e-2,
            "the same place",
        ),
        (
            lambda pose, by: pose.update(
                world_matrix=[[1, 0, 0, 1e7 + by], *np.eye(4)[1:].tolist()], position=[1e7, 0, 0]
            ),
            0,
            1,
            r"world_matrix\[0\]\[3\]: must be a finite number from -1e.07 to 1e.07",
        ),
    ],
)
def test_poses_may_deviate_as_much_as_files_round(change, within, beyond, expected, tmp_path):
    for by, refused in ((within, False), (beyond, True)):
        pose = {"name": "a", "position": [0, 0, 0], "rotation": [0, 0, 0]}
        pose["world_matrix"] = np.eye(4).tolist()
        change(pose, by)
        file = tmp_path / f"{refused}.json"
        file.write_text(json.dumps({"frames": [pose]}))
        rig = from_settings({"type": "poses", "file": str(file)})
        if refused:
            with pytest.raises(UserError, match=rf"frames\[0\]: .*{expected}"):
                rig.poses()
        else:
            assert len(rig.poses()) == 1


def test_a_quaternions_length_may_deviate_as_much_as_files_round(tmp_path):
    for length, refused in ((1 + 9e-5, False), (1 - 9e-5, False), (1 + 1.1e-4, True)):
        file = tmp_path / f"{length}.csv"
        file.write_text(f"name,x,y,z,qw,qx,qy,qz\na,1,2,3,0,0,0,{length}\n")
        rig = from_settings({"type": "poses", "file": str(file)})
        if refused:
            with pytest.raises(UserError, match=r"quaternion: has the length 1\.00011; must be 1"):
                rig.poses()
        else:
            np.testing.assert_allclose(matrices(rig)[0, :3, :3], np.diag([-1, -1, 1]), atol=1e-12)


def test_a_file_too_large_for_poses_is_not_read(tmp_path, monkeypatch):
    file = tmp_path / "poses.csv"
    file.write_text("name,x,y,z,rx,ry,rz\na,0,0,0,0,0,0")
    size = file.stat().st_size
    monkeypatch.setattr(rig_of_poses, "LARGEST_FILE", size)
    rig = from_settings({"type": "poses", "file": str(file)})
    assert rig.view_count == 1
    monkeypatch.setattr(rig_of_poses, "LARGEST_FILE", size - 1)
    with pytest.raises(UserError, match=r"poses.csv: has .*; must be at most "):
        rig.poses()
