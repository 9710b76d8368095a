"""Files and logs are complete on the disk before anybody relies on them: a power cut loses none."""

import os
from pathlib import Path

import pytest

from lightfield.core import files
from lightfield.core.errors import UserError
from lightfield.dataset.ledger import Job, Ledger


@pytest.fixture
def flushed(monkeypatch):
    """Return the sizes of files when they were flushed to the disk, and the names at that time."""
    seen = []
    fsync = os.fsync

    def flush(file):
        fsync(file)
        path = str(Path(f"/proc/self/fd/{file}").readlink())
        seen.append((os.fstat(file).st_size, path))

    monkeypatch.setattr(os, "fsync", flush)
    return seen


def test_a_file_gets_its_name_after_its_bytes_are_on_the_disk(flushed, tmp_path):
    target = tmp_path / "record.json"
    target.write_bytes(b"old")
    files.write_bytes(target, b"another")
    ((size, path),) = flushed
    assert size == len(b"another")
    # The old file still had the name.
    assert path != str(target) and path.startswith(str(tmp_path))
    assert target.read_bytes() == b"another"


def test_a_line_of_a_log_is_on_the_disk_before_work_goes_on(flushed, tmp_path):
    log = tmp_path / "0-6.journal.jsonl"
    for number in range(2):
        files.append_json_line(log, {"view": number})
        assert flushed[-1] == (log.stat().st_size, str(log))
    ledger = tmp_path / "ledger.txt"
    for number in range(2):
        Ledger(ledger).note(Job([f"{number}.json"], {}, {}, {}))
        assert flushed[-1] == (ledger.stat().st_size, str(ledger))


def test_a_program_that_writes_nothing_leaves_the_old_file(tmp_path):
    target = tmp_path / "record.json"
    target.write_bytes(b"old")
    with pytest.raises(UserError, match=r"record\.json: cannot be written: the file is empty"):
        files.write_bytes(target, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["record.json"]
    assert target.read_bytes() == b"old"
