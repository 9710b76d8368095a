"""lightfield.json: written as it was, read strictly, and what it says resolved in one place."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.dataset.lightfield import LightField
from lightfield.geometry import lenses, rigs

FISHEYE = lenses.from_camera({"lens": "equidistant", "resolution": [64, 64], "fov": 180})
WIDE = lenses.from_camera({"lens": "equidistant", "resolution": [64, 64], "fov": 181})
PERSPECTIVE = lenses.from_camera({"lens": "rectilinear", "resolution": [64, 48], "fov": 60})
PANORAMA = lenses.from_camera({"lens": "equirectangular", "resolution": [64, 32]})
CUBOID = {"type": "cuboid", "cameras": [3, 2, 2], "evaluation_split": "odd"}
PLANE = {"type": "plane", "cameras": [2, 1], "center": [1, 2, 3], "rotation": [10, 20, 30]}


def content(**changes: Any) -> dict[str, Any]:
    return json.loads(json.dumps(LightField.from_rig(PLANE, FISHEYE).to_json() | changes))


def read(tmp_path: Path, held: Any) -> LightField:
    write_json(tmp_path / "lightfield.json", held)
    return LightField.read(tmp_path / "lightfield.json")


def test_it_holds_what_silvrs_readers_read() -> None:
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
        turned = rigs.euler_to_matrix(np.array(frame["rotation"]))
        np.testing.assert_allclose(matrix[:3, :3], turned, atol=1e-11)
        number = int(frame["name"][len("view_x") : -1])
        assert frame["split"] == ("test" if number % 2 else "train")


def test_what_is_read_is_written_again_byte_for_byte(tmp_path: Path) -> None:
    for rig in (CUBOID, PLANE):
        first, second = tmp_path / "first.json", tmp_path / "second.json"
        made = LightField.from_rig(rig, FISHEYE, depth="z", render={"samples": 4})
        made.write(first)
        LightField.read(first).write(second)
        assert first.read_bytes() == second.read_bytes()
        assert [view.split for view in LightField.read(second).views] == [
            ("train", "test")[pose.number % 2] if rig is CUBOID else None
            for pose in rigs.poses(rig)
        ]


def test_keys_of_others_are_kept(tmp_path: Path) -> None:
    held = content(note="kept")
    held["frames"][1]["timestamp"] = 7
    assert read(tmp_path, held).to_json() == held


def test_a_view_is_placed_by_its_matrix_or_by_its_angles(tmp_path: Path) -> None:
    whole = read(tmp_path, content())
    held = content()
    for frame in held["frames"]:
        del frame["position"], frame["rotation"]
    by_matrix = read(tmp_path, held)
    held = content()
    for frame in held["frames"]:
        del frame["world_matrix"]
    by_angles = read(tmp_path, held)
    for found in (by_matrix, by_angles):
        np.testing.assert_allclose(found.matrices, whole.matrices, atol=1e-11)
        for view, same in zip(found.views, whole.views, strict=True):
            np.testing.assert_allclose(view.position, same.position, atol=1e-11)
            np.testing.assert_allclose(view.rotation, same.rotation, atol=1e-11)
    # Both there: the matrix decides.
    held = content()
    held["frames"][0]["world_matrix"][0][3] = 5
    assert read(tmp_path, held).views[0].matrix[0, 3] == 5


def test_the_matrix_looks_where_the_rig_points() -> None:
    """A level plane's cameras look along +Y with +Z up."""
    view = LightField.from_rig({"type": "plane", "cameras": [1, 1]}, FISHEYE).views[0]
    np.testing.assert_array_equal(
        view.matrix, [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    )


@pytest.mark.parametrize(
    ("lens", "absent", "cycles", "impossible"),
    [
        (FISHEYE, "z", "distance", "Z"),
        (PERSPECTIVE, "z", "z", "none"),
        (WIDE, "distance", "distance", "z"),
        (PANORAMA, "distance", "distance", "z"),
    ],
)
def test_what_depth_means_follows_from_the_key_and_the_lens(
    lens: lenses.Lens, absent: str, cycles: str, impossible: str
) -> None:
    rig = {"type": "plane", "cameras": [1, 1]}
    assert LightField.from_rig(rig, lens).depth == absent
    assert LightField.from_rig(rig, lens).cycles_depth == cycles
    for depth in {absent, "distance", None}:
        assert LightField.from_rig(rig, lens, depth=depth).depth == depth
    with pytest.raises(UserError, match=f"^lightfield.json: depth: is '{impossible}'"):
        LightField.from_rig(rig, lens, depth=impossible)


def test_a_changed_copy_has_another_lens_other_views_and_other_keys(tmp_path: Path) -> None:
    first = read(tmp_path, content(render={"samples": 4}, frame=2, scene={"name": "x"}))
    assert (first.render, first.frame, first.scene) == ({"samples": 4}, 2, {"name": "x"})
    changed = first.changed(lens=WIDE, views=first.views[1:], render={"samples": 8})
    assert changed.lens.to_lightfield() == WIDE.to_lightfield()
    assert (changed.depth, changed.path) == ("distance", first.path)
    assert [view.name for view in changed.views] == ["view_0001f"]
    assert (changed.render, changed.frame) == ({"samples": 8}, 2)
    assert (first.lens.width, first.depth, len(first.views)) == (64, "z", 2)
    assert changed.folder == tmp_path
    assert len(first.changed(views=[]).matrices) == 0


@pytest.mark.parametrize("key", ["render", "frame", "scene"])
def test_a_key_of_ours_that_another_tool_did_not_write_is_named(key: str) -> None:
    with pytest.raises(UserError, match=f"^lightfield.json: {key}: is missing; .*make_lightfield"):
        getattr(LightField.from_rig(PLANE, FISHEYE), key)


def frame(**changes: Any) -> dict[str, Any]:
    first, second = content()["frames"]
    return {"frames": [first, {k: v for k, v in (second | changes).items() if v != "none"}]}


NUMBERS = [[math.pi] * 4] * 3

BROKEN: dict[str, tuple[Any, str]] = {
    "no mapping": ([], "must be a mapping, not a list"),
    "no camera": ({"frames": []}, "camera: is missing"),
    "no frames": ({"frames": None}, "frames: must be a list of views"),
    "no view": ({"frames": []}, "frames: is empty"),
    "frame is no mapping": ({"frames": [3]}, r"frames\[0\]: must be a mapping, not 3"),
    "no name": (frame(name="none"), r"frames\[1\]: name: must be a file name, not None"),
    "number as name": (frame(name=3), r"frames\[1\]: name: must be a file name, not 3"),
    "empty name": (frame(name=""), r"frames\[1\]: name: must be a file name"),
    "folder as name": (frame(name="../x"), r"frames\[1\]: name: must be a file name"),
    "backslash in name": (frame(name="..\\x"), r"frames\[1\]: name: must be a file name"),
    "a name twice": (frame(name="view_0000f"), r"frames\[1\]: view_0000f: is the name of two"),
    "three rows": (frame(world_matrix=NUMBERS), r"frames\[1\]: world_matrix: must be 4 × 4 finite"),
    "uneven rows": (
        frame(world_matrix=[[1], [1, 2]]),
        r"frames\[1\]: world_matrix: must be 4 × 4 finite",
    ),
    "infinity": (frame(position=[1, 2, 1e999]), r"frames\[1\]: position: must be 3 finite numbers"),
    "texts": (frame(position=["1", "2", "3"]), r"frames\[1\]: position: must be 3 finite numbers"),
    "flags": (frame(position=[True] * 3), r"frames\[1\]: position: must be 3 finite numbers"),
    "four angles": (
        frame(rotation=[1, 2, 3, 4]),
        r"frames\[1\]: rotation: must be 3 finite numbers",
    ),
    "no rotation": (
        frame(world_matrix="none", rotation="none"),
        r"frames\[1\]: rotation: is missing, and so is world_matrix",
    ),
    "no position": (
        frame(world_matrix="none", position="none"),
        r"frames\[1\]: position: is missing, and so is world_matrix",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_with_a_file_is_said_in_one_line(case: str, tmp_path: Path) -> None:
    changes, message = BROKEN[case]
    held = changes if case in ("no mapping", "no camera") else content(**changes)
    path = tmp_path / "lightfield.json"
    path.write_text(json.dumps(held))
    with pytest.raises(UserError, match=rf"^{path}: {message}") as caught:
        LightField.read(path)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_or_no_json_is_named(tmp_path: Path) -> None:
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
