"""The configuration: valid settings are resolved, and invalid ones end in one line."""

import json
import re
import sys
from pathlib import Path

import forks
import jsonschema
import numpy as np
import pytest
import yaml
from mistakes import REMOVE, RIGHT, changed
from pydantic import ValidationError

from lightfield.configuration import config_file, json_schema, keys, scene_yaml
from lightfield.configuration.config_file import Preset
from lightfield.core.errors import UserError
from lightfield.core.names import ROOT
from lightfield.geometry.rigs import as_written
from lightfield.planning.loading import datasets_of, load_datasets, scene_datasets
from lightfield.settings import yaml_files
from lightfield.workflow import job_settings

SNAKEMAKE = Path(sys.executable).with_name("snakemake")


CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
TURNED_ON_THE_SPOT = "name,x,y,z,rx,ry,rz\na,1,2,3,0,0,0\nb,1,2,3,0,1,0\n"


def flowing(rig, **scene):
    """Return a scene YAML of one rig with flow."""
    content = {
        **RIGHT,
        "rigs": {"View": {**rig, "camera": CAMERA}},
        "flow": {"pairs": "neighbours"},
    }
    return {**content, "reprojections": {}, "exports": {}, **scene}


@pytest.mark.parametrize(
    ("rig", "refused"),
    [
        ({"type": "plane", "cameras": [1, 1]}, True),
        ({"type": "plane", "cameras": [1, 1], "stereo": {"distance": 0.06}}, False),
        ({"type": "plane", "cameras": [3, 2], "size": 0}, True),
        ({"type": "plane", "cameras": [1, 3], "size": [1, 1, 0]}, True),
        ({"type": "plane", "cameras": [1, 3], "size": [0, 0, 1]}, False),
        ({"type": "path", "count": 1, "keys": [{"position": [0, 0, i]} for i in (1, 2)]}, True),
        ({"type": "path", "count": 2, "keys": [{"position": [0, 0, i]} for i in (1, 2)]}, False),
        ({"type": "poses", "file": "spot.csv"}, True),
        ({"type": "blend_camera"}, True),
        ({"type": "blend_camera", "frames": {"first": 1, "last": 9}}, False),
    ],
)
def test_flow_of_a_rig_at_one_place_is_refused(rig, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("spot.csv").write_text(TURNED_ON_THE_SPOT)
    source = {"blend": "a.blend"} if rig["type"] == "blend_camera" else {"builder": "room"}
    file = tmp_path / "spot.yaml"
    file.write_text(yaml.safe_dump(flowing(rig, scene=source)))
    if not refused:
        assert scene_yaml.read_scene(file).flow
        return
    with pytest.raises(UserError) as caught:
        scene_yaml.read_scene(file)
    message = str(caught.value)
    assert re.match(rf"{file}:\d+: flow: ", message)
    assert "rigs.View" in message
    assert "\n" not in message


def test_flow_of_a_rig_that_a_preset_leaves_one_place_is_refused(tmp_path, monkeypatch):
    (tmp_path / "row.yaml").write_text(
        yaml.safe_dump(flowing({"type": "plane", "cameras": [4, 1]}))
    )
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    with pytest.raises(UserError, match=r"row\.yaml:\d+: flow: .*preset tiny .*rigs\.View"):
        scene_datasets("row", "tiny", Preset(views=1))
    assert scene_datasets("row", "tiny", Preset(views=2))[0].flow


def test_an_export_that_cannot_take_what_a_preset_leaves_is_refused(tmp_path, monkeypatch):
    for key, value in (("size", 1.2), ("baseline", 0.4)):
        rig = {"type": "plane", "cameras": [4, 4], key: value}
        content = flowing(rig) | {"exports": {"hci": {"sources": ["views"]}}}
        del content["flow"]
        content["rigs"]["View"]["camera"] = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
        (tmp_path / f"{key}.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    assert scene_datasets("size")[0].exports.hci
    assert scene_datasets("baseline", "tiny", Preset(views=12))[0].exports.hci
    problem = (
        r"size\.yaml:\d+: exports\.hci: under the preset tiny, the rig View has cameras .*apart"
    )
    with pytest.raises(UserError, match=problem):
        scene_datasets("size", "tiny", Preset(views=12))


def test_a_preset_that_leaves_less_than_blenders_smallest_image_is_refused(tmp_path, monkeypatch):
    content = flowing({"type": "plane", "cameras": [4, 1]})
    content["rigs"]["View"]["camera"]["resolution"] = [96, 8]
    (tmp_path / "strip.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    problem = (
        r"strip\.yaml:\d+: rigs\.View\.camera\.resolution: under the preset tiny, is \[24, 2\]; "
        "must be at least 4 × 4"
    )
    with pytest.raises(UserError, match=problem):
        scene_datasets("strip", "tiny", Preset(resolution=24))
    (dataset,) = scene_datasets("strip", "tiny", Preset(resolution=48))
    assert dataset.rig.camera.resolution == (48, 4)


def test_all_numbers_of_yaml_1_2_are_numbers(tmp_path):
    """The numbers of the core schema, YAML 1.2.2, section 10.3.2."""
    texts = [
        f"{sign}{digits}{exponent}"
        for sign in ("", "-", "+")
        for digits in ("25", "2.5", "2.", ".5", "0.0")
        for exponent in ("", "e1", "e+1", "e-1", "E1", "E-07")
    ]
    texts.append("0o17")
    file = tmp_path / "numbers.yaml"
    file.write_text("".join(f"{text!r}: {text}\n" for text in texts))
    numbers = yaml_files.read_yaml(file, "numbers")
    assert numbers == {text: 15 if "o" in text else float(text) for text in texts}
    assert numbers["2.5e1"] == 25


def test_numbers_of_yaml_1_1_that_look_like_numbers_stay_numbers(tmp_path):
    file = tmp_path / "numbers.yaml"
    numbers = {"7": 7, "-7": -7, "0": 0, "1_000": 1000, "0x1F": 31, "+1.5": 1.5, ".5": 0.5}
    numbers |= {
        "2.": 2.0,
        "1.0e-3": 0.001,
        "1e-3": 0.001,
        "-2E3": -2000.0,
        "-.inf": -float("inf"),
        "-0.0": 0.0,
    }
    file.write_text("".join(f"{key!r}: {key}\n" for key in numbers))
    assert yaml_files.read_yaml(file, "numbers") == numbers


def test_a_rig_can_take_over_another_rigs_settings(tmp_path):
    path = tmp_path / "merged.yaml"
    path.write_text(
        "scene: {builder: room}\n"
        "render: {samples: 1}\n"
        "rigs:\n"
        "  near: &near\n"
        "    type: sphere\n"
        "    subdivisions: 1\n"
        "    size: 1\n"
        "    camera: {lens: equidistant, fov: 180, resolution: [8, 8]}\n"
        "  far: {<<: *near, size: 3}\n"
    )
    near, far = scene_yaml.read_scene(path).rigs.values()
    assert (near.size, far.size) == (1, 3)
    assert near.camera == far.camera


@pytest.mark.parametrize(
    ("folder", "path"),
    [("./data", "data"), ("data/", "data"), ("a//./b", "a/b"), ("../b", "../b"), ("./-x", "./-x")],
)
def test_a_folder_has_one_path_however_it_is_written(folder, path):
    content = {"scenes": "room", "preset": "full", "presets": {"full": {}}, "results": folder}
    assert config_file.load_config(content).results == path


@pytest.mark.parametrize("storage", ["s3://bucket/a", "/mnt/volume", ""])
def test_a_storage_is_a_url_or_an_absolute_path(storage):
    content = {"scenes": "room", "preset": "full", "presets": {"full": {}}}
    assert config_file.load_config(content | {"storage": storage}).storage == storage
    with pytest.raises(UserError, match=r"storage: .*must be a URL, or a path from /"):
        config_file.load_config(content | {"storage": "volume"})


def test_a_merged_mapping_may_replace_keys_of_another(tmp_path):
    path = tmp_path / "nested.yaml"
    path.write_text(
        "base: &base {size: 1, samples: 2}\n"
        "rigs: {far: {camera: &far {<<: *base, size: 3}}}\n"
        "other: {<<: *far, samples: 4}\n"
    )
    content = yaml_files.read_yaml(path, "nested")
    assert content["rigs"]["far"]["camera"] == {"size": 3, "samples": 2}
    assert content["other"] == {"size": 3, "samples": 4}


def test_an_export_of_one_rigs_views_ignores_other_rigs(tmp_path):
    content = changed("reprojections.same", {"rigs": ["LFSphere"]})
    content["rigs"]["LFSphere"]["camera"] = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    content["exports"]["colmap"] = {"sources": ["same"]}
    path = tmp_path / "one.yaml"
    path.write_text(yaml.safe_dump(content))
    assert scene_yaml.read_scene(path).exports.colmap
    content["exports"]["colmap"] = {"sources": ["views"], "depth": True}
    path.write_text(yaml.safe_dump(content))
    problem = (
        "exports.colmap.sources: views: the rig LFCuboid is a panorama, for which COLMAP has no "
        r"depth maps; .*; or export without it: rigs: \[LFSphere\]"
    )
    with pytest.raises(UserError, match=problem):
        scene_yaml.read_scene(path)
    content["exports"]["colmap"]["rigs"] = ["LFSphere"]
    path.write_text(yaml.safe_dump(content))
    assert scene_yaml.read_scene(path).exports.colmap


def test_each_rig_has_the_exports_that_name_it():
    flat = {"type": "plane", "cameras": [3, 3], "size": 1}
    flat["camera"] = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    wide = {"type": "sphere", "subdivisions": 1, "size": 1}
    wide["camera"] = {"lens": "equidistant", "fov": 200, "resolution": [8, 8]}
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 1},
        "rigs": {"flat": flat, "wide": wide},
        "exports": {
            "hci": {"sources": ["views"], "rigs": ["flat"]},
            "instant_ngp": {"sources": ["views"], "rigs": ["wide"]},
            "poses_csv": {"sources": ["views"]},
        },
    }
    written = scene_yaml.Scene.model_validate(content)
    first, second = datasets_of("mixed", written, "full", Preset(), {})
    assert [*first.exports.selected] == ["hci", "poses_csv"]
    assert first.exported == [
        "results/mixed/flat/exports/hci/export.json",
        "results/mixed/flat/exports/poses_csv/export.json",
    ]
    assert second.exported == [
        "results/mixed/wide/transforms.json",
        "results/mixed/wide/exports/poses_csv/export.json",
    ]
    # The files of an export do not depend on the rigs that have one, too.
    settings = job_settings.export(first, first.exports.hci, "views").as_json()
    assert "rigs" not in settings["options"]
    assert "rigs" not in first.exports.hci.recorded


def test_another_choice_of_points_runs_again_only_exports_with_a_number_of_points(monkeypatch):
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    rig = {"type": "plane", "cameras": [2, 2], "camera": camera}
    rig |= {"frames": {"first": 1, "last": 2}}
    with_number = {"colmap", "nerfstudio", "ncore", "lichtfeld", "dnerf", "colmap_frames"}
    with_number |= {"ncore_frames"}
    names = [*with_number, "splat", "nerf_synthetic", "point_cloud", "poses_csv"]
    content = {"scene": {"builder": "room"}, "render": {"samples": 1}, "rigs": {"flat": rig}}
    content["exports"] = {name: {"sources": ["views"]} for name in names}
    written = scene_yaml.Scene.model_validate(content)
    first, _ = datasets_of("mixed", written, "full", Preset(), {})

    def settings():
        exports = first.exports.selected.items()
        return {name: job_settings.export(first, each, "views").as_json() for name, each in exports}

    before = settings()
    monkeypatch.setitem(keys.VERSIONS, "points", keys.VERSIONS["points"] + 1)
    after = settings()
    assert {name for name in before if before[name] != after[name]} == with_number


def test_an_export_for_training_is_of_a_whole_split():
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    rig = {"type": "plane", "cameras": [2, 2], "camera": camera}
    rigs = {"a": rig | {"split": "train"}, "b": rig | {"split": "test"}, "c": rig}
    content = {"scene": {"builder": "room"}, "render": {"samples": 1}, "rigs": rigs}
    for name in ("nerfstudio", "instant_ngp"):
        for chosen in (["a"], ["b"], ["a", "c"]):
            content["exports"] = {name: {"sources": ["views"], "rigs": chosen}}
            with pytest.raises(ValidationError, match=rf"exports\.{name}\.rigs: lacks [ab]; must"):
                scene_yaml.Scene.model_validate(content)
        for chosen in (["a", "b"], ["c"]):
            content["exports"] = {name: {"sources": ["views"], "rigs": chosen}}
            scene_yaml.Scene.model_validate(content)
    content["exports"] = {"poses_csv": {"sources": ["views"], "rigs": ["a"]}}
    scene_yaml.Scene.model_validate(content)


def test_defaults_and_limits_are_applied(tmp_path, monkeypatch):
    (tmp_path / "right.yaml").write_text(yaml.safe_dump(RIGHT, sort_keys=False))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    full = scene_datasets("right")
    assert [(d.scene_folder, d.rig_folder, d.view_count) for d in full] == [
        ("right", "LFSphere", 642),
        ("right", "LFCuboid", 1400),
    ]
    assert full[0].render.seed == 0
    assert full[0].depth == "z"
    assert full[1].depth == "distance"
    assert list(full[0].reprojections) == ["perspective"]
    assert list(full[1].reprojections) == []
    limits = Preset(resolution=100, samples=8, views=50, denoise=True)
    small = scene_datasets("right", "small", limits)
    assert [(d.scene_folder, d.view_count) for d in small] == [
        ("right_small", 42),
        ("right_small", 48),
    ]
    assert small[0].rig.camera.resolution == (100, 100)
    assert small[1].rig.camera.resolution == (100, 50)
    assert small[0].reprojections["perspective"].camera.resolution == (100, 100)
    assert small[0].render.samples == 8
    assert small[0].render.denoise is True
    with pytest.raises(
        UserError, match=r"right\.yaml:\d+: rigs\.LFSphere: a rig of type sphere can"
    ):
        scene_datasets("right", limits=Preset(views=1))


def test_a_preset_leaves_the_pixels_of_a_perspective_view_square(tmp_path, monkeypatch):
    camera = {"lens": "rectilinear", "fov": 60, "sensor_size": [36, 24], "resolution": [3000, 2000]}
    camera["principal_point"] = [1515, 970]
    content = changed("rigs.LFSphere.camera", camera)
    (tmp_path / "right.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    without_preset = (Preset(), (36, 24), (3000, 2000))
    for limits, size, resolution in (without_preset, (Preset(resolution=65), 36, (64, 42))):
        datasets = scene_datasets("right", limits=limits)
        (rig,) = [dataset.rig for dataset in datasets if dataset.rig_name == "LFSphere"]
        assert rig.camera.sensor_size == size
        assert rig.camera.resolution == resolution
        # The angles from the middle in degrees.
        x, y = np.subtract(rig.camera.principal_point, np.divide(resolution, 2))
        assert (x, y) == pytest.approx((15 * resolution[0] / 3000, -30 * resolution[0] / 3000))
        assert rig.camera.make().has_square_pixels
    # Keys that the preset does not write stay.
    cuboid, sphere = scene_datasets("right", limits=Preset(resolution=64))
    assert "sensor_size" not in str(as_written(cuboid.placed_rig))
    assert "sensor_size" not in sphere.reprojections["perspective"].as_json()["camera"]


def test_a_cube_map_has_a_lens_map_and_a_view_a_face(tmp_path, monkeypatch):
    faces = {"camera": {"lens": "rectilinear", "fov": 90, "resolution": [64, 64]}}
    content = changed("reprojections.faces", faces | {"cube_map": True})
    (tmp_path / "right.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    dataset = scene_datasets("right", limits=config_file.Preset(resolution=32, views=20))[0]
    assert dataset.reprojections["faces"].as_json() == {
        "camera": {"lens": "rectilinear", "fov": 90, "resolution": [32, 32]},
        "cube_map": True,
        "rotation": [0, 0, 0],
        "filter": "adaptive",
        "samples": 1,
        "formats": ["png"],
        "bits": 8,
        "exposure": 0,
        "reinhard": 1,
        "mask": False,
        "passes": [],
    }
    names = [Path(path).name for path in dataset.lens_maps("faces")]
    assert names == [f"lens_map_{face}.npy" for face in "fblrud"]
    assert set(dataset.lens_maps("faces")) <= set(dataset.intermediates)
    for key, value in (("fov", 80), ("resolution", [64, 32])):
        faces["camera"][key] = value
        content["reprojections"]["faces"] |= faces
        expected = "camera: must be rectilinear with fov 90|square with cube_map"
        (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(content))
        with pytest.raises(UserError, match=expected):
            scene_yaml.load_scene("wrong")
        faces["camera"]["fov"] = 90


def test_every_scene_of_the_repository_is_right():
    for path in scene_yaml.SCENES.glob("*.yaml"):
        scene_yaml.read_scene(path)


@pytest.mark.parametrize("name", json_schema.MODELS)
def test_the_schemas_for_editors_match_the_models(name):
    path = ROOT / "configs/schema" / f"{name}.schema.json"
    assert path.read_text() == json_schema.schema(name), "run scripts/schema.py"


def schema_of(text, folder):
    """Return the schema that a YAML file in a folder names in its first line, as editors do."""
    path = re.match(r"# yaml-language-server: \$schema=(\S+)\n", text)[1]
    return json.loads((folder / path).read_text())


@pytest.mark.parametrize(
    "path",
    [*scene_yaml.SCENES.glob("*.yaml"), ROOT / "config.yaml", ROOT / "config/config.yaml"],
    ids=lambda path: path.stem,
)
def test_a_yaml_names_a_schema_that_accepts_it(path):
    text = path.read_text()
    validator = jsonschema.Draft202012Validator(schema_of(text, path.parent))
    validator.validate(yaml.safe_load(text))


def parts_of(schema):
    """Yield all parts of a schema that are mappings."""
    if isinstance(schema, dict):
        yield schema
    for part in schema.values() if isinstance(schema, dict) else schema:
        if isinstance(part, dict | list):
            yield from parts_of(part)


@pytest.mark.parametrize("name", json_schema.MODELS)
def test_editors_explain_each_key_and_propose_only_allowed_defaults(name):
    schema = json.loads(json_schema.schema(name))
    for part in parts_of(schema):
        for key, of_key in part.get("properties", {}).items():
            model = schema["$defs"].get(of_key.get("$ref", "").rpartition("/")[2], {})
            description = of_key.get("description") or model["description"]
            assert re.fullmatch(r"[^`\n]*(`[^`\n]+`[^`\n]*)*", description), key
            if "default" in of_key:
                named = of_key | {"$defs": schema["$defs"]}
                jsonschema.Draft202012Validator(named).validate(of_key["default"])


def test_editors_propose_the_keys_of_the_given_type_of_rig_and_lens():
    schema = json.loads(json_schema.schema("scene"))
    (rig,) = schema["properties"]["rigs"]["patternProperties"].values()
    for kinds, key in (
        (rig["oneOf"], "type"),
        (schema["$defs"]["CameraSettings"]["oneOf"], "lens"),
    ):
        models = [schema["$defs"][kind["$ref"].rpartition("/")[2]] for kind in kinds]
        names = [model["properties"][key]["const"] for model in models]
        assert len({*names}) == len(names) and all(key in model["required"] for model in models)
        assert [model["title"] for model in models] == names


def test_the_schema_finds_mistakes_of_a_scene():
    validator = jsonschema.Draft202012Validator(json.loads(json_schema.schema("scene")))
    for path, value in (
        ("rigs", {"a b": RIGHT["rigs"]["LFSphere"]}),
        ("render.sample", 4),
        ("rigs.LFSphere.subdivisions", 12),
        ("rigs.LFSphere.type", "cuboid"),
        ("rigs.LFSphere.camera", REMOVE),
        ("rigs.LFSphere.camera.lens", "rectiliner"),
    ):
        assert not validator.is_valid(changed(path, value)), path


def test_a_single_word_becomes_a_list():
    content = {"preset": "full", "presets": {"full": {}}, "scenes": "artist"}
    assert config_file.load_config(content).scenes == ["artist"]
    assert config_file.load_config(content).rigs == "all"
    assert config_file.load_config({**content, "rigs": "LFSphere"}).rigs == ["LFSphere"]


@pytest.mark.parametrize(
    ("arguments", "rigs"),
    [
        ([], {"LFSphere_e100cm_d170cm"}),
        (["scenes=garden", "rigs=LFCuboid_8panos"], {"LFCuboid_8panos"}),
        (["scenes=smoke"], {"LFCuboid_1x1x1", "LFPlane_3x2_equisolid", "LFLattice_2panos"}),
    ],
)
@pytest.mark.slow
def test_scenes_without_rigs_mean_all_of_theirs(arguments, rigs, tmp_path):
    folders = (f"results={tmp_path}/results", f"work={tmp_path}/work")
    plan = forks.run_snakemake(
        ["--cores", "1", "--dry-run", "--printshellcmds", "--config", *folders, *arguments],
        ROOT,
    )
    assert plan.returncode == 0, plan.stderr
    assert set(re.findall(r"Placing the cameras of \w+/(\w+)", plan.stdout + plan.stderr)) == rigs


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["preset=best"], "preset: is 'best'; must be one of tiny, preview, full"),
        (
            ["scenes=[garden, lone_monk]", "rigs=LFSphere_e100cm_d170cm"],
            "none of LFSphere_e100cm_d170cm is in lone_monk; it has ",
        ),
    ],
)
@pytest.mark.slow
def test_snakemake_ends_with_one_line_and_no_job(arguments, expected):
    result = forks.run_snakemake(["--cores", "1", "--config", *arguments], ROOT)
    assert result.returncode != 0
    errors = [line for line in result.stderr.splitlines() if "error" in line.lower()]
    assert len(errors) == 1
    assert expected in errors[0]
    assert "Traceback" not in result.stderr
    assert "rule " not in result.stdout + result.stderr


@pytest.mark.slow
def test_a_mistake_has_the_file_that_configfile_names(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("preset: full\nenergy:\n  watts: -2.5e1\nscenes: [nowhere]\n")
    folders = (f"results={tmp_path}/results", f"work={tmp_path}/work")
    arguments = ["--cores", "1", "--dry-run", "--configfile", str(mine), "--config", *folders]
    result = forks.run_snakemake(arguments, ROOT)
    assert f"error: {mine}:3: energy.watts: is -25.0; must be a number at least 0" in result.stderr
    mine.write_text(mine.read_text().replace("-2.5e1", "2.5e1"))
    result = forks.run_snakemake(arguments, ROOT)
    assert f"error: {mine}:4: scenes: there is no scene 'nowhere'" in result.stderr
    result = forks.run_snakemake([*arguments, "scenes=smoek"], ROOT)
    assert "error: --config: scenes: there is no scene 'smoek'; is smoke or" in result.stderr


def test_no_two_scenes_may_share_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    for name in ("room", "room_tiny"):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(RIGHT))

    def chosen(scene, preset):
        presets = {"tiny": {}, "full": {}}
        content = {"scenes": [scene], "preset": preset, "presets": presets}
        return load_datasets(config_file.load_config(content))

    assert chosen("room", "full") and chosen("room_tiny", "tiny")
    for scene, preset in (("room", "tiny"), ("room_tiny", "full")):
        with pytest.raises(UserError, match="room_tiny would be the folder of both room with"):
            chosen(scene, preset)


WHERE_KEYS_STAND = """\
rigs:
  near.by: &near
    camera: &camera
      lens: equidistant
      resolution:
        - 8
        - 0
    size: 1
  far:
    <<: *near
    size: 2
  wall: {camera: *camera}
  near: 1
"""


@pytest.mark.parametrize(
    ("problem", "line"),
    [
        ("rigs: is wrong", 1),
        ("rigs.near: is wrong", 13),
        ("rigs.near.by: is wrong", 2),
        ("rigs.near.by.camera: is missing the key fov", 3),
        ("rigs.near.by.camera.fov: is missing", 3),
        ("rigs.near.by.camera.resolution.[1]: is 0", 7),
        ("rigs.far.size: is 2", 11),
        ("rigs.far.camera.lens: is wrong", 4),
        ("rigs.wall.camera: is wrong", 12),
        ("rigs.wall.camera.lens: is wrong", 4),
        ("rig: unknown key", None),
        ("is missing the key scene", None),
        ("rigs of nobody: is wrong", None),
    ],
)
def test_a_problem_has_the_line_where_its_key_stands(problem, line):
    said = yaml_files.located(problem, WHERE_KEYS_STAND, "a.yaml")
    assert said == (f"a.yaml:{line}: {problem}" if line else f"a.yaml: {problem}")


def test_a_key_of_the_configuration_has_the_line_of_the_file_that_says_it(tmp_path, monkeypatch):
    """Not of the other file, and no line if the command line says it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "defaults").mkdir()
    defaults = tmp_path / "defaults/config.yaml"
    defaults.write_text("preset: full\nenergy:\n  cores: auto\n  watts: -1\n")
    users_file = tmp_path / "config.yaml"
    users_file.write_text("energy: {cores: 0}\nscenes: 7\n")
    content = {"preset": "best", "scenes": 7, "energy": {"cores": 0, "watts": -1}, "presets": {}}
    with pytest.raises(UserError) as caught:
        config_file.load_config(content)
    places = {"scenes": ["--config"]}
    message = config_file.with_lines(
        str(caught.value), lambda key: places.get(key, [users_file, defaults])
    )
    assert "config.yaml:1: energy.cores: is 0" in message
    assert "defaults/config.yaml:4: energy.watts: is -1" in message
    assert "--config: scenes: " in message
    assert "config.yaml: presets: " in message


def test_a_drawn_value_has_its_line_in_the_family(tmp_path):
    file = tmp_path / "rooms.yaml"
    file.write_text(
        "scene: {builder: room}\n"
        "render:\n"
        "  samples: 4\n"
        "rigs: {A: {type: sphere, camera: {lens: equidistant, fov: 180, resolution: [8, 8]}}}\n"
        "family:\n"
        "  seeds: 0-3\n"
        "  values:\n"
        "    render.samples: {integers: [0, 4]}\n"
    )
    with pytest.raises(UserError, match=r"rooms\.yaml:8: render\.samples: is 0"):
        scene_yaml.read_scene(file)


@pytest.mark.parametrize(("pixels", "width"), [(64, 256), (1024, 4096), (2048, 4096)])
def test_the_pages_panorama_has_twice_the_angular_resolution_of_the_views(pixels, width):
    """So a degree of it has twice the pixels of a degree of the fisheye, up to a limit."""
    rig = {"type": "plane", "cameras": [2, 1], "size": 1}
    camera = {"lens": "equidistant", "fov": 180, "resolution": [pixels, pixels]}
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 1},
        "rigs": {"View": rig | {"camera": camera}},
    }
    scene = scene_yaml.Scene.model_validate(content)
    (dataset,) = datasets_of("tried", scene, "full", Preset(), {})
    assert dataset.panorama_width == width


@pytest.mark.parametrize(
    ("path", "value", "why"),
    [
        ("render.depth", "none", "video: needs depth, which the views of LFSphere lack"),
        ("video.rigs", ["LFSpher"], "video.rigs: there is no rig 'LFSpher'; did you mean LFSphere"),
        ("video.format", "mp4", "video.format: mp4 needs ffmpeg, which is not installed"),
        ("family", {"seeds": "0-1"}, "video: does not go with family"),
        ("reprojections", {"video": {"format": "exr"}}, "reprojections.video: the name video is"),
    ],
)
def test_a_video_that_cannot_be_made_is_refused_by_the_plan(path, value, why, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 4},
        "rigs": {"LFSphere": {"type": "sphere", "subdivisions": 1, "size": 1, "camera": camera}},
        "video": {"path": "walk", "format": "webp"},
    }
    scene_yaml.check_scene(yaml.safe_dump(content), "mine.yaml")
    *parents, key = path.split(".")
    block = content
    for parent in parents:
        block = block[parent]
    block[key] = value
    with pytest.raises(UserError, match=re.escape(why)):
        scene_yaml.check_scene(yaml.safe_dump(content), "mine.yaml")


@pytest.mark.parametrize(
    ("path", "value", "why"),
    [
        (
            "render.camera_motion",
            {"travel": [0, 0, -0.01], "rolling": 0.2},
            "rigs.walk.imu.exposure: is missing; the times of a rolling shutter's rows need",
        ),
        ("reprojections", {"imu": {"format": "exr"}}, "reprojections.imu: the name imu is taken"),
        ("rigs.walk.frames", {"first": 1, "last": 2}, "rigs.walk.imu: does not go with frames"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_by_the_plan(path, value, why):
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 4},
        "rigs": {
            "walk": {
                "type": "path",
                "count": 4,
                "keys": [{"position": [0, 0, 1]}, {"position": [0, 1, 1]}],
                "camera": {"lens": "equidistant", "fov": 180, "resolution": [16, 16]},
                "imu": {"seconds": 2},
            }
        },
    }
    scene_yaml.check_scene(yaml.safe_dump(content), "mine.yaml")
    *parents, key = path.split(".")
    block = content
    for parent in parents:
        block = block[parent]
    block[key] = value
    with pytest.raises(UserError, match=re.escape(why)):
        scene_yaml.check_scene(yaml.safe_dump(content), "mine.yaml")
