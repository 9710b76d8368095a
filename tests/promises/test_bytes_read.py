"""What a job reads is what its plan or its maker said. Else the job fails, or its result is right.

Each rule's program runs once more by hand, with a byte of what it reads changed after the plan, or
while it works. The file keeps its size and its time.
"""

import os
import shutil
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

import bookkeeping
import forks
import pytest
from bookkeeping import CUBOID, PLANE
from checkouts import assert_same_bytes, checkout, jobs_on, snakemake
from faults import flip

pytestmark = pytest.mark.slow

PUBLISHED = "results/smoke/smoke_LFPlane_3x2_equisolid"
# Targets that no other target of the smoke build needs.
ALSO = [f"{PUBLISHED}.tar"]
CHANGING = Path(__file__).parents[1] / "blender/changed_in_job.py"
# These jobs add up times, which are never the same.
TIMED = {"costs", "page", "index"}


@pytest.fixture(scope="module")
def folder(smoke, tmp_path_factory):
    """A copy of the smoke build with a package."""
    folder = checkout(tmp_path_factory.mktemp("read") / "plenoforge")
    for name in ("results", "work"):
        shutil.copytree(smoke / name, folder / name)
    result = snakemake(folder, "--cores", "2", "smoke", *ALSO)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder


@pytest.fixture(scope="module")
def jobs(folder):
    """The first job of each rule that has a receipt, by the name of the rule."""
    plan = snakemake(
        folder, "--dry-run", "--forceall", "--logger", "jobs", "--", "smoke", *ALSO
    ).stderr
    first = {}
    for job in jobs_on(plan):
        if bookkeeping.note_of(job) and job["command"]:
            first.setdefault(job["rule"], job)
    assert {"render", "reproject", "export", "validate", "checksums", "pack"} <= first.keys()
    return first


def files_read(folder, job):
    """Return a view that stands for the job's receipts of views, and each other file it reads."""
    noted = bookkeeping.noted(folder)
    inputs = noted[bookkeeping.note_of(job)].inputs
    views = [path for name in inputs if bookkeeping.is_note(name) for path in noted[name].files]
    files = [name for name in inputs if not bookkeeping.is_note(name)]
    # The last view shows whether the program compares all of them.
    return [path for path in [*views[-1:], *files] if (folder / path).is_file()]


@contextmanager
def kept(folder, path):
    """Put a file back with its time."""
    path = folder / path
    status, content = path.stat(), path.read_bytes()
    try:
        yield
    finally:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def flip_in_secret(path):
    """Change a byte of a file, and keep its size and its time."""
    status = path.stat()
    flip(path, None)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def run(folder, job, python):
    """Run the command of a job whose receipt is gone. Return its status and its log."""
    bookkeeping.forget(folder, bookkeeping.note_of(job))
    path = f"{python.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    command = ["bash", "-c", job["command"]]
    result = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, check=False)
    return result.returncode, (folder / job["log"][0]).read_text()


def outcomes(folder, jobs, python_of):
    """Return a line for each changed file that a rule's job neither refuses nor does without."""
    wrong = []
    for rule, job in jobs.items():
        for name in files_read(folder, job):
            before = bookkeeping.noted(folder)[bookkeeping.note_of(job)]
            with ExitStack() as stack:
                # A validation removes the list of a dataset's sums.
                lists = (
                    path.relative_to(folder) for path in folder.glob("results/*/*/sha256sums.txt")
                )
                for path in {bookkeeping.note_of(job), name, *before.files, *map(str, lists)}:
                    stack.enter_context(kept(folder, path))
                status, log = run(folder, job, python_of(folder / name))
                refused = f"{name}: is not as its job made it" in log or (
                    f"{name}: has changed" in log
                )
                if status:
                    is_right = refused and bookkeeping.note_of(job) not in bookkeeping.noted(folder)
                else:
                    after = bookkeeping.noted(folder)[bookkeeping.note_of(job)]
                    is_right = rule in TIMED or after.files == before.files
            if not is_right:
                last_line = log.strip().splitlines()[-1:]
                wrong.append(f"{rule}: {name}: status {status}: {last_line}")
    return "\n".join(wrong)


def test_a_byte_changed_after_the_plan_is_refused_or_not_read(folder, jobs):
    def python_of(path):
        flip_in_secret(path)
        return forks.python()

    assert outcomes(folder, jobs, python_of) == ""


@pytest.mark.parametrize("undone", ["never", "after"])
def test_a_byte_changed_while_a_job_works_is_refused_or_not_read(folder, jobs, undone, tmp_path):
    def python_of(path):
        program = tmp_path / "python"
        program.write_text(f'#!/bin/sh\nexec {sys.executable} {CHANGING} {path} {undone} "$@"\n')
        program.chmod(0o755)
        return program

    assert outcomes(folder, jobs, python_of) == ""


def test_the_next_run_mends_a_view_that_an_export_refused(folder, smoke):
    """Neither an export nor a package of a damaged view stays."""
    view = f"results/{CUBOID}/perspective_hdr/view_f0000f.exr"
    bookkeeping.forget(folder, f"results/{CUBOID}/perspective_hdr/exports/colmap/export.json")
    flip_in_secret(folder / view)
    result = snakemake(folder, "--cores", "2", "smoke", *ALSO)
    assert result.returncode == 1
    assert f"{view}: is not as its job made it" in result.stderr
    result = snakemake(folder, "--cores", "2", "smoke", *ALSO)
    assert result.returncode == 0, result.stdout + result.stderr
    assert_same_bytes(smoke, folder, CUBOID)


def test_a_receipt_in_the_place_of_another_counts_as_missing(folder, smoke):
    """Nothing says of a dataset what a job has noted about another."""
    receipt, other = bookkeeping.KINDS["receipt of a file"]
    (folder / receipt).write_bytes((folder / other).read_bytes())
    plan = snakemake(folder, "--dry-run", "--logger", "jobs", "--", "smoke").stderr
    assert receipt in {path for job in jobs_on(plan) for path in job["output"]}
    result = snakemake(folder, "--cores", "2", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    assert_same_bytes(smoke, folder, PLANE)
