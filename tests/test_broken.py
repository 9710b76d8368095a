"""A broken small file is named in one line, set aside, and made again."""

import json
import os
import re
from pathlib import Path

import pytest
import simulated
from checkouts import checkout, snakemake

from lightfield.core.files import broken, set_aside, sha256
from lightfield.dataset import ledger


def folder_of(path):
    path.unlink()
    (path / "inside").mkdir(parents=True)


def text(content):
    return lambda path: path.write_bytes(content)


FAULTS = [
    (folder_of, "is a folder"),
    (text(b'{"half": ['), "is not JSON: "),
    (text(b"[1, 2]"), "is a list, not a mapping"),
    (text(b'{"\xff": 1}'), "is no text in UTF-8"),
    (text(b""), "is empty"),
    (text(b"null"), "is a NoneType, not a mapping"),
]


@pytest.mark.parametrize(("spoil", "problem"), FAULTS)
def test_what_cannot_be_read_is_said(spoil, problem, tmp_path):
    path = tmp_path / "a.json"
    assert broken(path) is None
    path.write_text("{}")
    assert broken(path) is None
    spoil(path)
    assert (broken(path) or "").startswith(problem)


def test_nothing_that_was_set_aside_is_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for content in "ab":
        Path("results").mkdir(exist_ok=True)
        Path("results/a.json").write_text(content)
        set_aside(Path("results/a.json"), Path("work/removed"))
    assert Path("work/removed/results/a.json").read_text() == "a"
    assert Path("work/removed/results/a.json.2").read_text() == "b"
    assert not Path("results/a.json").exists()


def test_what_lies_elsewhere_is_set_aside_where_all_else_is(tmp_path, monkeypatch):
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path / "own")
    inside = Path("work/removed") / (tmp_path / "a.json").relative_to("/")
    for path, name in ((tmp_path / "a.json", inside.name), (Path("../a.json"), "a.json.2")):
        (tmp_path / "a.json").touch()
        assert set_aside(path, Path("work/removed")) == inside.with_name(name)
        assert inside.with_name(name).is_file()


def run(folder, *arguments):
    result = snakemake(folder, *arguments)
    told = result.stdout + result.stderr
    assert result.returncode == 0, told
    assert "Traceback" not in told
    return told


def test_a_folder_is_set_aside_where_a_link_that_leads_nowhere_was(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.exr").symlink_to("a.exr")
    set_aside(Path("a.exr"), Path("removed"))
    Path("a.exr/inside").mkdir(parents=True)
    assert set_aside(Path("a.exr"), Path("removed")) == Path("removed/a.exr.2")
    assert Path("removed/a.exr").is_symlink()
    assert Path("removed/a.exr.2/inside").is_dir()


@pytest.mark.slow
def test_what_is_broken_is_planned_again_and_set_aside(tmp_path):
    folder = checkout(tmp_path)
    datasets = simulated.build(folder)
    assert "Nothing to be done" in run(folder, "-n", "smoke")
    before = ledger.read(folder / "work/ledger.txt")
    one, two, three = datasets
    spoilt = [
        one.record("render", *one.shards[0]),
        one.record("perspective", *one.shards[0]),
        f"{one.work}/cameras.json",
        one.costs,
        f"{two.folder}/lightfield.json",
        f"{two.work}/perspective/lens_map.npy",
        three.inventory,
        three.page,
        f"{three.folder}/validation.json",
    ]
    for number, name in enumerate(spoilt):
        spoil = FAULTS[number % 5][0] if name.endswith(".json") else folder_of
        spoil(folder / name)
        os.utime(folder / name, (simulated.WHEN, simulated.WHEN))
    view = next((folder / three.folder / "exr").iterdir())
    folder_of(view)
    # A link to itself: not even whether it is a folder can be asked.
    loop = Path(one.record("render", *one.shards[0])).with_suffix(".journal.jsonl")
    (folder / loop).unlink(missing_ok=True)
    (folder / loop).symlink_to(loop.name)
    told = run(folder, "-n", "smoke")
    assert f"{loop}: is a link that leads to no file; it is made anew" in told
    for name in [*spoilt, str(view.relative_to(folder))]:
        assert len(re.findall(rf"^{re.escape(name)}: .*; it is made anew$", told, re.M)) == 1
        assert (folder / name).exists()
    assert {*spoilt, three.record("render", *three.shards[0])} <= simulated.planned(folder, "smoke")
    # The run sets aside what it makes again, before its first job: the second dataset's cameras.
    run(folder, "--until", "lightfield", "--", "smoke")
    aside = {path for path in (folder / "work/removed").rglob("*") if path.is_file()}
    assert folder / "work/removed" / two.folder / "lightfield.json" in aside
    assert (folder / spoilt[0]).exists()
    assert broken(folder / two.folder / "lightfield.json") is None
    # What its job has made is noted, and only that.
    noted = ledger.read(folder / "work/ledger.txt")
    assert noted[f"{two.folder}/lightfield.json"] == sha256(folder / two.folder / "lightfield.json")
    assert noted[f"{one.work}/cameras.json"] == before[f"{one.work}/cameras.json"]


@pytest.mark.slow
def test_a_dataset_named_alone_notices_a_changed_yaml_and_what_is_broken(tmp_path):
    folder = checkout(tmp_path)
    one, two, _ = simulated.build(folder)
    targets = [f"{one.folder}/sha256sums.txt", two.package]
    assert not simulated.planned(folder, targets[0])
    path = folder / "configs/scenes/smoke.yaml"
    path.write_text(re.sub(r"samples: \d+", "samples: 3", path.read_text(), count=1))
    (folder / two.costs).write_text("{")
    os.utime(folder / two.costs, (simulated.WHEN, simulated.WHEN))
    expected = {f"{d.folder}/lightfield.json" for d in (one, two)} | {two.costs}
    assert expected <= simulated.planned(folder, *targets)


@pytest.mark.slow
def test_a_reprojection_that_does_not_say_how_it_was_made_is_made_anew_alone(tmp_path):
    folder = checkout(tmp_path)
    one, *_ = simulated.build(folder)
    path = folder / one.folder / "perspective/lightfield.json"
    content = json.loads(path.read_text())
    del content["reprojection"]
    path.write_text(json.dumps(content))
    ngp = folder / one.folder / "perspective_hdr/transforms.json"
    ngp.write_text(json.dumps({"frames": []}))
    for changed in (path, ngp):
        os.utime(changed, (simulated.WHEN, simulated.WHEN))
    files = simulated.planned(folder, "smoke")
    assert {str(p.relative_to(folder)) for p in (path, ngp)} <= files
    assert not files & {*one.all_records}


@pytest.mark.slow
def test_what_views_are_made_from_is_verified_before_it_is_used(tmp_path):
    simulated.build(checkout(tmp_path))
    paths = ["work/smoke/inventory.json", "work/smoke/scene.blend"]
    for path in paths:
        content = (tmp_path / path).read_bytes()
        (tmp_path / path).write_bytes(content.replace(b"s", b"t", 1))
        os.utime(tmp_path / path, (simulated.WHEN, simulated.WHEN))
    result = snakemake(tmp_path, "smoke", "--dry-run", "--quiet", "all")
    assert result.returncode == 0, result.stderr
    said = [line for line in result.stderr.splitlines() if "made anew" in line]
    problem = "its sha256 is not the one in ledger.txt; it is made anew"
    assert sorted(said) == [f"{path}: {problem}" for path in paths]
