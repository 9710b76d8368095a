"""What changes while a run lives is neither used nor noted as right: a job fails, and says why."""

import contextlib
import os
import signal
import time

import bookkeeping
import pytest
import tiny
from bookkeeping import rendered
from checkouts import assert_same_bytes, planned, start_snakemake
from waiting import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("in_forks")]


def start(folder, *arguments):
    """Start a run in a checkout. Return it, and the file with what it prints."""
    output = folder.parent / f"{folder.name}.txt"
    with output.open("w") as file:
        run = start_snakemake(
            folder, "--cores", "2", *tiny.CHOSEN, *arguments, stdout=file, stderr=file
        )
    return run, output


def replace(path, old, new):
    text = path.read_bytes()
    assert old in text
    path.write_bytes(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "old", "new", "maker"),
    [
        (tiny.LIGHTFIELD, b'"samples": 4', b'"samples": 5', "lightfield"),
        (tiny.VIEW, b"R", b"S", "render"),
        (tiny.TRANSFORMS, b"0.", b"1.", "export_to_instant_ngp"),
    ],
)
def test_a_file_changed_right_after_its_job_is_not_used(
    built_tiny, tmp_path, name, old, new, maker
):
    folder = tiny.checked_out(tmp_path / "fresh")
    run, output = start(folder)
    wait_until(lambda: name in bookkeeping.noted(folder), run, log=output)
    replace(folder / name, old, new)
    assert run.wait() == 1
    assert f"{name}: is not as its job made it" in output.read_text()
    assert planned(folder, *tiny.CHOSEN)[maker] == 1
    tiny.build(folder)
    assert_same_bytes(built_tiny, folder)
    assert max(rendered(folder).values()) <= (2 if maker == "render" else 1)


def test_an_input_that_changes_while_a_job_reads_it_fails_the_job(built_tiny, tmp_path):
    folder = tiny.checked_out(tmp_path / "fresh")
    run, output = start(folder)
    wait_until((folder / tiny.VIEW).exists, run, log=output)
    with (folder / tiny.BLEND).open("ab") as file:
        file.write(b"more")
    assert run.wait() == 1
    error = f"error: {tiny.BLEND}: has changed while this job read it; start the run again"
    assert error in output.read_text()
    tiny.build(folder)
    assert_same_bytes(built_tiny, folder)
    assert max(rendered(folder).values()) == 1


@pytest.mark.parametrize("over_old_results", [False, True])
def test_after_kills_again_and_again_no_view_is_rendered_twice(
    built_tiny, tiny_build, tmp_path, over_old_results
):
    undisturbed, folder = built_tiny, tiny.checked_out(tmp_path / "fresh")
    if over_old_results:
        folder = tiny_build
        tiny.edit(folder, "size: 0.5", "size: 0.6")
        undisturbed = tiny.checked_out(tmp_path / "undisturbed")
        tiny.edit(undisturbed, "size: 0.5", "size: 0.6")
        tiny.build(undisturbed)
    before = rendered(folder)
    for views in (1, 2, 3, 5, 6):
        run, _ = start(folder)
        # A kill may come between a view and its line of history.
        while (rendered(folder) - before).total() < views and run.poll() is None:
            time.sleep(0.02)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
        run.wait()
    tiny.build(folder)
    assert "Nothing to be done" in tiny.build(folder)
    assert max((rendered(folder) - before).values()) == 1
    assert_same_bytes(undisturbed, folder)


def test_the_next_run_waits_for_the_jobs_of_a_killed_one(built_tiny, tmp_path):
    folder = tiny.checked_out(tmp_path / "fresh")
    run, output = start(folder)
    wait_until(lambda: bookkeeping.unfinished_shards(folder, "tiny"), run, log=output)
    # Its jobs live on.
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    tiny.build(folder)
    assert set(rendered(folder).values()) == {1}
    assert_same_bytes(built_tiny, folder)
