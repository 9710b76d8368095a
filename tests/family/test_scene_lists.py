"""The lists of a corpus's exports, read as MapAnything and DUSt3R read them."""

import shutil

import families
import numpy as np
import pytest
from sphere import LENSES, RADIUS, write_views
from test_corpus import make

from lightfield.core.files import read_json
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.products import exports

RIG = {"type": "plane", "cameras": [3, 1], "size": 1}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """A corpus of six valid members, whose perspective views are exported, and a failed one."""
    family = tmp_path_factory.mktemp("lists") / "chairs"
    for number in range(6):
        dataset = families.add_member(family, f"{number:04d}") / "plane"
        write_views(dataset / "flat", LENSES["perspective"], RIG)
        source = SourceDataset(dataset, "flat", ".exr")
        for kind in ("wai", "dust3r"):
            settings = EXPORTERS[kind].model_validate({"sources": ["flat"]})
            exports.run(source, settings, dataset / "flat/exports" / kind)
    families.add_failure(family, "broken", "no surface")
    make(family, splits={"validation": 0.3, "test": 0.3})
    return family


@pytest.fixture(scope="module")
def members(corpus):
    """The names of the valid members of each part, by the trainers' name of the part."""
    by_part = {"train": [], "val": [], "test": []}
    for member in read_json(corpus / "corpus.json")["members"]:
        if member["state"] == "valid":
            part = {"validation": "val"}.get(member["split"], member["split"])
            by_part[part].append(member["name"])
    assert sorted(map(len, by_part.values()))[-1] > 1
    return {part: names for part, names in by_part.items() if names}


@pytest.fixture(scope="module")
def lists(corpus, tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("lists") / "lists"
    result = run_program("list_scenes.py", corpus, "--output", folder)
    assert result.stdout.startswith("train: ")
    return folder


def test_mapanythings_list_has_the_scenes_of_each_part(corpus, members, lists):
    for part, names in members.items():
        scenes = np.load(lists / part / f"chairs_scene_list_{part}.npy")
        assert scenes.tolist() == [f"{name}/plane/flat/exports/wai" for name in names]
        for scene in scenes:
            assert (corpus / scene / "scene_meta.json").is_file()


def test_dust3rs_pairs_are_of_two_views_of_one_scene(corpus, members, lists):
    for part, names in members.items():
        with np.load(lists / part / "waymo_pairs.npz") as data:
            scenes, frames, pairs = (data[key] for key in ("scenes", "frames", "pairs"))
            assert len(data["scores"]) == len(pairs)
        assert len(scenes) == len(names)
        assert sorted({*pairs[:, 0].tolist()}) == list(range(len(names)))
        for scene, *views in pairs:
            folder = lists / part / scenes[scene]
            member = names[scene]
            assert folder.resolve() == (corpus / member / "plane/flat/exports/dust3r/views")
            for view in views:
                # Each scene has frames of its own.
                assert view // 3 == scene
                with np.load(folder / f"{frames[view]}.npz") as camera:
                    assert np.linalg.norm(camera["cam2world"][:3, 3]) < RADIUS


def test_a_corpus_without_such_exports_is_named(corpus, tmp_path, run_program):
    family = shutil.copytree(corpus, tmp_path / "chairs")
    for path in family.glob("*/plane/flat/exports"):
        shutil.rmtree(path)
    arguments = ["list_scenes.py", family, "--output", tmp_path / "lists"]
    result = run_program(*arguments, check=False)
    assert result.returncode == 1
    assert f"{family}: no valid member has an export for these trainers" in result.stderr
    assert not (tmp_path / "lists").exists()


def test_a_damaged_list_of_pairs_is_named(corpus, tmp_path, run_program):
    family = shutil.copytree(corpus, tmp_path / "chairs")
    path = family / "0003/plane/flat/exports/dust3r/waymo_pairs.npz"
    for content in (b"", path.read_bytes()[:300], b"no archive"):
        path.write_bytes(content)
        arguments = ["list_scenes.py", family, "--output", tmp_path / "lists"]
        result = run_program(*arguments, check=False)
        assert result.returncode == 1
        assert result.stderr.count("\n") == 1
        assert f"{path}: is not an NPZ file of arrays" in result.stderr
