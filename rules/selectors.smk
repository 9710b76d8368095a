# What single rules ask for: inputs, resources and arguments that take more than a look at a dataset.


def shard_cost(wildcards):
    """Return the cost of rendering a shard."""
    views = int(wildcards.end) - int(wildcards.first)
    return cost("render", dataset_of(wildcards), views)


@of_each_shard
def threads_of_shard(wildcards):
    """Return the cores of each shard, so that the shards at work fit this machine's memory."""
    shards = sum(len(dataset.shards) for dataset in CHOSEN)
    need = shard_cost(wildcards).memory_bytes
    return shard_threads(ALL_CORES, shards, need, MEMORY)


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


def panorama_memory(wildcards, attempt):
    """Return the memory of the panorama in MB. Each retry requests more."""
    return cost("render_panorama", dataset_of(wildcards)).megabytes(attempt)


def batch_threads(wildcards):
    """Return the cores of each batch: one, or more if there are fewer batches than cores."""
    count = sum(map(len, BUILD.batches.values()))
    return max(1, ALL_CORES // count)


def blend_of(wildcards):
    """Return a scene's .blend. A user's own file is on the machine that runs Snakemake."""
    dataset = scene_of(wildcards)
    return local(dataset.blend) if dataset.source.blend else dataset.blend or []


def packed_sums(wildcards):
    """Return the checksums that exist when everything in an archive is finished.

    With a store, also return its files and their lists.
    """
    datasets = asked(BUILD.rig, wildcards)
    files = [dataset.paths.sums for dataset in datasets]
    if datasets[0].sequence_exports:
        files.append(datasets[0].sequence_sums)
    if STORE:
        if datasets[0].sequence_exports:
            files.append(datasets[0].sequence_paths.validation)
            files += datasets[0].sequence_exports
        for dataset in datasets:
            files += [dataset.paths.validation, *dataset.published]
            files += dataset.all_records
    return files


def status_arguments():
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
    file_of_rig = {}
    for dataset in CHOSEN:
        name = f"{dataset.scene_folder}/{dataset.rig_name}"
        file_of_rig[name] = (
            f"{RESULTS}/benchmarks/error_vs_time/{dataset.scene_name}.json"
        )
    arguments = []
    for name, file in file_of_rig.items():
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
