# The configuration, and where everything lies. Every path of the workflow comes from here.
import atexit
import difflib
import json
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from functools import cache
from importlib.metadata import version
from pathlib import Path

# Relative to Snakemake's folder, which may be a user's own, and quoted for commands.
SCRIPTS = shlex.quote(os.path.relpath(FOLDER / "scripts"))
BENCHMARKS = shlex.quote(os.path.relpath(FOLDER / "benchmarks"))

from lightfield.core import disk_space, leftovers, units
from lightfield.workflow.failures import (
    batch_log,
    cause,
    failure_report,
    first_sentence,
    is_newer,
)
from lightfield.core.gpus import visible
from lightfield.core.memory import available
from lightfield.planning.cost import (
    STAGES,
    Cost,
    cost,
    light_group_count,
    members_cost,
    shard_threads,
    temporary_bytes,
    view_cost,
)
from lightfield.workflow import ledger, presence, shard_counts
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.scene_yaml import load_scene, scene_content, scene_path
from lightfield.configuration.config_file import load_config
from lightfield.configuration.dataset_paths import PICTURES, PLOTS, Paths
from lightfield.configuration.dataset import Cluster
from lightfield.formats.export_lists import MANIFEST
from lightfield.configuration.exports import (
    SEQUENCE_EXPORTS,
    InstantNgp,
    export_settings_of,
)
from lightfield.core.names import MESH, VIEWS
from lightfield.stages.checks import SequenceValidationSettings, ValidationSettings
from lightfield.stages.exports import MeshSettings
from lightfield.stages.measurement import SynthesisSettings
from lightfield.stages.publishing import PackSettings
from lightfield.stages.report import FiguresSettings, Measurement, PageSettings
from lightfield.stages.rig import FreePlacesSettings
from lightfield.stages.scene import BuildSettings, ImportSettings
from lightfield.workflow.loading import (
    chosen_families,
    family_folder,
    load_datasets,
    rendered_frames,
    scene_datasets,
)
from lightfield.workflow.shard_files import JOURNAL_SUFFIX
from lightfield.workflow.view_store import ViewStore
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.rigs import Poses

# The rigs in a config.yaml belong to the scenes in it. For other scenes, all rigs are chosen.
NAMING = GIVEN if "scenes" in GIVEN else OWN
if "scenes" in NAMING and "rigs" not in {*GIVEN, *NAMING}:
    config["rigs"] = "all"

# On a cluster, shards are small, so that no job waits long for the last one.
CLUSTER = Cluster(jobs=NODES, cores=CORES or 1) if NODES else None

try:
    SETTINGS = load_config(config)
    CHOSEN = load_datasets(SETTINGS, CLUSTER)
    FAMILIES = chosen_families(SETTINGS)
    if IS_MAIN_PROCESS:
        for dataset in CHOSEN:
            presence.check_presence(dataset)
    WHOLE = load_datasets(SETTINGS.model_copy(update={"rigs": "all"}), CLUSTER)
    SMOKE = scene_datasets("smoke", settings=SETTINGS, cluster=CLUSTER)
except UserError as error:
    sys.exit(f"error: {error}")

CHOSEN_SCENES = list(dict.fromkeys(dataset.scene_name for dataset in CHOSEN))
# Imported scenes have only views.
RENDERED_SCENES = list(dict.fromkeys(d.scene_name for d in CHOSEN if not d.imported))
RESULTS = SETTINGS.results
WORK = SETTINGS.work
# Also datasets that are not chosen: they may test what is trained on the chosen ones.
DATASETS = {dataset.name: dataset for dataset in [*SMOKE, *WHOLE]}
# Any dataset of each scene YAML: all of them have the same .blend.
SCENES = {dataset.scene_name: dataset for dataset in DATASETS.values()}

# The imported scenes, as a wildcard's constraint. "(?!)" matches nothing.
IMPORTED = "|".join({d.scene_folder for d in DATASETS.values() if d.imported}) or "(?!)"

# The rigs with exports of a whole sequence, as a wildcard's constraint on the start of a path.
SEQUENCES = (
    "|".join(
        {
            re.escape(f"{d.scene_folder}/{d.rig_name}")
            for d in DATASETS.values()
            if d.sequence_exports
        }
    )
    or "(?!)"
)

# The paths of a dataset, with wildcards.
PATHS = Paths(RESULTS, WORK)
LEDGER = f"{WORK}/{ledger.NAME}"
# Damaged files are moved here, so that nobody loses anything.
REMOVED = f"{WORK}/removed"
SHARDS = f"{WORK}/{shard_counts.NAME}"
MEMORY = available()
# Each render takes a GPU, so as many renders run at once as there are GPUs. Nodes count their own.
LOCAL_GPUS = visible() if RUNS_HERE and SETTINGS.device != "cpu" else []
if RUNS_HERE:
    limit_resource("gpu", max(1, len(LOCAL_GPUS)))
# Without GPUs the resource is left out, unless a submit command needs the number.
DEFAULT_GPUS = 0 if ASKS_FOR_GPUS else None
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
    format="[a-z0-9_]+",
    first=r"\d+",
    end=r"\d+",


def is_of(job, *names):
    """Return whether a job's rule is one of these. A workflow that has them as a module may rename it."""
    return job.rule.name in {getattr(rules, name).rule.name for name in names}


def log_of(job):
    """Return the log of a job. ``job`` is its path, with wildcards."""
    return f"{WORK}/logs/{job}.log"


def times_of(job):
    """Return the TSV in which Snakemake writes a job's time and memory."""
    return f"{WORK}/benchmarks/{job}.tsv"


def one_of(by_name, name, folder, kind):
    """Return the entry with a name from a file's path. Ends the run if there is none."""
    if name not in by_name:
        near = " or ".join(difflib.get_close_matches(name, by_name))
        hint = f"; is {near} meant?" if near else ""
        sys.exit(f"error: {folder}/{name}: no {kind}{hint}")
    return by_name[name]


def dataset_of(wildcards):
    """Return the dataset of a job's wildcards."""
    name = f"{wildcards.scene}/{wildcards.rig}"
    return one_of(DATASETS, name, RESULTS, "dataset of the chosen scenes")


def scene_of(wildcards):
    """Return any dataset of the scene of a job's wildcard."""
    return one_of(SCENES, wildcards.name, WORK, "chosen scene")


def reprojection_of(wildcards):
    """Return the reprojection of a job's wildcards. None for the views themselves."""
    dataset, name = dataset_of(wildcards), stage_of(wildcards)
    if name == "render":
        return None
    return one_of(
        dataset.reprojections, name, dataset.paths.folder, "reprojection of it"
    )


def of_dataset(attribute):
    """Return an input function: it returns an attribute of the job's dataset.

    A file that the dataset lacks is an empty list.
    """
    return of_each_shard(
        lambda wildcards: getattr(dataset_of(wildcards), attribute) or []
    )


def stage_of(wildcards):
    """Return the stage whose views a job makes or reads."""
    source = wildcards.get("source", "").rstrip("/")
    return wildcards.get("reprojection", source or "render")


def records(wildcards):
    """Return the records of the shards whose views a job reads."""
    return dataset_of(wildcards).records(stage_of(wildcards))


def optional(*names, **flags):
    """Return a params function: it returns the flags of the optional inputs that exist.

    An input's flag has the input's name, unless ``flags`` gives another.
    """
    flags |= dict(zip(names, names))

    def arguments(wildcards, input):
        given = [(flag, input[name]) for flag, name in flags.items() if input[name]]
        return shlex.join(
            word for flag, path in given for word in (f"--{flag}", str(path))
        )

    return arguments
