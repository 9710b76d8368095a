"""A user's file that changes after the plan, or in secret, ends in no valid dataset."""

import json
import os
import subprocess
import sys

import bookkeeping
import forks
import numpy as np
import pytest
from checkouts import assert_same_bytes, checkout, jobs_on, snakemake, start_snakemake
from PIL import Image
from waiting import wait_until

from lightfield.core.files import sha256

pytestmark = pytest.mark.slow

CAMERA = "camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}"
BROUGHT = f"""
scene: {{blend: scene.blend}}
render: {{samples: 1}}
rigs:
  LFPlane:
    type: plane
    cameras: [4, 1]
    center: [0, 0, 2]
    size: 0.1
    look_at: [0, 0, 0]
    {CAMERA}
report: {{panorama: false}}
"""
CHOSEN = ("--config", "scenes=[mine]", "rigs=all", "preset=full", "views_per_shard=1")
VIEWS = "results/mine/LFPlane/exr"

BUILDER = """
import bpy
from helper import SIZE


def build(parameters):
    bpy.ops.mesh.primitive_cube_add(size=SIZE)
    bpy.ops.object.light_add(type="SUN")
"""
HELPER = "SIZE = 2\n"
POSES = "name,x,y,z,rx,ry,rz\na,0,-5,0,1.57,0,0\n"
BUILT = f"""
scene: {{builder: ./mine.py}}
render: {{samples: 1}}
rigs:
  LFPoses: {{type: poses, file: poses.csv, {CAMERA}}}
"""


def write_texture(path, level):
    """Write a grey picture. All have the same size in bytes, and the same time."""
    Image.fromarray(np.full((8, 8, 3), level, np.uint8)).save(path)
    os.utime(path, (1_700_000_000, 1_700_000_000))


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A .blend that shows texture.bmp."""
    folder = tmp_path_factory.mktemp("scene")
    write_texture(folder / "texture.bmp", 100)
    program = "tests/blender/textured_scene.py"
    subprocess.run(
        [sys.executable, program, folder / "scene.blend", folder / "texture.bmp"], check=True
    )
    return folder / "scene.blend"


def brought(folder, scene, level):
    """Return a checkout with the .blend and a texture of a level."""
    checkout(folder, mine=BROUGHT)
    (folder / "scene.blend").write_bytes(scene.read_bytes())
    write_texture(folder / "texture.bmp", level)
    return folder


def build(folder):
    result = snakemake(folder, "--cores", "2", *CHOSEN)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder


@pytest.fixture(scope="module")
def bright(scene, tmp_path_factory):
    """A build with a bright texture."""
    return build(brought(tmp_path_factory.mktemp("bright") / "plenoforge", scene, 200))


@pytest.mark.usefixtures("in_forks")
def test_a_texture_changed_between_two_shards_ends_in_no_mixed_dataset(scene, bright, tmp_path):
    folder = brought(tmp_path / "plenoforge", scene, 100)
    output = tmp_path / "output.txt"
    with output.open("w") as file:
        run = start_snakemake(folder, *CHOSEN, stdout=file, stderr=file)
    wait_until(lambda: any((folder / VIEWS).glob("view_*.exr")), run, log=output)
    write_texture(folder / "texture.bmp", 200)
    assert run.wait() == 1
    assert "texture.bmp: has changed" in output.read_text()
    build(folder)
    assert_same_bytes(bright, folder)


def test_a_texture_changed_at_its_size_and_time_is_planned_and_rendered(scene, bright, tmp_path):
    folder = build(brought(tmp_path / "plenoforge", scene, 100))
    write_texture(folder / "texture.bmp", 200)
    plan = snakemake(folder, "--dry-run", *CHOSEN)
    assert "texture.bmp" in bookkeeping.outdated_in_plan(plan.stderr)["mine/inventory"]
    assert_same_bytes(bright, build(folder))
    assert "Nothing to be done" in snakemake(folder, "--dry-run", *CHOSEN).stderr


def test_a_changed_calibration_is_planned_and_rendered(tmp_path):
    """Its numbers stand in lightfield.json, and in the settings of the jobs that need them."""
    camera = "camera: {lens: calibrated, file: cameras.txt}"
    folder = checkout(tmp_path / "plenoforge", mine=BUILT.replace(CAMERA, camera))
    for file, text in {"mine.py": BUILDER, "helper.py": HELPER, "poses.csv": POSES}.items():
        (folder / file).write_text(text)

    def calibrated(focal_length):
        text = f"1 SIMPLE_PINHOLE 16 16 {focal_length} 8 8\n"
        (folder / "cameras.txt").write_text(text)
        rig = build(folder) / "results/mine/LFPoses"
        lightfield = json.loads((rig / "lightfield.json").read_text())
        assert lightfield["camera"]["focal_length"] == pytest.approx(focal_length * 36 / 16)
        return sha256(rig / "exr/a.exr")

    before = calibrated(20)
    (folder / "cameras.txt").write_text("1 SIMPLE_PINHOLE 16 16 30 8 8\n")
    plan = bookkeeping.outdated_in_plan(snakemake(folder, "--dry-run", *CHOSEN).stderr)
    assert "mine/LFPoses/lightfield" in plan
    assert calibrated(30) != before
    assert calibrated(20) == before


@pytest.mark.parametrize(
    ("name", "rule", "old", "new"),
    [
        ("mine.py", "build_scene", "SUN", "POINT"),
        ("helper.py", "build_scene", "2", "3"),
        ("poses.csv", "lightfield", "-5", "-6"),
    ],
)
def test_a_file_changed_after_the_plan_is_refused(tmp_path, name, rule, old, new):
    """It may be as before when the next run is planned."""
    folder = checkout(tmp_path / "plenoforge", mine=BUILT)
    for file, text in {"mine.py": BUILDER, "helper.py": HELPER, "poses.csv": POSES}.items():
        (folder / file).write_text(text)
    plan = snakemake(folder, "--dry-run", "--logger", "jobs", *CHOSEN).stderr
    (job,) = (job for job in jobs_on(plan) if job["rule"] == rule)
    (folder / name).write_text((folder / name).read_text().replace(old, new, 1))
    for file in job["log"]:
        (folder / file).parent.mkdir(parents=True)
    path = f"{forks.python().parent}:{os.environ['PATH']}"
    command = ["bash", "-c", job["command"]]
    result = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, check=False)
    assert result.returncode == 1
    log = (folder / job["log"][0]).read_text()
    changed = "mine.py" if rule == "build_scene" else name
    assert log.endswith(f"{changed}: has changed since the plan; start the run again\n")
    assert not bookkeeping.noted(folder)
