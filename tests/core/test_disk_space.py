"""Before a run: disks without space are refused, and leftovers of killed runs are removed."""

import errno
import os
import re
import subprocess
import sys
import time
from collections import namedtuple
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from checkouts import checkout, snakemake
from conftest import SCRIPTS, mount_disk
from sphere import write_views

from lightfield.core import disk_space, files, leftovers, locks
from lightfield.core.errors import UserError

Usage = namedtuple("Usage", "free")

HUGE = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFHuge:
    type: plane
    cameras: [400, 250]
    camera: {lens: rectilinear, fov: 60, resolution: [16384, 16384]}
"""

ONE = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
"""

KEEPER = """
import sys, time
from lightfield.core.leftovers import temporary_folder
with temporary_folder(sys.argv[1]) as folder:
    (folder / "view.exr").write_bytes(bytes(1000))
    print(folder, flush=True)
    time.sleep(60)
"""


@pytest.mark.slow
def test_a_limit_of_files_below_a_log_is_refused_before_snakemake_meets_it(tmp_path):
    folder = checkout(tmp_path / "plenoforge", one=ONE)
    command = "ulimit -f 8; exec snakemake --cores 1 --dry-run --config scenes=[one] preset=full"
    result = subprocess.run(
        ["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    (line,) = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert line.startswith("error: .snakemake: cannot be written: a file may have 8.19 kB here: ")
    assert "ulimit -f" in line


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [([40, 40], None), ([50, 45], "warning"), ([150, 45], "warning"), ([150, 55], "error")],
)
def test_sizes_of_files_on_one_disk_are_added_up(sizes, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(disk_space.shutil, "disk_usage", lambda _: Usage(100e9))
    folders = [tmp_path / f"not/there/{number}" for number in range(len(sizes))]
    needs = [
        disk_space.Need(folder, size * 1e9) for folder, size in zip(folders, sizes, strict=True)
    ]
    text = f"{folders[0]}: 100 GB are free on its disk, and this run writes some {sum(sizes)} GB"
    if expected == "error":
        with pytest.raises(UserError, match=text):
            list(disk_space.check(needs))
        return
    warnings = list(disk_space.check(needs))
    assert [warning.startswith(text) for warning in warnings] == [True] * (expected == "warning")


DISK = {"f_flag": 0, "f_frsize": 4096, "f_files": 10**6, "f_favail": 10**5}
DISK |= dict.fromkeys(("f_blocks", "f_bfree", "f_bavail"), 10**9)


@pytest.mark.parametrize(
    ("state", "files", "cause"),
    [
        ({}, 10**5, None),
        ({"f_favail": 50}, 60, "takes 50 more files (inodes), and this run writes some 60"),
        ({"f_favail": 0}, 0, "takes no more files (its inodes are used up): remove some files"),
        ({"f_files": 0, "f_favail": 0}, 60, None),
        ({"f_bavail": 0}, 0, "is full: free some space"),
        ({"f_flag": os.ST_RDONLY}, 0, "is read-only: mount its disk for writing, or write else"),
    ],
)
def test_a_full_or_read_only_disk_is_refused_with_the_cause(
    state, files, cause, tmp_path, monkeypatch
):
    monkeypatch.setattr(disk_space.os, "statvfs", lambda _: SimpleNamespace(**DISK | state))
    needs = [disk_space.Need(tmp_path / "results", 1, files)]
    if cause is None:
        assert list(disk_space.check(needs)) == []
        return
    with pytest.raises(UserError, match=re.escape(cause)) as caught:
        list(disk_space.check(needs))
    assert str(caught.value).startswith(f"{tmp_path / 'results'}: ")


def test_a_folder_of_somebody_else_is_refused_with_the_cause(nobody):
    nobody.chmod(0o500)
    with pytest.raises(UserError, match=r"you may not write in .*: change its permissions"):
        list(disk_space.check([disk_space.Need(nobody / "results", 1)]))
    with pytest.raises(UserError, match=r"cannot be written: you may not write in .*: change"):
        files.write_text(nobody / "results/names.json", "text")


@pytest.mark.slow
def test_a_run_that_cannot_fit_ends_before_its_first_job(tmp_path):
    folder = checkout(tmp_path, huge=HUGE)
    result = snakemake(folder, "--config", "scenes=huge", "preset=full")
    assert result.returncode != 0
    (said,) = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert said.startswith("error: results: ") and " GB are free on its disk" in said
    assert "Traceback" not in result.stderr
    assert not (folder / "results").exists()
    # The plan writes only the settings of its jobs.
    written = [path for path in (folder / "work").rglob("*") if path.is_file()]
    # A plan writes its mark, and the settings that are missing. A run takes its lock.
    notes = {"check.txt", "run.lock"}
    assert all("settings" in path.parts or path.name in notes for path in written)


def test_a_file_in_place_of_a_folder_is_named_in_place_of_a_quota(tmp_path):
    (tmp_path / "removed").touch()
    cause = f"{tmp_path / 'removed'} is a file, and must be a folder"
    with pytest.raises(UserError, match=re.escape(cause)):
        files.write_text(tmp_path / "removed/results/view.exr", "text")
    with pytest.raises(UserError, match=re.escape(cause)):
        list(disk_space.check([disk_space.Need(tmp_path / "removed", 1)]))


@pytest.mark.parametrize(
    ("options", "causes"),
    [
        ("ro", ["the disk of ", "is read-only: mount its disk for writing"]),
        ("size=1m,nr_inodes=8", ["its inodes are used up): remove some files"]),
        (
            "size=64k",
            ["GB are free on its disk, and this run writes some", "is full: free some space"],
        ),
    ],
)
@pytest.mark.parametrize("name", ["work", "results", "results/one"])
@pytest.mark.slow
def test_a_disk_that_takes_nothing_ends_a_run_with_one_line(name, options, causes, tmp_path):
    folder = checkout(tmp_path, one=ONE)
    disk = folder / name
    disk.mkdir(parents=True)
    mounted = mount_disk(disk, options)
    if not mounted:
        # Without the right to mount, the folder itself is read-only.
        disk.chmod(0o500)
        causes = ["you may not write in"]
    try:
        result = snakemake(folder, "--config", "scenes=one", "rigs=all", "preset=full")
    finally:
        if mounted:
            subprocess.run(["umount", disk], check=True)
    said = result.stderr.splitlines()
    assert result.returncode != 0
    assert "Traceback" not in result.stderr
    assert said[-1].startswith(f"error: {name}"), said[-1]
    assert any(cause in said[-1] for cause in causes), said[-1]


@pytest.mark.slow
def test_a_full_disk_below_snakemake_itself_is_one_line(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    if not mount_disk(disk, "size=40m"):
        pytest.skip("needs the right to mount a file system")
    try:
        folder = checkout(disk / "checkout", one=ONE)
        with (folder / "filler").open("wb", buffering=0) as file, suppress(OSError):
            while file.write(bytes(4096)):
                pass
        result = snakemake(folder, "--config", "scenes=one", "rigs=all", "preset=full")
    finally:
        subprocess.run(["umount", disk], check=True)
    assert result.stderr.splitlines()[-1].startswith("error: .snakemake: cannot be written: the d")
    assert "Traceback" not in result.stderr


@pytest.mark.slow
def test_a_limit_of_memory_in_which_blender_cannot_start_is_one_line(tmp_path):
    folder = checkout(tmp_path, one=ONE)
    arguments = [
        Path(sys.executable).with_name("snakemake"),
        "--cores",
        "1",
        "--config",
        "scenes=one",
    ]
    result = subprocess.run(
        [
            "bash",
            "-c",
            'ulimit -v 600000; exec "$@"',
            "bash",
            *arguments,
            "rigs=all",
            "preset=full",
        ],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    said = "error: memory: a process may have 614 MB here, and Blender needs at least 1.5 GB: "
    assert result.stderr.splitlines()[-1].startswith(said)
    assert "Traceback" not in result.stderr


@pytest.mark.slow
def test_a_dry_run_names_everything_that_the_run_would_refuse(tmp_path):
    folder = checkout(
        tmp_path,
        huge=HUGE,
        other=ONE.replace("builder: room", "blend: other.blend"),
        textured=ONE.replace("builder: room", "blend: textured.blend"),
        theirs="scene: {dataset: theirs}",
    )
    for name in ("other", "textured"):
        (folder / f"{name}.blend").write_bytes(b"a scene")
    files.write_json(folder / "configs/scenes/other.lock.json", {"sha256": "0" * 64})
    inventory = folder / "work/textured/inventory.json"
    gone = {"path": "textures/gone.png", "bytes": 7, "mtime_ns": 7}
    files.write_json(inventory, {"external_files": [gone]})
    camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
    write_views(folder / "theirs/dataset", camera, {"type": "plane", "cameras": [2, 1]})
    missing = next((folder / "theirs/dataset/exr").iterdir())
    missing.unlink()
    scenes = "scenes=[huge,other,textured,theirs]"
    arguments = ("--dry-run", "--config", scenes, "rigs=all", "preset=full")
    result = snakemake(folder, *arguments)
    refused = [line for line in result.stderr.splitlines() if line.startswith("would be refused")]
    assert result.returncode == 1, result.stderr
    assert len(refused) == 4, refused
    message = "\n".join(refused)
    assert re.search(r": results: .* GB are free on its disk, and this run writes some", message)
    assert f": other.blend: its sha256 is {files.sha256(folder / 'other.blend')}, but" in message
    assert (
        ": textured.blend: files that it shows are missing: textures/gone.png; put them" in message
    )
    assert f"theirs/dataset/exr: {missing.name}: no such file" in message


def test_only_leftovers_of_killed_processes_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(leftovers.tempfile, "gettempdir", lambda: str(tmp_path))
    arguments = [sys.executable, "-c", KEEPER, tmp_path]
    keepers = [
        subprocess.Popen(
            arguments, stdout=subprocess.PIPE, text=True, env={"PYTHONPATH": str(SCRIPTS)}
        )
        for _ in range(2)
    ]
    live, dead = (Path(keeper.stdout.readline().strip()) for keeper in keepers)
    keepers[1].kill()
    keepers[1].wait()
    (tmp_path / "results").mkdir()
    names = [".view.77.tmp.exr", ".view.78.tmp", ".view.79.tmp.exr", "view.exr", ".tmp.exr"]
    paths = [tmp_path / "results" / name for name in names]
    for path in paths:
        path.write_bytes(b"half")
    empty, full, young = (tmp_path / f"blender_{name}" for name in ("empty", "full", "young"))
    for path in (empty, full, young):
        path.mkdir()
    (full / "picture.png").write_bytes(b"an artist's")
    checkout_folder = tmp_path / "plenoforge-checkout"
    checkout_folder.mkdir()
    old = time.time() - 2 * leftovers.BLENDER_AGE
    for path in (live, dead, *paths, full / "picture.png", empty, full, checkout_folder):
        os.utime(path, (old, old))
    os.utime(paths[2])
    removed = leftovers.remove([tmp_path / "results"])
    assert {path for path in removed if path.is_relative_to(tmp_path)} == {dead, *paths[:2], empty}
    assert not any(path.exists() for path in removed)
    assert all(
        path.exists() for path in (live / "view.exr", *paths[2:], full, young, checkout_folder)
    )
    keepers[0].kill()
    keepers[0].wait()


def test_a_link_named_like_a_temporary_folder_removes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(leftovers.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(leftovers, "FOLDER_AGE", -1)
    kept = tmp_path / "kept/view.exr"
    kept.parent.mkdir()
    kept.write_bytes(b"mine")
    link = tmp_path / f"{leftovers.PREFIX}link"
    link.symlink_to(kept.parent)
    assert link not in leftovers.remove()
    assert link.is_symlink()
    assert kept.read_bytes() == b"mine"


def test_a_temporary_folder_needs_no_locks(tmp_path, monkeypatch):
    def flock(*_):
        raise OSError(errno.EBADF, "Bad file descriptor")

    monkeypatch.setattr(locks.fcntl, "flock", flock)
    monkeypatch.setattr(leftovers, "FOLDER_AGE", -1)
    with leftovers.temporary_folder(tmp_path) as folder:
        monkeypatch.setattr(leftovers.tempfile, "gettempdir", lambda: str(tmp_path))
        leftovers.remove()
        assert folder.is_dir()
    assert not folder.exists()


def test_processes_of_equal_number_write_separate_temporary_files(tmp_path, monkeypatch):
    monkeypatch.setattr(files.os, "getpid", lambda: 7)
    target = tmp_path / "names.json"
    with files.atomic_path(target) as one, files.atomic_path(target) as other:
        one.write_text("one")
        other.write_text("other")
    assert target.read_text() == "one"
    assert list(tmp_path.iterdir()) == [target]


def test_a_temporary_name_without_a_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="cannot be written"):
        files.write_text("", "text")
    assert not list(tmp_path.iterdir())
