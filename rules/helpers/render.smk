# What the rules of render.smk ask of the configuration.


@of_each_shard
def shard_threads(wildcards):
    """Give each shard so many cores that what runs at once fits this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = dataset_of(wildcards).estimate.view_memory_bytes
    return memory.threads(workflow.cores or 1, shards, need, MEMORY)


@of_each_shard
def shard_memory(wildcards, attempt):
    """Ask for the memory in MB that a shard takes, and for more where that was too little."""
    return math.ceil(dataset_of(wildcards).estimate.view_memory_bytes / 1e6) * attempt


@of_each_shard
def shard_minutes(wildcards):
    """Allow a shard several times its estimated time, and never less than half an hour."""
    views = int(wildcards.end) - int(wildcards.first)
    seconds = views * dataset_of(wildcards).estimate.view_seconds
    return 30 + math.ceil(5 * seconds / 60)


@of_each_shard
def stall_seconds(wildcards):
    """Return after how long a view is taken to hang: ten times what one core needs, and more.

    On this machine, where a build may be stopped and continued by hand, none is.
    """
    seconds = dataset_of(wildcards).estimate.view_seconds
    return 1800 + math.ceil(10 * seconds) if RUNS_ELSEWHERE else 0


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
    words = [given_slurm_extra()] if given_slurm_extra() else []
    if not RUNS_HERE:
        dataset = dataset_of(wildcards)
        bounds = (wildcards.first, wildcards.end) if attempt > 1 else (0, 0)
        nodes = failing_nodes(dataset.record("render", *bounds), attempt)
        words += [f"--exclude={','.join(nodes)}"] if nodes else []
    # Of a group's jobs Slurm's executor takes no None.
    return " ".join(words)
