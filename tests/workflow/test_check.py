"""The check of many jobs: a file that many jobs share is read once, and each fault is named."""

import json
import os
from pathlib import Path

import pytest
from faults import FAULTS

from lightfield.core import receipts
from lightfield.core.files import Stamp, identity_and_sha256, size_and_time
from lightfield.workflow import check
from lightfield.workflow.check import JobCheck


@pytest.fixture
def folder(nobody, monkeypatch):
    monkeypatch.chdir(nobody)
    return nobody


def make(name, content, inputs=(), **settings):
    """Make a file as the job of a stage does. Return its receipt."""
    path = Path("work/receipts/scene", f"{name}.jsonl")
    header = {"stage": "stage", "version": 1, "settings": settings}
    with receipts.opened(path, header, [Path(f"{name}.json")]) as receipt:
        for each in inputs:
            receipt.add_input(each)
        Path(f"{name}.json").write_text(content)
        receipt.note_written(Path(f"{name}.json"), Stamp.of(f"{name}.json"))
        receipt.seal()
    return str(path)


def verdict(path, **settings):
    return JobCheck(Path("work"), lambda _: settings, {"stage": 1}).verdict(path, settings)


def test_a_changed_setting_input_or_version_makes_a_job_outdated(folder):
    Path("scene.yaml").write_text("red")
    path = make("a", "[]", ["scene.yaml"], samples=4)
    assert verdict(path, samples=4).is_fine
    assert verdict(path, samples=5).outdated == ["setting samples"]
    assert verdict(path, samples=4, denoise=True).outdated == ["setting denoise"]
    newer = JobCheck(Path("work"), lambda _: None, {"stage": 2}).verdict(path, {"samples": 4})
    assert newer.outdated == ["version of stage"]
    os.utime("scene.yaml")
    assert verdict(path, samples=4).is_fine
    Path("scene.yaml").write_text("blue")
    assert verdict(path, samples=4).outdated == ["scene.yaml"]
    Path("scene.yaml").unlink()
    assert verdict(path, samples=4).outdated == ["scene.yaml"]


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
        jobs = JobCheck(Path("work"), lambda _: {}, {"stage": 1})
        assert all(jobs.verdict(path, {}).is_fine for path in paths)
        jobs.sums.save()
    assert reads == ["scene.blend"]


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_the_check_names_the_damaged_file(folder, fault):
    files = [Path(f"{name}.json") for name in "ab"]
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
