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


@cache
def failing_nodes(record, attempt):
    """Return the nodes that a shard avoids, by its journal and those of its dataset's shards.

    In the first attempt, only the other journals count, because there may be thousands of shards.
    """
    folder = Path(record).parent
    shard_journal = Path(record).with_suffix(JOURNAL_SUFFIX)
    other_journals = dict(journals(folder, time.monotonic() // JOURNALS_AGE))
    other_journals.pop(shard_journal, None)
    runs = []
    if attempt > 1 and shard_journal.exists():
        runs = journal.read(shard_journal)
    return journal.avoided(runs, other_journals.values())


# Seconds. If a thousand shards fail at once, they share one reading of all journals.
JOURNALS_AGE = 60


@lru_cache(maxsize=8)
def journals(folder, _period):
    """Return the runs in each journal of a folder. Reads them once in each period."""
    return {path: journal.read(path) for path in folder.glob(journal.JOURNALS)}


@of_each_shard
def avoided_nodes(wildcards, attempt):
    """Return Slurm's arguments that exclude the nodes to avoid, after the user's arguments."""
    arguments = [given_slurm_extra()] if given_slurm_extra() else []
    if not RUNS_HERE:
        dataset = dataset_of(wildcards)
        bounds = (wildcards.first, wildcards.end) if attempt > 1 else (0, 0)
        nodes = failing_nodes(dataset.record("render", *bounds), attempt)
        if nodes:
            arguments.append(f"--exclude={','.join(nodes)}")
    # Slurm's executor refuses None for jobs of a group.
    return " ".join(arguments)
