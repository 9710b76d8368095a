"""`open_dataset`, whose readers get the same arrays from a folder, a package and shards."""

import shutil

import numpy as np
import pytest
from sphere import LENSES, write_views

from lightfield import open_dataset
from lightfield.configuration.scene_yaml import Credits
from lightfield.core.files import sha256
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import FLOW
from lightfield.imaging import images
from lightfield.report import package
from lightfield.report.publish import publish

# Off the sphere's centre, and turned about every axis.
RIG = {
    "type": "plane",
    "cameras": [3, 2],
    "size": 0.4,
    "center": [0.4, -0.3, 0.5],
    "rotation": [20, -35, 50],
    "split": {"every": 3},
}
CAMERA = {"lens": "equidistant", "fov": 160, "resolution": [24, 16]}


def finish(dataset):
    """List the files of a dataset with their sums, as its validation does."""
    files = sorted(path for path in dataset.rglob("*") if path.is_file())
    lines = [f"{sha256(path)}  {path.relative_to(dataset).as_posix()}\n" for path in files]
    (dataset / "sha256sums.txt").write_text("".join(lines))
    return dataset


def write_dataset(dataset):
    """Write a dataset with passes, flow, a split, and two reprojections."""
    write_views(dataset, CAMERA, RIG)
    write_views(dataset / "perspective", LENSES["perspective"], RIG, suffix=".png")
    write_views(dataset / "panorama", LENSES["panorama"], RIG)
    passes = ["normal", "object"]
    lightfield = LightField.read(dataset / "lightfield.json").with_flow()
    lightfield.changed(scene={"name": "room"}, render={"passes": passes}).write(lightfield.path)
    random = np.random.default_rng(1)
    for name in ("perspective", "panorama"):
        reprojected = LightField.read(dataset / name / "lightfield.json")
        reprojected.changed(passes=["normal"] if name == "panorama" else []).write(reprojected.path)
    for number, view in enumerate(lightfield.views):
        normal = {name: random.normal(size=(16, 24)).astype(np.float32) for name in "RGB"}
        images.write_exr(dataset / f"normal/{view.name}.exr", normal)
        numbers = {"Y": np.full((16, 24), number, np.uint32)}
        images.write_exr(dataset / f"object/{view.name}.exr", numbers)
        flow = {name: np.full((16, 24), number, np.float32) for name in FLOW.channels}
        images.write_exr(dataset / f"flow/{view.flow}.exr", flow)
        of_panorama = {name: np.full((32, 64), number, np.float32) for name in "RGB"}
        images.write_exr(dataset / f"panorama/normal/{view.name}.exr", of_panorama)
    return finish(dataset)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("reading") / "dataset")


CREDITS = {
    "description": "A sphere from within",
    "licence": "CC-BY-4.0",
    "publish": {
        "creators": [{"name": "Ada Lovelace"}],
        "url": "https://example.org/dataset",
        "publisher": "Zenodo",
        "date": "2026-11-30",
        **dict.fromkeys(("limitations", "biases", "personal_information"), "None."),
        **dict.fromkeys(("use_cases", "social_impact"), "None."),
    },
}


@pytest.fixture(scope="module")
def forms(folder, tmp_path_factory):
    """The same dataset in each form in which it can be opened."""
    home = tmp_path_factory.mktemp("forms")
    scene = Credits.model_validate(CREDITS)
    card = package.card(folder, "room_rig", scene)
    package.pack(folder, card, home / "room_rig.tar", None)
    package.pack(folder, card, home / "parts/room_rig.tar", 30_000)
    assert len([*home.glob("parts/*.tar")]) > 2
    publish(folder, "room_rig", scene, home / "shards", 30_000)
    # Without the files of no single view.
    shutil.copytree(home / "shards", home / "samples")
    (home / "samples/other_files.tar").unlink()
    run = len([*home.glob("shards/room_rig-train-*.tar")]) - 1
    assert run
    return {
        "folder": folder,
        "package": home / "room_rig.tar",
        "package of parts": home / "parts/room_rig.tar",
        "shards": home / "shards",
        "samples alone": home / "samples",
        "training shards": home / f"shards/room_rig-train-{{00000..{run:05}}}.tar",
        "one shard": home / "shards/room_rig-test-00000.tar",
    }


def arrays(data):
    """Return all that the views of a dataset have, by view and name."""
    read = {}
    for view in data.views:
        origins, directions = view.rays()
        read[view.name, "rgb"] = view.rgb
        read[view.name, "origins"] = origins
        read[view.name, "directions"] = directions
        for name in data.passes:
            read[view.name, name] = view.read(name)
        if data.reprojection == "perspective":
            read[view.name, "alpha"] = view.alpha
        else:
            read[view.name, "z"] = view.z
            read[view.name, "distance"] = view.distance
    return read


# The parts of the split that a form has.
FORMS = {
    "package": {"train", "test"},
    "package of parts": {"train", "test"},
    "shards": {"train", "test"},
    "samples alone": {"train", "test"},
    "training shards": {"train"},
    "one shard": {"test"},
}


@pytest.mark.parametrize("name", FORMS)
def test_each_form_of_a_dataset_has_the_same_arrays(name, forms):
    true_data = open_dataset(forms["folder"])
    data = open_dataset(forms[name])
    assert list(data.reprojections) == ["panorama", "perspective"]
    assert {view.split for view in data.views} == FORMS[name]
    if name != "one shard":
        expected = {view.name for view in true_data.views if view.split in FORMS[name]}
        assert {view.name for view in data.views} == expected
    pairs = [(data, true_data)]
    pairs += [(data.reprojections[key], true_data.reprojections[key]) for key in data.reprojections]
    for read, true in pairs:
        assert (read.passes, read.lens, read.depth) == (true.passes, true.lens, true.depth)
        true_arrays = arrays(true)
        for key, array in arrays(read).items():
            np.testing.assert_array_equal(array, true_arrays[key], str(key))
            assert array.dtype == (np.uint32 if key[1] == "object" else np.float32)
