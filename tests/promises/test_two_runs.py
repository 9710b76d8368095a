"""Two runs in one folder: at the same time, and after one of them was killed or stopped."""

import os
import pwd
import shutil
import signal
import subprocess
import sys
from contextlib import suppress

import forks
import pytest
from checkouts import checkout, snakemake, start_snakemake
from waiting import wait_until

pytestmark = pytest.mark.slow

SCENE = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
"""

# Stands in for what builds a scene. It writes the number of the process group of Snakemake and its
# jobs. Then it waits until the test lets it go on.
WAITING = """
import os, time
from pathlib import Path
from lightfield.core.files import write_text
def build(job):
    Path("starting").write_text(str(os.getpgrp()))
    Path("starting").rename("started")
    while not Path("go").exists():
        time.sleep(0.05)
    write_text(job.output, "a scene")
"""
BUILD = ("--config", "scenes=[one,two]", "rigs=all", "preset=full", "--", "work/one/scene.blend")


@pytest.fixture
def real_jobs(monkeypatch):
    """Run the jobs of forks as real children of Snakemake, which share its locks."""
    monkeypatch.setenv(forks.PYTHON_OF_JOBS, sys.executable)


@pytest.fixture(params=["checkout", "own folder"])
def building(request, tmp_path, real_jobs, in_forks):
    """A folder with a run that waits for its job, the process, the run's number, and a function.

    The process stands for the run, which is a fork. The function runs Snakemake there.
    """
    folder, arguments = checkout(tmp_path / "checkout", one=SCENE, two=SCENE), BUILD
    (folder / "scripts/lightfield/rendering/scenes/built_scene.py").write_text(WAITING)
    if request.param == "own folder":
        own_folder = tmp_path / "own"
        (own_folder / "configs").mkdir(parents=True)
        (folder / "configs/scenes").rename(own_folder / "configs/scenes")
        shutil.copytree(own_folder / "configs/scenes", folder / "configs/scenes")
        arguments = ("--snakefile", folder / "Snakefile", "--directory", own_folder, *BUILD)
        folder = own_folder
    else:
        arguments = ("--directory", folder, *BUILD)
    process = start_snakemake(tmp_path / "checkout", *arguments, stderr=subprocess.PIPE, text=True)
    wait_until((folder / "started").exists, process)

    def run(*more, target=None):
        given = (*arguments[:-1], target) if target else arguments
        return snakemake(tmp_path / "checkout", *more, *given)

    run.start = lambda **options: start_snakemake(tmp_path / "checkout", *arguments, **options)
    number = int((folder / "started").read_text())
    yield folder, process, number, run
    (folder / "go").touch()
    with suppress(ProcessLookupError):
        os.killpg(number, signal.SIGKILL)
    process.wait()


def last_line(run):
    return (run.stdout + run.stderr).splitlines()[-1]


def test_a_second_build_is_refused_whatever_other_runs_look_at_the_folder(building):
    folder, process, number, run = building
    user = pwd.getpwuid(os.getuid()).pw_name
    refusal = f"error: another run (process {number} of {user}) makes the scene one: wait for it, "
    second = run()
    assert second.returncode != 0
    assert last_line(second).startswith(refusal)
    assert "Traceback" not in second.stdout + second.stderr
    assert "locked" not in (dry := run("--dry-run")).stderr and dry.returncode == 0
    # A run that makes no files leaves the build its locks.
    for options in ((), ("--nolock",)):
        status = run(*options, target="status")
        assert status.returncode == 0, status.stderr
    assert last_line(run()).startswith(refusal)
    (folder / "go").touch()
    assert process.wait() == 0
    assert run().returncode == 0


@pytest.mark.parametrize("building", ["checkout"], indirect=True)
@pytest.mark.parametrize("command", ["--dry-run", "--summary", "--lint"])
def test_a_command_that_shows_something_leaves_a_live_run_alone(building, command):
    folder, process, _, run = building
    shown = run(command)
    assert shown.returncode == 0, shown.stdout + shown.stderr
    assert "locked" not in shown.stderr and "another run" not in shown.stderr
    assert process.poll() is None
    (folder / "go").touch()
    assert process.wait() == 0
    assert (folder / "work/one/scene.blend").read_text() == "a scene"


def test_a_build_of_another_dataset_runs_beside_it(building):
    folder, process, _, run = building
    target = "results/two/LFPlane/lightfield.json"
    second = run(target=target)
    assert second.returncode == 0, second.stderr
    assert (folder / target).is_file()
    assert process.poll() is None
    (folder / "go").touch()
    assert process.wait() == 0


def test_two_scenes_are_built_at_once_in_one_folder(built_tiny, tmp_path, real_jobs):
    scene = f"scene: {{dataset: {built_tiny}/results/tiny}}"
    folder = checkout(tmp_path / "shared", one=scene, two=scene)
    chosen = [
        ("--config", f"scenes=[{name}]", "rigs=all", "preset=full") for name in ("one", "two")
    ]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    runs = [start_snakemake(folder, *given, **pipe) for given in chosen]
    for run in runs:
        said, _ = run.communicate()
        assert run.returncode == 0, said
    index = (folder / "results/index.html").read_text()
    assert all(f"{name}/LFPlane/report/index.html" in index for name in ("one", "two"))
    for given in chosen:
        plan = snakemake(folder, "--dry-run", *given)
        assert "Nothing to be done" in plan.stdout + plan.stderr


def test_after_a_kill_with_its_jobs_the_next_run_continues(building):
    folder, process, number, run = building
    os.killpg(number, signal.SIGKILL)
    process.wait()
    (folder / "go").touch()
    following = run()
    assert following.returncode == 0, following.stderr
    assert "waiting for" not in following.stderr
    assert (folder / "work/one/scene.blend").read_text() == "a scene"


def test_after_a_kill_the_next_run_waits_for_the_jobs_that_live_on(building, tmp_path):
    folder, process, number, run = building
    os.kill(number, signal.SIGKILL)
    process.wait()
    log = tmp_path / "terminal.log"
    with log.open("w") as terminal:
        following = run.start(stdout=terminal, stderr=terminal)
    waiting = "waiting for a process of another run"
    wait_until(lambda: waiting in log.read_text(), following, log=log)
    (folder / "go").touch()
    assert following.wait() == 0, log.read_text()
    assert (folder / "work/one/scene.blend").read_text() == "a scene"


@pytest.mark.parametrize("building", ["checkout"], indirect=True)
def test_a_stopped_run_says_so_and_the_next_one_continues(building):
    folder, process, number, run = building
    os.kill(number, signal.SIGTERM)
    said = process.stderr.readline()
    while "stopping after SIGTERM" not in said:
        said = process.stderr.readline()
        assert said, "it ended without a message"
    (folder / "go").touch()
    *_, last = process.stderr.read().splitlines()
    assert process.wait() != 0
    assert last.startswith("error: the run was stopped") and last.endswith("goes on")
    assert (folder / "work/one/scene.blend").read_text() == "a scene"
    assert run().returncode == 0
