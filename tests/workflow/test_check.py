"""The check of many jobs: a file that many jobs share is read once, and each fault is named."""

import json
import os
from pathlib import Path

import pytest
from faults import FAULTS

from lightfield.core.files import Stamp, identity_and_sha256, size_and_time
from lightfield.engine import receipts
from lightfield.workflow import check
from lightfield.workflow.check import JobCheck


@pytest.fixture
def folder(nobody, monkeypatch):
    monkeypatch.chdir(nobody)
    return nobody


def make(name, content, inputs=(), **settings):
    """Make a file as the job of a stage does. Return its receipt."""
    path = Path("work/receipts/scene", f"{name}.jsonl")
    file = Path("results/scene", f"{name}.json")
    file.parent.mkdir(parents=True, exist_ok=True)
    header = {"stage": "stage", "version": 1, "settings": settings}
    with receipts.opened(path, header, [file]) as receipt:
        for each in inputs:
            receipt.add_input(each)
        file.write_text(content)
        receipt.note_written(file, Stamp.of(file))
        receipt.seal()
    return str(path)


def verdict(path, **settings):
    return JobCheck(Path("work"), Path("results"), lambda _: settings, {"stage": 1}).verdict(
        path, settings
    )


def test_a_changed_setting_input_or_version_makes_a_job_outdated(folder):
    Path("scene.yaml").write_text("red")
    path = make("a", "[]", ["scene.yaml"], samples=4)
    assert verdict(path, samples=4).is_fine
    assert verdict(path, samples=5).outdated == ["setting samples"]
    assert verdict(path, samples=4, denoise=True).outdated == ["setting denoise"]
    newer = JobCheck(Path("work"), Path("results"), lambda _: None, {"stage": 2}).verdict(
        path, {"samples": 4}
    )
    assert newer.outdated == ["version of stage"]
    os.utime("scene.yaml")
    assert verdict(path, samples=4).is_fine
    Path("scene.yaml").write_text("blue")
    assert verdict(path, samples=4).outdated == ["scene.yaml"]
    Path("scene.yaml").unlink()
    assert verdict(path, samples=4).outdated == ["scene.yaml"]


def test_a_job_runs_for_a_file_that_it_has_not_read_but_is_not_called_outdated(folder):
    for name in ("scene.yaml", "places.json"):
        Path(name).write_text(name)
    path = make("a", "[]", ["scene.yaml"])
    jobs = JobCheck(Path("work"), Path("results"), lambda _: {}, {"stage": 1})
    found = jobs.verdict(path, {}, ["scene.yaml", "places.json"])
    assert not found.is_fine and not found.outdated
    assert found.unread == ["places.json"]


def test_a_newer_receipt_is_a_reason_to_run_only_if_its_job_runs(folder):
    first = make("a", "[1]")
    second = make("b", "[2]", [first])
    later = Path("results/scene/b.json").stat().st_mtime + 60
    os.utime(first, (later, later))
    for wanted, is_only_newer in (({}, True), ({"quality": 2}, False)):
        settings = {first: wanted, second: {}}
        jobs = JobCheck(Path("work"), Path("results"), settings.get, {"stage": 1})
        assert jobs.verdict(second, {}).is_fine
        assert jobs.is_only_newer(second, first) == is_only_newer


def test_an_equal_remake_changes_nothing_behind_it(folder):
    first = make("a", "[1]")
    second = make("b", "[2]", [first])
    make("a", "[1]", quality=2)
    assert verdict(second).is_fine
    make("a", "[3]", quality=3)
    assert verdict(second).outdated == [first]


def test_a_touched_file_is_read_once_for_all_jobs_and_plans(folder, monkeypatch):
    Path("scene.blend").write_text("scene")
    paths = [make(str(number), "[]", ["scene.blend"]) for number in range(20)]
    os.utime("scene.blend")
    reads = []
    monkeypatch.setattr(
        check, "identity_and_sha256", lambda path: reads.append(path) or identity_and_sha256(path)
    )
    for _ in range(2):
        jobs = JobCheck(Path("work"), Path("results"), lambda _: {}, {"stage": 1})
        assert all(jobs.verdict(path, {}).is_fine for path in paths)
        jobs.sums.save()
    assert reads == ["scene.blend"]


def test_sums_are_kept_where_the_run_began(folder, monkeypatch):
    """Snakemake leaves that folder before its process ends."""
    Path("scene.blend").write_text("a scene")
    sums = check.Sums(Path("work/sums.json"))
    sums.of("scene.blend")
    for name in ("work", "elsewhere"):
        (folder / name).mkdir(exist_ok=True)
    monkeypatch.chdir("elsewhere")
    sums.save()
    assert "scene.blend" in json.loads((folder / "work/sums.json").read_text())


@pytest.mark.parametrize("content", ["5", "[]", "{", '{"a": 5}', '{"a": []}', '{"a": [1, 2]}'])
def test_damaged_notes_of_sums_are_no_hindrance(folder, content):
    path = make("a", "[]")
    file = Path("results/scene/a.json")
    os.utime(file, (1, 1))
    Path("work/sums.json").write_text(content.replace('"a"', f'"{file}"'))
    assert verdict(path).is_fine


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_the_check_names_the_damaged_file(folder, fault):
    files = [Path(f"results/scene/{name}.json") for name in "ab"]
    paths = [make(path.stem, json.dumps({"number": [n] * 10})) for n, path in enumerate(files)]
    sibling = folder / "c.json"
    sibling.write_text("{}")
    status = files[0].stat()
    apply, sets_time_back = FAULTS[fault]
    apply(folder / files[0], sibling)
    if sets_time_back and fault != "swapped":
        os.utime(files[0], ns=(status.st_atime_ns, status.st_mtime_ns))
    has_other_stamp = size_and_time(files[0]) != (status.st_size, status.st_mtime_ns)
    # A plan reads only files with another size or time.
    assert verdict(paths[0]).damaged == [str(files[0])] * has_other_stamp
    assert verdict(paths[1]).is_fine


# ---- receipts into which somebody else wrote ------------------------------------------------


def add_line(path, name):
    """Add a file to a receipt, which is not as the receipt says."""
    line = {"file": str(name), "sha256": "0" * 64, "bytes": 1, "modified_ns": 1}
    with Path(path).open("a") as receipt:
        receipt.write(json.dumps(line) + "\n")


@pytest.mark.parametrize("name", ["{}/x", "../x", "x", "results/../x", "resultsx/y", "results"])
def test_a_receipt_that_names_other_files_is_none_and_nobody_reads_them(folder, name, monkeypatch):
    path = make("a", "[]")
    assert verdict(path).is_fine
    add_line(path, name.format(folder))
    reads = []
    monkeypatch.setattr(Stamp, "of", reads.append)
    found = verdict(path)
    assert (found.has_receipt, found.damaged, found.elsewhere) == (False, [], None)
    assert not reads


def test_a_receipt_of_other_results_is_named(folder):
    path = make("a", "[]")
    check = JobCheck(Path("work"), Path("moved"), lambda _: {}, {"stage": 1})
    assert check.verdict(path, {}).elsewhere == "results/scene/a.json"


@pytest.mark.parametrize("results", ["../out", "{}/out"])
def test_results_may_lie_in_another_folder(folder, results, monkeypatch):
    (folder / "here").mkdir()
    monkeypatch.chdir(folder / "here")
    results = Path(results.format(folder))
    file = results / "scene/a.json"
    file.parent.mkdir(parents=True)
    file.write_text("[]")
    path = Path("work/receipts/scene/a.jsonl")
    with receipts.opened(path, {"stage": "stage", "version": 1, "settings": {}}, [file]) as receipt:
        receipt.note_written(file, Stamp.of(file))
        receipt.seal()

    def found():
        return JobCheck(Path("work"), results, lambda _: {}, {"stage": 1}).verdict(str(path), {})

    assert found().is_fine
    file.write_text("[1]")
    assert found().damaged == [str(file)]
