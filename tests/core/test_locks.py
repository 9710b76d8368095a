"""A process that waits for a lock says who holds it."""

import os
import subprocess
import sys

import pytest
from conftest import SCRIPTS

from lightfield.core import locks

# Locks a file, says so, and holds the lock until the input ends.
PROCESS = """
import sys
from lightfield.core import locks
with open(sys.argv[1], "a") as file:
    locks.lock(file, "another dog")
    print("locked", flush=True)
    input()
"""
USER = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture
def start(tmp_path):
    processes = []

    def start():
        processes.append(
            subprocess.Popen(
                [sys.executable, "-c", PROCESS, tmp_path / "a lock"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env={"PYTHONPATH": str(SCRIPTS)},
            )
        )
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_who_waits_names_the_process_and_goes_on_after_its_death(start):
    first = start()
    assert first.stdout.readline() == "locked\n"
    second = start()
    waiting = f"waiting for another dog (process {first.pid} of {USER})\n"
    assert second.stderr.readline() == waiting
    first.kill()
    assert second.stdout.readline() == "locked\n"


def test_a_kernel_that_lists_no_locks_costs_only_the_name(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(locks, "_LOCKS", tmp_path / "none")
    with (tmp_path / "lock").open("a") as file:
        assert locks.try_lock(file)
        assert locks.holder_of(file) is None
        locks.tell_waiting("a dog", [file])
    assert capsys.readouterr().err == "waiting for a dog\n"


def test_several_processes_hold_a_shared_lock(tmp_path):
    path = tmp_path / "lock"
    with path.open("a") as one, path.open("a") as other, path.open("a") as third:
        assert locks.try_lock(one, shared=True)
        assert locks.try_lock(other, shared=True)
        assert not locks.try_lock(third)


def test_a_holder_elsewhere_is_not_to_be_killed():
    this = locks.Holder.this_process()
    assert this.is_own
    assert str(this) == f"process {os.getpid()} of {USER}"
    elsewhere = this._replace(host="node7")
    assert not elsewhere.is_own
    assert str(elsewhere) == f"process {os.getpid()} of {USER} on node7"
