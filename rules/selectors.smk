# What single rules ask for: inputs, resources and arguments that take more than a look at a dataset.
import shlex
from pathlib import Path

from lightfield.planning.cost import cost, shard_threads


def cost_at(stage, wildcards):
    """Return the cost of a dataset's job at a stage."""
    return asked(lambda names: BUILD.job_cost(stage, names), wildcards)


def memory_of(stage):
    """Return the resource function of a stage's memory in MB. Each further attempt gets more."""
    return of_each_shard(
        lambda wildcards, attempt: cost_at(stage, wildcards).megabytes(attempt)
    )


@of_each_shard
def threads_of_shard(wildcards):
    """Return the cores of each shard, so that the shards at work fit this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = cost_at("render", wildcards).memory_bytes
    return shard_threads(ALL_CORES, shards, need, MEMORY)


@of_each_shard
def stall_seconds(wildcards):
    """Return the seconds after which a view counts as hung.

    On this machine it is 0, which means never: the user may suspend and continue a build.
    """
    a_view = cost("render", asked(BUILD.dataset, wildcards), views=1)
    return a_view.stall_seconds if RUNS_ELSEWHERE else 0


def blend_of(wildcards):
    """Return a scene's .blend. A user's own file is on the machine that runs Snakemake."""
    dataset = asked(BUILD.scene, wildcards)
    return local(dataset.blend) if dataset.source.blend else dataset.blend or []


def status_arguments(wildcards):
    """Return the arguments that name each chosen dataset and family to scripts/status.py."""
    arguments = []
    for dataset in CHOSEN:
        reprojections = ",".join(dataset.reprojections)
        arguments += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
    for folder, batches in BUILD.batches.items():
        members = sum(map(len, batches.values()))
        arguments += ["--family", folder, str(members)]
    return shlex.join(arguments)


def advice_arguments():
    """Return the arguments that name the files of `error_vs_time` to scripts/plan.py."""
    arguments = []
    for name, scene in {d.sequence_name: d.scene_name for d in CHOSEN}.items():
        file = f"{RESULTS}/benchmarks/error_vs_time/{scene}.json"
        if Path(file).exists():
            arguments += ["--advice", name, file]
    return shlex.join(arguments)


def verify_command(wildcards):
    """Return the command that verifies all folders. Without any, it does nothing.

    With a store, these are the folders of finished datasets: no list has the checksums of others.
    The ledger does not know what other machines made.
    """
    if STORE:
        folders = shlex.join(paths.folder for paths in finished_in_store())
        return f"python {SCRIPTS}/verify.py {folders}" if folders else ":"
    folders = shlex.join(BUILD.verified_folders)
    return f"python {SCRIPTS}/verify.py {folders} --work {WORK}"
