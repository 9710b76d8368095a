"""Commands beside a plain run do what they say, and no more."""

import os
import shutil

import bookkeeping
import pytest
from bookkeeping import CUBOID, rendered
from checkouts import assert_same_bytes, planned, snakemake

pytestmark = pytest.mark.slow
VIEW = f"results/{CUBOID}/exr/view_b0000f.exr"
TRANSFORMS = f"results/{CUBOID}/perspective/transforms.json"


@pytest.fixture
def folder(smoke, tmp_path):
    """A copy of a build, which a test may change."""
    return shutil.copytree(smoke, tmp_path / "plenoforge")


def change_scene(folder, old, new):
    path = folder / "configs/scenes/smoke.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def run(folder, *arguments):
    result = snakemake(folder, *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def test_new_times_alone_run_nothing(folder):
    for name in (
        "config.yaml",
        "configs/scenes/smoke.yaml",
        "scripts/scenes/room/__init__.py",
        "work/smoke/scene.blend",
        f"work/{CUBOID}/settings/lightfield.json",
        f"results/{CUBOID}/lightfield.json",
        bookkeeping.shard(CUBOID, "render", "0-6"),
        VIEW,
        TRANSFORMS,
    ):
        os.utime(folder / name)
    assert "Nothing to be done" in run(folder, "--dry-run", "smoke")


def states(folder):
    """Return the time and the bytes of each file of a build. Each plan may write settings."""
    paths = {path for name in ("results", "work") for path in (folder / name).rglob("*")}
    paths -= {folder / name for name in bookkeeping.OF_PLANS}
    return {
        path: (path.stat().st_mtime_ns, path.read_bytes())
        for path in paths
        if path.is_file() and "settings" not in path.parts
    }


def test_commands_that_show_something_change_nothing(folder):
    (folder / VIEW).write_text("not a view")
    change_scene(folder, "exposure: -1", "exposure: -2")
    plan = planned(folder, "smoke")
    assert plan["render"] == 1 and plan["reproject"] > 1
    before = states(folder)
    for arguments in (
        ["--lint"],
        ["--list-rules"],
        ["--summary", "--", "smoke"],
        ["--dag", "--", "smoke"],
        ["--unlock"],
    ):
        run(folder, *arguments)
        assert states(folder) == before, arguments
    assert planned(folder, "smoke") == plan


def test_a_target_by_its_path_is_made_with_what_it_needs(folder):
    (folder / VIEW).unlink()
    assert planned(folder, TRANSFORMS) == {
        "render": 1,
        "reproject": 1,
        "export_to_instant_ngp": 1,
    }
    change_scene(folder, "center: [0, 0, 1.5]", "center: [0, 0, 1.4]")
    outdated = {
        "lightfield": 1,
        "check_cameras": 1,
        "render": 1,
        "lens_map": 1,
        "reprojected_lightfield": 1,
        "reproject": 1,
        "export_to_instant_ngp": 1,
    }
    assert planned(folder, TRANSFORMS) == outdated
    shutil.rmtree(folder / ".snakemake")
    assert planned(folder, TRANSFORMS) == outdated


def test_a_forced_job_keeps_the_views_that_are_finished(smoke, folder):
    before = rendered(folder)
    shard = bookkeeping.shard(CUBOID, "render", "0-6")
    assert "1 job in" in run(folder, "--forcerun", "render", "--", shard)
    assert rendered(folder) == before
    assert_same_bytes(smoke, folder, CUBOID)


def test_a_run_until_a_rule_goes_no_further(smoke, folder):
    (folder / VIEW).unlink()
    change_scene(folder, "exposure: -1", "exposure: -2")
    run(folder, "--until", "render", "--", "smoke")
    assert_same_bytes(smoke, folder)
    plan = planned(folder, "smoke")
    assert "render" not in plan and plan["reproject"] > 1
