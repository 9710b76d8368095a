"""`open_dataset`, whose readers get the same arrays from a folder, a package and shards."""

import json
import math
import pickle
import re
import shutil
import sys
import tarfile
import types
from dataclasses import replace
from pathlib import Path

import families
import numpy as np
import pytest
from checkouts import ROOT
from sphere import LENSES, RADIUS, colour_of, make_transparent, write_views

from lightfield import open_corpus, open_dataset
from lightfield.configuration.publication import Credits
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import FLOW
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.publishing import package
from lightfield.publishing.publish import publish
from lightfield.stages.family import Corpus, CorpusSettings

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


def write_dataset(dataset, rig=RIG):
    """Write a dataset with passes, flow, a split, and two reprojections."""
    write_views(dataset, CAMERA, rig)
    write_views(dataset / "perspective", LENSES["perspective"], rig, suffix=".png")
    write_views(dataset / "panorama", LENSES["panorama"], rig)
    passes = ["normal", "object"]
    lightfield = LightField.read(dataset / "lightfield.json").with_flow()
    lightfield.changed(scene={"name": "room"}, render={"samples": 4, "passes": passes}).write(
        lightfield.path
    )
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
    (dataset / "object/names.json").write_text('{"ball": 1}')
    write_faces(dataset, lightfield)
    return finish(dataset)


def write_faces(dataset, lightfield):
    """Write two faces of a cube map of each view, of which PNGs have the same names as EXRs."""
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 90, "resolution": [8, 8]})
    views = [
        replace(view, name=f"{view.name}_{face}", others={"split": view.split})
        for view in lightfield.views
        for face in "lr"
    ]
    content = lightfield.changed(lens=lens, views=views, passes=[])
    (dataset / "faces").mkdir()
    content.write(dataset / "faces/lightfield.json")
    for number, view in enumerate(views):
        planes = {name: np.full((8, 8), number, np.float16) for name in "RGBZ"}
        images.write_exr(dataset / f"faces/{view.name}.exr", planes)
        images.write_png(dataset / f"faces/{view.name}.png", np.full((8, 8, 3), number, np.uint8))


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


DTYPES = {"object": np.uint32, "origins": np.float64, "directions": np.float64}
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
    assert list(data.reprojections) == ["faces", "panorama", "perspective"]
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
            assert array.dtype == DTYPES.get(key[1], np.float32)


@pytest.mark.parametrize("name", LENSES)
def test_depth_along_the_rays_leads_to_the_surface(name, tmp_path):
    """The surface is a sphere, and a point's colour on it follows from its place."""
    write_views(tmp_path / "dataset", LENSES[name], RIG)
    data = open_dataset(tmp_path / "dataset")
    assert len(data.views) == 6
    for view in data.views:
        origins, directions = view.rays()
        points = origins + directions * view.distance[..., None]
        seen = np.isfinite(points).all(axis=-1)
        assert seen.any()
        np.testing.assert_allclose(np.linalg.norm(points[seen], axis=-1), RADIUS, atol=1e-4)
        colour = encode_srgb(view.rgb[seen])
        np.testing.assert_allclose(colour, colour_of(points[seen]) / 255, atol=1e-3)
        axis = -view.world_from_camera[:3, 2]
        along_axis = (points - view.world_from_camera[:3, 3]) @ axis
        np.testing.assert_allclose(view.z[seen], along_axis[seen], atol=1e-5)
        np.testing.assert_array_equal(view.depth, view.z if data.depth == "z" else view.distance)

        pixels, visible = view.project(points[seen])
        row, column = np.nonzero(seen)
        assert visible.all()
        np.testing.assert_allclose(pixels, np.stack([column, row], axis=-1) + 0.5, atol=1e-3)


def test_a_fisheyes_rays_follow_from_its_equation(folder):
    """θ = r · fov / 2, and r is 1 where the image circle touches the edges of the image."""
    content = json.loads((folder / "lightfield.json").read_text())
    data = open_dataset(folder)
    for view, frame in zip(data.views, content["frames"], strict=True):
        matrix = np.array(frame["world_matrix"])
        origins, directions = view.rays()
        for row in range(16):
            for column in range(24):
                right, up = (column + 0.5 - 12) / 12, (8 - row - 0.5) / 8
                r = math.hypot(right, up)
                if r > 1:
                    assert np.isnan(directions[row, column]).all()
                    continue
                theta = r * math.radians(160) / 2
                sine = math.sin(theta) / r
                ray = matrix[:3, :3] @ (sine * right, sine * up, -math.cos(theta))
                np.testing.assert_allclose(directions[row, column], ray, atol=1e-12)
                np.testing.assert_array_equal(origins[row, column], matrix[:3, 3])


def test_points_beside_the_frame_and_behind_the_camera_are_not_visible(tmp_path):
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [8, 4]}
    write_views(tmp_path / "dataset", camera, {"type": "lattice", "cameras": [1, 1, 1]})
    view = open_dataset(tmp_path / "dataset").views[0]
    # The camera is at the origin, and looks along +Y.
    points = [(0, 2, 0), (1.9, 2, 0.9), (2.1, 2, 0), (0, 2, 1.1), (0, -2, 0)]
    pixels, visible = view.project(points)
    assert visible.tolist() == [True, True, False, False, False]
    np.testing.assert_allclose(pixels[:3], [(4, 2), (7.8, 0.2), (8.2, 2)], atol=1e-9)
    assert np.isnan(pixels[4]).all()


def test_views_are_found_by_number_name_and_part(folder):
    data = open_dataset(folder)
    assert data.views["view_0002f"].name == data.views[2].name == data.views[-4].name
    assert [view.name for view in data.views[1:3]] == ["view_0001f", "view_0002f"]
    parts = {part: [view.name for view in data.split(part)] for part in ("train", "test")}
    assert parts["test"] == ["view_0000f", "view_0003f"]
    assert len(parts["train"]) == 4
    assert not data.split("validation")
    assert data.lightfield.content["scene"]["name"] == "room"
    assert (data.views[0].frame, data.views[0].time) == (None, 0.0)
    assert data.frames == [data]
    assert f"{data.views[1:3]}".count("<view view_000") == 2
    assert data.names("object") == {"ball": 1}


def test_without_a_split_all_views_train(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, {key: RIG[key] for key in ("type", "cameras")})
    data = open_dataset(tmp_path / "dataset")
    assert [len(data.split(part)) for part in ("train", "validation", "test")] == [6, 0, 0]


def test_a_picture_is_read_as_it_was_encoded(folder):
    data = open_dataset(folder)
    view = data.reprojections["perspective"].views[0]
    light = data.reprojections["panorama"].views[0].rgb
    assert (view.rgb.max() <= 1, view.alpha.min(), light.dtype) == (True, 1, np.float32)
    # The reprojection's own lens and pose lead to the sphere, too.
    origins, directions = view.rays()
    along = (origins * directions).sum(axis=-1)
    distance = -along + np.sqrt(along**2 + RADIUS**2 - (origins**2).sum(axis=-1))
    points = origins + directions * distance[..., None]
    np.testing.assert_allclose(view.rgb, colour_of(points) / 255, atol=3e-3)


@pytest.mark.parametrize("form", ["folder", "package", "shards"])
def test_the_alpha_of_an_opaque_view_is_1(form, forms):
    """Neither its EXRs nor the PNGs of the cube map's faces have a channel A."""
    data = open_dataset(forms[form])
    faces = replace(data.reprojections["faces"], suffix=".png")
    for view, size in ((data.views[0], (16, 24)), (faces.views[0], (8, 8))):
        assert (view.alpha.dtype, view.alpha.shape) == (np.float32, size)
        assert (view.alpha == 1).all()


def test_the_alpha_of_a_transparent_view_is_its_files(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG)
    make_transparent(tmp_path / "dataset", 0.25)
    assert (open_dataset(tmp_path / "dataset").views[0].alpha == 0.25).all()


def test_a_dataset_of_silvrs_tools_is_read(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG)
    file = tmp_path / "dataset/lightfield.json"
    content = json.loads(file.read_text())
    del content["depth"]
    for frame in content["frames"]:
        del frame["split"]
    file.write_text(json.dumps(content))
    for view in (tmp_path / "dataset/exr").iterdir():
        channels = images.read_image(view).channels
        images.write_exr(view, channels | {"Z": channels["Z"].astype(np.float16)})
    view = open_dataset(tmp_path / "dataset").views[1]
    origins, directions = view.rays()
    points = origins + directions * view.distance[..., None]
    seen = np.isfinite(points).all(axis=-1)
    np.testing.assert_allclose(np.linalg.norm(points[seen], axis=-1), RADIUS, rtol=1e-3)


def write_sequence(rig):
    """Write a sequence of three frames. Its cameras move."""
    for number in (8, 10, 14):
        frame = rig / f"f{number:05d}" / "dataset"
        write_views(frame, CAMERA, RIG | {"center": [number / 100, 0, 0]})
        write_views(frame / "perspective", LENSES["perspective"], RIG)
        shutil.copytree(frame, frame.parent, dirs_exist_ok=True)
        shutil.rmtree(frame)
        path = frame.parent / "lightfield.json"
        LightField.read(path).changed(frame=number, scene={"name": "room"}).write(path)
        finish(frame.parent)
    return rig


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    return write_sequence(tmp_path_factory.mktemp("sequence") / "rig")


@pytest.fixture(params=["folder", "package", "shards", "samples alone"])
def sequence_form(request, sequence, tmp_path):
    """The sequence in each form."""
    scene = Credits.model_validate(CREDITS)
    if request.param == "folder":
        return sequence
    if request.param == "package":
        card = package.card(sequence, "room_rig", scene)
        package.pack(sequence, card, tmp_path / "room_rig.tar", None)
        return tmp_path / "room_rig.tar"
    publish(sequence, "room_rig", scene, tmp_path / "shards", None)
    if request.param == "samples alone":
        (tmp_path / "shards/other_files.tar").unlink()
    return tmp_path / "shards"


def test_a_sequence_has_views_with_a_time(sequence_form, sequence):
    data = open_dataset(sequence_form)
    assert len(data.frames) == 3
    assert [len(frame.views) for frame in data.frames] == [6, 6, 6]
    assert sorted({view.time for view in data.views}) == pytest.approx([0, 1 / 3, 1])
    assert len(data.views) == 18
    assert len(data.split("test")) == 6
    with pytest.raises(UserError, match=r"view_0001f: .* 3 frames"):
        data.views["view_0001f"]
    view = data.frames[1].views["view_0001f"]
    truth = json.loads((sequence / "f00010/lightfield.json").read_text())["frames"][1]
    np.testing.assert_allclose(view.world_from_camera, truth["world_matrix"])
    assert view.rgb.shape == (16, 24, 3)
    perspective = data.reprojections["perspective"]
    assert (len(perspective.views), len(perspective.frames[2].views)) == (18, 6)
    assert perspective.frames[2].views[5].time == 1
    assert perspective.views[0].rgb.shape == (48, 64, 3)


def test_one_shard_of_a_sequence_has_only_the_views_in_it(sequence, tmp_path):
    publish(sequence, "room_rig", Credits.model_validate(CREDITS), tmp_path / "shards", 30_000)
    shards = sorted(tmp_path.glob("shards/room_rig-*.tar"))
    assert len(shards) > 3
    views = [view for shard in shards for view in open_dataset(shard).views]
    assert len(views) == 18
    for view in views:
        assert view.rgb.shape == (16, 24, 3)


def test_the_rigs_of_a_scene_are_a_list(tmp_path):
    for name in ("plane", "moving"):
        write_views(tmp_path / name / "dataset", CAMERA, RIG)
    shutil.move(tmp_path / "plane/dataset", tmp_path / "room/plane")
    shutil.move(tmp_path / "moving/dataset", tmp_path / "room/moving/f00001")
    with pytest.raises(UserError, match="has 2 datasets; open_corpus"):
        open_dataset(tmp_path / "room")
    assert [len(data.views) for data in open_corpus(tmp_path / "room")] == [6, 6]


def test_opening_reads_no_pixels(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG)
    shutil.rmtree(tmp_path / "dataset/exr")
    view = open_dataset(tmp_path / "dataset").views[0]
    assert np.isfinite(view.rays()[0]).all()
    with pytest.raises(UserError, match=r"exr/view_0000f\.exr: no such file"):
        view.rgb  # noqa: B018


def test_loaders_can_send_views_to_other_processes(forms):
    for form in forms.values():
        view = open_dataset(form).views[0]
        assert len(repr(view)) + len(repr(view.dataset)) < 500
        copy = pickle.loads(pickle.dumps(view))
        np.testing.assert_array_equal(copy.rgb, view.rgb)


def test_views_are_read_after_a_change_of_directory(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(folder.parent)
    data = open_dataset(folder.name)
    monkeypatch.chdir(tmp_path)
    assert data.views[0].rgb.shape == (16, 24, 3)


def test_who_changes_an_array_changes_no_view(folder):
    data = open_dataset(folder)
    for view in (data.views[0], data.reprojections["perspective"].views[0]):
        poses = [view.position, view.world_from_camera, *view.rays()]
        images_read = [view.rgb, *map(view.read, view.dataset.passes)]
        for array in poses + images_read:
            array[:] = 7
        assert not np.any(view.world_from_camera == 7)
        assert not np.any(view.rays()[1] == 7)


def test_omnidirectional_stereo_has_no_rays_in_any_form(tmp_path):
    rig = tmp_path / "rig/dataset"
    write_views(rig, LENSES["panorama"], RIG)
    path = rig / "lightfield.json"
    lightfield = LightField.read(path)
    lightfield.changed(scene={"name": "room"}, omnidirectional_stereo=0.065).write(path)
    finish(rig)
    publish(rig, "room_rig", Credits.model_validate(CREDITS), tmp_path / "shards", None)
    (tmp_path / "shards/other_files.tar").unlink()
    for form in (rig, tmp_path / "shards"):
        view = open_dataset(form).views[0]
        assert view.rgb.shape == (32, 64, 3)
        for use in (view.rays, lambda view=view: view.project([(0, 0, 0)])):
            with pytest.raises(UserError, match="omnidirectional_stereo"):
                use()


# ---- mistakes --------------------------------------------------------------------------------


def cut(path, beyond):
    """Cut a tar ``beyond`` so many bytes of its third file's header."""
    with tarfile.open(path) as archive:
        size = archive.getmembers()[2].offset + beyond
    path.write_bytes(path.read_bytes()[:size])
    return path


def removed(folder, *names):
    """Remove files from a folder. Returns the folder."""
    for name in names:
        (folder / name).unlink()
    return folder


def damaged(path):
    path.write_bytes(b"\xff\xfe")
    return path


def further_parts(home):
    """Return the names of the package's parts after the first, in their order."""
    names = [path.name for path in home.glob("parts/room_rig.*.tar")]
    return sorted(names, key=lambda name: int(name.split(".")[1]))


# What is opened, and what the message names beside it.
MISTAKES = {
    "no path": (lambda home: home / "missing", "is not there"),
    "other case": (lambda home: home / "Shards", "shards differs only in case"),
    "further part": (lambda home: home / "parts/room_rig.2.tar", "the first .tar"),
    "empty folder": (lambda home: home / "empty", "has no lightfield.json"),
    "another file": (lambda home: home / "text.txt", "must be the folder of a dataset, or a .tar"),
    "no tar": (lambda home: home / "text.tar", "whole, uncompressed tar"),
    "compressed": (lambda home: home / "zipped.tar", "whole, uncompressed tar"),
    "cut in a file": (lambda home: cut(home / "room_rig.tar", 600), "tar"),
    "cut between files": (lambda home: cut(home / "room_rig.tar", 0), "cut short"),
    "shards beyond the last": (
        lambda home: home / "shards/room_rig-train-{00000..00099}.tar",
        "room_rig-train-00098.tar, room_rig-train-00099.tar",
    ),
    "missing shard": (
        lambda home: removed(home / "shards", "room_rig-train-00001.tar"),
        "misses room_rig-train-00001.tar",
    ),
    "missing part of the split": (
        lambda home: removed(home / "shards", "room_rig-test-00000.tar"),
        "misses room_rig-test-00000.tar",
    ),
    "missing shard, without a list": (
        lambda home: removed(home / "shards", "room_rig-train-00001.tar", "sha256sums.txt"),
        "misses room_rig-train-00001.tar",
    ),
    "missing shard of a run": (
        lambda home: (
            removed(home / "shards", "room_rig-train-00001.tar")
            / "room_rig-train-{00000..00002}.tar"
        ),
        "misses room_rig-train-00001.tar",
    ),
    "damaged sums of shards": (
        lambda home: damaged(home / "shards/sha256sums.txt").parent,
        "sha256sums.txt: is not a valid list of checksums",
    ),
    "missing part of a package": (
        lambda home: removed(home / "parts", "room_rig.2.tar") / "room_rig.tar",
        "misses room_rig.2.tar",
    ),
    "missing parts at the end of a package": (
        lambda home: removed(home / "parts", *further_parts(home)) / "room_rig.tar",
        "misses 1 file, such as sha256sums.txt; copy all parts",
    ),
    "missing last part of a package": (
        lambda home: removed(home / "parts", further_parts(home)[-1]) / "room_rig.tar",
        "misses 1 file, such as sha256sums.txt; copy all parts",
    ),
    "missing first part of a package": (
        lambda home: removed(home / "parts", "room_rig.tar") / further_parts(home)[4],
        "open the first .tar of the package, room_rig.tar",
    ),
    "further part with a lightfield.json": (
        lambda home: home / "parts" / further_parts(home)[3],
        "open the first .tar of the package, room_rig.tar",
    ),
    "broken lightfield.json": (lambda home: home / "broken", "lightfield.json"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_that_names_the_path(mistake, forms, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(forms["shards"].parent, home)
    (home / "empty").mkdir()
    (home / "broken").mkdir()
    (home / "broken/lightfield.json").write_text('{"camera": ')
    (home / "text.txt").write_text("text")
    (home / "text.tar").write_text("text")
    with tarfile.open(home / "zipped.tar", "w:gz") as archive:
        archive.add(home / "text.txt", "room/lightfield.json")
    path, problem = MISTAKES[mistake]
    path = path(home)
    with pytest.raises(UserError) as raised:
        open_dataset(path)
    message = str(raised.value)
    assert "\n" not in message
    assert problem in message
    assert str(path).partition("{")[0] in message


def test_a_missing_pass_and_a_wrong_part_name_what_there_is(folder):
    data = open_dataset(folder)
    with pytest.raises(UserError, match=r"no 'albedo'; it has normal, object, flow"):
        data.views[0].read("albedo")
    with pytest.raises(UserError, match=r"'val'; must be train, validation, test"):
        data.split("val")
    with pytest.raises(UserError, match=r"view_0099f.* view_0000f to view_0005f"):
        data.views["view_0099f"]
    with pytest.raises(UserError, match=r"no 'albedo'; it has normal, object, flow"):
        data.names("albedo")
    with pytest.raises(UserError, match=r"'albedoo'; there are normal, .*albedo, .* flow"):
        data.views[0].pass_path("albedoo")
    with pytest.raises(UserError, match=r"'depth'; must be z or distance"):
        data.views[0].depth_as("depth")


@pytest.mark.parametrize("form", ["folder", "package", "shards"])
def test_an_unknown_reprojection_is_one_line_that_names_what_there_is(form, forms):
    data = open_dataset(forms[form])
    with pytest.raises(UserError) as raised:
        data.reprojections["perspectiv"]
    message = str(raised.value)
    assert message.startswith(f"{forms[form]}: ")
    assert message.endswith(": has no 'perspectiv'; it has faces, panorama, perspective")
    assert "perspectiv" not in data.reprojections
    assert data.reprojections.get("perspectiv") is None
    # A loader sends the dataset to its processes with what was looked up.
    copied = pickle.loads(pickle.dumps(data)).reprojections
    assert list(copied) == ["faces", "panorama", "perspective"]
    with pytest.raises(UserError, match=re.escape(message)):
        copied["perspectiv"]


def test_without_reprojections_the_message_says_none(folder):
    panorama = open_dataset(folder).reprojections["panorama"]
    with pytest.raises(UserError, match=r"has no 'perspective'; it has none"):
        panorama.reprojections["perspective"]


def test_a_number_beyond_the_views_names_the_numbers(folder):
    views = open_dataset(folder).views
    for number in (6, -7):
        with pytest.raises(IndexError, match=rf"^{number}: .* 6 views; they are 0 to 5$"):
            views[number]
    # What Python does with a sequence goes on.
    assert next(reversed(views)).name == "view_0005f"
    assert views.index(views[2]) == 2


def test_a_damaged_view_in_a_tar_is_named_by_its_place(forms, tmp_path):
    tar = Path(shutil.copy(forms["package"], tmp_path))
    content = tar.read_bytes()
    with tarfile.open(tar) as archive:
        entry = archive.getmember("room_rig/exr/view_0001f.exr")
    start = entry.offset_data + 1000
    tar.write_bytes(
        content[:start] + bytes(entry.size - 1000) + content[start + entry.size - 1000 :]
    )
    view = open_dataset(tar).views[1]
    with pytest.raises(UserError, match=r"room_rig\.tar/exr/view_0001f\.exr: "):
        view.rgb  # noqa: B018


# ---- the page --------------------------------------------------------------------------------

PAGE = ROOT / "docs/how-to/read-a-dataset.md"
GARDEN = "results/garden/LFSphere_e100cm_d170cm"


@pytest.fixture
def results(folder, sequence, tmp_path, monkeypatch):
    """The datasets that the page names. The garden has 18 views or more."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "torch", stand_in_for_torch())
    garden = write_dataset(tmp_path / GARDEN / "dataset", RIG | {"cameras": [5, 4]})
    shutil.copytree(garden, tmp_path / GARDEN, dirs_exist_ok=True)
    shutil.copy(package.READER_SOURCE, tmp_path / GARDEN)
    monkeypatch.syspath_prepend(tmp_path / GARDEN)
    shutil.copytree(sequence, tmp_path / "results/still_life/LFMoving")
    for number in range(4):
        families.add_member(tmp_path / "results/chairs", f"{number:04d}", shade=number)
    settings = CorpusSettings(family="chairs")
    looks = tmp_path / "looks.json"
    job = Corpus(settings=settings, folder=tmp_path / "results/chairs", cache=looks, receipt=None)
    job.note_settings(settings.as_json())
    job.run()


def stand_in_for_torch():
    """Return what the page uses of torch, on arrays. The environment of the tests has no torch."""
    torch = types.ModuleType("torch")

    class Tensor(np.ndarray):
        def float(self):
            return self.astype(np.float32)

    torch.from_numpy = lambda array: array.view(Tensor)
    data = types.SimpleNamespace(
        Dataset=object,
        DataLoader=lambda views, batch_size: (views[number] for number in range(len(views))),
    )
    torch.utils = types.SimpleNamespace(data=data)
    return torch


def test_the_code_of_the_page_runs(results, capsys):
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.M | re.S)
    names = {"points": np.zeros((7, 3))}
    read = []
    for block in blocks:
        exec(block, names)
        read.append(dict(names))
    assert read[0]["pixels"].shape == (7, 2)
    np.testing.assert_allclose(np.linalg.norm(read[1]["points"], axis=1), RADIUS, atol=1e-4)
    assert len(read[2]["test_views"]) == 7
    printed = capsys.readouterr().out
    assert re.findall(r"^(\d+) ([\d.]+) \[", printed, re.M)[-1] == ("14", "1.0")
    assert re.search(r"^0001 \{.shade.: 1\} 3$", printed, re.M)
    # By the reader, and by the ten lines that it replaces.
    np.testing.assert_allclose(read[-1]["directions"], read[-2]["directions"], atol=1e-12)
    code = [line for line in blocks[-2].splitlines() if line and not line.startswith("import")]
    assert len(code) == 10
    (loader,) = (block for block in blocks if "class Rays" in block)
    lines = loader.partition("class")[2].partition("views = torch")[0].splitlines()
    assert len([line for line in lines if line]) == 10
    batches = [*names["views"]]
    assert len(batches) == 13
    origins, directions, colour = batches[0]
    assert origins.shape == directions.shape == colour.shape
    assert {array.dtype for array in batches[0]} == {np.dtype(np.float32)}
