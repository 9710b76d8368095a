"""Verify: it finds and names every fault in every kind of file, and runs repair it."""

import errno
import hashlib
import json
import os
import random
import shutil
from pathlib import Path

import pytest
import simulated
from checkouts import checkout

from lightfield.core.files import sha256
from lightfield.dataset.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.validation import integrity
from lightfield.validation.integrity import Integrity
from soak import KINDS, replace, spoil


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
    return {
        str(fault.path): fault
        for dataset in datasets
        for fault in Integrity(Path(dataset.folder), Path(work) if work else None).faults()
    }


def own_files(*folders):
    """Return the files that jobs made. Leaves out the index, which belongs to no single dataset."""
    paths = [path for name in folders for path in sorted(Path(name).rglob("*")) if path.is_file()]
    return [
        path
        for path in paths
        if path not in (Path("work/ledger.txt"), Path("results/index.html"))
        and "settings" not in path.parts
        and not path.name.endswith(".lock")
    ]


def test_a_build_and_its_copy_have_no_fault(copy):
    assert faults(copy) == {}
    assert faults(copy, work=None) == {}


def test_a_fault_in_a_copy_is_found_without_the_folder_of_work(copy):
    rng = random.Random(2)
    for dataset in copy:
        files = [path for path in own_files(dataset.folder) if "report" not in path.parts]
        # The file of checksums has two faults. Only one is named.
        chosen = rng.sample([path for path in files if path.name != "sha256sums.txt"], 6)
        for path in chosen:
            spoil(path, rng.choice(KINDS), rng)
        assert faults([dataset], work=None).keys() == {str(path) for path in chosen}


def test_a_name_that_leaves_the_dataset_is_not_its_file(copy):
    with Path(copy[0].folder, "sha256sums.txt").open("a") as sums:
        for name in ("../outside.txt", "exr/../../outside.txt", "/outside.txt", ""):
            sums.write(f"{'0' * 64}  {name}\n")
    assert faults(copy[:1], work=None) == {}


def test_a_damaged_ledger_is_named_and_written_anew(copy):
    path = Path("work/ledger.txt")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0].replace("0", "1", 1), *lines[1:]]))
    for dataset in copy:
        assert "work/ledger.txt" in faults([dataset])
    absolute = Integrity(Path(copy[0].folder).absolute(), Path("work").absolute())
    damaged = next(fault for fault in absolute.faults() if fault.path.name == "ledger.txt")
    assert "1" in damaged.problem
    absolute.mend(damaged)
    assert path.read_text() == "".join(lines[1:])
    assert "work/ledger.txt" not in faults(copy)


def test_repaired_files_are_planned_and_no_others(copy, run_program):
    first, second, third = copy
    view = next(Path(first.folder, "exr").iterdir())
    picture = next(Path(second.folder, "perspective").glob("*.png"))
    spoilt = {
        str(view): first.record("render", *first.shards[0]),
        str(picture): second.record("perspective", *second.shards[0]),
        f"{second.work}/perspective/lens_map.npy": f"{second.work}/perspective/lens_map.npy",
        f"{first.folder}/report/rig.svg": f"{first.folder}/report/rig.svg",
        second.record("render", *second.shards[0]): second.record("render", *second.shards[0]),
    }
    rng = random.Random(3)
    for name in spoilt:
        spoil(Path(name), replace, rng)
    Path(first.folder, "notes.txt").write_text("a stray")
    arguments = ("verify.py", first.folder, second.folder, third.folder)
    result = run_program(*arguments, "--work", "work", check=False)
    assert result.returncode == 1
    assert sorted(line.split(": ")[0] for line in result.stdout.splitlines()) == sorted(
        [*spoilt, f"{first.folder}/notes.txt"]
    )
    result = run_program(*arguments, "--work", "work", "--mend", check=False)
    assert result.stderr == (
        f"error: 6 faults in {', '.join(arguments[1:])}; the next run makes them again\n"
    )
    planned = simulated.planned(Path(), "smoke")
    assert set(spoilt.values()) <= planned
    assert not any(name.startswith((third.folder, third.work)) for name in planned)
    assert second.inventory not in planned and second.blend not in planned
    assert f"{second.folder}/lightfield.json" not in planned
    assert Path("work/removed", first.folder, "notes.txt").read_text() == "a stray"


# ---- a dataset of one view, alone and as a frame of a sequence ------------------------------


def put(path, content):
    """Write a text, or other content as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))


def published(folder):
    """Write a dataset of one view, and its file of checksums."""
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [4, 4]})
    rig = {"type": "plane", "cameras": [1, 1]}
    LightField.from_rig(rig, lens).write(folder / "lightfield.json")
    put(folder / "validation.json", {"valid": True})
    files = ["exr/view_0000f.exr", "transforms.json", "depth.png"]
    files += ["exports/colmap/export.json", "exports/colmap/sparse/points.txt"]
    for name in files:
        put(folder / name, f'{{"name": "{folder}/{name}"}}')
    write_checksums(folder, [*files, "lightfield.json", "validation.json"])
    put(folder / "report/page.html", "a page")


def write_checksums(folder, names):
    lines = [f"{sha256(folder / name)}  {name}\n" for name in sorted(names)]
    put(folder / "sha256sums.txt", "".join(lines))


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
        published(Path("results", dataset_name))
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
    simulated.note(sorted({str(path) for path in noted}))
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


def test_a_copys_own_lists_must_agree(small):
    folder = Path("results", small)
    right = (folder / "validation.json").read_text()
    put(folder / "validation.json", {"valid": False})
    assert problems_of(small, None)[f"{folder}/validation.json"].startswith("its sha256 is")
    put(folder / "validation.json", right)
    sums = f"{folder}/sha256sums.txt"
    listed = [line.split("  ")[1] for line in Path(sums).read_text().splitlines()]
    for missing in ("validation.json", "lightfield.json", "exr/view_0000f.exr"):
        write_checksums(folder, [name for name in listed if name != missing])
        assert problems_of(small, None) == {
            f"{folder}/{missing}": "is not a file of this dataset, or has no checksum",
            sums: f"has no checksum of {missing}",
        }
    write_checksums(folder, listed)
    for name in ("README.md", "card.json"):
        (folder / name).write_text("of a package")
    assert problems_of(small, None) == {}
    put(folder / "validation.json", {"valid": False})
    write_checksums(folder, listed)
    invalid = {f"{folder}/validation.json": "says that the dataset is not valid"}
    assert problems_of(small, None) == invalid
    written = [f"{folder}/validation.json", sums, f"work/{small}/checksums.txt"]
    Path(written[-1]).write_text(Path(sums).read_text())
    simulated.note(written)
    # A run that adds a package notes its files.
    added = {f"{folder}/{name}" for name in ("README.md", "card.json")}
    problems = problems_of(small)
    assert {path: problem for path, problem in problems.items() if path not in added} == invalid
    for text, problem in (("no sums\n", "has no checksum"), ("", "is empty"), (None, "is missing")):
        Path(sums).unlink()
        if text is not None:
            Path(sums).write_text(text)
        assert problems_of(small, None) == {sums: problem}


def test_any_remaining_list_is_enough_for_a_view(small):
    """Three lists have its checksum: that of published files, the shard's record and its log."""
    view = Path("results", small, "exr/view_0000f.exr")
    log = Path("work", small, "render/0-1.sums.jsonl")
    log.write_text(json.dumps({"file": "exr/view_0000f.exr", "sha256": sha256(view)}))
    simulated.note([str(log)])
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


def test_a_copy_is_checked_from_its_own_folder(small, monkeypatch):
    monkeypatch.chdir(Path("results", small))
    assert list(Integrity(Path()).faults()) == []
    Path("depth.png").write_bytes(b"spoilt")
    assert [str(fault.path) for fault in Integrity(Path()).faults()] == ["depth.png"]


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
    assert {f"{second.folder}/lightfield.json", *second.all_records} <= planned
    others = {name for name in planned if name.startswith((first.folder, third.folder))}
    # A page shows the scene YAML.
    assert others == {first.page, third.page}
    scene.write_text(text.replace("samples: 4", "samples: 2"))
    planned = simulated.planned(Path(), "smoke")
    assert all({f"{d.folder}/lightfield.json", *d.all_records} <= planned for d in copy)
