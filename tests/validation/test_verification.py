"""Verification: which receipts and lists vouch for a file, and what is moved to mend a fault."""

import errno
import json
import os
import shutil
from pathlib import Path

import bookkeeping
import pytest
import simulated
from simulated import put

from lightfield.core.errors import UserError
from lightfield.core.files import Stamp, sha256
from lightfield.engine.flags import parsed
from lightfield.engine.receipts import job_of
from lightfield.stages.checks import Verify
from lightfield.validation import verification
from lightfield.validation.verification import faults

OTHER = "results/scene_near/other"
VIEW = "exr/view_0000f.exr"


@pytest.fixture(params=["scene_near/rig", "scene_near/rig/f00001"])
def small(request, tmp_path, monkeypatch):
    """The folder of a small dataset beside others, all noted as built here."""
    monkeypatch.chdir(tmp_path)
    name = request.param
    for dataset in (name, "scene_near/other"):
        simulated.write_one_view(Path("results", dataset))
        put(Path("work", dataset, "places.json"), "{}")
        paths = [*Path("results", dataset).rglob("*"), Path("work", dataset, "places.json")]
        bookkeeping.note([str(path) for path in paths if path.is_file()])
    put(Path("work/scene/inventory.json"), "{}")
    bookkeeping.note(["work/scene/inventory.json"])
    write_receipt(f"work/receipts/{name}/reader.jsonl", {}, ["work/scene/inventory.json"])
    return Path("results", name)


def write_receipt(path, outputs, inputs=()):
    """Write the receipt of a job that read ``inputs``. ``outputs`` are the stamps of files."""
    header = {"job": job_of(path), "stage": "", "version": None, "settings": {}}
    header["inputs"] = {name: sha256(name) for name in inputs}
    lines = [header, *({"file": str(name), **stamp._asdict()} for name, stamp in outputs.items())]
    put(Path(path), "".join(json.dumps(line) + "\n" for line in lines))


def problems_of(folder, work="work"):
    return faults(folder, Path(work) if work else None)


def spoil(path):
    """Change a byte, and keep size and time."""
    content = bytearray(path.read_bytes())
    status = path.stat()
    content[-1] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_a_dataset_has_the_faults_of_its_own_files_and_of_those_that_its_jobs_read(small):
    assert problems_of(small) == problems_of(small, None) == {}
    published = {path for path in small.rglob("*") if path.is_file() and path.parts[-2] != "report"}
    own = published | {small / "report/page.html", Path("work/scene/inventory.json")}
    own |= {path for path in Path("work", *small.parts[1:]).rglob("*") if path.is_file()}
    others = {path for path in Path(OTHER).rglob("*") if path.is_file()}
    assert len(own) == 11 and len(others) == 9
    for path in own | others:
        spoil(path)
        assert problems_of(small).keys() == ({str(path)} if path in own else set())
        if path in published and path.name != "sha256sums.txt":
            assert problems_of(small, None).keys() == {str(path)}
        spoil(path)
    stray = small / "stray.txt"
    stray.touch()
    assert problems_of(small) == {str(stray): "is not a file of this dataset, or has no checksum"}


def test_the_receipt_or_list_that_a_file_disagrees_with_is_named(small):
    view = small / VIEW
    right = sha256(view)
    spoil(view)
    receipt = f"work/receipts/{'/'.join(small.parts[1:])}/exr/view_0000f_exr.jsonl"
    for work, source in (("work", receipt), (None, f"{small}/sha256sums.txt")):
        problem = f"its sha256 is {sha256(view)}, but {source} says {right}"
        assert problems_of(small, work) == {str(view): problem}
    spoil(view)
    # The list has the right sum.
    path = Path(receipt)
    path.write_text(path.read_text().replace(right, "0" * 64))
    (name,) = problems_of(small)
    assert name == receipt


def test_a_users_file_that_has_changed_in_secret_is_named_and_not_moved(small, capsys):
    Path("texture.png").write_text("old")
    write_receipt(f"work/receipts/{'/'.join(small.parts[1:])}/user.jsonl", {}, ["texture.png"])
    assert problems_of(small) == {}
    spoil(Path("texture.png"))
    assert problems_of(small).keys() == {"texture.png"}
    with pytest.raises(UserError, match="1 faults"):
        parsed(Verify, None, [str(small), "--work", "work", "--mend"]).run()
    assert "texture.png: has changed since a job read it" in capsys.readouterr().out
    assert Path("texture.png").exists()


def test_a_damaged_receipt_is_named_and_no_file_of_it(small):
    receipt = Path("work/receipts", *small.parts[1:], "exr/view_0000f_exr.jsonl")
    receipt.write_text(receipt.read_text()[:-5])
    assert problems_of(small) == {str(receipt): "is damaged"}
    receipt.unlink()
    receipt.mkdir()
    assert problems_of(small) == {str(receipt): "is a folder"}
    # The list vouches for the view.
    spoil(small / VIEW)
    assert problems_of(small).keys() == {str(receipt), str(small / VIEW)}


def test_receipts_of_former_jobs_report_no_fault(small):
    """Another number of shards, fewer views, and an export that is no longer wanted."""
    folder = Path("work/receipts", *small.parts[1:])
    names = (VIEW, "exr/view_0001f.exr", "old/a.json")
    outputs = {small / name: Stamp("0" * 64, 1, 1) for name in names}
    write_receipt(folder / "render/0-2.jsonl", outputs)
    assert problems_of(small) == {}
    (small / "depth.png").unlink()
    shutil.rmtree(small / "report")
    missing = {str(small / "depth.png"), str(small / "report/page.html")}
    assert problems_of(small) == dict.fromkeys(sorted(missing), "is missing")


def test_an_unfinished_dataset_has_only_the_faults_of_files_that_exist(small):
    (small / "sha256sums.txt").unlink()
    assert problems_of(small) == {str(small / "sha256sums.txt"): "is missing"}
    bookkeeping.forget(".", str(small / "sha256sums.txt"))
    (small / "depth.png").unlink()
    (small / "not_noted.txt").touch()
    assert problems_of(small) == {}
    spoil(small / VIEW)
    assert problems_of(small).keys() == {str(small / VIEW)}


def test_a_view_of_a_shard_at_work_is_its_own(small):
    view = small / "exr/view_0001f.exr"
    view.write_text("new")
    part = Path("work/receipts", *small.parts[1:], "render/0-2.part")
    put(part, {"file": str(view), **Stamp.of(view)._asdict(), "key": "key"})
    assert problems_of(small) == {}
    spoil(view)
    assert problems_of(small).keys() == {str(view)}


def test_a_copy_of_a_dataset_that_was_built_here_is_checked_by_its_own_list(small):
    copy = Path("backup", *small.parts[1:])
    shutil.copytree(small, copy)
    spoil(small / VIEW)
    assert problems_of(copy) == {}
    spoil(copy / "depth.png")
    assert problems_of(copy).keys() == {str(copy / "depth.png")}


def test_an_unreadable_file_is_a_fault(small, monkeypatch):
    def failing(path):
        if str(path).endswith("depth.png"):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return sha256(path)

    monkeypatch.setattr(verification, "sha256", failing)
    assert problems_of(small) == {str(small / "depth.png"): "cannot be read: Input/output error"}


def test_mending_moves_each_faulty_file_and_nothing_else(small, capsys):
    paths = [small / VIEW, small / "depth.png", Path("work", *small.parts[1:], "places.json")]
    for path in paths:
        spoil(path)
    arguments = [str(small), "--work", "work", "--mend"]
    with pytest.raises(UserError, match=r"3 faults in .*; the next run makes them again"):
        parsed(Verify, None, arguments).run()
    aside = {path for path in Path("work/removed").rglob("*") if path.is_file()}
    assert aside == {Path("work/removed", path) for path in paths}
    assert not any(path.exists() for path in paths)
    assert problems_of(small) == {str(path): "is missing" for path in sorted(paths)}


def test_mending_moves_nothing_that_other_programs_made(small, tmp_path, capsys):
    """Neither files that a receipt names, nor receipts, nor lists beside the build."""
    outside = tmp_path.parent / f"{tmp_path.name}_outside"
    names = ["README.md", "results/notes.txt", f"../{outside.name}/a.txt", f"{outside}/a.txt"]
    foreign_receipt = f"../{outside.name}/receipts/a.jsonl"
    for name in [*names, foreign_receipt, "sha256sums.txt", "results/sha256sums.txt"]:
        put(Path(name), "mine")
    put(small / "member/member.json", "{}")
    receipt = Path("work/receipts", *small.parts[1:], "hostile.jsonl")
    stamp = Stamp("0" * 64, 1, 1)
    write_receipt(receipt, dict.fromkeys([*names, small / VIEW], stamp), [foreign_receipt])
    spoil(Path("work", *small.parts[1:], "places.json"))
    with pytest.raises(UserError, match="the next run makes them again"):
        parsed(Verify, None, [str(small), "--work", "work", "--mend"]).run()
    assert (
        f"{receipt}: names README.md, which no job of this build makes" in capsys.readouterr().out
    )
    aside = {path for path in Path("work/removed").rglob("*") if path.is_file()}
    places = Path("work/removed/work", *small.parts[1:], "places.json")
    assert aside >= {Path("work/removed", receipt), places}
    for name in [*names, foreign_receipt, "sha256sums.txt", "results/sha256sums.txt"]:
        assert Path(name).read_text() == "mine"


def test_a_receipt_with_a_path_that_leads_out_and_in_is_damaged(small):
    receipt = Path("work/receipts", *small.parts[1:], "hostile.jsonl")
    put(Path("x"), "mine")
    up = "/".join([".."] * len(small.parts))
    write_receipt(receipt, {f"{small}/{up}/x": Stamp("0" * 64, 1, 1)})
    assert problems_of(small) == {str(receipt): "is damaged"}
