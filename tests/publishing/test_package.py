"""Packages: reproducible bytes, parts, a card, and a complete dataset when unpacked."""

import json
import os
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from sphere import write_views

from lightfield.configuration.scene_yaml import load_scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.exporters import EXPORTERS, lists_beside_views
from lightfield.formats.lightfield import LightField
from lightfield.publishing import package
from lightfield.stages.publishing import Package, PackSettings
from lightfield.validation.verification import faults

NAME = "smoke_LFPlane"
RIG = {"type": "plane", "cameras": [2, 2], "size": 0.4}
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [32, 32]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A finished dataset with a reprojection, an export, a pass and a report."""
    dataset = tmp_path_factory.mktemp("package") / "smoke" / "dataset"
    write_views(dataset, CAMERA, RIG)
    path = dataset / "lightfield.json"
    LightField.read(path).changed(scene={"name": "smoke"}).write(path)
    (dataset / "perspective").mkdir()
    shutil.copy(path, dataset / "perspective/lightfield.json")
    write_json(dataset / "perspective/transforms.json", {"frames": []})
    write_json(dataset / "perspective/exports/colmap/export.json", {"format": "colmap"})
    write_json(dataset / "perspective/exports/nerfstudio/transforms.json", {"frames": []})
    write_json(dataset / "normal/names.json", {})
    write_json(dataset / "report/costs.json", {"not": "packed"})
    write_json(dataset / "validation.json", {"valid": True})
    sums = {
        file.relative_to(dataset).as_posix(): sha256(file)
        for file in dataset.rglob("*")
        if file.is_file() and "report" not in file.parts
    }
    lines = [f"{digest}  {name}\n" for name, digest in sorted(sums.items())]
    (dataset / "sha256sums.txt").write_text("".join(lines))
    return dataset


def packed(folder, target, most=None):
    target.parent.mkdir(parents=True, exist_ok=True)
    card = package.card(folder, NAME, load_scene("smoke"))
    return package.pack(folder, card, target, most)


def test_a_package_has_the_same_bytes_whoever_packs_it_and_when(folder, tmp_path):
    (first_archive,) = packed(folder, tmp_path / "one" / f"{NAME}.tar")
    for path in folder.rglob("*"):
        path.chmod(0o777)
        os.utime(path, (1, 1))
    (two,) = packed(folder, tmp_path / "two" / f"{NAME}.tar")
    assert first_archive.read_bytes() == two.read_bytes()
    with tarfile.open(first_archive) as archive:
        for entry in archive:
            assert (entry.mtime, entry.uid, entry.gid, entry.uname) == (0, 0, 0, "")
            assert entry.name.startswith(f"{NAME}/")
            assert "report" not in entry.name


def test_a_package_has_the_files_behind_links(folder, tmp_path):
    (expected,) = packed(folder, tmp_path / "one" / f"{NAME}.tar")
    linked = Path(shutil.copytree(folder, tmp_path / "linked" / folder.name))
    for path in [path for path in linked.iterdir() if path.is_dir()]:
        shutil.move(path, tmp_path / "disk" / path.name)
        path.symlink_to(tmp_path / "disk" / path.name)
    single = linked / "lightfield.json"
    shutil.move(single, tmp_path / "single.json")
    single.symlink_to(tmp_path / "single.json")
    (archive,) = packed(linked, tmp_path / "two" / f"{NAME}.tar")
    assert archive.read_bytes() == expected.read_bytes()
    (linked / "exr/loop").symlink_to(linked)
    with pytest.raises(UserError, match="exr/loop: is a link to a folder that it lies in; remove"):
        packed(linked, tmp_path / "three" / f"{NAME}.tar")
    assert not (tmp_path / "three" / f"{NAME}.tar").exists()


def test_parts_of_a_size_unpack_to_a_complete_dataset(folder, tmp_path):
    target = tmp_path / f"{NAME}.tar"
    (target.with_name(f"{NAME}.9.tar")).write_text("of an earlier package")
    other = target.with_name(f"{NAME}.b.tar")
    other.write_text("of the rig LFPlane.b")
    parts = packed(folder, target, 45_000)
    assert [path.name for path in parts[:2]] == [f"{NAME}.tar", f"{NAME}.2.tar"]
    assert sorted(tmp_path.glob("*.tar")) == sorted([*parts, other])
    assert len(parts) > 2
    for path in parts:
        with tarfile.open(path) as archive:
            assert path.stat().st_size <= 45_000 or len(archive.getnames()) == 1
        subprocess.run(["tar", "-xf", path, "-C", tmp_path], check=True)
    unfolded = tmp_path / NAME
    assert faults(unfolded) == {}
    view = unfolded / "exr" / "view_0001f.exr"
    view.write_bytes(view.read_bytes()[:-1])
    assert faults(unfolded).keys() == {str(view)}
    listed = package.listed(parts)
    assert [part["sha256"] for part in listed] == [sha256(path) for path in parts]


def test_the_card_describes_loading_and_citing(folder, tmp_path):
    (path,) = packed(folder, tmp_path / f"{NAME}.tar")
    with tarfile.open(path) as archive:
        card = json.load(archive.extractfile(f"{NAME}/card.json"))
        readme = archive.extractfile(f"{NAME}/README.md").read().decode()
    assert card["views"] == 4
    assert card["lens"] == "equidistant fisheye, 180°"
    assert card["depth"] == "z"
    assert card["passes"] == ["normal"]
    assert card["reprojections"] == ["perspective"]
    assert card["scene"]["description"].startswith("A tiny rig in a small room")
    assert any("SILVR" in text for text in card["cite"])
    assert card["loaders"]["perspective/exports/colmap"].endswith(
        "Reconstruction('perspective/exports/colmap/sparse/0')"
    )
    assert f'open_dataset("{NAME}")' in card["python"]
    assert card["python"] in readme
    # This reader does not use nerfstudio's file.
    instant_ngp_files = {
        path for path, how in card["loaders"].items() if how.startswith("./instant-ngp")
    }
    assert instant_ngp_files == {"perspective/transforms.json"}
    lists = [("instant_ngp", folder / path) for path in instant_ngp_files]
    assert [*lists_beside_views(folder)] == lists
    assert all(text in readme for text in (*card["cite"], *card["loaders"].values()))
    assert "licence of the scene | CC-BY-4.0" in readme
    credited = load_scene("lone_monk_original")
    again = package.card(folder, NAME, credited)
    assert again["cite"][1] == credited.credit == "Lone Monk, by Carlo Bergonzini (Monorender)"


def test_the_card_names_the_rig_as_the_scene_yaml_does(folder, tmp_path):
    for rig, said in (("hemisphere", "hemisphere"), (None, "PLANE")):
        target = tmp_path / f"{NAME}.tar"
        settings = PackSettings.of(scene=load_scene("smoke"), rig=rig)
        Package(settings=settings, folder=folder, output=target).run()
        assert json.loads(target.with_suffix(".json").read_text())["rig"] == said


def test_a_folder_may_have_any_name_but_must_hold_a_dataset(folder, tmp_path):
    elsewhere = tmp_path / "exports" / "smoke"
    shutil.copytree(folder, elsewhere)
    cards = [package.card(path, NAME, load_scene("smoke")) for path in (folder, elsewhere)]
    assert cards[0] == cards[1]
    with pytest.raises(UserError, match=r"smoke: has no lightfield\.json"):
        shutil.rmtree(elsewhere)
        package.card(elsewhere, NAME, load_scene("smoke"))


def test_every_export_has_a_loader():
    assert package.LOADERS.keys() == {"mesh", "video", *EXPORTERS}


def test_an_export_in_a_folder_with_another_name_is_recognised_by_its_list(folder, tmp_path):
    dataset = shutil.copytree(folder, tmp_path / "dataset")
    write_json(dataset / "perspective/exports/mine/export.json", {"format": "miv"})
    card = package.card(dataset, NAME, load_scene("smoke"))
    loader = card["loaders"]["perspective/exports/mine"]
    assert loader.startswith("Encoder -c CONFIGURATION -p inputDirectory perspective/exports/mine/")
    for content, why in (({"format": "x"}, "format: is 'x'; must be one of"), ({}, "is missing")):
        write_json(dataset / "perspective/exports/mine/export.json", content)
        with pytest.raises(UserError, match=rf"mine/export.json: .*{why}"):
            package.card(dataset, NAME, load_scene("smoke"))
