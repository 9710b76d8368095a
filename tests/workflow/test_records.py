"""Shards' records: which files are finished, and what a record holds of them."""

from pathlib import Path

from lightfield.core.files import read_json, sha256
from lightfield.workflow.records import ShardRecord
from lightfield.workflow.shard_files import read_record


def test_a_file_with_its_key_and_bytes_is_finished_whichever_shard_made_it(tmp_path: Path) -> None:
    folder = tmp_path / "exr"
    folder.mkdir()
    files = [folder / name for name in ("a.exr", "b.exr")]
    for file, shard in zip(files, ("0-1", "1-2"), strict=True):
        file.write_bytes(file.name.encode())
        ShardRecord(tmp_path / f"{shard}.json", folder).add(file, "key")
    other_bounds = ShardRecord(tmp_path / "0-2.json", folder)
    assert all(other_bounds.is_finished(file, "key") for file in files)
    assert ShardRecord(tmp_path / "0-1.json", folder).is_finished(files[0], "key")
    assert not other_bounds.is_finished(files[0], "another key")
    files[1].write_bytes(b"c.exr")
    assert not other_bounds.is_finished(files[1], "key")
    assert not other_bounds.is_finished(folder / "gone.exr", "key")


def test_a_record_lists_unchecked_files_too(tmp_path: Path) -> None:
    file = tmp_path / "exr" / "a.exr"
    file.parent.mkdir()
    file.write_bytes(b"12345")
    path = tmp_path / "0-1.json"
    ShardRecord(path, file.parent).write([file], counts={"views": 1})
    entry = {"bytes": 5, "sha256": sha256(file)}
    assert read_json(path) == {"files": {"exr/a.exr": entry}, "counts": {"views": 1}}
    assert read_record(path) == {"exr/a.exr": (entry["bytes"], entry["sha256"])}


def test_a_view_of_other_settings_is_not_sought_in_other_logs(tmp_path: Path) -> None:
    folder = tmp_path / "exr"
    folder.mkdir()
    view = folder / "view_0000f.exr"
    view.write_bytes(b"view")
    ShardRecord(tmp_path / "render/0-1.json", folder).add(view, "old")
    # Reading this log would be an error.
    (tmp_path / "render/1-2.sums.jsonl").mkdir()
    assert not ShardRecord(tmp_path / "render/0-1.json", folder).is_finished(view, "new")
    assert ShardRecord(tmp_path / "render/0-1.json", folder).is_finished(view, "old")
