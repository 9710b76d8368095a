# Functions for the rules of rig.smk.


def free_places_settings(dataset):
    """Return the settings of a random rig's places. Ends the run for another rig."""
    if not dataset.places:
        sys.exit(
            f"error: {dataset.paths.work}/places.json: is for rigs of type random; "
            f"{dataset.rig_name} has type {dataset.rig.type}"
        )
    settings = FreePlacesSettings.of(
        rig=dataset.rig,
        frame=dataset.source.frame,
        scene_name=dataset.source.scene_name,
        view_layers=dataset.source.view_layers,
    )
    return settings.as_json()


def poses_sum(dataset):
    """Return the SHA-256 of a rig's file of poses. None for other rigs."""
    return sha256(dataset.rig.file) if isinstance(dataset.rig, Poses) else None


def lightfield_settings(dataset):
    """Return the settings of a dataset's lightfield.json."""
    settings = LightfieldSettings.of_capture(
        dataset,
        flow=bool(dataset.flow),
        fingerprint=dataset.builder_fingerprint,
        poses_sha256=poses_sum(dataset),
    )
    return settings.as_json()


def split_rigs(wildcards):
    """Return the light fields of those rigs of a scene that have a split."""
    return [
        dataset.paths.lightfield
        for dataset in DATASETS.values()
        if dataset.scene_folder == wildcards.scene and dataset.splits
    ]


def splits_settings(wildcards):
    """Return the settings file of a scene's splits, which lists its rigs."""
    path = f"{WORK}/{wildcards.scene}/settings/splits.json"
    return settings_file(path, {"lightfields": split_rigs(wildcards)})
