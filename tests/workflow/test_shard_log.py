"""The files of a shard: which are finished, also after a kill or by other shards."""

from pathlib import Path

import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_bytes, write_text
from lightfield.engine import receipts
from lightfield.formats.layout import SUMS
from lightfield.imaging import images
from lightfield.workflow import shard_log

HEADER = {"stage": "render_shard", "version": None, "settings": {}}
FOLDER = Path("work/receipts/scene/rig/render")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def opened(name, header=HEADER):
    return receipts.opened(FOLDER / name, header, [Path("exr")])


def render(name, *files, key="key", seals=True):
    with opened(name) as receipt:
        for file in files:
            write_bytes(file, file.name.encode())
            shard_log.add(file, key)
        if seals:
            receipt.seal()


def finished(name, file, key="key"):
    with opened(name):
        return shard_log.is_finished(file, key)


@pytest.mark.parametrize("seals", [True, False])
def test_a_file_with_its_key_and_bytes_is_finished_whichever_shard_made_it(seals):
    """Also if the shard was killed before its end."""
    files = [Path("exr/a.exr"), Path("exr/b.exr")]
    render("0-1.jsonl", files[0], seals=seals)
    render("1-2.jsonl", files[1], seals=seals)
    assert all(finished("0-2.jsonl", file) for file in files)
    assert finished("0-1.jsonl", files[0])
    assert not finished("0-2.jsonl", files[0], "another key")
    files[1].write_bytes(b"c.exr")
    assert not finished("0-2.jsonl", files[1])
    # The damaged file was moved away, so that no bytes are lost.
    assert not files[1].exists()
    assert Path("work/removed/exr/b.exr").read_bytes() == b"c.exr"
    assert not finished("0-2.jsonl", Path("exr/gone.exr"))


def test_a_new_view_reads_the_receipt_of_no_other_shard(monkeypatch):
    """Each of thousands of shards would read the receipts of all."""
    render("0-1.jsonl", Path("exr/a.exr"))
    with opened("1-2.jsonl"):
        monkeypatch.setattr(receipts, "read", None)
        assert not shard_log.is_finished(Path("exr/b.exr"), "key")


def test_a_file_of_another_key_stays_until_it_is_overwritten():
    view = Path("exr/a.exr")
    render("0-1.jsonl", view, key="old")
    assert not finished("0-1.jsonl", view, "new")
    assert view.exists()


def test_a_receipt_says_what_was_read_and_made():
    Path("scene.blend").write_text("scene")
    with opened("0-1.jsonl") as receipt:
        receipt.add_input("scene.blend")
        write_bytes(Path("exr/a.exr"), b"view")
        shard_log.add(Path("exr/a.exr"), "key")
        # The job makes nothing in this folder.
        write_text(Path("cache/b.json"), "{}")
        shard_log.log({"view": "a"})
        receipt.seal()
    found = receipts.read(FOLDER / "0-1.jsonl")
    assert found.inputs.keys() == {"scene.blend"}
    assert {name: output.key for name, output in found.outputs.items()} == {"exr/a.exr": "key"}
    assert found.outputs["exr/a.exr"].has_bytes("exr/a.exr")
    assert found.history == [{"view": "a"}]
    assert not (FOLDER / "0-1.part").exists()


def test_the_sum_of_a_receipt_has_no_times():
    sums = set()
    for _ in range(2):
        render("0-1.jsonl", Path("exr/a.exr"))
        sums.add(receipts.input_sum(FOLDER / "0-1.jsonl"))
    assert len(sums) == 1


def test_an_input_that_changes_meanwhile_fails_the_job():
    Path("scene.blend").write_text("scene")
    with (
        pytest.raises(UserError, match=r"^scene\.blend: has changed while this job read it"),
        opened("0-1.jsonl") as receipt,
    ):
        receipt.add_input("scene.blend")
        Path("scene.blend").write_text("other")
        receipt.check_inputs()
    assert receipts.read(FOLDER / "0-1.jsonl") is None


def test_a_damaged_receipt_is_no_input():
    render("0-1.jsonl", Path("exr/a.exr"))
    (FOLDER / "0-1.jsonl").write_text("{")
    with (
        opened("1-2.jsonl") as receipt,
        pytest.raises(UserError, match=r"0-1\.jsonl: is missing or damaged; the next run"),
    ):
        receipt.add_input(FOLDER / "0-1.jsonl")


def test_a_receipt_still_holds_until_a_setting_or_a_file_changes():
    view = Path("exr/a.exr")
    render("0-1.jsonl", view)

    def holds(**settings):
        with opened("0-1.jsonl", HEADER | {"settings": settings}) as receipt:
            return receipt.still_holds()

    assert holds()
    assert not holds(samples=4)
    view.write_bytes(b"other bytes")
    assert not holds()


def test_a_file_without_a_receipt_is_finished_only_if_its_sum_is_published():
    """Its key alone does not say that its pixels are whole."""
    bare, published = (Path(f"results/scene/{rig}/exr/a.exr") for rig in ("bare", "published"))
    for file in (bare, published):
        images.write_exr(file, {"R": np.zeros((2, 2), np.float32)}, {images.KEY_ATTRIBUTE: "key"})
    write_text(published.parents[1] / SUMS, f"{sha256(published)}  exr/a.exr\n")
    assert not finished("0-1.jsonl", bare)
    assert finished("0-2.jsonl", published)


def test_a_link_to_nowhere_in_place_of_a_file_is_moved_aside():
    file = Path("exr/a.exr")
    render("0-1.jsonl", file)
    file.unlink()
    file.symlink_to("gone.exr")
    assert not finished("0-1.jsonl", file)
    assert not file.is_symlink()
    assert Path("work/removed/exr/a.exr").is_symlink()
