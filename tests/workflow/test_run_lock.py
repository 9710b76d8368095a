"""A run holds the locks of its scenes until its process ends."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
from conftest import SCRIPTS

from lightfield.core import locks
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
    with pytest.raises(UserError, match=rf"process {run.pid} of \w+\) makes the scene scene: wait"):
        run_lock.take([folder])
    run.kill()
    run.wait()
    assert not run_lock.is_held(folder)
    run_lock.take([folder])


def test_only_the_own_run_is_to_be_killed(run, tmp_path, monkeypatch):
    with pytest.raises(UserError, match=rf"\(kill {run.pid}\)"):
        run_lock.take([tmp_path / "scene"])
    me = locks.pwd.getpwuid(os.getuid()).pw_name
    # To another user, the same run is a colleague's.
    monkeypatch.setattr(locks.pwd, "getpwuid", lambda _: SimpleNamespace(pw_name="ada"))
    with pytest.raises(UserError, match=f"or ask {me} to end it") as refusal:
        run_lock.take([tmp_path / "scene"])
    assert "kill" not in str(refusal.value)


def test_runs_of_other_scenes_are_let_in(run, tmp_path):
    run_lock.take([tmp_path / "other"])
    assert not run_lock.is_held(tmp_path / "none")


def test_a_file_system_without_locks_gets_a_warning(tmp_path, monkeypatch, capsys):
    def refuse(*_):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(locks.fcntl, "flock", refuse)
    run_lock.take([tmp_path / "scene"])
    assert "cannot be locked: Function not implemented" in capsys.readouterr().err
