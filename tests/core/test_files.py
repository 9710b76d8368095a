"""Files and logs are complete on the disk before anybody relies on them: a power cut loses none."""

import os
from pathlib import Path

import pytest

from lightfield.core import files
from lightfield.core.errors import UserError
from lightfield.core.files import broken, set_aside


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
    log = tmp_path / "0-6.part"
    for number in range(2):
        files.append_json_line(log, {"view": number})
        assert flushed[-1] == (log.stat().st_size, str(log))


def test_a_program_that_writes_nothing_leaves_the_old_file(tmp_path):
    target = tmp_path / "record.json"
    target.write_bytes(b"old")
    with pytest.raises(UserError, match=r"record\.json: cannot be written: the file is empty"):
        files.write_bytes(target, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["record.json"]
    assert target.read_bytes() == b"old"


# ---- messages, and where damaged files go ---------------------------------------------------


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b'{"half": [', "is not JSON: "),
        (b"[1, 2]", "is a list, not a mapping"),
        (b'{"\xff": 1}', "is not text in UTF-8"),
        (b"", "is empty"),
        (b"null", "is a NoneType, not a mapping"),
        (b"{}", None),
    ],
)
def test_the_message_says_what_is_wrong_with_a_json(content, problem, tmp_path):
    path = tmp_path / "a.json"
    assert broken(path) is None
    path.write_bytes(content)
    said = broken(path)
    assert said is problem is None or said.startswith(problem)


def test_files_set_aside_are_never_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for content in "ab":
        Path("results").mkdir(exist_ok=True)
        Path("results/a.json").write_text(content)
        set_aside(Path("results/a.json"), Path("work/removed"))
    assert Path("work/removed/results/a.json").read_text() == "a"
    assert Path("work/removed/results/a.json.2").read_text() == "b"
    assert not Path("results/a.json").exists()


def test_files_outside_the_folder_are_set_aside_with_all_others(tmp_path, monkeypatch):
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path / "own")
    inside = Path("work/removed") / (tmp_path / "a.json").relative_to("/")
    for path, name in ((tmp_path / "a.json", inside.name), (Path("../a.json"), "a.json.2")):
        (tmp_path / "a.json").touch()
        assert set_aside(path, Path("work/removed")) == inside.with_name(name)
        assert inside.with_name(name).is_file()


def test_a_folder_is_set_aside_even_in_place_of_a_broken_link(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.exr").symlink_to("a.exr")
    set_aside(Path("a.exr"), Path("removed"))
    Path("a.exr/inside").mkdir(parents=True)
    assert set_aside(Path("a.exr"), Path("removed")) == Path("removed/a.exr.2")
    assert Path("removed/a.exr").is_symlink()
    assert Path("removed/a.exr.2/inside").is_dir()
