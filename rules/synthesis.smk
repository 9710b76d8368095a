# What a light field is worth to whoever walks inside it; asked for by name, no part of a dataset.

import numpy as np


def reach(dataset):
    """Return how far a rig's cameras are from their middle, in metres."""
    places = np.array([pose.position for pose in dataset.rig.poses()])
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())


def held_out(dataset):
    """Return the dataset whose cameras are between those of a light field, None if none is.

    Of the scene's chosen datasets that is the one whose cameras reach least far. A rig whose
    cameras span no surface has no inside.
    """
    scene = [other for other in CHOSEN if other.scene_folder == dataset.scene_folder]
    around = [other for other in scene if other.rig.cells() is not None]
    if dataset not in around:
        return None
    inner = min(around, key=reach)
    return inner if reach(inner) < reach(dataset) else None


def truth_words(wildcards):
    truth = held_out(dataset_of(wildcards))
    return ["--truth", truth.folder] if truth else []


def truth_records(wildcards):
    truth = held_out(dataset_of(wildcards))
    return truth.records("render") if truth else []


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
        dataset=DATASET,
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
