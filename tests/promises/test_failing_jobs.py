"""Failing programs: each fails its job, and the terminal ends with the cause."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import forks
import pytest
from checkouts import PUBLISHED_VIEWS as IMPORTED
from checkouts import ROOT, SEQUENCE, checkout, snakemake, with_consumers
from sphere import write_views

pytestmark = pytest.mark.slow
# A scene that needs more than the smoke scene does, such as a download, free places, and a video.
BROUGHT = """
scene:
  blend: scene.blend
  url: https://example.org/scene.blend
  sha256: "0000000000000000000000000000000000000000000000000000000000000000"
  targets: {board: {type: chessboard, squares: [4, 3], square: 0.04}}
render: {target_error: 0.1}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
  anywhere:
    type: random
    count: 2
    size: 1
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
  pair:
    type: plane
    cameras: [2, 1]
    head:
      left: {camera: {lens: equidistant, fov: 180, resolution: [16, 16]}}
      right: {camera: {lens: equidistant, fov: 180, resolution: [16, 16]}, position: [0.1, 0, 0]}
flow: {pairs: neighbours}
video: {path: walk, format: webp}
exports:
  instant_ngp: {sources: [views]}
  nerfstudio: {sources: [views], depth: true}
"""
MODELLED = f"scene: {{model: model.obj}}{SEQUENCE}"
# A family.
MANY = """
scene: {builder: room}
render: {samples: 4}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
family: {seeds: 0-1}
"""
TARGETS = [
    "all",
    "smoke",
    "package",
    "plan",
    "prune",
    "status",
    "error_vs_time",
    "reprojection_benchmark",
    "stability",
    "extremes",
    "render_overhead",
    "gpu_check",
    "synthesis",
    "verify",
]
CHOSEN = ["--config", "scenes=[brought,imported,modelled,many]", "rigs=all", "preset=full"]
RULES = [
    rule
    for file in sorted((ROOT / "rules").glob("*.smk"))
    for rule, body in re.findall(r"^rule (\w+):\n((?:(?: .*)?\n)+)", file.read_text() + "\n", re.M)
    # Only a storage has copies of the users' .blend files.
    if "    shell:" in body and rule != "store_blend"
]
# Stands in for every program. It writes its outputs, and then fails.
FAILING = f"""#!{sys.executable}
import json, os, sys
from pathlib import Path
for log, names in json.loads(os.environ["WORK_TO_DO"]).items():
    if os.path.exists(log) and os.path.samestat(os.stat(log), os.fstat(1)):
        for name in names:
            Path(name).write_text("done")
print("what comes before it")
sys.exit("error: the stand-in fails")
"""
WHEN = 1_700_000_000


class Failing:
    """A checkout whose programs fail. All files that jobs read or write exist."""

    def __init__(self, folder):
        self.folder = checkout(
            folder, brought=BROUGHT, imported=IMPORTED, modelled=MODELLED, many=MANY
        )
        (self.folder / "model.obj").write_text("# stands in for a model\n")
        plane = {"type": "plane", "cameras": [2, 1]}
        camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
        write_views(self.folder / "published/LFPlane", camera, plane)
        programs = [*(ROOT / "scripts").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
        for program in programs:
            stand_in = self.folder / program.relative_to(ROOT)
            stand_in.parent.mkdir(exist_ok=True)
            stand_in.write_text(FAILING)
        with_consumers(self.folder)
        # This rule runs no job's program, but runs before the first one.
        (self.folder / "scripts/check_device.py").write_text("")
        (self.folder / "bin").mkdir()
        (self.folder / "bin/tar").write_text(FAILING)
        (self.folder / "bin/tar").chmod(0o755)
        plan = self.run("--dry-run", "--forceall", "--logger", "jobs", *CHOSEN, "--", *TARGETS)
        assert plan.returncode == 0, plan.stdout
        jobs = [json.loads(line) for line in plan.stdout.splitlines() if line.startswith("{")]
        self.jobs = {job["rule"]: job for job in jobs if job["log"]}
        self.read, self.written = (
            {
                rule: {file for job in jobs if job["rule"] == rule for file in job[kind]}
                for rule in RULES
            }
            for kind in ("input", "output")
        )
        self.files = {file for job in jobs for file in (*job["input"], *job["output"])}
        self.files = {file for file in self.files if not file.startswith("configs/")}

    def run(self, *arguments, work=None):
        """Run Snakemake. ``work`` maps each job's log to what the job writes."""
        env = {
            "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
            "WORK_TO_DO": json.dumps(work or {}),
        }
        arguments = ("--cores", "1", *arguments)
        return forks.run_snakemake(arguments, self.folder, env, merge_outputs=True)

    def independent_groups(self):
        """Return the rules in groups. No job reads what another rule of its group writes."""
        groups = []
        for rule in RULES:
            for group in groups:
                if not any(
                    self.is_read(member, rule) or self.is_read(rule, member) for member in group
                ):
                    group.append(rule)
                    break
            else:
                groups.append([rule])
        return groups

    def is_read(self, written_by, read_by):
        return bool(self.written[written_by] & self.read[read_by])

    def fail(self, *rules, options=(), config=()):
        """Run the job of each rule alone. Return the terminal's output."""
        # This content and time are valid for a record, a calibration, and a checked .blend.
        content = {"files": {}, "cost_samples": 4, "bytes": 200, "mtime_ns": WHEN * 10**9}
        content |= {"external_files": [], "sources": {}, "members": {}}
        for file in self.files:
            path = self.folder / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(content).ljust(200))
            os.utime(path, (WHEN, WHEN))
        jobs = [self.jobs[rule] for rule in rules]
        targets = [job["output"][0] if job["output"] else job["rule"] for job in jobs]
        work = {job["log"][0]: job["output"] for job in jobs}
        for file in (file for outputs in work.values() for file in outputs):
            # An existing .blend would not be downloaded.
            (self.folder / file).unlink()
        run = self.run(
            # A page would update the filled-in files of its dataset, because they are damaged.
            "--allowed-rules",
            *rules,
            "--rerun-triggers",
            "mtime",
            *options,
            *CHOSEN,
            *config,
            *(["cluster_jobs=1"] if "--executor" in options else []),
            "--force",
            *targets,
            work=work,
        )
        assert run.returncode != 0, run.stdout
        return run.stdout


def on_a_cluster(submit="bash submit.sh"):
    """Return options that submit jobs to a stand-in for a cluster."""
    return [
        "--executor",
        "cluster-generic",
        "--jobs",
        "1",
        "--cluster-generic-status-cmd",
        "echo",
        "--cluster-generic-submit-cmd",
        submit,
        "--seconds-between-status-checks",
        "1",
    ]


@pytest.fixture(scope="session")
def failing(tmp_path_factory):
    return Failing(tmp_path_factory.mktemp("failing"))


def last_words(failing, *rules):
    return "".join(
        f"{rule} failed: error: the stand-in fails\n  log: {failing.jobs[rule]['log'][0]}\n"
        for rule in rules
    )


@pytest.fixture(scope="module")
def failed(failing):
    """For each rule: the terminal's output after its failure, and its remaining files."""
    failures = {}
    for rules in failing.independent_groups():
        terminal = failing.fail(*rules, options=["--keep-going"])
        for rule in rules:
            outputs = (failing.folder / file for file in failing.jobs[rule]["output"])
            failures[rule] = terminal, [path for path in outputs if path.exists()]
    return failures


@pytest.mark.parametrize("rule", RULES)
def test_a_program_that_fails_after_its_work_fails_its_job(failing, failed, rule):
    terminal, left = failed[rule]
    assert "MissingOutputException" not in terminal
    assert last_words(failing, rule) in terminal
    assert (failing.folder / failing.jobs[rule]["log"][0]).is_file()
    assert not left


def test_every_job_that_failed_is_named_at_the_end(failing):
    terminal = failing.fail("stability", "extremes")
    assert terminal.endswith(last_words(failing, "extremes", "stability")), terminal


# The second job of this group waits for the first, so it did not fail.
@pytest.mark.parametrize("groups", [[], ["--groups", "render=shard", "reproject=shard"]])
def test_a_job_that_fails_on_a_cluster_is_named_at_the_end(failing, groups):
    submit = failing.folder / "submit.sh"
    submit.write_text('bash "$1" > node.log 2>&1 && echo success || echo failed\n')
    options = [*on_a_cluster(), *groups]
    terminal = failing.fail("render", options=options)
    assert terminal.endswith(last_words(failing, "render")), terminal


@pytest.mark.parametrize(
    ("groups", "name"), [([], "render"), (["--groups", "render=shard"], "shard_render")]
)
def test_the_batch_systems_log_is_named_for_a_job_that_never_began(failing, groups, name):
    submit = failing.folder / "submit.sh"
    said = "slurmstepd: error: execve(): python: No such file or directory"
    # The job's number is what it prints, and the stand-in's status of the job, too.
    submit.write_text(f"echo '{said}' > .snakemake/$1-failed.log; echo failed\n")
    other = failing.folder / f".snakemake/{name}-17.log"
    other.write_text("slurmstepd: error: another job's\n")
    earlier = failing.folder / failing.jobs["render"]["log"][0]
    earlier.parent.mkdir(parents=True, exist_ok=True)
    earlier.write_text("error: of an earlier run\n")
    os.utime(earlier, (WHEN, WHEN))
    options = [*on_a_cluster("bash submit.sh {name}"), *groups]
    terminal = failing.fail("render", options=options)
    log = Path(f".snakemake/{name}-failed.log")
    assert terminal.endswith(f"render failed: {said}\n  log: {log}\n"), terminal
    # The next run must not take it for its own.
    (failing.folder / log).unlink()


REFUSAL = "sbatch: error: Batch job submission failed: Invalid partition name specified"
UNKNOWN = "The given account nobody's appears to be invalid. Available accounts: mine"


# As sbatch says it with --test-only.
OF_GROUP = "allocation failure: Invalid partition name specified"


@pytest.mark.parametrize(
    ("account", "groups", "said"),
    [
        ("mine", [], f"SLURM sbatch failed. The error message was '{REFUSAL}'."),
        (
            "mine",
            ["--groups", "render=shard", "reproject=shard"],
            f"render failed: sbatch refused it: {OF_GROUP}",
        ),
        ("nobody's", [], UNKNOWN),
    ],
)
def test_the_end_says_why_slurm_refuses_a_job(
    failing, tmp_path, monkeypatch, account, groups, said
):
    commands = dict.fromkeys(["sinfo", "scontrol", "squeue", "sacct"], "")
    commands |= {
        "sbatch": f"[ $1 = --test-only ] && echo '{OF_GROUP}' >&2 || echo '{REFUSAL}' >&2; exit 1",
        "sacctmgr": "echo mine",
    }
    other = failing.folder / ".snakemake/slurm_logs/rule_render/17.log"
    other.parent.mkdir(parents=True, exist_ok=True)
    other.write_text("slurmstepd: error: another job's\n")
    for name, script in commands.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    resources = ("--default-resources", f"slurm_account={account!r}")
    terminal = failing.fail(
        "render",
        options=[
            "--executor",
            "slurm",
            "--jobs=1",
            *resources,
            *groups,
            "--slurm-init-seconds-before-status-checks",
            "1",
        ],
    )
    # The plugin for Python 3.11 checks the account before a job exists. It then ends the run
    # itself, and breaks the line.
    ends_before_jobs = account != "mine" and sys.version_info < (3, 13)
    lines = terminal.splitlines()
    assert said in " ".join(lines), terminal
    assert ends_before_jobs or lines[-1].startswith("render failed: "), terminal
    assert "17.log" not in terminal


def test_a_run_without_slurm_ends_before_its_first_job(failing, tmp_path, monkeypatch):
    problem = "sinfo: fatal: Could not establish a configuration source"
    (tmp_path / "sinfo").write_text(f"#!/bin/sh\necho '{problem}' >&2; exit 1\n")
    (tmp_path / "sinfo").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    terminal = failing.fail("render", options=["--executor", "slurm", "--jobs=1"])
    *_, last = terminal.splitlines()
    assert last == f"error: --executor slurm: no Slurm answers: {problem}: run this on a login node"
    assert "Traceback" not in terminal and "failed" not in terminal


@pytest.mark.parametrize(
    ("signal", "advice"),
    [("KILL", "memory ran out: lower --cores"), ("BUS", "free some space in /dev/shm and TMPDIR")],
)
def test_a_signal_is_named_with_what_to_lower(failing, signal, advice):
    program = failing.folder / "scripts/render_shard.py"
    program.write_text(f"import os, signal; os.kill(os.getpid(), signal.SIG{signal})")
    try:
        *_, why, log = failing.fail("render").splitlines()
    finally:
        program.write_text(FAILING)
    assert why.startswith(f"render failed: error: killed by SIG{signal}: most likely")
    assert advice in why
    assert log.startswith("  log: work/logs/")


def test_a_signal_to_a_job_and_its_shell_is_named(failing, monkeypatch):
    """`timeout`, a CI and a batch system send a signal to each process of a run."""

    def run_in_processes(arguments, folder, env, merge_outputs):
        return subprocess.run(
            [Path(sys.executable).with_name("snakemake"), *arguments],
            cwd=folder,
            env=os.environ | env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT if merge_outputs else subprocess.PIPE,
            text=True,
            check=False,
        )

    # The shell is no parent of a fork.
    monkeypatch.setattr(forks, "run_snakemake", run_in_processes)
    program = failing.folder / "scripts/render_shard.py"
    program.write_text(
        "import os, signal\n"
        "for process in (os.getppid(), os.getpid()): os.kill(process, signal.SIGTERM)\n"
    )
    try:
        *_, why, _ = failing.fail("render").splitlines()
    finally:
        program.write_text(FAILING)
    assert why.startswith("render failed: error: killed by SIGTERM: it was cancelled")


def test_a_job_whose_log_does_not_fit_on_the_disk_is_explained(failing, small_disk):
    disk, mounted = small_disk
    logs = failing.folder / "work/logs"
    shutil.rmtree(logs, ignore_errors=True)
    logs.symlink_to(disk)
    program = failing.folder / "scripts/render_shard.py"
    # The job fills the disk, so it cannot say why it fails.
    program.write_text(f"""
import errno, sys
with open({str(disk / "filler")!r}, "wb", buffering=0) as file:
    size = 2**16
    while size and {mounted}:
        try:
            file.write(bytes(size))
        except OSError:
            size //= 2
sys.exit({"'error: no log has it'" if mounted else "1"})
""")
    try:
        *_, why, _ = failing.fail("render").splitlines()
    finally:
        program.write_text(FAILING)
        logs.unlink()
    assert why.startswith("render failed: ")
    assert why.endswith("is full: free some space" if mounted else "it said nothing"), why


@pytest.mark.parametrize(
    ("rule", "config", "said"),
    [
        ("render", ["device=metal"], "error: device: this machine has no metal device"),
        ("check_gpu", [], "error: device: this machine has no GPU that Cycles can use"),
    ],
)
def test_a_missing_device_is_reported_before_the_first_job(
    failing, monkeypatch, rule, config, said
):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "-1")
    monkeypatch.setenv("HIP_VISIBLE_DEVICES", "-1")
    program = failing.folder / "scripts/check_device.py"
    shutil.copy(ROOT / "scripts/check_device.py", program)
    try:
        terminal = failing.fail(rule, config=config)
    finally:
        program.write_text("")
    assert terminal.splitlines()[-1].startswith(said)
    assert "views" not in terminal


def test_a_device_of_the_nodes_may_be_missing_on_the_submitting_machine(failing):
    program = failing.folder / "scripts/check_device.py"
    shutil.copy(ROOT / "scripts/check_device.py", program)
    submit = failing.folder / "submit.sh"
    submit.write_text('bash "$1" > node.log 2>&1 && echo success || echo failed\n')
    options = on_a_cluster()
    try:
        terminal = failing.fail("render", options=options, config=["device=metal"])
    finally:
        program.write_text("")
    assert terminal.endswith(last_words(failing, "render")), terminal


FROM_ANOTHER_TIME_ZONE = """
scene: {model: shape.obj}
render: {samples: 1}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
"""


def test_a_model_with_a_time_in_the_future_is_named_before_the_first_job(tmp_path):
    folder = checkout(tmp_path, shape=FROM_ANOTHER_TIME_ZONE)
    model = folder / "shape.obj"
    model.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    arguments = ("--config", "scenes=[shape]", "preset=full", "--", "work/shape/model.blend")
    for hours, is_refused in ((5, True), (0, False)):
        moment = time.time() + hours * 3600
        os.utime(model, (moment, moment))
        plan = snakemake(folder, "--dry-run", *arguments)
        assert plan.returncode == is_refused, plan.stderr
        said = "would be refused: shape.obj: its time is in the future"
        assert (said in plan.stderr) == is_refused
    os.utime(model, (time.time() + 5 * 3600,) * 2)
    run = snakemake(folder, "--cores", "1", *arguments)
    assert run.returncode == 1
    assert "error: shape.obj: its time is in the future" in run.stderr
    assert "touch shape.obj" in run.stderr
    assert not (folder / "work/shape/model.blend").exists()
