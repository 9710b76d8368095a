"""Hostile settings and files of poses: each is refused in one line, before anything is made."""

import datetime
import json
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml
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
    ("rigs.LFSphere.frames", {"first": 0, "last": 1_000_000}),
    ("rigs.LFSphere.frames", {"first": 0, "last": HUGE}),
    ("rigs.LFSphere.frames", {"first": 5, "last": 1}),
    ("rigs.LFSphere.frames", {"first": 0, "last": 9999, "step": 0}),
    ("rigs.LFSphere.frames", {"first": 0, "last": 9999}),
    ("rigs.LFCuboid.cameras", [2000, 2000, 2000]),
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
    *(("rigs.LFSphere.camera.fov", value) for value in (1e-300, 5, 360.1, "180")),
    *(
        ("render.samples", value)
        for value in ("12:30:45", "010", "0b11", "1,000", "64 ", "sixty", "٣")
    ),
    *(
        ("scene", {"blend": "a.blend", "sha256": value})
        for value in (83, "0123", "A" * 64, "0" * 63, "0" * 65, "g" * 64, 0.5, True, ["0" * 64])
    ),
    *(
        ("scene", {"blend": "a.blend", "url": value})
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
    ("scene", {"blend": "a{b}.blend"}),
    ("scene", {"blend": "a\n.blend"}),
    ("scene", {"blend": "*.blend"}),
    ("scene", {"blend": LONG * 10 + ".blend"}),
    ("scene", {"blend": "a.blend", "url": "file:///etc/passwd"}),
    ("scene", {"blend": "a.blend", "sha256": "0" * 64 + "\n"}),
    ("exports", {"instant_ngp": {"sources": ["perspective"], "offset": [0, 0, 1e31]}}),
    ("render.sa\nmples", 1),
    ("x" * 100_000, 1),
    ("rigs.LFSphere", {"type": "poses", "file": "missing.csv", "camera": CAMERA}),
    ("rigs.LFSphere", {"type": "poses", "file": "/dev/zero", "camera": CAMERA}),
    ("rigs.LFSphere", {"type": "poses", "file": ".", "camera": CAMERA}),
]

SETTINGS = [
    *({"results": value} for value in ("a b", "a;b", "a\n", "$(id)", "a'b", 'a"b', "{a}", "-a")),
    *({"results": value} for value in ("", "a|b", "a>b", "a&b", "a`b", "~", "*", LONG * 10, 7)),
    *({"results": value} for value in ("work", "./work/", "..")),
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
    *({"results": value} for value in ("work/a", "work/../work")),
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
    file.write_text(yaml.safe_dump(changed(*VALUES[number])))
    assert assert_refused(lambda: config.read_scene(file)).startswith(f"{file}: ")


@pytest.mark.parametrize("number", range(len(SETTINGS)))
def test_a_hostile_setting_is_refused(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = {"scenes": ["room"], "preset": "full", "presets": {"full": {}}, **SETTINGS[number]}
    assert assert_refused(lambda: config.load_config(content)).startswith("config.yaml: ")


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
