"""The records of jobs say the same as the rules: which jobs a build has, and their commands."""

import contextlib
import re
import shlex
from pathlib import Path

import pytest
import yaml
from checkouts import SEQUENCE, checkout, jobs_on, snakemake

from lightfield.configuration.config_file import load_config
from lightfield.engine.flags import parsed
from lightfield.workflow.build import Build
from lightfield.workflow.jobs import JOBS, jobs_of

CAMERA = "{lens: equidistant, fov: 180, resolution: [16, 16]}"
SCENES = {
    "built": f"""
scene: {{builder: room}}
render: {{samples: 4, light_groups: each}}
report: {{panorama: false}}
rigs:
  LFTest: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}, split: test}}
  LFTrain: {{type: plane, cameras: [3, 2], size: 1, camera: {CAMERA}, split: train}}
  LFRandom: {{type: random, count: 2, size: 1, camera: {CAMERA}, split: odd}}
  LFHead: {{type: lattice, cameras: [2, 1, 1], head: {{left: {{camera: {CAMERA}}}}}}}
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 60, resolution: [8, 8]}}
    format: png
  cubes:
    camera: {{lens: rectilinear, fov: 90, resolution: [8, 8]}}
    cube_map: true
    rigs: [LFTrain, LFTest]
exports:
  instant_ngp: {{sources: [perspective, views], rigs: [LFTrain, LFTest]}}
  colmap: {{sources: [perspective]}}
  poses_csv: {{sources: [views, perspective]}}
""",
    "brought": f"""
scene:
  blend: scene.blend
  url: https://example.org/scene.blend
  sha256: "{0:064}"
  targets: {{board: {{type: chessboard, squares: [4, 3], square: 0.04}}}}
render: {{target_error: 0.1}}
report: {{panorama: false}}
rigs:
  anywhere: {{type: random, count: 2, size: 1, camera: {CAMERA}}}
""",
    "modelled": f"""
scene: {{model: model.obj}}
render: {{samples: 4}}
report: {{panorama: false}}
rigs:
  LFPlane: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}}}
""",
    "moved": f"scene: {{builder: still_life}}\nreport: {{panorama: false}}{SEQUENCE}",
}
CHOICE = {"scenes": [*SCENES], "rigs": "all", "preset": "full", "views_per_shard": 2}
# These options depend on the machine.
OF_MACHINE = {"device", "threads", "processes", "stall"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = checkout(tmp_path_factory.mktemp("jobs") / "plenoforge", **SCENES)
    (folder / "model.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    return folder


def command_by_job(folder):
    """Return the program and the flags of each job that a run would start, by the job's name."""
    choice = [f"{key}={value}".replace(" ", "") for key, value in CHOICE.items()]
    plan = snakemake(folder, "--dry-run", "--logger", "jobs", "--config", *choice)
    assert plan.returncode == 0, plan.stdout + plan.stderr
    commands = {}
    for job in jobs_on(plan.stderr):
        for path in job["output"]:
            if found := re.fullmatch(r"work/receipts/(.+)\.jsonl", path):
                _, program, *words = shlex.split(job["command"])
                commands[found[1]] = (Path(program).stem, words[: words.index(">")])
    return commands


def has_record_with_fields(name):
    """Return whether a member of a family may have a job of this name."""
    names = [job.name for job in JOBS if job.fields]
    return any(re.fullmatch(re.sub(r"\{\w+\}", ".*", each), name) for each in names)


def values_of(stage):
    """Return the fields of a stage that do not depend on the machine, and the settings."""
    return stage.model_dump(exclude={"settings", "receipt", *OF_MACHINE}), {
        key: value
        for key, value in stage.settings.as_json().items()
        # Rules fill these in.
        if key != "inputs"
    }


@pytest.mark.slow
def test_a_build_has_the_jobs_of_its_records_with_the_same_files_and_settings(folder):
    commands = command_by_job(folder)
    with contextlib.chdir(folder):
        content = yaml.safe_load(Path("config.yaml").read_text()) | CHOICE
        build = Build.load(load_config(content))
        jobs = {
            job.name.format(**names): (job, names, fields) for job, names, fields in jobs_of(build)
        }
        assert {name for name in commands if has_record_with_fields(name)} == jobs.keys()
        assert {job for job, _, _ in jobs.values()} == {job for job in JOBS if job.fields}
        for name, (job, names, fields) in jobs.items():
            program, words = commands[name]
            assert program == job.stage.name
            by_rule = parsed(job.stage, None, words)
            assert values_of(by_rule) == values_of(job.stage_of(build, names, fields)), name
