"""A family of scenes: a member that fails leaves the others alone, and runs make the rest."""

import json
import subprocess

import bookkeeping
import forks
import pytest
from checkouts import ROOT, checkout, snakemake
from faults import FAULTS

pytestmark = pytest.mark.slow
CAMERA = "{lens: equidistant, fov: 180, resolution: [64, 64]}"
ROOMS = f"""
scene: {{builder: room}}
render: {{samples: 1}}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    size: 0.5
    center: [0, 0, 1.2]
    camera: {CAMERA}
    split: odd
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 60, resolution: [16, 16]}}
    format: png
exports:
  instant_ngp: {{sources: [perspective]}}
  nerf_synthetic: {{sources: [perspective]}}
family:
  seeds: 0-3
  values:
    rigs.LFPlane.size: {{uniform: [0.25, 0.5]}}
"""
# A builder that raises an error for seed 1, and crashes its process for seed 2.
BROKEN = """

built = build


def build(parameters):
    import os, signal
    if parameters["seed"] == 1:
        raise ValueError("no walls")
    if parameters["seed"] == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    built(parameters)
"""


def test_what_packs_datasets_refuses_a_family(tmp_path):
    folder = checkout(tmp_path / "plenoforge", rooms=ROOMS)
    chosen = ("--config", "scenes=[rooms]", "preset=full")
    run = snakemake(folder, "--dry-run", *chosen, "--", "package")
    assert run.returncode == 1
    assert "package: rooms: a family has no packages; its corpus is published as it" in run.stderr
    scene = folder / "configs/scenes/rooms.yaml"
    scene.write_text(f"{ROOMS}publish: {{creators: [{{name: A. Joiner}}], licence: CC0-1.0}}\n")
    run = snakemake(folder, "--dry-run", *chosen)
    assert run.returncode == 1
    assert "publish: does not go with family; its corpus has the licence" in run.stderr


def assert_two_members_failed(run, folder):
    """Check the first run: two members failed, and the others are complete datasets."""
    members = folder / "results/rooms"
    assert run.returncode == 1
    assert "2 of 4 members of rooms built, 2 failed: results/rooms/failed.txt" in run.stderr
    failed = (members / "failed.txt").read_text().splitlines()
    assert failed[0] == "0001: build_scene: ValueError: no walls"
    assert failed[1].startswith("0002: build_scene: killed by SIGSEGV")
    assert sorted(path.name for path in (members / "0001").iterdir()) == ["member.json"]
    assert "Traceback" in (folder / "work/rooms/0001/member.log").read_text()
    assert "Traceback" not in run.stderr
    record = json.loads((members / "0003/member.json").read_text())
    assert record["seed"] == 3
    assert record["state"] == "valid"
    assert 0.25 <= record["values"]["rigs.LFPlane.size"] <= 0.5
    dataset = members / "0003/LFPlane"
    for name in ("exr/view_0000f.exr", "perspective/view_0000f.png", "perspective/transforms.json"):
        assert (dataset / name).is_file()
    check = subprocess.run(
        ["sha256sum", "-c", "--quiet", "sha256sums.txt"], cwd=dataset, check=False
    )
    assert check.returncode == 0


def assert_a_plan_finds_damaged_records(folder, choice):
    """Damage what jobs have recorded of all members. Check that a plan names it."""
    fault_of_record = {
        "results/rooms/0002/member.json": "a digit",
        "work/rooms/members.json": "cut short",
        "results/rooms/corpus.json": "a bit",
    }
    for path, fault in fault_of_record.items():
        FAULTS[fault][0](folder / path, None)
    plan = snakemake(folder, "--dry-run", *choice)
    for path in fault_of_record:
        assert f"{path}: " in plan.stderr


def test_members_fail_alone_and_are_kept_and_mended(tmp_path):
    folder = checkout(tmp_path / "plenoforge", rooms=ROOMS)
    builder = folder / "scripts/scenes/room/__init__.py"
    sound_text = builder.read_text()
    builder.write_text(sound_text + BROKEN)
    choice = ("--config", "scenes=[rooms]", "rigs=all", "preset=full")

    run = snakemake(folder, *choice)
    assert_two_members_failed(run, folder)
    members = folder / "results/rooms"

    # Nothing is built again, and the failures are named again.
    before = bookkeeping.begun_members(folder, "rooms")
    run = snakemake(folder, *choice)
    assert run.returncode == 1
    assert "2 of 4 members of rooms built" in run.stderr
    assert bookkeeping.begun_members(folder, "rooms") == before

    # A sound builder makes all members. Their views are kept where the scene is the same.
    builder.write_text(sound_text)
    run = snakemake(folder, *choice)
    assert run.returncode == 0, run.stderr
    assert "4 of 4 members of rooms built" in run.stderr
    assert not (members / "failed.txt").exists()

    # A new member leaves the others alone, and a damaged file is made again.
    scene = folder / "configs/scenes/rooms.yaml"
    scene.write_text(ROOMS.replace("0-3", "0-4"))
    times = {name: (members / name / "member.json").stat().st_mtime_ns for name in ("0000", "0003")}
    view = members / "0001/LFPlane/exr/view_0000f.exr"
    content = view.read_bytes()
    view.write_bytes(content[:-1])
    verify = [forks.python(), ROOT / "scripts/verify.py", "results/rooms"]
    verified = subprocess.run(verify, cwd=folder, capture_output=True, text=True, check=False)
    assert verified.returncode == 1
    assert "results/rooms/0001/LFPlane/exr/view_0000f.exr: " in verified.stdout
    run = snakemake(folder, *choice)
    assert "5 of 5 members of rooms built" in run.stderr
    assert times == {name: (members / name / "member.json").stat().st_mtime_ns for name in times}
    assert view.read_bytes() == content
    corpus = json.loads((members / "corpus.json").read_text())
    assert [member["state"] for member in corpus["members"]] == ["valid"] * 5
    assert len([*(members / "thumbnails").iterdir()]) == 5
    verified = subprocess.run(verify, cwd=folder, capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stdout
    assert_a_plan_finds_damaged_records(folder, choice)


# While the file "trouble" exists, the system ends the process of seed 0, and its disk is full for
# seed 1.
TROUBLED = """

built = build


def build(parameters):
    import errno, os, pathlib, signal
    if pathlib.Path("trouble").exists():
        if parameters["seed"] == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        if parameters["seed"] == 1:
            raise OSError(errno.ENOSPC, "No space left on device")
    built(parameters)
"""


def test_what_stops_a_member_from_outside_is_no_failure_of_it(tmp_path):
    folder = checkout(tmp_path / "plenoforge", rooms=ROOMS)
    builder = folder / "scripts/scenes/room/__init__.py"
    builder.write_text(builder.read_text() + TROUBLED)
    choice = ("--config", "scenes=[rooms]", "rigs=all", "preset=full")
    members = folder / "results/rooms"

    (folder / "trouble").touch()
    run = snakemake(folder, *choice)
    assert run.returncode == 1
    assert "build_members failed: error: " in run.stderr
    assert "No space left on device" in run.stderr
    assert "Traceback" not in run.stderr
    log = (folder / "work/logs/rooms/batches/seeds_0000_0031.log").read_text()
    assert "member 0001 is not finished: OSError: [Errno 28] No space left on device" in log
    assert sorted(path.parent.name for path in members.glob("*/member.json")) == ["0002", "0003"]

    (folder / "trouble").unlink()
    before = bookkeeping.begun_members(folder, "rooms")
    run = snakemake(folder, *choice)
    assert run.returncode == 0, run.stderr
    assert "4 of 4 members of rooms built" in run.stderr
    assert bookkeeping.begun_members(folder, "rooms") == [*before, "0000", "0001"]
