"""Verify: it finds and names every fault in every kind of file, and runs repair it."""

import os
import random
import re
import shutil
from pathlib import Path

import bookkeeping
import pytest
import simulated
from checkouts import checkout
from simulated import put, write_checksums, write_one_view

from soak import KINDS, replace, spoil

SUMS = "sha256sums.txt"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    root = checkout(tmp_path_factory.mktemp("verify"))
    return root, simulated.build(root)


@pytest.fixture
def copy(built, tmp_path, monkeypatch):
    """A copy of the build, which is the current folder, and its datasets."""
    root = Path(shutil.copytree(built[0], tmp_path / "plenoforge", copy_function=os.link))
    for name in ("results", "work"):
        shutil.rmtree(root / name)
        shutil.copytree(built[0] / name, root / name)
    monkeypatch.chdir(root)
    return built[1]


def faults(datasets, work="work"):
    return bookkeeping.problems((dataset.paths.folder for dataset in datasets), work)


def test_a_build_and_its_copy_have_no_fault(copy):
    assert faults(copy) == {}
    assert faults(copy, work=None) == {}


def test_a_fault_in_a_copy_is_found_without_the_folder_of_work(copy):
    rng = random.Random(2)
    for dataset in copy:
        files = [path for path in sorted(Path(dataset.paths.folder).rglob("*")) if path.is_file()]
        # A copy has no checksums of its report, and none of the checksums.
        published = [path for path in files if "report" not in path.parts and path.name != SUMS]
        chosen = rng.sample(published, 6)
        for path in chosen:
            spoil(path, rng.choice(KINDS), rng)
        assert faults([dataset], work=None).keys() == {str(path) for path in chosen}


@pytest.mark.parametrize("name", ["../outside.txt", "exr/../../outside.txt", "/outside.txt", ""])
def test_a_list_that_names_a_file_outside_the_dataset_is_refused(copy, run_program, name):
    with Path(copy[0].paths.folder, SUMS).open("a") as sums:
        sums.write(f"{'0' * 64}  {name}\n")
    result = run_program("verify.py", copy[0].paths.folder, check=False)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert re.search(rf"{SUMS}: line \d+: is {re.escape(repr(name))}; must be the path of", line)


def test_files_behind_links_are_checked(copy, run_program, tmp_path):
    folder = Path(copy[0].paths.folder)
    disk = tmp_path / "disk"
    disk.mkdir()
    for path in [path for path in folder.iterdir() if path.is_dir()]:
        shutil.move(path, disk / path.name)
        path.symlink_to(disk / path.name)
    assert faults(copy[:1]) == {}
    view = next((folder / "exr").glob("*.exr"))
    view.write_bytes(view.read_bytes()[:-1] + b"!")
    stray = view.with_name("stray.exr")
    stray.write_bytes(b"mine")
    found = faults(copy[:1], work=None)
    assert found.keys() == {str(view), str(stray)}
    assert "nothing is moved out of the folder that exr links to" in found[str(stray)]
    run_program("verify.py", folder, "--work", "work", "--mend", check=False)
    assert not view.exists()
    assert (disk / "exr/stray.exr").read_bytes() == b"mine"


def test_a_link_to_a_foreign_folder_is_one_fault(copy, run_program, tmp_path):
    notes = tmp_path / "notes"
    notes.mkdir()
    for name in ("a.txt", "b.txt"):
        (notes / name).write_text("mine")
    link = Path(copy[0].paths.folder, "notes")
    link.symlink_to(notes)
    assert faults(copy[:1]).keys() == {str(link)}
    run_program("verify.py", copy[0].paths.folder, "--work", "work", "--mend", check=False)
    assert not link.exists()
    assert sorted(path.name for path in notes.iterdir()) == ["a.txt", "b.txt"]


@pytest.fixture
def one_view(tmp_path, monkeypatch):
    """The folder of a copied dataset of one view."""
    monkeypatch.chdir(tmp_path)
    write_one_view(Path("copied/rig"))
    return Path("copied/rig")


def problems_of(folder):
    return bookkeeping.problems([folder], work=None)


def test_a_copy_that_lacks_its_validation_is_named_in_one_line(one_view):
    sums = one_view / SUMS
    listed = [line.split("  ")[1] for line in sums.read_text().splitlines()]
    (one_view / "validation.json").unlink()
    write_checksums(one_view, [name for name in listed if name != "validation.json"])
    assert problems_of(one_view) == {str(sums): "has no checksum of validation.json"}


def test_a_copys_own_lists_must_agree(one_view):
    right = (one_view / "validation.json").read_text()
    put(one_view / "validation.json", {"valid": False})
    assert problems_of(one_view)[f"{one_view}/validation.json"].startswith("its sha256 is")
    put(one_view / "validation.json", right)
    sums = one_view / SUMS
    listed = [line.split("  ")[1] for line in sums.read_text().splitlines()]
    for missing in ("validation.json", "lightfield.json", "exr/view_0000f.exr"):
        write_checksums(one_view, [name for name in listed if name != missing])
        assert problems_of(one_view) == {
            f"{one_view}/{missing}": "is not a file of this dataset, or has no checksum",
            str(sums): f"has no checksum of {missing}",
        }
    write_checksums(one_view, listed)
    for name in ("README.md", "card.json", "read.py", "__pycache__/read.cpython-313.pyc"):
        (one_view / name).parent.mkdir(exist_ok=True)
        (one_view / name).write_text("of a package")
    assert problems_of(one_view) == {}
    put(one_view / "validation.json", {"valid": False})
    write_checksums(one_view, listed)
    invalid = {f"{one_view}/validation.json": "says that the dataset is not valid"}
    assert problems_of(one_view) == invalid
    for text, problem in (("no sums\n", "has no checksum"), ("", "is empty"), (None, "is missing")):
        sums.unlink()
        if text is not None:
            sums.write_text(text)
        assert problems_of(one_view) == {str(sums): problem}


def test_a_copy_is_checked_from_its_own_folder(one_view, monkeypatch):
    monkeypatch.chdir(one_view)
    assert problems_of(".") == {}
    Path("depth.png").write_bytes(b"spoilt")
    assert problems_of(".").keys() == {"depth.png"}


def test_repaired_files_are_planned_and_no_others(copy, run_program):
    first, second, third = copy
    view = next(Path(first.paths.folder, "exr").iterdir())
    picture = next(Path(second.paths.folder, "perspective").glob("*.png"))
    (lens_map,) = second.lens_maps("perspective")
    picture_of_report = f"{first.paths.folder}/report/rig.svg"
    record = second.receipts("render")[0]
    spoilt = {
        str(view): first.receipts("render")[0],
        str(picture): second.receipts("perspective")[0],
        lens_map: lens_map,
        picture_of_report: picture_of_report,
        record: record,
    }
    rng = random.Random(3)
    for name in spoilt:
        spoil(Path(name), replace, rng)
    Path(first.paths.folder, "notes.txt").write_text("a stray")
    arguments = ("verify.py", first.paths.folder, second.paths.folder, third.paths.folder)
    result = run_program(*arguments, "--work", "work", check=False)
    assert result.returncode == 1
    assert sorted(line.split(": ")[0] for line in result.stdout.splitlines()) == sorted(
        [*spoilt, f"{first.paths.folder}/notes.txt"]
    )
    result = run_program(*arguments, "--work", "work", "--mend", check=False)
    assert result.stderr == (
        f"error: 6 faults in {', '.join(arguments[1:])}; the next run makes them again\n"
    )
    planned = simulated.planned(Path(), "smoke")
    assert set(spoilt.values()) <= planned
    assert not any(name.startswith((third.paths.folder, third.paths.work)) for name in planned)
    assert second.inventory not in planned and second.blend not in planned
    assert f"{second.paths.folder}/lightfield.json" not in planned
    assert Path("work/removed", first.paths.folder, "notes.txt").read_text() == "a stray"


@pytest.mark.slow
def test_files_of_other_settings_are_planned_without_snakemakes_metadata(copy):
    first, second, third = copy
    shutil.rmtree(".snakemake")
    scene = Path("configs/scenes/smoke.yaml")
    text = scene.read_text()
    # The checkout's files are links to the repository's own.
    scene.unlink()
    scene.write_text(text.replace("size: 0.5", "size: 0.25", 1))
    planned = simulated.planned(Path(), "smoke")
    assert {f"{second.paths.folder}/lightfield.json", *second.all_receipts} <= planned
    others = {name for name in planned if name.startswith((first.paths.folder, third.paths.folder))}
    # A page shows the scene YAML.
    assert others == {first.paths.page, third.paths.page}
    scene.write_text(text.replace("samples: 4", "samples: 2"))
    planned = simulated.planned(Path(), "smoke")
    assert all({f"{d.paths.folder}/lightfield.json", *d.all_receipts} <= planned for d in copy)
