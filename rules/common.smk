# The configuration, and where everything lies. Every path of the workflow comes from here.
import atexit
import json
import math
import os
import shlex
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(workflow.basedir) / "scripts"))
# A prefix takes the place of Snakemake's own, whose strict mode keeps the exit status of a program
# before `| tee`. The rules call `python`: let that be the one that runs Snakemake.
shell.prefix(
    "set -euo pipefail;"
    f" export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH; "
)

from lightfield.dataset.config import VIEWS, load_config, load_datasets, scene_datasets
from lightfield.core.errors import UserError
from lightfield.core.failures import failure_report
from lightfield.core.files import write_json
from lightfield.dataset.keys import scene_fingerprint

try:
    SETTINGS = load_config(config)
    CHOSEN = load_datasets(SETTINGS)
    SMOKE = scene_datasets("smoke", "full", {})
except UserError as error:
    sys.exit(f"error: {error}")

RESULTS = SETTINGS["results"]
WORK = SETTINGS["work"]
LIMITS = {"smoke": {}} | {
    dataset.scene: SETTINGS["presets"][SETTINGS["preset"]] for dataset in CHOSEN
}
DATASETS = {(dataset.scene, dataset.rig): dataset for dataset in [*SMOKE, *CHOSEN]}

# For planning only, measured on one core of a 2-core x86-64 machine: path tracing of one sample of
# one pixel, and start-up (bpy, the scene, and Cycles' acceleration structures).
SECONDS_PER_SAMPLE = 6e-6
START_UP_SECONDS = 3.0
# A pixel's samples where a target error is given instead of them: an estimate for planning.
GUESSED_SAMPLES = 256
# Start-up is kept under this share of a shard's time.
START_UP_SHARE = 0.05
# More shards of one dataset than this only make the plan long: no machine renders them all at once.
MOST_SHARDS = 64

# Snakemake sets this up by itself if it is run with --software-deployment-method conda.
ENVIRONMENT = "../envs/environment.yaml"

DATASET = f"{RESULTS}/{{scene}}/{{rig}}"
MADE = f"{WORK}/{{scene}}/{{rig}}"
PANORAMA = f"{MADE}/panorama"
# Pictures of a report that are drawn together, each as .svg and .png.
STILLS = ("rig", "depth_panorama", "noise")
REPROJECTED = f"{DATASET}/{{reprojection}}"
# Which datasets are being built, for the progress lines of each shard.
RUN = f"{WORK}/run.json"


wildcard_constraints:
    name="[A-Za-z0-9_-]+",
    scene="[A-Za-z0-9_-]+",
    # A sequence's datasets lie a folder deeper, one for each frame.
    rig=r"[A-Za-z0-9_.-]+(/f\d{5,7})?",
    reprojection=r"(?!f\d{5,7}/)[A-Za-z0-9_.-]+",
    first=r"\d+",
    end=r"\d+",


# Jobs of seconds: too short to queue for on a cluster, they run where Snakemake does.
localrules:
    check_blend,
    checksums,
    contact_sheet,
    costs,
    export_reprojection_to_instant_ngp,
    export_views_to_instant_ngp,
    figures,
    index,
    lens_map,
    lightfield,
    page,
    panorama,
    panorama_lightfield,
    plan,
    probe_cameras,
    reprojected_lightfield,
    rig_tables,
    status,


def dataset_of(wildcards):
    """Return the dataset that a job's wildcards mean."""
    return DATASETS[wildcards.scene, wildcards.rig]


def view_seconds(dataset):
    """Estimate how long one core path-traces one view."""
    width, height = dataset.cameras["camera"]["resolution"]
    return width * height * planned_samples(dataset) * SECONDS_PER_SAMPLE


def planned_samples(dataset):
    """Return a pixel's samples; with a target error a guess, the same before and after calibration.

    Shards follow from it, whose bounds must follow from the configuration alone.
    """
    limit = dataset.render.get("most_samples", GUESSED_SAMPLES)
    return dataset.render.get("samples", min(limit, GUESSED_SAMPLES))


def expected_samples(dataset):
    """Return a pixel's samples as well as they are known: as the calibration has it, if it is."""
    record = Path(WORK, dataset.scene, "calibration.json")
    if "target_error" in dataset.render and record.exists():
        return json.loads(record.read_text())["cost_samples"]
    return planned_samples(dataset)


def shards(dataset):
    """Split a dataset's views into runs (first, end) of nearly equal length.

    Automatically, a run is as short as it can be without start-up taking more than its share: the
    shorter, the more processes can work at once.
    """
    wanted = SETTINGS["views_per_shard"]
    if wanted == "auto":
        wanted = math.ceil(START_UP_SECONDS / START_UP_SHARE / view_seconds(dataset))
        wanted = max(wanted, math.ceil(dataset.view_count / MOST_SHARDS))
    count = math.ceil(dataset.view_count / wanted)
    bounds = [dataset.view_count * number // count for number in range(count + 1)]
    return list(zip(bounds, bounds[1:]))


def shard_threads(wildcards, *others):
    """Give each shard one core, or more where there are fewer shards than cores."""
    total = sum(len(shards(dataset)) for dataset in CHOSEN)
    return max(1, workflow.cores // total) if workflow.cores else 1


def scene_file(wildcards):
    """Return the .blend of a dataset: what a builder makes, or what the user brought."""
    return blend_of(dataset_of(wildcards).name)


def blend_of(name):
    """Return the .blend of a scene YAML, as `scene_file` does."""
    return source_of(name).get("blend", f"{WORK}/{name}/scene.blend")


def scene_check(wildcards):
    """Return the proof that the user's own .blend is the one meant; a built one needs none."""
    return check_of(dataset_of(wildcards).name)


def check_of(name):
    """Return the proof of a scene YAML's .blend, as `scene_check` does."""
    return f"{WORK}/{name}/blend.json" if "blend" in source_of(name) else []


def scene_inventory(wildcards):
    """Return the list of what a dataset's scene contains."""
    return f"{WORK}/{dataset_of(wildcards).name}/inventory.json"


def records(dataset, stage):
    """Return the records of a dataset's shards at a stage: `render`, or a reprojection's name."""
    return [
        f"{WORK}/{dataset.scene}/{dataset.rig}/{stage}/{first}-{end}.json"
        for first, end in shards(dataset)
    ]


def all_records(dataset):
    """Return the records of every stage that makes a dataset's images."""
    return [
        record
        for stage in ["render", *dataset.reprojections]
        for record in records(dataset, stage)
    ]


def transforms(dataset):
    """Return the files that a dataset exports for instant-ngp."""
    folder = f"{RESULTS}/{dataset.scene}/{dataset.rig}"
    return [
        (
            f"{folder}/transforms.json"
            if source == VIEWS
            else f"{folder}/{source}/transforms.json"
        )
        for source in dataset.exports.get("instant_ngp", {}).get("sources", [])
    ]


def lightfields(dataset):
    """Return the lightfield.json of a dataset and of each of its reprojections."""
    folder = f"{RESULTS}/{dataset.scene}/{dataset.rig}"
    return [
        f"{folder}/lightfield.json",
        *(f"{folder}/{name}/lightfield.json" for name in dataset.reprojections),
    ]


def published(dataset):
    """Return the files of a dataset that a job makes one by one, its views aside."""
    return [*lightfields(dataset), *transforms(dataset)]


def pictures(dataset):
    """Return the pictures of a dataset's report."""
    folder = f"{RESULTS}/{dataset.scene}/{dataset.rig}/report"
    stills = [
        f"{folder}/{name}{suffix}" for name in STILLS for suffix in (".svg", ".png")
    ]
    return [f"{folder}/contact_sheet.png", f"{folder}/panorama.png", *stills]


def page_of(dataset):
    """Return the page that shows a dataset."""
    return f"{RESULTS}/{dataset.scene}/{dataset.rig}/report/index.html"


def measurements(wildcards):
    """Return the files of those measurements of interest to a dataset that have been made.

    They are no input, for a page must never start a measurement: that takes an hour.
    """
    name = dataset_of(wildcards).name
    stems = ["reprojection", "stability", f"error_vs_time/{name}"]
    files = [
        Path(RESULTS, "benchmarks", f"{stem}{suffix}")
        for stem in stems
        for suffix in (".csv", ".json", ".svg", ".png")
    ]
    return [file for file in files if file.exists()]


def measurement_times(wildcards):
    """Return when those files were made: a page is made anew when this changes."""
    return [file.stat().st_mtime_ns for file in measurements(wildcards)]


def dataset_files(dataset):
    """Return all that a finished dataset consists of, as a target rule asks for it.

    The records are named although later files follow from them, because Snakemake makes a missing
    file anew only if a target rule names it.
    """
    folder = f"{RESULTS}/{dataset.scene}/{dataset.rig}"
    return [
        f"{folder}/validation.json",
        f"{folder}/sha256sums.txt",
        *published(dataset),
        *pictures(dataset),
        f"{folder}/report/costs.json",
        page_of(dataset),
        *all_records(dataset),
    ]


def probes():
    """Return name, number of frames, and probe of each chosen rig: a sequence's first frame's."""
    frames = {}
    for dataset in CHOSEN:
        frames.setdefault((dataset.scene, dataset.rig_name), []).append(dataset.rig)
    return [
        (f"{scene}/{rig}", len(folders), f"{WORK}/{scene}/{folders[0]}/probe.json")
        for (scene, rig), folders in frames.items()
    ]


def status_words():
    """Return the words that tell scripts/status.py of each chosen dataset."""
    return [
        word
        for dataset in CHOSEN
        for word in (
            "--dataset",
            f"{dataset.scene}/{dataset.rig}",
            str(dataset.view_count),
            ",".join(dataset.reprojections),
        )
    ]


def package_file(dataset):
    """Return a rig's dataset as one archive, all frames of a sequence in it, named as SILVR's are."""
    return f"{RESULTS}/{dataset.scene}/{dataset.scene}_{dataset.rig_name}.tar"


def packed_sums(wildcards):
    """Return the checksums that say that everything in an archive is finished."""
    return [
        f"{RESULTS}/{dataset.scene}/{dataset.rig}/sha256sums.txt"
        for dataset in DATASETS.values()
        if (dataset.scene, dataset.rig_name) == (wildcards.scene, wildcards.rig)
    ]


def source_of(name):
    """Return the `scene` block of a scene YAML that is being built."""
    return next(d.source for d in DATASETS.values() if d.name == name)


def fingerprint(wildcards):
    """Return what changes when a builder does; a user's .blend is an input, which is checked."""
    return fingerprint_of(dataset_of(wildcards))


def fingerprint_of(dataset):
    """Return the fingerprint of a dataset, as `fingerprint` does."""
    source = dataset.source
    return scene_fingerprint(source) if "builder" in source else None


def scene_name(wildcards):
    """Return the scene YAML's name that `scene` means: it may have a preset's name behind it."""
    known = {dataset.scene: dataset.name for dataset in DATASETS.values()}
    return known.get(wildcards.scene, wildcards.scene)


def scene_limits(wildcards):
    """Return the limits of `scene`; without a preset's name it is at full size."""
    return LIMITS.get(wildcards.scene, {})


def first_dataset(wildcards):
    """Return the dataset of a scene's first rig, whose views are its probes."""
    name = scene_name(wildcards)
    preset = "full" if wildcards.scene == name else SETTINGS["preset"]
    return scene_datasets(name, preset, scene_limits(wildcards))[0]


def calibration_of(dataset):
    """Return the record of what was chosen for a scene's target error; none is needed without."""
    if "target_error" not in dataset.render:
        return []
    return f"{WORK}/{dataset.scene}/calibration.json"


def calibration(wildcards):
    """Return the record of a dataset's calibration, as `calibration_of` does."""
    return calibration_of(dataset_of(wildcards))


def calibration_words(wildcards, input):
    """Return the words that tell a program of a calibration, if there is one."""
    return f"--calibration {input.calibration}" if input.calibration else ""


def shard_minutes(wildcards):
    """Allow a shard several times its estimated time, and never less than half an hour."""
    dataset = dataset_of(wildcards)
    count = int(wildcards.end) - int(wildcards.first)
    seconds = (
        view_seconds(dataset) * expected_samples(dataset) / planned_samples(dataset)
    )
    return 30 + math.ceil(5 * count * seconds / 60)


def reprojection_of(wildcards):
    """Return a reprojection's settings, defaults filled in."""
    return dataset_of(wildcards).reprojections[wildcards.reprojection]


def optics(wildcards):
    """Return the words that tell scripts/reproject.py where each pixel comes from."""
    settings = reprojection_of(wildcards)
    words = ["--camera", json.dumps(settings["camera"]), "--filter", settings["filter"]]
    if settings["samples"] > 1:
        words += ["--samples", str(settings["samples"])]
    if any(settings["rotation"]):
        words += ["--rotation", ",".join(map(str, settings["rotation"]))]
    return shlex.join(words)


def development(wildcards):
    """Return the words that tell scripts/reproject.py what to write."""
    settings = reprojection_of(wildcards)
    words = [f"--{settings['format']}", "--exposure", str(settings["exposure"])]
    if "reinhard" in settings:
        words += ["--reinhard", str(settings["reinhard"])]
    return shlex.join(words)


def placement(wildcards):
    """Return the words that place a dataset in instant-ngp's unit cube."""
    export = dataset_of(wildcards).exports["instant_ngp"]
    words = []
    if "scale" in export:
        words += [
            "--scale",
            str(export["scale"]),
            "--offset",
            *map(str, export["offset"]),
        ]
    if "aabb_scale" in export:
        words += ["--aabb-scale", str(export["aabb_scale"])]
    if "evaluation_split" in dataset_of(wildcards).cameras:
        words.append("--split")
    return shlex.join(words)


@cache
def full_datasets(name):
    """Return a scene YAML's datasets at full size, by rig."""
    return {dataset.rig: dataset for dataset in scene_datasets(name, "full", {})}


def full_size(wildcards):
    """Return what the scene YAML says of a dataset's size, whatever the preset, as JSON.

    Samples and denoise are null where the YAML has a target error instead.
    """
    full = full_datasets(dataset_of(wildcards).name)[wildcards.rig]
    return json.dumps(
        {
            "views": full.view_count,
            "resolution": full.cameras["camera"]["resolution"],
            "samples": full.render.get("samples"),
            "denoise": full.render.get("denoise"),
        }
    )


def suffix(wildcards):
    """Return the suffix of a reprojection's images."""
    return f".{dataset_of(wildcards).reprojections[wildcards.reprojection]['format']}"


def reprojection_words(wildcards):
    """Return the words that name a dataset's reprojections."""
    words = [f"--reprojection {name}" for name in dataset_of(wildcards).reprojections]
    return " ".join(words)


def panorama_width(wildcards):
    """Give the panorama twice a 180 degree fisheye view's angular resolution, within 4096 pixels."""
    return min(4 * dataset_of(wildcards).cameras["camera"]["resolution"][0], 4096)


def failed_jobs():
    """Return rule and log of each job that failed; of a group's, of those that began in vain."""
    failed = [job for job in workflow.scheduler.failed if not job.is_group()]
    failed += [
        job
        for group in workflow.scheduler.failed
        if group.is_group()
        for job in group.jobs
        if Path(job.log[0]).exists() and not all(map(os.path.exists, job.output))
    ]
    return sorted((job.rule.name, Path(job.log[0])) for job in failed)


def drop_false_records():
    """Remove the record of every shard whose files are no longer those that it describes.

    Snakemake sees only whether a record is there. A view that was deleted or cut short shows in
    its size; its shard then runs again and makes what is missing. By the log of checksums beside the
    record it finds every other file that is not as it was made.
    """
    for dataset in DATASETS.values():
        folder = Path(RESULTS, dataset.scene, dataset.rig)
        for record in map(Path, all_records(dataset)):
            try:
                files = json.loads(record.read_text())["files"]
                whole = all(
                    (folder / name).stat().st_size == file["bytes"]
                    for name, file in files.items()
                )
            except FileNotFoundError:
                whole = not record.exists()
            except (ValueError, KeyError):
                whole = False
            if not whole:
                record.unlink()


def drop_false_checks():
    """Remove the proof of every .blend that is no longer the file that was checked."""
    for dataset in DATASETS.values():
        proof = Path(WORK, dataset.name, "blend.json")
        if "blend" not in dataset.source or not proof.exists():
            continue
        checked = json.loads(proof.read_text())
        try:
            found = Path(dataset.source["blend"]).stat()
        except FileNotFoundError:
            continue
        if (found.st_size, found.st_mtime_ns) != (
            checked["bytes"],
            checked["mtime_ns"],
        ):
            proof.unlink()


if workflow.is_main_process:
    drop_false_records()
    drop_false_checks()
