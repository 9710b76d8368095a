"""A run that waits for jobs that Slurm does not have: it ends, and says so."""

import pytest

from lightfield.planning.forecast import Request
from lightfield.workflow import slurm
from lightfield.workflow.slurm import PATIENCE, Watch


@pytest.fixture
def commands(tmp_path, monkeypatch):
    """Return a function that gives one of Slurm's commands a script."""
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")

    def give(name, script):
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)

    return give


class Run:
    """A run on Slurm, whose watch looks when a test lets time pass."""

    def __init__(self):
        self.jobs, self.lines, self.ends, self.now = frozenset({1, 2}), [], [], 1000.0
        self.watch = Watch("id", lambda: self.jobs, self.lines.append, self.ends.append)

    def wait(self, seconds):
        for _ in range(int(seconds // 30)):
            self.now += 30
            if self.watch.look(self.now):
                return


def test_a_run_whose_jobs_slurm_does_not_have_ends_within_minutes(commands):
    commands("squeue", '[ "$*" = "--noheader --format=%i --name=id" ] || echo 17')
    run = Run()
    run.wait(PATIENCE - 60)
    assert not run.ends
    run.wait(120)
    (why,) = run.ends
    assert why.startswith("error: Slurm has had no job of this run for 6 min 00 s, but Snakemake")
    assert "waits for 2: " in why and why.endswith("the same command goes on")


def test_a_run_goes_on_while_slurm_has_a_job_of_it_or_others_end(commands):
    commands("squeue", "echo 17")
    run = Run()
    run.wait(10 * PATIENCE)
    commands("squeue", "true")
    # One job after the other ends, so Snakemake knows of them.
    for number in range(10):
        run.jobs = frozenset({number})
        run.wait(PATIENCE - 60)
    run.jobs = frozenset()
    run.wait(10 * PATIENCE)
    assert run.ends == run.lines == []


def test_a_slurm_that_does_not_answer_ends_no_run(commands):
    commands("squeue", "echo 'slurm_load_jobs error: Unable to contact' >&2; exit 1")
    run = Run()
    run.wait(10 * PATIENCE)
    assert run.lines == [
        "warning: Slurm does not answer: slurm_load_jobs error: Unable to contact; its jobs go on "
        "meanwhile"
    ]
    commands("squeue", "true")
    run.wait(PATIENCE - 30)
    assert run.lines[1:] == ["note: Slurm answers again"]
    assert not run.ends
    run.wait(90)
    assert len(run.ends) == 1


def test_sbatch_says_why_it_refuses_a_group(commands, tmp_path):
    commands("sbatch", f'echo "$@" > {tmp_path}/asked; echo "allocation failure: why" >&2; exit 1')
    common = {"slurm_partition": "long", "slurm_extra": "'--exclude=node7'", "gpu": 1}
    requests = [
        Request("render", 16, common | {"mem_mb": 8000, "runtime": 90}),
        Request("reproject", 1, common | {"mem_mb": 2000, "runtime": 30}),
    ]
    assert slurm.refusal(requests) == "sbatch refused it: allocation failure: why"
    asked = (tmp_path / "asked").read_text().split()
    assert asked[0] == "--test-only"
    assert {
        "--cpus-per-task=16",
        "--time=120",
        "--mem=8000M",
        "--gpus=1",
        "--partition=long",
        "--exclude=node7",
    } <= {*asked}
    commands("sbatch", "true")
    assert slurm.refusal(requests) is None
