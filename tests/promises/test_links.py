"""Links and hostile paths: no view is lost, and nothing outside the build is moved."""

import json
import os
import shutil
import tarfile
from pathlib import Path

import bookkeeping
import pytest
import tiny
from checkouts import checkout, snakemake

SCENE = """
licence: CC0-1.0
scene: {builder: room}
render: {samples: 1, passes: [normal, object]}
rigs:
  LFTrain:
    type: plane
    cameras: [2, 2]
    size: 0.5
    center: [0, 0, 1.2]
    camera: {lens: equidistant, fov: 180, resolution: [32, 32]}
    split: train
  LFTest:
    type: plane
    cameras: [2, 1]
    size: 0.3
    center: [0, 0, 1.2]
    camera: {lens: equidistant, fov: 180, resolution: [32, 32]}
    split: test
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 80, resolution: [24, 24]}
    format: png
exports:
  instant_ngp: {sources: [perspective]}
  nerfstudio: {sources: [perspective]}
report: {panorama: false}
"""
DATASET = Path("results/linked/LFTrain")
OTHER = Path("results/linked/LFTest")
SUMS = "sha256sums.txt"
# The folders that are links: those in one dataset, and the other dataset.
LINKS = (
    DATASET / "exr",
    DATASET / "normal",
    DATASET / "perspective",
    DATASET / "report",
    DATASET / "object",
    OTHER,
)


def run(folder, *targets):
    result = snakemake(
        folder, "--cores", "2", "--config", "scenes=[linked]", "preset=full", "--", *targets
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def tarred(folder, rig):
    """Return the SHA-256 of each file in the package of a rig."""
    with tarfile.open(folder / f"results/linked/linked_{rig}.tar") as archive:
        assert all(entry.isreg() for entry in archive)
        return {entry.name: archive.extractfile(entry).read() for entry in archive}


def sums(folder, dataset):
    """Return the checksums of all files but that of the validation, which takes a time."""
    lines = (folder / dataset / SUMS).read_text().splitlines()
    return sorted(line for line in lines if not line.endswith("  validation.json"))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A build without links, and its packages."""
    folder = checkout(tmp_path_factory.mktemp("links") / "plain", linked=SCENE)
    run(folder, "all", "package")
    return folder


def assert_complete(folder, built):
    """Check that a build with links publishes and packs what the build without them does."""
    for dataset in (DATASET, OTHER):
        assert sums(folder, dataset) == sums(built, dataset)
        assert sum("  exr/" in line for line in sums(folder, dataset)) >= 2
        assert json.loads((folder / dataset / "validation.json").read_text())["valid"]
        archive = tarred(folder, dataset.name)
        expected = tarred(built, dataset.name)
        for content in (archive, expected):
            # It has a time, and sha256sums.txt has its checksum.
            del content[f"linked_{dataset.name}/validation.json"]
            del content[f"linked_{dataset.name}/{SUMS}"]
        assert archive == expected
    page = (folder / "results/index.html").read_text()
    assert "linked/LFTrain/report/index.html" in page
    assert "linked/LFTest/report/index.html" in page
    assert all((folder / link).is_symlink() for link in LINKS)
    assert "no fault" in run_verify(folder)


def run_verify(folder):
    run(folder, "verify")
    return (folder / "work/logs/verify.log").read_text()


@pytest.mark.slow
def test_a_build_into_linked_folders_has_every_view(built, tmp_path):
    folder = checkout(tmp_path / "fresh", linked=SCENE)
    for link in LINKS:
        disk = tmp_path / "disk" / link.name
        disk.mkdir(parents=True)
        (folder / link).parent.mkdir(parents=True, exist_ok=True)
        (folder / link).symlink_to(disk)
    run(folder, "all", "package")
    assert_complete(folder, built)
    assert "Nothing to be done" in run(folder, "all")


@pytest.mark.slow
def test_a_dataset_whose_folders_move_behind_links_keeps_every_view(built, tmp_path):
    folder = Path(shutil.copytree(built, tmp_path / "moved"))
    for link in LINKS:
        disk = tmp_path / "disk" / link.name
        disk.parent.mkdir(exist_ok=True)
        shutil.move(folder / link, disk)
        (folder / link).symlink_to(disk)
    for dataset in (DATASET, OTHER):
        (folder / dataset / "validation.json").unlink()
        (folder / f"results/linked/linked_{dataset.name}.tar").unlink()
    before = bookkeeping.rendered(folder)
    run(folder, "all", "package")
    assert_complete(folder, built)
    assert bookkeeping.rendered(folder) == before


@pytest.mark.slow
def test_no_run_writes_through_a_link_in_place_of_a_file(tiny_build, tmp_path):
    behind = tmp_path / "behind"
    for path in [path for path in (tiny_build / "work").rglob("*") if path.is_file()]:
        place = behind / path.relative_to(tiny_build)
        place.parent.mkdir(parents=True, exist_ok=True)
        path.rename(place)
        path.symlink_to(place)
    place = behind / "part.txt"
    place.write_text("of somebody else\n")
    notes = bookkeeping.notes_of_killed_shard(tiny.NAME, "render", tiny.SHARDS[0])
    (tiny_build / notes).symlink_to(place)
    before = {path: path.read_bytes() for path in behind.rglob("*") if path.is_file()}
    tiny.edit(tiny_build, "samples: 4", "samples: 2")
    tiny.build(tiny_build)
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.slow
def test_no_receipt_makes_a_run_move_files_outside_the_build(
    tiny_build, tmp_path, run_program, monkeypatch
):
    outside = tmp_path / "outside"
    outside.mkdir()
    os.mkfifo(outside / "fifo")
    places = [outside / "mine", tiny_build / "README", tiny_build.parent / "mine"]
    for place in places:
        place.write_text("mine")
    names = [str(outside / "fifo"), str(outside / "mine"), "/dev/null", "../mine", "README"]
    names.append(f"results/{tiny.NAME}/../../../README")
    bookkeeping.claim(tiny_build, names)
    tiny.build(tiny_build)
    assert "Nothing to be done" in tiny.build(tiny_build, "-n")
    assert not (tiny_build / "work/removed").exists()
    bookkeeping.claim(tiny_build, names)
    monkeypatch.chdir(tiny_build)
    dataset = f"results/{tiny.NAME}"
    run_program("verify.py", dataset, "--work", "work", "--mend", check=False)
    removed = [path for path in Path("work/removed").rglob("*") if not path.is_dir()]
    assert removed
    assert all(path.is_relative_to(f"work/removed/{bookkeeping.NOTES}") for path in removed)
    assert all(place.read_text() == "mine" for place in places)
    assert (outside / "fifo").is_fifo()
    assert Path("/dev/null").is_char_device()
