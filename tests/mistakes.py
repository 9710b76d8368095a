"""One table of mistakes that users make: in which file, under which key, and what is allowed.

test_mistakes.py reads each file with its mistake. To report an unrefused mistake, add a row.
"""

import copy
import datetime
from typing import Any, NamedTuple

import numpy as np

from lightfield.core.names import ROOT

RIGHT = {
    "scene": {"builder": "room"},
    "render": {"samples": 64},
    "rigs": {
        "LFSphere": {
            "type": "sphere",
            "subdivisions": 4,
            "camera": {"lens": "equidistant", "fov": 180, "resolution": [2048, 2048]},
        },
        "LFCuboid": {
            "type": "cuboid",
            "cameras": [10, 30, 10],
            "camera": {"lens": "equirectangular", "resolution": [4096, 2048]},
        },
    },
    "reprojections": {
        "perspective": {
            "rigs": ["LFSphere"],
            "camera": {"lens": "rectilinear", "focal_length": 18, "resolution": [256, 256]},
        }
    },
    "exports": {"instant_ngp": {"sources": ["perspective"]}},
}

# What the author of a dataset says to publish it.
PUBLISH = {
    "creators": [{"name": "Ada Lovelace"}],
    "licence": "CC-BY-4.0",
    "url": "https://example.org/dataset",
    "publisher": "Zenodo",
    "date": "2026-11-30",
    "limitations": "Few pixels.",
    "biases": "One room.",
    "personal_information": "None.",
    "use_cases": "Tests.",
    "social_impact": "None.",
}

CHESSBOARD = {"type": "chessboard", "squares": [5, 4], "square": 0.04}
CHARUCO = {"type": "charuco", "squares": [5, 4], "square": 0.04, "marker": 0.03}
APRILGRID = {"type": "aprilgrid", "tags": [4, 3], "tag": 0.06}

# Instead of a value: removes the key. Its text is the same in all processes of the tests.
REMOVE = ...


def changed(path, value):
    """Return the right YAML's content with the value at a dotted path replaced or removed."""
    content = copy.deepcopy(RIGHT)
    *parents, last = path.split(".")
    part = content
    for key in parents:
        part = part.setdefault(key, {})
    if value is REMOVE:
        del part[last]
    else:
        part[last] = value
    return content


class Mistake(NamedTuple):
    """A wrong value under a key of a file, or a wrong text for the file, and its message.

    The message goes on after the file's name with ``said``. It contains ``allowed``.
    """

    file: str
    key: str
    value: Any
    said: str
    allowed: str = ""

    def __str__(self) -> str:
        return f"{self.file}-{self.key[:40]}-{str(self.value)[:30]}"


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
    "no such bool": "a: !!bool x\n",
    "no such timestamp": 'a: !!timestamp "x"\n',
    "an empty integer": 'a: !!int ""\n',
    "an empty number": 'a: !!float ""\n',
    "half a character": 'a: "\\ud800"\n',
    "half a character in a key": '"\\ud800": 1\n',
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

EXPLAINED_TEXTS = [
    ("render: {samples: 4\n", ":2:1: "),
    ("render: {samples: 4}\nrender: {samples: 5}\n", "the key 'render' is given twice"),
    ("render: {<<: {samples: 4, samples: 5}}\n", "the key 'samples' is given twice"),
    (
        "a: &a {samples: 4}\nrender: {<<: *a, <<: {samples: 5}}\n",
        "the key '<<' is given twice",
    ),
    ("1: 2\n", "the key 1 is not a text"),
    ("- a\n- b\n", 'is ["a", "b"]; must be a mapping'),
    ("{}\n---\n{}\n", ":2:1: expected a single document in the stream, but found another"),
    ("scene:\n\tbuilder: room\n", ":2:1: is indented with a tab; use spaces"),
    ("a:\n  - b\n\t- c\n", ":3:1: is indented with a tab; use spaces"),
    ("scene: {blend: a.blend, sha256: 0123}\n", 'scene.sha256: is "0123"; must be 64 hex'),
    ("render: {samples: 12:30:45}\n", 'render.samples: is "12:30:45"; must be a whole number'),
    ("render: {samples: 010}\n", 'render.samples: is "010"; must be a whole number'),
    ("render: {samples: 0b11}\n", 'render.samples: is "0b11"; must be a whole number'),
    (
        "scene: {builder: room}\n"
        "render: {samples: 1}\n"
        "reprojections: {flat: {camera: {lens: rectilinear, focal_length: 1e-300}}}\n",
        "flat.camera.focal_length: is 1e-300; must be a number at least 0.001",
    ),
    ("render: {clamp_indirect: 1:30.5}\n", 'clamp_indirect: is "1:30.5"; must be a number'),
    ("scene: !!python/object/apply:os.getcwd []\n", "could not determine a constructor"),
    (
        'description: !!timestamp "x"\n',
        ":1:14: description: is 'x', which is not a valid timestamp",
    ),
    (
        "rigs:\n  A:\n    split: !!bool x\n",
        ":3:12: rigs.A.split: is 'x', which is not a valid bool",
    ),
    (
        "rigs: {A: {size: [1, !!float y]}}\n",
        ":1:22: rigs.A.size.[1]: is 'y', which is not a valid float",
    ),
    (
        f"render:\n  samples: {'9' * 60_000}\n",
        ":2:12: render.samples: is '999",
    ),
    (
        f"render:\n  samples: 0x{'f' * 60_000}\n",
        ":2:12: render.samples: is a number with too many digits",
    ),
    (
        # The smallest that is larger than any float.
        f"render:\n  samples: 0x1{'0' * 256}\n",
        ":2:12: render.samples: is a number with too many digits",
    ),
    (
        'description: "a \\ud800"\n',
        ":1:14: description: has '\\ud800', half of a character",
    ),
]

CAMERA = RIGHT["rigs"]["LFSphere"]["camera"]
SPHERE = RIGHT["rigs"]["LFSphere"]
PERSPECTIVE = RIGHT["reprojections"]["perspective"]
NOT_A_NUMBER = [float("nan"), float("inf"), -float("inf"), 1e31, -1e31, "1e31", True, None, [], {}]
NOT_A_NAME = ["a\n", LONG, "..", ".hidden", "-rf", "a b", "a/b", "a;b", "$(id)", "ä", "", "a\0"]

# Wrong settings of a scene YAML: the key, the value, and the key that the message begins with if
# that is another key.
REFUSED = [
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
    ("rigs.LFCuboid.cameras", [200, 200, 100], "rigs.LFCuboid"),
    ("rigs.LFCuboid.cameras", [HUGE, 1, 1]),
    ("rigs.LFCuboid.cameras", [0, 1, 1]),
    ("rigs.LFCuboid.camera.lens", LONG),
    *(("rigs", {name: SPHERE}) for name in NOT_A_NAME),
    *(
        ("rigs", {name: SPHERE})
        for name in (
            *("trials", "published", "scene.blend", "inventory.json", "f00001"),
            # The package of the rig x, a run's lock, a log, a benchmark, and a receipt.
            *("tarclash_x.tar", "run.lock", "splits.log", "x.tsv", "splits.jsonl", "splits.part"),
            "settings",
        )
    ),
    *(("reprojections", {name: PERSPECTIVE}) for name in NOT_A_NAME),
    *(
        ("reprojections", {name: PERSPECTIVE})
        for name in (
            "render",
            "exr",
            "report",
            "exports",
            "mesh",
            "video",
            "panorama",
            "f00001",
            "a.json",
            "a.txt",
            "lightfield.log",
            "settings",
        )
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
    *(
        (
            f"exports.{name}",
            {"sources": ["perspective"]},
            f"exports.{name}.sources: perspective: the rig LFSphere has fewer than two frames",
        )
        for name in ("dnerf", "colmap_frames", "multipleview", "ncore_frames")
    ),
    *(
        (f"exports.{name}", {"sources": ["perspective"], "rate": 0})
        for name in ("neural_3d_video", "miv_frames", "opendibr_frames", "ncore_frames")
    ),
    ("exports.scene_flow", {"sources": ["perspective"]}, "exports.scene_flow.sources: perspective"),
    ("exports.coco", {"sources": ["views"]}, "exports.coco.sources: views lacks the pass object"),
    *(("mesh", value) for value in (None, True, "glb", [])),
    *(("scene.targets", value) for value in (None, True, [], {"a": {}}, {"a/b": CHESSBOARD})),
    *(
        ("scene.targets", {"a": CHESSBOARD | {key: value}}, f"scene.targets.a.{key}")
        for key, value in (
            ("type", "circles"),
            ("squares", [1, 4]),
            ("squares", 4),
            ("squares", [51, 4]),
            ("square", 0),
            ("border", -1),
            ("position", [0, 0]),
            ("rotation", 90),
            ("marker", 0.02),
        )
    ),
    *(
        ("scene.targets", {"a": CHARUCO | {key: value}}, f"scene.targets.a.{key}")
        for key, value in (("marker", 0.04), ("dictionary", "DICT_5x5_250"))
    ),
    *(
        ("scene.targets", {"a": APRILGRID | {key: value}}, f"scene.targets.a.{key}")
        for key, value in (
            ("tags", [50, 50]),
            ("tag", 0),
            ("spacing", 0),
            ("border_bits", 3),
            ("dictionary", "DICT_5X5_250"),
        )
    ),
    *(("mesh.formats", value) for value in ([], ["obj"], "glb", ["glb", "glb"], ["GLB"])),
    *(("video", value) for value in (None, True, "mp4", {}, {"path": "orbit"})),
    *(
        ("video", {"path": "walk", key: value}, f"video.{key}")
        for key, value in (
            ("format", "gif"),
            ("seconds", 0.5),
            ("seconds", 21),
            ("height", 34),
            ("height", 1082),
            ("height", 101),
            ("rigs", []),
            ("rigs", ["LFSpher"]),
        )
    ),
    *(("mesh.rigs", value) for value in ([], "LFSphere", ["LFSpher"])),
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
    ("render.target_error", {"value": 0.1, "of_samples": 4}, "render.target_error"),
    *(
        ("render.target_error", {"of_samples": value}, "render.target_error.of_samples")
        for value in (0, -1, 1.5, "256", "file")
    ),
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
    *(
        ("rigs.A", {"type": "plane", "cameras": [2, 1], **keys}, f"rigs.A.{key}")
        for key, keys in (
            ("camera", {"camera": CAMERA, "head": {"left": {"camera": CAMERA}}}),
            ("cube_map", {"cube_map": True, "head": {"left": {"camera": CAMERA}}}),
            ("stereo", {"stereo": {"distance": 0.1}, "head": {"left": {"camera": CAMERA}}}),
            ("size", {"size": "fit", "head": {"left": {"camera": CAMERA}}}),
            ("center", {"center": "fit", "head": {"left": {"camera": CAMERA}}}),
            ("head", {"head": {}}),
            ("head", {"head": ["left", "right"]}),
            ("head.left", {"head": {"left": {}}}),
            ("head.left.camera.fov", {"head": {"left": {"camera": CAMERA | {"fov": 400}}}}),
            ("head.left.position", {"head": {"left": {"camera": CAMERA, "position": [1, 2]}}}),
            ("head.left.rotation", {"head": {"left": {"camera": CAMERA, "rotation": 90}}}),
            # Blender's limits. The checks of the rig A_left find these.
            ("head.left.camera", {"head": {"left": {"camera": CAMERA | {"fov": 5}}}}),
            (
                "head.left.camera.resolution",
                {"head": {"left": {"camera": CAMERA | {"resolution": [2, 2]}}}},
            ),
            ("split", {"head": {"left": {"camera": CAMERA}}, "split": {"test": ["nobody"]}}),
        )
    ),
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
        (
            "rigs.A",
            {
                "type": "path",
                "camera": CAMERA,
                "count": 4,
                "keys": [{"position": [0, 0, 1]}, {"position": [0, 1, 1]}],
                "imu": value,
            },
            "rigs.A.imu",
        )
        for value in (
            True,
            {},
            {"seconds": 0},
            {"seconds": 1e7},
            {"seconds": 1, "rate": 0},
            {"seconds": 1, "rate": 1e6},
            {"seconds": 1e5},
            {"seconds": 1, "seed": -1},
            {"seconds": 1, "exposure": 0},
            {"seconds": 1, "gyroscope_noise_density": -1},
            {"seconds": 1, "accelerometer_random_walk": 1e4},
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
            ("brown_conrady", {"focal_length": 10, "coefficients": []}),
            ("brown_conrady", {"focal_length": 10, "coefficients": [0.1] * 9}),
            ("brown_conrady", {"focal_length": 10, "coefficients": [0.1], "fov": 181}),
            ("thin_prism_fisheye", {"focal_length": 10, "coefficients": [0.1] * 7}),
            ("fisheye624", {"focal_length": 10, "coefficients": [0.1] * 11}),
            ("fisheye624", {"focal_length": -1, "coefficients": [0.1] * 12}),
            ("division", {"focal_length": 10, "coefficients": 0.1}),
            ("f_theta", {"focal_length": 10, "coefficients": [0.1, 0, 0]}),
            ("fov_model", {"focal_length": 10, "coefficients": [0]}),
            ("fov_model", {"focal_length": 10, "coefficients": [3.2]}),
            ("unified", {"focal_length": 10, "coefficients": [-1]}),
            ("extended_unified", {"focal_length": 10, "coefficients": [1.1, 1]}),
            ("extended_unified", {"focal_length": 10, "coefficients": [-0.1, 1]}),
            ("extended_unified", {"focal_length": 10, "coefficients": [0.5, 0]}),
            ("double_sphere", {"focal_length": 10, "coefficients": [1, 0.5]}),
            ("double_sphere", {"focal_length": 10, "coefficients": [-1, 0.5]}),
            ("double_sphere", {"focal_length": 10, "coefficients": [0, 1.1]}),
            ("ucm", {"focal_length": 10, "coefficients": [0.9]}),
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
    *(("render.camera_motion", value) for value in ({}, {"travel": [0, 0, 0]}, {"rolling": 0.5})),
    *(("render.camera_motion", {"turn": value}) for value in ([0, 180, 0], [0, 1], 5)),
    *(("render.camera_motion", {"travel": [1, 0, 0], "rolling": value}) for value in (0, 1.5)),
    *(("reprojections.perspective.primaries", value) for value in ("acescg", "ACEScg", 7)),
    *(("reprojections.perspective.compression", value) for value in ("zip", "ZIP", "dwaa", 1)),
    *(("reprojections.perspective.look", value) for value in ("agx", None, 7, "Raw - Punchy")),
    *(("sensor", value) for value in ("noise", None, [], {"gain": 1})),
    *(("sensor.sources", value) for value in ([], "views", ["view"], ["views", "views"])),
    *(("sensor.rigs", value) for value in ([], ["Nobody"], ["LFSphere", 7])),
    *(("sensor.bits", value) for value in (0, 17, 8.0, "8")),
    *(("sensor.noise", value) for value in ({}, {"a": 0}, {"a": 1e-12}, {"a": -1}, {"b": 2}, 0.1)),
    *(("sensor.brackets", value) for value in ([], [0], [2, 0], [0, 0], [-99, 0], 1)),
    *(("sensor.vignetting", value) for value in ({}, {"alpha": [1]}, {"alpha": [[0, 0, 0]]})),
    *(("sensor.response", {key: value}) for key, value in (("toe", 0.3), ("center", 1))),
    *(("sensor.colour", value) for value in (0, [0, 0], [9, 0, 0, 0, 0, 0, 0, 0])),
    *(("sensor.exposure", {"range": value}) for value in ([1, 0], [0], [-99, 0], 1)),
    *(("sensor.exposure", {"step": value}) for value in (0, -1, "x")),
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
            ("colmap", "rigs", []),
            ("colmap", "rigs", "LFSphere"),
            ("colmap", "rigs", ["LFSpher"]),
            ("colmap", "rigs", ["LFCuboid"]),
            ("nerfstudio", "exposure", 101),
            ("nerfstudio", "reinhard", 0),
            ("nerfstudio", "normals", 1),
            ("nerfstudio", "objects", []),
            ("nerfstudio", "objects", "Ball"),
            ("coco", "segmentation", 1),
            ("instant_ngp", "scale", 0),
            ("instant_ngp", "scale", float("inf")),
            ("instant_ngp", "aabb_scale", 3),
            ("instant_ngp", "aabb_scale", 256),
            ("instant_ngp", "bounds", "all"),
            ("instant_ngp", "render_aabb", [[0, 0, 0]]),
            ("instant_ngp", "render_aabb", [[1, 1, 1], [0, 0, 0]]),
            ("wai", "exposure", 101),
            ("dust3r", "overlap", 1.1),
            ("focal_stack", "distances", []),
            ("focal_stack", "distances", [0]),
            ("focal_stack", "distances", 2),
            ("focal_stack", "aperture", -1),
            ("focal_stack", "format", "jpg"),
            ("quilt", "focus", 0),
            ("quilt", "row", -1),
            ("quilt", "tiles", [8]),
            ("quilt", "tiles", [0, 6]),
            ("quilt", "aspect", 0),
            ("epipolar_volumes", "depth", 1),
            ("opendibr", "format", "mp4"),
            ("ncore", "points", 0),
            ("lichtfeld", "format", "jpg"),
            ("lichtfeld", "normals", 1),
        )
    ),
    *(("flow", value) for value in (True, {"pairs": "all"}, {}, [])),
    *(("report.panorama", value) for value in ("yes", 1)),
    *((key, value) for key in ("description", "licence", "credit") for value in (7, ["a"])),
    *(("publish", PUBLISH | {"creators": value}) for value in ([], "Ada", [{"orcid": "1"}])),
    *(("publish", PUBLISH | {"date": value}) for value in (2026, "soon", "2026-13-01")),
    *(
        ("publish", PUBLISH | {"url": value})
        for value in ("example.org", 7, "https://a.org/'", "https://a.org/<b>", "https://a.org/ b")
    ),
    ("publish", PUBLISH | {"derived_from": ['https://a.org/"><script>']}),
    *(("publish", PUBLISH | {"licence": value}) for value in ("CC BY", "")),
    *(
        ("publish", PUBLISH | {"doi": value})
        for value in ("https://doi.org/10.1/2", 10.1, '10.1234/"><script>')
    ),
    *(("publish", PUBLISH | {key: ""}) for key in ("limitations", "biases", "use_cases")),
    *(("publish", value) for value in (True, [])),
    *(("scene.parameters.detail", value) for value in (0, 1.1, "1")),
    *(("scene.parameters.seed", value) for value in (2**63, "7", 0.0)),
    *(("scene.parameters.place", value) for value in (-1, "7", 0.5)),
    *(("scene.frame", value) for value in (-1, 1048575, 1.0, "last", "file")),
    *(("scene", value) for value in (None, [], {})),
    ("scene.view_layers", ["a"]),
    ("scene.followed_camera", "view"),
    ("scene.allow_missing", True),
    ("scene.scene_name", "a"),
]

# Wrong settings of a scene YAML, and the message after the file's name.
EXPLAINED = [
    ("family", {}, "family: must have one of seeds and models"),
    ("family", {"seeds": "0-9", "models": "*.glb"}, "family: must have one of seeds and models"),
    ("family", {"models": 7}, "family.models: is 7; must be a text"),
    ("family", {"models": []}, "family.models: is []; must be a text or have at least 1 item"),
    ("family", {"models": ["*.obj", 3]}, "family.models.[1]: is 3; must be a text"),
    ("family", {"seeds": "9"}, 'family.seeds: is "9"; must be the first and the last seed'),
    ("family", {"seeds": 9}, "family.seeds: is 9; must be a text"),
    ("family", {"seeds": "9-0"}, "family.seeds: is '9-0'; must have the smaller seed first"),
    ("family", {"seeds": "0-999999"}, "family.seeds: is '0-999999'; must be at most 100000 seeds"),
    ("family", {"seeds": "0-9", "batch": 0}, "family.batch: is 0; must be a whole number at least"),
    (
        "family",
        {"seeds": "0-9", "corpus": {"splits": {"test": 2}}},
        "family.corpus.splits.test: is 2; must be a number at most 1",
    ),
    (
        "family",
        {"seeds": "0-9", "corpus": {"splits": {"test": 0.6, "validation": 0.5}}},
        "family.corpus.splits: validation and test are 0.5 and 0.6; their sum must be at most 1",
    ),
    (
        "family",
        {"seeds": "0-9", "corpus": {"splits": {"train": 0.9}}},
        "family.corpus.splits.train: unknown key",
    ),
    (
        "family",
        {"seeds": "0-9", "corpus": {"shards": 2}},
        "family.corpus.shards: is 2; must be true or false",
    ),
    (
        "family",
        {"seeds": "0-9", "corpus": {"shard_gigabytes": 0}},
        "family.corpus.shard_gigabytes: is 0; must be a number above 0",
    ),
    ("family", {"seed": "0-9"}, "family.seed: unknown key; did you mean seeds?"),
    (
        "family",
        {"seeds": "0-9", "values": {"samples": {"uniform": [0, 1]}}},
        "family.values: 'samples' is not a key with dots",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"scene.parameters.seed": {"integers": [0, 1]}}},
        "family.values: scene.parameters.seed cannot be drawn, because each member has its own",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"render.samples": {"integers": [9, 1]}}},
        "family.values.render.samples.integers: is [9, 1]; must have the smaller bound first",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"render.samples": {"log_uniform": [0, 1]}}},
        "log_uniform: is [0.0, 1.0]; must be above 0",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"render.samples": {}}},
        "must have one of uniform, log_uniform, integers and choice",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"scene.parameters.detial": {"uniform": [0.5, 1]}}},
        "scene.parameters.detial: unknown key; did you mean detail?",
    ),
    (
        "family",
        {"seeds": "0-9", "values": {"render.samples": {"integers": [0, 4]}}},
        "render.samples: is 0; must be a whole number at least 1",
    ),
    ("family", {"models": "*.glb"}, "scene: must have one of builder, blend, model and dataset"),
    ("family", None, "family: is null"),
    ("render.samples", REMOVE, "render: is missing the key samples"),
    (
        "render",
        {"samples": 4, "light_groups": "each", "denoise": True},
        "render.denoise: does not go with light_groups",
    ),
    (
        "render.target_error",
        {"value": 0.1, "of_samples": 4},
        "must be a number or have either value or of_samples",
    ),
    (
        "render",
        {"target_error": 0.01, "light_groups": ["Lamp"]},
        "render.target_error: may choose to denoise",
    ),
    (
        "render.light_groups",
        {"a": ["Lamp"], "b": ["Lamp"]},
        "render.light_groups: Lamp is in two groups; must be in one",
    ),
    ("render.light_groups", {"a": ["x"], "A": ["y"]}, "render.light_groups: the name a is taken"),
    ("render.light_groups", {"rest": ["x"]}, "render.light_groups: the name rest is taken"),
    ("render.light_groups", {"a b": ["x"]}, "render.light_groups: 'a b' is not a name of at most"),
    ("render.light_groups", {}, "render.light_groups: must have one group or more"),
    ("render.light_groups", "all", 'render.light_groups: is "all"; must be each or a list'),
    ("relight", {"night": {"Lamp": 0}}, "relight.night: needs render.light_groups"),
    ("relight", {"night": {"Lamp": -1}}, "relight.night.Lamp: is -1; must be a number at least 0"),
    ("relight", {"perspective": {}}, "relight.perspective: is the name of a reprojection, too"),
    (
        "reprojections.perspective.relight",
        "night",
        "reprojections.perspective.relight: needs render.light_groups",
    ),
    (
        "reprojections.perspective.passes",
        ["light_groups"],
        "reprojections.perspective.passes: light_groups needs render.light_groups",
    ),
    ("exports.nerfstudio", None, "exports.nerfstudio: is null; must have a value, or be left out"),
    ("rigs.LFSphere", None, "rigs.LFSphere: is null; must be a mapping of keys to values"),
    ("rigs.LFSphere.size", "1m", 'size: is "1m"; must be a number or a list of 3'),
    ("scene.parameters", {"sede": 7}, "scene.parameters.sede: unknown key; did you mean seed?"),
    (
        "scene",
        {"blend": "a.blend", "parameters": {"seed": 1}},
        "scene.parameters: is only for builder, not for blend",
    ),
    (
        "publish",
        {"creators": [{"name": "Ada Lovelace"}], "date": "2026-11-30"},
        "publish.licence: is missing; must be a short name from https://spdx.org/licenses",
    ),
    (
        "publish",
        PUBLISH | {"date": "soon"},
        'publish.date: is "soon"; must be a date such as 2026-11-30',
    ),
    (
        "publish",
        PUBLISH | {"url": 'https://a.org/"><script>'},
        "must be an address that begins with http:// or https://, without blanks, quotes, < and >",
    ),
    (
        "publish",
        PUBLISH | {"licence": "CC BY"},
        'publish.licence: is "CC BY"; must be a short name from https://spdx.org/licenses',
    ),
    ("render.samples", "many", 'render.samples: is "many"; must be a whole'),
    ("render.samples", True, "render.samples: is true; must be a whole number"),
    ("render.clamp_indirect", "10", 'clamp_indirect: is "10"; must be a'),
    ("render.clamp_indirect", float("inf"), "clamp_indirect: is Infinity; must be a"),
    ("render.samples", 1.5, "render.samples: is 1.5; must be a whole number"),
    ("render.samples", 0, "render.samples: is 0; must be a whole number at least 1"),
    (
        "render.samples",
        2**31,
        "render.samples: is 2147483648; must be a whole number at most 2147483647",
    ),
    ("render.sample", 4, "render.sample: unknown key; did you mean samples?"),
    ("render.xyzzy", 4, "render.xyzzy: unknown key; allowed here: samples, "),
    ("scene.builder", "nowhere", 'scene.builder: is "nowhere"; must be one of barbershop'),
    ("scene.builder", "./no.py", 'is "./no.py"; must be the path of a file that exists'),
    ("scene.builder", "a{b}.py", 'is "a{b}.py"; must be a name of small letters'),
    ("scene.builder", ".py", 'is ".py"; must be a name of small letters'),
    ("scene.parameters", {"balls": 3}, "scene.parameters.balls: unknown key; allowed here: seed"),
    ("scene.parameters", 3, "scene.parameters: is 3; must be a mapping of keys to values"),
    ("scene.blend", "a.blend", "scene: must have one of builder, blend, model and dataset"),
    ("scene", {"model": "a.dae"}, 'scene.model: is "a.dae"; must be a path that ends in .fbx'),
    ("scene", {"model": "a{b}.glb"}, 'scene.model: is "a{b}.glb"; must be a path that ends in'),
    (
        "scene",
        {"model": "a.glb", "up": "z"},
        "scene.up: is only for OBJ, PLY and STL; glTF, USD and FBX files define it themselves",
    ),
    (
        "scene",
        {"model": "a.obj", "light": "sun"},
        'scene.light: is "sun"; must be one of softboxes, city',
    ),
    *(
        ("scene", {"model": "a.obj", "light": light}, "sunset, or a path that ends in .hdr or .exr")
        for light in ("sky.png", "sky.{a}.hdr", "a\nb.exr", ".hdr.", "Softboxes")
    ),
    (
        "scene",
        {"model": "a.obj", "light": 3},
        "scene.light: is 3; must be a text: put it in quotes",
    ),
    ("scene.light", "sky.hdr", "scene.light: is only for model"),
    ("scene", {"model": "a.obj", "unit": "mm"}, 'scene.unit: is "mm"; must be box or metres'),
    ("scene", {"model": "a.obj", "ground": 1}, "scene.ground: is 1; must be true or false"),
    ("scene", {"model": "a.obj", "url": "https://a.org/b"}, "scene.url: does not go with model"),
    ("scene", {"model": "a.obj", "parameters": {}}, "scene.parameters: does not go with model"),
    (
        "scene",
        {"model": "a.obj", "frame": "file"},
        "scene.frame: file is only for blend, not for model",
    ),
    (
        "scene",
        {"model": "a.obj", "shared_folder": ["b"]},
        'scene.shared_folder: is ["b"]; must be a text',
    ),
    ("scene.shared_folder", "b", "scene.shared_folder: is only for model"),
    ("scene.light", "city", "scene.light: is only for model"),
    ("scene.url", "https://example.org/a.blend", "scene.url: is only for blend, not for builder"),
    ("scene.frame", "file", "scene.frame: file is only for blend, not for builder"),
    ("render.samples", "file", "render.samples: file is only for scene.blend"),
    (
        "rigs.LFSphere",
        {"type": "blend_camera", "camera": {"lens": "file", "resolution": [8, 8]}},
        "rigs.LFSphere.type: blend_camera needs scene.blend",
    ),
    ("scene.licence", "CC0-1.0", "scene.licence: belongs to the top of the file, beside scene"),
    ("render.credit", "me", "render.credit: belongs to the top of the file, beside scene"),
    ("samples", 64, "samples: belongs to render"),
    ("rigs.LFSphere.resolution", [8, 8], "did you mean rotation? resolution belongs to camera"),
    ("publish", PUBLISH | {"credit": "me"}, "publish.credit: belongs to the top of the file"),
    (
        "rigs.LFSphere.camera",
        {"lens": "file", "resolution": [8, 8]},
        "rigs.LFSphere.camera.lens: file is only for a rig of type blend_camera",
    ),
    (
        "rigs.LFSphere.camera",
        {
            "lens": "rectilinear",
            "focal_length": 50,
            "sensor_size": [36, 24],
            "resolution": [1920, 1080],
        },
        "rigs.LFSphere.camera.sensor_size: is [36.0, 24.0], but the pixels of Cycles' persp",
    ),
    (
        "scene",
        {"blend": "a.blend", "sha256": "123"},
        'scene.sha256: is "123"; must be 64 hexadecimal digits in small letters',
    ),
    (
        "scene",
        {"blend": "a.blend", "sha256": 7},
        "scene.sha256: is 7; must be a text: put it in quotes",
    ),
    (
        "scene",
        {"blend": "a.blend", "sha256": "0" * 64},
        "scene.sha256: is only for a file with scene.url; leave it out",
    ),
    ("scene", {"blend": "a.obj"}, 'scene.blend: is "a.obj"; must be a path that ends in .blend'),
    (
        "scene",
        {"blend": "a.blend", "url": "example.org"},
        'scene.url: is "example.org"; must be an address that begins with http',
    ),
    (
        "reprojections.perspective.camera.focal_length",
        1e-300,
        "camera.focal_length: is 1e-300; must be a number at least 0.001",
    ),
    (
        "rigs.LFSphere.camera",
        {"lens": "rectilinear", "fov": 175, "resolution": [9, 9]},
        # A width of 36 mm, and Blender's shortest focal length of 1 mm.
        "rigs.LFSphere.camera.fov: is 175; must be at most 173.6 in Blender",
    ),
    (
        "rigs.LFSphere.camera.resolution",
        [64, 3],
        "rigs.LFSphere.camera.resolution: is [64, 3]; must be at least 4 × 4 pixels",
    ),
    (
        "rigs.LFSphere.camera",
        {"lens": "rectilinear", "focal_length": 0.9, "resolution": [9, 9]},
        "rigs.LFSphere.camera: its focal length in mm is 0.9; must be at least 1 in Blender",
    ),
    *(
        (
            "rigs.LFSphere",
            {"type": kind, "count": 8, "face_inside": True, "camera": CAMERA},
            f"rigs.LFSphere.face_inside: does not go with type {kind}, whose cameras look inside",
        )
        for kind in ("hemisphere", "ring", "spiral")
    ),
    (
        "rigs.LFSphere.camera.fov",
        5,
        "rigs.LFSphere.camera: its fov in degrees is 5; must be at least 9.998 in Blender",
    ),
    (
        "rigs.LFSphere.camera",
        {"lens": "equisolid", "focal_length": 200, "fov": 20, "resolution": [9, 9]},
        "rigs.LFSphere.camera: its focal length in mm is 200; must be at most 100 in Blender",
    ),
    (
        "rigs.LFSphere.camera",
        {"lens": "rectilinear", "focal_length": 2, "sensor_size": 0.5, "resolution": [9, 9]},
        "rigs.LFSphere.camera.sensor_size: is 0.5; must be at least 1 mm in Blender",
    ),
    (
        "rigs.A",
        {"type": "plane", "camera": CAMERA, "cameras": [3, 2], "size": 1, "baseline": 0.1},
        "rigs.A.baseline: does not go with size",
    ),
    *(
        (
            "rigs.A",
            {"type": "plane", "camera": CAMERA, "cameras": [3, 2], "baseline": value},
            "rigs.A.baseline: is ",
        )
        for value in (0, -1, 1001, [1, 2])
    ),
    ("rigs.LFSphere.type", "ball", 'rigs.LFSphere.type: is "ball"; must be one of plane, cuboid,'),
    (
        "rigs.LFSphere.subdivisions",
        12,
        "rigs.LFSphere.subdivisions: is 12; must be a whole number at most 7",
    ),
    ("rigs.LFSphere.cameras", [3, 3], "rigs.LFSphere.cameras: unknown key; did you mean camera?"),
    (
        "rigs.LFCuboid.cameras",
        [3, 3],
        "rigs.LFCuboid.cameras: is [3, 3]; must be a list of 3 values",
    ),
    ("rigs.LFCuboid.size", -1, "rigs.LFCuboid.size: is -1; must be a number at least 0"),
    ("rigs.LFCuboid.center", [0, 1], "rigs.LFCuboid.center: is [0, 1]; must be a"),
    ("rigs", {}, "rigs: is {}; must have at least 1 item"),
    ("rigs", {"../out": RIGHT["rigs"]["LFSphere"]}, "rigs: '../out' is not a name"),
    (
        "reprojections.perspective.camera",
        {"lens": "rectilinear", "fov": 180, "resolution": [9, 9]},
        "reprojections.perspective.camera.fov: is 180; must be a number below 180",
    ),
    (
        "rigs.LFSphere.camera",
        {"lens": "equidistant", "resolution": [9, 9]},
        "rigs.LFSphere.camera: is missing the key fov",
    ),
    ("render.depth", "z", "render.depth: is 'z', but rigs.LFCuboid.camera"),
    (
        "reprojections.perspective.rigs",
        ["LFSpher"],
        "reprojections.perspective.rigs: there is no rig 'LFSpher'; did you mean LFSphere?",
    ),
    (
        "reprojections.exr",
        RIGHT["reprojections"]["perspective"],
        "reprojections.exr: the name exr is taken",
    ),
    (
        "exports.instant_ngp.sources",
        ["fisheye"],
        "exports.instant_ngp.sources: is 'fisheye'; must be of views, perspective",
    ),
    # Names that other programs have for the same.
    *(
        (f"rigs.LFSphere.{key}", name, f"; did you mean {right}?")
        for key, name, right in (
            ("camera.lens", "perspective", "rectilinear"),
            ("camera.lens", "Pinhole", "rectilinear"),
            ("camera.lens", "fisheye", "equidistant"),
            ("camera.lens", "panorama", "equirectangular"),
            ("camera.lens", "rectlinear", "rectilinear"),
            ("type", "dome", "hemisphere"),
            ("type", "hemispere", "hemisphere"),
        )
    ),
    ("render.camera_motion", {}, "render.camera_motion: must have travel, turn, or both"),
    (
        "render",
        {"samples": 4, "passes": ["motion"], "camera_motion": {"travel": [1, 0, 0]}},
        "render.passes: motion does not go with camera_motion",
    ),
    (
        "reprojections.perspective.primaries",
        "rec709",
        "reprojections.perspective.primaries: is only for format exr; a PNG is sRGB",
    ),
    (
        "reprojections.perspective.compression",
        "htj2k",
        "reprojections.perspective.compression: is only for EXR files: format exr, or passes",
    ),
    (
        "reprojections.perspective.look",
        "Filmik",
        'perspective.look: is "Filmik"; must be none, file, or one of Standard, ACES',
    ),
    (
        "reprojections.perspective.look",
        "AgX - Punch",
        "AgX - Very Low Contrast; did you mean AgX - Punchy?",
    ),
    ("reprojections.perspective.look", "Raw - High Contrast", "must be Raw without a look"),
    (
        "reprojections.perspective.look",
        "file",
        "reprojections.perspective.look: file is only for scene.blend; give it a name such as AgX",
    ),
    (
        "reprojections.perspective",
        {**PERSPECTIVE, "look": "AgX", "reinhard": 5},
        "reprojections.perspective.reinhard: does not go with look, which tone maps",
    ),
    (
        "reprojections.perspective",
        {**PERSPECTIVE, "look": "AgX", "format": "exr"},
        "reprojections.perspective.look: is only for format png; an EXR keeps the light",
    ),
    (
        "exports.nerfstudio",
        {"sources": ["perspective"], "look": "AgX"},
        "exports.nerfstudio.look: is for EXR sources; give look to the reprojection perspective",
    ),
    (
        "exports.nerfstudio",
        {"sources": ["view"], "look": "AgX"},
        "exports.nerfstudio.sources: is 'view'; must be of views, perspective; did you mean views?",
    ),
    (
        "exports",
        {"point_cloud": {"sources": ["views"], "look": "AgX", "reinhard": 5}},
        "exports.point_cloud.reinhard: does not go with look",
    ),
    (
        "exports",
        {"lichtfeld": {"sources": ["views"], "format": "exr", "look": "AgX"}},
        "exports.lichtfeld.look: is only for format png",
    ),
    (
        "sensor",
        {"look": "AgX", "response": {"gamma": 0.5}},
        "sensor.response: does not go with look, which stands in its place",
    ),
    (
        "sensor",
        {"look": "AgX", "brackets": [-1, 1]},
        "sensor.brackets: does not go with look, which cannot be undone",
    ),
    ("sensor", {"look": "file"}, "sensor.look: file is only for scene.blend"),
    (
        "sensor",
        {"sources": ["fisheye"]},
        "sensor.sources: is 'fisheye'; must be of views, perspective",
    ),
    ("sensor", {"rigs": ["LFSpher"]}, "sensor.rigs: there is no rig 'LFSpher'; did you mean"),
    (
        "sensor",
        {"sources": ["perspective"], "rigs": ["LFSpher"]},
        "sensor.rigs: there is no rig 'LFSpher'; did you mean LFSphere?",
    ),
    (
        "sensor",
        {"sources": ["perspective"], "rigs": ["LFCuboid"]},
        "sensor.rigs: LFCuboid is not a rig of the reprojection perspective",
    ),
    ("sensor", {"noise": {"a": 0}}, "sensor.noise: must have a, b, or both above 0"),
    (
        "sensor",
        {"exposure": {"range": [0, 1], "step": 1}},
        "must be a number or have one of range and step",
    ),
    (
        "sensor",
        {"colour": {"range": [0, 6]}},
        "sensor.colour: must be from -5 to 5",
    ),
    ("sensor", {"brackets": [2, 0]}, "sensor.brackets: is [2, 0]; must be a list of stops"),
    ("sensor", {"exposure": "auto"}, 'sensor.exposure: is "auto"; must be a number'),
]

# Wrong settings of config.yaml. The message begins with the first key.
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
    {"results": str(ROOT / "rules")},
    {"results": str(ROOT / "README.md")},
    *(
        {"scenes": [value]}
        for value in (
            "a.b",
            *("tables", "logs", "benchmarks", "removed", "receipts", "settings"),
            *NOT_A_NAME,
        )
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
    *({"device": value} for value in ("GPU", "gpu", 0, ["cpu"])),
    *({"energy": value} for value in (65, {"cores": 0}, {"cores": "all"}, {"price": 1})),
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

FULL_SIZE = {"views": 6, "resolution": [64, 64], "samples": "file"}
# Wrong settings files of programs: the file, its content, and the message.
CAMERA_OF_90 = {"lens": "rectilinear", "fov": 90, "resolution": [24, 16]}
PROGRAMS = [
    *(
        ("reproject.json", content, said)
        for content, said in (
            ({"formats": ["png"], "exposur": 1}, "exposur: unknown key; did you mean exposure?"),
            ({"formats": ["png"], "exposure": 101}, "exposure: is 101; must be a number at most"),
            ({"formats": ["jpg"]}, "formats.[0]: is "),
            (
                {"formats": ["exr"], "relight": {"Lamp": -1}},
                "relight.Lamp: is -1; must be a number",
            ),
            ({"formats": ["exr"], "relight": "all"}, 'relight: is "all"; must be each'),
            ({"formats": ["png"], "camera": CAMERA_OF_90 | {"fov": "90"}}, "camera.fov: is "),
            (
                {"formats": ["png"], "camera": CAMERA_OF_90, "cube_map": True},
                "camera.resolution: is [24, 16",
            ),
            ([], "is []; must be a mapping"),
        )
    ),
    *(
        ("colmap.json", content, said)
        for content, said in (
            ({"options": {"sources": ["views"], "point": 5}}, "options.point: unknown key"),
            ({"options": {"sources": ["views"], "points": 0}}, "options.points: is 0; must be"),
            ({"options": {"sources": ["views"]}, "tested_by": ["other"]}, "tested_by: is "),
        )
    ),
    *(
        ("instant_ngp.json", content, said)
        for content, said in (
            ({}, "is missing the key options"),
            ({"options": {"sources": ["views"], "scal": 1}}, "options.scal: unknown key; did you"),
            ({"options": {"sources": ["views"], "scale": -1}}, "options.scale: is -1; must be a"),
            ({"options": {"sources": ["views"]}, "suffix": ".jpg"}, "suffix: is "),
        )
    ),
    *(
        ("mesh.json", content, said)
        for content, said in (
            ({"formats": ["obj"]}, "formats.[0]: is "),
            ({"frame": -1}, "frame: is -1; must be"),
            ({"format": ["glb"]}, "format: unknown key; did you mean formats?"),
        )
    ),
    *(
        ("import_model.json", {"model": "a.obj", **content}, said)
        for content, said in (
            ({"model": "a.txt"}, 'model: is "a.txt"; must be a path that ends in .fbx'),
            ({"model": "a.glb", "up": "y"}, "up: is only for OBJ, PLY and STL"),
            ({"light": "day"}, 'light: is "day"; must be one of softboxes'),
            ({"frame": "file"}, 'frame: is "file"; must be a whole number'),
            ({"units": "box"}, "units: unknown key; did you mean unit?"),
        )
    ),
    *(
        ("costs.json", {"energy": {}, "full": FULL_SIZE, **content}, said)
        for content, said in (
            ({"energy": []}, "energy: is []; must be a mapping"),
            ({"full": {"views": 6}}, "full: is missing the key resolution"),
            ({"full": FULL_SIZE | {"views": 0}}, "full.views: is 0; must be"),
            ({"watts": 65}, "watts: unknown key"),
        )
    ),
]

# Wrong settings of config.yaml whose message names more than the key.
CHOICES = [
    ({"preset": "best"}, "preset: is 'best'; must be one of full"),
    ({"scenes": ["gardn"]}, "scenes: there is no scene 'gardn'; is garden meant?"),
    ({"scenes": ["nowhere"]}, "scenes: there is no scene 'nowhere'; there are barbershop, "),
    ({"work": "results/smoke"}, "work: is 'results/smoke', and results is 'results'; must be two"),
    ({"rigs": ["LFSpher"]}, "rigs: 'LFSpher' is in none of the scenes garden"),
    (
        {"scenes": ["garden", "lone_monk"], "rigs": ["LFSphere_e100cm_d170cm"]},
        "rigs: none of LFSphere_e100cm_d170cm is in lone_monk; it has ",
    ),
    ({"device": "quantum"}, 'device: is "quantum"; must be auto, cpu, optix,'),
    ({"views_per_shard": 0}, "views_per_shard: is 0; must be auto or a whole number at least 1"),
    ({"results": "."}, "results: is '.'; must be a folder that is used for nothing else"),
    ({"energy": {"watts": -5}}, "energy.watts: is -5; must be a number at least 0"),
    ({"energy": {"watt": 65}}, "energy.watt: unknown key; did you mean watts?"),
    ({"energy": {"cores": 0}}, "energy.cores: is 0; must be auto or a whole number at least 1"),
]
CONFIG_TEXTS = [
    (b"scenes: [garden]\n\tpreset: full\n", ":2:1: is indented with a tab"),
    (b"scenes: [garden\n", ":2:1: "),
    (b"- garden\n", "must be a mapping"),
    (b"", "must be a mapping"),
    (b"\xff\xfe", "cannot be read as YAML"),
]

MISTAKES = [
    *(Mistake("scene.yaml", key, value, "", said) for key, value, said in EXPLAINED),
    *(Mistake("scene.yaml", key, value, said[0] if said else key) for key, value, *said in REFUSED),
    *(Mistake("scene.yaml", "", text, "", said) for text, said in EXPLAINED_TEXTS),
    *(Mistake("scene.yaml", "", text, "") for text in TEXTS.values()),
    *(Mistake("config.yaml", next(iter(keys)), keys, next(iter(keys))) for keys in SETTINGS),
    *(Mistake("config.yaml", next(iter(keys)), keys, *said) for keys, *said in CHOICES),
    *(Mistake("config.yaml", "", text, "", said) for text, said in CONFIG_TEXTS),
    *(Mistake("poses.json", "frames[1]", frame, "frames[1]") for frame in POSES),
    *(Mistake(file, "", text, "") for file, text in POSES_TEXTS.items()),
    *(Mistake(file, "", content, said) for file, content, said in PROGRAMS),
]
