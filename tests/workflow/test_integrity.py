"""Integrity: which lists name a fault in a file of a dataset, and what is removed to mend it."""

import errno
import hashlib
import json
import os
from pathlib import Path

import bookkeeping
import pytest
import simulated
from checkouts import checkout
from simulated import put, write_checksums

from lightfield.core.files import sha256
from lightfield.validation import integrity
from lightfield.validation.integrity import Integrity


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """The datasets of a simulated build, which is the current folder."""
    root = checkout(tmp_path / "plenoforge")
    datasets = simulated.build(root)
    monkeypatch.chdir(root)
    return datasets


def test_a_damaged_ledger_is_named_and_written_anew(copy):
    path = Path("work/ledger.txt")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0].replace("0", "1", 1), *lines[1:]]))
    for dataset in copy:
        assert "work/ledger.txt" in problems_of(dataset.name)
    absolute = Integrity(Path(copy[0].paths.folder).absolute(), Path("work").absolute())
    damaged = next(fault for fault in absolute.faults() if fault.path.name == "ledger.txt")
    assert "1" in damaged.problem
    absolute.mend(damaged)
    assert path.read_text() == "".join(lines[1:])
    assert not any("work/ledger.txt" in problems_of(dataset.name) for dataset in copy)


# ---- a dataset of one view, alone and as a frame of a sequence ------------------------------


def write_work_files(name):
    """Write a dataset's files of work. Return their paths."""
    folder = Path("work", name)
    view = Path(f"results/{name}/exr/view_0000f.exr")
    entry = {"bytes": view.stat().st_size, "sha256": sha256(view)}
    record = {"files": {"exr/view_0000f.exr": entry}}
    sums = Path(f"results/{name}/sha256sums.txt").read_text()
    contents = {
        folder / "render/0-1.json": json.dumps(record),
        folder / "render/0-1.sums.jsonl": "{}",
        folder / "places.json": "{}",
        folder / "checksums.txt": sums,
        Path("work/benchmarks", name, "r.tsv"): "seconds",
    }
    for path, text in contents.items():
        put(path, text)
    return list(contents)


OF_SCENE = [
    "work/scene_near/inventory.json",
    "work/scene/scene.json",
    "results/scene_near/splits.json",
]
OF_OTHERS = [
    "work/scene_far/x.json",
    "work/scene_near_too/x.json",
    "work/scen/x.json",
    "work/x.json",
]


@pytest.fixture(params=["scene_near/rig", "scene_near/rig/f00001"])
def small(request, tmp_path, monkeypatch):
    """Small datasets beside one another, and the name of one of them."""
    monkeypatch.chdir(tmp_path)
    name = request.param
    noted = []
    for dataset_name in (name, f"{name[:-1]}2", "scene_near/other"):
        simulated.write_one_view(Path("results", dataset_name))
        noted += write_work_files(dataset_name)
        listed = ("exr/view_0000f.exr", "exports/colmap/sparse/points.txt", "depth.png")
        present = [path for path in Path("results", dataset_name).rglob("*") if path.is_file()]
        noted += [
            path
            for path in present
            if path.relative_to(f"results/{dataset_name}").as_posix() not in listed
        ]
    for path in map(Path, OF_SCENE + OF_OTHERS):
        put(path, {"of": str(path)})
        noted.append(path)
    bookkeeping.note(sorted({str(path) for path in noted}))
    return name


def problems_of(name, work="work"):
    integrity = Integrity(Path("results", name), Path(work) if work else None)
    faults = list(integrity.faults())
    assert len({fault.path for fault in faults}) == len(faults)
    return {str(fault.path): fault.problem for fault in faults}


def test_a_dataset_has_the_faults_of_its_own_files_only(small):
    assert problems_of(small) == problems_of(small, None) == {}
    own_paths = {path for path in Path("results", small).rglob("*") if path.is_file()}
    published_ones = {path for path in own_paths if "report" not in path.parts}
    own_paths |= {path for path in Path("work", small).rglob("*") if path.is_file()}
    own_paths |= {Path("work/benchmarks", small, "r.tsv"), *map(Path, OF_SCENE)}
    all_paths = [p for top in ("results", "work") for p in Path(top).rglob("*") if p.is_file()]
    assert len(own_paths) == 17 and own_paths < set(all_paths)
    for path in all_paths:
        if path.name in ("ledger.txt", ".ledger.txt.lock"):
            continue
        content = path.read_bytes()
        path.write_bytes(content + b"\n")
        assert problems_of(small).keys() == ({str(path)} if path in own_paths else set()), path
        if path in published_ones and path.name != "sha256sums.txt":
            assert problems_of(small, None).keys() == {str(path)}
        path.write_bytes(content)
    stray = Path("results", small, "stray.txt")
    stray.touch()
    assert problems_of(small) == {str(stray): "is not a file of this dataset, or has no checksum"}


def test_the_list_that_a_file_disagrees_with_is_named(small):
    folder = Path("results", small)
    for name, source in (
        ("lightfield.json", "work/ledger.txt"),
        ("exr/view_0000f.exr", "its record"),
        ("depth.png", "sha256sums.txt"),
    ):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content + b" ")
        digest, right = hashlib.sha256(content + b" "), hashlib.sha256(content)
        problem = f"its sha256 is {digest.hexdigest()}, but {source} says {right.hexdigest()}"
        assert problems_of(small) == {f"results/{small}/{name}": problem}
        (folder / name).write_bytes(content)


def test_a_dataset_that_is_not_valid_is_named(small):
    folder = Path("results", small)
    sums = folder / "sha256sums.txt"
    listed = [line.split("  ")[1] for line in sums.read_text().splitlines()]
    put(folder / "validation.json", {"valid": False})
    write_checksums(folder, listed)
    work_sums = Path(f"work/{small}/checksums.txt")
    work_sums.write_text(sums.read_text())
    bookkeeping.note([f"{folder}/validation.json", str(sums), str(work_sums)])
    invalid = {f"{folder}/validation.json": "says that the dataset is not valid"}
    assert problems_of(small) == invalid


def test_any_remaining_list_is_enough_for_a_view(small):
    """Three lists have its checksum: that of published files, the shard's record and its log."""
    view = Path("results", small, "exr/view_0000f.exr")
    log = Path("work", small, "render/0-1.sums.jsonl")
    line = {"file": "exr/view_0000f.exr", "key": "0", "sha256": sha256(view)}
    log.write_text(json.dumps(line))
    bookkeeping.note([str(log)])
    view.write_bytes(b"spoilt")
    lists = [view.parents[1] / "sha256sums.txt", Path("work", small, "checksums.txt")]
    lists += [log.with_name("0-1.json"), log]
    for number, path in enumerate(lists):
        assert problems_of(small)[str(view)].startswith("its sha256 is "), number
        path.write_bytes(b"spoilt")
    assert problems_of(small)[str(view)] == "is not a file of this dataset, or has no checksum"
    view.unlink()
    view.mkdir()
    assert str(view) in problems_of(small)


def test_an_unreadable_file_is_a_fault(small, monkeypatch):
    def failing(path):
        if path.name == "depth.png":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return sha256(path)

    monkeypatch.setattr(integrity, "sha256", failing)
    image = f"results/{small}/depth.png"
    assert problems_of(small) == {image: "cannot be read: Input/output error"}


def test_without_a_ledger_only_published_files_have_a_checksum(small):
    Path("work/ledger.txt").unlink()
    stray = Path("results", small, "depth.png")
    stray.write_bytes(b"spoilt")
    problems = problems_of(small)
    assert problems.pop("work/ledger.txt").startswith("is missing")
    assert problems.keys() == {str(stray)}


@pytest.mark.parametrize(
    ("spoilt", "follower"),
    [
        ("results/{}/exports/colmap/sparse/points.txt", "results/{}/exports/colmap/export.json"),
        ("results/{}/depth.png", "results/{}/transforms.json"),
        ("work/{}/render/0-1.sums.jsonl", "work/{}/render/0-1.json"),
        ("work/{}/places.json", None),
        ("results/{}/exr/view_0000f.exr", None),
        ("results/{}/lightfield.json", None),
    ],
)
def test_a_fault_also_removes_what_identifies_the_files_job(spoilt, follower, small):
    path = spoilt.format(small)
    expected = {path, follower.format(small)} if follower else {path}
    Path(path).write_bytes(b"spoilt")
    integrity = Integrity(Path("results", small), Path("work"))
    (fault,) = integrity.faults()
    integrity.mend(fault)
    aside = {
        str(p.relative_to("work/removed")) for p in Path("work/removed").rglob("*") if p.is_file()
    }
    assert aside == expected
    assert not any(Path(name).exists() for name in expected)
    # A file that will be made again counts as missing.
    assert expected <= problems_of(small).keys()


def test_history_that_was_set_aside_is_not_missed(small):
    path = Path("work/benchmarks", small, "r.tsv")
    path.write_bytes(b"spoilt")
    integrity = Integrity(Path("results", small), Path("work"))
    (fault,) = integrity.faults()
    integrity.mend(fault)
    assert problems_of(small) == {}
    assert not path.exists() and Path("work/removed", path).read_bytes() == b"spoilt"
