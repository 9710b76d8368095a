"""A run holds the locks of its scenes until its process ends."""

import subprocess
import sys

import pytest
from conftest import SCRIPTS

from lightfield.core.errors import UserError
from lightfield.workflow import run_lock

# Takes the lock of a folder, and lives until it is killed.
RUN = """
import sys, time
from pathlib import Path
from lightfield.workflow import run_lock
run_lock.take([Path(sys.argv[1])])
print("taken", flush=True)
time.sleep(60)
"""


@pytest.fixture
def run(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, tmp_path / "scene"],
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": str(SCRIPTS)},
    )
    process.stdout.readline()
    yield process
    process.kill()
    process.wait()


def test_a_live_run_is_named_and_a_killed_one_frees_its_lock(run, tmp_path):
    folder = tmp_path / "scene"
    assert run_lock.is_held(folder)
    with pytest.raises(UserError, match=rf"another run makes these files, process {run.pid}: wait"):
        run_lock.take([folder])
    run.kill()
    run.wait()
    assert not run_lock.is_held(folder)
    run_lock.take([folder])


def test_runs_of_other_scenes_are_let_in(run, tmp_path):
    run_lock.take([tmp_path / "other"])
    assert not run_lock.is_held(tmp_path / "none")


def test_a_file_system_without_locks_gets_a_warning(tmp_path, monkeypatch, capsys):
    def refuse(*_):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(run_lock.fcntl, "flock", refuse)
    run_lock.take([tmp_path / "scene"])
    assert "cannot be locked: Function not implemented" in capsys.readouterr().err
