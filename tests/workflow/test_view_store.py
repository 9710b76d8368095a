"""The view store in a folder: a stored file is used only if its bytes are right."""

import hashlib
import os
import shutil
import sys
from pathlib import Path

import pytest

from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.workflow.records import ShardRecord
from lightfield.workflow.view_store import VARIABLE, ViewStore

KEY = "0" * 64
# A job's own folder holds the dataset's views and a shard's record.
VIEW, PASS = "results/s/rig/exr/a.exr", "results/s/rig/normal/a.exr"
RECORD = "work/s/rig/render/0-1.json"


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "store"))
    return ViewStore.configured()


@pytest.fixture
def shard(tmp_path, store):
    """Return a function that makes or opens the shard's record in a job's own folder."""

    def work_in(name):
        folder = tmp_path / name
        return folder, ShardRecord(folder / RECORD, folder / "results/s/rig/exr")

    return work_in


def make(folder, record, name, content):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)
    record.add(folder / name, KEY)


def test_another_job_takes_finished_views(shard):
    folder, record = shard("one")
    make(folder, record, VIEW, b"view")
    make(folder, record, PASS, b"pass")
    other, again = shard("other")
    assert again.is_finished(other / VIEW, KEY)
    assert again.is_finished(other / PASS, KEY)
    assert (other / VIEW).read_bytes() == b"view"
    assert (other / PASS).read_bytes() == b"pass"
    assert not again.is_finished(other / "results/s/rig/exr/b.exr", KEY)
    assert not again.is_finished(other / VIEW, "1" * 64)


def test_a_damaged_local_file_is_fetched_again(shard):
    folder, record = shard("one")
    make(folder, record, VIEW, b"view")
    (folder / VIEW).write_bytes(b"weiv")
    _, again = shard("one")
    assert again.is_finished(folder / VIEW, KEY)
    assert (folder / VIEW).read_bytes() == b"view"


@pytest.mark.parametrize("spoil", [lambda path: path.write_bytes(b"vie"), lambda p: p.unlink()])
def test_a_view_lost_in_the_store_is_rendered_again(shard, store, tmp_path, spoil):
    folder, record = shard("one")
    make(folder, record, VIEW, b"view")
    spoil(tmp_path / "store/views/sums" / sha256(folder / VIEW))
    other, again = shard("other")
    assert not again.is_finished(other / VIEW, KEY)
    assert not (other / VIEW).exists()
    make(other, again, VIEW, b"view")
    third, last = shard("third")
    assert last.is_finished(third / VIEW, KEY)


def test_a_truncated_object_does_not_count(store, tmp_path):
    path = write(tmp_path / "texture.png", b"texture")
    assert not store.has(digest(b"texture"), 7)
    store.put(path, digest(b"texture"))
    assert store.has(digest(b"texture"), 7)
    write(tmp_path / "store/views/sums" / digest(b"texture"), b"text")
    assert not store.has(digest(b"texture"), 7)


def test_no_view_is_listed_before_the_store_has_it(store, tmp_path):
    path = write(tmp_path / "a.exr", b"view")
    # This is the state after a job is killed while it puts the view.
    write(tmp_path / "store/views/sums", b"no folder")
    with pytest.raises(UserError, match="the view store cannot be used"):
        store.put_view(path, "exr/a.exr", KEY, digest(b"view"))
    assert store.listed(KEY) == []
    (tmp_path / "store/views/sums").unlink()
    store.put_view(path, "exr/a.exr", KEY, digest(b"view"))
    assert store.listed(KEY) == [("exr/a.exr", digest(b"view"))]


@pytest.mark.parametrize("content", [b"", b"tex", b"something longer"])
def test_an_object_with_other_bytes_is_not_taken_but_replaced(store, tmp_path, content):
    path = write(tmp_path / "texture.png", b"texture")
    write(tmp_path / "store/views/sums" / digest(b"texture"), content)
    assert not store.take(digest(b"texture"), tmp_path / "taken.png")
    assert not (tmp_path / "taken.png").exists()
    store.put(path, digest(b"texture"))
    assert store.take(digest(b"texture"), tmp_path / "taken.png")
    assert (tmp_path / "taken.png").read_bytes() == b"texture"


def test_a_reader_gets_a_complete_object_while_another_job_puts_it(store, tmp_path):
    store.put(write(tmp_path / "one", b"texture"), digest(b"texture"))
    with (tmp_path / "store/views/sums" / digest(b"texture")).open("rb", 0) as reader:
        assert reader.read(3) == b"tex"
        # Only a part of the other job's copy exists yet.
        store.put(write(tmp_path / "other", b"tex"), digest(b"texture"))
        assert reader.read() == b"ture"


def test_a_reader_gets_a_complete_list_while_it_is_sent_again(store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / RECORD, b"first")
    store.send(RECORD)
    with (tmp_path / "store" / RECORD).open("rb", 0) as reader:
        write(tmp_path / RECORD, b"2")
        store.send(RECORD)
        assert reader.read() == b"first"
    assert (tmp_path / "store" / RECORD).read_bytes() == b"2"


def test_consumers_take_the_files_of_records_and_manifests(shard, store, run_program):
    folder, record = shard("one")
    make(folder, record, VIEW, b"view")
    record.write([folder / VIEW])
    other, _ = shard("other")
    shutil.copytree(folder / "work", other / "work")
    export = "results/s/rig/exports/colmap"
    exported = other / export / "export.json"
    for each in (folder, other):
        write_json(each / export / "export.json", {"format": "colmap"})
    (folder / export / "images").mkdir()
    (folder / export / "images/a.exr").write_bytes(b"copy")
    store.put_list(folder / export / "export.json", [folder / export / "images/a.exr"])
    arguments = ("--results", "results", "--work", "work", RECORD, exported)
    run_program("take_views.py", *arguments, cwd=other)
    assert (other / VIEW).read_bytes() == b"view"
    assert (exported.parent / "images/a.exr").read_bytes() == b"copy"

    (other / VIEW).unlink()
    write_json(other / RECORD, {"files": {"exr/a.exr": {"bytes": 4, "sha256": "f" * 64}}})
    failed = run_program("take_views.py", *arguments, cwd=other, check=False)
    assert failed.returncode == 1
    assert failed.stderr.splitlines()[-1].startswith("error: 1 files are not in the view store")
    assert f"as {VIEW}; --mend lets" in failed.stderr


def test_a_list_with_a_lost_file_is_removed_from_the_storage(
    shard, store, run_program, monkeypatch
):
    folder, record = shard("one")
    make(folder, record, VIEW, b"view")
    record.write([folder / VIEW])
    # Snakemake keeps a copy of the storage's file under the same path.
    monkeypatch.chdir(folder)
    store.send(RECORD)
    stored = Path(store.url, RECORD)
    assert stored.read_bytes() == (folder / RECORD).read_bytes()
    (Path(store.url) / "views/sums" / sha256(folder / VIEW)).unlink()
    (folder / VIEW).unlink()
    arguments = ("--results", "results", "--work", "work", RECORD)
    assert run_program("take_views.py", *arguments, cwd=folder, check=False).returncode == 1
    assert stored.exists()
    failed = run_program("take_views.py", "--mend", *arguments, cwd=folder, check=False)
    assert failed.stderr.splitlines()[-1].endswith(f"as {VIEW}; the next run makes them again")
    assert not stored.exists()


def test_an_unusable_store_is_one_line(tmp_path):
    (tmp_path / "store").symlink_to("store")
    with pytest.raises(UserError, match="the view store cannot be used"):
        ViewStore(str(tmp_path / "store")).check()


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "upath", None)
    with pytest.raises(UserError, match=r"make \.venv/complete-with-storage"):
        ViewStore("s3://bucket").check()


def test_a_stored_file_is_fetched_with_its_time(tmp_path, monkeypatch, store):
    stored = tmp_path / "store/results/lightfield.json"
    stored.parent.mkdir(parents=True)
    stored.write_text("{}")
    os.utime(stored, (1000, 1000))
    monkeypatch.chdir(tmp_path)
    store.bring("results/lightfield.json")
    store.bring("results/missing.json")
    path = tmp_path / "results/lightfield.json"
    assert (path.read_text(), path.stat().st_mtime) == ("{}", 1000)
    assert not (tmp_path / "results/missing.json").exists()


def test_a_finished_dataset_is_fetched_by_its_checksums(tmp_path, monkeypatch, store, run_program):
    monkeypatch.chdir(tmp_path)
    dataset, stored = Path("results/s/rig"), tmp_path / "store/results/s/rig"
    arguments = ("--store", store.url, str(dataset))
    missing = run_program("take_dataset.py", *arguments, check=False)
    assert "sha256sums.txt: is not in" in missing.stderr

    store.put(write(tmp_path / "view", b"view"), digest(b"view"))
    write(stored / "perspective/lightfield.json", b"lens")
    write(stored / "report/index.html", b"page")
    sums = f"{digest(b'view')}  exr/a.exr\n{digest(b'lens')}  perspective/lightfield.json\n"
    write(stored / "sha256sums.txt", sums.encode())
    taken = run_program("take_dataset.py", *arguments, check=False)
    assert taken.returncode == 0, taken.stderr
    assert (dataset / "exr/a.exr").read_bytes() == b"view"
    assert (dataset / "perspective/lightfield.json").read_bytes() == b"lens"
    assert (dataset / "report/index.html").read_bytes() == b"page"

    write(stored / "perspective/lightfield.json", b"snel")
    shutil.rmtree(dataset)
    wrong = run_program("take_dataset.py", *arguments, check=False)
    assert wrong.returncode == 1
    assert f"1 files are not in {store.url}" in wrong.stderr
    assert str(dataset / "perspective/lightfield.json") in wrong.stderr


HOSTILE = ["../../x", "exr/../../../../x", "{outside}/x", ""]


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("kind", ["sums", "archive", "published"])
def test_no_dataset_of_a_storage_is_written_outside_its_folder(
    kind, name, tmp_path, monkeypatch, store, run_program
):
    home = tmp_path / "home/deep"
    home.mkdir(parents=True)
    monkeypatch.chdir(home)
    name = name.format(outside=tmp_path)
    store.put(write(tmp_path / "hostile", b"hostile"), digest(b"hostile"))
    (tmp_path / "hostile").unlink()
    stored = Path(store.url, "results/s")
    path = {"sums": "rig", "archive": "rig.json", "published": "published/rig"}[kind]
    if kind == "archive":
        entry = {"file": name, "bytes": 7, "sha256": digest(b"hostile")}
        write_json(stored / path, {"parts": [entry]})
    else:
        write(stored / path / "sha256sums.txt", f"{digest(b'hostile')}  {name}\n".encode())
    before = files(tmp_path)
    result = run_program("take_dataset.py", "--store", store.url, f"results/s/{path}", check=False)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert f"is {name!r}; must be the path of a file in its folder, without .." in line
    # Only the list itself has come.
    assert len(files(tmp_path) - before) == 1


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("kind", ["record", "note"])
def test_no_file_of_a_list_is_written_outside_its_dataset(
    kind, name, tmp_path, monkeypatch, store, run_program
):
    home = tmp_path / "home/deep"
    home.mkdir(parents=True)
    monkeypatch.chdir(home)
    name = name.format(outside=tmp_path)
    hostile = write(tmp_path / "hostile", b"hostile")
    store.put(hostile, digest(b"hostile"))
    path = home / RECORD
    if kind == "record":
        write_json(path, {"files": {name: {"bytes": 7, "sha256": digest(b"hostile")}}})
    else:
        path = home / "results/s/rig/exports/colmap/export.json"
        write_json(path, {"format": "colmap"})
        store.put_view(hostile, name, sha256(path), digest(b"hostile"))
    before = files(tmp_path)
    arguments = ("--results", "results", "--work", "work", path)
    result = run_program("take_views.py", *arguments, check=False)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert f"is {name!r}; must be the path of a file in its folder, without .." in line
    assert files(tmp_path) == before


def test_a_taken_file_replaces_a_link_and_not_what_it_leads_to(store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outside = write(tmp_path / "outside", b"mine")
    store.put(write(tmp_path / "view", b"view"), digest(b"view"))
    taken = tmp_path / "results/exr/a.exr"
    taken.parent.mkdir(parents=True)
    taken.symlink_to(outside)
    assert store.take(digest(b"view"), taken)
    assert taken.read_bytes() == b"view"
    assert outside.read_bytes() == b"mine"


def files(folder):
    return {path for path in folder.rglob("*") if path.is_file()}


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def digest(content):
    return hashlib.sha256(content).hexdigest()
