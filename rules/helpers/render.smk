# Functions for the rules of render.smk.


def shard_cost(wildcards):
    """Return the cost of rendering a shard."""
    views = int(wildcards.end) - int(wildcards.first)
    return cost("render", dataset_of(wildcards), views)


@of_each_shard
def threads_of_shard(wildcards):
    """Return the cores of each shard, so that the shards at work fit this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = shard_cost(wildcards).memory_bytes
    return shard_threads(workflow.cores or 1, shards, need, MEMORY)


@of_each_shard
def shard_memory(wildcards, attempt):
    """Return the memory of a shard in MB. Each further attempt gets more."""
    return shard_cost(wildcards).megabytes(attempt)


@of_each_shard
def shard_minutes(wildcards):
    """Return a shard's time limit."""
    return shard_cost(wildcards).most_minutes


@of_each_shard
def stall_seconds(wildcards):
    """Return the seconds after which a view counts as hung.

    On this machine it is 0, which means never: the user may suspend and continue a build.
    """
    a_view = cost("render", dataset_of(wildcards), views=1)
    return a_view.stall_seconds if RUNS_ELSEWHERE else 0
