# What single rules ask for: inputs, resources and arguments that take more than a look at a dataset.
import os
import shlex
import sys
from pathlib import Path

from lightfield.core.gpus import CUDA
from lightfield.planning.cost import cost, shard_threads


def cost_at(stage, wildcards):
    """Return the cost of a dataset's job at a stage."""
    return asked(lambda names: BUILD.job_cost(stage, names), wildcards)


def memory_of(stage):
    """Return the resource function of a stage's memory in MB. Each further attempt gets more."""
    return lambda wildcards, attempt: cost_at(stage, wildcards).megabytes(attempt)


def threads_of_shard(wildcards):
    """Return the cores of each shard, so that the shards at work fit this machine."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN_DATASETS)
    need = cost_at("render", wildcards).memory_bytes
    threads = shard_threads(ALL_CORES, shards, need, MEMORY)
    # Cycles may be unable to use an AMD GPU, unless the user names its kind.
    used_gpus = [
        each for each in LOCAL_GPUS if each.variable == CUDA or SETTINGS.device == "hip"
    ]
    if used_gpus:
        # On each GPU one shard renders, and another one starts. More would only wait.
        threads = max(threads, ALL_CORES // (2 * len(used_gpus)))
    return threads


def stall_seconds(wildcards):
    """Return the seconds after which a view counts as hung.

    On this machine it is 0, which means never: the user may suspend and continue a build.
    """
    a_view = cost("render", asked(BUILD.dataset, wildcards), views=1)
    return 0 if RUNS_HERE else a_view.stall_seconds


def blend_of(wildcards):
    """Return a scene's .blend. A user's own file is on the machine that runs Snakemake."""
    dataset = asked(BUILD.scene, wildcards)
    return local(dataset.blend) if dataset.source.blend else dataset.blend or []


def light_of(wildcards):
    """Return the picture that lights a scene's model. Empty for a light that has a name."""
    light_file = asked(BUILD.scene, wildcards).source.light_file
    return local(light_file) if light_file else []


def status_arguments(wildcards):
    """Return the arguments that name each chosen dataset and family to scripts/status.py."""
    arguments = []
    for dataset in CHOSEN_DATASETS:
        reprojections = ",".join(dataset.reprojections)
        arguments += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
        if not STORE and CHECK.will_run(
            f"{RECEIPTS}/{dataset.name}/lightfield{SUFFIX}"
        ):
            arguments += ["--outdated", dataset.name]
    for folder, batches in BUILD.batches.items():
        members = sum(map(len, batches.values()))
        arguments += ["--family", folder, str(members)]
    return shlex.join(arguments)


def equal_error_arguments():
    """Return the arguments that tell scripts/plan.py what was measured of each chosen scene.

    A calibration tells more than `error_vs_time`.
    """
    arguments = []
    for name, dataset in {d.sequence_name: d for d in CHOSEN_DATASETS}.items():
        advice = f"{RESULTS}/benchmarks/error_vs_time/{dataset.scene_name}.json"
        if dataset.calibration:
            seconds = dataset.paths.calibration_seconds
            arguments += ["--calibration", name, dataset.calibration, seconds]
        elif Path(advice).exists():
            arguments += ["--advice", name, advice]
    return shlex.join(arguments)


def verify_command(wildcards):
    """Return the command that verifies all folders. Without any, it does nothing.

    With a store, it takes the finished datasets: no list has the checksums of others.
    """
    if not STORE:
        folders = shlex.join(BUILD.verified_folders)
        return f"python {SCRIPTS}/verify.py {folders} --work {WORK}"
    homes = [dataset.paths for dataset in CHOSEN_DATASETS]
    homes += [d.sequence_paths for d in CHOSEN_DATASETS if d.sequence_exports]
    folders = shlex.join(
        paths.folder
        for paths in dict.fromkeys(homes)
        if Path(paths.sums).name in STORAGE.names(paths.folder)
    )
    take = (
        f"python {SCRIPTS}/take_dataset.py --store {shlex.quote(STORE)} --work {WORK}"
    )
    return f"{take} {folders}" if folders else ":"


def consumers(wildcards):
    """Return the file that says that the consumers' environment is complete."""
    if not (CONSUMERS / "complete").exists():
        sys.exit(
            f"error: learn: torch is missing: set up {os.path.relpath(CONSUMERS)} "
            f"with `make -C {shlex.quote(os.path.relpath(FOLDER))} .venv-consumers/complete`"
        )
    return ancient(str(CONSUMERS / "complete"))
