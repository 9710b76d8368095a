"""Verify: faults of every kind in files of every kind, all found, named and mended."""

import os
import random
import shutil
from pathlib import Path

import pytest
import simulated
from checkouts import checkout

from lightfield.validation.integrity import Integrity
from soak import KINDS, replace, spoil


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    root = checkout(tmp_path_factory.mktemp("verify"))
    return root, simulated.build(root)


@pytest.fixture
def copy(built, tmp_path, monkeypatch):
    """The build in a folder of its own, which is the current one; and its datasets."""
    root = Path(shutil.copytree(built[0], tmp_path / "plenoforge", copy_function=os.link))
    for name in ("results", "work"):
        shutil.rmtree(root / name)
        shutil.copytree(built[0] / name, root / name)
    monkeypatch.chdir(root)
    return built[1]


def faults(datasets, work="work"):
    return {
        str(fault.path): fault
        for dataset in datasets
        for fault in Integrity(Path(dataset.folder), Path(work) if work else None).faults()
    }


def own_files(*folders):
    """Return all files but the ledger and the index, which belong to no dataset alone."""
    found = [path for name in folders for path in sorted(Path(name).rglob("*")) if path.is_file()]
    return [
        path for path in found if path not in (Path("work/sums.json"), Path("results/index.html"))
    ]


def test_nothing_is_wrong_with_a_build_and_with_a_copy_of_it(copy):
    assert faults(copy) == {}
    assert faults(copy, work=None) == {}


def test_every_fault_is_found_and_no_other(copy):
    rng = random.Random(1)
    whole = {path: path.read_bytes() for path in own_files("results", "work")}
    done = 0
    while done < 300:
        chosen = rng.sample(sorted(whole), 10)
        first, second = chosen[:2]
        # A swap, and one fault each of the others.
        if whole[first] != whole[second]:
            first.write_bytes(whole[second])
            second.write_bytes(whole[first])
        else:
            chosen = chosen[2:]
        for path in chosen[-8:]:
            spoil(path, rng.choice(KINDS), rng)
        found = faults(copy)
        # Without its ledger's entry a record is none, and its views count by what is published.
        assert found.keys() == {str(path) for path in chosen}
        assert not any("\n" in str(fault) for fault in found.values())
        done += len(chosen)
        for path in chosen:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            path.unlink(missing_ok=True)
            path.write_bytes(whole[path])
    assert faults(copy) == {}


def test_a_fault_in_a_copy_is_found_without_the_folder_of_work(copy):
    rng = random.Random(2)
    for dataset in copy:
        files = [path for path in own_files(dataset.folder) if "report" not in path.parts]
        # Of two faults in the file of sums itself only one is named.
        chosen = rng.sample([path for path in files if path.name != "sha256sums.txt"], 6)
        for path in chosen:
            spoil(path, rng.choice(KINDS), rng)
        assert faults([dataset], work=None).keys() == {str(path) for path in chosen}


def test_a_name_that_leaves_the_dataset_is_none_of_its_files(copy):
    with Path(copy[0].folder, "sha256sums.txt").open("a") as sums:
        for name in ("../outside.txt", "exr/../../outside.txt", "/outside.txt", ""):
            sums.write(f"{'0' * 64}  {name}\n")
    assert faults(copy[:1], work=None) == {}


def test_a_damaged_ledger_is_named_and_noted_anew(copy):
    path = Path("work/sums.json")
    path.write_text(path.read_text().replace("0", "1", 1))
    for dataset in copy:
        found = list(Integrity(Path(dataset.folder), Path("work")).faults())
        assert [str(fault) for fault in found] == [
            "work/sums.json: is damaged: its own checksum does not hold"
        ]
    Integrity(Path(copy[0].folder).absolute(), Path("work").absolute()).mend(found[0])
    assert not path.exists()
    absolute = Integrity(Path(copy[0].folder).absolute(), Path("work").absolute())
    assert [str(fault.path) for fault in absolute.faults()] == ["work/sums.json"]


def test_what_is_mended_is_planned_and_nothing_else(copy, run_program):
    one, two, three = copy
    view = next(Path(one.folder, "exr").iterdir())
    picture = next(Path(two.folder, "perspective").glob("*.png"))
    spoilt = {
        str(view): one.record("render", *one.shards[0]),
        str(picture): two.record("perspective", *two.shards[0]),
        f"{two.work}/perspective/lens_map.npy": f"{two.work}/perspective/lens_map.npy",
        f"{one.folder}/report/rig.svg": f"{one.folder}/report/rig.svg",
        two.record("render", *two.shards[0]): two.record("render", *two.shards[0]),
    }
    rng = random.Random(3)
    for name in spoilt:
        spoil(Path(name), replace, rng)
    Path(one.folder, "notes.txt").write_text("a stray")
    words = ("verify.py", one.folder, two.folder, three.folder)
    told = run_program(*words, "--work", "work", check=False)
    assert told.returncode == 1
    assert sorted(line.split(": ")[0] for line in told.stdout.splitlines()) == sorted(
        [*spoilt, f"{one.folder}/notes.txt"]
    )
    told = run_program(*words, "--work", "work", "--mend", check=False)
    assert told.stderr == (
        f"error: 6 faults in {', '.join(words[1:])}; the next run makes them again\n"
    )
    planned = simulated.planned(Path(), "smoke")
    assert set(spoilt.values()) <= planned
    assert not any(name.startswith((three.folder, three.work)) for name in planned)
    assert two.inventory not in planned and two.blend not in planned
    assert f"{two.folder}/lightfield.json" not in planned
    assert Path("work/removed", one.folder, "notes.txt").read_text() == "a stray"


@pytest.mark.slow
def test_what_was_made_from_other_settings_is_planned_without_snakemakes_memory(copy):
    one, two, three = copy
    assert not Path(".snakemake", "metadata").exists()
    scene = Path("configs/scenes/smoke.yaml")
    text = scene.read_text()
    # The checkout's files are links to the repository's own.
    scene.unlink()
    scene.write_text(
        text.replace(
            "colmap: {sources: [perspective_hdr], points: 2000",
            "colmap: {sources: [perspective_hdr], points: 1000",
        )
    )
    planned = simulated.planned(Path(), "smoke")
    assert f"{one.folder}/perspective_hdr/exports/colmap/export.json" in planned
    assert f"{one.folder}/perspective_hdr/exports/nerfstudio/export.json" not in planned
    assert not any("lightfield.json" in name or name in one.all_records for name in planned)
    scene.write_text(text.replace("size: 0.5", "size: 0.25", 1))
    planned = simulated.planned(Path(), "smoke")
    assert {f"{two.folder}/lightfield.json", *two.all_records} <= planned
    assert not any(name.startswith((one.folder, three.folder)) for name in planned)
    scene.write_text(text.replace("samples: 4", "samples: 2"))
    planned = simulated.planned(Path(), "smoke")
    assert all({f"{d.folder}/lightfield.json", *d.all_records} <= planned for d in copy)
