# What a light field is worth to whoever walks inside it; asked for by name, no part of a dataset.


def reach(dataset):
    """Return how far a rig's cameras are from their middle, in metres."""
    places = [pose.position for pose in dataset.rig.poses()]
    middle = [sum(axis) / len(places) for axis in zip(*places)]
    return max(math.dist(place, middle) for place in places)


def held_out(dataset):
    """Return the scene's chosen datasets whose cameras are all nearer together than a light field's.

    A rig whose cameras span no surface has nothing between them.
    """
    if dataset.rig.cells() is None:
        return []
    return [
        other
        for other in CHOSEN
        if other.scene_folder == dataset.scene_folder
        and other.rig.cells() is not None
        and reach(other) < reach(dataset)
    ]


def truth_words(wildcards):
    """Return the words that name the datasets with which synthesised views are compared."""
    truths = held_out(dataset_of(wildcards))
    return (
        shlex.join(["--truth", *(truth.folder for truth in truths)]) if truths else ""
    )


def truth_records(wildcards):
    """Return the records of those datasets' views."""
    truths = held_out(dataset_of(wildcards))
    return [record for truth in truths for record in truth.records("render")]


rule measure_synthesis:
    input:
        records=lambda wildcards: dataset_of(wildcards).records("render"),
        truth=truth_records,
        lightfield=f"{DATASET}/lightfield.json",
    output:
        multiext(
            f"{RESULTS}/benchmarks/synthesis/{{scene}}/{{rig}}", ".csv", ".svg", ".png"
        ),
    log:
        log_of("{scene}/{rig}/synthesis"),
    conda:
        ENVIRONMENT
    resources:
        mem_mb=4000,
    params:
        dataset=lambda wildcards, input: str(Path(input.lightfield).parent),
        truth=truth_words,
        stem=lambda wildcards, output: str(Path(output[0]).with_suffix("")),
    message:
        "Measuring how well views of {wildcards.scene}/{wildcards.rig} are synthesised"
    shell:
        f"python {SCRIPTS}/synthesis_quality.py"
        " {params.dataset} {params.truth} --output {params.stem} > {log} 2>&1"


rule synthesis:
    input:
        [
            f"{RESULTS}/benchmarks/synthesis/{dataset.scene_folder}/{dataset.rig_folder}.csv"
            for dataset in CHOSEN
            if dataset.depth
        ],
