"""The ledger with many jobs: a file that many jobs share is read once."""

import json
import os

import pytest
from faults import FAULTS

from lightfield.core.files import sha256
from lightfield.workflow import ledger
from lightfield.workflow.ledger import Job, Ledger, Stamp


def test_a_source_file_is_read_once_for_all_its_readers(tmp_path, monkeypatch):
    scene = tmp_path / "scene.blend"
    scene.write_bytes(b"scene")
    reads = []
    monkeypatch.setattr(ledger, "sha256", lambda path: reads.append(path) or sha256(path))
    jobs = Ledger(tmp_path / "ledger.txt")
    for _ in range(20):
        (stamp,) = jobs.input_stamps([str(scene)]).values()
        assert stamp.sha256 == sha256(scene)
    assert len(reads) == 1
    scene.write_bytes(b"another")
    (stamp,) = jobs.input_stamps([str(scene)]).values()
    assert stamp.sha256 == sha256(scene)


def test_a_touched_file_is_read_once_for_all_jobs_that_read_it(tmp_path, monkeypatch):
    scene = tmp_path / "scene.blend"
    scene.write_bytes(b"scene")
    made = Ledger(tmp_path / "ledger.txt")
    outputs = [str(tmp_path / f"{number}.json") for number in range(20)]
    for output in outputs:
        made.note(Job([output], {}, {}, {str(scene): Stamp.of(scene)}))
    os.utime(scene)
    reads = []
    monkeypatch.setattr(ledger, "sha256", lambda path: reads.append(path) or sha256(path))
    planned = Ledger(tmp_path / "ledger.txt")
    assert [planned.changed_input(output) for output in outputs] == [None] * 20
    assert len(reads) == 1
    # The same process notices other bytes too.
    scene.write_bytes(b"another")
    assert {planned.changed_input(output) for output in outputs} == {str(scene)}


def test_a_file_that_a_later_job_replaced_is_outdated_and_not_damaged(tmp_path):
    path = tmp_path / "ledger.txt"
    view = tmp_path / "view.exr"
    for name, content in (("0-4.json", b"first"), ("0-2.json", b"second")):
        record = tmp_path / name
        record.write_text("{}")
        view.write_bytes(content)
        files = {str(file): Stamp.of(file) for file in (record, view)}
        Ledger(path).note(Job([str(record)], files, {}, {}))
    planned = Ledger(path)
    assert planned.damage == {}
    assert planned.replaced == {str(view): [str(tmp_path / "0-4.json")]}
    # No run may note the first job's checksum with the times of the second job's file.
    planned.refresh()
    assert Ledger(path).replaced == planned.replaced
    view.write_bytes(b"damage")
    assert str(view) in Ledger(path).damage


def note(path, *files):
    """Write into a ledger that a job made this file."""
    stamps = {str(file): ledger.Stamp.of(file) for file in files}
    ledger.Ledger(path).note(ledger.Job([str(files[0])], stamps, {}, {}))


@pytest.mark.parametrize("fault", sorted(FAULTS.keys() - {"deleted"}))
def test_the_ledger_names_the_damaged_file_and_what_to_make_again(nobody, fault):
    path, sound, sibling = (nobody / name for name in ("a.json", "b.json", "c.json"))
    for number, file in enumerate((path, sound, sibling)):
        file.write_text(json.dumps({"number": [number] * 10}))
    note(nobody / "ledger.txt", path, sound)
    FAULTS[fault][0](path, sibling)
    (damaged,) = ledger.Ledger(nobody / "ledger.txt").damage.items()
    assert damaged[0] == str(path) and damaged[1][1] == [str(path)]
    assert "\n" not in damaged[1][0]
