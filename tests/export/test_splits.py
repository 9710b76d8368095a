"""Splits: the purpose of each view, from the scene YAML to every export and to validation."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from checkouts import checkout, planned
from oracles.readers.ply import read_vertices
from pydantic import TypeAdapter
from test_exports import RADIUS, VIEWS, write_views

from lightfield.configuration import scene_yaml
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.geometry import rigs
from lightfield.planning.loading import scene_datasets
from lightfield.products import exports
from lightfield.settings.base import checked
from lightfield.validation import splits_check
from lightfield.validation.files import read_sets

PERSPECTIVE = {"lens": "rectilinear", "fov": 70, "resolution": [32, 24]}
PLANE = {"type": "plane", "cameras": [4, 3], "size": 1.2}
LISTS = {"validation": ["view_0003f"], "test": ["view_0001f", "view_0007f"]}


@pytest.mark.parametrize(
    ("split", "validation", "test"),
    [
        ("odd", [], range(1, 12, 2)),
        ({"every": 5}, [], (0, 5, 10)),
        (LISTS, [3], (1, 7)),
        ("train", [], ()),
        ("validation", range(12), ()),
        ("test", [], range(12)),
    ],
)
def test_a_rig_says_the_purpose_of_its_views(split, validation, test):
    purposes = [pose.split for pose in rigs.from_settings(PLANE | {"split": split}).poses()]
    parts = dict.fromkeys(test, "test") | dict.fromkeys(validation, "validation")
    assert purposes == [parts.get(number, "train") for number in range(12)]


HEMISPHERE = {"type": "hemisphere", "count": 40}
SPREAD_RIGS = {
    "fibonacci": HEMISPHERE,
    "rings": HEMISPHERE | {"pattern": "rings"},
    "sphere": {"type": "sphere", "subdivisions": 2},
    "plane": {"type": "plane", "cameras": [16, 8]},
    "lattice": {"type": "lattice", "cameras": [8, 4, 4]},
    "cuboid": {"type": "cuboid", "cameras": [4, 4, 4]},
    "cylinder": {"type": "cylinder", "cameras": [16, 5]},
    "random": {"type": "random", "count": 50},
    "ring": {"type": "ring", "count": 40},
    "spiral": {"type": "spiral", "count": 60},
    "path": {
        "type": "path",
        "count": 40,
        "keys": [{"position": place} for place in ([0, 0, 0], [1, 0, 0], [1, 1, 0])],
    },
}


def largest_gap(positions, tests):
    """Return the largest distance from a camera to the nearest test camera."""
    distances = np.linalg.norm(positions[:, None] - positions[None, tests], axis=-1)
    return distances.min(axis=1).max()


@pytest.mark.parametrize("name", SPREAD_RIGS)
def test_test_views_are_spread_better_than_by_chance(name):
    whole_rig = SPREAD_RIGS[name] | {"camera": PERSPECTIVE}
    lightfield = LightField.from_rig(whole_rig, rigs.from_settings(whole_rig).camera.make())
    positions = lightfield.world_from_cameras[:, :3, 3]
    poses = rigs.from_settings(whole_rig | {"split": {"every": 8}}).poses()
    of_split = [number for number, pose in enumerate(poses) if pose.split == "test"]
    exported_names = {view.name for view in splits(lightfield).test}
    of_export = [n for n, view in enumerate(lightfield.views) if view.name in exported_names]
    draw = np.random.default_rng(1).choice
    count = -(-len(positions) // 8)
    drawn_gaps = [
        largest_gap(positions, draw(len(positions), count, replace=False)) for _ in range(99)
    ]
    for tests in (of_split, of_export):
        assert len(tests) == count
        assert largest_gap(positions, tests) <= np.quantile(drawn_gaps, 0.1)


def test_test_views_of_a_hemisphere_are_on_all_sides():
    poses = rigs.from_settings(HEMISPHERE | {"split": {"every": 8}}).poses()
    tests = np.array([pose.position for pose in poses if pose.split == "test"])
    azimuths = np.sort(np.degrees(np.arctan2(tests[:, 0], tests[:, 1])))
    assert np.diff(azimuths, append=azimuths[0] + 360).max() < 180


@pytest.mark.parametrize("name", ["ring", "spiral"])
def test_every_eighth_view_tests_where_none_are_spread_better(name):
    poses = rigs.from_settings(SPREAD_RIGS[name] | {"split": {"every": 8}}).poses()
    tests = [number for number, pose in enumerate(poses) if pose.split == "test"]
    assert tests == [*range(0, len(poses), 8)]


def test_test_views_at_one_place_look_in_different_directions(tmp_path):
    # A tripod that goes round four times. Every fourth view has one of only two directions.
    rows = [f"view_{n},0,0,0,1.5,0,{n % 8 * 0.7}" for n in range(32)]
    (tmp_path / "poses.csv").write_text("\n".join(["name,x,y,z,rx,ry,rz", *rows]))
    rig = {"type": "poses", "file": str(tmp_path / "poses.csv"), "split": {"every": 4}}
    tests = [n for n, pose in enumerate(rigs.from_settings(rig).poses()) if pose.split == "test"]
    assert {number % 8 for number in tests} == {*range(8)}


def test_the_faces_of_a_cube_map_stay_together():
    rig = rigs.from_settings(PLANE | {"cube_map": True, "split": {"every": 4}})
    parts = np.reshape([pose.split for pose in rig.poses()], (12, 6))
    assert (parts == parts[:, :1]).all()
    assert (parts[:, 0] == "test").sum() == 3


def test_a_thinned_rig_has_no_list_of_removed_views():
    assert rigs.from_settings(PLANE | {"split": LISTS}).thinned(4).split is None
    assert rigs.from_settings(PLANE | {"split": "odd"}).thinned(4).split == "odd"


SCENE = {
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {
        "around": {**PLANE, "split": "train", "camera": PERSPECTIVE},
        "along": {"type": "spiral", "count": 5, "split": "test", "camera": PERSPECTIVE},
    },
    "reprojections": {"small": {"camera": PERSPECTIVE, "format": "exr"}},
    "exports": {
        "nerf_synthetic": {"sources": ["views", "small"]},
        "instant_ngp": {"sources": ["small"]},
    },
}


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("rigs.around.split", "even", 'split: is "even"; must be odd or train, validation or test'),
        ("rigs.around.split", {"every": 1}, "split.every: is 1; must be a whole number at least 2"),
        ("rigs.around.split", {"test": ["a", "a"]}, "'a' occurs twice"),
        ("rigs.around.split", {"every": 2, "test": ["a"]}, "must be odd or .* have every, or test"),
        ("rigs.around.split", {"test": ["view_0012f"]}, "there is no view 'view_0012f'"),
        ("rigs.around.split", "test", "rigs.around.split: is test, but no rig has split: train"),
        ("rigs.along.split", "odd", "rigs.around.split: is train, but no rig has split: test"),
        ("rigs.along.split", {"every": 8}, "give around {every: 8}, which splits only its own rig"),
        ("rigs.along.camera.fov", 60, "rigs.along.camera: must be as in around, which trains"),
        ("rigs.along.frames", {"first": 1, "last": 2}, "rigs.along.frames: must be as in around"),
        ("reprojections.small.rigs", ["around"], "reprojections.small.rigs: lacks along; must"),
    ],
)
def test_an_invalid_split_is_refused(path, value, expected):
    content = json.loads(json.dumps(SCENE))
    *parents, last = path.split(".")
    part = content
    for key in parents:
        part = part[key]
    part[last] = value
    with pytest.raises(UserError, match=expected):
        checked(TypeAdapter(scene_yaml.Scene), content, "scene.yaml")


@pytest.mark.slow
def test_a_rig_that_tests_is_exported_with_the_trained_one(tmp_path, monkeypatch):
    (tmp_path / "two.yaml").write_text(json.dumps(SCENE))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    around, along = scene_datasets("two")
    assert (around.tested_by, along.trained_by) == (("along",), "around")
    assert [name for name, _ in around.exports] == [name for name, _ in along.exports]
    assert list(around.exports.selected) == ["instant_ngp", "nerf_synthetic"]
    assert list(along.exports.selected) == ["instant_ngp"]
    assert around.splits == along.splits == "results/two/splits.json"
    assert around.splits in around.files
    (tmp_path / "checkout").mkdir()
    folder = checkout(tmp_path / "checkout", two=json.dumps(SCENE))
    jobs = planned(folder, "--config", "scenes=two", "rigs=around", "preset=full")
    assert (jobs["lightfield"], jobs["splits"], jobs["export"]) == (2, 1, 2)
    assert jobs["validate"] == 1


TWO_RIGS = SCENE | {
    "rigs": {
        "inner": {"type": "sphere", "subdivisions": 1, "split": "train", "camera": PERSPECTIVE},
        "outer": {**PLANE, "split": "train", "camera": PERSPECTIVE},
        "along": {"type": "spiral", "count": 5, "split": "test", "camera": PERSPECTIVE},
        "alone": {**PLANE, "camera": PERSPECTIVE},
    },
    "exports": {
        "colmap": {"sources": ["small"], "together": ["inner", "outer", "along"]},
        "poses_csv": {"sources": ["small"]},
    },
}


@pytest.mark.slow
def test_two_rigs_that_train_go_into_one_export(tmp_path, monkeypatch):
    (tmp_path / "two.yaml").write_text(json.dumps(TWO_RIGS))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    datasets = {dataset.rig_name: dataset for dataset in scene_datasets("two")}
    exported_formats = {rig: [*d.exports.selected] for rig, d in datasets.items()}
    assert exported_formats == {
        "inner": ["colmap", "poses_csv"],
        "outer": ["poses_csv"],
        "along": ["poses_csv"],
        "alone": ["poses_csv"],
    }
    (tmp_path / "checkout").mkdir()
    folder = checkout(tmp_path / "checkout", two=json.dumps(TWO_RIGS))
    jobs = planned(folder, "--config", "scenes=two", "rigs=inner", "preset=full")
    # The other two rigs are rendered for it, but they have no page.
    assert (jobs["lightfield"], jobs["render"], jobs["reproject"]) == (3, 3, 3)
    assert (jobs["export"], jobs["validate"]) == (2, 1)


def test_two_rigs_of_a_sequence_are_exported_together_frame_by_frame(tmp_path, monkeypatch):
    rig = {**PLANE, "camera": PERSPECTIVE, "frames": {"first": 1, "last": 2}}
    content = SCENE | {
        "rigs": {"inner": rig, "outer": rig | {"size": 3}},
        "exports": {"dnerf": {"sources": ["small"], "together": ["inner", "outer"]}},
    }
    (tmp_path / "moving.yaml").write_text(json.dumps(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    first, second, *others = scene_datasets("moving")
    for frame, dataset in (("f00001", first), ("f00002", second)):
        (export,) = dataset.exports.selected.values()
        assert dataset.rigs_beside(export) == (f"outer/{frame}",)
        assert dataset.sequence_exports == ["results/moving/inner/small/exports/dnerf/export.json"]
    assert all(not dataset.exports.selected for dataset in others)


@pytest.mark.parametrize(
    ("together", "changes", "expected"),
    [
        (["inner", "other"], {}, "exports.colmap.together: there is no rig 'other'"),
        (["inner"], {}, "exports.colmap.together: .*at least 2"),
        (["inner", "inner"], {}, "exports.colmap.together: is .*each once"),
        (["along", "inner", "outer"], {}, "together: begins with along, which tests; name a rig"),
        (["inner", "outer"], {}, "exports.colmap.together: lacks along; must have all rigs of the"),
        (["inner", "outer", "along", "alone"], {}, "only one of inner and alone has a split"),
        (
            ["alone", "near"],
            {"near": {**PLANE, "camera": PERSPECTIVE, "frames": {"first": 1, "last": 2}}},
            "rigs.near.frames: must be as in alone; see exports.colmap.together",
        ),
    ],
)
def test_rigs_that_cannot_go_into_one_export_are_refused(together, changes, expected):
    content = json.loads(json.dumps(TWO_RIGS))
    content["rigs"] |= changes
    content["exports"]["colmap"]["together"] = together
    with pytest.raises(UserError, match=expected):
        checked(TypeAdapter(scene_yaml.Scene), content, "scene.yaml")


@pytest.mark.parametrize(
    ("export", "expected"),
    [
        ({"colmap": {"sources": ["small"], "rigs": ["a"], "together": ["a", "b"]}}, "not both"),
        ({"poses_csv": {"sources": ["small"], "together": ["a", "b"]}}, "together: unknown key"),
    ],
)
def test_together_is_for_training_and_in_place_of_rigs(export, expected):
    with pytest.raises(UserError, match=expected):
        checked(TypeAdapter(scene_yaml.Scene), TWO_RIGS | {"exports": export}, "scene.yaml")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene's folder with a rig to train on, one for validation, and one to test with."""
    folder = tmp_path_factory.mktemp("splits") / "scene"
    for name, split in (("around", "train"), ("near", "validation"), ("along", "test")):
        rig = {"type": "plane", "cameras": [2, 2], "size": 0.5, "split": split}
        rig["center"] = [0.1 * len(name), 0, 0]
        camera = VIEWS | {"resolution": [32, 32]}
        write_views(folder / name / "dataset", camera, rig)
        write_views(folder / name / "dataset" / "small", PERSPECTIVE, rig)
        (folder / name / "dataset").rename(folder / f"{name}_")
        (folder / name).rmdir()
        (folder / f"{name}_").rename(folder / name)
    return folder


def exported(scene, name, folder, **options):
    settings = TypeAdapter(EXPORTERS[name]).validate_python({"sources": ["small"], **options})
    beside = {rig: scene / rig for rig in ("near", "along")}
    exports.run(SourceDataset(scene / "around", "small", ".exr", beside), settings, folder)
    return folder


NAMES = {
    "train": {f"view_000{i}f" for i in range(4)},
    "val": {f"near_view_000{i}f" for i in range(4)},
    "test": {f"along_view_000{i}f" for i in range(4)},
}


def test_nerf_synthetic_has_a_folder_and_a_list_for_each_part(scene, tmp_path):
    folder = exported(scene, "nerf_synthetic", tmp_path / "export")
    for part, names in NAMES.items():
        frames = json.loads((folder / f"transforms_{part}.json").read_text())["frames"]
        assert {frame["file_path"] for frame in frames} == {f"./{part}/{name}" for name in names}
        assert {path.stem for path in (folder / part).iterdir()} == names


def test_the_lists_of_nerfstudio_and_colmap_follow_the_split(scene, tmp_path):
    folder = exported(scene, "nerfstudio", tmp_path / "nerfstudio", points=200)
    content = json.loads((folder / "transforms.json").read_text())
    for part, names in NAMES.items():
        listed_names = content[f"{part}_filenames"]
        assert sorted(listed_names) == sorted(f"images/{name}.png" for name in names)
    folder = exported(scene, "colmap", tmp_path / "colmap", format="text", points=200)
    assert (folder / "sparse/0/test.txt").read_text().split() == [
        f"along_view_000{i}f.png" for i in range(4)
    ]
    assert len(pycolmap.Reconstruction(folder / "sparse/0").images) == 12


def test_the_views_of_two_rigs_that_train_are_in_one_model(scene, tmp_path):
    """COLMAP's own library reads it. All cameras are where the rigs' lightfield.json say."""
    joined = tmp_path / "scene"
    shutil.copytree(scene, joined)
    for prefix in ("", "small/"):
        path = joined / "near" / f"{prefix}lightfield.json"
        content = json.loads(path.read_text().replace('"validation"', '"train"'))
        path.write_text(json.dumps(content))
    folder = exported(joined, "colmap", tmp_path / "colmap", points=200)
    images = pycolmap.Reconstruction(folder / "sparse/0").images.values()
    test_names = (folder / "sparse/0/test.txt").read_text().split()
    train = {image.name for image in images} - {*test_names}
    assert train == {f"{name}.png" for name in NAMES["train"] | NAMES["val"]}
    centres = {image.name: image.projection_center() for image in images}
    for rig, prefix in (("around", ""), ("near", "near_"), ("along", "along_")):
        for view in LightField.read(joined / rig / "small" / "lightfield.json").views:
            np.testing.assert_allclose(
                centres[f"{prefix}{view.name}.png"], view.position, atol=1e-6
            )
    names = {path.name for path in (folder / "images").iterdir()}
    assert names == {*centres}


def test_views_of_two_rigs_with_one_name_are_refused(scene, tmp_path):
    shutil.copytree(scene, tmp_path / "scene")
    for path in (tmp_path / "scene/around").rglob("lightfield.json"):
        path.write_text(path.read_text().replace("view_0000f", "near_view_0000f"))
    with pytest.raises(UserError, match=r"near/small/lightfield.json: .*near_view_0000f"):
        exported(tmp_path / "scene", "nerfstudio", tmp_path / "export", points=200)


def test_points_come_only_from_the_training_views(scene, tmp_path):
    shutil.copytree(scene, tmp_path / "scene")
    for rig in ("near", "along"):
        shutil.rmtree(tmp_path / "scene" / rig / "exr")
    folder = exported(tmp_path / "scene", "point_cloud", tmp_path / "export", voxel=0.1)
    vertices = read_vertices(folder / "points.ply")
    distance = np.linalg.norm(np.stack([vertices[axis] for axis in "xyz"], axis=-1), axis=-1)
    np.testing.assert_allclose(distance, RADIUS, atol=1e-5)


def test_points_of_a_rig_that_only_tests_come_from_all_its_views(scene, tmp_path):
    settings = EXPORTERS["point_cloud"](sources=["small"], voxel=0.1)
    exports.run(SourceDataset(scene / "along", "small", ".exr"), settings, tmp_path)
    assert len(read_vertices(tmp_path / "points.ply"))


def test_a_split_without_a_part_is_an_error():
    lens = rigs.from_settings(PLANE | {"camera": PERSPECTIVE}).camera.make()
    for split, missing in (("train", "test"), ("test", "train")):
        lightfield = LightField.from_rig(PLANE | {"split": split}, lens)
        with pytest.raises(UserError, match=f"frames: no view is left to {missing}"):
            splits(lightfield)


def test_validation_finds_deviations_from_the_split(scene, tmp_path):
    folder = tmp_path / "scene"
    shutil.copytree(scene, folder)
    path = folder / "splits.json"
    rig_names = ("around", "near", "along")

    def problems():
        dataset = folder / "around"
        return splits_check.check(path, dataset, read_sets(dataset, ["small"])[0]).problems

    def write():
        lightfields = {
            name: LightField.read(folder / name / "lightfield.json") for name in rig_names
        }
        write_json(path, splits_content(lightfields))
        return json.loads(path.read_text())

    content = write()
    assert content["train"] == [f"around/view_000{i}f" for i in range(4)]
    assert problems() == []
    write_json(path, content | {"test": [*content["test"], "around/view_0001f"]})
    assert problems() == ["splits.json: test: is not what the rigs' lightfield.json say"]
    # A test view has the place of a training view.
    trained = json.loads((folder / "around" / "lightfield.json").read_text())
    tested = json.loads((folder / "along" / "lightfield.json").read_text())
    tested["frames"][2] = trained["frames"][1] | {"name": "view_0002f", "split": "test"}
    write_json(folder / "along" / "lightfield.json", tested)
    write()
    assert problems() == [
        "along/view_0002f: is for test, but has the pose of around/view_0001f, which trains"
    ]
    trained["frames"][0]["split"] = "validation"
    write_json(folder / "around" / "lightfield.json", trained)
    write()
    assert problems()[0] == "small/lightfield.json: frames: view_0000f: split is another"
    write_json(path, {"train": []})
    with pytest.raises(UserError, match="must map train, validation, test to names of views"):
        problems()
    with pytest.raises(UserError, match=r"splits\.json: belongs to the rigs in .*, but .* is not"):
        splits_check.check(path, tmp_path / "copy", [])


@pytest.mark.parametrize("end", ["l", "Lamp", "Lamp_001", "Lamp_001_2"])
def test_views_that_are_named_after_a_light_or_a_face_have_the_split_of_their_view(end, tmp_path):
    lens = rigs.from_settings(PLANE | {"camera": PERSPECTIVE}).camera.make()
    lightfield = LightField.from_rig(PLANE | {"split": {"test": ["view_0001f"]}}, lens)
    write_json(tmp_path / "splits.json", splits_content({"rig": lightfield}))
    lightfield.write(tmp_path / "rig" / "lightfield.json")

    def problems(split_of_first_view):
        views = [replace(view, name=f"{view.name}_{end}") for view in lightfield.views]
        views[0] = replace(views[0], others={"split": split_of_first_view})
        lightfield.changed(views=views).write(tmp_path / "rig" / "lights" / "lightfield.json")
        sets = read_sets(tmp_path / "rig", ["lights"])[0]
        return splits_check.check(tmp_path / "splits.json", tmp_path / "rig", sets).problems

    assert problems("train") == []
    assert problems("test") == [
        f"lights/lightfield.json: frames: view_0000f_{end}: split is another"
    ]
