"""A kill at any moment, then one run: it goes on, and makes nothing twice that was finished."""

import os
import signal

import bookkeeping
import pytest
from checkouts import assert_same_bytes, checkout, snakemake, start_snakemake
from faults import KINDS
from waiting import wait_until

pytestmark = pytest.mark.slow


@pytest.mark.usefixtures("in_forks")
def test_after_a_kill_at_each_kind_of_file_the_next_run_goes_on(smoke, tmp_path):
    """Each run is killed as soon as a kind of file is there for the first time."""
    folder = checkout(tmp_path / "killed")
    expected = {kind: folder / names[0] for kind, names in KINDS.items()}
    finished = {}
    kills = 0
    while expected:
        run = start_snakemake(folder, "--cores", "2", "smoke")
        missing = list(expected.values())
        wait_until(lambda missing=missing: any(path.exists() for path in missing), run)
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
        kills += 1
        expected = {kind: path for kind, path in expected.items() if not path.exists()}
        finished |= bookkeeping.times_of_making(folder)
    assert kills > 15
    result = snakemake(folder, "--cores", "2", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    assert_same_bytes(smoke, folder)
    assert max(bookkeeping.rendered(folder).values()) == 1
    assert finished.items() <= bookkeeping.times_of_making(folder).items()
    plan = snakemake(folder, "--dry-run", "smoke")
    assert "Nothing to be done" in plan.stdout + plan.stderr
