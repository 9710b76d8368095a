"""Receipts of jobs: which inputs and outputs they name."""

import json
import os
import sys
from functools import partial
from pathlib import Path

import pytest

from lightfield.core.errors import UserError
from lightfield.core.files import Stamp
from lightfield.engine import receipts
from lightfield.engine.receipts import Output

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


HEADER = {"stage": "job", "version": 1, "settings": {}, "inputs": {}}


def write_lines(path, *names):
    """Write a receipt with files that are not as it says."""
    lines = [{"file": name, "sha256": "0" * 64, "bytes": 1, "modified_ns": 1} for name in names]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(line) + "\n" for line in (HEADER, *lines)))


@pytest.mark.parametrize("name", ["made/../x", "./made/x", "made//x", "made/", "", "a\0b", 5, None])
def test_a_receipt_with_a_path_in_another_form_counts_as_damaged(name):
    write_lines(RECEIPT, "made/a", name)
    assert receipts.read(RECEIPT) is None
    write_lines(RECEIPT.with_suffix(".part"), "made/a", name)
    assert [*receipts.read_part(RECEIPT)[0]] == ["made/a"]


@pytest.mark.parametrize("suffix", [".jsonl", ".part"])
def test_a_job_moves_no_file_of_others(suffix, tmp_path):
    """A FIFO stands for a device, which looks damaged, too."""
    outside = tmp_path.parent / f"{tmp_path.name}_outside"
    outside.mkdir()
    os.mkfifo(outside / "fifo")
    (tmp_path / "mine.txt").write_text("mine")
    names = [str(outside / "fifo"), f"../{outside.name}/fifo", "mine.txt"]
    write_lines(RECEIPT.with_suffix(suffix), "made/a", *names)
    with opened() as receipt:
        assert not receipt.still_holds()
        receipt.seal()
    assert (outside / "fifo").is_fifo()
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert not receipts.read(RECEIPT).outputs


def test_a_job_does_not_keep_a_receipt_that_names_files_of_others():
    Path("made").mkdir()
    for name in ("made/a", "mine.txt"):
        Path(name).write_text(name)
    with opened() as receipt:
        for name in ("made/a", "mine.txt"):
            receipt.outputs[name] = Output(Stamp.of(name))
        receipt.seal()
    with opened() as receipt:
        assert not receipt.still_holds()


def batch(count):
    """Make files, each from a file of a user, by ``count`` jobs. Return the files' names."""
    names = [f"made/{count}/{number}.txt" for number in range(count)]
    Path(f"made/{count}").mkdir(parents=True)
    for number, name in enumerate(names):
        path = Path(f"work/receipts/made/{count}/{number}.jsonl")
        user_file = Path(f"user/{count}/{number}.txt")
        user_file.parent.mkdir(parents=True, exist_ok=True)
        user_file.write_text(name)
        header = {"stage": "job", "version": 1, "settings": {}}
        with receipts.opened(path, header, [Path(name)]) as receipt:
            receipts.note_inputs([user_file])
            Path(name).write_text(name)
            receipt.note_kept(Path(name))
            receipt.seal()
    return names


def calls_of(function):
    """Return how many functions of Python a function calls."""
    count = 0

    def note(_frame, event, _argument):
        nonlocal count
        count += event == "call"

    sys.setprofile(note)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


def test_twice_as_many_inputs_are_twice_the_work():
    """A corpus notes thousands of files, and the files from which they were made."""
    calls = {}
    for count in (1, 100, 200):
        names = batch(count)
        user_files = [name.replace("made", "user") for name in names]
        receipts.input_sum(names[0])
        with opened():
            calls[count] = calls_of(partial(receipts.note_inputs, names + user_files))
    assert calls[200] < 2.3 * calls[100]


def test_a_users_file_that_changed_since_another_input_was_made_is_named():
    (name,) = batch(1)
    Path("user/1/0.txt").write_text("changed")
    for inputs in ([name, "user/1/0.txt"], ["user/1/0.txt", name]):
        with opened(), pytest.raises(UserError, match=r"^user/1/0\.txt: has changed"):
            receipts.note_inputs(inputs)
