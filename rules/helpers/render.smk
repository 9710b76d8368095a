# Functions for the rules of render.smk.


@of_each_shard
def shard_threads(wildcards):
    """Return the cores of each shard, so that the shards at work fit this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = dataset_of(wildcards).estimate.view_memory_bytes
    return memory.threads(workflow.cores or 1, shards, need, MEMORY)


@of_each_shard
def shard_memory(wildcards, attempt):
    """Return the memory of a shard in MB. Each further attempt gets more."""
    return math.ceil(dataset_of(wildcards).estimate.view_memory_bytes / 1e6) * attempt


@of_each_shard
def shard_minutes(wildcards):
    """Return a shard's time limit: several times its estimate, and at least half an hour."""
    views = int(wildcards.end) - int(wildcards.first)
    seconds = views * dataset_of(wildcards).estimate.view_seconds
    return 30 + math.ceil(5 * seconds / 60)


@of_each_shard
def stall_seconds(wildcards):
    """Return the seconds after which a view counts as hung: ten times its estimate, and more.

    On this machine it is 0, which means never: the user may suspend and continue a build.
    """
    seconds = dataset_of(wildcards).estimate.view_seconds
    return 1800 + math.ceil(10 * seconds) if RUNS_ELSEWHERE else 0
