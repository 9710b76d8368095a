# The configuration, and where everything lies. Every path of the workflow comes from here.
import atexit
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from functools import cache
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
    shard_threads,
    temporary_bytes,
    view_cost,
)
from lightfield.workflow import ledger, presence, shard_counts
from lightfield.configuration.config_file import load_config
from lightfield.configuration.dataset_paths import PICTURES, PLOTS, Paths
from lightfield.configuration.dataset import Cluster
from lightfield.formats.export_lists import MANIFEST
from lightfield.configuration.exports import (
    SEQUENCE_EXPORTS,
)
from lightfield.stages import job_settings
from lightfield.workflow.build import Build, learned_exports, stage_of
from lightfield.workflow.shard_files import JOURNAL_SUFFIX
from lightfield.workflow.view_store import ViewStore
from lightfield.geometry.lenses.cube_map import CUBE_FACES

# The rigs in a config.yaml belong to the scenes in it. For other scenes, all rigs are chosen.
NAMING = GIVEN if "scenes" in GIVEN else OWN
if "scenes" in NAMING and "rigs" not in {*GIVEN, *NAMING}:
    config["rigs"] = "all"

# The cores of this machine, or of each job on a cluster.
ALL_CORES = CORES or 1

# On a cluster, shards are small, so that no job waits long for the last one.
CLUSTER = Cluster(jobs=NODES, cores=ALL_CORES) if NODES else None

try:
    SETTINGS = load_config(config)
    BUILD = Build.load(SETTINGS, CLUSTER)
    if IS_MAIN_PROCESS:
        for dataset in BUILD.chosen:
            presence.check_presence(dataset)
except UserError as error:
    sys.exit(f"error: {error}")

RESULTS = SETTINGS.results
WORK = SETTINGS.work
CHOSEN = BUILD.chosen
DATASETS = BUILD.datasets
CHOSEN_SCENES = list(dict.fromkeys(dataset.scene_name for dataset in CHOSEN))
# Imported scenes have only views.
RENDERED_SCENES = list(dict.fromkeys(d.scene_name for d in CHOSEN if not d.imported))

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


def asked(question, wildcards):
    """Return what a function of the build says of a job. Ends the run if it refuses the job."""
    try:
        return question(dict(wildcards.items()))
    except UserError as error:
        sys.exit(f"error: {error}")


def dataset_of(wildcards):
    """Return the dataset of a job's wildcards."""
    return asked(BUILD.dataset, wildcards)


def scene_of(wildcards):
    """Return any dataset of the scene of a job's wildcard."""
    return asked(BUILD.scene, wildcards)


def of_build(question):
    """Return an input function: it returns what a function of the build says of the job."""
    return of_each_shard(lambda wildcards: asked(question, wildcards))


def of_dataset(attribute):
    """Return an input function: it returns an attribute of the job's dataset.

    A file that the dataset lacks is an empty list.
    """
    return of_each_shard(
        lambda wildcards: getattr(dataset_of(wildcards), attribute) or []
    )


def of_first(attribute):
    """Return an input function: an attribute of the dataset whose views are the scene's probes."""
    return (
        lambda wildcards: getattr(BUILD.first_of_scene(wildcards.scene), attribute)
        or []
    )


def optional(*names, **flags):
    """Return a params function: it returns the flags of the optional inputs that exist.

    An input's flag has the input's name, unless ``flags`` gives another.
    """
    flags |= dict(zip(names, names))

    def arguments(wildcards, input):
        given = [
            (flag, input.get(name)) for flag, name in flags.items() if input.get(name)
        ]
        return shlex.join(
            word for flag, path in given for word in (f"--{flag}", str(path))
        )

    return arguments
