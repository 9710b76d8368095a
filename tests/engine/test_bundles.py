"""Files of a job reach another folder in a bundle, and only with the bytes that the job made."""

import shutil
import tarfile
from pathlib import Path

import pytest

from lightfield.core.errors import UserError
from lightfield.core.files import write_text
from lightfield.engine import bundles, receipts

RECEIPT = Path("work/receipts/s/r/render/0-1.jsonl")
VIEW, NAMED, TEXTURE = Path("results/s/r/exr/a.exr"), Path("results/s/r/a.json"), Path("wood.png")


@pytest.fixture
def other(tmp_path, monkeypatch):
    """Make a receipt with its bundle in one folder. Return another that has these two alone."""
    (tmp_path / "one").mkdir()
    (tmp_path / "other").mkdir()
    monkeypatch.setenv(bundles.VARIABLE, str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path / "one")
    write_text(TEXTURE, "oak")
    with receipts.opened(
        RECEIPT, {"stage": "s", "version": 1, "settings": {}}, [Path("results")]
    ) as receipt:
        receipt.add_input(TEXTURE)
        write_text(VIEW, "view")
        write_text(NAMED, "{}")
        receipt.seal()
    bundles.pack(RECEIPT, [NAMED], [TEXTURE])
    for file in (RECEIPT, bundles.bundle_of(RECEIPT)):
        (tmp_path / "other" / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, tmp_path / "other" / file)
    monkeypatch.chdir(tmp_path / "other")
    return tmp_path / "other"


def test_a_job_gets_the_files_that_no_rule_declares(other):
    bundles.unpack(RECEIPT)
    assert VIEW.read_text() == "view"
    assert TEXTURE.read_text() == "oak"
    assert not NAMED.exists()
    assert receipts.read(RECEIPT).outputs[str(VIEW)].stamp.matches(VIEW)


def test_a_damaged_bundle_is_refused(other):
    bundle = bundles.bundle_of(RECEIPT)
    sound = bundle.read_bytes()
    bundle.write_bytes(
        sound.replace(b"view", b"veiw").replace(b"results/s/r/exr", b"results/s/r/exr")
    )
    with pytest.raises(UserError, match=r"exr/a\.exr: the storage does not have the bytes"):
        bundles.unpack(RECEIPT)
    assert not VIEW.exists()
    bundle.write_bytes(sound[:700])
    with pytest.raises(UserError, match=r"0-1\.tar: is damaged"):
        bundles.unpack(RECEIPT)


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE])
@pytest.mark.parametrize("target", ["nowhere", "/etc/passwd", "results/s/r/a.json"])
def test_a_link_in_a_bundle_is_no_file_of_a_job(other, kind, target):
    member = tarfile.TarInfo(str(VIEW))
    member.type, member.linkname = kind, target
    with tarfile.open(bundles.bundle_of(RECEIPT), "w") as archive:
        archive.addfile(member)
    with pytest.raises(UserError, match=r"exr/a\.exr: the storage does not have the bytes"):
        bundles.unpack(RECEIPT)
    assert not VIEW.is_symlink() and not VIEW.exists()


def test_a_newer_file_of_the_user_stays(other):
    write_text(TEXTURE, "pine")
    bundles.unpack(RECEIPT)
    assert TEXTURE.read_text() == "pine"


def test_jobs_with_a_common_folder_need_no_bundle(other, monkeypatch):
    monkeypatch.delenv(bundles.VARIABLE)
    bundle = bundles.bundle_of(RECEIPT)
    bundle.unlink()
    bundles.pack(RECEIPT, [])
    bundles.unpack(RECEIPT)
    assert not bundle.exists()
    assert not VIEW.exists()
