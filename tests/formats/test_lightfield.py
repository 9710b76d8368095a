"""lightfield.json: written unchanged, read strictly, and its meaning resolved in one place."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightfield.configuration import keys
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.scene_source import SceneSource
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import PASSES
from lightfield.geometry import lenses, rigs, rotations
from lightfield.planning.loading import scene_datasets

FISHEYE = lenses.from_camera({"lens": "equidistant", "resolution": [64, 64], "fov": 180})
WIDE = lenses.from_camera({"lens": "equidistant", "resolution": [64, 64], "fov": 181})
PERSPECTIVE = lenses.from_camera({"lens": "rectilinear", "resolution": [64, 48], "fov": 60})
PANORAMA = lenses.from_camera({"lens": "equirectangular", "resolution": [64, 32]})
CUBOID = {"type": "cuboid", "cameras": [3, 2, 2], "split": "odd"}
GONE = object()
PLANE = {"type": "plane", "cameras": [2, 1], "center": [1, 2, 3], "rotation": [10, 20, 30]}


def content(**changes: Any) -> dict[str, Any]:
    return json.loads(json.dumps(LightField.from_rig(PLANE, FISHEYE).to_json() | changes))


def read(tmp_path: Path, held: Any) -> LightField:
    write_json(tmp_path / "lightfield.json", held)
    return LightField.read(tmp_path / "lightfield.json")


def test_it_has_the_keys_that_silvrs_readers_read() -> None:
    held = LightField.from_rig(CUBOID, FISHEYE, depth="z", frame=3).to_json()
    held = json.loads(json.dumps(held, allow_nan=False))
    keys = ["camera", "lf_type", "resolution", "sensor_size", "depth", "frame", "frames"]
    assert list(held) == keys
    assert held["lf_type"] == "CUBOID"
    assert {key: held[key] for key in ("camera", "resolution", "sensor_size")} == (
        FISHEYE.to_lightfield()
    )
    for frame in held["frames"]:
        assert list(frame) == ["name", "position", "rotation", "world_matrix", "split"]
        matrix = np.array(frame["world_matrix"])
        np.testing.assert_array_equal(matrix[:3, 3], frame["position"])
        np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])
        assert "-0.0" not in json.dumps(frame["world_matrix"])
        turned = rotations.euler_to_matrix(np.array(frame["rotation"]))
        np.testing.assert_allclose(matrix[:3, :3], turned, atol=1e-11)
        number = int(frame["name"][len("view_x") : -1])
        assert frame["split"] == ("test" if number % 2 else "train")


def test_a_file_is_written_again_byte_for_byte(tmp_path: Path) -> None:
    for rig in (CUBOID, PLANE):
        first, second = tmp_path / "first.json", tmp_path / "second.json"
        made = LightField.from_rig(rig, FISHEYE, depth="z", render={"samples": 4})
        made.write(first)
        LightField.read(first).write(second)
        assert first.read_bytes() == second.read_bytes()
        assert [view.split for view in LightField.read(second).views] == [
            ("train", "test")[pose.number % 2] if rig is CUBOID else None
            for pose in rigs.from_settings(rig).poses()
        ]


def test_unknown_keys_are_kept(tmp_path: Path) -> None:
    held = content(note="kept")
    held["frames"][1]["timestamp"] = 7
    assert read(tmp_path, held).to_json() == held


def test_a_view_is_placed_by_its_matrix_or_by_its_angles(tmp_path: Path) -> None:
    complete = read(tmp_path, content())
    held = content()
    for frame in held["frames"]:
        del frame["position"], frame["rotation"]
    by_matrix = read(tmp_path, held)
    held = content()
    for frame in held["frames"]:
        del frame["world_matrix"]
    by_angles = read(tmp_path, held)
    for placed in (by_matrix, by_angles):
        np.testing.assert_allclose(
            placed.world_from_cameras, complete.world_from_cameras, atol=1e-11
        )
        for view, same in zip(placed.views, complete.views, strict=True):
            assert view.position.shape == view.rotation.shape == (3,)
            np.testing.assert_allclose(view.position, same.position, atol=1e-11)
            np.testing.assert_allclose(view.rotation, same.rotation, atol=1e-11)
    view = View.placed("x", complete.views[1].world_from_camera, {"split": "test"})
    assert (view.position.shape, view.split) == ((3,), "test")
    np.testing.assert_allclose(view.position, complete.views[1].position, atol=1e-11)
    np.testing.assert_allclose(view.rotation, complete.views[1].rotation, atol=1e-11)
    assert View.placed("x", view.world_from_camera).split is None
    # With both, the matrix decides.
    held = content()
    held["frames"][0]["world_matrix"][0][3] = 5
    assert read(tmp_path, held).views[0].world_from_camera[0, 3] == 5


def test_the_matrix_looks_in_the_rigs_direction() -> None:
    """A level plane's cameras look along +Y with +Z up."""
    view = LightField.from_rig({"type": "plane", "cameras": [1, 1]}, FISHEYE).views[0]
    np.testing.assert_array_equal(
        view.world_from_camera, [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    )


@pytest.mark.parametrize(
    ("lens", "absent", "impossible"),
    [
        (FISHEYE, "z", "Z"),
        (PERSPECTIVE, "z", "none"),
        (WIDE, "distance", "z"),
        (PANORAMA, "distance", "z"),
    ],
)
def test_the_kind_of_depth_follows_from_the_key_and_the_lens(
    lens: lenses.Lens, absent: str, impossible: str
) -> None:
    rig = {"type": "plane", "cameras": [1, 1]}
    assert LightField.from_rig(rig, lens).depth == absent
    for depth in {absent, "distance", None}:
        assert LightField.from_rig(rig, lens, depth=depth).depth == depth
    with pytest.raises(UserError, match=f"^lightfield.json: depth: is '{impossible}'"):
        LightField.from_rig(rig, lens, depth=impossible)


def test_a_copy_can_have_another_lens_other_views_and_other_keys(tmp_path: Path) -> None:
    first = read(tmp_path, content(render={"samples": 4}, frame=2, scene={"name": "x"}))
    assert (first.render.samples, first.frame, first.scene) == (4, 2, {"name": "x"})
    changed = first.changed(lens=WIDE, views=first.views[1:], render={"samples": 8})
    assert changed.lens.to_lightfield() == WIDE.to_lightfield()
    assert (changed.depth, changed.path) == ("distance", first.path)
    assert [view.name for view in changed.views] == ["view_0001f"]
    assert (changed.render.samples, changed.frame) == (8, 2)
    assert (first.lens.width, first.depth, len(first.views)) == (64, "z", 2)
    assert changed.folder == tmp_path
    assert len(first.changed(views=[]).world_from_cameras) == 0


@pytest.mark.parametrize("key", ["render", "frame", "scene"])
def test_a_missing_key_of_another_tools_file_is_named(key: str) -> None:
    with pytest.raises(UserError, match=f"^lightfield.json: {key}: is missing; .*make_lightfield"):
        getattr(LightField.from_rig(PLANE, FISHEYE), key)
    if key != "render":
        with pytest.raises(UserError, match=f"^lightfield.json: {key}: must be a "):
            getattr(LightField.from_rig(PLANE, FISHEYE, **{key: "one"}), key)


NO_NAME = "name: must be a file name, not "
NUMBER = "must be a finite number from -1e+07 to 1e+07, not "
NO_POSE = "world_matrix: is missing, or position and rotation are"

BROKEN = {
    "no mapping": ([], "must be a mapping, not a list"),
    "no camera": ({"frames": []}, "camera: is missing"),
    "no frames": (content(frames=None), "frames: must be a list of views"),
    "too many views": (content(frames=[None] * 1_000_000), "frames: are 1,000,000; must be at"),
    "no view": (content(frames=[]), "frames: is empty"),
    "a text for settings": (content(render="cycles"), "render: must be a mapping"),
    "no list of passes": (content(passes=3), "passes: must be of normal, object"),
    "a text for a number": (
        content(render={"samples": "64", "transparent": True}),
        'render: samples: is "64"; must be a whole number',
    ),
    "a pass that there is not": (content(render={"passes": ["x"]}), "passes: must be of normal"),
    "no side": (content(resolution=[0, 8]), "resolution: is 0; must be two whole numbers"),
    "no image of this world": (
        content(resolution=[8, 1e308]),
        "resolution: is 1e+308; must be two whole numbers of pixels from 1 to 524288",
    ),
    "frame is not a mapping": (content(frames=[3]), "frames[0]: must be a mapping, not 3"),
}
BROKEN_FRAMES: dict[str, tuple[dict[str, Any], str]] = {
    "no name": ({"name": GONE}, NO_NAME + "None"),
    "number as name": ({"name": 3}, NO_NAME + "3"),
    "empty name": ({"name": ""}, NO_NAME + "''"),
    "folder as name": ({"name": "../x"}, NO_NAME + "'../x'"),
    "backslash in name": ({"name": "x\\y"}, NO_NAME),
    "a name twice": ({"name": "view_0000f"}, "view_0000f: is the name of two frames"),
    "three rows": ({"world_matrix": [[1.5] * 4] * 3}, "world_matrix: must be a list of 4"),
    "uneven rows": (
        {"world_matrix": [[1] * 4] * 3 + [[1]]},
        "world_matrix[3]: must be a list of 4",
    ),
    "infinity": ({"position": [1, 2, math.inf]}, f"position[2]: {NUMBER}inf"),
    "texts": ({"position": ["1", "2", "3"]}, f"position[0]: {NUMBER}'1'"),
    "flags": ({"position": [1, True, 3]}, f"position[1]: {NUMBER}True"),
    "four angles": ({"rotation": [1, 2, 3, 4]}, "rotation: must be a list of 3"),
    "no rotation": ({"rotation": GONE}, "rotation: is missing beside position"),
    "no position": ({"position": GONE}, "position: is missing beside rotation"),
    "no pose": ({"world_matrix": GONE, "position": GONE, "rotation": GONE}, NO_POSE),
}
for case, (changes, message) in BROKEN_FRAMES.items():
    first, second = content()["frames"]
    second = {key: value for key, value in (second | changes).items() if value is not GONE}
    BROKEN[case] = content(frames=[first, second]), f"frames[1]: {message}"


@pytest.mark.parametrize("case", BROKEN)
def test_an_invalid_file_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    held, message = BROKEN[case]
    path = tmp_path / "lightfield.json"
    path.write_text(json.dumps(held))
    with pytest.raises(UserError) as caught:
        LightField.read(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_a_missing_file_or_one_without_json_is_named(tmp_path: Path) -> None:
    path = tmp_path / "lightfield.json"
    with pytest.raises(UserError, match=f"{path}: cannot be read"):
        LightField.read(path)
    path.write_text("{")
    with pytest.raises(UserError, match=f"{path}: is not JSON"):
        LightField.read(path)


def test_cube_map_refuses_a_lens_that_is_not_90_degrees() -> None:
    rig = {"type": "plane", "cameras": [1, 1], "cube_map": True}
    camera = {"lens": "rectilinear", "resolution": [64, 64], "fov": 90}
    assert len(LightField.from_rig(rig, lenses.from_camera(camera)).views) == 6
    for wrong in (
        FISHEYE,
        lenses.from_camera({**camera, "fov": 91}),
        lenses.from_camera({**camera, "resolution": [64, 48]}),
    ):
        with pytest.raises(UserError, match=r"cube_map: .*fov: 90 and square"):
            LightField.from_rig(rig, wrong)


# ---- the key of a view's pixels ---------------------------------------------------------------


def test_a_views_key_changes_with_everything_that_its_pixels_depend_on() -> None:
    first = LightField.from_rig(PLANE, FISHEYE, depth="z", render={"samples": 4}, frame=1)
    view = first.views[0]
    moved = view.world_from_camera + 1e-12 * np.eye(4)[[3, 1, 2, 0]]
    view_keys = [
        keys.render_key(first, view),
        keys.render_key(first, View.placed("other", view.world_from_camera)),
        keys.render_key(first, View.placed(view.name, moved)),
        keys.render_key(first.changed(depth="distance"), view),
        keys.render_key(first.changed(depth=None), view),
        keys.render_key(first.changed(lens=WIDE, depth="distance"), view),
        keys.render_key(first.changed(render={"samples": 5}), view),
        keys.render_key(first.changed(frame=2), view),
        keys.render_key(first.changed(scene={"fingerprint": "0"}), view),
    ]
    assert len(set(view_keys)) == len(view_keys)
    assert all(len(key) == 64 for key in view_keys)


def test_a_views_key_follows_from_nothing_else(tmp_path: Path) -> None:
    first = LightField.from_rig(PLANE, FISHEYE, depth="z", render={"samples": 4}, frame=1)
    key = keys.render_key(first, first.views[0])
    first.write(tmp_path / "elsewhere.json")
    again = LightField.read(tmp_path / "elsewhere.json")
    assert keys.render_key(again, again.views[0]) == key
    assert keys.render_key(first.changed(views=first.views[:1]), first.views[0]) == key
    other_split = View.placed(
        first.views[0].name, first.views[0].world_from_camera, {"split": "test"}
    )
    assert keys.render_key(first, other_split) == key
    # A view resumed on another machine is not rendered again for its last digits.
    assert keys.render_key(first.changed(machine="another"), first.views[0]) == key


def test_a_views_seed_follows_from_its_name_and_never_changes() -> None:
    seeds = [keys.view_seed(seed, name) for seed in (0, 1) for name in ("a", "b")]
    assert len(set(seeds)) == 4
    assert all(0 <= keys.view_seed(0, str(number)) < 2**31 for number in range(200))
    # Finished views keep their pixels: the seed is 31 bits of the SHA-256 of this JSON.
    digest = hashlib.sha256(b'[5, "view_0001f"]').hexdigest()
    assert keys.view_seed(5, "view_0001f") == int(digest, 16) >> (256 - 32) & (2**31 - 1)


def test_a_scenes_fingerprint_follows_from_its_files_or_its_builder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blend = SceneSource(blend="a.blend", sha256="ab" * 32)
    assert keys.scene_fingerprint(blend) == "ab" * 32
    with pytest.raises(UserError, match=r"a.blend: its sha256 is not known"):
        keys.scene_fingerprint(blend.model_copy(update={"sha256": None}))
    monkeypatch.setattr(keys, "BUILDERS", tmp_path)
    fingerprints = set()
    for common, builder_text, seed in (("a", "b", 1), ("c", "b", 1), ("a", "d", 1), ("a", "b", 2)):
        for folder, text in (("library", common), ("room", builder_text)):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / "__init__.py").write_text(text)
        fingerprints.add(
            keys.scene_fingerprint(SceneSource(builder="room", parameters={"seed": seed}))
        )
    assert len(fingerprints) == 4 and all(len(key) == 64 for key in fingerprints)


def test_the_key_of_a_flow_changes_with_lens_poses_and_views(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = LightField.from_rig(PLANE, FISHEYE, depth="z")
    first_view, second_view = first.views
    flow_keys = [
        keys.flow_key(first, first_view, second_view, ["a", "b"]),
        keys.flow_key(first, second_view, first_view, ["a", "b"]),
        keys.flow_key(first, first_view, first_view, ["a", "b"]),
        keys.flow_key(first, second_view, second_view, ["a", "b"]),
        keys.flow_key(first, first_view, second_view, ["b", "a"]),
        keys.flow_key(
            first.changed(lens=WIDE, depth="distance"), first_view, second_view, ["a", "b"]
        ),
    ]
    monkeypatch.setitem(keys.VERSIONS, "flow", 2)
    flow_keys.append(keys.flow_key(first, first_view, second_view, ["a", "b"]))
    assert len(set(flow_keys)) == len(flow_keys)


def test_keys_never_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another version of the program must not render views again that have these keys."""
    monkeypatch.setattr(keys, "version", lambda _: "5.0.1")
    monkeypatch.setattr(keys, "BUILDERS", tmp_path)
    for name in ("library/shapes.py", "room/__init__.py"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(name)
    scene, render = {"name": "a"}, {"samples": 4, "seed": 0}
    first = LightField.from_rig(PLANE, FISHEYE, depth="z", frame=1, scene=scene, render=render)
    blend = SceneSource(blend="a.blend", sha256="ab" * 32)
    all_keys = [
        keys.render_key(first, first.views[1]),
        keys.names_key(first),
        keys.scene_fingerprint(SceneSource(builder="room")),
        keys.scene_fingerprint(blend, [("a.png", "cd" * 32), ("b.png", None)]),
    ]
    assert [key[:12] for key in all_keys] == [
        "690b6266f822",
        "6a816a6ab618",
        "5cba495d5265",
        "2a16a9a77496",
    ]
    with pytest.raises(ValueError, match="not JSON compliant"):
        keys.render_key(first.changed(render={"exposure": math.nan}), first.views[0])


def test_settings_do_not_change_when_a_job_records_the_checksum_of_a_blend(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    camera = {"lens": "equidistant", "resolution": [8, 8], "fov": 180}
    scene = {
        "scene": {"blend": "mine.blend"},
        "render": {"samples": 1},
        "rigs": {"LFPlane": PLANE | {"camera": camera}},
    }
    write_json(tmp_path / "configs/scenes/mine.yaml", scene)

    def settings() -> LightfieldSettings:
        (dataset,) = scene_datasets("mine")
        return LightfieldSettings.of_capture(dataset)

    before = settings()
    recorded = {"blend": "mine.blend", "sha256": "a" * 64}
    write_json(tmp_path / "configs/scenes/mine.lock.json", recorded)
    after = settings()
    assert after.as_json() == before.as_json()
    # The job looks it up when it runs.
    for planned in (before, after):
        assert planned.capture.source.sha256 == "a" * 64


@pytest.mark.parametrize("group", ["", "..", "a/b", "a\n", "-a"])
def test_a_pass_whose_name_is_no_folder_is_refused(group: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="passes"):
        _ = read(tmp_path, content(passes=[f"Combined_{group}"])).passes


@pytest.mark.parametrize("name", PASSES)
def test_a_pass_has_the_bytes_of_its_numbers(name: str) -> None:
    assert PASSES[name].bytes == len(PASSES[name].channels) * np.dtype(PASSES[name].dtype).itemsize
