"""Receipts of jobs: which inputs and outputs they name."""

from pathlib import Path

import pytest

from lightfield.core import receipts
from lightfield.core.errors import UserError

RECEIPT = Path("work/receipts/garden/job.jsonl")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def opened():
    return receipts.opened(RECEIPT, {"stage": "job", "version": 1, "settings": {}}, [Path("made")])


def test_an_input_that_changes_before_it_is_noted_again_is_named():
    """So it is with a model, which is noted before its import and after it."""
    Path("model.obj").write_text("before")
    with opened() as receipt:
        receipts.note_inputs(["model.obj"])
        Path("model.obj").write_text("after")
        receipts.note_inputs([Path.cwd() / "model.obj"])
        with pytest.raises(UserError, match=r"^model\.obj: has changed while this job read it"):
            receipt.check_inputs()


@pytest.mark.parametrize("name", ["missing.png", "folder", "folder/file/below", "x" * 300])
def test_an_input_that_is_no_file_is_missing_until_it_is_one(name):
    Path("folder").mkdir()
    Path("folder/file").touch()
    with opened() as receipt:
        receipts.note_inputs([name])
        receipt.check_inputs()
        receipt.seal()
    assert receipts.read(RECEIPT).inputs == {name: None}
    assert receipts.input_sum(name) is None


def test_a_kept_file_stays_an_output():
    Path("made").mkdir()
    Path("made/kept.webp").write_text("as it was")
    with opened() as receipt:
        receipt.note_kept(Path("made/kept.webp"))
        receipt.seal()
    assert [*receipts.read(RECEIPT).outputs] == ["made/kept.webp"]
