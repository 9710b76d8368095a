# The configuration, and where everything lies. Every path of the workflow comes from here.
import os
import re
import shlex
import sys
from operator import attrgetter

from lightfield.configuration.config_file import load_config, with_lines
from lightfield.configuration.dataset import Cluster
from lightfield.configuration.dataset_paths import Paths
from lightfield.core import gpus
from lightfield.core.errors import UserError
from lightfield.core.memory import available
from lightfield.workflow import presence
from lightfield.workflow.build import Build

# Relative to Snakemake's folder, which may be a user's own, and quoted for commands.
SCRIPTS = shlex.quote(os.path.relpath(FOLDER / "scripts"))
BENCHMARKS = shlex.quote(os.path.relpath(FOLDER / "benchmarks"))


# The rigs in a config.yaml belong to the scenes in it. For other scenes, all rigs are chosen.
CHOOSING_KEYS = GIVEN_KEYS if "scenes" in GIVEN_KEYS else USER_CONFIG
if "scenes" in CHOOSING_KEYS and "rigs" not in {*GIVEN_KEYS, *CHOOSING_KEYS}:
    config["rigs"] = "all"

# The cores of this machine, or of each job on a cluster.
try:
    ALL_CORES = workflow.cores
except Exception:
    # Commands that run no job, such as --summary, need no --cores.
    ALL_CORES = 1

try:
    SETTINGS = load_config(config)
    # On a cluster, shards are small, so that no job waits long for the last one.
    CLUSTER = (
        Cluster(jobs=SETTINGS.cluster_jobs, cores=ALL_CORES)
        if SETTINGS.cluster_jobs
        else None
    )
    BUILD = Build.load(SETTINGS, CLUSTER)
    if IS_MAIN_PROCESS:
        presence.check_notes(Path(".snakemake/metadata"))
        for dataset in BUILD.chosen:
            presence.check_presence(dataset)
        for name, family in BUILD.families.items():
            presence.check_lights(name, family)
except UserError as error:
    sys.exit(f"error: {with_lines(str(error), CONFIG_FILES, GIVEN_KEYS)}")


def config_mistake(problem):
    """Return the error for a mistake in config.yaml, with the line of the problem's key."""
    return UserError(with_lines(f"config.yaml: {problem}", CONFIG_FILES, GIVEN_KEYS))


# Where the storage of jobs without a common folder is. Empty if they have one.
STORE = SETTINGS.storage
RUNS_HERE = not CLUSTER
RESULTS = SETTINGS.results
WORK = SETTINGS.work
CHOSEN_DATASETS = BUILD.chosen
DATASETS = BUILD.datasets
# Imported scenes have only views.
RENDERED_SCENES = list(
    dict.fromkeys(d.scene_name for d in CHOSEN_DATASETS if not d.imported)
)

# The paths of a dataset, with wildcards.
PATHS = Paths(RESULTS, WORK)
# Damaged files are moved here, so that nobody loses anything.
REMOVED = f"{WORK}/removed"
MEMORY = available()
# Each render takes a GPU, and waits until one is free. Nodes count their own.
LOCAL_GPUS = gpus.visible(SETTINGS.device) if RUNS_HERE else []
GPUS = 1 if LOCAL_GPUS or SETTINGS.device not in ("auto", "cpu") else 0
# Without GPUS the resource is left out, so that a profile's default counts.
GPU = {"gpu": GPUS} if GPUS else {}


def one_of(names):
    """Return the wildcard's constraint that matches these names, or nothing without any."""
    return "|".join(sorted(map(re.escape, names))) or "(?!)"


# Only the datasets tell whether a path is a rig with frames, or a dataset without. So these are
# constraints on both wildcards, written at ``scene``. A ruleorder comes too late for this:
# Snakemake first asks for the inputs of every rule that matches, and one of them would refuse.
SEQUENCES = one_of({d.sequence_name for d in DATASETS.values() if d.sequence_exports})
SCENE_OF_SEQUENCE = rf"(?=(?:{SEQUENCES})/[^/]+$)[A-Za-z0-9_-]+"
SCENE_OF_DATASET = rf"(?!(?:{SEQUENCES})/[^/]+$)[A-Za-z0-9_-]+"


CONSTRAINTS = {
    "name": "[A-Za-z0-9_-]+",
    "scene": "[A-Za-z0-9_-]+",
    # A sequence's datasets lie a folder deeper, one for each frame.
    "rig": r"[A-Za-z0-9_.-]+(/f\d{5,7})?",
    # The receipts of the views lie beside the receipts of the reprojections.
    "reprojection": r"(?!f\d{5,7}/|flow/|render/|panorama/)[A-Za-z0-9_.-]+",
    # Of an export: nothing for the views, or a reprojection's name and a slash.
    "source": r"((?!f\d{5,7}/)[A-Za-z0-9_.-]+/)?",
    "format": "[a-z0-9_]+",
    "first": r"\d+",
    "end": r"\d+",
    "family": one_of(BUILD.family_names),
    "batch": r"(seeds|models)_\d+_(of_)?\d+",
}


wildcard_constraints:
    **CONSTRAINTS,


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


def of_build(question):
    """Return an input function: it returns what a function of the build says of the job."""
    return lambda wildcards: asked(question, wildcards)


def of_dataset(attribute):
    """Return an input function: it returns an attribute of the job's dataset.

    A file that the dataset lacks is an empty list.
    """
    return of_build(lambda names: attrgetter(attribute)(BUILD.dataset(names)) or [])


def of_first(attribute):
    """Return an input function: an attribute of the dataset whose views are the scene's probes."""

    def of_probed(names):
        return attrgetter(attribute)(BUILD.first_of_scene(names["scene"])) or []

    return of_build(of_probed)


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
