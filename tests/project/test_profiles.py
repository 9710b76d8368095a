"""The cluster profiles: the resources that each job requests, planned by Snakemake itself."""

import json
import os
import subprocess
from functools import cache
from pathlib import Path

import forks
import pytest
import yaml
from checkouts import ROOT, snakemake

STATUS = ROOT / "profiles/cluster-generic/status.sh"
PROFILES = ["slurm", "cluster-generic"]
# The rules whose jobs go to the cluster. All others take seconds.
SUBMITTED = {
    "build_scene",
    "check_cameras",
    "render",
    "render_panorama",
    "reproject",
    "validate",
    "pack",
}


@cache
def settings(profile):
    return yaml.safe_load((ROOT / "profiles" / profile / "config.yaml").read_text())


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Return a function that plans the smoke build, by profile and device. It returns the jobs."""

    @cache
    def plan(profile, device, *options):
        folder = tmp_path_factory.mktemp("planned")
        results = folder / "results"
        arguments = [
            "--dry-run",
            "--logger",
            "jobs",
            "--profile",
            f"profiles/{profile}",
            *options,
            "--config",
            f"results={results}",
            f"work={folder / 'work'}",
            f"device={device}",
            "--",
            "smoke",
            f"{results}/smoke/smoke_LFCuboid_1x1x1.tar",
        ]
        # Snakemake finds the logger plugin here.
        run = forks.run_snakemake(arguments, ROOT, {"PYTHONPATH": str(Path(__file__).parents[1])})
        assert run.returncode == 0, run.stderr
        return [json.loads(line) for line in run.stderr.splitlines() if line.startswith("{")]

    return plan


@pytest.mark.parametrize("profile", PROFILES)
def test_every_job_declares_its_resources(planned, profile):
    jobs = planned(profile, "cpu")
    assert {job["rule"] for job in jobs} >= SUBMITTED
    for job in jobs:
        assert 1 <= job["cpus"] <= settings(profile)["cores"], job
        assert job["mem_mb"] >= 1000, job
        assert job["runtime"] >= 10, job
        assert job["gpu"] == 0, job


def test_renders_take_every_cpu_of_a_job(planned):
    for job in planned("slurm", "cpu"):
        if job["rule"] in ("render", "render_panorama"):
            assert job["cpus"] == settings("slurm")["cores"]


def test_a_users_arguments_for_slurm_reach_every_job(planned):
    options = ("--default-resources", "mem_mb=2000", "runtime=30", "slurm_extra='--qos=long'")
    jobs = planned("slurm", "cpu", *options)
    assert {job["rule"] for job in jobs} >= SUBMITTED
    assert {job["slurm_extra"] for job in jobs} == {"--qos=long"}


def test_only_renders_request_a_gpu_and_only_for_a_gpu_device(planned):
    gpus = {(job["rule"], job["gpu"]) for job in planned("slurm", "optix")}
    assert {rule for rule, count in gpus if count} == {"render", "render_panorama"}
    assert max(count for _, count in gpus) == 1


@pytest.mark.parametrize("profile", PROFILES)
def test_a_profile_names_rules_that_exist(planned, profile):
    rules = {job["rule"] for job in planned("slurm", "cpu")}
    assert {*settings(profile)["groups"], *settings(profile)["set-threads"]} <= rules


def test_the_profiles_differ_only_in_their_executor():
    slurm, generic = (settings(profile) for profile in PROFILES)
    shared = slurm.keys() & generic.keys() - {"executor"}
    assert {"jobs", "cores", "retries", "default-resources", "groups"} <= shared
    assert {key: slurm[key] for key in shared} == {key: generic[key] for key in shared}


@pytest.mark.parametrize("profile", [*PROFILES, "kubernetes"])
def test_the_build_knows_how_many_jobs_run_at_once_and_where_the_storage_is(profile):
    keys = yaml.safe_load(
        (ROOT / "profiles" / profile / settings(profile)["configfile"]).read_text()
    )
    assert keys["cluster_jobs"] == settings(profile)["jobs"]
    assert keys.get("storage") == settings(profile).get("default-storage-prefix")


def test_kubernetes_pods_share_a_volume_and_request_a_gpu_on_demand():
    kubernetes, slurm = settings("kubernetes"), settings("slurm")
    shared = {key for key in kubernetes.keys() & slurm.keys() if "default" not in key}
    assert {key: kubernetes[key] for key in shared - {"executor"}} == {
        key: slurm[key] for key in shared - {"executor"}
    }
    _, mounted = kubernetes["kubernetes-persistent-volumes"].split(":")
    assert kubernetes["default-storage-prefix"] == mounted
    # The executor requests the given number, and no node offers 0 of an unknown resource.
    assert kubernetes["default-resources"].keys() == slurm["default-resources"].keys() - {"gpu"}


def test_the_submit_command_requests_all_four_resources():
    command = settings("cluster-generic")["cluster-generic-submit-cmd"]
    for part in ("{threads}", "{resources.mem_mb}M", "{resources.runtime}", "{resources.gpu}"):
        assert part in command


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "keys", "expected"),
    [
        (
            ["--default-storage-provider", "fs", "--default-storage-prefix", "STORE"],
            [],
            "add --config",
        ),
        ([], ["storage=STORE"], "add --default-storage-provider"),
    ],
)
def test_a_storage_is_refused_unless_snakemake_and_the_configuration_have_it(
    tmp_path, options, keys, expected
):
    def filled(words):
        return [word.replace("STORE", str(tmp_path / "store")) for word in words]

    config = ["--config", *filled(keys), "preset=tiny"]
    run = snakemake(ROOT, "-n", "--directory", tmp_path, *filled(options), *config, "--", "smoke")
    assert run.returncode == 1
    assert "Traceback" not in run.stderr
    last = (run.stdout + run.stderr).splitlines()[-1]
    assert last.startswith("error: storage: ") and expected in last


@pytest.mark.parametrize(
    ("squeue", "answer"),
    [
        ("echo COMPLETED", "success"),
        ("echo PENDING", "running"),
        ("echo RUNNING", "running"),
        ("echo COMPLETING", "running"),
        ("echo CANCELLED", "failed"),
        ("echo NODE_FAIL", "failed"),
        ("echo OUT_OF_MEMORY", "failed"),
        ("echo TIMEOUT", "failed"),
        ("echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1", "failed"),
        ("echo 'slurm_load_jobs error: Unable to contact slurm controller' >&2; exit 1", "running"),
    ],
)
def test_status_of_a_slurm_job(tmp_path, squeue, answer):
    program = tmp_path / "squeue"
    program.write_text(f"#!/bin/sh\n{squeue}\n")
    program.chmod(0o755)
    run = subprocess.run(
        [STATUS, "17"],
        env={"PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout == f"{answer}\n"
