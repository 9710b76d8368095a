"""Every rule runs again when anything changes that its jobs were made from.

Stand-ins do the work of all programs, so a build of every rule takes seconds.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from checkouts import checkout
from sphere import write_views
from test_failures import RULES

from lightfield.dataset import ledger

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]
CAMERA = "{lens: equidistant, fov: 180, resolution: [16, 16]}"
BUILT = f"""
description: Two cameras in a room
scene:
  builder: room
  frame: 1
render: {{samples: 4}}
report: {{panorama: true}}
rigs:
  LFLine:
    type: plane
    cameras: [2, 1]
    size: 1
    center: [0, 0, 1]
    camera: {CAMERA}
    split: odd
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 60, resolution: [8, 8]}}
    format: png
    exposure: -1
exports:
  instant_ngp: {{sources: [perspective]}}
  nerfstudio: {{sources: [perspective], points: 9}}
"""
# What no built scene needs: a download, a calibration, free places, and flow.
BROUGHT = f"""
licence: CC0-1.0
scene:
  blend: scene.blend
  url: https://example.org/scene.blend
  sha256: "{0:064}"
  allow_missing: true
  view_layers: [One]
  scene_name: First
render: {{target_error: 0.1}}
rigs:
  anywhere:
    type: random
    count: 2
    size: 1
    camera: {CAMERA}
flow: {{pairs: neighbours}}
exports:
  instant_ngp: {{sources: [views]}}
  nerfstudio: {{sources: [views], depth: true}}
"""
IMPORTED = "scene: {dataset: published}\n"
# These have outputs; the other targets are asked for to be read, and always run.
TARGETS = [
    *("all", "package", "error_vs_time", "reprojection_benchmark", "stability", "extremes"),
    *("render_overhead", "gpu_check", "synthesis", "learn"),
    *(f"results/benchmarks/advise/{name}.json" for name in ("built", "brought")),
    *("work/built/LFLine/probe.json", "work/brought/anywhere/probe.json"),
]
READ = {"rig_tables", "plan", "status", "advise", "verify"}
CHOSEN = ["--config", "scenes=[built,brought,imported]", "rigs=all", "preset=full"]
# In place of every program: it writes what its job is known by, with everything that rules read.
STAND_IN = f"""#!{sys.executable}
import json, os
from pathlib import Path
content = {{"frames": [], "external_files": [], "cost_samples": 4}}
listing = {{"files": {{}}}}
for log, names in json.loads(Path("work_to_do.json").read_text()).items():
    if os.path.exists(log) and os.path.samestat(os.stat(log), os.fstat(2)):
        for name in names:
            is_list = Path(name).name == "export.json" or "-" in Path(name).stem
            more = listing if is_list else {{}}
            Path(name).write_text(json.dumps(content | {{"name": name}} | more))
"""


class Build:
    """A checkout in which stand-ins have built everything, and Snakemake's own notes are lost."""

    def __init__(self, folder):
        scenes = {"built": BUILT, "brought": BROUGHT, "imported": IMPORTED}
        self.folder = checkout(folder, **scenes)
        camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
        rig = {"type": "plane", "cameras": [2, 1]}
        write_views(folder / "published/LFPlane", camera, rig)
        for program in [*ROOT.glob("scripts/*.py"), *ROOT.glob("benchmarks/*.py")]:
            stand_in = folder / program.relative_to(ROOT)
            stand_in.parent.mkdir(exist_ok=True)
            stand_in.write_text(STAND_IN)
        (folder / "scripts/check_device.py").write_text("")
        self.jobs = self.plan("--forceall")
        (folder / "work_to_do.json").write_text(
            json.dumps({job["log"][0]: job["output"] for job in self.jobs if job["log"]})
        )
        # A page shows the measurements that there were when it was made.
        for _ in range(2):
            result = self.run("--cores", "4")
            assert result.returncode == 0, result.stdout + result.stderr
        shutil.rmtree(folder / ".snakemake")

    def run(self, *words):
        return subprocess.run(
            [sys.executable, "-m", "snakemake", *words, *CHOSEN, "--", *TARGETS],
            cwd=self.folder,
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        )

    def plan(self, *words):
        """Return the jobs that a run would run."""
        result = self.run("--cores", "4", "--dry-run", *words, "--logger", "jobs")
        assert result.returncode == 0, result.stdout + result.stderr
        lines = (line for line in result.stderr.splitlines() if line.startswith("{"))
        return [job for job in map(json.loads, lines) if job["output"]]

    def settings(self):
        """Return the settings of every job, by file and key."""
        return {
            (str(path.relative_to(self.folder / "work")), key): value
            for path in (self.folder / "work").rglob("settings/**/*.json")
            for key, value in json.loads(path.read_text()).items()
        }


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    return Build(tmp_path_factory.mktemp("every_rule") / "plenoforge")


def test_all_rules_have_jobs_in_the_build_and_none_runs_twice(build):
    with_outputs = set(RULES) - READ
    assert {job["rule"] for job in build.jobs} >= with_outputs
    assert not build.plan()


def levels(jobs):
    """Return the jobs in groups, none of which follows from another of its group."""
    maker = {file: number for number, job in enumerate(jobs) for file in job["output"]}
    depths = {}

    def depth(number):
        if number not in depths:
            makers = {maker[file] for file in jobs[number]["input"] if file in maker}
            depths[number] = 1 + max(map(depth, makers), default=0)
        return depths[number]

    groups = {}
    for number, job in enumerate(jobs):
        groups.setdefault(depth(number), []).append(job)
    return groups.values()


def falsified(line, names):
    """Return a line of the ledger in which inputs of these names have other bytes and times."""
    content = json.loads(line.partition(" ")[2])
    content["inputs"] |= {name: ["0" * 64, 0, 0, 0] for name in names}
    text = json.dumps(content)
    return f"{hashlib.sha256(text.encode()).hexdigest()} {text}"


def test_each_job_runs_again_that_was_made_from_something_else(build):
    """Times say nothing: all else is as if two builds had run beside each other."""
    path = build.folder / "work/ledger.txt"
    text = path.read_text()
    lines = {}
    for line in text.splitlines():
        for name in json.loads(line.partition(" ")[2])["outputs"]:
            lines[name] = line
    try:
        for jobs in levels(build.jobs):
            changed = {}
            for job in jobs:
                line = lines[job["output"][0]]
                inputs = json.loads(line.partition(" ")[2])["inputs"]
                # Nothing follows from the content of these inputs, or the job has none.
                if inputs:
                    changed[line] = falsified(line, inputs)
            path.write_text("".join(f"{changed.get(s, s)}\n" for s in text.splitlines()))
            reasons = {job["output"][0]: job["reason"] for job in build.plan()}
            for job in jobs:
                if lines[job["output"][0]] in changed:
                    assert "Forced" in reasons.get(job["output"][0], ""), job["output"]
    finally:
        path.write_text(text)


def test_each_input_of_each_job_is_noticed_if_it_is_another_file(build, monkeypatch, tmp_path):
    monkeypatch.chdir(build.folder)
    inputs = 0
    for line in Path("work/ledger.txt").read_text().splitlines():
        content = json.loads(line.partition(" ")[2])
        for name in content["inputs"]:
            (tmp_path / "ledger.txt").write_text(falsified(line, [name]) + "\n")
            found = ledger.Ledger(tmp_path / "ledger.txt")
            assert [found.changed_input(output) for output in content["outputs"]] == [
                name for _ in content["outputs"]
            ]
            inputs += 1
    assert inputs > 200


VIEWS = {"lightfield", "check_cameras", "render", "validate", "page"}
YAMLS = {name: f"configs/scenes/{name}.yaml" for name in ("built", "brought", "imported")}
OTHER = f"  LFOther: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}"
# In each round one change of each scene YAML and of config.yaml: its old and new text, and the
# rules of that scene, or of all, that must run again.
ROUNDS = [
    {
        "built": (
            "builder: room",
            "builder: room\n  parameters: {seed: 2}",
            {"build_scene", "inventory", "panorama_lightfield", "probe_cameras"} | VIEWS,
        ),
        "brought": (f"{0:064}", f"{1:064}", {"check_blend", "inventory", "free_places"} | VIEWS),
        "imported": ("scene:", "licence: CC0-1.0\nscene:", {"pack", "page"}),
        "config.yaml": ("price_per_kwh: 0.32", "price_per_kwh: 0.4", {"costs", "page"}),
    },
    {
        "built": (
            "samples: 4",
            "samples: 5",
            {"panorama_lightfield", "render_panorama", "probe_cameras", "probe"} | VIEWS,
        ),
        "brought": ("allow_missing: true", "allow_missing: false", {"inventory"}),
        "config.yaml": ("device:", "package_gigabytes: 1\ndevice:", {"pack"}),
    },
    {
        "built": (
            "lens: equidistant",
            "lens: equisolid, focal_length: 3",
            {"lens_map", "reprojected_lightfield", "figures"} | VIEWS,
        ),
        "brought": (
            "view_layers: [One]",
            "view_layers: [Two]",
            {"inventory", "free_places", "probe_cameras", "calibrate"} | VIEWS,
        ),
        "config.yaml": ("  full: {}", "  full: {samples: 3}", {"lightfield", "probe_cameras"}),
    },
    {
        "built": ("frame: 1", "frame: 2", {"inventory", "panorama_lightfield"} | VIEWS),
        "brought": ("scene_name: First", "scene_name: Second", {"inventory", "free_places"}),
    },
    {
        "built": ("center: [0, 0, 1]", "center: [0, 0, 2]", {"panorama_lightfield"} | VIEWS),
        "brought": ("target_error: 0.1", "target_error: 0.2", {"probe_cameras", "calibrate"}),
    },
    {
        "built": ("fov: 60", "fov: 50", {"lens_map", "reproject", "export_to_instant_ngp"}),
        "brought": (
            "size: 1",
            "size: 2",
            {"free_places", "probe", "flow", "measure_synthesis"} | VIEWS,
        ),
    },
    {
        "built": ("exposure: -1", "exposure: -2", {"reprojected_lightfield", "reproject"}),
        "brought": ("flow: {pairs: neighbours}\n", "", {"lightfield", "validate"}),
    },
    {
        "built": ("  nerfstudio: {sources: [perspective], points: 9}\n", "", {"validate"}),
        "brought": (
            "nerfstudio: {sources: [views], depth: true}",
            "nerfstudio: {sources: [views], depth: true, points: 9}",
            {"export", "measure_learning"},
        ),
    },
    {
        "built": ("split: odd", "split: {every: 3}", {"splits"} | VIEWS),
        "brought": ("scene_name:", "frame: 3\n  scene_name:", {"free_places", "inventory"} | VIEWS),
    },
    {
        "built": (
            "exports:",
            "  other: {camera: {lens: rectilinear, fov: 40, resolution: [8, 8]}}\nexports:",
            {"costs", "validate"},
        ),
        "brought": ("instant_ngp: {", "instant_ngp: {scale: 2, ", {"export_to_instant_ngp"}),
    },
    {"built": ("panorama: true", "panorama: false", {"page"})},
    {"built": ("samples: 4", "samples: 4, motion_blur: true", {"inventory"} | VIEWS)},
    {"built": ("format: png", "format: exr", {"export_to_instant_ngp", "export"})},
    {"built": ("samples: 4", "samples: 4, depth: distance", VIEWS)},
    {"built": ("builder: room", "builder: still_life", {"build_scene"})},
    {"built": ("resolution: [16, 16]", "resolution: [32, 32]", {"panorama_lightfield"} | VIEWS)},
    {"built": ("split: odd", "frames: {first: 1, last: 2, step: 1}", {"pack"})},
    {"published/LFPlane/lightfield.json": ("{", "{ ", {"lightfield"})},
    {"results/benchmarks/learn/built/LFLine.csv": (None, "a,b\n1,2\n", {"page"})},
    {"built": ("    split: odd\n", f"    split: train\n{OTHER}, split: test}}\n", {"export"})},
    {"built": ("    split: odd\n", f"    split: test\n{OTHER}, split: train}}\n", {"lightfield"})},
]
# The first two follow from the programs' versions, the third from where the scene YAML lies. Only
# instant-ngp places test views as the trained ones, and only a .blend's camera has frames.
CONSTANT = {"version", "bpy", "command", "camera_frames", "nerfstudio.json trained_by"}


@pytest.fixture(scope="module")
def rounds(build):
    """Of each round the jobs that must run, by scene, and the settings that the plan wrote."""
    results = []
    for changes in ROUNDS:
        texts = {}
        for name, (old, new, _) in changes.items():
            path = build.folder / YAMLS.get(name, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            texts[path] = path.read_text() if old else None
            assert old is None or old in texts[path], old
            path.write_text(texts[path].replace(old, new, 1) if old else new)
        made = rules_by_scene(build.plan())
        results.append((made, build.settings()))
        for path, text in texts.items():
            if text is None:
                path.unlink()
            else:
                path.write_text(text)
    # A plan with other settings leaves nothing to do.
    assert not build.plan()
    return results


def rules_by_scene(jobs):
    return {(name, job["rule"]) for job in jobs for name in YAMLS if f"/{name}" in job["output"][0]}


@pytest.mark.parametrize("number", range(len(ROUNDS)))
def test_a_changed_setting_runs_what_depends_on_it(rounds, number):
    made, _ = rounds[number]
    for name, (_, _, rules) in ROUNDS[number].items():
        again = {rule for scene, rule in made if scene == name or name not in YAMLS}
        assert rules <= again, rules - again


def test_every_setting_of_every_job_is_changed_above(build, rounds):
    before = build.settings()
    changed = {key for _, after in rounds for key in before if after[key] != before[key]}
    # By the file's name, not for each scene.
    kept = {f"{Path(file).name} {key}" for file, key in before if key not in CONSTANT}
    kept -= {f"{Path(file).name} {key}" for file, key in changed}
    assert not kept - CONSTANT
