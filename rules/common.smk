# The configuration, and where everything lies. Every path of the workflow comes from here.
import atexit
import difflib
import inspect
import json
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path

# From the folder that Snakemake works in, which may be a user's own; as commands have them.
SCRIPTS = shlex.quote(os.path.relpath(FOLDER / "scripts"))
BENCHMARKS = shlex.quote(os.path.relpath(FOLDER / "benchmarks"))

from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo

from lightfield.core import leftovers, processors, room
from lightfield.core.failures import (
    batch_log,
    cause,
    failure_report,
    first_sentence,
    is_newer,
)
from lightfield.core.gpus import visible
from lightfield.core.memory import available
from lightfield.dataset import journal, ledger, memory, shard_counts
from lightfield.dataset.config import accept_blend, load_config, load_scene, scene_path
from lightfield.dataset.dataset import (
    MOST_SHARDS,
    PICTURES,
    PLOTS,
    SOURCE_KEYS,
    check_presence,
    load_datasets,
    scene_datasets,
)
from lightfield.dataset.exports import MANIFEST, VIEWS
from lightfield.dataset.shard_files import JOURNAL_SUFFIX
from lightfield.dataset.splits import SPLITS
from lightfield.dataset.view_store import VARIABLE, ViewStore
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.rigs import Poses

# Where machines see no common folder: what is declared lies in Snakemake's own storage there, and
# views in the view store.
STORE = workflow.storage_settings.default_storage_prefix or ""
# A prefix takes the place of Snakemake's own, strict mode and all. The rules call `python`: let
# that be the one that runs Snakemake, and a signal that ends it be named in the job's log.
shell.prefix(
    f"set -euo pipefail; export {VARIABLE}={shlex.quote(STORE)};"
    f" export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH;"
    ' python() {{ command python "$@" || {{ local status=$?; if ((status > 128)); then'
    ' echo "error: killed by SIG$(kill -l $status)" >&2; fi; return $status; }}; }}; '
)

# The rigs that a config.yaml names are those of the scene that it names.
NAMING = GIVEN if "scenes" in GIVEN else OWN
if "scenes" in NAMING and "rigs" not in {*GIVEN, *NAMING}:
    config["rigs"] = "all"

# Locally, without --cores and --jobs, all that this process may use.
if (workflow.resource_settings.cores, workflow.resource_settings.nodes) == (None, None):
    workflow.resource_settings.cores = processors.available()
    workflow.register_resource("_cores", processors.available())

# On a cluster at least one for each job that runs at once, and none waits long for the last.
if workflow.resource_settings.nodes:
    config.setdefault(
        "most_shards", max(64, min(workflow.resource_settings.nodes, MOST_SHARDS))
    )
    config.setdefault("shard_minutes", 20 * (workflow.resource_settings.cores or 1))

try:
    SETTINGS = load_config(config)
    CHOSEN = load_datasets(SETTINGS)
    if workflow.is_main_process:
        for dataset in CHOSEN:
            check_presence(dataset)
    WHOLE = load_datasets(SETTINGS.model_copy(update={"rigs": "all"}))
    SMOKE = scene_datasets("smoke", settings=SETTINGS)
except UserError as error:
    sys.exit(f"error: {error}")

CHOSEN_SCENES = list(dict.fromkeys(dataset.scene_name for dataset in CHOSEN))
# Of the others there are views alone.
RENDERED_SCENES = list(dict.fromkeys(d.scene_name for d in CHOSEN if not d.imported))
RESULTS = SETTINGS.results
WORK = SETTINGS.work
# Those that are not chosen may test what is trained on the chosen ones.
DATASETS = {dataset.name: dataset for dataset in [*SMOKE, *WHOLE]}
# Any dataset of each scene YAML: all of them have the same .blend.
SCENES = {dataset.scene_name: dataset for dataset in DATASETS.values()}

# The scenes that are somebody else's views, as a wildcard's constraint; "(?!)" matches nothing.
IMPORTED = "|".join({d.scene_folder for d in DATASETS.values() if d.imported}) or "(?!)"

# Snakemake sets this up by itself if it is run with --software-deployment-method conda.
ENVIRONMENT = "../envs/environment.yaml"

# `folder` and `work` of a Dataset, with wildcards.
DATASET = f"{RESULTS}/{{scene}}/{{rig}}"
MADE = f"{WORK}/{{scene}}/{{rig}}"
PANORAMA = f"{MADE}/panorama"
REPROJECTED = f"{DATASET}/{{reprojection}}"
# Of a cube map each face has one, with _f, _b, … before the suffix.
LENS_MAP = f"{MADE}/{{reprojection}}/lens_map.npy"
LEDGER = f"{WORK}/{ledger.NAME}"
# Where damaged files are moved to, so that nobody loses anything.
REMOVED = f"{WORK}/removed"
SHARDS = f"{WORK}/{shard_counts.NAME}"
MEMORY = available()
# One for each render, and as many renders at once as this machine has GPUs; nodes count their own.
LOCAL_GPUS = visible() if workflow.local_exec and SETTINGS.device != "cpu" else []
if workflow.local_exec and "gpu" not in workflow.global_resources:
    workflow.register_resource("gpu", max(1, len(LOCAL_GPUS)))
# Left out where it is none, unless a submit command needs the number.
DEFAULT_GPUS = (
    0 if "gpu" in (workflow.resource_settings.default_resources or ()) else None
)
GPUS = 1 if LOCAL_GPUS or SETTINGS.device not in ("auto", "cpu") else DEFAULT_GPUS


wildcard_constraints:
    name="[A-Za-z0-9_-]+",
    scene="[A-Za-z0-9_-]+",
    # A sequence's datasets lie a folder deeper, one for each frame.
    rig=r"[A-Za-z0-9_.-]+(/f\d{5,7})?",
    # The records of the views lie beside those of the reprojections.
    reprojection=r"(?!f\d{5,7}/|flow/|render/)[A-Za-z0-9_.-]+",
    # Of an export: nothing for the views, or a reprojection's name and a slash.
    source=r"((?!f\d{5,7}/)[A-Za-z0-9_.-]+/)?",
    format="[a-z_]+",
    first=r"\d+",
    end=r"\d+",


# Where these rules are a module of another workflow, that may have given them other names.
RENDER, RENDER_PANORAMA, CALIBRATE, CHECK_GPU = map(
    workflow.modifier.modify_rulename,
    ("render", "render_panorama", "calibrate", "check_gpu"),
)


def own(jobs):
    """Return those jobs that are of these rules: another workflow may have some of its own."""
    jobs = [job for job in jobs if not job.is_group()]
    return [job for job in jobs if Path(job.rule.snakefile).is_relative_to(FOLDER)]


def needed_jobs():
    """Return the jobs of these rules that this run needs, those that are finished too."""
    return own(workflow.dag.needrun_jobs(exclude_finished=False))


def log_of(job):
    """Return the log of a job; ``job`` is its path, with wildcards."""
    return f"{WORK}/logs/{job}.log"


def times_of(job):
    """Return where Snakemake notes what a job has taken."""
    return f"{WORK}/benchmarks/{job}.tsv"


def one_of(known, name, folder, kind):
    """Return what has a name, which is in a file's path; ends the run where nothing has."""
    if name not in known:
        near = " or ".join(difflib.get_close_matches(name, known))
        hint = f"; is {near} meant?" if near else ""
        sys.exit(f"error: {folder}/{name}: no {kind}{hint}")
    return known[name]


def dataset_of(wildcards):
    """Return the dataset that a job's wildcards mean."""
    name = f"{wildcards.scene}/{wildcards.rig}"
    return one_of(DATASETS, name, RESULTS, "dataset of the chosen scenes")


def scene_of(wildcards):
    """Return any dataset of the scene that a job's wildcard means."""
    return one_of(SCENES, wildcards.name, WORK, "chosen scene")


def reprojection_of(wildcards):
    """Return the reprojection that a job's wildcards mean; None of the views themselves."""
    dataset, name = dataset_of(wildcards), stage_of(wildcards)
    if name == "render":
        return None
    return one_of(dataset.reprojections, name, dataset.folder, "reprojection of it")


def export_of(wildcards):
    """Return what an export's job is asked for."""
    dataset, name = dataset_of(wildcards), wildcards.format
    folder = f"{dataset.folder}/exports"
    return one_of(dataset.exports.wanted, name, folder, "export of it")


def of_each_shard(function):
    """Return a function of a rule, whose parameters Snakemake need not work out at each call.

    It calls these for each shard several times; a plan of 2,000 shards takes a second less.
    """
    function.__signature__ = inspect.signature(function)
    return function


def of_dataset(attribute):
    """Return the function by which a rule asks for an attribute of its dataset."""
    return of_each_shard(lambda wildcards: getattr(dataset_of(wildcards), attribute))


def stage_of(wildcards):
    """Return the stage at which a job makes or reads views."""
    source = wildcards.get("source", "").rstrip("/")
    return wildcards.get("reprojection", source or "render")


def records(wildcards):
    """Return the records of the shards whose views a job reads."""
    return dataset_of(wildcards).records(stage_of(wildcards))


@of_each_shard
def shard_threads(wildcards):
    """Give each shard so many cores that what runs at once fits this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = dataset_of(wildcards).view_memory_bytes
    return memory.threads(workflow.cores or 1, shards, need, MEMORY)


@of_each_shard
def shard_memory(wildcards, attempt):
    """Ask for the memory in MB that a shard takes, and for more where that was too little."""
    return math.ceil(dataset_of(wildcards).view_memory_bytes / 1e6) * attempt


def panorama_memory(wildcards, attempt):
    """Ask for the same for the panorama."""
    dataset = dataset_of(wildcards)
    need = dataset.memory_bytes(dataset.panorama_width**2 // 2)
    return math.ceil(need / 1e6) * attempt


@of_each_shard
def shard_minutes(wildcards):
    """Allow a shard several times its estimated time, and never less than half an hour."""
    views = int(wildcards.end) - int(wildcards.first)
    seconds = views * dataset_of(wildcards).expected_view[0]
    return 30 + math.ceil(5 * seconds / 60)


@of_each_shard
def stall_seconds(wildcards):
    """Return after how long a view is taken to hang: ten times what one core needs, and more.

    On this machine, where a build may be stopped and continued by hand, none is.
    """
    seconds = dataset_of(wildcards).expected_view[0]
    return 1800 + math.ceil(10 * seconds) if workflow.remote_exec else 0


@cache
def failing_nodes(record, attempt):
    """Return the nodes that a shard avoids, by the journals of it and its dataset's others.

    In the first attempt, in which there may be thousands of shards, of the others' alone.
    """
    folder = Path(record).parent
    own = Path(record).with_suffix(JOURNAL_SUFFIX)
    others = {**journals(folder, time.monotonic() // JOURNALS_AGE)}
    others.pop(own, None)
    shard = journal.read(own) if attempt > 1 and own.exists() else []
    return journal.avoided(shard, others.values())


# Seconds: where a thousand shards fail at once, not each of them reads all journals.
JOURNALS_AGE = 60


@lru_cache(maxsize=8)
def journals(folder, _period):
    """Return the runs in each journal of a folder, as they were some time in a period."""
    return {path: journal.read(path) for path in folder.glob(journal.JOURNALS)}


@of_each_shard
def avoided_nodes(wildcards, attempt):
    """Return the words by which Slurm leaves out the nodes that a shard avoids, and the user's."""
    given = workflow.resource_settings._parsed_default_resources.get("slurm_extra")
    # Snakemake has one without a text where none is given.
    words = [given.raw.strip("'\"")] if given and given.raw else []
    if not workflow.local_exec:
        dataset = dataset_of(wildcards)
        bounds = (wildcards.first, wildcards.end) if attempt > 1 else (0, 0)
        nodes = failing_nodes(dataset.record("render", *bounds), attempt)
        words += [f"--exclude={','.join(nodes)}"] if nodes else []
    # Of a group's jobs Slurm's executor takes no None.
    return " ".join(words)


@cache
def full_datasets(name):
    """Return a scene YAML's datasets at full size, by rig."""
    return {dataset.rig_folder: dataset for dataset in scene_datasets(name)}


def full_size(dataset):
    """Return what the scene YAML says of a dataset's size, whatever the preset.

    Without samples and denoise where the YAML has a target error instead, or there is no render.
    """
    full = full_datasets(dataset.scene_name)[dataset.rig_folder]
    settings = {key: full.render.get(key) for key in ("samples", "denoise")}
    return {
        "views": full.view_count,
        "resolution": full.rig.camera.resolution,
        **{key: value for key, value in settings.items() if value is not None},
    }


def full_sizes(wildcards):
    """Return the views and the resolution of each rig of a scene at full size, as JSON."""
    return json.dumps(
        {
            name: {
                "views": dataset.view_count,
                "resolution": dataset.rig.camera.resolution,
            }
            for name, dataset in full_datasets(wildcards.scene).items()
        }
    )


def status_words():
    """Return the words that name each chosen dataset to scripts/status.py."""
    words = []
    for dataset in CHOSEN:
        reprojections = ",".join(dataset.reprojections)
        words += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
    return shlex.join(words)


def packed(wildcards):
    """Return the datasets in an archive: a rig's, or one of each frame."""
    rigs = {}
    for dataset in DATASETS.values():
        name = f"{dataset.scene_folder}/{dataset.rig_name}"
        rigs.setdefault(name, []).append(dataset)
    name = f"{wildcards.scene}/{wildcards.rig}"
    return one_of(rigs, name, RESULTS, "dataset of the chosen scenes")


def packed_sums(wildcards):
    """Return the checksums that say that everything in an archive is finished.

    With a store also what is in it, and what lists it.
    """
    datasets = packed(wildcards)
    files = [f"{dataset.folder}/sha256sums.txt" for dataset in datasets]
    if STORE:
        for dataset in datasets:
            files += [f"{dataset.folder}/validation.json", *dataset.published]
            files += dataset.all_records
    return files


def packed_scene(wildcards):
    """Return the name of an archive's scene YAML."""
    return packed(wildcards)[0].scene_name


def probes():
    """Return name, number of frames, and probe of each chosen rig: a sequence's first frame's."""
    frames = {}
    for dataset in CHOSEN:
        if not dataset.imported:
            frames.setdefault((dataset.scene_folder, dataset.rig_name), []).append(
                dataset
            )
    return [
        (f"{scene}/{rig}", len(datasets), f"{datasets[0].work}/probe.json")
        for (scene, rig), datasets in frames.items()
    ]


def advice_words():
    """Return the words that name to scripts/plan.py what `snakemake advise` has found."""
    files = {
        f"{d.scene_folder}/{d.rig_name}": f"{RESULTS}/benchmarks/advise/{d.scene_name}.json"
        for d in CHOSEN
    }
    there = [(name, file) for name, file in files.items() if Path(file).exists()]
    return shlex.join(word for pair in there for word in ("--advice", *pair))


def measurements(wildcards):
    """Return the files of those measurements of interest to a dataset that have been made.

    They are no input, for a page must never start a measurement: that takes an hour.
    """
    dataset = dataset_of(wildcards)
    stems = ["reprojection", "stability", f"error_vs_time/{dataset.scene_name}"]
    for kind in ("synthesis", "learn"):
        stems.append(f"{kind}/{dataset.scene_folder}/{dataset.rig_folder}")
    files = [
        Path(RESULTS, "benchmarks", f"{stem}{suffix}")
        for stem in stems
        for suffix in (".csv", ".json", ".svg", ".png")
    ]
    return [file for file in files if file.exists()]


def rebuilding(wildcards):
    """Return the command that makes a dataset, to be shown on its page."""
    dataset = dataset_of(wildcards)
    snakefile = os.path.relpath(FOLDER / "Snakefile")
    words = [] if snakefile == "Snakefile" else ["-s", snakefile]
    choice = [f"scenes={dataset.scene_name}", f"rigs={dataset.rig_name}"]
    words += ["--cores", "all", "--config", *choice, f"preset={dataset.preset}"]
    return shlex.join(["snakemake", *words])


def reach(dataset):
    """Return how far a rig's cameras are from their middle, in metres."""
    places = [pose.position for pose in dataset.rig.poses()]
    middle = [sum(axis) / len(places) for axis in zip(*places)]
    return max(math.dist(place, middle) for place in places)


def held_out(dataset):
    """Return the scene's chosen datasets whose cameras are all nearer together than a light field's.

    A rig whose cameras span no surface has nothing between them.
    """
    if dataset.rig.cells() is None:
        return []
    return [
        other
        for other in CHOSEN
        if other.scene_folder == dataset.scene_folder
        and other.rig.cells() is not None
        and reach(other) < reach(dataset)
    ]


def truth_words(wildcards):
    """Return the words that name the datasets with which synthesised views are compared."""
    truths = held_out(dataset_of(wildcards))
    return (
        shlex.join(["--truth", *(truth.folder for truth in truths)]) if truths else ""
    )


def truth_records(wildcards):
    """Return the records of those datasets' views."""
    truths = held_out(dataset_of(wildcards))
    return [record for truth in truths for record in truth.records("render")]


@cache
def first_dataset(folder):
    """Return the dataset of a scene's first rig, whose views are its probes.

    A folder that is not being built is a scene's name, which means the scene at full size.
    """
    for dataset in DATASETS.values():
        if dataset.scene_folder == folder:
            name, preset = dataset.scene_name, dataset.preset
            return scene_datasets(name, preset, dataset.limits, SETTINGS)[0]
    return scene_datasets(folder, settings=SETTINGS)[0]


def of_first(attribute):
    """Return the function by which a rule asks for an attribute of that dataset."""
    return lambda wildcards: getattr(first_dataset(wildcards.scene), attribute)


def optional(*names, **flags):
    """Return the function by which a rule names to its program inputs that there may be.

    Each has a flag of its own name, or the one that is given.
    """
    flags |= dict(zip(names, names))

    def words(wildcards, input):
        given = [(flag, input[name]) for flag, name in flags.items() if input[name]]
        return shlex.join(
            word for flag, path in given for word in (f"--{flag}", str(path))
        )

    return words


def lens_maps_of(wildcards):
    """Return the lens maps of a reprojection; none of what is not one."""
    dataset, name = dataset_of(wildcards), wildcards.reprojection
    return dataset.lens_maps(name) if name in dataset.reprojections else []


def of_reprojection(attribute):
    """Return the function by which a rule asks for an attribute of its reprojection."""
    return lambda wildcards: getattr(reprojection_of(wildcards), attribute)


def reprojection_words(wildcards):
    """Return the words that name a dataset's reprojections."""
    words = [f"--reprojection {name}" for name in dataset_of(wildcards).reprojections]
    return " ".join(words)


def instant_ngp_words(wildcards, input):
    """Return the words that say to scripts/export_instant_ngp.py from what it writes, and what."""
    dataset, reprojection = dataset_of(wildcards), reprojection_of(wildcards)
    words = ["--image-suffix", reprojection.suffix if reprojection else ".exr"]
    if not reprojection:
        words += ["--image-dir", f"{dataset.folder}/exr"]
    if dataset.exports.instant_ngp:
        folder = Path(dataset.folder, wildcards.source)
        words += dataset.exports.instant_ngp.words(str(folder))
    if input.trained:
        words += ["--placed-as", str(input.trained)]
    return shlex.join(words)


def export_words(wildcards):
    """Return the words that say to scripts/export.py from what it exports, and how."""
    dataset = dataset_of(wildcards)
    reprojection = reprojection_of(wildcards)
    suffix = reprojection.suffix if reprojection else ".exr"
    options = export_of(wildcards).model_dump_json(
        exclude_unset=True, exclude={"sources"}
    )
    name = wildcards.source.rstrip("/") or VIEWS
    words = ["--source", name, "--suffix", suffix, "--options", options]
    for other in tested_by(wildcards):
        words += ["--tested-by", other.rig_name, other.folder]
    return shlex.join(words)


def tested_by(wildcards):
    """Return the datasets whose views go into an export of this one, to test with."""
    dataset = dataset_of(wildcards)
    rigs = dataset.tested_by if export_of(wildcards).is_for_training else ()
    return [DATASETS[f"{dataset.scene_folder}/{rig}"] for rig in rigs]


def learned_from(dataset):
    """Return the manifests of a dataset's exports with depth that benchmarks/learn.py reads."""
    wanted = dataset.exports.nerfstudio
    files = dataset.exported if wanted and wanted.depth else []
    return [path for path in files if path.endswith(f"exports/nerfstudio/{MANIFEST}")]


def exported_views(wildcards):
    """Return what an export reads: the views of its dataset and of those that test it.

    Points are lifted from the depth of the rendered views, whatever the source.
    """
    dataset = dataset_of(wildcards)
    files = [*dataset.records("render"), *records(wildcards)]
    for other in tested_by(wildcards):
        files += [*other.records("render"), *other.records(stage_of(wildcards))]
        files += [
            f"{other.folder}/{name}lightfield.json" for name in ("", wildcards.source)
        ]
    return list(dict.fromkeys(files))


def trained_by(wildcards):
    """Return the transforms.json, if any, of what is trained on and tested by this dataset."""
    dataset = dataset_of(wildcards)
    if dataset.trained_by is None:
        return []
    folder = f"{RESULTS}/{dataset.scene_folder}/{dataset.trained_by}"
    return f"{folder}/{wildcards.source}transforms.json"


def check_device():
    """Refuse a device that is not there before the first job, where renders are for this machine.

    Raises `UserError`.
    """
    jobs = needed_jobs()
    device = SETTINGS.device
    if device == "auto" and any(job.rule.name == CHECK_GPU for job in jobs):
        device = "gpu"
    renders = device == "gpu" or any(job.resources.get("gpu") for job in jobs)
    if renders and workflow.local_exec:
        words = [sys.executable, FOLDER / "scripts/check_device.py", device]
        checked = subprocess.run(words, capture_output=True, text=True)
        if checked.returncode:
            *_, problem = checked.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(problem.removeprefix("error: "))


def check_room():
    """Compare the room on the disks with what this run writes, and warn; raises `UserError`."""
    jobs = [job for job in needed_jobs() if job.rule.name == RENDER]
    datasets = {d.folder: d for d in (dataset_of(job.wildcards) for job in jobs)}
    needs = [(Path(RESULTS), d.missing_bytes) for d in datasets.values()]
    # A built scene, at most.
    needs += [(Path(WORK), 1e8) for _ in {d.scene_name for d in datasets.values()}]
    if jobs and workflow.local_exec:
        # What renders at once writes each its view as Cycles has it: in memory if there is room.
        pixels = max(math.prod(d.rig.camera.resolution) for d in datasets.values())
        at_once = min(len(jobs), max(1, workflow.cores // jobs[0].threads))
        size = at_once * pixels * memory.PASSES_PIXEL_BYTES
        if not room.fast_folder(size):
            needs.append((Path(tempfile.gettempdir()), size))
    for warning in room.check(needs):
        print(f"warning: {warning}", file=sys.stderr)


def keep_shards():
    """Note the shards of the datasets of which this run renders some: they keep these."""
    jobs = [job for job in needed_jobs() if job.rule.name == RENDER]
    datasets = {d.name: d for d in (dataset_of(job.wildcards) for job in jobs)}
    counts = {name: (d.view_count, len(d.shards)) for name, d in datasets.items()}
    if counts:
        shard_counts.note(WORK, counts)
        if STORE:
            ViewStore(STORE).send(SHARDS)


def remove_leftovers():
    """Remove what killed runs have left, and say so."""
    removed = leftovers.remove(map(Path, (RESULTS, WORK)))
    if removed:
        print(
            f"removed {len(removed)} files and folders that killed runs have left",
            file=sys.stderr,
        )


# What the executor said of a job or group that failed.
SAID = {}


def note_failures():
    """Note what the executor says of jobs that fail, as that they were refused.

    Snakemake keeps it from the log of a group; and of a group that it does not even submit, as with
    an account that there is not, Slurm's executor reports nothing, and would wait for ever.
    """
    executor = workflow.scheduler._executor
    forward, run_job = executor.report_job_error, executor.run_job

    def noting(job_info, msg=None, **words):
        SAID[job_info.job] = msg
        forward(job_info, msg=msg, **words)

    def running(job):
        try:
            run_job(job)
        except AttributeError as error:
            if not (job.is_group() and error.__context__):
                raise
            noting(SubmittedJobInfo(job), f"not submitted: {error.__context__}")

    executor.report_job_error, executor.run_job = noting, running


def failed_jobs(failed):
    """Return rule, cause and log of each of these jobs; of a group's, of those that said why.

    Of a job that said nothing, as one that never began, it is the batch system's log, if there is,
    or else what the executor said.
    """
    found = []
    # Clocks of nodes differ.
    start = workflow.start_time.timestamp() - 5
    for one in failed:
        jobs = own([one])
        if one.is_group():
            jobs = [
                job for job in own(one.jobs) if not all(map(os.path.exists, job.output))
            ]
        logs = [(job.rule.name, Path(job.log[0])) for job in jobs]
        for _, log in logs if STORE else ():
            name = os.path.relpath(log, stored(WORK))
            ViewStore(STORE).bring(f"{WORK}/{name}")
        spoke = [(name, cause(log), log) for name, log in logs if is_newer(log, start)]
        spoke = [(name, why, log) for name, why, log in spoke if why]
        if logs and not spoke:
            name, log = min(logs)
            batch = batch_log(one.name, start)
            why = batch and cause(batch) or first_sentence(SAID.get(one) or "")
            spoke = [(name, why or "it said nothing", batch or log)]
        found += spoke
    return sorted(found)
