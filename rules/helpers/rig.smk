# What the rules of rig.smk ask of the configuration.


def free_rig(dataset):
    """Return what a random rig says of its places."""
    return dataset.rig.model_dump(
        mode="json", exclude_unset=True, exclude={"camera", "split"}
    )


def poses_sum(dataset):
    """Return the SHA-256 of the file from which a rig has its poses; None of other rigs."""
    return sha256(dataset.rig.file) if isinstance(dataset.rig, Poses) else None


def split_rigs(wildcards):
    """Return the light fields of a scene whose rigs say what their views are for."""
    return [
        f"{dataset.folder}/lightfield.json"
        for dataset in DATASETS.values()
        if dataset.scene_folder == wildcards.scene and dataset.splits
    ]


def splits_settings(wildcards):
    """Return the settings file of a scene's splits: which rigs they are of."""
    path = f"{WORK}/{wildcards.scene}/settings/splits.json"
    return settings_file(path, {"lightfields": split_rigs(wildcards)})
