"""A build on a real Slurm node, with the accidents that happen on clusters."""

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import bookkeeping
import forks
import psutil
import pytest
from bookkeeping import rendered, workers
from checkouts import ROOT, checkout, snakemake, start_snakemake
from slurm_node import Node, install
from waiting import wait_until as wait_until_soon

CUBOID = "smoke/LFCuboid_1x1x1"
SHARDS = ("0-3", "3-6")
# What the jobs on the cluster need.
INPUTS = (
    f"work/{CUBOID}/cameras.json",
    f"work/{CUBOID}/perspective/lens_map.npy",
    f"work/{CUBOID}/panorama/lightfield.json",
    "work/smoke/inventory.json",
)
CONFIG = ["--config", "scenes=smoke", "rigs=LFCuboid_1x1x1", "preset=full", "views_per_shard=3"]
WORDS = [
    "--profile",
    "profiles/slurm",
    "--cores",
    "2",
    "--retries",
    "4",
    "--slurm-init-seconds-before-status-checks",
    "2",
    # The panorama gets too little memory at first.
    "--set-resources",
    "render_panorama:mem_mb=100 if attempt == 1 else 4000",
    *CONFIG,
    "--",
    # A job that renders a shard also reprojects it.
    *(bookkeeping.shard(CUBOID, "perspective", views) for views in SHARDS),
    f"work/{CUBOID}/panorama/exr/view_0000f.exr",
]
# Slurm takes minutes, in which many looks would take time from other tests.
wait_until = partial(wait_until_soon, pause=0.1)
IMPATIENT = ROOT / "tests/impatient"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="Slurm's daemons are root's"),
]


# Two batches, of three members each.
ROOMS = """
scene: {builder: room}
render: {samples: 4}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    size: 0.5
    center: [0, 0, 1.2]
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
family: {seeds: 0-5, batch: 3}
"""
OF_ROOMS = ["--config", "scenes=rooms", "rigs=all", "preset=full"]


def slower_checkout(folder: Path) -> Path:
    """Return a checkout whose views take seconds, so that a test can stop a shard between them."""
    path = checkout(folder) / "configs/scenes/smoke.yaml"
    path.write_text(path.read_text().replace("samples: 4\n", "samples: 60\n"))
    return folder


def build(folder: Path, *targets: str) -> None:
    """Make targets on this machine."""
    result = snakemake(folder, *CONFIG, "--", *targets)
    assert result.returncode == 0, result.stdout + result.stderr


def views_of(folder: Path) -> dict[str, bytes]:
    """Return the rendered views of the dataset by name."""
    views = folder.glob(f"results/{CUBOID}/exr/*.exr")
    return {path.name: path.read_bytes() for path in views}


def test_no_view_is_lost_or_rendered_twice_on_a_cluster(tmp_path):
    install()
    folder = slower_checkout(tmp_path / "cluster")
    build(folder, *INPUTS)
    undisturbed = tmp_path / "undisturbed"
    shutil.copytree(folder, undisturbed)
    build(undisturbed, *(bookkeeping.shard(CUBOID, "render", views) for views in SHARDS))
    with Node(tmp_path / "node") as node:
        log = folder / "terminal.log"
        environment = node.environment | {"PYTHONPATH": str(IMPATIENT)}
        # The Snakemake of a batch only starts the job's steps, so it is a fork. The steps are
        # processes of the node: they see its disk, and Slurm measures their memory.
        environment["PYTHON_OF_BATCHES"] = str(forks.python())
        environment[forks.PYTHON_OF_JOBS] = sys.executable
        with log.open("wb") as terminal:
            run = start_snakemake(folder, *WORDS, env=environment, stdout=terminal, stderr=terminal)
        began = stop_next(folder, "*", set(), run)
        # All accidents happen to one shard. The other one's jobs may be faster.
        (shard,) = (views for views in SHARDS if workers(folder, CUBOID, views) & began)
        node.run("scancel", "--state=RUNNING", "--full", "--user=root")
        # The job submitted in its place hangs until its time is over.
        began |= stop_next(folder, shard, began, run)
        for job in node.run("squeue", "--states=RUNNING", "--noheader", "--format=%i").split():
            node.run("scontrol", "update", f"JobId={job}", "EndTime=now")
        # The disk of the next job is full, and it fails. It begins after it has chosen a folder of
        # temporary files, and so it does not choose one on another disk.
        full = stop_next(folder, shard, began, run)
        with no_room(node, full):
            for process in full:
                os.kill(process, signal.SIGCONT)
            wait_until(lambda: not any(map(psutil.pid_exists, full)), run, log=log)
            logs = [path.read_text() for path in folder.glob(f"work/logs/{CUBOID}/render/*.log")]
        wait_until(lambda: workers(folder, CUBOID, shard) - began - full, run, log=log)
        wait_for_views(folder, 4, run)
        node.kill_node()
        wait_until(lambda: node.state() == "down", node.daemons["slurmctld"], 60)
        node.start_node()
        assert run.wait(1800) == 0, log.read_text()
        states = node.run("squeue", "--states=all", "--noheader", "--format=%T").split()
    assert {"COMPLETED", "CANCELLED", "TIMEOUT", "FAILED"} <= set(states)
    if node.own_disk:
        no_room_left = re.compile(r"; [\d.]+ (bytes|[kM]B) are free there: free some space")
        assert any(map(no_room_left.search, logs)), logs
    assert "exceeded memory limit" in (tmp_path / "node/slurmd.log").read_text()
    assert set(rendered(folder).values()) == {1}
    assert views_of(folder) == views_of(undisturbed)
    assert len(views_of(folder)) == 6


def test_members_go_out_to_a_cluster_and_a_cancelled_batch_keeps_them(tmp_path, in_forks):
    install()
    folder = checkout(tmp_path / "cluster", rooms=ROOMS)
    log = folder / "terminal.log"
    with Node(tmp_path / "node") as node:
        with log.open("wb") as terminal:
            run = start_snakemake(
                folder,
                "--profile",
                "profiles/slurm",
                "--slurm-init-seconds-before-status-checks",
                "2",
                *OF_ROOMS,
                env=node.environment,
                stdout=terminal,
                stderr=terminal,
            )
        first = folder / "results/rooms/0000/member.json"
        wait_until(first.exists, run, log=log)
        written = first.stat().st_mtime_ns
        node.run("scancel", "--state=RUNNING", "--full", "--user=root")
        assert run.wait(1800) == 0, log.read_text()
        states = node.run("squeue", "--states=all", "--noheader", "--format=%T").split()
    assert "CANCELLED" in states
    assert "6 of 6 members of rooms built" in log.read_text()
    assert first.stat().st_mtime_ns == written
    # The same members on one machine, in one batch.
    alone = checkout(tmp_path / "alone", rooms=ROOMS.replace("batch: 3", "batch: 6"))
    result = snakemake(alone, *OF_ROOMS)
    assert result.returncode == 0, result.stdout + result.stderr
    for number in range(6):
        sums = f"results/rooms/000{number}/LFPlane/sha256sums.txt"
        views = [line for line in (folder / sums).read_text().splitlines() if "exr/" in line]
        assert len(views) == 2
        assert set(views) <= set((alone / sums).read_text().splitlines())


def test_a_run_goes_on_after_its_controller_did_not_answer(tmp_path):
    """A job ends meanwhile. The profile's settings let the executor ask again until it answers."""
    install()
    folder = slower_checkout(tmp_path / "cluster")
    build(folder, *INPUTS)
    # A cluster without accounting has no sacct, for which the executor asks `which`.
    (tmp_path / "bin").mkdir()
    which = tmp_path / "bin/which"
    which.write_text('#!/bin/sh\n[ "$1" = sacct ] && exit 1\nexec /usr/bin/which "$@"\n')
    which.chmod(0o755)
    log = folder / "terminal.log"
    with Node(tmp_path / "node") as node:
        path = f"{which.parent}:{node.environment['PATH']}"
        places = f"{IMPATIENT}:{folder / 'envs'}"
        environment = node.environment | {"PYTHONPATH": places, "PATH": path}
        with log.open("wb") as terminal:
            run = start_snakemake(folder, *WORDS, env=environment, stdout=terminal, stderr=terminal)
        wait_for_views(folder, 1, run)
        controller = node.daemons["slurmctld"]
        controller.terminate()
        controller.wait(30)
        # Five attempts without an answer, which is what the executor makes by itself, take 55 s.
        time.sleep(80)
        node.start("slurmctld", "-D")
        assert run.wait(900) == 0, log.read_text()
    said = log.read_text()
    assert "warning: Slurm does not answer: " in said and "note: Slurm answers again" in said
    assert set(rendered(folder).values()) == {1}
    assert len(views_of(folder)) == 6


def test_the_end_has_the_words_of_sbatch_for_a_refused_group(tmp_path, in_forks):
    install()
    folder = checkout(tmp_path / "cluster")
    build(folder, *INPUTS)
    log = folder / "terminal.log"
    more = ["--retries", "0", "--set-resources", "render:mem_mb=90000000"]
    with Node(tmp_path / "node") as node, log.open("wb") as terminal:
        shard = bookkeeping.shard(CUBOID, "perspective", SHARDS[0])
        words = ["--profile", "profiles/slurm", "--cores", "2", *more, *CONFIG, "--", shard]
        run = start_snakemake(
            folder, *words, env=node.environment, stdout=terminal, stderr=terminal
        )
        assert run.wait(600) == 1, log.read_text()
    said = "render failed: sbatch refused it: allocation failure: Requested node configuration is"
    assert log.read_text().splitlines()[-1].startswith(said), log.read_text()


def test_the_documented_program_needs_nothing_of_the_project():
    program = ROOT / "tests/slurm_node.py"
    environment = {"PATH": os.environ["PATH"]}
    result = subprocess.run(
        [sys.executable, program, "--help"], env=environment, capture_output=True, check=False
    )
    assert result.returncode == 0, result.stderr


def stop_next(folder: Path, views: str, began: set[int], run) -> set[int]:
    """Wait for processes of a shard other than those in ``began``. Stop and return them."""
    log = folder / "terminal.log"
    wait_until(lambda: workers(folder, CUBOID, views) - began, run, log=log)
    stopped = workers(folder, CUBOID, views) - began
    for process in stopped:
        os.kill(process, signal.SIGSTOP)
    return stopped


@contextmanager
def no_room(node: Node, found: set[int]):
    """Fill the node's disk. Without a disk of its own, limit the files of these processes."""
    if node.own_disk:
        filler = node.fill_disk()
        yield
        filler.unlink()
        return
    for process in found:
        resource.prlimit(process, resource.RLIMIT_FSIZE, (1, 1))
    yield


def wait_for_views(folder: Path, count: int, run) -> None:
    """Wait until this many views are rendered."""
    log = folder / "terminal.log"
    wait_until(lambda: rendered(folder).total() >= count, run, log=log)
