"""Hostile settings and files of poses: each is refused in one line, before anything is made."""

import datetime
import json
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml
from checkouts import checkout, snakemake
from test_config import RIGHT, SNAKEMAKE, changed

from lightfield.core.errors import UserError
from lightfield.dataset import config
from lightfield.geometry.rigs import from_settings

BOMB = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
LONG = "x" * 300
HUGE = 10**31

TEXTS = {
    "nothing": "",
    "a list": "- a\n",
    "a number": "7\n",
    "an aliases' bomb": "a0: &a0 [x]\n" + BOMB,
    "a bomb in its place": "a0: &a0 [x]\n" + BOMB + "rigs: *a11\n",
    "a loop": "rigs: &a [*a]\n",
    "a loop of mappings": "rigs: &a {b: *a}\n",
    "an unknown alias": "rigs: *nothing\n",
    "depth": "a: " + "[" * 20000 + "]" * 20000,
    "depth of keys": "".join(" " * i + "a:\n" for i in range(300)),
    "size": "a: " + "x" * 10**6,
    "a number of 5000 digits": "a: " + "9" * 5000,
    "a code": "a: !!python/object/apply:os.system [id]\n",
    "a module": "a: !!python/module:os\n",
    "an own tag": "a: !x 1\n",
    "no such date": "a: 2024-13-45\n",
    "no such time": "a: 2024-01-01 25:61:61\n",
    "no such integer": "a: !!int x\n",
    "no such number": "a: !!float x\n",
    "no such binary": "a: !!binary ä\n",
    "a merge": "a: &a {b: 1}\nrigs: {<<: *a}\n",
    "a merge of itself": "a: &a {<<: *a}\n",
    "a merge of a number": "rigs: {<<: 1}\n",
    "a key twice beside a merge": "a: &a {b: 1}\nrigs: {<<: *a, c: 1, c: 2}\n",
    "a key twice": "scene: {builder: room}\nscene: {builder: room}\n",
    "a key that is a list": "? [a, b]\n: 1\n",
    "a key that is a mapping": "? {a: b}\n: 1\n",
    "a key that is a date": "2024-01-01: 1\n",
    "a key that is null": "~: 1\n",
    "a key that is true": "yes: 1\n",
    "two documents": "scene: {builder: room}\n---\nscene: {builder: room}\n",
    "tabs": "scene:\n\tbuilder: room\n",
    "a tab in a list": "rigs:\n  - a\n\t- b\n",
    "a tab in brackets": "scene: {\n\tbuilder: room}\n",
    "an open bracket": "scene: {builder: room\n",
    "an open quote": 'scene: "room\n',
    "a null byte": "scene: {builder: ro\0om}\n",
    "a terminal's code": "scene: \x1b[2J\n",
    "not UTF-8": b"scene: \xff\xfe\n",
    "UTF-16": "scene: {builder: room}\n".encode("utf-16"),
    "an image": bytes(range(256)) * 40,
    "JSON cut short": '{"scene": {"builder": ',
    "a directive": "%YAML 9.9\n---\nscene: 1\n",
}

CAMERA = RIGHT["rigs"]["LFSphere"]["camera"]
SPHERE = RIGHT["rigs"]["LFSphere"]
PERSPECTIVE = RIGHT["reprojections"]["perspective"]
NOT_A_NUMBER = [float("nan"), float("inf"), -float("inf"), 1e31, -1e31, "1e31", True, None, [], {}]
NOT_A_NAME = ["a\n", LONG, "..", ".hidden", "-rf", "a b", "a/b", "a;b", "$(id)", "ä", "", "a\0"]

# Settings of a scene YAML: the key, its value, and the key that the message begins with, where that
# is another one.
VALUES = [
    *(("render.samples", value) for value in [*NOT_A_NUMBER[:-3], HUGE, -1, 0.5, b"1"]),
    *(("render.seed", value) for value in (HUGE, -1, 1.5, datetime.date(2024, 1, 1))),
    *(("render.clamp_indirect", value) for value in NOT_A_NUMBER if value is not None),
    *(("render.filter_width", value) for value in (0, 1e31, float("nan"))),
    *(("render.target_error", value) for value in (0, -1, 2, float("nan"), "small")),
    *(("rigs.LFSphere.size", value) for value in (-1, 1e31, float("inf"), [1, 2], "1", True)),
    *(("rigs.LFSphere.center", [0, 0, value]) for value in (1e31, None, "1", True)),
    *(("rigs.LFSphere.center", value) for value in ([0, 0], "0 0 0")),
    *(("rigs.LFSphere.rotation", value) for value in ([float("nan"), 0, 0], [1e31, 0, 0])),
    *(("rigs.LFSphere.subdivisions", value) for value in (0, HUGE, 2.5)),
    *(("rigs.LFSphere.camera.resolution", value) for value in ([0, 1], [HUGE, 1], [1.5, 1], 64)),
    *(("rigs.LFSphere.camera.fov", value) for value in (0, -1, 1e31, float("nan"), True)),
    ("rigs.LFSphere.camera.principal_point", [1e31, 0]),
    ("rigs.LFSphere.camera.sensor_size", 1e31),
    ("rigs.LFSphere.frames", {"first": 0, "last": 1_000_000}, "rigs.LFSphere"),
    ("rigs.LFSphere.frames", {"first": 0, "last": HUGE}),
    ("rigs.LFSphere.frames", {"first": 5, "last": 1}),
    ("rigs.LFSphere.frames", {"first": 0, "last": 9999, "step": 0}),
    ("rigs.LFSphere.frames", {"first": 0, "last": 9999}, "rigs.LFSphere"),
    ("rigs.LFCuboid.cameras", [2000, 2000, 2000], "rigs.LFCuboid"),
    ("rigs.LFCuboid.cameras", [HUGE, 1, 1]),
    ("rigs.LFCuboid.cameras", [0, 1, 1]),
    ("rigs.LFCuboid.camera.lens", LONG),
    *(("rigs", {name: SPHERE}) for name in NOT_A_NAME),
    *(("rigs", {name: SPHERE}) for name in ("trials", "scene.blend", "inventory.json", "f00001")),
    *(("reprojections", {name: PERSPECTIVE}) for name in NOT_A_NAME),
    *(
        ("reprojections", {name: PERSPECTIVE})
        for name in ("render", "exr", "report", "exports", "panorama", "f00001", "a.json", "a.txt")
    ),
    ("reprojections.perspective.samples", HUGE),
    ("reprojections.perspective.exposure", 1e31),
    ("reprojections.perspective.reinhard", 1e31),
    ("reprojections.perspective.reinhard", 1e-30),
    ("reprojections.perspective.rotation", [0, 0, 1e31]),
    *(
        ("reprojections.perspective.camera.focal_length", value)
        for value in (1e31, 1e-300, 5e-324, 0, -0.0, "1e-300", "12:30", [50])
    ),
    *(
        ("reprojections.perspective.camera.sensor_size", value)
        for value in (1e-300, 0, [36, 1e-300], [36], [36, 24, 1], "36")
    ),
    *(
        ("rigs.LFSphere.camera", {"lens": "rectilinear", "resolution": [8, 8], **keys})
        for keys in (
            {"fov": 179.9999999},
            {"fov": 1e-300},
            {"focal_length": 0.5},
            {"focal_length": 50, "sensor_size": 0.5},
            {"focal_length": 50, "fov": 40},
            {},
        )
    ),
    *(("rigs.LFSphere.camera.fov", value, "rigs.LFSphere.camera") for value in (1e-300, 5)),
    *(("rigs.LFSphere.camera.fov", value) for value in (360.1, "180")),
    *(
        ("render.samples", value)
        for value in ("12:30:45", "010", "0b11", "1,000", "64 ", "sixty", "٣")
    ),
    *(
        ("scene", {"blend": "a.blend", "sha256": value}, "scene.sha256")
        for value in (83, "0123", "A" * 64, "0" * 63, "0" * 65, "g" * 64, 0.5, True, ["0" * 64])
    ),
    *(
        ("scene", {"blend": "a.blend", "url": value}, "scene.url")
        for value in ("ftp://a/b", "//a/b", " http://a", "javascript:0", 7, "")
    ),
    *(("scene.builder", value) for value in ("Room", "room ", "ro-om", "library", "__init__", 7)),
    ("reprojections.perspective.rigs", ["x\ny"]),
    ("scene.builder", "../../etc/passwd"),
    ("scene.builder", "room\n"),
    ("scene.frame", HUGE),
    ("scene.parameters", {"seed": -1}),
    ("scene.parameters", {"detail": float("nan")}),
    ("scene.parameters", {"detail": b"\xff"}),
    ("scene.parameters", {"detail": datetime.date(2024, 1, 1)}),
    ("scene", {"blend": "a{b}.blend"}, "scene.blend"),
    ("scene", {"blend": "a\n.blend"}, "scene.blend"),
    ("scene", {"blend": "*.blend"}, "scene.blend"),
    ("scene", {"blend": LONG * 10 + ".blend"}, "scene.blend"),
    ("scene", {"blend": "a.blend", "url": "file:///etc/passwd"}, "scene.url"),
    ("scene", {"blend": "a.blend", "sha256": "0" * 64 + "\n"}, "scene.sha256"),
    ("exports", {"instant_ngp": {"sources": ["perspective"], "offset": [0, 0, 1e31]}}),
    ("render.sa\nmples", 1, "render: sa\\nmples"),
    ("x" * 100_000, 1, "is larger than 65 kB"),
    ("rigs.LFSphere", {"type": "poses", "file": "missing.csv", "camera": CAMERA}),
    ("rigs.LFSphere", {"type": "poses", "file": "/dev/zero", "camera": CAMERA}),
    ("rigs.LFSphere", {"type": "poses", "file": ".", "camera": CAMERA}),
    *(("render.max_bounces", value) for value in (-1, 1025, 1.5, True, "8")),
    *(("render.adaptive_threshold", value) for value in (-0.1, 1.1, float("nan"), "0")),
    *(("render.denoise", value) for value in ("yes", 1, "auto")),
    *(("render.denoise_quality", value) for value in ("best", 1, True)),
    ("render.denoise_prefilter", "High"),
    *(("render.passes", value) for value in (["Normal"], "normal", [1], ["normal"] * 2, ["depth"])),
    *(("render.depth", value) for value in ("w", True, 0)),
    ("render.transparent", "no"),
    ("render.light_tree", 1),
    ("render.guiding", "cpu"),
    *(("render.motion_blur", value) for value in ("half", -1)),
    ("render.target_error", {"value": 0}, "render.target_error.value"),
    ("render.target_error", {"denoise": "never"}, "render.target_error"),
    ("render.target_error", {"value": 0.1, "denoise": "always"}, "render.target_error.denoise"),
    ("render.depth_of_field", True),
    *(("render", value) for value in (None, "fast")),
    *(("rigs", value) for value in ({}, [])),
    *(("rigs.A", value) for value in ("sphere", 7, [], {})),
    *(
        ("rigs.A", {"type": value}, "rigs.A.type")
        for value in ("cone", "Plane", None, 1, ["plane"])
    ),
    *(
        ("rigs.LFSphere.stereo", {"distance": value}, "rigs.LFSphere.stereo.distance")
        for value in (0, -1, 1001)
    ),
    *(("rigs.LFSphere.stereo", value) for value in ({}, 0.065)),
    ("rigs.LFSphere.stereo", {"distance": 1, "omnidirectional": True}),
    *(("rigs.LFSphere.split", value) for value in ("even", "train", True, {"test": ["nobody"]})),
    *(("rigs.LFSphere.split", {"every": value}, "rigs.LFSphere.split.every") for value in (1, 2.5)),
    *(("rigs.LFSphere.look_at", value) for value in ([0, 0], "origin", [float("nan")] * 3)),
    *(("rigs.LFSphere.face_inside", value) for value in (1, "no")),
    ("rigs.LFSphere.cube_map", "yes"),
    ("rigs.LFSphere.radius", 1),
    *(
        ("rigs.A", {"type": "plane", "camera": CAMERA, "cameras": value}, "rigs.A.cameras")
        for value in ([0, 1], [2001, 1], [2], [2, 2, 2], "2x2", [2, 1.5], [True, 2])
    ),
    *(
        ("rigs.A", {"type": kind, "camera": CAMERA, "count": 4, key: value}, f"rigs.A.{key}")
        for kind, key, value in (
            ("hemisphere", "count", 0),
            ("hemisphere", "count", 100_001),
            ("hemisphere", "elevation", [10, 91]),
            ("hemisphere", "elevation", [50, 10]),
            ("hemisphere", "pattern", "spiral"),
            ("ring", "count", 2.0),
            ("ring", "elevation", 91),
            ("ring", "elevation", [0, 1]),
            ("spiral", "turns", 0),
            ("spiral", "turns", 1001),
            ("spiral", "elevation", 10),
            ("path", "keys", []),
            ("path", "keys", [{}]),
            ("path", "keys", "a.csv"),
            ("path", "keys", [{"position": [0, 0, 0], "quaternion_wxyz": [0, 0, 0, 0]}] * 2),
            ("random", "count", HUGE),
            ("random", "seed", -1),
            ("random", "seed", 0.5),
        )
    ),
    *(
        ("reprojections.perspective.camera", {"resolution": [8, 8], "lens": lens, **keys})
        for lens, keys in (
            ("pinhole", {"fov": 60}),
            (None, {"fov": 60}),
            ("rectilinear", {"fov": 60, "resolution": "8x8"}),
            ("rectilinear", {"fov": 60, "resolution": [65537, 8]}),
            ("rectilinear", {"fov": 60, "principal_point": "centre"}),
            ("equirectangular", {"longitude": [90, -90]}),
            ("equirectangular", {"longitude": [0, 0]}),
            ("equirectangular", {"latitude": [0, 91]}),
            ("kannala_brandt", {"focal_length": 10, "coefficients": [1]}),
            ("kannala_brandt", {"focal_length": 10, "coefficients": [float("nan"), 0, 0, 0]}),
            ("polynomial", {"fov": 120, "coefficients": "abc"}),
            ("polynomial", {"fov": 361, "coefficients": [0, -0.1, 0, 0, 0]}),
            ("equisolid", {"fov": 120, "focal_length": 0}),
            ("stereographic", {"fov": 360}),
            ("orthographic", {"fov": 181}),
        )
    ),
    *(("reprojections.perspective", value) for value in ("rectilinear", None, [])),
    *(("reprojections.perspective.rigs", value) for value in ([], "LFSphere", ["Nobody"], [7])),
    *(("reprojections.perspective.samples", value) for value in (0, 65, 1.5)),
    *(("reprojections.perspective.bits", value) for value in (10, "8", True)),
    *(("reprojections.perspective.format", value) for value in ("jpg", "PNG", 7)),
    *(("reprojections.perspective.filter", value) for value in ("gauss", 1)),
    *(
        ("reprojections.perspective.exposure", value)
        for value in ([], [0, 0], [101], "auto", -101, [0] * 33)
    ),
    *(("reprojections.perspective.passes", value) for value in (["albedo"], ["Normal"], "normal")),
    *(("exports", value) for value in ([], "colmap")),
    ("exports.nerf", {}),
    *(("exports.colmap", value) for value in (None, [])),
    *(
        (f"exports.{name}", {"sources": ["perspective"], key: value}, f"exports.{name}.{key}")
        for name, key, value in (
            ("colmap", "points", 0),
            ("colmap", "points", 1.5),
            ("colmap", "format", "csv"),
            ("colmap", "depth", 1),
            ("colmap", "sources", []),
            ("colmap", "sources", ["nowhere"]),
            ("colmap", "sources", "perspective"),
            ("nerfstudio", "exposure", 101),
            ("nerfstudio", "reinhard", 0),
            ("instant_ngp", "scale", 0),
            ("instant_ngp", "scale", float("inf")),
            ("instant_ngp", "aabb_scale", 3),
            ("instant_ngp", "aabb_scale", 256),
            ("instant_ngp", "bounds", "all"),
            ("instant_ngp", "render_aabb", [[0, 0, 0]]),
            ("instant_ngp", "render_aabb", [[1, 1, 1], [0, 0, 0]]),
            ("opendibr", "format", "mp4"),
        )
    ),
    *(("flow", value) for value in (True, {"pairs": "all"}, {}, [])),
    *(("report.panorama", value) for value in ("yes", 1)),
    *((key, value) for key in ("description", "licence", "credit") for value in (7, ["a"])),
    *(("scene.parameters.detail", value) for value in (0, 1.1, "1")),
    *(("scene.parameters.seed", value) for value in (2**63, "7", 0.0)),
    *(("scene.frame", value) for value in (-1, 1048575, 1.0, "last", "file")),
    *(("scene", value) for value in (None, [], {})),
    ("scene.view_layers", ["a"]),
    ("scene.allow_missing", True),
    ("scene.scene_name", "a"),
]

# Settings of config.yaml; the message begins with the first key.
SETTINGS = [
    *({"results": value} for value in ("a b", "a;b", "a\n", "$(id)", "a'b", 'a"b', "{a}", "-a")),
    *({"results": value} for value in ("", "a|b", "a>b", "a&b", "a`b", "~", "*", LONG * 10, 7)),
    {"results": ".."},
    *({"work": value} for value in ("a b", ".", "/", "\0", None, ["a"], {"a": "b"})),
    *(
        {key: value}
        for key in ("results", "work")
        for value in (
            ".git",
            "scripts",
            "scripts/lightfield",
            "a/../configs",
            ".snakemake/a",
            "a/.git",
        )
    ),
    *({"work": value} for value in ("results", "results/smoke", "./results/../results/a")),
    *({"work": "a", "results": value} for value in ("a", "./a/", "a/b", "a/../a")),
    {"results": str(config.ROOT / "rules")},
    {"results": str(config.ROOT / "README.md")},
    *(
        {"scenes": [value]}
        for value in ("a.b", "tables", "logs", "benchmarks", "removed", *NOT_A_NAME)
    ),
    {"scenes": ["a", "a"]},
    {"scenes": []},
    {"scenes": {}},
    {"rigs": ["a\n"]},
    {"preset": datetime.date(2024, 1, 1)},
    {"presets": {"full": {}, LONG: {}}},
    {"presets": {"full": {"samples": 1e31}}},
    {"presets": {"full": {"views": 0}}},
    {"views_per_shard": HUGE},
    {"views_per_shard": -1},
    {"energy": {"watts": 1e31}},
    {"energy": {"price_per_kwh": float("nan")}},
    {"device": "cpu\n"},
    *({"preset": value} for value in ("Full", "nope", 7, None, ["full"])),
    *({"presets": value} for value in ({}, [], {"full": None}, {"Full": {}})),
    *(
        {"presets": {"full": {key: value}}}
        for key, value in (
            ("resolution", 0),
            ("denoise", "yes"),
            ("sample", 1),
            ("views", 1.5),
            ("samples", 2**31),
        )
    ),
    *({"views_per_shard": value} for value in (0, 1.5, "all", "10", True)),
    *({"package_gigabytes": value} for value in (0, -1, "2", float("inf"))),
    *({"accept_blend": value} for value in ("yes", 1, None)),
    *({"device": value} for value in ("GPU", "gpu", 0, ["cpu"])),
    *({"energy": value} for value in (65, {"cores": 0}, {"cores": "all"}, {"price": 1})),
    *({"energy": {"currency": value}} for value in ("x" * 21, 7)),
    *({"rigs": value} for value in ([], "a b", ["a", "a"], 7, {"a": 1})),
    *({"scenes": value} for value in (7, True, [7], [["a"]], "a/b")),
    {"scene": "room"},
    {"results": True},
    {"work": 7.5},
]

EYE = np.eye(4).tolist()
HALF_TURN = [[-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def moved(row, column, value):
    """Return the unit matrix with one number changed."""
    matrix = np.eye(4).tolist()
    matrix[row][column] = value
    return matrix


POSES = [
    *(
        {"world_matrix": moved(*place)}
        for place in [(0, 0, 2), (0, 1, 0.01), (2, 2, -1), (0, 0, 0)]
    ),
    *({"world_matrix": moved(*place)} for place in [(3, 3, 0), (3, 0, 1), (1, 3, 1e31)]),
    *({"world_matrix": moved(0, 0, value)} for value in [*NOT_A_NUMBER, "x", HUGE, 10**400]),
    {"world_matrix": np.zeros((4, 4)).tolist()},
    {"world_matrix": np.eye(3).tolist()},
    {"world_matrix": "unit"},
    {"world_matrix": [[1]]},
    {"world_matrix": EYE, "position": [0, 0, 0], "rotation": [0, 0, 0.01]},
    {"world_matrix": EYE, "position": [0, 0, 0.01], "rotation": [0, 0, 0]},
    {"world_matrix": EYE, "position": [0, 0, 0]},
    {"world_matrix": HALF_TURN, "position": [0, 0, 0], "rotation": [0, 0, 0]},
    {"position": [0, 0, 1e31], "rotation": [0, 0, 0]},
    {"position": [0, 0, 0], "rotation": [0, 0, "π"]},
    {"position": [0, 0], "rotation": [0, 0, 0]},
    {"position": {}, "rotation": [0, 0, 0]},
    {},
    *({"name": name, "world_matrix": EYE} for name in ("a\n", "a/b", "..", "", " ", LONG, 7, None)),
    [],
    "a",
    None,
]

POSES_TEXTS = {
    "deep.json": "[" * 10**5,
    "nan.json": '{"frames": [{"name": "a", "position": [NaN, 0, 0], "rotation": [0, 0, 0]}]}',
    "list.json": "[]",
    "frames.json": '{"frames": {}}',
    "digits.json": '{"frames": [' + "9" * 5000 + "]}",
    "latin.json": b'{"frames": "\xe4"}',
    "empty.csv": "",
    "binary.csv": bytes(range(256)),
    "null.csv": "name,x,y,z,rx,ry,rz\na\0,0,0,0,0,0,0\n",
    "line.csv": "name,x,y,z,rx,ry,rz\n" + "x" * 10**6,
    "far.csv": "name,x,y,z,rx,ry,rz\na,1e31,0,0,0,0,0\n",
    "infinite.csv": "name,x,y,z,rx,ry,rz\na,inf,0,0,0,0,0\n",
}


def assert_refused(read):
    """Assert that the settings or poses are refused, and in one line that a person can read."""
    with pytest.raises(UserError) as caught:
        read()
    message = str(caught.value)
    assert message.isprintable() and len(message) <= 2001
    # Nobody is shown a regular expression.
    assert not re.search(r"\^[\[\\\w]|\]\*?\$", message), message
    return message


@pytest.mark.parametrize("name", TEXTS)
def test_a_hostile_text_is_no_scene(name, tmp_path):
    file, text = tmp_path / "hostile.yaml", TEXTS[name]
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    assert assert_refused(lambda: config.read_scene(file)).startswith(f"{file}: ")


@pytest.mark.parametrize("number", range(len(VALUES)), ids=lambda n: f"{n}-{VALUES[n][0][:40]}")
def test_a_hostile_value_is_refused(number, tmp_path):
    file = tmp_path / "hostile.yaml"
    path, value, *named = VALUES[number]
    file.write_text(yaml.safe_dump(changed(path, value)))
    message = assert_refused(lambda: config.read_scene(file))
    assert message.startswith(f"{file}: {named[0] if named else path}")


@pytest.mark.parametrize("number", range(len(SETTINGS)))
def test_a_hostile_setting_is_refused(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = {"scenes": ["room"], "preset": "full", "presets": {"full": {}}, **SETTINGS[number]}
    key = next(iter(SETTINGS[number]))
    message = assert_refused(lambda: config.load_config(content))
    assert message.startswith(f"config.yaml: {key}")


@pytest.mark.parametrize("number", range(len(POSES)))
def test_a_hostile_pose_is_refused(number, tmp_path):
    frame = POSES[number]
    if isinstance(frame, dict):
        frame = {"name": "b", **frame}
    file = tmp_path / "poses.json"
    file.write_text(json.dumps({"frames": [{"name": "a", "world_matrix": EYE}, frame]}))
    rig = from_settings({"type": "poses", "file": str(file)})
    assert assert_refused(rig.poses).startswith(f"{file}: frames[1]")


@pytest.mark.parametrize("name", POSES_TEXTS)
def test_a_hostile_file_of_poses_is_refused(name, tmp_path):
    file, text = tmp_path / name, POSES_TEXTS[name]
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    rig = from_settings({"type": "poses", "file": str(file)})
    assert assert_refused(rig.poses).startswith(f"{file}: ")


# Runs a command and prints the most memory that it had. In a process of its own: Linux counts what
# the starting process had, which is pytest's.
MEASURED = """
import resource, subprocess, sys
status = subprocess.run(sys.argv[1:], stdout=sys.stderr).returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(status)
"""


CHOICE = "scenes: hostile\nrigs: all\npreset: full\n"


@pytest.mark.parametrize(
    ("text", "own", "arguments"),
    [
        ("a0: &a0 [x]\n" + BOMB + "rigs: *a11\n", CHOICE, []),
        (
            yaml.safe_dump(changed("rigs.LFSphere.frames", {"first": 0, "last": 1_000_000})),
            *(CHOICE, []),
        ),
        (yaml.safe_dump(RIGHT), CHOICE, ["work=a;id"]),
        (yaml.safe_dump(RIGHT), CHOICE + "views_per_shard: 12:30\n", []),
        (yaml.safe_dump(RIGHT), CHOICE + "presets: {full: {samples: 1:30}}\n", []),
        ("", "a0: &a0 [x]\n" + BOMB, []),
    ],
)
@pytest.mark.slow
def test_a_hostile_plan_ends_with_one_line_and_little_memory(text, own, arguments, tmp_path):
    """In a user's own folder, where config.yaml is the user's."""
    (tmp_path / "configs/scenes").mkdir(parents=True)
    (tmp_path / "configs/scenes/hostile.yaml").write_text(text)
    (tmp_path / "config.yaml").write_text(own)
    words = ("-n", "--cores", "1", "--snakefile", config.ROOT / "Snakefile")
    command = [SNAKEMAKE, *words, *(["--config", *arguments] if arguments else [])]
    run = subprocess.run(
        [sys.executable, "-c", MEASURED, *map(str, command)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode != 0
    *lines, largest = (run.stderr + run.stdout).splitlines()
    header = ("host: ", "Using workflow specific profile ", "Config file ")
    assert [line for line in lines if not line.startswith(header)] == [lines[-1]]
    assert lines[-1].startswith("error: ")
    # In KiB, but for macOS.
    assert int(largest) * (1 if sys.platform == "darwin" else 1024) < 500e6
    assert not (tmp_path / "results").exists() and not (tmp_path / "work").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"scenes: [garden]\n\tpreset: full\n", "line 2, column 1: is indented with a tab"),
        (b"scenes: [garden\n", "line 2, column 1"),
        (b"- garden\n", "must be a mapping"),
        (b"", "must be a mapping"),
        (b"\xff\xfe", "cannot be read as YAML"),
        (None, "cannot be read as YAML"),
    ],
)
def test_what_is_wrong_with_the_checkouts_own_config_is_one_line(text, problem, tmp_path):
    folder = checkout(tmp_path)
    if text is None:
        (folder / "config.yaml").unlink()
    else:
        (folder / "config.yaml").write_bytes(text)
    run = snakemake(folder, "--dry-run")
    said = (run.stdout + run.stderr).splitlines()
    assert run.returncode != 0
    assert said[-1].startswith("error: ") and "config.yaml: " in said[-1] and problem in said[-1]
    assert len(said) <= 2
