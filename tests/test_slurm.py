"""A build on a real Slurm node, to which happens what happens on clusters."""

import json
import os
import signal
from pathlib import Path

import pytest
from checkouts import assert_same_bytes, checkout, rendered, start_snakemake, wait_until
from slurm_node import Node, install

CUBOID = "smoke/LFCuboid_1x1x1"
WORDS = [
    *(
        "--profile",
        "profiles/slurm",
        "--cores",
        "2",
        "--slurm-init-seconds-before-status-checks",
        "2",
    ),
    # A panorama is given too little memory first.
    *("--set-resources", "render_panorama:mem_mb=100 if attempt == 1 else 4000"),
    *("--config", "scenes=smoke", "rigs=LFCuboid_1x1x1", "preset=full", "views_per_shard=3"),
]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="Slurm's daemons are root's"),
]


def test_no_view_is_lost_or_made_twice_whatever_happens_on_the_cluster(smoke, tmp_path):
    install()
    folder = checkout(tmp_path / "cluster")
    with Node(tmp_path / "node") as node:
        log = folder / "terminal.log"
        with log.open("wb") as terminal:
            run = start_snakemake(
                folder, *WORDS, env=node.environment, stdout=terminal, stderr=terminal
            )
        wait_for_views(folder, 1, run)
        began = processes(folder)
        node.run("scancel", "--state=RUNNING", "--full", "--user=root")
        # What is submitted in its place hangs, until its time is over.
        wait_until(lambda: processes(folder) - began, run, log=log)
        for process in processes(folder) - began:
            os.kill(process, signal.SIGSTOP)
        for job in node.run("squeue", "--states=RUNNING", "--noheader", "--format=%i").split():
            node.run("scontrol", "update", f"JobId={job}", "EndTime=now")
        wait_for_views(folder, 4, run)
        node.kill_node()
        wait_until(lambda: node.state() == "down", node.daemons["slurmctld"], 60)
        node.start_node()
        assert run.wait(1800) == 0, log.read_text()
        states = node.run("squeue", "--states=all", "--noheader", "--format=%T").split()
    assert {"COMPLETED", "CANCELLED", "TIMEOUT", "FAILED"} <= set(states)
    assert "exceeded memory limit" in (tmp_path / "node/slurmd.log").read_text()
    assert set(rendered(folder).values()) == {1}
    assert_same_bytes(smoke, folder, CUBOID)


def processes(folder: Path) -> set[int]:
    """Return the processes that have worked on a shard."""
    lines = [
        json.loads(line)
        for journal in folder.glob(f"work/{CUBOID}/render/*.journal.jsonl")
        for line in journal.read_text().splitlines()
    ]
    return {line["pid"] for line in lines if "pid" in line}


def wait_for_views(folder: Path, count: int, run) -> None:
    """Wait until the journals have so many views."""
    journals = f"work/{CUBOID}/render/*.journal.jsonl"
    wait_until(
        lambda: sum(path.read_text().count('"view"') for path in folder.glob(journals)) >= count,
        run,
        log=folder / "terminal.log",
    )
