"""Every job runs again if anything that it was made from changes, and only then.

Stand-ins replace all programs, so a build of every rule takes seconds. A stand-in writes its
command and the SHA-256 of each input. That shows from what each file was made. It reads its flags
and writes its receipt as the program does.
"""

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import bookkeeping
import forks
import pytest
from checkouts import PUBLISHED_VIEWS as IMPORTED
from checkouts import ROOT, SEQUENCE, checkout, jobs_on, snakemake, with_consumers
from sphere import write_views

from lightfield.core.files import size_and_time

pytestmark = pytest.mark.slow
CAMERA = "{lens: equidistant, fov: 180, resolution: [16, 16]}"
BUILT = f"""
description: Cameras in a room
scene:
  builder: room
  frame: 1
  targets: {{board: {{type: chessboard, squares: [4, 3], square: 0.04}}}}
render: {{samples: 4}}
report: {{panorama: true}}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 2]
    size: 1
    center: [0, 0, 1]
    camera: {CAMERA}
    split: odd
  LFInner: {{type: plane, cameras: [2, 2], size: 0.5, camera: {CAMERA}}}
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 60, resolution: [8, 8]}}
    format: png
    exposure: -1
  cubes:
    camera: {{lens: rectilinear, fov: 90, resolution: [8, 8]}}
    cube_map: true
mesh: {{formats: [glb]}}
video: {{path: walk, format: webp, rigs: [LFPlane]}}
exports:
  instant_ngp: {{sources: [perspective]}}
  nerfstudio: {{sources: [perspective], points: 9}}
sensor: {{noise: {{a: 0.01}}}}
"""
# Scenes for the rules that a built scene does not need: download, calibration, free places, flow,
# heads.
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
  pair:
    type: plane
    cameras: [2, 1]
    size: 1
    head:
      left: {{camera: {CAMERA}}}
      right: {{camera: {CAMERA}, position: [0.1, 0, 0]}}
flow: {{pairs: neighbours}}
exports:
  instant_ngp: {{sources: [views]}}
  nerfstudio: {{sources: [views], depth: true}}
"""
MOVED = f"scene: {{builder: still_life}}{SEQUENCE}"
MODELLED = f"""
scene: {{model: model.obj, light: sky.hdr}}
render: {{samples: 4}}
rigs:
  LFPlane: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}}}
"""
# A picture of two pixels, of four bytes each.
SKY = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\nbrightly"
# A family, of two batches.
MANY = f"""
scene: {{builder: room}}
render: {{samples: 4}}
rigs:
  LFPlane: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}}}
family:
  seeds: 0-2
  batch: 2
  values: {{scene.parameters.detail: {{uniform: [0.5, 1]}}}}
"""
TARGETS = [
    "all",
    "package",
    "plan",
    "error_vs_time",
    "reprojection_benchmark",
    "stability",
    "extremes",
    "render_overhead",
    "gpu_check",
    "synthesis",
]
CHOSEN = [
    "--config",
    "scenes=[built,brought,imported,modelled,moved,many]",
    "rigs=all",
    "preset=full",
]
# Rules without output: a target is read or always runs, or only asks for other targets.
WITHOUT_OUTPUT = {
    "all",
    "smoke",
    "report_html",
    "package",
    "error_vs_time",
    "gpu_check",
    "synthesis",
    "plan",
    "prune",
    "status",
    "verify",
}
# Stands in for every program. It writes what identifies its job, in a form that rules can read.
STAND_IN = """
import json, os, sys
from pathlib import Path
sys.path.insert(0, "scripts")
from lightfield.core.files import write_json
from lightfield.engine.flags import parsed
from lightfield.engine.receipts import input_sum, is_receipt, note_inputs, note_shared_inputs
from lightfield.engine.stage import Stage
from lightfield.stages.registry import BY_NAME

# Only the log of a job tells which job this is. A job fails if Snakemake removes its log meanwhile.
target = os.readlink("/proc/self/fd/2")
if target.startswith("pipe:"):
    # A job without outputs answers on the terminal.
    sys.exit()
log = Path(target).relative_to(Path.cwd())
work = json.loads(Path("work_to_do", log).read_text())

def write(job=None):
    if job and job.name == "import_model":
        # A model and its light are only in the settings. Its program notes them.
        settings = job.settings
        note_inputs([settings.model, *([settings.light_file] if settings.light_file else [])])
    if job and job.name == "report_index":
        # It finds the pages itself.
        note_shared_inputs(work["input"])
    outputs = [Path(name) for name in work["output"] if not is_receipt(name)]
    if job and not outputs:
        # A shard declares its receipt, and writes files into a folder.
        outputs = [folder / f"view_{job.receipt.stem}.exr" for folder in job.made()]
    inputs = {name: input_sum(name) for name in work["input"]}
    for output in outputs:
        content = {"name": str(output), "inputs": inputs, "command": sys.argv}
        content |= {"frames": [], "external_files": [], "cost_samples": 4, "sources": {}}
        write_json(output, content | {"members": {}, "files": {}})

if "--receipt" in sys.argv:
    Stage._do_work = write
    parsed(BY_NAME[Path(sys.argv[0]).stem], None).run()
else:
    write()
"""
# Options that say how a job runs, not what it makes.
MACHINE = {"--threads", "--processes", "--cores", "--device", "--stall"}


class Build:
    """A checkout in which stand-ins built everything, and Snakemake's own metadata is lost."""

    def __init__(self, folder):
        scenes = {"built": BUILT, "brought": BROUGHT, "imported": IMPORTED, "modelled": MODELLED}
        scenes |= {"moved": MOVED, "many": MANY}
        self.folder = checkout(folder, **scenes)
        for name in ("model.obj", "other.obj"):
            (folder / name).write_text("# stands in for a model\n")
        (folder / "sky.hdr").write_text(SKY)
        camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
        write_views(folder / "published/LFPlane", camera, {"type": "plane", "cameras": [2, 1]})
        for program in [*ROOT.glob("scripts/*.py"), *ROOT.glob("benchmarks/*.py")]:
            stand_in = folder / program.relative_to(ROOT)
            stand_in.parent.mkdir(exist_ok=True)
            stand_in.write_text(STAND_IN)
        (folder / "scripts/check_device.py").write_text("")
        with_consumers(folder, python=forks.python())
        self.jobs = self.run()
        shutil.rmtree(folder / ".snakemake")

    def start(self, *arguments):
        """Start a process of its own that makes everything."""
        return subprocess.Popen(
            [forks.python(), "snakemake.py", *self.command_line(*arguments)],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def command_line(self, *arguments):
        return ["--cores", "4", *arguments, *CHOSEN, "--", *TARGETS]

    def snakemake(self, *arguments):
        """Run everything. Return the terminal's stderr."""
        result = snakemake(self.folder, *self.command_line(*arguments))
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stderr

    def plan(self, *arguments):
        """Return the jobs that a run would start, by their first output."""
        stderr = self.snakemake("--dry-run", *arguments, "--logger", "jobs")
        return {job["output"][0]: job for job in jobs_on(stderr) if job["output"]}

    def run(self):
        """Run everything, twice. Return all its jobs.

        A page shows the measurements that existed when it was planned, so it needs a second run.
        """
        jobs = self.prepare()
        for _ in range(2):
            self.snakemake()
        return jobs

    def prepare(self):
        """Tell the stand-ins what each job reads and writes. Return all jobs."""
        jobs = self.plan("--forceall", "--ignore-incomplete")
        work = {job["log"][0]: job for job in jobs.values()}
        work["work/logs/plan.log"] = {"input": [], "output": []}
        for log, job in work.items():
            path = self.folder / "work_to_do" / log
            path.parent.mkdir(parents=True, exist_ok=True)
            inputs = [name for name in job["input"] if bookkeeping.is_content(name)]
            path.write_text(json.dumps({"input": inputs, "output": job["output"]}))
        return jobs

    def settings(self):
        """Return the settings of every job, by file and key."""
        return {
            (str(path.relative_to(self.folder / "work")), key): value
            for path in (self.folder / "work").rglob("settings/**/*.json")
            for key, value in json.loads(path.read_text()).items()
        }

    def inputs(self, job):
        """Return what a job would note about its inputs now."""
        names = [name for name in job["input"] if bookkeeping.is_content(name)]
        return {name: bookkeeping.digest_of_input(self.folder, name) for name in names}


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("every_rule")
    build = Build(folder / "plenoforge")
    # Like a fresh clone, what the tests use has other inodes than were noted.
    shutil.copytree(build.folder.rename(folder / "pristine"), build.folder)
    return build


def states(folder):
    """Return the size and the time of each file below a folder. A folder has None, and is first."""
    sizes_and_times = {}
    for entry in os.scandir(folder):
        sizes_and_times[entry.path] = size_and_time(entry.path)
        if entry.is_dir():
            sizes_and_times |= states(entry.path)
    return sizes_and_times


def restore(build):
    """Undo all changes in a build's folder. Copies what differs, because there are many files."""
    folder = str(build.folder)
    pristine = str(build.folder.with_name("pristine"))
    wanted = {
        folder + path.removeprefix(pristine): state for path, state in states(pristine).items()
    }
    present = states(folder)
    for path in reversed(present):
        if path not in wanted:
            Path(path).rmdir() if present[path] is None else Path(path).unlink()
    for path, state in wanted.items():
        if state is None:
            Path(path).mkdir(exist_ok=True)
        elif present.get(path) != state:
            shutil.copy2(pristine + path.removeprefix(folder), path)


@pytest.fixture
def build(pristine):
    """The build as it was at first."""
    restore(pristine)
    return pristine


def test_all_rules_have_jobs_in_the_build_and_none_runs_twice(build):
    listed = {*snakemake(build.folder, "--list-rules", *CHOSEN).stdout.split()}
    made = {job["rule"] for job in build.jobs.values()}
    # Only a storage has copies of the .blend files of users.
    assert made == listed - WITHOUT_OUTPUT - {"store_blend", "write_settings"}
    assert {job["rule"]: job["reason"] for job in build.plan().values()} == {}


def test_target_rules_name_an_output_of_every_job(build):
    """Otherwise Snakemake would not make it again if it is missing."""
    stderr = build.snakemake("--dry-run", "--forceall", "--ignore-incomplete", "--logger", "jobs")
    without_output = [job for job in jobs_on(stderr) if not job["output"]]
    named = {name for job in without_output for name in job["input"]}
    unnamed = [job for job in build.jobs.values() if named.isdisjoint(job["output"])]
    # The user may remove a downloaded .blend once its views are rendered.
    assert {job["rule"] for job in unnamed} - {*TARGETS} == {"fetch_blend"}


def test_a_missing_output_is_made_again_with_the_others_of_its_job(build):
    outputs = {job["output"][-1]: first for first, job in build.jobs.items() if job["output"][1:]}
    for name in outputs:
        (build.folder / name).unlink()
    assert build.plan().keys() >= {*outputs.values()}


def followers(jobs, first):
    """Return the first outputs of these jobs and of all jobs that depend on them."""
    maker = {name: output for output, job in jobs.items() for name in job["output"]}
    readers = {}
    for output, job in jobs.items():
        for name in job["input"]:
            readers.setdefault(maker.get(name), set()).add(output)
    reached = set()
    newest = set(first)
    while newest:
        reached |= newest
        newest = {reader for output in newest for reader in readers.get(output, ())} - reached
    return reached


def identifying_arguments(command):
    """Return a command's arguments except for those that say how to run it, or what exists."""
    kept = []
    flag = ""
    for word in command:
        flag = word if word.startswith("--") else flag
        if flag not in {*MACHINE, "--finished"}:
            kept.append(word)
    return kept


def assert_made_from_present_inputs(build, jobs):
    """Check that each output was made by its job's present command from its present inputs.

    A page shows the measurements that existed when it was planned. A package has the page's walk.
    """
    shown_later = build.plan().keys()
    assert {jobs[output]["rule"] for output in shown_later} <= {"page", "index", "pack"}
    noted = bookkeeping.noted(build.folder)
    for first_output, job in jobs.items():
        if first_output in shown_later:
            continue
        inputs = build.inputs(job)
        arguments = shlex.split(job["command"])
        (python,) = (word for word in arguments if Path(word).name == "python")
        command = arguments[arguments.index(python) + 1 : arguments.index(">")]
        # Jobs of benchmarks have no receipt.
        files = noted[first_output].files if first_output in noted else job["output"]
        for output in files:
            content = json.loads((build.folder / output).read_text())
            assert content["inputs"] == inputs, output
            assert identifying_arguments(content["command"]) == identifying_arguments(command), (
                output
            )
        if first_output in noted:
            assert inputs.items() <= noted[first_output].inputs.items()


NAMES = ("built", "brought", "imported", "modelled", "moved", "many")
SCENES = {name: f"configs/scenes/{name}.yaml" for name in NAMES}
ROOM = "scripts/scenes/room/__init__.py"
OTHER = f"  LFOther: {{type: plane, cameras: [2, 1], size: 1, camera: {CAMERA}"
# The cameras of a light field, its panorama and its probes follow from the same settings.
CAMERAS = {"lightfield", "panorama_lightfield", "probe_cameras"}
RENDERED = ("built", "brought", "modelled", "moved")
RENDERED_CAMERAS = {f"{scene} {rule}" for scene in RENDERED for rule in CAMERAS}
BUILDING = {"build_scene"} | CAMERAS
# The first rig has the probes.
OF_PLANE = {"LFPlane lightfield", "LFPlane panorama_lightfield", "probe_cameras"}
TESTED = {"LFPlane lightfield", "probe_cameras", "LFPlane export", "splits", "check_gpu"}
CUBES = BUILT[BUILT.index("  cubes:") : BUILT.index("mesh:")]
TO_CUBES = BUILT[BUILT.index("render:") : BUILT.index("  cubes:")]
# A rig that tests another has the same camera. So these rounds do not follow a change of it.
ODD = BUILT[BUILT.index("    center:") : BUILT.index("  LFInner:")]
INNER = BUILT[BUILT.index("  LFInner:") : BUILT.index("reprojections:")]
# Each round makes one change in each scene YAML and in other files. It has the old and the new
# text, and the jobs whose own settings or inputs change, by rule and if need be by folder.
ROUNDS = {
    # These two replace most text, so they come before rounds that change a part of it.
    "another pass, and a .blend to be fetched": {
        "built": (
            TO_CUBES,
            TO_CUBES.replace("samples: 4", "samples: 4, passes: [normal]").replace(
                "exposure: -1", "exposure: -1\n    passes: [normal]"
            ),
            CAMERAS | {"perspective reproject", "perspective reprojected_lightfield"},
        ),
        # A missing file is downloaded again if a job needs it.
        "brought": (f"{0:064}", f"{1:064}", {"check_blend"}),
        "scene.blend": (None, None, {"fetch_blend"}),
    },
    # The inventory lists the emitters, of which a light field's groups are made.
    "light groups, and another light": {
        "built": (
            TO_CUBES,
            TO_CUBES.replace("samples: 4", "samples: 4, light_groups: [lamp]").replace(
                "exposure: -1", "exposure: -1\n    relight: {lamp: 2}"
            ),
            {"inventory", "perspective reproject", "perspective reprojected_lightfield"} | CAMERAS,
        ),
    },
    "what is built, checked, packed, and paid": {
        "built": (
            "builder: room",
            "builder: room\n  parameters: {seed: 2}",
            {"build_scene"} | CAMERAS,
        ),
        "brought": (f"{0:064}", f"{1:064}", {"check_blend"}),
        "imported": ("Few pixels.", "Few views.", {"imported pack", "imported publish"}),
        "config.yaml": ("watts: 65", "watts: 66", {"costs"}),
    },
    "samples, and what may be missing": {
        "built": ("samples: 4", "samples: 5", CAMERAS),
        "many": ("samples: 4", "samples: 5", {"build_members"}),
        "brought": ("allow_missing: true", "allow_missing: false", {"inventory"}),
        "config.yaml": ("device:", "package_gigabytes: 1\ndevice:", {"pack", "publish"}),
    },
    "the lens, and the view layers": {
        # A panorama has a lens of its own.
        "built": (
            "lens: equidistant",
            "lens: equisolid, focal_length: 3",
            {"LFPlane lightfield", "probe_cameras"},
        ),
        "brought": ("view_layers: [One]", "view_layers: [Two]", {"inventory"}),
    },
    # Nothing limits the samples of imported views.
    "the samples of a preset": {
        "config.yaml": (
            "  full: {}",
            "  full: {samples: 3}",
            RENDERED_CAMERAS | {"build_members"},
        ),
    },
    "the frame, and the scene": {
        "built": ("frame: 1", "frame: 2", {"inventory", "mesh"} | CAMERAS),
        "brought": ("scene_name: First", "scene_name: Second", {"inventory", "free_places"}),
    },
    "a board": {
        "built": ("square: 0.04", "square: 0.05", {"inventory", "mesh"} | CAMERAS),
    },
    "what follows the camera": {
        "brought": (
            "scene_name: First",
            "scene_name: First\n  followed_camera: file",
            {"inventory"},
        ),
    },
    "the place, and the error": {
        "built": ("center: [0, 0, 1]", "center: [0, 0, 2]", OF_PLANE),
        "brought": ("target_error: 0.1", "target_error: 0.2", CAMERAS),
    },
    "another lens of a reprojection, and another size": {
        "built": (
            "fov: 60",
            "fov: 50",
            {"perspective lens_map", "perspective reprojected_lightfield"},
        ),
        "brought": ("size: 1", "size: 2", {"free_places"}),
    },
    "development, and no flow": {
        "built": (
            "exposure: -1",
            "exposure: -2",
            {"perspective reproject", "perspective reprojected_lightfield"},
        ),
        "brought": ("flow: {pairs: neighbours}\n", "", {"lightfield", "probe_cameras"}),
    },
    "an export less, and other options": {
        "built": (
            "  nerfstudio: {sources: [perspective], points: 9}\n",
            "",
            # The drawing of a rig without a split shows the test views that exports choose.
            {"validate", "costs", "LFInner figures"},
        ),
        "brought": ("depth: true}", "depth: true, points: 9}", {"export"}),
    },
    "an export of one rig": {
        "built": (
            "points: 9",
            "points: 9, rigs: [LFPlane]",
            {"LFInner validate", "LFInner costs", "LFInner figures"},
        ),
        # Rounds that split the views by rigs wait: this export lacks their second rig.
        SCENES["built"]: ("split: odd", "split:  odd", set()),
    },
    "a split, and a frame": {
        "built": ("split: odd", "split: {every: 3}", {"LFPlane lightfield", "probe_cameras"}),
        "brought": (
            "scene_name:",
            "frame: 3\n  scene_name:",
            {"inventory", "free_places"} | CAMERAS,
        ),
    },
    "a reprojection more, and another scale": {
        "built": (
            "mesh:",
            "  other: {camera: {lens: rectilinear, fov: 40, resolution: [8, 8]}}\nmesh:",
            {"costs"},
        ),
        "brought": ("instant_ngp: {", "instant_ngp: {scale: 2, ", {"export_to_instant_ngp"}),
    },
    "a reprojection less, and another .blend": {
        "built": (CUBES, "", {"validate", "costs"}),
        "scene.blend": ("{", "{ ", {"check_blend"}),
    },
    "a reprojection to faces no longer": {
        "built": ("cube_map: true", "cube_map: false", {"cubes reprojected_lightfield"}),
    },
    "no panorama, and larger batches": {
        "built": ("panorama: true", "panorama: false", {"figures"}),
        "many": ("batch: 2", "batch: 3", {"count_members"}),
    },
    "motion blur, and another model": {
        "built": ("samples: 4", "samples: 4, motion_blur: true", {"inventory"} | CAMERAS),
        "modelled": (
            "model: model.obj, light: sky.hdr",
            "model: other.obj, unit: metres, up: z, ground: true, light: city, frame: 2, "
            "allow_missing: true, shared_folder: textures",
            {"import_model", "inventory"} | CAMERAS,
        ),
    },
    "another format, and another text of the model": {
        "built": (
            "format: png",
            "format: exr\n    primaries: acescg",
            {"perspective reproject", "perspective reprojected_lightfield"},
        ),
        "model.obj": ("#", "# ", {"import_model"}),
    },
    "another format of meshes, and a seed more": {
        "built": ("[glb]", "[ply]", {"mesh"}),
        "many": ("0-2", "0-3", {"seeds_0002_0003 build_members", "corpus"}),
    },
    "another path of the video": {"built": ("path: walk", "path: turntable", {"video"})},
    "another format of the video": {"built": ("format: webp", "format: mp4", {"video"})},
    "a longer and higher video": {
        "built": ("path: walk,", "path: walk, seconds: 7, height: 90,", {"video"}),
    },
    "the numbers of objects": {
        "built": ("samples: 4", "samples: 4, passes: [object]", {"mesh"} | CAMERAS),
    },
    "how pixels are resampled, other drawn values, and another text of a light": {
        "built": (
            "exposure: -1",
            "exposure: -1\n    filter: bilinear\n    samples: 2\n    rotation: [0, 9, 0]",
            {"perspective lens_map", "perspective reprojected_lightfield"},
        ),
        "many": ("[0.5, 1]", "[0.6, 1]", {"build_members"}),
        "sky.hdr": ("brightly", "dimmedly", {"import_model"}),
    },
    "how light becomes pixels": {
        "built": (
            "exposure: -1",
            "exposure: -1\n    bits: 16\n    reinhard: 4",
            {"perspective reproject", "perspective reprojected_lightfield"},
        ),
    },
    # The .blend's look comes through its inventory, and rendered views keep their keys.
    "a look, and the look of a .blend": {
        # A look goes neither with EXR nor with a tone mapping, which other rounds ask for.
        "built": (
            "format: png\n    exposure: -1\n  cubes",
            "format: png\n    exposure: -1\n    look: AgX - Punchy\n  cubes",
            # Drawings have the look of the scene's pictures.
            {"perspective reproject", "perspective reprojected_lightfield", "figures", "video"},
        ),
        "brought": (
            "depth: true}",
            "depth: true, look: file}",
            {"inventory", "lightfield", "probe_cameras", "export"},
        ),
    },
    "another sensor, and how members are split": {
        "built": (
            "a: 0.01",
            "a: 0.02",
            {"sensor reproject", "sensor reprojected_lightfield"},
        ),
        "many": (
            "batch: 2",
            "batch: 2\n  corpus: {splits: {test: 0.2}, shards: true, shard_gigabytes: 2}",
            {"corpus"},
        ),
    },
    "cameras that move, and a longer sequence": {
        "built": ("samples: 4", "samples: 4, camera_motion: {travel: [1, 0, 0]}", CAMERAS),
        # The cameras' settings hold the rig, and so its frames.
        "moved": (
            "last: 2",
            "last: 3",
            {"inventory", "lightfield", "probe_cameras", "export_sequence", "pack"},
        ),
    },
    "distances, and other points of a sequence": {
        "built": ("samples: 4", "samples: 4, depth: distance", CAMERAS),
        "moved": ("points: 9", "points: 8", {"export_sequence"}),
    },
    "another builder": {
        "built": ("builder: room", "builder: still_life", {"build_scene"} | CAMERAS)
    },
    "another text of the builder": {
        ROOM: (
            '"""',
            '""" ',
            {"build_members", *(f"built {rule}" for rule in {"build_scene"} | CAMERAS)},
        ),
    },
    "the library of all builders": {
        "scripts/scenes/library/lights.py": (
            '"""',
            '""" ',
            {
                "build_members",
                *(f"{scene} {rule}" for scene in ("built", "moved") for rule in BUILDING),
            },
        ),
    },
    "the resolution": {"built": ("[16, 16]", "[32, 32]", OF_PLANE | {"check_gpu"})},
    "a sequence": {
        "built": (
            "    type: plane\n",
            "    type: plane\n    frames: {first: 1, last: 2, step: 1}\n",
            {"inventory", "probe_cameras", "check_gpu", "LFPlane pack"},
        ),
    },
    "a description, and somebody's light field": {
        "built": ("Cameras in a room", "Some cameras", {"pack"}),
        "published/LFPlane/lightfield.json": ("{", "{ ", {"imported lightfield"}),
    },
    "a measurement": {
        "results/benchmarks/synthesis/built/LFPlane.json": (None, "{}\n", {"built LFPlane page"}),
    },
    "a rig that tests": {
        "built": (ODD, ODD.replace("odd\n", f"train\n{OTHER}, split: test}}\n"), TESTED),
    },
    "a rig that is tested": {
        "built": (ODD, ODD.replace("odd\n", f"test\n{OTHER}, split: train}}\n"), TESTED),
    },
    # The other dataset's views were compared with its views.
    "a rig less": {"built": (INNER, "", {"measure_synthesis", "check_gpu"})},
    "a rig that is the larger one": {
        "built": ("size: 0.5", "size: 2", {"LFInner lightfield", "measure_synthesis"}),
    },
}
# Versions and bpy follow from the programs, and commands from the place of the scene YAML. Only a
# .blend's camera has frames. Only instant-ngp places a rig that tests like the trained one; other
# formats take its views. No scene YAML asks reproject.py for masks, or sets the number of compared
# synthesised views. A scene with another name is another scene. A panorama has no neighbour.
CONSTANT = {"version", "spread_version", "points_version", "bpy", "command", "camera_frames"}
CONSTANT |= {"reproject.json mask", "synthesis.json views", "lightfield.json scene"}
CONSTANT |= {"panorama.json scene", "probes.json scene", "panorama.json flow"}
# The sequence is of rendered views, and no other rig tests it.
CONSTANT |= {"dnerf.json suffix", "dnerf.json tested_by"}
CONSTANT |= {"nerfstudio.json trained_by", "instant_ngp.json tested_by"}
# The preset and the folders are another family's. A new seed changes the members of one batch.
CONSTANT |= {"family", "preset", "results", "work", "seeds_0000_0001.json members"}


def edit(build, changes):
    """Make the changes of a round. If a text is missing, change nothing and return False."""
    paths = {name: build.folder / SCENES.get(name, name) for name in changes}
    for name, (old, new, _) in changes.items():
        is_there = paths[name].exists()
        if (old is None and new is None and not is_there) or (
            old is not None and not (is_there and old in paths[name].read_text())
        ):
            return False
    for name, (old, new, _) in changes.items():
        if new is None:
            paths[name].unlink()
        elif old is None:
            paths[name].parent.mkdir(parents=True, exist_ok=True)
            paths[name].write_text(new)
        else:
            paths[name].write_text(paths[name].read_text().replace(old, new, 1))
    return True


def apply(build, changes):
    """Make the changes of a round. Return the plan, and the settings that it changes."""
    before = build.settings()
    # A plan writes settings that are missing.
    for path in (build.folder / "work").rglob("settings/**/*.json"):
        path.unlink()
    assert edit(build, changes)
    planned = build.plan()
    after = build.settings()
    return planned, {key for key in before if after.get(key) != before[key]}


def changed_jobs(jobs, changes, build):
    """Return the first outputs of the jobs that a round changes or adds itself."""
    for output, job in jobs.items():
        for name, (*_, rules) in changes.items():
            # Each page shows the text of its scene YAML.
            for changed in rules | {"page"} if name in SCENES else rules:
                *folders, rule = changed.split()
                folders += {name} & SCENES.keys()
                if job["rule"] == rule and {*folders} <= {*output.replace(".", "/").split("/")}:
                    yield output
        if output not in build.jobs:
            yield output


# These rounds leave fewer jobs.
WITH_FEWER_JOBS = {
    "an export less, and other options",
    "a reprojection less, and another .blend",
    "a reprojection to faces no longer",
    "no panorama, and larger batches",
    "a sequence",
    "development, and no flow",
    "a rig that is tested",
    "a rig less",
}
# The settings that each round changes.
CHANGED = {}


@pytest.mark.parametrize("name", ROUNDS)
def test_a_change_plans_the_affected_jobs_and_no_others(build, name):
    planned, CHANGED[name] = apply(build, ROUNDS[name])
    # The other jobs are the same as before, unless they are planned.
    jobs = build.plan("--forceall") if name in WITH_FEWER_JOBS else build.jobs | planned
    assert planned.keys() == followers(jobs, changed_jobs(jobs, ROUNDS[name], build))


def test_planned_jobs_are_made_from_present_inputs(build):
    """Makes many changes at once. The test above checks the plan of each."""
    waiting = list(ROUNDS)
    while waiting:
        restore(build)
        # A round waits if another one has replaced the same text.
        together = [name for name in waiting if edit(build, ROUNDS[name])]
        jobs = build.prepare()
        build.snakemake()
        assert_made_from_present_inputs(build, jobs)
        waiting = [name for name in waiting if name not in together]


def test_every_setting_of_every_job_is_changed_above(build):
    settings = build.settings()
    for name in ROUNDS.keys() - CHANGED.keys():
        restore(build)
        _, CHANGED[name] = apply(build, ROUNDS[name])
    changed = set().union(*CHANGED.values())
    # Compare by the file's name, not for each scene.
    untouched = {f"{Path(file).name} {key}" for file, key in settings if key not in CONSTANT}
    untouched -= {f"{Path(file).name} {key}" for file, key in changed}
    assert untouched <= CONSTANT


# ---- inputs ---------------------------------------------------------------------------------


def levels(jobs):
    """Return the first outputs of jobs in groups. No job depends on another of its group."""
    maker = {name: output for output, job in jobs.items() for name in job["output"]}
    depths = {}

    def depth(output):
        if output not in depths:
            makers = {maker[name] for name in jobs[output]["input"] if name in maker}
            depths[output] = 1 + max(map(depth, makers), default=0)
        return depths[output]

    groups = {}
    for output in jobs:
        groups.setdefault(depth(output), []).append(output)
    return groups.values()


def test_each_job_that_read_other_content_runs_again(build):
    """Times do not help here: all else is as if two builds had run beside each other."""
    jobs = build.plan("--forceall")
    noted = bookkeeping.noted(build.folder)
    for outputs in levels(jobs):
        # Jobs of benchmarks have no receipt.
        read = {
            output: build.inputs(jobs[output])
            for output in outputs
            if output in noted and build.inputs(jobs[output])
        }
        with bookkeeping.made_from_other_inputs(build.folder, read):
            assert build.plan().keys() == followers(jobs, read)


def test_each_changed_input_of_each_job_is_noticed(build):
    inputs = 0
    for _, name, outdated in bookkeeping.each_changed_input(build.folder):
        assert outdated == [name]
        inputs += 1
    assert inputs > 200


def test_one_run_repairs_what_two_simultaneous_builds_mixed_up(build):
    """The builds' programs overwrite each other's inputs, without atomic writes."""
    apply(build, ROUNDS["samples, and what may be missing"])
    jobs = build.prepare()
    builds = [build.start("--nolock", "--forceall") for _ in range(2)]
    for process in builds:
        process.communicate()
    build.snakemake()
    assert_made_from_present_inputs(build, jobs)
