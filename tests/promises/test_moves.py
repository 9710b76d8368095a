"""Results that are moved, or that two builds share: plans say what a run does."""

from pathlib import Path

import pytest
import tiny
from checkouts import checkout, snakemake

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

pytestmark = pytest.mark.slow

PAGE = Path(f"results/{tiny.NAME}/report/index.html")
COSTS = Path(f"results/{tiny.NAME}/report/costs.json")


def said(folder, *arguments):
    """Return the exit status of Snakemake, and what it printed."""
    result = snakemake(folder, *tiny.CHOSEN, *arguments)
    return result.returncode, result.stdout + result.stderr


def test_a_link_in_the_old_place_keeps_a_moved_build_finished(tiny_build):
    (tiny_build / "results").rename(tiny_build / "elsewhere")
    (tiny_build / "results").symlink_to(tiny_build / "elsewhere")
    status, plan = said(tiny_build, "--dry-run")
    assert status == 0 and "Nothing to be done" in plan


POSES = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFPoses:
    type: poses
    file: poses.csv
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
"""
IMPORTED = "scene: {dataset: published}\n"
ARGUMENTS = ("--config", "scenes=[posed,imported]", "rigs=all", "preset=full", "--")
# Their settings have the rig.
TARGETS = ("results/posed/LFPoses/lightfield.json", "results/imported/LFMine/lightfield.json")


def test_a_copied_folder_with_a_file_of_poses_has_nothing_to_do(tmp_path):
    folder = checkout(tmp_path / "first", posed=POSES, imported=IMPORTED)
    (folder / "poses.csv").write_text("name,x,y,z,rx,ry,rz\na,0,0,1,1.57,0,0\n")
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [4, 4]})
    rig = {"type": "plane", "cameras": [1, 1]}
    LightField.from_rig(rig, lens).write(folder / "published/LFMine/lightfield.json")
    run = snakemake(folder, *ARGUMENTS, *TARGETS)
    assert run.returncode == 0, run.stderr
    copy = folder.rename(tmp_path / "second")
    plan = snakemake(copy, "--dry-run", *ARGUMENTS, *TARGETS)
    assert "Nothing to be done" in plan.stderr
    (copy / "poses.csv").write_text("name,x,y,z,rx,ry,rz\na,1,0,1,1.57,0,0\n")
    plan = snakemake(copy, "--dry-run", *ARGUMENTS, *TARGETS)
    assert "outdated: posed/LFPoses/lightfield: setting poses_sha256" in plan.stderr


def test_an_absolute_folder_of_results_has_nothing_to_do_after_its_run(tmp_path):
    folder = tiny.checked_out(tmp_path / "plenoforge")
    results = f"results={tmp_path / 'elsewhere'}"
    tiny.build(folder, results)
    status, plan = said(folder, results, "--dry-run")
    assert status == 0 and "Nothing to be done" in plan
    (tmp_path / "elsewhere" / tiny.NAME / "exr/view_0000f.exr").write_bytes(b"spoilt")
    tiny.build(folder, results)
    status, plan = said(folder, results, "--dry-run")
    assert status == 0 and "Nothing to be done" in plan


@pytest.mark.parametrize("is_moved", [True, False])
def test_another_folder_of_results_is_refused_before_a_job_and_in_the_plan(tiny_build, is_moved):
    if is_moved:
        (tiny_build / "results").rename(tiny_build / "elsewhere")
    before = sorted(tiny_build.rglob("*.exr"))
    status, plan = said(tiny_build, "results=elsewhere", "--dry-run")
    (refusal,) = (
        line
        for line in plan.splitlines()
        if line.startswith("would be refused: --config: results:")
    )
    assert status == 1 and "is missing" not in plan and "outdated:" not in plan
    status, run = said(tiny_build, "results=elsewhere")
    assert status == 1
    assert run.splitlines()[-1] == refusal.replace("would be refused", "error")
    assert sorted(tiny_build.rglob("*.exr")) == before
    # A folder work of its own belongs to the other folder.
    status, plan = said(tiny_build, "results=elsewhere", "work=other_work", "--dry-run")
    assert status == 0 and "refused" not in plan


def test_a_plan_says_that_another_build_writes_the_same_dataset(tiny_build):
    _, plan = said(tiny_build, "--dry-run")
    assert "folder work" not in plan
    # Costs are never equal in two builds. Pages show them.
    for path in (COSTS, PAGE):
        text = (tiny_build / path).read_text()
        (tiny_build / path).write_text(f"{text}\n")
    _, plan = said(tiny_build, "--dry-run")
    assert (
        plan.count(f"note: {COSTS} is newer than its receipt: if runs with another folder work")
        == 1
    )


def test_the_status_does_not_count_views_of_an_earlier_scene(tiny_build):
    _, status = said(tiny_build, "--", "status")
    assert "rendered: 6 of 6\n" in status and "outdated" not in status
    tiny.edit(tiny_build, "size: 0.5", "size: 0.4")
    _, status = said(tiny_build, "--", "status")
    assert "rendered: 0 of 6" in status
    assert "outdated: 6 views of an earlier scene, or of earlier settings" in status
